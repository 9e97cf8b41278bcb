"""The reader of tables: finds separator, decimal sign, header and rows, whatever stands before and between them."""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.text import checked_name
from servotwin.units.words import is_unit

# --- How a table separates its cells and writes its decimals, found out from its lines --------------------------------

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


# --- The text of a file, whichever of the usual encodings it is in ----------------------------------------------------

_HEAD = 4096  # bytes that tell what a file is
_MOST_CONTROL = 0.1  # share of control characters in a text
_ZEROS = re.compile("\0{3,}")
_NOT_TEXT = {b"PK\x03\x04": "a zip archive or an Excel workbook", b"PAR1": "a Parquet file", b"\x1f\x8b": "a gzip file",
             b"\x89PNG": "a picture", b"\xd0\xcf\x11\xe0": "an Excel workbook", b"\x89HDF": "an HDF5 file",
             b"MATLAB": "a MATLAB file", b"%PDF": "a PDF"}
NUL = "a NUL"
_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


class Text(NamedTuple):
    """The lines of a file.

    Parameters
    ----------
    lines : list of str
        Those that end in a line end.
    rest : str
        Text behind the last line end.
    encoding : str
    unwritten : int
        Zeros behind the text, which a card holds where its last block was not written.
    """

    lines: list[str]
    rest: str
    encoding: str
    unwritten: int = 0


def read_bytes(path: str | Path) -> bytes:
    """Return the contents of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # a NUL in the path
        raise InputError(f"{path}: cannot be read ({error})") from None


def read_text(path: Path, *, damaged: bool = False) -> Text:
    r"""Return the lines of a text file: UTF-8 with or without a mark, UTF-16, else Windows-1252 or Latin-1.

    Parameters
    ----------
    path : Path
    damaged : bool
        Whether there may be zeros within the text too.

    Raises
    ------
    InputError
        If it cannot be read, or is no text.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_bytes("t;Winkel (\xb0)\r\n0;9\r\n0.02;1".encode("latin-1"))
    >>> read_text(file)
    Text(lines=['t;Winkel (°)', '0;9'], rest='0.02;1', encoding='cp1252', unwritten=0)
    """
    data = read_bytes(path)
    for start, what in _NOT_TEXT.items():
        if data.startswith(start):
            raise InputError(str(path), got=what, allowed="a text, such as CSV")
    whole, encoding = _decoded(data)
    text = whole.rstrip("\0")
    unwritten = len(whole) - len(text)
    _check(path, text, whole, damaged=damaged)
    # "−" is the minus sign of typesetters; \x1a ended files of old
    text = text.rstrip("\x1a").replace("\u2212", "-").replace("\r\n", "\n").replace("\r", "\n")
    *lines, rest = text.split("\n")
    return Text(lines, rest, encoding, unwritten)


def _decoded(data: bytes) -> tuple[str, str]:
    encoding = next((name for mark, name in _UTF16.items() if data.startswith(mark)), "")
    if encoding:
        data = data[2:]
    elif b"\0" in data[:_HEAD]:
        head = data[:_HEAD]
        # letters and digits of UTF-16 without a mark have a NUL in every second place
        places = head[1::2].count(0), head[::2].count(0)
        if max(places) > 0.7 * (len(head) // 2) and min(places) < 0.1 * len(head):
            encoding = "utf-16-le" if places[0] > places[1] else "utf-16-be"
    if encoding:
        return data[:len(data) // 2 * 2].decode(encoding, errors="replace"), encoding
    whole = max(data.rfind(b"\n"), data.rfind(b"\r")) + 1  # a line that was torn may end within a character
    for name in ("utf-8-sig", "cp1252"):
        try:
            return data[:whole].decode(name) + data[whole:].decode(name, errors="replace"), name
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1"), "latin-1"


def _check(path: Path, text: str, whole: str, *, damaged: bool) -> None:
    head = text[:_HEAD] if text.strip() else whole[:_HEAD]
    once = _ZEROS.sub("\0", head)  # a block that was never written counts as one
    control = sum(c < " " and c not in "\t\r\n\f\x1a" for c in once)
    if control > _MOST_CONTROL * len(once):
        raise InputError(str(path), got="binary data", allowed="a text, such as CSV")
    if "\0" in text and not damaged:
        before = text[:text.index("\0")]
        line = 1 + before.replace("\r\n", "\n").replace("\r", "\n").count("\n")
        raise InputError(f"{path}: line {line}", got=NUL, allowed="a text; the file was damaged")


# --- Lines of the Arduino IDE -----------------------------------------------------------------------------------------

ARRIVAL = "Serial Monitor"
"""Name of the column with the times that the Serial Monitor puts before lines."""
_PREFIX = re.compile(r"\s*(\d{1,2}:\d\d:\d\d\.\d{1,6})\s*->\s?(.*)")
_LABEL = r"[^\W\d_][\w ./()%°-]*?"
_LABELLED = re.compile(rf"\s*({_LABEL})\s*:\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf)\s*", re.IGNORECASE)
_BEGUN = re.compile(rf"\s*({_LABEL})\s*:\s*(.*)")
_SHARE = 0.6  # of the lines: text of a start-up and rows that were torn are the rest
_SAMPLE_SERIAL = 400  # lines


def without_times(lines: Sequence[str]) -> tuple[list[str], dict[int, str]]:
    """Return lines without the Serial Monitor's times, and these by the number of their line; none if few have them.

    Examples
    --------
    >>> without_times(["12:03:11.123 -> 20,1500", "12:03:11.143 -> 40,1500"])
    (['20,1500', '40,1500'], {1: '12:03:11.123', 2: '12:03:11.143'})
    """
    some = [line for line in lines[:_SAMPLE_SERIAL] if line.strip()]
    if not some or sum(_PREFIX.fullmatch(line) is not None for line in some) < _SHARE * len(some):
        return list(lines), {}
    matches = [_PREFIX.fullmatch(line) for line in lines]
    return ([line if match is None else match[2] for line, match in zip(lines, matches, strict=True)],
            {k: match[1] for k, match in enumerate(matches, 1) if match is not None})


def labelled_rows(lines: Sequence[str]) -> list[Row] | None:
    r"""Return the rows of lines such as ``pwm:1500,adc:512``, their labels as a header first; None where they are none.

    Examples
    --------
    >>> labelled_rows(["pwm:1500,adc:512", "pwm:1600,adc:5"])
    [Row(line=1, cells=['pwm', 'adc']), Row(line=1, cells=['1500', '512']), Row(line=2, cells=['1600', '5'])]
    """
    some = [line for line in lines[:_SAMPLE_SERIAL] if line.strip()]
    if not some or ":" not in some[len(some) // 2]:
        return None
    shapes = Counter(labels for line in some if (labels := _labels(line)))
    if not shapes:
        return None
    names, count = shapes.most_common(1)[0]
    if count < _SHARE * len(some) or len(set(names)) < len(names):
        return None
    begin = next(k for k, line in enumerate(lines, 1) if line.strip())
    return [Row(begin, list(names)), *(Row(k, _values(line, names)) for k, line in enumerate(lines, 1) if line.strip())]


def _parts(line: str) -> list[str]:
    for separator in ("\t", ","):
        if separator in line:
            return [part for part in line.split(separator) if part.strip()]
    return re.sub(r":\s+", ":", line).split()


def _labels(line: str) -> tuple[str, ...]:
    """Return the labels of a line all of whose parts are a label and a number; else none."""
    matches = [_LABELLED.fullmatch(part) for part in _parts(line)]
    return tuple(match[1] for match in matches if match is not None) if all(matches) else ()


def _values(line: str, names: Sequence[str]) -> list[str]:
    """Return the cells of a line; what is not labelled as it should be stays as it is, so that it is seen."""
    cells = []
    for part in _parts(line):
        match = _BEGUN.fullmatch(part)
        cells.append(match[2].strip() if match is not None and match[1] in names else part.strip())
    return cells


# --- Points and commas that separate thousands: `1.020` beside `980`, or among decimal commas -------------------------

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
    places: 500, 980, 1.020. With `asked` that is taken for granted.
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


# --- The reader of tables ---------------------------------------------------------------------------------------------

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
        Entry of each column in a line of units below the header; empty where there is none.
    rows : list of Row
        Cells of each row, with the number of its line.
    separator : str
    decimal : {".", ","}
    encoding : str
    remarks : tuple of str
        Parts that were passed over, each in one line.
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
            Value that an empty cell, `NaN`, `NA`, `-` or `null` counts as; unless given it is an error.

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
