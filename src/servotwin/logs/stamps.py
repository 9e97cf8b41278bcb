"""Dates and times of day as time stamps."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.tables import TextTable

_ISO = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)(Z|[+-]\d\d:?\d\d)?", re.IGNORECASE)
_CLOCK = re.compile(r"(?:(\d{1,2}[./-]\d{1,2}[./-]\d{2,4}),?[ T])?"  # of which day, whatever comes first
                    r"(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d{1,9}))?(?: ?([AP])\.?M\.?)?", re.IGNORECASE)
_SECOND = 1_000_000_000  # ns
_DAY = 86400 * _SECOND
CLOCKS = {"iso": "dates such as 2024-05-03T12:00:01.250", "clock": "times such as 12:00:01.250"}


class Stamps(NamedTuple):
    """Times from the first row on [s], and what they were written as: "iso" or "clock"."""

    unit: str
    time: NDArray[np.float64]

    @property
    def form(self) -> str:
        """What they are, in words."""
        return "dates" if self.unit == "iso" else "times of day"


def clock_of(cell: str) -> str:
    """Return what a cell is as a time: "iso" for a date, "clock" for a time of day, else nothing.

    Examples
    --------
    >>> clock_of("12:00:01.25"), clock_of("3.5.2024 12:00:01"), clock_of("2024-05-03T12:00"), clock_of("1.25")
    ('clock', 'clock', 'iso', '')
    """
    if ":" not in cell:
        return ""
    return "iso" if _ISO.fullmatch(cell) else "clock" if _CLOCK.fullmatch(cell) else ""


def stamps_of(table: TextTable, column: str) -> Stamps | None:
    """Return the times of a column of ISO 8601 dates or times of day, None where its first cell is neither.

    Raises
    ------
    InputError
        If a further cell is none: names the line.
    """
    cells = table.cells(column)
    unit = clock_of(cells[0])
    return Stamps(unit, (_iso if unit == "iso" else _clock)(table, column, cells)) if unit else None


def _iso(table: TextTable, column: str, cells: Sequence[str]) -> NDArray[np.float64]:
    found = [_matched(_ISO, table, k, column, cell, "iso") for k, cell in enumerate(cells)]
    plain = [f"{match[1]}T{match[2].replace(',', '.')}" for match in found]
    try:
        stamps = np.array(plain, dtype="datetime64[ns]")
    except ValueError as error:
        raise InputError(f"{table.path}: {column}", got=str(error), allowed=CLOCKS["iso"]) from None
    nanoseconds = (stamps - stamps[0]).astype(np.int64)
    zones = [match[3] or "" for match in found]
    if len(set(zones)) > 1:
        if "" in zones:
            k = zones.index("") if zones[0] else next(k for k, zone in enumerate(zones) if zone)
            raise InputError(f"{table.path}: line {table.rows[k].line}, {column}", got=cells[k],
                             allowed="a time zone in all rows, or in none")
        shift = np.array([_zone(zone) for zone in zones], dtype=np.int64) * 60 * _SECOND
        nanoseconds = nanoseconds - (shift - shift[0])
    return np.asarray(nanoseconds / _SECOND)


def _zone(text: str) -> int:
    """Return minutes from UTC."""
    if text.upper() == "Z":
        return 0
    return (1 if text[0] == "+" else -1) * (60 * int(text[1:3]) + int(text[-2:]))


def _clock(table: TextTable, column: str, cells: Sequence[str]) -> NDArray[np.float64]:
    found = [_matched(_CLOCK, table, k, column, cell, "clock") for k, cell in enumerate(cells)]
    times = np.array([(3600 * _hour(m[2], m[6]) + 60 * int(m[3]) + int(m[4])) * _SECOND
                      + int((m[5] or "0").ljust(9, "0")) for m in found], dtype=np.int64)
    dated = all(m[1] for m in found)
    later = np.array([a[1] != b[1] for a, b in pairwise(found)], bool) if dated else np.diff(times) < -_DAY // 2
    days = np.cumsum(np.append(0, later))  # past midnight
    return np.asarray((times + _DAY * days - times[0]) / _SECOND)


def _hour(hour: str, half: str | None) -> int:
    """Return the hour of the day; of its halves the first begins with 12 AM, the second with 12 PM."""
    return int(hour) if half is None else int(hour) % 12 + 12 * (half.upper() == "P")


def _matched(form: re.Pattern[str], table: TextTable, k: int, column: str, cell: str, unit: str) -> re.Match[str]:
    match = form.fullmatch(cell)
    if match is None:
        raise InputError(f"{table.path}: line {table.rows[k].line}, {column}", got=cell or "nothing",
                         allowed=CLOCKS[unit])
    return match
