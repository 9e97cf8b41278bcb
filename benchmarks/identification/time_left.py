"""The time left that ten fits tell as they go: by how much it rises, and how far it is off.

    python benchmarks/identification/time_left.py [FITS]

A fit of logs of the independent bench, of servos and conditions of all kinds; time is CPU time, so that others on the
machine do not count. What is left is told from 1 s on: what has been done, times what is left over what is done.
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

FROM = 1.0  # s
AT = (0.1, 0.25, 0.5, 0.75)  # of the whole time


def told(fit: int) -> list[tuple[float, float]]:
    """Return when a fit told which share is done; the last is its end."""
    began, said = clock.process_time(), [(0.0, 0.0)]

    def tell(share: float, text: str) -> None:
        said.append((clock.process_time() - began, share))

    if fit % 5 == 4:
        servo = bus_rig.truth(fit)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            st.identify(bus_rig.logs(servo, fit), bus_rig.file_of(servo, fit), st.DigitalServo, free=bus_rig.FREE,
                        priors=None, progress=tell)
    else:
        truth = draws.random_truth(fit)
        found = (draws.taken(truth, list(draws.CONDITIONS)[fit % len(draws.CONDITIONS)]) if fit % 2 else
                 with_defect(truth, ("load friction", "play")[fit // 2 % 2], 0.5))
        rig_fits.fitted(truth, found, progress=tell, compare_with=("slew", "M1"))
    said.append((clock.process_time() - began, 1.0))
    return said


def left(said: list[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and what was said to be left at them."""
    time, share = np.array(said).T
    keep = (time > FROM) & (share > 0.0) & (share < 1.0)
    return time[keep], time[keep] * (1.0 - share[keep]) / share[keep]


def main(count: int = 10) -> None:
    print("CPU time of each fit; what is left as told at shares of it, over what was; by how much it rose at most\n"
          f"  fit   takes   {'   '.join(f'at {share:4.2f}' for share in AT)}   rises")
    for fit in range(count):
        said = told(300 + fit)
        whole, (time, value) = said[-1][0], left(said)
        if len(time) < 2:
            print(f"  {fit:3d} {whole:6.1f} s   too short", flush=True)
            continue
        # time goes on, so what is left may stay only if work turns out larger
        rise = float(np.max(value - np.minimum.accumulate(value)) / whole)
        near = [value[min(np.searchsorted(time, share * whole), len(time) - 1)] / max((1.0 - share) * whole, 1e-9)
                for share in AT]
        print(f"  {fit:3d} {whole:6.1f} s   {'   '.join(f'{one:7.2f}' for one in near)}   {100.0 * rise:4.0f} % of all",
              flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
