"""Part 2: a random servo found again from 48 noisy pendulum logs, beside least squares over a fixed-step simulator."""

import os
import time as clock

import fixed_step

import servotwin as st
from logs import DURATION, FREE, LOGS, NOISE, SAMPLE, Task, error, make
from servotwin.models import Model

SEEDS, STARTS = 10, 3


def off(values: dict[str, float], truth: dict[str, float]) -> float:
    """Return by how much the worst parameter is off, relative to the truth."""
    return max(abs(values[name] / truth[name] - 1.0) for name in truth)


def fitted(kind: type[Model], task: Task, seed: int) -> tuple[st.Fit, float]:
    """Identify from a random beginning; return the fit and how long it took [s]."""
    began = clock.perf_counter()
    fit = st.identify(task.logs, task.begin, model=kind, free=list(FREE[kind]), nuisance=(), priors=None,
                      bounds=task.bounds, starts=STARTS, seed=seed, holdout=0, intervals=False, compare_with=())
    return fit, clock.perf_counter() - began


def row(kind: type[Model], seed: int) -> tuple[float, float]:
    """Print what one seed gave; return error [rad] and time [s]."""
    task = make(kind, seed)
    fit, spent = fitted(kind, task, seed)
    wrong = error(kind, task, fit.servo)
    found = {name: fit.estimates[name] for name in FREE[kind]}
    print(f"  {kind.__name__:13} {seed:4d} {spent:8.1f} s {1e3 * error(kind, task, task.begin):9.0f} "
          f"{1e3 * wrong:10.4f} {off(found, task.truth):11.1e}", flush=True)
    return wrong, spent


def peer(seed: int, own: float) -> None:
    """Print what the fixed-step simulator makes of the same logs, and the ratio of times."""
    task = make(st.BoundedServo, seed)
    found = fixed_step.fit(task, seed)
    print(f"  fixed step    {seed:4d} {found.seconds:8.1f} s {'':9} {1e3 * found.error:10.4f} "
          f"{off(found.values, task.truth):11.1e}   {found.seconds / own:.1f}x the time of BoundedServo")
    print(f"{'':24}at the true parameters it is {1e3 * found.own_error:.1f} mrad off, for its step of "
          f"{1e3 * SAMPLE:g} ms", flush=True)


def main(seeds: int = SEEDS) -> None:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"8 parameters from {LOGS} logs of {DURATION:g} s at {1.0 / SAMPLE:g} Hz with {1e3 * NOISE:g} mrad of noise, "
          f"{STARTS} random starts, {cores} cores")
    print(f"  {'':13} seed     time  start mrad  end mrad   parameters off")
    times = {}
    for kind in (st.PulseServo, st.BoundedServo):
        rows = [row(kind, seed) for seed in range(seeds)]
        times[kind] = rows[0][1]
        print(f"  {kind.__name__}: worst of {seeds} seeds {1e3 * max(wrong for wrong, _ in rows):.3f} mrad, "
              f"longest {max(spent for _, spent in rows):.0f} s")
    peer(0, times[st.BoundedServo])


if __name__ == "__main__":
    main()
