"""The time left that ten fits tell as they go: by how much it rises, and how far it is off.

    python benchmarks/identification/time_left.py [FITS [FIRST]]

A fit of logs of the independent bench, of servos and conditions of all kinds; time is CPU time, so that others on the
machine do not count. What is left is told from 1 s on: what has been done, times what is left over what is done. Last
stands what took longer than was said.
"""

import sys
import time as clock
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

import servotwin as st
from reference import bus_rig, rig_fits
from reference import rig_draws as draws
from reference.rig_defects import with_defect
from servotwin.identification.fitting.search.stopping import LONGER, Course

FROM = 1.0  # s
AT = (0.1, 0.25, 0.5, 0.75)  # of the whole time


def told(fit: int) -> list[tuple[float, float, str]]:
    """Return when a fit told which share is done, and what went on; the last is its end."""
    Course.clock = staticmethod(clock.process_time)
    if fit % 5 == 4:
        servo = bus_rig.truth(fit)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            logs, file = bus_rig.logs(servo, fit), bus_rig.file_of(servo, fit)

            def go_on() -> None:
                st.identify(logs, file, st.DigitalServo, free=bus_rig.FREE, priors=None, progress=tell)
    else:
        truth = draws.random_truth(fit)
        found = (draws.taken(truth, list(draws.CONDITIONS)[fit % len(draws.CONDITIONS)]) if fit % 2 else
                 with_defect(truth, ("load friction", "play")[fit // 2 % 2], 0.5))

        def go_on() -> None:
            rig_fits.fitted(truth, found, progress=tell, compare_with=("slew", "M1"))

    began, said = clock.process_time(), [(0.0, 0.0, "")]

    def tell(share: float, text: str) -> None:
        said.append((clock.process_time() - began, share, text))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        go_on()
    return said


def left(said: list[tuple[float, float, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and what was said to be left at them."""
    time, share = np.array([(when, done) for when, done, _ in said]).T
    keep = (time > FROM) & (share > 0.0) & (share < 1.0)
    return time[keep], time[keep] * (1.0 - share[keep]) / share[keep]


def main(count: int = 10, first: int = 300) -> None:
    print("CPU time of each fit; what is left as told at shares of it, over what was; by how much it rose at most\n"
          f"  fit   takes   {'   '.join(f'at {share:4.2f}' for share in AT)}   rises")
    for fit in range(count):
        said = told(first + fit)
        whole, (time, value) = said[-1][0], left(said)
        if len(time) < 2:
            print(f"  {fit:3d} {whole:6.1f} s   too short", flush=True)
            continue
        # time goes on, so what is left may stay only if work turns out larger
        rise = float(np.max(value - np.minimum.accumulate(value)) / whole)
        near = [value[min(np.searchsorted(time, share * whole), len(time) - 1)] / max((1.0 - share) * whole, 1e-9)
                for share in AT]
        longer = ", ".join(dict.fromkeys(text for _, _, text in said if text.endswith(LONGER)))
        said_at = "   ".join(f"{one:7.2f}" for one in near)
        print(f"  {fit:3d} {whole:6.1f} s   {said_at}   {100.0 * rise:4.0f} % of all   "
              f"{longer}", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
