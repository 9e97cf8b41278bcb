"""What is wrong with the clock of a table: counters that overflow, rows sent twice, repeated stamps, resets."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.columns import TIME, Column
from servotwin.logs.defined import defined_times, is_defined
from servotwin.logs.mend_names import CLOCK16, DROP, RESET, SPREAD, TORN
from servotwin.logs.mends import between, say
from servotwin.logs.stamps import CLOCKS, stamps_of
from servotwin.tables import TextTable, said_lines

Array = NDArray[np.float64]

_NANOSECONDS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
# period of a counter [ns] -> what it is
_OVERFLOWS = {2**32 * 1000: "micros() begins again after 4294.967296 s", 2**32 * 10**6: (
    "millis() begins again after 4294967.296 s")}
_OVERFLOWS_16 = (2**16 * 1000, 2**16 * 10**6)
_STEPS = 2.0  # usual steps: one more or less than a single one
_LONG = 50.0  # usual steps: a shorter period may be anything
_NEAR = 5.5  # usual steps: how far apart neighbours are without a row that is torn
_FEWEST = 3  # rows of a log
_SENT_TWICE = 2  # rows, and all of their cells alike


@dataclass(frozen=True)
class Timed:
    """Rows of a table with their times [s]."""

    table: TextTable
    time: Array


@dataclass
class _Rows:
    """A table on its way, with the stamps of its rows in the unit of the file."""

    table: TextTable
    stamps: Array
    column: Column
    mends: Collection[str]

    @property
    def usual(self) -> float:
        """The usual step of the stamps."""
        steps = np.diff(self.stamps)
        return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0

    @property
    def unit(self) -> float:
        """Nanoseconds of one count."""
        return _NANOSECONDS.get(self.column.unit, 10**9) * abs(self.column.scale)

    def drop(self, gone: NDArray[np.bool_], remark: str) -> None:
        """Leave rows out."""
        self.table, self.stamps = self.table.without(gone, remark), self.stamps[~gone]


def timed(table: TextTable, column: Column, mends: Collection[str]) -> list[Timed]:
    """Return the logs of a table, each with its times: one, or where resets are mended as many as there are.

    Raises
    ------
    InputError
        If time stands still or runs backwards, and what to make of it is not certain and was not said.
    """
    if is_defined(column.column):
        return [Timed(table, defined_times(column.column, len(table.rows)))]
    stamps = _stamps(table, column)
    rows = _Rows(table, stamps, replace(column, unit="s") if column.unit in CLOCKS else column, mends)
    starts = [0, *_backwards(rows), len(rows.stamps)]
    parts = []
    for first, stop in pairwise(starts):
        if len(starts) > 2 and stop - first < _FEWEST:
            continue
        parts.append(_forwards(_part(rows, first, stop, alone=len(starts) == 2)))
    if not parts:
        _refuse(rows, starts[1], RESET)
    return parts


def _part(rows: _Rows, first: int, stop: int, *, alone: bool) -> _Rows:
    if alone:
        return rows
    out = np.ones(len(rows.stamps), np.bool_)
    out[first:stop] = False
    lines = f"lines {rows.table.rows[first].line} to {rows.table.rows[stop - 1].line}"
    table = rows.table.without(out, f"{lines} are a log of their own: the clock begins again")
    return _Rows(table, rows.stamps[first:stop], rows.column, rows.mends)


# ---------------------------------------------------------------------------------------- times that run backwards

def _backwards(rows: _Rows) -> list[int]:
    """Mend what runs backwards, and return where the clock began again."""
    starts: list[int] = []
    at = 1
    while True:
        back = np.flatnonzero(np.diff(rows.stamps[at - 1:]) < 0.0)
        if not back.size:
            return starts
        k = at + int(back[0])
        if _overflowed(rows, k) or _sent_twice(rows, k):
            at = max(k, 1)
        elif (torn := _misfit(rows, k)) is not None:
            if TORN not in rows.mends:
                _refuse(rows, k, TORN, f"leaves out line {rows.table.rows[torn].line}, whose time fits nowhere")
            gone = np.zeros(len(rows.stamps), np.bool_)
            gone[torn] = True
            rows.drop(gone, f"line {rows.table.rows[torn].line} is torn: its time fits nowhere; left out")
            at = max(k - 1, 1)
        elif RESET in rows.mends:
            starts.append(k)
            at = k + 1
        else:
            _refuse(rows, k, RESET)


def _overflowed(rows: _Rows, k: int) -> bool:
    """Join times of a counter that began again at a power of two, where that is certain or was said."""
    back = rows.stamps[k - 1] - rows.stamps[k]
    found = next((period for period in (*_OVERFLOWS, *_OVERFLOWS_16) if period > _LONG * rows.usual * rows.unit
                  and 0.0 < period / rows.unit - back <= _STEPS * rows.usual), None)
    if found is None:
        return False
    line = rows.table.rows[k].line
    if found in _OVERFLOWS_16:
        if CLOCK16 not in rows.mends:
            _refuse(rows, k, CLOCK16, f"joins them: a counter of 16 bits begins again after {found / 1e9:g} s")
        remark = f"a counter of 16 bits begins again in line {line}; its times are joined"
    else:
        remark = f"{_OVERFLOWS[found]} in line {line}; its times are joined"
    rows.stamps = np.concatenate([rows.stamps[:k], rows.stamps[k:] + found / rows.unit])
    rows.table = rows.table.without(np.zeros(len(rows.stamps), np.bool_), remark)
    return True


def _sent_twice(rows: _Rows, k: int) -> bool:
    """Leave out rows that are the same, cell by cell, as those before that have their stamps."""
    begin = int(np.searchsorted(rows.stamps[:k], rows.stamps[k]))
    if (np.diff(rows.stamps[:k]) < 0.0).any() or begin >= k or rows.stamps[begin] != rows.stamps[k]:
        return False
    cells = [row.cells[rows.table.added:] for row in rows.table.rows]
    count = min(k - begin, len(cells) - k)
    if count < _SENT_TWICE or cells[begin:begin + count] != cells[k:k + count]:
        return False
    gone = np.zeros(len(cells), np.bool_)
    gone[k:k + count] = True
    rows.drop(gone, f"lines {rows.table.rows[k].line} to {rows.table.rows[k + count - 1].line} are those from line "
              f"{rows.table.rows[begin].line} on once more, and left out")
    return True


def _misfit(rows: _Rows, k: int) -> int | None:
    """Return the single row without which time goes on as it should; None if that is none."""
    stamps, near = rows.stamps, _NEAR * rows.usual
    if any(True for _ in between(rows.table, k)):
        return None
    if k >= 2 and 0.0 < stamps[k] - stamps[k - 2] <= near:
        return k - 1
    if k + 1 < len(stamps) and 0.0 < stamps[k + 1] - stamps[k - 1] <= near:
        return k
    return None


# -------------------------------------------------------------------------------------------- times that stand still

def _forwards(rows: _Rows) -> Timed:
    same = np.append(False, np.diff(rows.stamps) == 0.0)
    if same.any():
        lines = said_lines([rows.table.rows[k].line for k in np.flatnonzero(same).tolist()])
        if DROP in rows.mends:
            rows.drop(same, f"{lines}: the stamp of the row before; left out")
        elif SPREAD in rows.mends:
            rows.stamps = _spread(rows.stamps, rows.usual)
            rows.table = rows.table.without(np.zeros(len(same), np.bool_), f"{lines}: the stamp of the row before; "
                                            "spread up to the next one")
        else:
            k = int(np.argmax(same))
            drop = say(DROP, rows.mends, f"leaves out {int(same.sum())} such rows" if same.sum() > 1 else "")
            _refuse(rows, k, "", f"{drop}, {say(SPREAD, rows.mends)}")
    return Timed(rows.table, rows.column.to_si(rows.stamps, TIME))


def _spread(stamps: Array, usual: float) -> Array:
    """Return stamps of which equal ones are spread up to the next other one.

    Examples
    --------
    >>> _spread(np.array([0.0, 10.0, 10.0, 20.0, 20.0]), 10.0).tolist()
    [0.0, 10.0, 15.0, 20.0, 25.0]
    """
    values, first, count = np.unique(stamps, return_index=True, return_counts=True)
    room = np.append(np.diff(values), usual)
    place = np.arange(len(stamps)) - np.repeat(first, count)
    return np.asarray(stamps + place * np.repeat(room / count, count))


def _refuse(rows: _Rows, k: int, mend: str, effect: str = "") -> NoReturn:
    """Raise what is wrong with the time of a row, and what to type."""
    time = rows.column.to_si(rows.stamps, TIME)
    stands = "stands still" if time[k] == time[k - 1] else "runs backwards"
    said = say(mend, rows.mends, effect) if mend else effect
    raise InputError(f"{rows.table.path}: line {rows.table.rows[k].line}, {rows.column.column}: time {stands}",
                     got=f"{time[k]:.9g} s after {time[k - 1]:.9g} s in line {rows.table.rows[k - 1].line}",
                     allowed=f"increasing times; {said}")


# -------------------------------------------------------------------------------------------------------- stamps

def _stamps(table: TextTable, column: Column) -> Array:
    """Return the stamps of all rows in the unit of the file."""
    if column.unit in CLOCKS:
        stamps = stamps_of(table, column.column)
        if stamps is None or stamps.unit != column.unit:
            raise InputError(f"{table.path}: line {table.rows[0].line}, {column.column}",
                             got=table.cells(column.column)[0] or "nothing", allowed=CLOCKS[column.unit])
        return stamps.time
    return _since_first(table, column) if column.from_first else table.numbers(column.column)


def _since_first(table: TextTable, column: Column) -> Array:
    """Return stamps less the first one, subtracted before they are rounded: nanoseconds since 1970 have 19 digits."""
    cells = table.cells(column.column)
    try:
        stamps = [Decimal(cell.replace(",", ".", 1) if table.decimal == "," else cell) for cell in cells]
        return np.array([float(stamp - stamps[0]) for stamp in stamps])
    except (InvalidOperation, OverflowError):
        # not all are plain numbers: the ordinary way names the line
        values = table.numbers(column.column)
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused with its line
            return np.asarray(values - values[0])
