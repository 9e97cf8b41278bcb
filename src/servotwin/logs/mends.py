"""What can be mended in a table before it is a log: the words of `--mend`, and rows that are no rows."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.logs.columns import COMMANDS, TIME, Column
from servotwin.logs.defined import is_defined
from servotwin.logs.impossible import impossible, refuse
from servotwin.logs.mend_names import DROP, MENDS, SPREAD, THOUSANDS, TORN
from servotwin.logs.stamps import CLOCKS, clock_of
from servotwin.tables import TextTable, said_lines
from servotwin.tables.dialect import MISSING
from servotwin.tables.thousands import grouped_in, without_groups

if TYPE_CHECKING:
    from servotwin.logs.layout import Layout

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
