"""A clock that never lies: bench time by the time on the wall, and how slow it really runs."""

from __future__ import annotations

import math
from collections import deque

from servotwin.errors import InputError
from servotwin.units import is_finite

SPEEDS = (1e-6, 10.0)
"""Slowest and fastest speed that may be asked for [s of the bench per s]."""
UNPACED = "unpaced"
OVER = 1.0  # s on the wall over which the pace is measured
LATE = 0.1  # s on the wall: a debt of more is dropped


class Pace:
    """How far bench time should be, and how fast it has really gone.

    Parameters
    ----------
    now : float
        Time on the wall [s].

    Examples
    --------
    >>> pace = Pace(0.0)
    >>> pace.ask(0.5, now=0.0, bench=0.0)
    >>> pace.target(now=0.04, bench=0.0)
    0.02
    >>> pace.went(now=1.0, bench=0.1), round(pace.measured, 3), pace.behind
    (None, 0.1, True)
    """

    def __init__(self, now: float) -> None:
        self.speed = 1.0
        self.running = True
        self._from = (now, 0.0)
        self._went: deque[tuple[float, float]] = deque([(now, 0.0)])
        self._late_until = -math.inf

    def ask(self, speed: object, *, now: float, bench: float) -> None:
        """Take another speed, of `SPEEDS` or `UNPACED`.

        Raises
        ------
        InputError
            If it is none.
        """
        if speed == UNPACED:
            speed = math.inf
        elif not (is_finite(speed) and SPEEDS[0] <= speed <= SPEEDS[1]):
            raise InputError("speed", got=speed, allowed=f"a number from {SPEEDS[0]:g} to {SPEEDS[1]:g}, or {UNPACED}")
        self.speed = float(speed)
        self.begin(now=now, bench=bench)

    def run(self, running: bool, *, now: float, bench: float) -> None:
        """Go on, or stand still."""
        self.running = running
        self.begin(now=now, bench=bench)

    def begin(self, *, now: float, bench: float) -> None:
        """Count from here on, without debt."""
        self._from, self._late_until = (now, bench), -math.inf
        self._went = deque([(now, bench)])

    def target(self, *, now: float, bench: float) -> float:
        """Return how far bench time should be [s]; inf if it goes as fast as it can."""
        if not self.running:
            return bench
        return self._from[1] + self.speed * (now - self._from[0]) if math.isfinite(self.speed) else math.inf

    def went(self, *, now: float, bench: float) -> None:
        """Take note of how far bench time has come; a debt that is too large is dropped, and told."""
        if math.isfinite(self.speed) and self.target(now=now, bench=bench) - bench > LATE * self.speed:
            self._from, self._late_until = (now, bench), now + OVER
        self._went.append((now, bench))
        while len(self._went) > 2 and self._went[1][0] <= now - OVER:
            self._went.popleft()

    @property
    def behind(self) -> bool:
        """Whether it could not keep up within the last second."""
        return self._went[-1][0] < self._late_until

    @property
    def measured(self) -> float:
        """Bench seconds per second on the wall over the last second; 0 while it stands."""
        (first, start), (last, end) = self._went[0], self._went[-1]
        return (end - start) / (last - first) if self.running and last > first else 0.0
