"""A function of time as a table of pieces: what every command and every recorded torque lowers to.

From its start, and until the next piece starts, a piece is

    y(t) = value + slope s + amplitude sin(phase + frequency s + sweep s²/2),    s = t − start

so it is constant, linear, a sinusoid or a linear chirp. The first piece also holds before its own start.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from operator import itemgetter, lt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.physics.elementary import cos, sin
from servotwin.physics.laws import array_form

_FEW = 16  # pieces, for which plain Python is faster than arrays


class Piece(NamedTuple):
    """One piece of a function of time; `value`, `slope` and `amplitude` carry the function's unit."""

    start: float = 0.0
    value: float = 0.0
    slope: float = 0.0
    amplitude: float = 0.0
    frequency: float = 0.0
    phase: float = 0.0
    sweep: float = 0.0


_WIDTH = len(Piece._fields)


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
        y += amplitude * sin(phase + (frequency + 0.5 * sweep * s) * s)
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
        rate += amplitude * (frequency + sweep * s) * cos(phase + (frequency + 0.5 * sweep * s) * s)
    return rate


def piece_range(piece: Piece, end: float) -> tuple[float, float]:
    """Return bounds of the piece between its start and `end` [s]; a sinusoid counts with its whole amplitude.

    Examples
    --------
    >>> piece_range(Piece(value=1.0, slope=2.0), 3.0)
    (1.0, 7.0)
    """
    start, first, slope, amplitude, _, _, _ = piece
    if slope == 0.0:
        return first - abs(amplitude), first + abs(amplitude)
    last = first + slope * (end - start)
    return min(first, last) - abs(amplitude), max(first, last) + abs(amplitude)


@dataclass(frozen=True)
class Pieces:
    """A right-continuous function of time; `table` is sorted by start and not empty."""

    table: tuple[Piece, ...]
    numbers: array[float] = field(init=False, repr=False, compare=False)
    """All numbers of the table, piece after piece; not to be written to."""
    _starts: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.table:
            raise InputError("pieces", got="an empty table", allowed="at least one piece")
        numbers = tuple(chain.from_iterable(self.table))
        if not (math.isfinite(sum(numbers)) or all(map(math.isfinite, numbers))):  # huge ones have no finite sum
            bad = next(piece for piece in self.table if not all(map(math.isfinite, piece)))
            raise InputError("piece", got=tuple(bad), allowed="finite numbers")
        starts = numbers[::_WIDTH]
        if not all(map(lt, starts, starts[1:])):
            raise InputError("pieces", got="starts that do not increase", allowed="increasing times")
        object.__setattr__(self, "numbers", array("d", numbers))
        object.__setattr__(self, "_starts", starts)

    @cached_property
    def rows(self) -> NDArray[np.float64]:
        """The table as an array, a row for each piece; not to be written to."""
        return np.frombuffer(self.numbers).reshape(-1, _WIDTH)

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """Lowest and highest value until the last piece starts (a sinusoid counts with its whole amplitude)."""
        if len(self.table) > _FEW:
            return self.bounds(self._starts[-1])
        ranges = self._ranges()
        if len(ranges) == 1:
            return float(ranges[0][0]), float(ranges[0][1])
        return float(min(ranges)[0]), float(max(ranges, key=itemgetter(1))[1])

    def _ranges(self) -> list[tuple[float, float]]:
        """Return bounds of each piece until the next one, or the last one, starts."""
        return list(map(piece_range, self.table, self._starts[1:] + self._starts[-1:]))

    def extreme(self, lowest: bool) -> tuple[int, float]:
        """Return number and start [s] of the piece with the lowest, or highest, of the `extremes`.

        Examples
        --------
        >>> Pieces((Piece(value=1.0), Piece(start=2.0, value=3.0))).extreme(False)
        (1, 2.0)
        """
        ranges = [both[not lowest] for both in self._ranges()]
        k = ranges.index(min(ranges) if lowest else max(ranges))
        return k, self._starts[k]

    def __reduce__(self) -> tuple[type[Pieces], tuple[tuple[Piece, ...]]]:
        """Pickle the table alone, so that equal tables pickle to equal bytes."""
        return Pieces, (self.table,)

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


def table_rows(functions: Iterable[Pieces]) -> NDArray[np.float64]:
    """Return the tables of many functions as one array, table behind table.

    Examples
    --------
    >>> table_rows([constant_pieces(1.0), constant_pieces(2.0)])[:, 1].tolist()
    [1.0, 2.0]
    """
    return np.frombuffer(b"".join([pieces.numbers for pieces in functions])).reshape(-1, _WIDTH)
