"""The reader of tables: finds separator, decimal sign, header and rows, whatever stands before and between them."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.tables.dialect import (
    COMMENTS,
    MISSING,
    SEPARATORS,
    Row,
    has_decimal_commas,
    is_comment,
    is_data,
    rows,
    separator_of,
)
from servotwin.tables.serial import ARRIVAL, labelled_rows, without_times
from servotwin.tables.text import Text, read_text
from servotwin.tables.thousands import BLANKS, check_thousands, without_blanks
from servotwin.text import checked_name
from servotwin.units.words import is_unit

_MARKS = frozenset(comment[0] for comment in COMMENTS)
_SEARCHED = 200  # lines in which the header stands


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table in words, as its file has them.

    Parameters
    ----------
    path : Path
    header : tuple of str
        Names of the columns; their numbers from 1 on where the file has none.
    has_header : bool
    units : tuple of str
        What a line of units below the header says of each column; empty where there is none.
    rows : list of Row
        Cells of each row, with the number of its line.
    separator : str
    decimal : {".", ","}
    encoding : str
    remarks : tuple of str
        What was passed over, each in one line.
    also : mapping of str to str
        Other names of columns: `%time`, where a header that begins with `%` is that of `time`.
    breaks : tuple of int
        Lines below the first header that are no rows: further headers, and what `without_rows` took for text.
    added : int
        Columns before those of the file: times of the Serial Monitor.
    """

    path: Path
    header: tuple[str, ...]
    has_header: bool = True
    units: tuple[str, ...] = ()
    rows: list[Row] = field(repr=False)
    separator: str
    decimal: str
    encoding: str
    remarks: tuple[str, ...] = ()
    also: dict[str, str] = field(default_factory=dict)
    breaks: tuple[int, ...] = ()
    added: int = 0
    _cells: dict[str, list[str]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _numbers: dict[tuple[str, bool], NDArray[np.float64]] = field(default_factory=dict, init=False, repr=False,
                                                                  compare=False)

    def name_of(self, name: str) -> str | None:
        """Return how the header calls a column; large and small letters count alike where that leaves no doubt."""
        if name in self.header:
            return name
        if name in self.also:
            return self.also[name]
        near = [own for own in self.header if own.casefold() == name.strip().casefold()]
        return near[0] if len(near) == 1 else None

    def cells(self, name: str) -> list[str]:
        """Return the cells of a column.

        Raises
        ------
        InputError
            If there is no such column, or it comes twice.
        """
        if name not in self._cells:
            own = self.name_of(name)
            if own is None:
                raise UnknownNameError(f"column of {self.path}", name, self.header)
            if self.header.count(own) > 1:
                raise InputError(f"{self.path}: column", got=f"{own} {self.header.count(own)} times", allowed="once")
            k = self.header.index(own)
            self._cells[name] = [row.cells[k] if k < len(row.cells) else "" for row in self.rows]
        return self._cells[name]

    def numbers(self, name: str, *, missing: float | None = None) -> NDArray[np.float64]:
        """Return the numbers of a column.

        Parameters
        ----------
        name : str
        missing : float, optional
            What an empty cell, `NaN`, `NA`, `-` or `null` counts as; unless given it is an error.

        Raises
        ------
        InputError
            If a cell holds no number: names file, line and column.
        """
        key = name, missing is None
        if key not in self._numbers:
            self._numbers[key] = self._converted(name, missing)
        return self._numbers[key]

    def _converted(self, name: str, missing: float | None) -> NDArray[np.float64]:
        cells = self.cells(name)
        text = "\n".join(cells)  # at once is faster than cell by cell
        if not ("_" in text or (self.decimal == "," and "." in text)):
            words = text.replace(",", ".").split("\n") if self.decimal == "," else cells
            try:
                if len(words) == len(cells):
                    return _frozen([float(word) for word in words])
            except ValueError:
                pass
        return _frozen([self.number(row.line, name, cell, missing=missing)
                        for row, cell in zip(self.rows, cells, strict=True)])

    def number(self, line: int, name: str, cell: str, *, missing: float | None = None) -> float:
        """Return the number of one cell.

        Raises
        ------
        InputError
            If it holds none.
        """
        allowed = "a number"
        if cell.lower() in MISSING and missing is not None:
            return missing
        if self.decimal == "," and "." in cell:
            allowed = "a number with a decimal comma, as other cells have it"
        elif self.decimal == "." and cell.count(",") == 1 and self.separator != ",":
            allowed = "a number with a decimal point, as other cells have it"
        elif "_" not in cell:
            try:
                return float(cell.replace(",", ".", 1) if self.decimal == "," else cell)
            except ValueError:
                pass
        where = name if self.has_header else f"column {name}"
        raise InputError(f"{self.path}: line {line}, {where}", got=cell or "nothing", allowed=allowed)

    def check_lengths(self, *, shorter: bool = False) -> None:
        """Raise unless every row has as many cells as the header; empty ones behind do not count.

        Parameters
        ----------
        shorter : bool
            Whether a row may have fewer, the last ones being empty.

        Raises
        ------
        InputError
            Names the line.
        """
        n = len(self.header)
        for line, cells in self.rows:
            count = len(cells)
            if count != n and ((count < n and not shorter) or any(cells[n:])):
                commas = " (decimal commas need another separator, such as ;)" if (
                    self.separator == "," and count > n) else ""
                raise InputError(f"{self.path}: line {line}", got=f"{count} cell{'s' * (count != 1)}",
                                 allowed=f"{n}, as the header, with {SEPARATORS[self.separator]} between{commas}")

    def without(self, drop: NDArray[np.bool_], remark: str = "", *, text: bool = False) -> TextTable:
        """Return the table without some rows, what is said of it, and whether they were text between rows."""
        breaks = [self.rows[k].line for k in np.flatnonzero(drop).tolist()] if text else []
        return replace(self, rows=[self.rows[k] for k in np.flatnonzero(~drop).tolist()],
                       breaks=tuple(sorted((*self.breaks, *breaks))),
                       remarks=(*self.remarks, remark) if remark else self.remarks)


def _frozen(values: list[float]) -> NDArray[np.float64]:
    made = np.array(values, dtype=np.float64)
    made.setflags(write=False)
    return made


def read_table(path: str | Path, known: Callable[[str], bool] = lambda name: False, *,
               unended: bool = True, serial: bool = False, damaged: bool = False,
               grouped: bool = False) -> TextTable:
    r"""Return the table in a text file.

    Commas, semicolons, tabs, bars or blanks separate its cells; decimals have a point or, unless commas separate, a
    comma; lines that begin with `#`, `%`, `//` or `;` are remarks, and the last of these before the rows is the header
    if no other line is. Lines before the header, empty ones and repeated headers are passed over.

    Parameters
    ----------
    path : str or Path
    known : callable
        Whether a name is that of a column: the header is the line with most of these.
    unended : bool
        Whether a last row counts that does not end in a newline: what a logger was writing when its power went does
        not.
    serial : bool
        Whether lines may be those of the Arduino IDE: `12:03:11.123 -> 20,1500`, `pwm:1500,adc:512`.
    damaged : bool
        Whether there may be zeros within the text.
    grouped : bool
        Whether points or commas may separate thousands, and whoever reads the table looks for them.

    Raises
    ------
    InputError
        If the file cannot be read, is no text, has no rows, a quoted cell that does not end, or separated thousands.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("Logger 7\n# at 6 V\nt;angle\n0,00;9,5\n0,02;-11,78\n0,04;-1")
    >>> table = read_table(file, unended=False)
    >>> table.header, table.numbers("angle").tolist(), table.remarks
    (('t', 'angle'), [9.5, -11.78], ('line 6 does not end in a newline and was left out',))
    """
    path = Path(path)
    text = read_text(path, damaged=damaged)
    remarks = []
    lines = text.lines
    if text.unwritten:
        remarks.append(f"{text.unwritten} zeros at the end, which were never written, were left out")
    if text.rest.strip():
        if unended and not text.unwritten:
            lines = [*lines, text.rest]
        elif lines:
            remarks.append(f"line {len(lines) + 1} does not end in a newline and was left out")
    if not any(line.strip() for line in lines):
        raise InputError(str(path), got="no line that ends in a newline" if text.rest.strip() else "an empty file",
                         allowed="a header and at least one row")
    arrivals: dict[int, str] = {}
    if serial:
        lines, arrivals = without_times(lines)
        text = text._replace(lines=lines)
        remarks += ["the Serial Monitor's times stand before the lines"] if arrivals else []
    labelled = labelled_rows(lines) if serial else None
    remarks += [] if labelled is None else ["labels stand before the numbers, as for the Serial Plotter"]
    separator = "," if labelled is not None else separator_of([line for line in lines if line.strip()])
    try:
        found = list(rows(lines, separator)) if labelled is None else labelled
    except csv.Error as error:
        raise InputError(f"{path}: not readable as CSV ({error})") from None
    if any(mark in line for line in lines for mark in BLANKS):
        found = without_blanks(found)
    table = _table(path, text, found, separator, known, remarks)
    if not grouped:
        check_thousands(table)
    return _with_arrivals(table, arrivals) if arrivals else table


def _with_arrivals(table: TextTable, arrivals: Mapping[int, str]) -> TextTable:
    """Return a table with the times of the Serial Monitor before its columns."""
    return replace(table, header=(ARRIVAL, *table.header), units=("", *table.units) if table.units else (), added=1,
                   rows=[Row(row.line, [arrivals.get(row.line, ""), *row.cells]) for row in table.rows])


def _table(path: Path, text: Text, found: list[Row], separator: str, known: Callable[[str], bool],
           remarks: list[str]) -> TextTable:
    header = _header(found, separator, known)
    names = [] if header is None else _names(text, found[header], separator, known, _width(found, separator))
    names = [re.sub(r"\s*[\r\n\t]\s*", " ", name) for name in names]  # of two lines, as spreadsheets have them
    for k, name in enumerate(names, 1):
        checked_name(f"{path}: line {found[header or 0].line}, name of column {k}", name, math.inf)
    below = found if header is None else found[header + 1:]
    also = {}
    if header is not None and names[0] != found[header].cells[0]:
        also = {found[header].cells[0]: names[0]}
        bare = [names, found[header].cells]
    else:
        bare = [names]
    units: list[str] = []
    data: list[Row] = []
    heads = {cells[0] for cells in bare if cells}
    again = []
    for row in below:
        first = row.cells[0]
        if first in heads and row.cells in bare:
            again.append(row.line)
            continue
        if first[:1] in _MARKS and is_comment(row.cells, separator):
            continue
        if not data and header is not None and _is_units(row.cells, len(names)):
            units = row.cells
            bare.append(units)
            heads.add(units[0])
            continue
        data.append(row)
    if not data:
        raise InputError(str(path), got="a header without rows", allowed="at least one row"
                         + (" that ends in a newline" if remarks else ""))
    if header is not None and any(is_data(row.cells) and not is_comment(row.cells, separator)
                                  for row in found[:header]):
        remarks.append(f"what stands before the header in line {found[header].line} was left out")
    between = [line for line in again if line > data[0].line]
    if between:
        remarks.append(f"the header comes again in {said_lines(between)} and was left out there")
    return TextTable(
        path=path, header=tuple(names) or tuple(str(k) for k in range(1, len(data[0].cells) + 1)),
        has_header=header is not None, units=tuple(units), rows=data, separator=separator,
        decimal="," if has_decimal_commas(data, separator) else ".", encoding=text.encoding, remarks=tuple(remarks),
        also=also, breaks=tuple(between))


def said_lines(lines: Sequence[int], most: int = 3) -> str:
    """Return numbers of lines in words.

    Examples
    --------
    >>> said_lines([7]), said_lines([7, 9, 12, 40])
    ('line 7', '4 lines (7, 9, 12, ...)')
    """
    if len(lines) == 1:
        return f"line {lines[0]}"
    return f"{len(lines)} lines ({', '.join(map(str, lines[:most]))}{', ...' if len(lines) > most else ''})"


def _width(found: Sequence[Row], separator: str) -> int:
    """Return how many cells the first row of data has, 0 where there is none."""
    first = (row for row in found if is_data(row.cells) and not is_comment(row.cells, separator))
    return len(next(first, Row(0, [])).cells)


def _header(found: Sequence[Row], separator: str, known: Callable[[str], bool]) -> int | None:
    """Return the place of the header: the line with most known names, else the one next above the data."""
    width = _width(found, separator)
    start = next((k for k, row in enumerate(found) if is_data(row.cells) and not is_comment(row.cells, separator)),
                 len(found))
    best, merit = None, (0, False)
    for k, row in enumerate(found[:max(start, _SEARCHED)]):
        remark = is_comment(row.cells, separator)
        cells = [row.cells[0].lstrip("#%/; "), *row.cells[1:]] if remark else row.cells
        names = sum(known(cell) for cell in cells)
        if is_data(row.cells) or (remark and width and len(cells) != width) or (k > start and names < 2):
            continue
        if (names, not remark) > merit and names:
            best, merit = k, (names, not remark)
    if best is not None:
        return best
    above = [k for k in range(start) if len(found[k].cells) == width or not width]
    plain = [k for k in above if not is_comment(found[k].cells, separator)]
    units = [k for k in plain if _is_units(found[k].cells, width)]
    plain = [k for k in plain if k not in units]
    if not width:
        return plain[0] if plain else None
    return (plain or above)[-1] if above else None


def _names(text: Text, row: Row, separator: str, known: Callable[[str], bool], width: int) -> list[str]:
    """Return the names in a header; between blanks one name may have blanks, if two or more divide the names."""
    cells = [row.cells[0].lstrip("#%/; ") if is_comment(row.cells, separator) else row.cells[0], *row.cells[1:]]
    if separator == " " and width and len(cells) != width and row.line <= len(text.lines):
        for other in ("  ", "\t", ",", ";"):
            parts = [part.strip() for part in text.lines[row.line - 1].lstrip("#%/; ").split(other) if part.strip()]
            if len(parts) == width:
                return parts
    return cells if cells[0] or len(cells) == width or not width else cells[1:]


def _is_units(cells: Sequence[str], width: int) -> bool:
    """Return whether a line below a header says units: some at least, and nothing else."""
    said = [cell for cell in cells if cell]
    return len(cells) == width and bool(said) and all(
        is_unit(cell) or (cell[0] in "[(" and cell[-1] in ")]") or cell == "-" for cell in said) and any(
        cell != "-" for cell in said)
