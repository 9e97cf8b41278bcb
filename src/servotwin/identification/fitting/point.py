"""Where a search stands, what a log says there, and the numbers that all logs share beside the parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NUISANCES = ("delay", "log_delay", "angle_offset", "angle_sag", "initial_state")
SHARED = {"delay": (0.01, "s"), "angle_offset": (0.01, "rad"), "angle_sag": (0.1, "rad/V")}
"""Nuisances that all logs share: the step that matters, and the unit."""
DELAY_SCALE, OFFSET_SCALE, SAG_SCALE = (SHARED[name][0] for name in SHARED)
SPEED_SCALE = 0.1  # rad/s
MOST_DELAY = 0.5  # s
STEP = 1e-4  # of a searched number: over the kinks that sticking makes
FINE = 1e-6  # so little that hardly a kink lies within
LATER = 1e-5  # s, for the time derivative of signals that are no angles


class Point(NamedTuple):
    """Where a search stands.

    Parameters
    ----------
    shared : ndarray, shape (p,)
        The searched numbers of `Space`, then delay and angle offset where these are nuisances (scaled).
    own : tuple of ndarray
        Of each log: angle and speed at its start, its own delay (scaled), as far as they are nuisances.
    """

    shared: Array
    own: tuple[Array, ...]


class LogPart(NamedTuple):
    """What one log says: simulated less measured, and the derivatives of that.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        In units of each sensor's noise.
    shared : ndarray, shape (m, p) or (m, 0)
    own : ndarray, shape (m, l) or (m, 0)
    """

    residual: Array
    shared: Array
    own: Array
