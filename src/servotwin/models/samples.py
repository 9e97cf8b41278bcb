"""States of a run at many times, the input of every output signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Samples:
    """State and mode at n times; every array has shape (n,).

    Parameters
    ----------
    time : ndarray
        [s]
    angle, speed, current : ndarray
        State variables [rad], [rad/s], [A]; the current is used only where it is a state.
    zone, contact : ndarray of int
        Mode.
    drive, error : ndarray
        Of a pulse servo: how the bridge drives (−1, 0, +1), and the latest error decided on [s].
    """

    time: Array
    angle: Array
    speed: Array
    current: Array
    zone: NDArray[np.int64]
    contact: NDArray[np.int64]
    drive: Array
    error: Array

    @classmethod
    def make(cls, time: Array, states: Array, zone: Array, contact: Array, drive: Array, error: Array) -> Samples:
        """Build from an array of states, shape (3, n)."""
        return cls(time, states[0], states[1], states[2], zone.astype(np.int64), contact.astype(np.int64),
                   drive, error)
