"""Fits that are stopped on their way: how wide their intervals are beside those of the finished fit.

    python benchmarks/identification/stopped.py [FITS [FIRST]]

The fits of `time_left.py`, each stopped after a tenth, a third and two thirds of what it tells.
"""

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import rig_draws as draws
from reference import rig_fits
from reference.rig_defects import with_defect

SHARES = (0.1, 0.33, 0.67)


def fitted(fit: int, progress: Any) -> Any:
    """Return a fit of logs of the independent bench."""
    truth = draws.random_truth(fit)
    found = (draws.taken(truth, list(draws.CONDITIONS)[fit % len(draws.CONDITIONS)]) if fit % 2 else
             with_defect(truth, ("load friction", "play")[fit // 2 % 2], 0.5))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return rig_fits.fitted(truth, found, progress=progress)


def main(count: int = 4, first: int = 300) -> None:
    print("  fit  stopped   intervals   wider than the finished one's   least, median ratio   hold its estimate")
    for fit in range(first, first + count):
        told: list[float] = []
        whole = fitted(fit, lambda share, text: told.append(share))  # noqa: B023
        ends = whole.intervals()
        for part in SHARES:
            left = [round(part * len(told))]

            def tell(share: float, text: str) -> None:
                left[0] -= 1  # noqa: B023
                if left[0] < 0:  # noqa: B023
                    raise KeyboardInterrupt

            short = fitted(fit, tell)
            ratios, holds = [], 0
            for name, (lower, upper, _) in short.intervals().items():
                if lower == lower and ends[name].lower == ends[name].lower:
                    ratios.append((upper - lower) / (ends[name].upper - ends[name].lower))
                    holds += lower <= whole.estimates[name] <= upper
            least, middle = (min(ratios), float(np.median(ratios))) if ratios else (np.nan, np.nan)
            print(f"  {fit}  at {part:4.0%} {len(ratios):8d} {sum(each > 1.0 for each in ratios):18d} "
                  f"{least:25.2f} {middle:7.2f} {holds:16d}", flush=True)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
