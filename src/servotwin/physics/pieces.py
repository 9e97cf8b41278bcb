"""A function of time as a table of pieces: what every command and every recorded torque lowers to.

From its start, and until the next piece starts, a piece is

    y(t) = value + slope s + amplitude sin(phase + frequency s + sweep s²/2),    s = t − start

so it is constant, linear, a sinusoid or a linear chirp. The first piece also holds before its own start.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.physics.laws import array_form


class Piece(NamedTuple):
    """One piece of a function of time; `value`, `slope` and `amplitude` carry the function's unit."""

    start: float = 0.0
    value: float = 0.0
    slope: float = 0.0
    amplitude: float = 0.0
    frequency: float = 0.0
    phase: float = 0.0
    sweep: float = 0.0


def piece_value(piece: Piece, time: float) -> float:
    """Return the piece at `time` [s].

    Examples
    --------
    >>> piece_value(Piece(start=1.0, value=2.0, slope=3.0), 2.0)
    5.0
    """
    start, value, slope, amplitude, frequency, phase, sweep = piece
    s = time - start
    y = value + slope * s
    if amplitude != 0.0:
        y += amplitude * math.sin(phase + (frequency + 0.5 * sweep * s) * s)
    return y


def piece_rate(piece: Piece, time: float) -> float:
    """Return the time derivative of the piece at `time` [s].

    Examples
    --------
    >>> piece_rate(Piece(start=1.0, value=2.0, slope=3.0), 2.0)
    3.0
    """
    start, _, slope, amplitude, frequency, phase, sweep = piece
    s = time - start
    rate = slope
    if amplitude != 0.0:
        rate += amplitude * (frequency + sweep * s) * math.cos(phase + (frequency + 0.5 * sweep * s) * s)
    return rate


def piece_range(piece: Piece, end: float) -> tuple[float, float]:
    """Return bounds of the piece between its start and `end` [s]; a sinusoid counts with its whole amplitude.

    Examples
    --------
    >>> piece_range(Piece(value=1.0, slope=2.0), 3.0)
    (1.0, 7.0)
    """
    first = piece.value
    last = first + piece.slope * (end - piece.start) if piece.slope != 0.0 else first
    return min(first, last) - abs(piece.amplitude), max(first, last) + abs(piece.amplitude)


@dataclass(frozen=True)
class Pieces:
    """A right-continuous function of time; `table` is sorted by start and not empty."""

    table: tuple[Piece, ...]

    def __post_init__(self) -> None:
        if not self.table:
            raise InputError("pieces", got="an empty table", allowed="at least one piece")
        for piece in self.table:
            if not all(map(math.isfinite, piece)):
                raise InputError("piece", got=tuple(piece), allowed="finite numbers")
        if any(b <= a for a, b in zip(self._starts, self._starts[1:], strict=False)):
            raise InputError("pieces", got="starts that do not increase", allowed="increasing times")

    @cached_property
    def _starts(self) -> tuple[float, ...]:
        return tuple(piece.start for piece in self.table)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The table as an array, a row for each piece; not to be written to."""
        return np.array(self.table, dtype=np.float64)

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Lowest and highest value until the last piece starts (a sinusoid counts with its whole amplitude)."""
        return self.bounds(self.table[-1].start)

    def extreme(self, lowest: bool) -> tuple[int, float]:
        """Return number and start [s] of the piece with the lowest, or highest, of the `extremes`.

        Examples
        --------
        >>> Pieces((Piece(value=1.0), Piece(start=2.0, value=3.0))).extreme(False)
        (1, 2.0)
        """
        ends = (*self._starts[1:], self._starts[-1])
        ranges = [piece_range(piece, end)[not lowest] for piece, end in zip(self.table, ends, strict=True)]
        k = ranges.index(min(ranges) if lowest else max(ranges))
        return k, self._starts[k]

    def __getstate__(self) -> dict[str, object]:
        """Leave caches out, so that equal tables pickle to equal bytes."""
        return {"table": self.table}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore the table alone."""
        self.__dict__.update(state)

    def at(self, time: float) -> tuple[Piece, float]:
        """Return the piece in force at `time` [s] and the time at which the next one takes over (inf: never)."""
        k = bisect_right(self._starts, time)
        return self.table[max(k - 1, 0)], (self._starts[k] if 0 < k < len(self.table) else self._end_of_first(k))

    def _end_of_first(self, k: int) -> float:
        return self._starts[1] if k == 0 and len(self.table) > 1 else math.inf

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """Return the values at `time` [s], any shape."""
        t = np.asarray(time, dtype=np.float64)
        k = np.maximum(np.searchsorted(self.rows[:, 0], t, side="right") - 1, 0)
        return np.asarray(array_form(piece_value)(Piece(*self.rows[k].transpose((-1, *range(t.ndim)))), t))

    def scaled(self, gain: float, offset: float) -> Pieces:
        """Return gain · y + offset.

        Examples
        --------
        >>> float(Pieces((Piece(value=2.0),)).scaled(3.0, 1.0)(0.0))
        7.0
        """
        return Pieces(tuple(p._replace(value=gain * p.value + offset, slope=gain * p.slope,
                                       amplitude=gain * p.amplitude) for p in self.table))

    def bounds(self, end: float = math.inf) -> tuple[float, float]:
        """Return the lowest and highest value until `end` [s] (a sinusoid counts with its whole amplitude)."""
        start, value, slope, amplitude = self.rows[:max(bisect_right(self._starts, end), 1), :4].T
        ends = np.maximum(np.minimum(np.append(start[1:], math.inf), end), start)
        with np.errstate(invalid="ignore", over="ignore"):
            last = np.where(slope != 0.0, value + slope * (ends - start), value)
        size = np.abs(amplitude)
        return float((np.minimum(value, last) - size).min()), float((np.maximum(value, last) + size).max())


def constant_pieces(value: float) -> Pieces:
    """Return the function that is `value` at all times."""
    return Pieces((Piece(value=value),))
