"""Instruments that count: whatever stands is read wrong by the same each time, so its samples say no more than one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.point import OFFSET_SCALE
from servotwin.identification.fitting.uncertainty import Counts
from servotwin.logs.column_values import step_of

Array = NDArray[np.float64]


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
