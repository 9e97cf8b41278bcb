"""Standard output: text, tables and JSON, each written at once."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import re
import shlex
import subprocess
import sys
import textwrap
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.text import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import typer
    from rich.console import Console, ConsoleOptions, RenderableType

    from servotwin.datasheet.holding import Span
    from servotwin.look.reports import Report, Table


# --- Tables and texts as lines of a terminal of any width -------------------------------------------------------------

# A table that is too wide wraps the words of its widest columns. Where that takes more lines, or a word does not fit,
# it folds: the first columns stay beside each other, and the others follow below each row, each behind its name. A
# number and its unit stay on one line; a word that is wider than the terminal, such as a path, is left whole.

_GAP = 2  # blanks between columns
_FOLD = "    "  # before what follows below a row
_WORTH = 1.5  # times the lines of a table that folds: what one that wraps may take, which is easier to compare
_LEAST = 20  # columns; a narrower terminal is treated as this wide
_KEPT = "\N{NO-BREAK SPACE}"
# Words that stay on one line: numbers with their units, units of several words, and ranges in brackets if there is room
_WHOLE = re.compile(r"\d (?:N m|kgf cm|deg C|[^\W\d]{1,4}(?:/\w+)?|%|°)(?![\w.])|\b(?:N m|kgf cm|deg C)\b")
_RANGE = re.compile(r"\([^() ]+ to [^() ]+\)")


class Line(NamedTuple):
    """A line of text, of which the first `bold` characters stand out."""

    text: str
    bold: int = 0


def wrapped(text: str, width: int, indent: str = "", *, ranges: bool = True) -> list[str]:
    """Return the lines of a text; those after the first have an indent beyond the blanks in front of the text.

    Unless `ranges`, those in brackets may part.

    Examples
    --------
    >>> wrapped("2.74 W at 0.46 N m, 342 deg/s", 20)
    ['2.74 W at 0.46 N m,', '342 deg/s']
    """
    room = max(width, 1)
    if len(text) <= room and "\n" not in text:
        return [text.rstrip()]
    front = text[:len(text) - len(text.lstrip(" "))]
    lines = textwrap.wrap(whole(text, ranges=ranges), room, subsequent_indent=front + indent, break_long_words=False,
                          break_on_hyphens=False)
    return [line.replace(_KEPT, " ") for line in lines] or [""]


def text_lines(text: str, width: int) -> list[Line]:
    """Return a text as lines; what is indented continues below itself."""
    return [Line(line) for part in text.split("\n")
            for line in wrapped(part, max(width, _LEAST), "  " if part.startswith(" ") else "")]


def pair_lines(rows: Sequence[tuple[str, str]], width: int) -> list[Line]:
    """Return labels and texts side by side; below each other where the labels take more than half of the width.

    Examples
    --------
    >>> [line.text for line in pair_lines([("final angle", "180.00 deg"), ("energy", "1 J")], 40)]
    ['  final angle  180.00 deg', '  energy       1 J']
    """
    room, side = max(width, _LEAST), max((len(label) for label, _ in rows), default=0)
    if 2 * side > room:
        return [line for label, text in rows for line in (
            *(Line("  " + part, room) for part in wrapped(label, room - 2)),
            *(Line(_FOLD + part) for part in wrapped(text, room - len(_FOLD))))]
    start = side + 2 * _GAP
    return [Line(f"{'  ' + label if k == 0 else '':{start}}{part}".rstrip(), start if k == 0 else 0)
            for label, text in rows for k, part in enumerate(wrapped(text, room - start))]


def table_lines(header: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[Line]:
    r"""Return a table, in as few lines as hold all of it.

    Examples
    --------
    >>> rows = [("a", "0.916 N m", "its sheet ends at 6 V, computed as an analog one")]
    >>> for wide in (80, 40, 24):
    ...     print("\n".join(line.text for line in table_lines(("id", "torque", "note"), rows, wide)))
    id  torque     note
    a   0.916 N m  its sheet ends at 6 V, computed as an analog one
    id  torque     note
    a   0.916 N m  its sheet ends at 6 V,
                   computed as an analog one
    id  torque
    a   0.916 N m
        note its sheet ends
        at 6 V, computed as
        an analog one
    """
    room, count = max(width, _LEAST), len(header)
    cells = [[*row, *[""] * (count - len(row))] for row in rows]
    columns = [[header[k], *(row[k] for row in cells)] for k in range(count)]
    widths, ranges = _widths(columns, room, ranges=True), True
    if widths is None:
        widths, ranges = _widths(columns, room, ranges=False), False
    folded = _folded(header, cells, columns, room)
    if widths is None:
        return folded
    found = [*_row(header, widths, bold=True), *(line for row in cells for line in _row(row, widths, ranges=ranges))]
    return found if len(found) <= _WORTH * len(folded) else folded


def whole(text: str, *, ranges: bool = True) -> str:
    """Return a text whose numbers do not part from their units, nor ranges in brackets."""
    kept = _RANGE.sub(_joined, text) if ranges else text
    return _WHOLE.sub(_joined, kept)


def _joined(match: re.Match[str]) -> str:
    return match[0].replace(" ", _KEPT)


def _widths(columns: Sequence[Sequence[str]], room: int, *, ranges: bool) -> list[int] | None:
    """Return the width of each column; None where their longest words do not fit beside each other."""
    widths = [max(map(len, cells)) for cells in columns]
    words = [[[len(word) for word in _words(cell, ranges=ranges)] for cell in cells] for cells in columns]
    least = [max(max(cell, default=0) for cell in cells) for cells in words]
    free = room - _GAP * (len(columns) - 1)
    if sum(widths) > free and sum(least) > free:
        return None
    heights = [[1] * len(cells) for cells in words]
    while sum(widths) > free:  # what costs the fewest lines gives way first, of these the widest
        choices = [k for k in range(len(widths)) if widths[k] > least[k]]
        after = {k: [_height(cell, widths[k] - 1) for cell in words[k]] for k in choices}
        lines = {k: sum(map(max, zip(*(after[k] if j == k else heights[j] for j in range(len(widths))), strict=True)))
                 for k in choices}
        at = min(choices, key=lambda k: (lines[k], -widths[k]))
        widths[at], heights[at] = widths[at] - 1, after[at]
    return widths


def _height(words: Sequence[int], width: int) -> int:
    """Return how many lines words of these lengths take."""
    lines, used = 1, 0
    for word in words:
        used += word + (used > 0)
        if used > width:
            lines, used = lines + 1, word
    return lines


def _words(cell: str, *, ranges: bool) -> list[str]:
    """Return what of a cell does not part; the blanks in front of it belong to each."""
    front = cell[:len(cell) - len(cell.lstrip(" "))]
    return [front + word for word in re.split(r"[ \n]+", whole(cell, ranges=ranges).strip(" "))]


def _row(cells: Sequence[str], widths: Sequence[int], *, bold: bool = False, ranges: bool = True) -> list[Line]:
    parts = [wrapped(cell, width, ranges=ranges) for cell, width in zip(cells, widths, strict=True)]
    gap, found = " " * _GAP, []
    for k in range(max(map(len, parts), default=0)):
        at = (part[k] if k < len(part) else "" for part in parts)
        text = gap.join(f"{cell:{width}}" for cell, width in zip(at, widths, strict=True)).rstrip()
        found.append(Line(text, len(text) if bold else 0))
    return found


def _folded(header: Sequence[str], cells: Sequence[Sequence[str]], columns: Sequence[Sequence[str]],
            room: int) -> list[Line]:
    """Return the columns that fit beside each other, and below each row the others behind their names."""
    widths, beside = [max(map(len, columns[0]))], 1
    while beside < len(header) and sum(widths) + _GAP * beside + max(map(len, columns[beside])) <= room:
        widths.append(max(map(len, columns[beside])))
        beside += 1
    if beside == 1:
        widths = [min(widths[0], room)]
    found = _row(header[:beside], widths, bold=True)
    for row in cells:
        found += _row(row[:beside], widths)
        rest = " | ".join(f"{name} {cell}".strip() for name, cell in zip(header[beside:], row[beside:], strict=True)
                         if cell.strip())
        found += [Line(_FOLD + part) for part in wrapped(rest, room - len(_FOLD)) if part]
    return found


# --- A figure with the range that guesses leave it, as text -----------------------------------------------------------

def with_span(value: float, span: Span | None, form: str, unit: str, *, scale: float = 1.0, note: str = "") -> str:
    """Return a value with its unit and, where it rests on guesses, its range behind it.

    Parameters
    ----------
    value : float
        In the unit.
    span : Span, optional
        In SI; `scale` leads to the unit.
    form : str
        Of a number, such as ".2f".
    unit : str
    scale : float
    note : str
        Text in brackets behind the value; the range then follows a comma.

    Examples
    --------
    >>> from servotwin.datasheet.holding import Span
    >>> with_span(3.99, Span(0.04, 0.12), ".1f", "deg", scale=57.3), with_span(3.99, None, ".1f", "deg")
    ('4.0 deg (2.3 to 6.9)', '4.0 deg')
    >>> with_span(0.1, Span(0.1, math.inf), ".1f", "s", note="within 1 deg")
    '0.1 s (within 1 deg), 0.1 to never'
    """
    number = f"{value:z{form}}"
    shown = f"{number} {unit}" + (f" ({note})" if note else "")
    low, high = (number, number) if span is None else (
        "never" if math.isinf(end) else f"{scale * end:z{form}}" for end in span)
    if low == high == number:
        return shown
    return f"{shown}, {low} to {high}" if note else f"{shown} ({low} to {high})"


# --- Standard output: text, tables and JSON, each written at once -----------------------------------------------------

_PIPE_WIDTH = 120  # characters of a line where no terminal says how wide it is


def emit(text: str) -> None:
    """Write a text and a line end to standard output; what a terminal would obey stands in it as Python writes it.

    Raises
    ------
    OSError
        If that fails; it names standard output.

    Examples
    --------
    >>> emit("hello")
    hello
    """
    _write(shown(text))


def _write(text: str) -> None:
    if sys.stdout is None:
        return
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from None


def emit_help(context: typer.Context) -> None:
    """Write the help of a command."""
    text = context.get_help()  # empty where typer has written it already
    if text:
        emit(text)


def emit_json(data: Any) -> None:
    """Write one JSON document; a number that is not finite becomes null, and -0 becomes 0.

    Examples
    --------
    >>> emit_json({"a": float("nan"), "b": -0.0})
    {
      "a": null,
      "b": 0.0
    }
    """
    emit(json_text(data))


def json_text(data: Any) -> str:
    """Return one JSON document; a number that is not finite becomes null, and -0 becomes 0.

    Examples
    --------
    >>> json_text({"a": float("nan")}).split()
    ['{', '"a":', 'null', '}']
    """
    return json.dumps(_finite(data), indent=2, allow_nan=False).replace("\x7f", "\\u007f")


def show(*parts: RenderableType) -> None:
    """Write tables and texts, no wider than the terminal.

    Examples
    --------
    >>> show("one", "two")
    one
    two
    """
    terminal = sys.stdout is not None and sys.stdout.isatty()
    width = None if terminal or os.environ.get("COLUMNS", "").isdigit() else _PIPE_WIDTH
    _write(drawn(parts, width, terminal=terminal))


def drawn(parts: Sequence[RenderableType], width: int | None, *, terminal: bool = False) -> str:
    r"""Return tables and texts as they are drawn in a width, that of the terminal unless given.

    Examples
    --------
    >>> drawn(["a word, and more of them"], 20)
    'a word, and more of\nthem'
    """
    from rich.console import Console

    page = io.StringIO()
    console = Console(file=page, force_terminal=terminal, width=width, markup=False, highlight=False, emoji=False)
    for part in parts:
        console.print(_Drawn(partial(text_lines, shown(part))) if isinstance(part, str) else part, crop=False)
    return "\n".join(line.rstrip() for line in page.getvalue().rstrip("\n").split("\n"))


def show_report(head: str, report: Report, *more: RenderableType) -> None:
    """Write the parts of a report that a terminal can show, below a line, and what else there is to say."""
    from servotwin.look.reports import Pairs

    parts: list[RenderableType] = [head]
    for part in report.parts():
        if not isinstance(part, Pairs):
            parts += ["", renderable(part)]
        elif part.rows:
            parts += ["", *([part.title] if part.title else []), pairs(part.rows)]
    show(*parts, *more)


def renderable(part: Table | str) -> RenderableType:
    """Return a table or a text of a report as the terminal shows it."""
    return part if isinstance(part, str) else table(part.head, part.rows)


@contextlib.contextmanager
def patience(what: str) -> Iterator[None]:
    """Show on a terminal that something lasts, once it has lasted for a second.

    Examples
    --------
    >>> with patience("adding"):
    ...     1 + 1
    2
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    import threading

    status: list[Any] = []

    def begin() -> None:
        from rich.console import Console

        status.append(Console(stderr=True, markup=False).status(f"{what} ..."))
        status[0].start()

    timer = threading.Timer(1.0, begin)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
        for shown in status:
            shown.stop()


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float):
        return data + 0.0 if math.isfinite(data) else None
    return data


def typed(*words: object) -> str:
    """Return a command line as it is typed in a shell of this system.

    Examples
    --------
    >>> typed("servotwin", "fit", "my runs", "--servo", "x.toml").replace('"', "'")
    "servotwin fit 'my runs' --servo x.toml"
    """
    texts = [str(word) for word in words]
    return subprocess.list2cmdline(texts) if os.name == "nt" else shlex.join(texts)


class _Drawn:
    """Lines that are laid out when the width of the terminal is known."""

    def __init__(self, lines: Callable[[int], list[Line]]) -> None:
        self.lines = lines

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[RenderableType]:
        """Give each line to `rich`, which draws the bold part of it where the terminal can."""
        from rich.text import Text

        for line in self.lines(options.max_width):
            drawn = Text(line.text, no_wrap=True, overflow="ignore")
            drawn.stylize("bold", 0, line.bold)
            yield drawn


def pairs(rows: Sequence[tuple[str, str]]) -> RenderableType:
    """Return labels and texts side by side.

    Examples
    --------
    >>> show(pairs([("final angle", "180.00 deg"), ("energy", "1 J")]))
      final angle  180.00 deg
      energy       1 J
    """
    return _Drawn(partial(pair_lines, [(shown(label), shown(text)) for label, text in rows]))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> RenderableType:
    """Return a table without frame, of which no number is cut however narrow the terminal.

    Examples
    --------
    >>> show(table(("id", "torque"), [("a", "1 N m")]))
    id  torque
    a   1 N m
    """
    return _Drawn(partial(table_lines, header, [[shown(cell) for cell in row] for row in rows]))
