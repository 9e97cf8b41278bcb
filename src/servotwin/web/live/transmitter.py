"""What sends the pulses: a frame clock whose rate may change, and frames that get lost."""

from __future__ import annotations

import random
from typing import NamedTuple

_SAME = 1e-9  # of a frame: instants that are nearer are one


class FrameEdge(NamedTuple):
    """The beginning of a frame: when [s], and whether its pulse is sent."""

    time: float
    sent: bool


class Transmitter:
    """A frame clock; a new rate takes effect after the frame that has begun.

    Parameters
    ----------
    rate : float
        Frames per second [Hz].
    seed : int
        Of which frames are lost.

    Examples
    --------
    >>> sender = Transmitter(50.0, seed=0)
    >>> [round(edge.time, 6) for edge in sender.until(0.05)], sender.until(0.05)
    ([0.0, 0.02, 0.04], [])
    """

    def __init__(self, rate: float, seed: int) -> None:
        self.rate, self.lost, self._seed = rate, 0.0, seed
        self._base, self._count, self._number = 0.0, 0, 0  # frames since `_base`, and in all

    @property
    def next_edge(self) -> float:
        """When the next frame begins [s]."""
        return self._base + self._count / self.rate

    def snapped(self, time: float) -> float:
        """Return a time, or that of the edge right next to it: what is a billionth of a frame away is the edge [s]."""
        period = 1.0 / self.rate
        edge = self._base + round((time - self._base) / period) / self.rate
        return edge if abs(time - edge) <= _SAME * period and edge >= self.next_edge else time

    def tune(self, rate: float) -> None:
        """Take another rate [Hz] from the next edge on."""
        self._base, self._count, self.rate = self.next_edge, 0, rate

    def until(self, time: float) -> list[FrameEdge]:
        """Return the frames that begin before a time [s] and were not returned yet."""
        edges = []
        while (edge := self.next_edge) < time:
            edges.append(FrameEdge(edge, not self._is_lost(self._number)))
            self._count, self._number = self._count + 1, self._number + 1
        return edges

    def _is_lost(self, number: int) -> bool:
        if self.lost in (0.0, 1.0):
            return self.lost == 1.0
        return random.Random(f"{self._seed}:{number}").random() < self.lost  # the same whatever came before
