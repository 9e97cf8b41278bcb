"""How far a fit is, told by the work that it measured, and what stops it: Ctrl-C, or the time that it was given."""

from __future__ import annotations

import math
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from servotwin.errors import InputError
from servotwin.identification.fitting.time_left import TimeLeft
from servotwin.units import is_finite

Show = Callable[[float, str], None]

LONGER = ", longer than usual"
_OFTEN = 0.2  # s, between two times that the same is told


class Within:
    """The time that a fit may take, from now on.

    Parameters
    ----------
    seconds : float or Within, optional
        As much as it likes unless given; one that has begun goes on.

    Raises
    ------
    InputError
        If it is no positive time.

    Examples
    --------
    >>> Within(1e-9).over, Within().over, Within(Within(60.0)).over
    (True, False, False)
    """

    def __init__(self, seconds: float | Within | None = None) -> None:
        if isinstance(seconds, Within):
            self.end: float = seconds.end
            return
        if seconds is not None and not (is_finite(seconds) and seconds > 0.0):
            raise InputError("within", got=seconds, allowed="a positive time [s]")
        self.end = math.inf if seconds is None else clock.monotonic() + float(seconds)

    @property
    def over(self) -> bool:
        """Whether it has run out."""
        return clock.monotonic() > self.end


class Stops:
    """What stops a fit, and whom it tells how far it is: stages say which share of the fit is done.

    Parameters
    ----------
    within : Within
    """

    def __init__(self, within: Within) -> None:
        self.within = within
        self.show: Show = lambda share, text: None  # told that share; may raise KeyboardInterrupt, which stops the fit
        self.stopped = False
        self._noted = False
        self._told, self._share, self._begun = (0.0, ""), 0.0, False
        self._looked = -math.inf

    def __call__(self, share: float, text: str) -> None:
        """Tell how far a stage is; stop if it is time to.

        Raises
        ------
        KeyboardInterrupt
        """
        self._share, self._begun = share, True
        self._told = self._of_all(share, text)
        self._looked = -math.inf
        self.look()

    def _of_all(self, share: float, text: str) -> tuple[float, str]:
        """Return the share of all work that is done, and what goes on."""
        return max(share, self._told[0]), text

    def look(self) -> None:
        """Stop if it is time to; else say again how far it is, if that was long ago.

        Raises
        ------
        KeyboardInterrupt
        """
        if self.stopped:
            return
        now = clock.monotonic()
        try:
            if self._noted or self.within.over:
                raise KeyboardInterrupt
            if self._begun and now - self._looked >= _OFTEN:
                self._looked = now
                self._told = self._of_all(self._share, self._told[1].removesuffix(LONGER))
                self.show(*self._told)
        except KeyboardInterrupt:
            self.stopped = True
            raise

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Let the first Ctrl-C stop the fit where it can be stopped, if nobody else listens to it."""
        here = threading.current_thread() is threading.main_thread()
        if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
            yield
            return

        def noted(number: int, frame: FrameType | None) -> Any:
            if self._noted or self.stopped:  # a second one ends it wherever it is
                signal.default_int_handler(number, frame)
            self._noted = True

        signal.signal(signal.SIGINT, noted)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)


class Course(Stops):
    """The way of a fit: stages say which share of theirs is done, and it is told which share of its time is gone.

    Parameters
    ----------
    within : Within
    intervals : bool
        Whether they are sought.
    beside : int
        How many simpler models are fitted too.
    trials : bool
        Whether causes may be tried: what is left counts them until the fit ends without.
    """

    clock: Callable[[], float] = staticmethod(clock.monotonic)

    def __init__(self, within: Within, *, intervals: bool = True, beside: int = 0, trials: bool = True) -> None:
        super().__init__(within)
        self._left, self._since = TimeLeft(intervals=intervals, beside=beside, trials=trials), self.clock()

    def _of_all(self, share: float, text: str) -> tuple[float, str]:
        """Return the share of its time that is gone; of a stage that takes longer than was said, the text says so."""
        gone = self.clock() - self._since
        left = self._left.at(share, gone)
        done = gone / (gone + left) if gone + left > 0.0 else 0.0
        return max(done, self._told[0]), text + LONGER * self._left.longer

    def ended(self) -> None:
        """Tell that nothing is left."""
        with suppress(KeyboardInterrupt):
            self.show(1.0, "")
