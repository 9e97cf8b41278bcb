"""Copies of a robot, at points of the numbers that are searched."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.numbers import Numbers

Array = NDArray[np.float64]


class Copies(ABC):
    """What simulates the joints of an episode at several points.

    Parameters
    ----------
    plant : MjModel
    numbers : Numbers
    links : sequence of int
        Bodies whose masses are searched.
    look : callable
        Called while it simulates; may raise.
    """

    def __init__(self, plant: Any, numbers: Numbers, links: Sequence[int],
                 look: Callable[[], object] = lambda: None) -> None:
        self.plant, self.numbers, self.links, self.look = plant, numbers, list(links), look

    @abstractmethod
    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are at the stamps of an episode, shape (copies, n, joints) [rad].

        nan where a simulation failed; `fine` without the counts of the servos.
        """
