"""Part 5: how long fits take. Good ones beside those of another checkout, bad ones beside their own without trials.

    python benchmarks/identification/speed.py [CHECKOUT]

Both fit the same logs in processes of their own, in turn; the better of two times counts. Without a checkout only the
trials are measured.
"""

import json
import os
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from reference import rig_draws as draws
from reference.rig_defects import with_defect
from reference.rig_fits import fitted

ROOT = Path(__file__).resolve().parents[2]
GOOD = ("white noise", "AR(1) 0.8", "counts", "short logs", "stamps 2 ms")
BAD = ("load friction", "play", "coast", "digital P servo", "reversed sign", "wrong voltage")
STRENGTH = 0.8
SEEDS = 2
ROUNDS = 2


def fits(kind: str, seeds: int) -> dict[str, float]:
    """Fit all logs of a kind once, and return the seconds of each fit."""
    found = {}
    for name in GOOD if kind == "good" else BAD:
        for seed in range(seeds):
            truth = draws.random_truth(seed)
            logs = draws.taken(truth, name) if kind == "good" else with_defect(truth, name, STRENGTH)
            more = {"diagnose": False} if kind == "untried" else {}
            if not found:
                fitted(truth, logs, **more)  # what is compiled, and the caches
            began = clock.perf_counter()
            fitted(truth, logs, **more)
            found[f"{name} {seed}"] = clock.perf_counter() - began
    return found


def timed(kind: str, checkout: Path, seeds: int) -> dict[str, float]:
    """Fit in a process of its own, with the package of a checkout."""
    done = subprocess.run([sys.executable, __file__, "child", kind, str(seeds)], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(checkout / "src")}, check=True)
    return dict(json.loads(done.stdout))


def compared(title: str, sides: dict[str, tuple[str, Path]], seeds: int) -> None:
    """Print the times of two sides, and their ratio, name by name."""
    one, other = sides
    times: dict[str, dict[str, list[float]]] = {one: {}, other: {}}
    for _ in range(ROUNDS):
        for side, (kind, checkout) in sides.items():
            for name, seconds in timed(kind, checkout, seeds).items():
                times[side].setdefault(name, []).append(seconds)
    print(f"  {title:18} {one:>14} {other:>14}   ratio, worst of {seeds} benches", flush=True)
    totals = []
    for name in dict.fromkeys(key.rsplit(" ", 1)[0] for key in times[one]):
        a, b = (np.array([min(times[side][f"{name} {k}"]) for k in range(seeds)]) for side in (one, other))
        totals.append((a.sum(), b.sum()))
        print(f"  {name:18} {a.mean():12.2f} s {b.mean():12.2f} s {a.sum() / b.sum():7.2f} {(a / b).max():7.2f}",
              flush=True)
    a, b = np.sum(totals, axis=0)
    print(f"  {'all':18} {'':14} {'':14} {a / b:7.2f}", flush=True)


def main(seeds: int = SEEDS, checkout: Path | None = None) -> None:
    if checkout is not None:
        compared("verdict is good", {"this": ("good", ROOT), "the other": ("good", checkout)}, seeds)
    compared("verdict is bad", {"with trials": ("bad", ROOT), "without": ("untried", ROOT)}, seeds)


if __name__ == "__main__":
    if sys.argv[1:2] == ["child"]:
        print(json.dumps(fits(sys.argv[2], int(sys.argv[3]))))
    else:
        main(checkout=Path(sys.argv[1]).resolve() if sys.argv[1:] else None)
