"""The clock of a log: its beat, how far stamps lie off it, and where rows are missing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.beat import beat_of

Array = NDArray[np.float64]

_GAP = 1.7  # usual steps: one row is missing, or more
_COARSE = 0.2  # of a step: what a clock counts in


class Gap(NamedTuple):
    """Rows that are missing.

    Parameters
    ----------
    at, length : float
        Of the last row before it, and to the next one [s].
    """

    at: float
    length: float


class Clock(NamedTuple):
    """What is to be said of time stamps.

    Parameters
    ----------
    period : float
        The usual step [s].
    jitter : float
        Standard deviation of the steps that are none of a gap [s].
    unit : float
        What stamps are whole multiples of; 0 where that is small beside the period, or they are none [s].
    gaps : tuple of Gap
        The longest first.
    off_beat : int
        Stamps that lie off the beat of the others.
    """

    period: float
    jitter: float
    unit: float
    gaps: tuple[Gap, ...]
    off_beat: int


def clock_of(time: Array) -> Clock:
    """Return what is to be said of time stamps [s].

    Examples
    --------
    >>> found = clock_of(np.delete(0.02 * np.arange(100.0), [40, 41]))
    >>> round(found.period, 6), len(found.gaps), round(found.gaps[0].length, 6)
    (0.02, 1, 0.06)
    """
    steps = np.diff(time)
    period = float(np.median(steps))
    wide = np.flatnonzero(steps > _GAP * period)
    order = wide[np.argsort(-steps[wide], kind="stable")]
    beat = beat_of(time)
    return Clock(period, float(np.std(steps[steps <= _GAP * period])), _unit(steps, period),
                 tuple(Gap(float(time[k]), float(steps[k])) for k in order.tolist()),
                 0 if beat is None else int(beat.off.sum()))


def _unit(steps: Array, period: float) -> float:
    """Return the largest of 1 s, 0.1 s, ... of which all steps are whole multiples, if it is coarse."""
    for power in range(0, -7, -1):
        unit = 10.0**power
        if np.abs(steps / unit - np.round(steps / unit)).max() < 1e-4 * max(1.0, float(np.abs(steps / unit).max())):
            return unit if unit > _COARSE * period and np.ptp(steps) > 0.5 * unit else 0.0
    return 0.0
