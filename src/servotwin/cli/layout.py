"""Tables and texts as lines of a terminal of any width: what does not fit wraps or folds, and no number is ever cut.

A table that is too wide wraps the words of its widest columns. Where that takes more lines, or a word does not fit, it
folds: the first columns stay beside each other, and the others follow below each row, each behind its name. A number
and its unit stay on one line; a word that is wider than the terminal, such as a path, is left whole.
"""

from __future__ import annotations

import re
import textwrap
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

_GAP = 2  # blanks between columns
_FOLD = "    "  # before what follows below a row
_WORTH = 1.5  # times the lines of a table that folds: what one that wraps may take, which is easier to compare
_LEAST = 20  # columns; a narrower terminal is treated as this wide
_KEPT = "\N{NO-BREAK SPACE}"
# What stays on one line: numbers with their units, units of several words, and ranges in brackets if there is room
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
    """Return a text as lines; what is indented goes on below itself."""
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
