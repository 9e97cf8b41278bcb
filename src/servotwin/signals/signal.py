"""A commanded signal: a kind, a table of pieces, and what it was just before the start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin import units
from servotwin.errors import CommandError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from servotwin.physics.pieces import Pieces

# unit of the caller -> (kind of command, dimension)
KINDS: dict[str, tuple[str, str]] = {
    "deg": ("angle", "angle"), "rad": ("angle", "angle"),
    "us": ("pulse_width", "time"), "ms": ("pulse_width", "time"), "s": ("pulse_width", "time"),
    "V": ("voltage", "voltage"), "mV": ("voltage", "voltage"),
}


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A command over time.

    Parameters
    ----------
    pieces : Pieces
        Values in SI: rad, s or V according to `unit`.
    unit : str
        The unit in which the caller gave it: "deg", "rad", "us", "ms", "s", "V" or "mV".
    initial : float
        Value just before t = 0 (SI); a servo starts at rest at the angle that it asks for.
    frame_period : float, optional
        Period of the transmitter's pulses [s]; overrides the servo's.
    edges : tuple of float, optional
        Rising edges of the pulses, where they are given one by one [s].

    Examples
    --------
    >>> from servotwin.signals import step
    >>> signal = step(0.0, 90.0, at=0.1, unit="deg")
    >>> signal.kind, signal.initial, [round(float(signal(t)), 4) for t in (0.0, 0.1)]
    ('angle', 0.0, [0.0, 1.5708])
    """

    pieces: Pieces
    unit: str
    initial: float
    frame_period: float | None = None
    edges: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        kind_of(self.unit)
        if not math.isfinite(self.initial):
            raise CommandError("value just before t = 0", got=self.initial, allowed="a finite number")
        if self.frame_period is not None:
            if self.kind != "pulse_width":
                raise CommandError("frame_period", got=self.frame_period,
                                   allowed="none: only a pulse signal (unit us, ms or s) has frames")
            if not (units.is_finite(self.frame_period) and self.frame_period > 0.0):
                raise CommandError("frame_period", got=self.frame_period, allowed="a positive number [s]")
        if self.kind == "pulse_width" and self.pieces.extremes[0] <= 0.0:
            raise CommandError("pulse width", got=self.pieces.extremes[0],
                               allowed="a positive width [s]")

    @property
    def kind(self) -> str:
        """What is commanded: "angle", "pulse_width" or "voltage"."""
        return kind_of(self.unit)

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """Return the values (SI) at `time` [s], any shape."""
        return self.pieces(time)


def kind_of(unit: str) -> str:
    """Return the kind of command that a unit stands for.

    Raises
    ------
    CommandError
        If no command is given in this unit.
    """
    if not isinstance(unit, str) or unit not in KINDS:
        raise CommandError("unit of a command", got=unit, allowed=", ".join(KINDS))
    return KINDS[unit][0]


def in_si(value: float, unit: str, what: str) -> float:
    """Return one number of a signal in SI.

    Raises
    ------
    CommandError
        If it is not a finite number, or the unit is no command's.
    """
    kind_of(unit)
    if not units.is_finite(value):
        raise CommandError(what, got=value, allowed=f"a finite number [{unit}]")
    return units.to_si(float(value), unit, KINDS[unit][1])
