"""What sends the pulses: a frame clock whose rate may change, and frames that get lost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

from servotwin.models.engine.live import posts
from servotwin.models.engine.live.posts import Sender


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
        self._clock: Any = SimpleNamespace(**Sender(rate, 0.0, seed, 0.0, 0, 0, 0.0)._asdict())

    @property
    def rate(self) -> float:
        """Frames per second [Hz]."""
        return float(self._clock.rate)

    @property
    def next_edge(self) -> float:
        """When the next frame begins [s]."""
        return posts.next_edge(self._clock)

    def snapped(self, time: float) -> float:
        """Return a time, or that of the edge right next to it: what is a billionth of a frame away is the edge [s]."""
        return posts.snapped(self._clock, time)

    def tune(self, rate: float) -> None:
        """Take another rate [Hz] from the next edge on."""
        posts.tune(self._clock, rate)

    def lose(self, share: float) -> None:
        """Let a share of the frames get lost from now on."""
        self._clock.lost = share

    def until(self, time: float) -> list[FrameEdge]:
        """Return the frames that begin before a time [s] and were not returned yet."""
        edges = []
        while (edge := self.next_edge) < time:
            edges.append(FrameEdge(edge, not posts.is_lost(self._clock)))
            posts.pass_edge(self._clock)
        return edges
