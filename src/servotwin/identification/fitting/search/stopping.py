"""How far a fit is, judged by the work that it measured, and what stops it: Ctrl-C, or the time that it was given."""

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
from servotwin.units import is_finite

# --- The time that a fit has left, by the time that its stages took so far and what those to come take beside them ----

STAGES = (0.0, 0.42, 0.7, 0.76, 0.95, 0.96, 1.0)
"""Where rough searches, the search, priors, intervals, errors and trials begin, as they say it."""
ROUGH, SEARCH, PRIORS, INTERVALS, ERRORS, TRIALS = range(6)
# The long side of what twenty fits took (benchmarks/identification/time_left.py): what is left shall fall
_SEARCH = 16.0  # times the rough searches: when pulses come may have to be found first
_INTERVALS = (5.0, 0.6)  # times the rough searches, and the search
_PRIORS, _ERRORS, _BESIDE = 0.02, 0.04, 0.03  # of all before; the last for each simpler model
_TRIALS = 0.9  # of all before
_AT_LEAST = 0.4  # of what a stage has taken, for which it may continue
_FROM = 1.0  # s: what is said earlier says nothing
_RISES = 1.1  # times the least that was said


class TimeLeft:
    """The time that a fit has left, by its measured stages.

    Stages whose length is not known before, such as the search, count with the long side of what is usual, and causes
    that may have to be tried count until they need not be.

    Parameters
    ----------
    intervals : bool
        Whether they are sought.
    beside : int
        How many simpler models are fitted too.
    trials : bool
        Whether causes may be tried.

    Examples
    --------
    >>> left = TimeLeft(intervals=True, beside=2, trials=True)
    >>> [round(left.at(share, now), 1) for share, now in ((0.0, 0.0), (0.42, 2.0), (0.76, 10.0), (0.95, 13.0))]
    [0.0, 91.4, 23.4, 14.2]
    """

    def __init__(self, *, intervals: bool, beside: int, trials: bool) -> None:
        self._intervals, self._errors, self._trials = intervals, _ERRORS + _BESIDE * beside, _TRIALS * trials
        self._begun = [math.inf] * len(STAGES)
        self._inner_begun = math.inf  # when the last search reported its first step [s]
        self._least = math.inf
        self.longer = False
        """Whether this stage takes longer than could be foreseen, so that what was said last is too little."""

    def at(self, share: float, now: float) -> float:
        """Return what is left [s] at a time since the fit began [s]; stages say which share of theirs is done."""
        stage = max(k for k in range(len(STAGES) - 1) if share >= STAGES[k])
        for k in range(stage + 1):
            self._begun[k] = min(self._begun[k], now)
        inner = (share - STAGES[stage]) / (STAGES[stage + 1] - STAGES[stage])
        left = self._of_stage(stage, inner, now)
        for later in range(stage + 1, TRIALS + 1):
            left += self._usual(later, now + left)
        if now < _FROM:  # little was measured yet
            return 2.0 * left
        said = min(left, _RISES * self._least)
        self.longer = said < left and stage > ROUGH and (
            now - self._begun[stage] > self._usual(stage, self._begun[stage]))
        self._least = min(self._least, said)
        return said

    def _of_stage(self, stage: int, inner: float, now: float) -> float:
        spent = now - self._begun[stage]
        if stage == ROUGH:
            return spent * (1.0 - inner) / inner if inner > 0.0 else 0.0
        usual = max(self._usual(stage, self._begun[stage]) - spent, _AT_LEAST * spent)
        if stage == TRIALS or inner <= 0.0:
            return usual
        self._inner_begun = min(self._inner_begun, now) if stage == SEARCH else self._begun[stage]
        return min(usual, (now - self._inner_begun + _ROUNDING) * (1.0 - inner) / inner)

    def _usual(self, stage: int, before: float) -> float:
        """Return what a stage usually takes [s] after all that came before took so long [s]."""
        rough = self._begun[SEARCH] - self._begun[ROUGH]
        if not math.isfinite(rough):
            rough = before
        if stage == SEARCH:
            return _SEARCH * rough
        if stage == INTERVALS:
            whole = before if rough == 0.0 else min(_INTERVALS[0] * rough, _INTERVALS[1] * before)
            return whole * self._intervals
        return {PRIORS: _PRIORS, ERRORS: self._errors, TRIALS: self._trials}[stage] * before


_ROUNDING = 1e-3  # s


# --- How far a fit is, judged by the work that it measured, and what stops it -----------------------------------------

Show = Callable[[float, str], None]
LONGER = ", longer than usual"
_OFTEN = 0.2  # s, between two times that the same is reported


class Within:
    """The time that a fit may take, from now on.

    Parameters
    ----------
    seconds : float or Within, optional
        As much as it likes unless given; one that has begun continues.

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
    """The stop of a fit, and its progress: stages say which share of the fit is done.

    Parameters
    ----------
    within : Within
    """

    def __init__(self, within: Within) -> None:
        self.within = within
        self.show: Show = lambda share, text: None  # gets that share; may raise KeyboardInterrupt, which stops the fit
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
        """Return the share of all work that is done, and the work in progress."""
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
    """The way of a fit: stages say which share of theirs is done, and it is given which share of its time is gone.

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
