"""How a bench is let go on: in stretches that are short enough that others have their turn."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from servotwin.errors import InputError, ServotwinError
from servotwin.web.live import Push, ServoPush
from servotwin.web.server.wire import line_of

if TYPE_CHECKING:
    from servotwin.web.live import LiveBench

BUDGET = 0.010  # s of computing in a turn
SHORT, LONG = 0.2 * BUDGET, 0.5 * BUDGET  # s of computing: a stretch of less, and of more, is given another length
FIRST = 5e-4  # s of bench time: the first stretch, of which nothing is known yet
LONGEST = 0.1  # s: one that begins at rest may go on in motion, which costs a thousand times as much
PATIENCE = 1.0
"""How long a stretch may take [s]: then the bench stands."""


class Stint:
    """A bench that is let go on.

    Parameters
    ----------
    bench : LiveBench

    Examples
    --------
    >>> from servotwin.web.live import LiveBench
    >>> from servotwin.web.server.first import first_scene
    >>> stint = Stint(LiveBench(first_scene()))
    >>> stint.until(1e-3, 1e3).time, stint.broken
    (0.001, None)
    """

    def __init__(self, bench: LiveBench) -> None:
        self._bench = bench
        self._stretch = FIRST
        self._ends = self._stands = 0.0
        self.broken: str | None = None
        """Why it cannot go on, in a line."""
        bench.hurried(lambda: _now() > self._ends, self._within)

    def begin(self) -> None:
        """Forget how fast it was: its numbers are others."""
        self._stretch = FIRST

    def until(self, target: float, points: float) -> Push:
        """Let it go on to a time [s], but for no longer than a turn may take; return what shows, at a rate [Hz]."""
        self._ends, pushes = _now() + BUDGET, [self._nothing()]
        while (self._bench.due or not self._bench.reached(target)) and self.broken is None and _now() < self._ends:
            before, at = self._bench.time, _now()
            pushes.append(self.to(max(min(target, before + self._stretch), before), points))
            spent = _now() - at
            if spent < SHORT:
                self._stretch = min(4.0 * self._stretch, LONGEST)
            elif spent > LONG:
                self._stretch = max(0.5 * self._stretch, FIRST)
        return joined(pushes)

    def to(self, until: float, points: float) -> Push:
        """Let it go on to a time [s] at a stretch; what it cannot is told in `broken`."""
        self._stands = _now() + PATIENCE
        try:
            return self._bench.advance(until, points)
        except ServotwinError as error:
            self.broken = line_of(error)
        except Exception as error:  # one bench shall not end the others
            self.broken = f"a mistake of servotwin itself ({type(error).__name__}); please report what was done"
        return self._nothing()

    def _within(self, time: float) -> None:
        if _now() > self._stands:
            raise InputError("motion", got=f"one that takes more than {PATIENCE:g} s to compute at t = {time:.6g} s",
                             allowed="numbers of a servo that is not so fast, and a new beginning")

    def _nothing(self) -> Push:
        bench = self._bench
        return Push(bench.time, tuple(ServoPush(columns, [], []) for columns in bench.columns), [])


def joined(pushes: list[Push]) -> Push:
    """Return pushes that follow each other as one.

    Examples
    --------
    >>> one = Push(1.0, (ServoPush(("time",), [(1.0,)], []),), [])
    >>> joined([one, one._replace(time=2.0)]).time
    2.0
    """
    servos = tuple(ServoPush(parts[-1].columns, [row for part in parts for row in part.points],
                             [pulse for part in parts for pulse in part.pulses])
                   for parts in zip(*(push.servos for push in pushes), strict=True))
    return Push(pushes[-1].time, servos, [event for push in pushes for event in push.events])


def _now() -> float:
    return time.monotonic()
