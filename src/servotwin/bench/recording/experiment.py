"""An experiment: what a servo is told, piece by piece, before it is known through which wire."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from servotwin.errors import InputError
from servotwin.units import is_finite

KINDS = {"pulse_width": "s", "angle": "rad"}  # kind of command -> its SI unit


@dataclass(frozen=True)
class Hold:
    """A command that is held for a while.

    Parameters
    ----------
    duration : float
        Positive [s]; a wire that works in frames or ticks rounds it to whole ones, at least one.
    value : float or None
        In SI, by the kind of the experiment; None: the servo is told nothing, and goes limp (no pulses, torque off).
    frame_period : float or None
        From pulse to pulse [s]; that of the experiment unless given.
    """

    duration: float
    value: float | None
    frame_period: float | None = None


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A run of one servo, as it is to be commanded.

    Parameters
    ----------
    name : str
        Of the run: a name that a file can have.
    motion : str
        Kind of motion, for tables of errors: "step", "staircase", "prbs", …
    kind : {"pulse_width", "angle"}
    holds : sequence of Hold
        One after the other; at least one with a value, and the first has one.
    frame_period : float
        From pulse to pulse, or from goal to goal [s].
    conditions : mapping of str to float or str
        Labels that the log gets.

    Raises
    ------
    InputError
        If a number is not finite or not positive where it has to be, or nothing is commanded.

    Examples
    --------
    >>> step = Experiment(name="step", motion="step", kind="pulse_width", holds=[Hold(0.5, 1.4e-3), Hold(1.0, 1.6e-3)])
    >>> step.duration, step.lowest, step.highest
    (1.5, 0.0014, 0.0016)
    """

    name: str
    motion: str
    kind: str
    holds: Sequence[Hold]
    frame_period: float = 0.02
    conditions: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"experiment {self.name!r}"
        if not self.name or any(c in self.name for c in "/\\\0") or self.name.startswith("."):
            raise InputError("name of an experiment", got=self.name, allowed="one that a file can have")
        if self.kind not in KINDS:
            raise InputError(f"{where}: kind", got=self.kind, allowed=", ".join(KINDS))
        holds = tuple(self.holds)
        if not holds or holds[0].value is None:
            raise InputError(f"{where}: holds", got="none with a value at the start", allowed="a first command")
        for one in holds:
            for what, number in (("duration", one.duration), ("frame_period", one.frame_period or self.frame_period)):
                if not (is_finite(number) and number > 0.0):
                    raise InputError(f"{where}: {what}", got=number, allowed="a positive number [s]")
            if one.value is not None and not is_finite(one.value):
                raise InputError(f"{where}: value", got=one.value, allowed=f"a finite number [{KINDS[self.kind]}]")
        object.__setattr__(self, "holds", holds)
        object.__setattr__(self, "conditions", MappingProxyType(dict(self.conditions)))

    @property
    def duration(self) -> float:
        """Of all holds [s]."""
        return sum(one.duration for one in self.holds)

    @property
    def lowest(self) -> float:
        """The lowest command (SI)."""
        return min(one.value for one in self.holds if one.value is not None)

    @property
    def highest(self) -> float:
        """The highest command (SI)."""
        return max(one.value for one in self.holds if one.value is not None)
