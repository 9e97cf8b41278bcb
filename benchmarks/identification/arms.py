"""Fits of whole arms by an independent model: do intervals hold, how far off are unseen episodes, what is named.

The arms (`tests/reference/arm_rig.py`) share no code with the package: three robots, two families of bus servos, masses
within 15 %, zeros within 2 degrees, supply, friction and latencies drawn, a loop of 30 Hz whose stamps are k/30. The
fit begins at the usual servos, nominal masses and the nominal voltage; three episodes of 20 s, the last one unseen.
    python benchmarks/identification/arms.py [SEEDS [FIRST]] [--gain]     --gain: a P register of half in one joint
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import arm_rig as rig
from reference.arm_rig_fits import Judged, judged

NORMAL = "normal"


def one(truth: rig.Truth, **more: object) -> Judged:
    """Return a fit of an arm, judged."""
    with tempfile.TemporaryDirectory() as folder:
        return judged(truth, Path(folder), **more)


def row(label: str, fits: list[Judged]) -> str:
    """Return the line of a robot and family."""
    told = [x for fit in fits for name, x in fit.held.items() if fit.methods[name] == NORMAL]
    other = [x for fit in fits for name, x in fit.held.items() if fit.methods[name] != NORMAL]
    missed = Counter(name.split(": ")[-1].split(".")[-1] for fit in fits for name, x in fit.held.items() if not x)
    worse = [fit.unseen / fit.left for fit in fits]
    return (f"  {label:24} {100.0 * np.mean(told) if told else np.nan:5.1f} % of {len(told):3d}   "
            f"{100.0 * np.mean(other) if other else np.nan:5.1f} % of {len(other):3d}   "
            f"{np.degrees(np.median([f.unseen for f in fits])):5.2f} deg, {np.median(worse):4.2f} ({max(worse):4.2f})  "
            f"{np.mean([f.seconds for f in fits]):5.0f} s   "
            + ", ".join(f"{name} {count}" for name, count in missed.most_common(5)))


def main(seeds: int = 3, first: int = 100, *, gain: bool = False) -> None:
    print(f"arms of {seeds} seeds each; intervals told by the episodes, and by beliefs, that hold; unseen episodes: "
          "rms, times what counts and clock leave of the truth itself (worst); CPU time; what was missed")
    named = []
    for robot in rig.ROBOTS.values():
        for family in rig.FAMILIES:
            fits = []
            for seed in range(first, first + seeds):
                truth = rig.random_truth(robot, family, seed)
                if gain:
                    truth = rig.with_wrong_gain(truth, seed % len(robot.links), 0.5)
                fits.append(one(truth, each=gain))
                if gain:
                    named.append(fits[-1].causes[:1] == ("proportional gain",))
            print(row(f"{robot.name}, {family}", fits), flush=True)
    if gain:
        print(f"  the gain is named first in {sum(named)} of {len(named)}")


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    main(*numbers, gain="--gain" in sys.argv)
