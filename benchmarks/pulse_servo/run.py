"""Pulse-level servos in batches beside MuJoCo, JAX, C and the machine's peak; one servo; cost; start-up.

`run.py` does all four parts; `run.py batch single` only those named. Further packages for the peers: mujoco, jax.
"""

import sys
from importlib import import_module

PARTS = ("batch", "single", "cost", "start")


def main() -> None:
    for part in sys.argv[1:] or PARTS:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        import_module(part).main()
        print(flush=True)


if __name__ == "__main__":
    main()
