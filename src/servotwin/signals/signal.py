"""A commanded signal: a kind, a table of pieces, and what it was just before the start."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import units
from servotwin.errors import CommandError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from servotwin.physics.pieces import Pieces

# unit of the caller -> (kind of command, dimension)
KINDS: dict[str, tuple[str, str]] = {
    "deg": ("angle", "angle"), "rad": ("angle", "angle"),
    "us": ("pulse_width", "time"), "ms": ("pulse_width", "time"), "s": ("pulse_width", "time"),
    "V": ("voltage", "voltage"), "mV": ("voltage", "voltage"),
}
KIND_NAMES = ("angle", "pulse_width", "voltage")
"""Kinds of commands, by the number that a header has for them."""

_HEADER = np.dtype([("kind", np.int64), ("initial", np.float64), ("lowest", np.float64), ("highest", np.float64),
                    ("frame_period", np.float64), ("first_change", np.float64), ("pieces", np.int64),
                    ("edges", np.int64)])
_CODES = {unit: KIND_NAMES.index(kind) for unit, (kind, _) in KINDS.items()}
_pack = Struct("=qdddddqq").pack


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
    header: bytes = field(init=False, repr=False, compare=False)
    """What `headers` reads of it."""

    def __post_init__(self) -> None:
        kind = kind_of(self.unit)
        if not math.isfinite(self.initial):
            raise CommandError("value just before t = 0", got=self.initial, allowed="a finite number")
        if self.frame_period is not None:
            if kind != "pulse_width":
                raise CommandError("frame_period", got=self.frame_period,
                                   allowed="none: only a pulse signal (unit us, ms or s) has frames")
            if not (units.is_finite(self.frame_period) and self.frame_period > 0.0):
                raise CommandError("frame_period", got=self.frame_period, allowed="a positive number [s]")
        low, high = self.pieces.extremes
        if kind == "pulse_width" and low <= 0.0:
            raise CommandError("pulse width", got=low, allowed="a positive width [s]")
        change = self.first_change
        object.__setattr__(self, "header", _pack(
            _CODES[self.unit], self.initial, min(low, self.initial), max(high, self.initial),
            self.frame_period or math.nan, math.nan if change is None else change, len(self.pieces.table),
            -1 if self.edges is None else len(self.edges)))

    @property
    def first_change(self) -> float | None:
        """When it changes first, or its first pulse comes [s]; None where it never changes.

        A single pulse that comes late is how a servo is left without pulses.

        Examples
        --------
        >>> from servotwin.signals import constant, pulse_train, step
        >>> step(0.0, 90.0, at=2.0, unit="deg").first_change, constant(1500.0, unit="us").first_change
        (2.0, None)
        >>> pulse_train([0.5, 0.52], [1500.0, 1500.0]).first_change
        0.5
        """
        if self.edges is not None:
            return self.edges[0] if len(self.edges) > 1 else None
        table = self.pieces.table
        first = table[0]
        if first.slope or first.amplitude:
            return first.start
        return table[1].start if len(table) > 1 else None

    @property
    def kind(self) -> str:
        """What is commanded: "angle", "pulse_width" or "voltage"."""
        return kind_of(self.unit)

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """Return the values (SI) at `time` [s], any shape."""
        return self.pieces(time)


def headers(signals: Iterable[Signal]) -> NDArray[Any]:
    """Return what there is to know of many signals but their pieces, as an array of records.

    `kind` is the place in `KIND_NAMES`; `lowest` and `highest` (SI) include `initial`; `frame_period` and
    `first_change` [s] are nan where there is none; `pieces` and `edges` count, and `edges` is -1 where there are none.

    Examples
    --------
    >>> from servotwin.signals import constant, step
    >>> headers([constant(1.5, unit="ms"), step(0.0, 2.0, at=0.1, unit="V")])[["kind", "highest", "pieces"]].tolist()
    [(1, 0.0015, 1), (2, 2.0, 2)]
    """
    return np.frombuffer(b"".join([signal.header for signal in signals]), _HEADER)


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
