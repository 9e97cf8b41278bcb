"""What the values of a measured signal say of its sensor: noise, steps, ends of its range."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.look import rough_noise

Array = NDArray[np.float64]

_FEW = 8  # different values, at least, that show steps
_MANY = 20_000  # different values: steps finer than that do not matter
_WHOLE = 0.3  # of a step, off which values may lie that were rounded
_FLAT = 10  # rows of one value at an end of the range
_MOVES = 0.5  # of neighbouring rows differ where there is noise
_TURN = 2.0 * math.pi


class Values(NamedTuple):
    """What is to be said of a measured signal, in SI.

    Parameters
    ----------
    low, high : float
    missing : int
        Rows without a value.
    noise : float
        Standard deviation, from second differences.
    step : float
        What values are whole multiples of; 0 where they are none.
    counts : int
        Steps of a whole turn, where it is an angle and their number a power of two; else 0.
    flat_low, flat_high : int
        Rows that stand at an end of the range without the noise that they have elsewhere.
    """

    low: float
    high: float
    missing: int
    noise: float
    step: float
    counts: int
    flat_low: int
    flat_high: int


def values_of(values: Array, *, angle: bool) -> Values:
    """Return what is to be said of a signal; nan where nothing was measured.

    Examples
    --------
    >>> turn = np.round(4096 * np.sin(np.arange(200.0)) / 12.0) * 2.0 * np.pi / 4096
    >>> found = values_of(turn, angle=True)
    >>> found.counts, round(math.degrees(found.step), 3)
    (4096, 0.088)
    """
    seen = values[np.isfinite(values)]
    if not len(seen):
        return Values(math.nan, math.nan, len(values), math.nan, 0.0, 0, 0, 0)
    step = _step(seen)
    turn = _TURN / step if angle and step > 0.0 else 0.0
    bits = round(math.log2(turn)) if turn > 1.0 else 0
    counts = 2**bits if bits >= 8 and abs(turn / 2**bits - 1.0) < 2e-3 else 0
    low, high = float(seen.min()), float(seen.max())
    return Values(low, high, len(values) - len(seen), rough_noise(seen), step, counts,
                  _flat(seen, low), _flat(seen, high))


def _step(seen: Array) -> float:
    different = np.unique(np.round(seen, 12))
    if not _FEW <= len(different) <= _MANY:
        return 0.0
    steps = np.diff(different)
    least = float(steps.min())
    step = float(np.median(steps[steps < 1.5 * least]))
    for _ in range(3):  # rounded values: ever more of them say how large it is
        number = np.round((different - different[0]) / step)
        step = float(np.dot(number, different - different[0]) / np.dot(number, number))
    off = np.abs((different - different[0]) / step - np.round((different - different[0]) / step))
    return step if off.max() < _WHOLE and len(different) > 2 else 0.0


def _flat(seen: Array, end: float) -> int:
    """Return how many rows stand at an end of the range, in runs without noise where others have some.

    At its first row a shaft may be at rest there.
    """
    if np.mean(np.diff(seen) != 0.0) < _MOVES:
        return 0
    at = np.concatenate([[0], (seen == end).astype(int), [0]])
    edges = np.flatnonzero(np.diff(at))
    runs = (edges[1::2] - edges[::2])[edges[::2] > 0]
    return int(runs[runs >= _FLAT].sum())
