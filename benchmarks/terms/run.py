"""What every term of the pulse servo costs, in a batch and in plain Python; what a bus costs; what is off does not; and
what digital servos cost with what theirs have, alone and on shared supplies; what friction that fades with the speed
costs, over its numbers; what each form of running lanes is worth.

`run.py` does all parts and draws the picture; `run.py batch bus` only those named. The picture needs `batch` and
`single`.
"""

import sys
from importlib import import_module

import picture

PARTS = ("batch", "kernels", "single", "bus", "off", "digital", "shared", "stribeck", "forms")


def main() -> None:
    factors = {}
    for part in sys.argv[1:] or PARTS:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        factors[part] = import_module(part).main()
        print(flush=True)
    if {"batch", "single"} <= factors.keys():
        picture.draw(factors["batch"], factors["single"])


if __name__ == "__main__":
    main()
