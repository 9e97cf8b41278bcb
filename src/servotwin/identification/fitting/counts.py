"""Instruments that count: whatever stands is read wrong by the same each time, so its samples say no more than one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.point import OFFSET_SCALE
from servotwin.identification.fitting.uncertainty import Counts

Array = NDArray[np.float64]

_FEW = 0.8  # of the values differ from all others: nobody counts so finely that it matters
_WHOLE = 0.02  # of a step


def step_of(values: Array) -> float:
    """Return the step of an instrument that counts; 0 where none is seen.

    All differences are then whole multiples of it, and many values are the same.

    Examples
    --------
    >>> angle = np.sin(np.arange(100) / 20.0)
    >>> round(step_of(0.05 * np.round(angle / 0.05)), 3), step_of(angle)
    (0.05, 0.0)
    """
    apart = np.diff(np.unique(values))
    apart = apart[apart > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-12)]
    if not len(apart) or len(apart) > _FEW * len(values):
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    off = np.abs(apart / step - np.round(apart / step))
    return step if float(np.quantile(off, 0.98)) < _WHOLE * max(1.0, float(np.median(apart / step))) else 0.0


def counts_of(forecast: Forecast, k: int) -> Counts | None:
    """Return which samples of a log share a reading; None where none of its instruments counts."""
    case = forecast.cases[k]
    steps = {name: step_of(values) for name, values in case.values.items()}
    if not any(steps.values()):
        return None
    reading, power = [], []
    first = 0
    for name, values in case.values.items():
        step = steps[name]
        same = np.append(False, np.abs(np.diff(values)) < 0.5 * step)
        found = first + np.cumsum(~same) - 1
        first = int(found[-1]) + 1
        reading.append(found)
        power.append(np.full(len(values), step**2 / 12.0 / case.sigma(name, forecast.noise) ** 2))
    names = forecast.names_of_own(case)
    belief = np.zeros(len(names))
    if "output_angle" in names and next(iter(case.values)) == "output_angle":
        place = names.index("output_angle")
        belief[place] = float(forecast.own_belief(case)[1][place]) * forecast.noise["output_angle"] / OFFSET_SCALE
    return Counts(np.concatenate(reading), np.concatenate(power), belief)
