"""Where a search stands, what a log says there, and the numbers that all logs share beside the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NUISANCES = ("delay", "log_delay", "frame_phase", "frame_period", "control_phase", "angle_offset", "angle_sag",
             "initial_state")
SHARED = {"delay": (0.01, "s"), "angle_offset": (0.01, "rad"), "angle_sag": (0.1, "rad/V"), "frame_period": (1e-3, "s")}
"""Nuisances that all logs share: the step that matters, and the unit."""
DELAY_SCALE, OFFSET_SCALE, SAG_SCALE, PERIOD_SCALE = (SHARED[name][0] for name in SHARED)
SPEED_SCALE = 0.1  # rad/s
MOST_DELAY = 0.5  # s
STEP = 1e-4  # of a searched number: over the kinks that sticking makes
FINE = 1e-6  # so little that hardly a kink lies within
WIDE = 0.03  # over many steps of counts and duties, and ticks at which a shaft just sticks, of a program that samples
LATER = 1e-5  # s, for the time derivative of signals that are no angles


class Frames(NamedTuple):
    """Which command each pulse of a log carries, and each tick of a program takes.

    Pulse k carries that of `phase` + k · `period`, from the first sample; ticks come by `tick` later after the first
    pulse than the servo says [s]. When pulses and ticks themselves come is another matter, and continuous; here every
    command changes at a jump.
    """

    phase: float
    period: float
    tick: float = 0.0


class Point(NamedTuple):
    """Where a search stands.

    Parameters
    ----------
    shared : ndarray, shape (p,)
        The searched numbers of `Space`, then those of `SHARED` that are nuisances (scaled).
    own : tuple of ndarray
        Of each log: angle and speed at its start, its own delay, when its first pulse comes (scaled), and when a
        program without pulses looks at the shaft first (in ticks), as far as they are nuisances.
    frames : tuple of Frames
        Of each log, where pulses have a phase; those that a forecast begins with unless given.
    """

    shared: Array
    own: tuple[Array, ...]
    frames: tuple[Frames, ...] = ()


class LogPart(NamedTuple):
    """What one log says: simulated less measured, and the derivatives of that.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        In units of each sensor's noise.
    shared : ndarray, shape (m, p) or (m, 0)
    own : ndarray, shape (m, l) or (m, 0)
    later : ndarray, shape (m,)
        What a delay changes: derivative by a scaled delay. Of signals that are no angles only where derivatives or
        rates were asked for.
    """

    residual: Array
    shared: Array
    own: Array
    later: Array = np.zeros(0)


def joined(parts: Sequence[LogPart]) -> Array:
    """Return the derivatives of some logs in one matrix, by shared numbers and those of each log."""
    from scipy.linalg import block_diag

    return np.column_stack([np.concatenate([part.shared for part in parts]), block_diag(*(part.own for part in parts))])
