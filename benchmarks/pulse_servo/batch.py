"""Part 1: the fleet on two cores beside MuJoCo, JAX, C, and the arithmetic peak of the machine."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import native
import numpy as np
import ours
import peer_jax
import peer_mujoco
from fleet import FRAME, Fleet, random_fleet
from work import Count, count

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import best

LANES, DURATION, THREADS = 4096, 2.0, 2
FRAMES = round(DURATION / FRAME)
MUJOCO_LANES = 64  # of a cost that is proportional to their number
PRECISIONS = ("float64", "float32")


class Row(NamedTuple):
    """One line of the table."""

    name: str
    dtype: str
    speed: float  # servo-seconds per second
    apart: tuple[float, float] | None = None  # from the formulas in NumPy, at the end: 99 % of lanes, largest [rad]


def attempt(name: str, prepare: Callable[[], Callable[[], object]]) -> Callable[[], object] | None:
    """Prepare a peer; one line if it is not installed."""
    try:
        return prepare()
    except ImportError as missing:
        print(f"{name}: left out, because {missing.name or missing} is not installed")
        return None


def apart(angle: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Return within what 99 % of the lanes agree, and the largest difference [rad]."""
    difference = np.abs(angle - exact)
    return float(np.quantile(difference, 0.99)), float(difference.max())


def rows(fleet: Fleet, exact: np.ndarray) -> Iterator[Row]:
    """Measure one contestant after the other."""
    seconds = LANES * DURATION
    for dtype in PRECISIONS:
        run = ours.prepare(fleet, DURATION, dtype)
        yield Row("servotwin, whole call", dtype, seconds / best(run, 10), apart(run(), exact))
        alone = ours.kernels(fleet, DURATION, dtype, THREADS)
        yield Row("servotwin, kernels alone", dtype, seconds / best(alone, 10))
    for dtype in PRECISIONS:
        run = attempt("C", lambda dtype=dtype: native.Native(dtype).prepare(fleet, FRAMES).run)
        if run:
            yield Row("C, gcc, vectorised", dtype, seconds / best(run, 10), apart(run(), exact))
    for dtype in PRECISIONS:
        run = attempt("JAX", lambda dtype=dtype: peer_jax.prepare(fleet, FRAMES, dtype, THREADS))
        if run:
            yield Row("JAX, scan over frames", dtype, seconds / best(run, 5), apart(run(), exact))
    run = attempt("MuJoCo", lambda: peer_mujoco.prepare(fleet, MUJOCO_LANES, DURATION, THREADS))
    if run:
        yield Row("mujoco.rollout, 1 ms", "float64", MUJOCO_LANES * DURATION / best(run, 3))


def peaks() -> dict[str, float]:
    """Return the most operations per second of this machine, by precision; nothing without gcc."""
    top = {}
    for dtype in PRECISIONS:
        machine = attempt("peak", lambda dtype=dtype: native.Native(dtype))
        if machine is not None:
            operations = machine.multiply_adds(THREADS)
            top[dtype] = operations / best(lambda m=machine: m.multiply_adds(THREADS), 3)
    return top


def show(table: list[Row], work: Count, top: dict[str, float]) -> None:
    """Print speeds, ratios and the share of the peak that the arithmetic of moving legs makes up."""
    own = {row.dtype: row.speed for row in reversed(table[:4])}  # the whole call stands before the kernels
    print(f"{'':24} {'':8} {'servo-s/s':>10} {'phases/s':>10} {'float64':>9} {'float32':>9} {'of peak':>8} "
          f"{'99 % [rad]':>11} {'max [rad]':>10}")
    for row in table:
        pulses = "mujoco" not in row.name
        phases = f"{4.0 * row.speed / FRAME:.2e}" if pulses else ""
        share = f"{row.speed / FRAME * work.operations(row.dtype) / top[row.dtype]:.1%}" if pulses and top else ""
        close = f"{row.apart[0]:11.1e} {row.apart[1]:10.1e}" if row.apart else ""
        ratios = " ".join(f"{own[dtype] / row.speed:8.3g}x" for dtype in PRECISIONS)
        print(f"{row.name:24} {row.dtype:8} {row.speed:10.2e} {phases:>10} {ratios} {share:>8} {close}")
    print(f"float64, float32: servotwin's whole call in that precision over the row. phases: 4 a frame; in "
          f"{work.phases:.2f} of them the shaft moves.")
    print("99 %, max: apart from the same formulas in NumPy, float64, at the end. A float32 error at the very edge of "
          "the deadband decides otherwise: a pulse more or less.")
    print("of peak: operations of the legs that move; " + ", ".join(
        f"{dtype} {work.operations(dtype):.0f} a frame, peak {top[dtype] / 1e9:.0f} Gflop/s" for dtype in top))


def main() -> None:
    fleet = random_fleet(LANES, duration=DURATION)
    work, exact = count(fleet, FRAMES)
    print(f"{LANES} random pulse servos, {DURATION:g} s, {THREADS} threads, only the last angle kept")
    table = list(rows(fleet, exact))
    show(table, work, peaks())


if __name__ == "__main__":
    main()
