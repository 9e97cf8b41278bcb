"""The shapes of commands that a bench can be given, as rows of pieces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from servotwin.physics.pieces import Piece, piece_range

if TYPE_CHECKING:
    from servotwin.models.engine.live.screen import Floats

FIELDS: dict[str, tuple[str, ...]] = {
    "hold": ("value",),
    "step": ("low", "high", "period"),
    "sine": ("mean", "amplitude", "frequency"),
    "sweep": ("mean", "amplitude", "start_frequency", "end_frequency", "duration"),
    "staircase": ("low", "high", "steps", "dwell"),
    "recorded": ("time", "value", "hold"),
}
"""What each shape is given by, beside its `unit`."""
PERIODS = 1000  # of a step that repeats: then it stays
_HOLD, _STEP, _SINE, _SWEEP, _STAIRCASE, RECORDED = range(6)
_TURN = 2.0 * math.pi


def shaped(shape: int, given: Floats, time: Floats, value: Floats, table: Floats) -> int:
    """Put the pieces of a shape that begins at 0 into a table; return how many there are.

    Parameters
    ----------
    shape : int
        Its place in `FIELDS`.
    given : ndarray
        Its numbers in the order of its fields; of a record 1 for straight lines between samples, 0 for steps.
    time, value : ndarray, shape (n,)
        Of a record; times count from the first.
    table : ndarray, shape (m, 7)
    """
    if shape == _HOLD or (shape == _STEP and given[2] == 0.0):
        _put(table, 0, Piece(0.0, given[0] if shape == _HOLD else given[1], 0.0, 0.0, 0.0, 0.0, 0.0))
        return 1
    if shape == _STEP:
        count = 0
        for half in range(2 * PERIODS + 1):
            count = _held(table, count, 0.5 * given[2] * half, given[0] if half % 2 == 0 else given[1])
        return count
    if shape == _SINE:
        _put(table, 0, Piece(0.0, given[0], 0.0, given[1], _TURN * given[2], 0.0, 0.0))
        return 1
    if shape == _SWEEP:
        first, last, duration = _TURN * given[2], _TURN * given[3], given[4]
        _put(table, 0, Piece(0.0, given[0], 0.0, given[1], first, 0.0, (last - first) / duration))
        _put(table, 1, Piece(duration, given[0], 0.0, given[1], last, 0.5 * (first + last) * duration % _TURN, 0.0))
        return 2
    if shape == _STAIRCASE:
        return _staircase(given[0], given[1], round(given[2]), given[3], table)
    return _recorded(given[0] == 1.0, time, value, table)


def _staircase(low: float, high: float, steps: int, dwell: float, table: Floats) -> int:
    count = 0
    for k in range(2 * steps + 1):
        n = min(k, 2 * steps - k)
        count = _held(table, count, dwell * k, high if n == steps else low + n * ((high - low) / steps))
    return count


def _recorded(lines: bool, time: Floats, value: Floats, table: Floats) -> int:
    count = 0
    for k in range(len(time)):
        if not lines:
            count = _held(table, count, time[k] - time[0], value[k])
            continue
        slope = 0.0
        if k + 1 < len(time):
            slope = (value[k + 1] - value[k]) / (time[k + 1] - time[0] - (time[k] - time[0]))
        _put(table, k, Piece(time[k] - time[0], value[k], slope, 0.0, 0.0, 0.0, 0.0))
        count = k + 1
    return count


def _held(table: Floats, count: int, time: float, value: float) -> int:
    """Put a value that holds from a time on behind others, if it is another one; return how many there are then."""
    if count > 0 and table[count - 1, 1] == value:
        return count
    _put(table, count, Piece(time, value, 0.0, 0.0, 0.0, 0.0, 0.0))
    return count + 1


def _put(table: Floats, n: int, piece: Piece) -> None:
    for k in range(len(piece)):
        table[n, k] = piece[k]


def scaled(table: Floats, count: int, gain: float, offset: float) -> None:
    """Let pieces be gain · y + offset."""
    for n in range(count):
        table[n, 1] = gain * table[n, 1] + offset
        table[n, 2] *= gain
        table[n, 3] *= gain


def extremes(table: Floats, count: int) -> tuple[float, float, int, int]:
    """Return the lowest and the highest value until the last piece starts, and in which pieces these are.

    A sinusoid counts with its whole amplitude.
    """
    low, high, lowest, highest = math.inf, -math.inf, 0, 0
    for n in range(count):
        row = table[n]
        end = table[min(n + 1, count - 1), 0]
        least, most = piece_range(Piece(row[0], row[1], row[2], row[3], row[4], row[5], row[6]), end)
        if least < low:
            low, lowest = least, n
        if most > high:
            high, highest = most, n
    return low, high, lowest, highest
