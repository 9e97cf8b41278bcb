"""Two servos, or one before and after something happened, among the logs: two groups of logs are fitted apart."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Prior
from servotwin.identification.fitting.diagnosis.bench import TrialBench
from servotwin.identification.fitting.diagnosis.gain import Told, gain
from servotwin.identification.fitting.diagnosis.shapes import GAIN, own_gains
from servotwin.identification.fitting.uncertainty import rows_of

Array = NDArray[np.float64]

_LOGS = 8  # among which two groups are sought


def two_servos(bench: TrialBench) -> Told | None:
    """Return what two sets of numbers gain over one, for the two groups of logs that differ most."""
    if len(bench.task.fitted) < 4:
        return None
    every = bench.task.fitted
    spread = [every[i * len(every) // min(len(every), _LOGS)] for i in range(min(len(every), _LOGS))]
    bench = TrialBench(bench.task, bench.whole, spread, bench.purse, bench.noise)
    logs = bench.setting.logs
    one, other = _groups(bench)
    residuals: list[Array] = [np.zeros(0)] * len(logs)
    for group in (one, other):
        there = bench.apart(group)
        for k in group:
            residuals[k] = there[k]
    if not all(np.isfinite(r).all() for r in residuals):
        return None
    named = ", ".join(logs[k].name for k in min(one, other, key=len))
    return Told("two servos", f"two servos among the logs, or one that changed: {named} and the others, fitted apart",
                "fit these logs apart", gain(bench.base.residuals, residuals, bench.noise))


def mixed_gains(bench: TrialBench) -> Told | None:
    """Return what another P in some of the logs gains."""
    said = [log.parameters.get(GAIN) for log in bench.setting.logs]
    setting = own_gains(bench)
    if setting is None:
        return None
    trial = bench.searched(setting, bench.base.point)
    if not all(np.isfinite(r).all() for r in trial.residuals):
        return None
    usual = bench.setting.model.value_or(GAIN, 0.0)
    other = [log.name for log, before in zip(setting.logs, said, strict=True)
             if log.parameters.get(GAIN, usual) != (usual if before is None else before)]
    return Told("P register", f"another gain of the loop in some logs than they say: {', '.join(other)}", "read the "
                "register for P back before each run", gain(bench.base.residuals, trial.residuals, bench.noise))


def _groups(bench: TrialBench) -> tuple[list[int], list[int]]:
    """Return the two groups, of two logs at least, whose own one-step estimates explain most."""
    forecast, point = bench.base.forecast, bench.base.point
    search = bench.search(forecast)
    parts = forecast.at(point)
    pieces = []
    for k, part in enumerate(parts):
        rows = rows_of(part, bench.task.loss, Prior(*forecast.own_belief(forecast.cases[k])), point.own[k])
        pieces.append((rows.slope.T @ rows.slope, rows.slope.T @ rows.score))
    size = len(pieces[0][1])
    hold = np.diag(np.where(search.held, 1e12, 1.0))

    def explained(group: tuple[int, ...] | list[int]) -> float:
        H = sum((pieces[k][0] for k in group), np.zeros((size, size))) + hold
        g = sum((pieces[k][1] for k in group), np.zeros(size))
        return float(g @ np.linalg.solve(H, g))

    everything = range(len(pieces))
    splits = [(list(group), [k for k in everything if k not in group])
              for count in range(2, len(pieces) // 2 + 1) for group in combinations(everything, count)]
    return max(splits, key=lambda split: explained(split[0]) + explained(split[1]))
