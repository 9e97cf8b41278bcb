"""Part 3: how often 95 % intervals hold the truth, for logs of an independent bench under ten conditions.

The bench (`tests/reference/rig.py`) shares no code with the package. The search begins at a servo file that is off by
10 to 30 %, without priors; six parameters, the delay and the angle offset are judged: eight intervals a fit. Intervals
without ends (undetermined, at a bound) are counted apart.

    python benchmarks/identification/interval_coverage.py [N | SEED ...] [CONDITION ...] [left out]

The last table is of benches with what servo files leave out (`rig_draws.with_left_out`): how many intervals hold, and
how many times as wide they are as those of a fit that is given what is left out.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import rig_draws as draws
from reference.rig_fits import NAMES, Judged, judged

SEEDS = 10
GIVEN = 8  # benches that are fitted with what is left out given, too
COUNTED = ("output_torque_constant", "electronics.stretcher_gain", "electronics.deadband", "output_coulomb_torque",
           "output_inertia")


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


def left_out(seeds: Sequence[int]) -> None:
    """Print how intervals hold of which the servo file leaves something out, number by number."""
    print("  left out, and rounded to 1 us; without trials")
    fits = [judged(draws.LEFT_OUT, seed, diagnose=False) for seed in seeds]
    given = [judged(draws.LEFT_OUT, seed, given=True, diagnose=False) for seed in [*seeds][:GIVEN]]
    ratios: dict[str, list[float]] = {}
    for name in NAMES:
        held = [fit.held[name] for fit in fits if name in fit.held]
        off = [abs(fit.off[name]) for fit in fits if name in fit.off]
        ratios[name] = [fit.half[name] / known.half[name] for fit, known in zip(fits, given, strict=False)
                        if name in fit.half and known.half.get(name, 0.0) > 0.0]
        print(f"  {name:28} {sum(held):3d} of {len(held):3d}, off by {np.median(off):4.2f} half widths, at most "
              f"{max(off):4.2f}   {np.median(ratios[name]):5.2f} times as wide as given")
    for words, some in (("left out", fits), ("given", given)):
        held = [held for fit in some for name, held in fit.held.items() if name in COUNTED]
        print(f"  {words:10} {', '.join(name.split('.')[-1] for name in COUNTED)}: {100.0 * np.mean(held):.1f} % of "
              f"{len(held)}; {100.0 * np.mean([fit.holds for fit in some]):.0f} % of {len(some)} end in noise, "
              f"{np.median([fit.seconds for fit in some]):.1f} s in the median")
    print(f"  {np.median([ratio for name in COUNTED for ratio in ratios[name]]):.2f} times as wide in the median")


def main(*seeds: int, only: tuple[str, ...] = ()) -> None:
    chosen = range(seeds[0] if seeds else SEEDS) if len(seeds) < 2 else seeds
    print(f"{len(NAMES)} intervals of {len(chosen)} random benches, four logs each, begun 10 to 30 % off")
    print("  condition       held        of intervals  residual, time on the processors; what was missed")
    all_held: list[bool] = []
    for condition in [one for one in only or draws.CONDITIONS if one != draws.LEFT_OUT]:
        fits = [judged(condition, seed) for seed in chosen]
        all_held += [x for fit in fits for x in fit.held.values()]
        print(row(condition, fits), flush=True)
    if all_held:
        share = np.mean(all_held)
        print(f"  all             {100.0 * share:5.1f} % of {len(all_held):3d}, ± "
              f"{100.0 * np.sqrt(0.95 * 0.05 / len(all_held)):.1f} % by chance")
    if not only or draws.LEFT_OUT in only:
        left_out(chosen)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:] if word.isdecimal()),
         only=tuple(word for word in sys.argv[1:] if not word.isdecimal()))
