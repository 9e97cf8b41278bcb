"""How a table separates its cells and writes its decimals, found out from its lines."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

COMMENTS = ("#", "%", "//", ";")
MISSING = frozenset(("", "-", "--", "nan", "na", "n/a", "#n/a", "#na", "none", "null", "nil", "?"))  # in small letters
SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", ",": "commas", " ": "blanks"}
_SAMPLE = 60  # lines from each of begin, middle and end
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
WHOLE_OR_POINT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_STAMP = re.compile(r"\d{4}-\d\d-\d\d|(\d{1,2}[./-]\d{1,2}[./-]\d{2,4},?[ T])?\d{1,2}:\d\d:\d\d")
_DECIMAL_COMMA = re.compile(r"(?<![\d.,])[+-]?\d*,\d+(?![\d.,])")


class Row(NamedTuple):
    """The cells of a line, without the blanks about them."""

    line: int
    cells: list[str]


def separator_of(lines: Sequence[str]) -> str:
    r"""Return the character between the cells: the one that makes rows of equal length with numbers in them.

    Examples
    --------
    >>> separator_of(["t;u", "0,0;1500", "0,02;1600"]), separator_of(["0 1500", "0.02   1600"])
    (';', ' ')
    """
    n = len(lines)
    sample = [*lines[:_SAMPLE], *lines[max(_SAMPLE, n // 2):][:_SAMPLE], *lines[max(2 * _SAMPLE, n - _SAMPLE):]]
    found = max(SEPARATORS, key=lambda s: _merit(sample, s))
    if _merit(sample, found) > 0.0:
        return found
    return next((s for s in SEPARATORS if lines and s in lines[0].strip()), ",")


def _merit(sample: Sequence[str], separator: str) -> float:
    """Return the share of lines that are rows of numbers, all equally long, under a separator."""
    number = WHOLE_OR_POINT if separator == "," else _NUMBER
    lengths: Counter[int] = Counter()
    for line in sample:
        if not line.lstrip().startswith(COMMENTS[:3]):
            cells = cut(line, separator)
            numbers = sum(bool(number.fullmatch(cell)) or bool(_STAMP.match(cell)) for cell in cells)
            if numbers >= 2 and 2 * (numbers + sum(cell.lower() in MISSING for cell in cells)) >= len(cells):
                lengths[len(cells)] += 1
    return max(lengths.values(), default=0) / max(len(sample), 1)


def cut(line: str, separator: str) -> list[str]:
    r"""Return the cells of one line.

    Examples
    --------
    >>> cut('0.02, "a, b" ,', ","), cut("  0.02   1500", " ")
    (['0.02', 'a, b', ''], ['0.02', '1500'])
    """
    if '"' in line:
        try:
            return next(rows([line], separator), Row(1, [""])).cells
        except csv.Error:  # an endless cell; whoever reads the rows says so
            return [line]
    return line.split() if separator == " " else [cell.strip() for cell in line.split(separator)]


def rows(lines: Sequence[str], separator: str) -> Iterator[Row]:
    """Return the cells of all lines that are not empty; a quoted cell may hold separators and line ends.

    Raises
    ------
    csv.Error
        If a quoted cell does not end.
    """
    if any('"' in line for line in lines):
        blank = separator == " "
        reader = csv.reader((f"{line.strip() if blank else line}\n" for line in lines), delimiter=separator,
                            skipinitialspace=True)
        for found in reader:
            stripped = [cell.strip() for cell in found]
            if any(stripped):
                yield Row(reader.line_num, stripped)
        return
    for k, line in enumerate(lines, 1):
        cells = line.split() if separator == " " else line.split(separator)
        if separator != " " and (" " in line or "\t" in line or "\xa0" in line):
            cells = [cell.strip() for cell in cells]
        if any(cells):
            yield Row(k, cells)


def is_comment(cells: Sequence[str], separator: str) -> bool:
    """Return whether a line is a remark; one that begins with a semicolon is none where these are the separator."""
    return cells[0].startswith(COMMENTS[:3] if separator == ";" else COMMENTS) and cells[0].lower() not in MISSING


def is_data(cells: Sequence[str]) -> bool:
    """Return whether a line looks like data: two numbers or stamps, or more than half of its cells.

    Examples
    --------
    >>> is_data(["0.02", "1500", "nan"]), is_data(["time", "pulse 1", "2"])
    (True, False)
    """
    numbers = sum(bool(_NUMBER.fullmatch(cell)) or bool(_STAMP.match(cell)) for cell in cells)
    return numbers >= 2 or (numbers == 1 and 2 * (1 + sum(cell.lower() in MISSING for cell in cells)) > len(cells))


def has_decimal_commas(rows: Iterable[Row], separator: str) -> bool:
    """Return whether any cell is a number with a comma in place of its point; among commas it was quoted."""
    form = _DECIMAL_COMMA.fullmatch if separator == "," else _DECIMAL_COMMA.match
    return any("," in cell and form(cell) is not None for row in rows for cell in row.cells)
