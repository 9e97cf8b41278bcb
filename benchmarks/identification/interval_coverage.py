"""Part 3: how often 95 % intervals hold the truth, for logs of an independent bench under ten conditions.

The bench (`tests/reference/rig.py`) shares no code with the package. The search begins at a servo file that is off by
10 to 30 %, without priors; six parameters, the delay and the angle offset are judged: eight intervals a fit. Intervals
without ends (undetermined, at a bound) are counted apart.
"""

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import rig_draws as draws
from reference.rig_fits import NAMES, Judged, judged

SEEDS = 10


def row(condition: str, fits: list[Judged]) -> str:
    """Return the line of a condition."""
    held = [x for fit in fits for x in fit.held.values()]
    endless = Counter(f"{name.split('.')[-1]} {why}" for fit in fits for name, why in fit.endless.items())
    missed = Counter(name.split(".")[-1] for fit in fits for name, x in fit.held.items() if not x)
    words = ", ".join(f"{name} {count}" for name, count in missed.most_common())
    share = f"{100.0 * np.mean(held):5.1f} %" if held else "   none"
    return (f"  {condition:15} {share} of {len(held):3d}  {1e3 * np.median([f.rms for f in fits]):6.2f} mrad "
            f"{np.mean([f.seconds for f in fits]):6.1f} s   {words}"
            + (f"   without ends: {', '.join(f'{k} {n}' for k, n in endless.items())}" if endless else ""))


def main(*seeds: int, only: tuple[str, ...] = ()) -> None:
    chosen = range(seeds[0] if seeds else SEEDS) if len(seeds) < 2 else seeds
    print(f"{len(NAMES)} intervals of {len(chosen)} random benches, four logs each, begun 10 to 30 % off")
    print("  condition       held        of intervals  residual, time on the processors; what was missed")
    all_held: list[bool] = []
    for condition in only or draws.CONDITIONS:
        fits = [judged(condition, seed) for seed in chosen]
        all_held += [x for fit in fits for x in fit.held.values()]
        print(row(condition, fits), flush=True)
    share = np.mean(all_held)
    print(f"  all             {100.0 * share:5.1f} % of {len(all_held):3d}, ± "
          f"{100.0 * np.sqrt(0.95 * 0.05 / len(all_held)):.1f} % by chance")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:] if word.isdecimal()),
         only=tuple(word for word in sys.argv[1:] if not word.isdecimal()))
