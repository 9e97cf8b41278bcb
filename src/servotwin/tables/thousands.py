"""Points and commas that separate thousands: `1.020` beside `980`, or among decimal commas."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from servotwin.errors import InputError
from servotwin.tables.dialect import Row, has_decimal_commas

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.tables.reading import TextTable

_HUNDREDS = 100  # in the same column: 2.500 beside 1 and 3 was written by hand
_FAR = 10.0  # times: whole numbers that are larger than all others, were the mark one of decimals
BLANKS = "\u00a0\u202f\u2009'\u2019"  # that do not end a line, and marks of Switzerland
_BLANK = re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:[{BLANKS}]\d{{3}})+(?:[.,]\d*)?")
WHOLE = re.compile(r"[+-]?\d{1,3}")
BY_POINTS = r"[+-]?[1-9]\d{0,2}(?:\.\d{3})+"


class Grouped(NamedTuple):
    """A mark that separates thousands, a cell that has it, and how its column is written else."""

    mark: str
    line: int
    column: str
    cell: str
    other: str


def grouped_in(table: TextTable, *, asked: bool = False) -> Grouped | None:
    """Return how thousands are separated in a table, None where nothing says that they are.

    The other mark is that of decimals, or whole numbers without a mark stand in one column with numbers of three
    places: 500, 980, 1.020. Who `asked` knows it.
    """
    cells = [cell for row in table.rows for cell in row.cells if "." in cell or "," in cell]
    found = {mark: [cell for cell in cells if mark in cell] for mark in ".,"}
    marks = [mark for mark in ".," if found[mark] and all(_form(mark).fullmatch(cell) for cell in found[mark])]
    if len(marks) != 1:
        return None
    mark = marks[0]
    mixed = next(_mixed(table, mark), None)
    if not (asked or mixed or all(found.values())):
        return None
    other = f"such as {mixed}" if mixed else f"with a decimal {'point' if mark == ',' else 'comma'}"
    return next(Grouped(mark, row.line, name, cell, other) for row in table.rows
                for name, cell in zip(table.header, row.cells, strict=False) if _form(mark).fullmatch(cell))


def without_blanks(rows: list[Row]) -> list[Row]:
    """Return rows without blanks and apostrophes within numbers (1'020), which separate nothing but thousands."""
    return [row if not any(mark in cell for cell in row.cells for mark in BLANKS) else Row(row.line, [
        re.sub(f"[{BLANKS}]", "", cell) if _BLANK.fullmatch(cell) else cell for cell in row.cells]) for row in rows]


def check_thousands(table: TextTable) -> None:
    """Raise InputError where thousands are separated: such a table is small, and soon written without."""
    found = grouped_in(table)
    if found is not None:
        plain = found.cell.replace(found.mark, "")
        raise InputError(f"{table.path}: line {found.line}, {found.column}", got=found.cell,
                         allowed=f"a number {found.other}, as other cells have it: {plain}, if the "
                         f"{'point' if found.mark == '.' else 'comma'} separates thousands")


def without_groups(table: TextTable, mark: str) -> TextTable:
    """Return the table without a mark between thousands."""
    form = _form(mark)
    rows = [Row(row.line, [cell.replace(mark, "") if form.fullmatch(cell) else cell for cell in row.cells])
            for row in table.rows]
    said = f"{'points' if mark == '.' else 'commas'} within whole numbers are taken for thousands separators"
    return replace(table, rows=rows, decimal="," if has_decimal_commas(rows, table.separator) else ".",
                   remarks=(*table.remarks, said))


def _form(mark: str) -> re.Pattern[str]:
    other = "," if mark == "." else r"\."
    return re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+(?:{other}\d*)?")


def _mixed(table: TextTable, mark: str) -> Iterator[str]:
    """Give a whole number of each column in which others have three places: nothing that prints decimals does so."""
    for k in range(len(table.header)):
        cells = [row.cells[k] for row in table.rows if k < len(row.cells)]
        marked = [cell for cell in cells if mark in cell]
        whole = [cell for cell in cells if WHOLE.fullmatch(cell) and int(cell) != 0]
        if not marked or not whole:
            continue
        largest = max(abs(float(cell.replace(mark, ".", 1).replace(mark, ""))) for cell in marked)
        numbers = [abs(int(cell)) for cell in whole]
        printed = max(numbers) >= _HUNDREDS and any(cell.endswith("0") for cell in marked)
        if printed or min(numbers) > _FAR * largest:
            yield whole[0]
