"""Mends of a table before it is a log: the words of `--mend`, and rows that are no rows."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.columns import CLOCKS, COMMANDS, TIME, Column, clock_of, stamps_of
from servotwin.logs.formats import CLOCK16, DROP, MENDS, RESET, SPREAD, THOUSANDS, TORN
from servotwin.logs.log_checks import defined_times, impossible, is_defined, refuse
from servotwin.tables import TextTable, said_lines
from servotwin.tables.reading import MISSING, grouped_in, without_groups

if TYPE_CHECKING:
    from servotwin.logs.formats import Layout

# --- Mends of a table before it is a log: the words of `--mend`, and rows that are no rows ----------------------------

_MOST_TORN = 0.2  # of the rows: with more the table is another one
_MOSTLY = 0.8  # of the cells of a column
_SWITCHES = ("true", "false", "on", "off", "yes", "no")
_WORD = re.compile(r"[^\W\d_]{2,}")


def checked_mends(words: Sequence[str]) -> tuple[str, ...]:
    """Return the mends that words name.

    Raises
    ------
    InputError
        If there is none of a name, or both ways to treat repeated stamps.

    Examples
    --------
    >>> checked_mends(["torn", "reset"])
    ('torn', 'reset')
    """
    if isinstance(words, str) or not all(isinstance(word, str) for word in words):
        raise InputError("mend", got=words, allowed="a list of " + ", ".join(MENDS))
    for word in words:
        if word not in MENDS:
            raise UnknownNameError("mend", word, MENDS)
    if DROP in words and SPREAD in words:
        raise InputError("mend", got=f"{DROP} and {SPREAD}", allowed="one of them")
    return tuple(dict.fromkeys(words))


def say(word: str, given: Collection[str], effect: str = "") -> str:
    """Return what to type for a mend, together with what was asked for already.

    Examples
    --------
    >>> say("torn", ["reset"], "leaves out 2 rows")
    '--mend reset,torn leaves out 2 rows'
    """
    return f"--mend {','.join([*given, word])} {effect or MENDS[word]}"


# -------------------------------------------------------------------------------------------- what is certain
def without_text(table: TextTable) -> TextTable:
    """Return the table without text between its rows, and without rows that were cut by it or by the end."""
    first = table.added
    lead = [row.cells[first] if len(row.cells) > first else "" for row in table.rows]
    n = len(table.header)
    text = np.array([_is_text(cell) and not _is_row(row.cells, n) for cell, row in zip(lead, table.rows, strict=True)])
    if text.mean() > 1.0 - _MOSTLY:
        return table  # names of runs, say, and no numbers
    if text.any():
        table = table.without(text, f"text in {said_lines(_lines(table, text))} was left out", text=True)
    cut = _cut_off(table)
    if cut.any():
        what = "is" if cut.sum() == 1 else "are"
        table = table.without(cut, f"{said_lines(_lines(table, cut))} {what} cut short by what follows, and left out")
    return table


def _is_text(cell: str) -> bool:
    """Tell whether a row that begins so is text: a word, or the noise of a line, in the place of a number or stamp."""
    if not cell or _is_number(cell) or cell.lower() in MISSING or clock_of(cell):
        return False
    return _WORD.match(cell.lstrip()) is not None or not any(c.isdigit() for c in cell)


def _is_row(cells: Sequence[str], n: int) -> bool:
    """Tell whether a line is a row all the same: one word, such as a note, and numbers."""
    return len(cells) == n and sum(_is_number(cell) or cell.lower() in MISSING for cell in cells) >= max(n - 1, 1)


def _cut_off(table: TextTable) -> NDArray[np.bool_]:
    """Return which rows are too short, and the last ones before a header, text or the end of the file."""
    n, rows = len(table.header), table.rows
    short = np.array([len(row.cells) < n for row in rows])
    if short.all():  # the header is too long
        return np.zeros(len(rows), np.bool_)
    breaks = np.array(table.breaks, dtype=np.int64)
    ends = [*(row.line for row in rows[1:]), None]
    for k in np.flatnonzero(short).tolist():
        after = ends[k]
        short[k] = after is None or bool(((breaks > rows[k].line) & (breaks < after)).any())
    return short


# ----------------------------------------------------------------------------------------------- what is asked for
def without_thousands(table: TextTable, mends: Collection[str]) -> TextTable:
    """Return the table without thousands separators.

    Raises
    ------
    InputError
        If there are some, and it was not asked for.
    """
    found = grouped_in(table, asked=THOUSANDS in mends)
    if found is None:
        return table
    if THOUSANDS not in mends:
        raise InputError(f"{table.path}: line {found.line}, {found.column}", got=found.cell,
                         allowed=f"a number {found.other}, as other cells have it; {say(THOUSANDS, mends)}")
    return without_groups(table, found.mark)


def sound(table: TextTable) -> TextTable:
    """Return the rows that look as most do, by which columns are recognised.

    Raises
    ------
    InputError
        If most have another length than the header.
    """
    n = len(table.header)
    if 2 * sum(len(row.cells) == n or (len(row.cells) > n and not any(row.cells[n:])) for row in table.rows) < len(
            table.rows):
        table.check_lengths()
    bad = _odd(table, range(len(table.header)))
    return table.without(bad) if 0 < bad.sum() < len(bad) else table


def without_torn(table: TextTable, layout: Layout, mends: Collection[str]) -> TextTable:
    """Return the table without rows that are cut, joined, or hold no number, or an impossible one, where one has to be.

    Raises
    ------
    InputError
        If there is such a row, and it was not asked for: names line and column.
    """
    used = [table.header.index(column.column) for column in layout.columns.values() if not is_defined(column.column)]
    torn = _odd(table, used, layout)
    if not torn.all():
        torn[~torn] = impossible(table.without(torn), layout)
    if not torn.any():
        return table
    count = int(torn.sum())
    if TORN in mends and not torn.all():
        return table.without(torn, f"{said_lines(_lines(table, torn))} {'is' if count == 1 else 'are'} torn, and left "
                             "out")
    try:
        _refuse(table, layout, torn)
    except InputError as error:
        if count > _MOST_TORN * len(torn):
            raise
        effect = f"leaves out {count} row{'s' * (count != 1)} that {'are' if count > 1 else 'is'} torn"
        raise InputError(error.what, error.got, f"{error.allowed}; {say(TORN, mends, effect)}") from None
    return table


def _odd(table: TextTable, used: Sequence[int], layout: Layout | None = None) -> NDArray[np.bool_]:
    """Return the rows of another length, or with words among numbers in one of some columns."""
    n = len(table.header)
    bad = np.array([len(row.cells) != n and (len(row.cells) < n or any(row.cells[n:])) for row in table.rows])
    needed, clocks = _needed(table, layout), _clocks(table, layout)
    for k in used:
        clock, missing = k in clocks, k not in needed
        if not clock and _reads(table, k, missing=missing):
            continue
        wrong = np.array([not bad[j] and not (bool(clock_of(row.cells[k])) if clock else _fits(
            table, row.cells[k], missing=missing)) for j, row in enumerate(table.rows)])
        if layout is not None or wrong.mean() < 1.0 - _MOSTLY:
            bad |= wrong
    return bad


def _needed(table: TextTable, layout: Layout | None) -> set[int]:
    """Return the columns whose cells must not be empty."""
    if layout is None:
        return set()
    return {table.header.index(column.column) for name, column in layout.columns.items()
            if (name == TIME or COMMANDS.get(name) == "voltage") and not is_defined(column.column)}


def _clocks(table: TextTable, layout: Layout | None) -> set[int]:
    """Return the columns that hold dates or times of day."""
    columns = () if layout is None else layout.columns.values()
    return {table.header.index(column.column) for column in columns if column.unit in CLOCKS}


def _reads(table: TextTable, k: int, *, missing: bool) -> bool:
    """Tell whether a whole column is numbers, at once, which is faster than cell by cell."""
    try:
        values = table.numbers(table.header[k], missing=np.nan if missing else None)
    except InputError:
        return False
    return missing or bool(np.isfinite(values).all())


def _fits(table: TextTable, cell: str, *, missing: bool) -> bool:
    if cell.lower() in MISSING:
        return missing
    return _is_number(cell.replace(",", ".", 1) if table.decimal == "," else cell) or bool(clock_of(cell)) or (
        cell.lower() in _SWITCHES)


def _refuse(table: TextTable, layout: Layout, torn: NDArray[np.bool_]) -> None:
    """Raise what is wrong with the first torn row."""
    k = int(np.argmax(torn))
    one = replace(table, rows=[table.rows[k]])
    one.check_lengths()
    for name, column in layout.columns.items():
        if not is_defined(column.column):
            _refuse_cell(one, name, column)
    refuse(one, layout)


def _refuse_cell(one: TextTable, name: str, column: Column) -> None:
    cell = one.cells(column.column)[0]
    line = one.rows[0].line
    if column.unit in CLOCKS:
        if not clock_of(cell):
            raise InputError(f"{one.path}: line {line}, {column.column}", got=cell or "nothing",
                             allowed=CLOCKS[column.unit])
        return
    needed = name == TIME or COMMANDS.get(name) == "voltage"
    if needed and cell.lower() in MISSING:
        raise InputError(f"{one.path}: line {line}, {column.column}", got=cell or "nothing", allowed="a number")
    if cell.lower() not in _SWITCHES:
        one.number(line, column.column, cell, missing=np.nan)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", ".", 1))
    except ValueError:
        return False
    return "_" not in cell


def _lines(table: TextTable, rows: NDArray[np.bool_]) -> list[int]:
    return [table.rows[k].line for k in np.flatnonzero(rows).tolist()]


def between(table: TextTable, k: int) -> Iterator[int]:
    """Give the lines of text or headers between a row and the one before it."""
    for line in table.breaks:
        if table.rows[k - 1].line < line < table.rows[k].line:
            yield line

# --- Faults of a table's clock ----------------------------------------------------------------------------------------

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
        _refuse_clock(rows, starts[1], RESET)
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
                _refuse_clock(rows, k, TORN, f"leaves out line {rows.table.rows[torn].line}, whose time fits nowhere")
            gone = np.zeros(len(rows.stamps), np.bool_)
            gone[torn] = True
            rows.drop(gone, f"line {rows.table.rows[torn].line} is torn: its time fits nowhere; left out")
            at = max(k - 1, 1)
        elif RESET in rows.mends:
            starts.append(k)
            at = k + 1
        else:
            _refuse_clock(rows, k, RESET)


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
            _refuse_clock(rows, k, CLOCK16, f"joins them: a counter of 16 bits begins again after {found / 1e9:g} s")
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
    """Return the single row without which time advances as it should; None if that is none."""
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
            _refuse_clock(rows, k, "", f"{drop}, {say(SPREAD, rows.mends)}")
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


def _refuse_clock(rows: _Rows, k: int, mend: str, effect: str = "") -> NoReturn:
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
