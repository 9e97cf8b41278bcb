"""Identification: the Jacobian of a log beside JAX, a known servo found again, and fits of an independent bench.

`run.py` does all parts; `run.py jacobian recover` only those named. A number behind a part is how many seeds it takes:
`run.py recover 2 coverage 3`. JAX is not a dependency of the package; without it a line says so.
"""

import sys
from importlib import import_module

PARTS = {"jacobian": "jacobian", "recover": "recover", "coverage": "interval_coverage", "defects": "defects",
         "speed": "speed", "times": "times", "arms": "arms", "kitchen": "kitchen"}


def main() -> None:
    words = sys.argv[1:]
    asked = [word for word in words if not word.isdecimal()] or list(PARTS)
    for part in asked:
        if part not in PARTS:
            sys.exit(f"run.py: {part!r} is not one of {', '.join(PARTS)}")
        after = words[words.index(part) + 1:] if part in words else []
        seeds = [int(word) for word in after[:1] if word.isdecimal() and part != "jacobian"]
        import_module(PARTS[part]).main(*seeds)
        print(flush=True)


if __name__ == "__main__":
    main()
