"""What the Arduino IDE makes of lines: the Serial Monitor puts times before them, the Serial Plotter wants labels."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from servotwin.tables.dialect import Row

ARRIVAL = "Serial Monitor"
"""Name of the column with the times that the Serial Monitor puts before lines."""
_PREFIX = re.compile(r"\s*(\d{1,2}:\d\d:\d\d\.\d{1,6})\s*->\s?(.*)")
_LABEL = r"[^\W\d_][\w ./()%°-]*?"
_LABELLED = re.compile(rf"\s*({_LABEL})\s*:\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf)\s*", re.IGNORECASE)
_BEGUN = re.compile(rf"\s*({_LABEL})\s*:\s*(.*)")
_SHARE = 0.6  # of the lines: text of a start-up and rows that were torn are the rest
_SAMPLE = 400  # lines


def without_times(lines: Sequence[str]) -> tuple[list[str], dict[int, str]]:
    """Return lines without the Serial Monitor's times, and these by the number of their line; none if few have them.

    Examples
    --------
    >>> without_times(["12:03:11.123 -> 20,1500", "12:03:11.143 -> 40,1500"])
    (['20,1500', '40,1500'], {1: '12:03:11.123', 2: '12:03:11.143'})
    """
    some = [line for line in lines[:_SAMPLE] if line.strip()]
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
    some = [line for line in lines[:_SAMPLE] if line.strip()]
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
