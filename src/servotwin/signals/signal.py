"""A commanded signal: a kind, a table of pieces, and what it was just before the start."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin import units
from servotwin.errors import CommandError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from servotwin.physics.pieces import Pieces


# --- Samples without a value: no pulses are sent there ----------------------------------------------------------------

def filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with each nan replaced by the number before it, or where there is none by the first number.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least one is a number.

    Examples
    --------
    >>> filled(np.array([np.nan, 1.0, np.nan, 2.0])).tolist()
    [1.0, 1.0, 1.0, 2.0]
    """
    there = ~np.isnan(values)
    latest = np.maximum.accumulate(np.where(there, np.arange(values.size), -1))
    return np.asarray(values[np.where(latest < 0, np.argmax(there), latest)])


def spans(time: NDArray[np.float64], silent: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return from when to when samples are silent [s]; before the first sample it is as there, after the last too.

    Examples
    --------
    >>> spans(np.array([0.0, 1.0, 2.0, 3.0]), np.array([True, False, True, True]))
    ((-inf, 1.0), (2.0, inf))
    """
    turns = np.flatnonzero(np.diff(np.concatenate(([False], silent, [False]))))
    times = np.append(time, math.inf)[turns]
    if turns.size and turns[0] == 0:
        times[0] = -math.inf
    return tuple(zip(times[::2].tolist(), times[1::2].tolist(), strict=True))


# --- Times that are probably a thousand times too long or too short ---------------------------------------------------

_FEWEST = 3  # samples, to tell a rhythm
_SLOW = 10.0  # s between samples: 20 ms would be 20 s
_WIDEST = 0.02  # s
_FAST = {"angle": 1000.0, "pulse_width": 0.6}  # rad/s, s/s: a hundred times what servos follow


def warn_of_time_base(time: NDArray[np.float64], value: NDArray[np.float64], kind: str, what: str, *,
                      stacklevel: int = 3) -> None:
    """Warn if samples come too far apart, or move too fast, for their times to be what they say.

    Parameters
    ----------
    time, value : ndarray, shape (n,)
        In SI, times increasing.
    kind : {"angle", "pulse_width", "voltage"}
    what : str
        Name of the sampled signal, for errors.
    stacklevel : int
        As in `warnings.warn`, counted from here; 3 is the caller of the caller.
    """
    if time.size < _FEWEST:
        return
    apart = float(np.median(np.diff(time)))
    if apart >= _SLOW:
        warnings.warn(f"{what}: its samples come {apart:g} s apart; were the times given in milliseconds?",
                      stacklevel=stacklevel)
    steps = np.abs(np.diff(value))
    span = float(time[-1] - time[0])
    if kind == "pulse_width" and value.max() > _WIDEST:
        return  # its unit is another one
    if kind in _FAST and np.count_nonzero(steps) > 1 and steps.sum() > _FAST[kind] * span:
        warnings.warn(f"{what}: its {time.size} samples go to and fro within {1e3 * span:g} ms, faster than any servo; "
                      "were the times given in seconds and read as milliseconds?", stacklevel=stacklevel)


# --- A commanded signal: a kind, a table of pieces, and what it was just before the start -----------------------------

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
_MOST_FRAMES = 1e7
_SAME = 1e-9  # of a frame: instants that are nearer are one, as for the engine


@dataclass(frozen=True, kw_only=True, repr=False)
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
    silences : tuple of (float, float)
        Spans start ≤ t < end in which no pulses are sent, one after the other; the first may begin at −∞, the last end
        at ∞ [s]. Frames count on meanwhile. Their values are held through it, and no servo sees them.

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
    silences: tuple[tuple[float, float], ...] = ()
    header: bytes = field(init=False, repr=False, compare=False)
    """The attributes that `headers` reads."""

    def __repr__(self) -> str:
        pieces, edges = len(self.pieces.table), "" if self.edges is None else f", {len(self.edges)} edges"
        return f"Signal({self.kind}, given in {self.unit}, {pieces} piece{'s'[:pieces != 1]}{edges})"

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
        if self.silences:
            self._check_silences()
        low, high = self.pieces.extremes
        if kind == "pulse_width" and low <= 0.0:
            raise CommandError("pulse width", got=low, allowed="a positive width [s]")
        change = self.first_change
        object.__setattr__(self, "header", _pack(
            _CODES[self.unit], self.initial, min(low, self.initial), max(high, self.initial),
            self.frame_period or math.nan, math.nan if change is None else change, len(self.pieces.table),
            -1 if self.edges is None else len(self.edges)))

    def _check_silences(self) -> None:
        if self.kind == "voltage":
            raise CommandError("silences", got="a voltage", allowed="pulses or angles: a voltage is always there")
        if self.edges is not None:
            raise CommandError("silences", got="edges too", allowed="one of both: edges tell of silences by themselves")
        times = [time for span in self.silences for time in span]
        if not all(a < b for a, b in pairwise(times)):  # nan too
            raise CommandError("silences", got=self.silences, allowed="spans (start, end), one after the other [s]")

    def delayed(self, by: float) -> Signal:
        """Return it later by a time [s], or earlier; what it was just before the start stays.

        Raises
        ------
        CommandError
            If the time is not finite.

        Examples
        --------
        >>> from servotwin.signals import sine
        >>> round(float(sine(mean=0.0, amplitude=1.0, frequency=1.0, unit="rad").delayed(2.0)(2.25)), 12)
        1.0
        """
        if not units.is_finite(by):
            raise CommandError("delayed(by)", got=by, allowed="a finite number [s]")
        rows = tuple(piece._replace(start=piece.start + by) for piece in self.pieces.table)
        return replace(self, pieces=type(self.pieces)(rows),
                       edges=None if self.edges is None else tuple(edge + by for edge in self.edges),
                       silences=tuple((start + by, end + by) for start, end in self.silences))

    def framed(self, period: float, until: float) -> Signal:
        """Return it with its pulses one by one, those of regular frames in no silence; itself where it has no silence.

        Parameters
        ----------
        period : float
            Of frames, of which the first begins at t = 0 [s].
        until : float
            How long pulses are wanted for; a few more follow [s].

        Raises
        ------
        CommandError
            If there are more than ten million frames.

        Examples
        --------
        >>> from servotwin.signals import samples
        >>> signal = samples([0.0, 0.02, 0.06], [1500.0, float("nan"), 1600.0], unit="us")
        >>> signal.framed(0.02, 0.06).edges
        (0.0, 0.06, 0.08, 0.1)
        """
        if not self.silences:
            return self
        frames = until / period
        if not frames <= _MOST_FRAMES:
            raise CommandError("duration / frame period", got=f"{frames:.3g} frames",
                               allowed=f"at most {_MOST_FRAMES:.0e} where some pulses are not sent")
        edges = np.arange(math.ceil(frames) + 3) * period
        starts, ends = np.array(self.silences).T
        at = edges + _SAME * period  # a pulse that is due as the silence begins is not sent
        which = np.searchsorted(starts, at, side="right") - 1
        silent = (which >= 0) & (at < ends[which])
        return replace(self, edges=tuple(edges[~silent].tolist()), silences=())

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
        changes = [piece.start for piece in table[1:2]]
        changes += [start if start > 0.0 else end for start, end in self.silences if end > 0.0]
        return min((change for change in changes if change < math.inf), default=None)

    @property
    def kind(self) -> str:
        """The kind of the command: "angle", "pulse_width" or "voltage"."""
        return kind_of(self.unit)

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """Return the values (SI) at `time` [s], any shape."""
        return self.pieces(time)


def headers(signals: Iterable[Signal]) -> NDArray[Any]:
    """Return all data of many signals but their pieces, as an array of records.

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
