"""Identification: the Jacobian of a log beside JAX, and a known servo found again from random starts.

`run.py` does both parts; `run.py jacobian` or `run.py recover` only that one. `run.py recover 2` tries two seeds of
each model instead of ten. JAX is not a dependency of the package; without it a line says so.
"""

import sys
from importlib import import_module

PARTS = ("jacobian", "recover")


def main() -> None:
    words = sys.argv[1:]
    seeds = [int(word) for word in words if word.isdecimal()]
    for part in [word for word in words if not word.isdecimal()] or PARTS:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        import_module(part).main(*seeds if part == "recover" else ())
        print(flush=True)


if __name__ == "__main__":
    main()
