"""Part 4: what is off costs nothing: the plain pulse servo on the fleet of the scenario `pulse_servo`."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "pulse_servo"))
import ours
from common import best
from fleet import random_fleet

LANES, DURATION, THREADS = 4096, 2.0, 2


def main() -> None:
    fleet = random_fleet(LANES, duration=DURATION)
    print(f"{LANES} servos of the scenario pulse_servo, {DURATION:g} s, float64: no term is on")
    for name, run in (("whole call", ours.prepare(fleet, DURATION, "float64")),
                      ("kernels alone", ours.kernels(fleet, DURATION, "float64", THREADS))):
        print(f"{name:20} {LANES * DURATION / best(run, 10):10.2e} servo-s/s")


if __name__ == "__main__":
    main()
