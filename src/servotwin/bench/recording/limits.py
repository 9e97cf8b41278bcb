"""What a servo may be asked for on a bench; said before anything moves."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from servotwin.bench.recording.experiment import KINDS, Experiment
from servotwin.errors import BenchError, InputError
from servotwin.units import is_finite

_WINDOW = 0.25  # s over which the current is averaged: a start draws the stall current for some tens of ms
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Range, voltage and current of a run.

    Parameters
    ----------
    kind : {"pulse_width", "angle"}
        What is commanded.
    low, high : float
        Commands that are allowed (SI), low below high.
    voltage : float
        Of the supply, as it is set [V].
    current : float
        Mean supply current over 0.25 s that ends the run [A].

    Raises
    ------
    InputError
        If a number makes no sense.

    Examples
    --------
    >>> Limits(kind="pulse_width", low=1e-3, high=2e-3, voltage=6.0, current=1.0).middle
    0.0015
    """

    kind: str
    low: float
    high: float
    voltage: float
    current: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("kind of limits", got=self.kind, allowed=", ".join(KINDS))
        for name in ("low", "high", "voltage", "current"):
            if not is_finite(getattr(self, name)):
                raise InputError(f"limits: {name}", got=getattr(self, name), allowed="a finite number (SI)")
        if not self.low < self.high:
            raise InputError("limits: range", got=f"{self.low:g} to {self.high:g}", allowed="low below high")
        if self.kind == "pulse_width" and not 0.0 < self.low:
            raise InputError("limits: low", got=self.low, allowed="a positive pulse width [s]")
        for name in ("voltage", "current"):
            if getattr(self, name) <= 0.0:
                raise InputError(f"limits: {name}", got=getattr(self, name), allowed="a positive number")

    @property
    def middle(self) -> float:
        """Of the range (SI)."""
        return 0.5 * (self.low + self.high)

    def at(self, share: float) -> float:
        """Return the command at a share of the range, 0 to 1 (SI)."""
        return self.low + share * (self.high - self.low)

    def check(self, experiment: Experiment) -> None:
        """Refuse an experiment that goes beyond the range.

        Raises
        ------
        InputError
        """
        if experiment.kind != self.kind:
            raise InputError(f"experiment {experiment.name!r}", got=f"commands of {experiment.kind}", allowed=self.kind)
        slack = _ROUNDING * (self.high - self.low)
        if experiment.lowest < self.low - slack or experiment.highest > self.high + slack:
            raise InputError(f"experiment {experiment.name!r}: range",
                             got=f"{experiment.lowest:g} to {experiment.highest:g} {KINDS[self.kind]}",
                             allowed=f"{self.low:g} to {self.high:g} {KINDS[self.kind]}")


class CurrentGuard:
    """Watches the supply current of a run.

    Parameters
    ----------
    limit : float
        [A]

    Examples
    --------
    >>> guard = CurrentGuard(1.0)
    >>> for k in range(300):
    ...     guard.look(k * 1e-3, 0.9)
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._seen: deque[tuple[float, float]] = deque()
        self._sum = 0.0

    def look(self, time: float, current: float) -> None:
        """Take one value [s, A]; nan is no value.

        Raises
        ------
        BenchError
            If the mean over the last 0.25 s is above the limit.
        """
        if current != current:
            return
        self._seen.append((time, current))
        self._sum += current
        while self._seen[0][0] < time - _WINDOW:
            self._sum -= self._seen.popleft()[1]
        full = time - self._seen[0][0] > 0.9 * _WINDOW
        if full and self._sum / len(self._seen) > self._limit:
            raise BenchError("supply current", f"{self._sum / len(self._seen):.3g} A in the mean of {_WINDOW:g} s, "
                                               f"above the limit of {self._limit:g} A")
