"""Rows whose numbers no log of a servo can hold, among others that do: characters were lost, or rows joined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.column_words import SAID
from servotwin.logs.columns import UNITS, Column, dimension_of_signal
from servotwin.logs.defined import is_defined
from servotwin.logs.log_checks import largest_of
from servotwin.units import from_si

if TYPE_CHECKING:
    from collections.abc import Iterator

    from servotwin.logs.layout import Layout
    from servotwin.tables import TextTable

PULSES = (200e-6, 4e-3)  # s: servos take 500 to 2500 us, those of helicopters half of it
_PEAKS = ("armature_current", "supply_current")  # milliamperes that count as amperes are too large at peaks alone
_MOST = 0.2  # of the rows: with more it is the unit that is wrong


def impossible(table: TextTable, layout: Layout) -> NDArray[np.bool_]:
    """Return which rows hold such a number; a column that has many has another unit, and is refused as a whole."""
    found = np.zeros(len(table.rows), np.bool_)
    for name, column in _bounded(layout):
        beyond = _beyond(table, name, column)
        if name == "pulse_width" and (beyond[1:] & beyond[:-1]).any():
            continue  # such pulses were sent: what is torn stands alone
        if beyond.mean() <= _MOST:
            found |= beyond
    return found


def check_said(table: TextTable, layout: Layout) -> None:
    """Raise if a column that was said to hold pulses holds none that a servo takes: names the column and its values."""
    column = layout.columns.get("pulse_width")
    if column is None or not any(one.column == column.column and one.known == SAID for one in layout.shown):
        return
    values = column.to_si(table.numbers(column.column, missing=np.nan), "pulse_width")
    longest = float(np.nanmax(values, initial=-np.inf))
    if 0.0 < longest < PULSES[0]:
        raise InputError(f"{table.path}: pulses of {column.column}", got=f"{1e6 * longest:.4g} us at most",
                         allowed=f"{1e6 * PULSES[0]:g} us or more: milliseconds, degrees or ticks?")


def refuse(one: TextTable, layout: Layout) -> None:
    """Raise what is impossible in a table of one row: names file, line and column."""
    for name, column in _bounded(layout):
        if _beyond(one, name, column)[0]:
            unit = "us" if column.unit == "ns" else column.unit
            low, high = (from_si(value, unit, dimension_of_signal(name)) for value in _range(name))
            raise InputError(f"{one.path}: line {one.rows[0].line}, {column.column}",
                             got=one.cells(column.column)[0],
                             allowed=f"{low:.6g} to {high:.6g} {unit}, as in the other rows")


def _bounded(layout: Layout) -> Iterator[tuple[str, Column]]:
    """Give the columns whose numbers have bounds that a wrong unit does not pass at times."""
    for name, column in layout.columns.items():
        if name not in _PEAKS and not is_defined(column.column) and name in UNITS and np.isfinite(largest_of(name)):
            yield name, column


def _range(name: str) -> tuple[float, float]:
    return PULSES if name == "pulse_width" else (-largest_of(name), largest_of(name))


def _beyond(table: TextTable, name: str, column: Column) -> NDArray[np.bool_]:
    values = column.to_si(table.numbers(column.column, missing=np.nan), name)
    low, high = _range(name)
    beyond = (values < low) | (values > high)
    return beyond & (values > 0.0) if name == "pulse_width" else beyond
