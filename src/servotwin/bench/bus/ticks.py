"""A clock that ticks at a fixed rate and does not drift."""

from __future__ import annotations

import time
from collections.abc import Callable


class Ticks:
    """Instants that lie whole periods behind the first; those that are missed are counted and passed over.

    Parameters
    ----------
    rate : float
        [Hz]
    clock, sleep : callable
        Of the host unless given [s].

    Examples
    --------
    >>> now = [0.0]
    >>> ticks = Ticks(100.0, clock=lambda: now[0], sleep=lambda t: now.__setitem__(0, now[0] + t))
    >>> [ticks.next(), ticks.next()], round(now[0], 3)
    ([0, 1], 0.01)
    >>> now[0] = 0.0345  # something took long
    >>> ticks.next(), ticks.late
    (3, 1)
    """

    def __init__(self, rate: float, *, clock: Callable[[], float] = time.perf_counter,
                 sleep: Callable[[float], None] = time.sleep) -> None:
        self.rate = rate
        self.late = 0
        self.start = 0.0
        self._clock, self._sleep = clock, sleep
        self._tick = -1

    def next(self) -> int:
        """Wait for the next tick that has not passed and return its number; the first is now, and 0."""
        if self._tick < 0:
            self.start = self._clock()
        self._tick += 1
        missed = int((self._clock() - self.start) * self.rate) - self._tick
        if missed > 0:
            self.late += missed
            self._tick += missed
        wait = self.start + self._tick / self.rate - self._clock()
        if wait > 0.0:
            self._sleep(wait)
        return self._tick
