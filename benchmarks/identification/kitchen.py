"""Part 8: how often intervals of 95 % from kitchen tables hold the truth, five kinds with 200 draws each.

The tables (`tests/reference/kitchen_tables.py`) share no code with the package: weights with currents, with speeds and
with sags, voltages with speeds, a dial read both ways; noise and last digits of scale, multimeter, film and protractor.
The servo file is off in what each kind tells. Figures and parameters are judged, each by its own interval.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import kitchen_draws
from reference.kitchen_tables import KINDS

DRAWS = 200


def main(draws: int = DRAWS) -> None:
    print(f"share of {draws} tables of each kind whose interval of 95 % holds the truth")
    for kind in KINDS:
        begun = time.process_time()
        held = kitchen_draws.shares(kind, draws)
        words = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in held.items())
        print(f"  {kind:10} {words}   ({time.process_time() - begun:.1f} s)", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
