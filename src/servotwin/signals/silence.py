"""Samples without a value: no pulses are sent there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with each nan replaced by the number before it, or where there is none by the first number.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least one is a number.

    Examples
    --------
    >>> filled(np.array([np.nan, 1.0, np.nan, 2.0])).tolist()
    [1.0, 1.0, 1.0, 2.0]
    """
    there = ~np.isnan(values)
    latest = np.maximum.accumulate(np.where(there, np.arange(values.size), -1))
    return np.asarray(values[np.where(latest < 0, np.argmax(there), latest)])


def spans(time: NDArray[np.float64], silent: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return from when to when samples are silent [s]; before the first sample it is as there, after the last too.

    Examples
    --------
    >>> spans(np.array([0.0, 1.0, 2.0, 3.0]), np.array([True, False, True, True]))
    ((-inf, 1.0), (2.0, inf))
    """
    turns = np.flatnonzero(np.diff(np.concatenate(([False], silent, [False]))))
    times = np.append(time, math.inf)[turns]
    if turns.size and turns[0] == 0:
        times[0] = -math.inf
    return tuple(zip(times[::2].tolist(), times[1::2].tolist(), strict=True))
