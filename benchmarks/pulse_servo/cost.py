"""Part 3: memory of a million servos, and time against the number of servos and against the time simulated."""

import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import ours
from fleet import random_fleet

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
LANES = (100, 1000, 10_000, 100_000, 1_000_000)
DURATIONS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # s, of 4096 servos
FITTED_LANES, FITTED_DURATION = 1e4, 4.0  # below these the call itself shows


def memory() -> None:
    """Print the peak of a process that simulates a million servos."""
    for dtype in ("float64", "float32"):
        done = subprocess.run([sys.executable, str(HERE / "million.py"), "1000000", dtype], check=True,
                              stdout=subprocess.PIPE, text=True)
        seconds, before, peak = map(float, done.stdout.split())
        print(f"a million servos, 1 s, {dtype}, last angle kept: {seconds:.2f} s, peak of the process {peak:.0f} MiB "
              f"(with 1000 servos {before:.0f} MiB)")


def seconds(lanes: int, duration: float, dtype: str) -> float:
    """Return the time of a whole call [s]."""
    fleet = random_fleet(lanes, duration=duration)
    return best(ours.prepare(fleet, duration, dtype), 2 if lanes * duration > 2e5 else 5)


def slope(x: np.ndarray, y: np.ndarray) -> float:
    """Return the exponent of a power law."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def draw() -> None:
    """Measure both curves, print their slopes and save the picture."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    lanes, durations = np.array(LANES, float), np.array(DURATIONS)
    large, lasting = lanes >= FITTED_LANES, durations >= FITTED_DURATION
    for dtype, mark in (("float64", "o-"), ("float32", "s--")):
        by_lanes = np.array([seconds(n, 1.0, dtype) for n in LANES])
        by_duration = np.array([seconds(4096, t, dtype) for t in DURATIONS])
        a, b = slope(lanes[large], by_lanes[large]), slope(durations[lasting], by_duration[lasting])
        left.loglog(lanes, by_lanes, mark, label=f"{dtype}, slope {a:.2f} from {FITTED_LANES:.0e} on")
        right.loglog(durations, by_duration, mark, label=f"{dtype}, slope {b:.2f} from {FITTED_DURATION:g} s on")
        listed = ", ".join(f"{n:.0e} servos {1e3 * t:.2f} ms" for n, t in zip(LANES, by_lanes, strict=True))
        print(f"{dtype}, 1 s simulated: {listed}; slope {a:.2f}")
        listed = ", ".join(f"{n:g} s {1e3 * t:.1f} ms" for n, t in zip(DURATIONS, by_duration, strict=True))
        print(f"{dtype}, 4096 servos: {listed}; slope {b:.2f}")
    left.set(xlabel="number of servos [1]", ylabel="time of the call [s]", title="1 s simulated")
    right.set(xlabel="time simulated [s]", ylabel="time of the call [s]", title="4096 servos")
    for axes in (left, right):
        axes.grid(which="major", alpha=0.4)
        axes.legend()
    figure.savefig(HERE / "cost.png", dpi=120)
    plt.close(figure)
    print(f"picture: {HERE.name}/cost.png")


def main() -> None:
    memory()
    draw()


if __name__ == "__main__":
    main()
