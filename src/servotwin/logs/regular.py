"""The regular times behind stamps that scatter about them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.logs.log import Log

Array = NDArray[np.float64]

_ROUNDS = 20  # of reweighting
_MOST = 0.5  # of a step: a stamp further off may belong to the next sample
_REGULAR = 0.9  # of all stamps are nearer, or they are not regular


class Regular(NamedTuple):
    """A straight line through stamps.

    Parameters
    ----------
    step : float
        From one sample to the next [s].
    times : ndarray, shape (n,)
        Where the stamps would lie without scatter [s].
    scatter : float
        How far they lie off, robust: 1.4826 times the median, as a standard deviation [s].
    """

    step: float
    times: Array
    scatter: float


def regular_times(time: Array) -> Regular | None:
    """Return the regular times behind stamps; None where there are none. Samples may be missing.

    Examples
    --------
    >>> found = regular_times(np.array([0.0, 0.021, 0.04, 0.059, 0.08, 0.12]))
    >>> round(found.step, 3), [round(float(t), 2) for t in found.times]
    (0.02, [0.0, 0.02, 0.04, 0.06, 0.08, 0.12])
    """
    steps = np.diff(time)
    usual = float(np.median(steps))
    counted = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(steps / usual), 1.0))])
    for number in (np.arange(len(time), dtype=np.float64), counted):
        step, first = _line(number, time)
        times = first + step * number
        off = np.abs(time - times)
        if step > 0.0 and np.mean(off < _MOST * step) > _REGULAR:
            return Regular(step, times, 1.4826 * float(np.median(off)))
    return None


def _line(number: Array, time: Array) -> tuple[float, float]:
    """Return slope and start of the line with the least sum of magnitudes, by reweighted least squares."""
    weight = np.ones(len(time))
    step, first = 0.0, 0.0
    for _ in range(_ROUNDS):
        step, first = np.polyfit(number, time, 1, w=np.sqrt(weight))
        weight = 1.0 / np.maximum(np.abs(time - first - step * number), 1e-9)
    return float(step), float(first)


def made_regular(log: Log) -> Log:
    """Return a log whose samples and commands come at regular times; itself where it has none."""
    found = regular_times(log.time)
    return log if found is None else replace(log, time=found.times)
