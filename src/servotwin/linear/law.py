"""What every loop that decides now and then can tell of itself."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Law(Protocol):
    """A loop that is linear, and the same again after some decisions."""

    @property
    def period(self) -> float:
        """From a decision to the next [s]."""

    @property
    def ticks(self) -> int:
        """After how many decisions it is the same again."""

    def open_loop(self, omega: Array, error: float = 0.0) -> Complex:
        """Return the loop, cut where it decides, for errors of an amplitude [rad]; shape of `omega` [rad/s]."""

    def closed_loop(self, omega: Array, amplitude: float = 0.0) -> Complex:
        """Return the fundamental of the output over a command's of an amplitude [rad]; shape of `omega` [rad/s]."""

    def monodromy(self, gain: float = 1.0) -> Array:
        """Return the transition of the closed loop until it is the same again, its gain `gain` times its own."""
