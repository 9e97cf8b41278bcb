"""Columns of a dial under names of one's own: pulse [us], angle (deg), angle_up_deg beside angle_down_deg."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.column_names import meaning_of, words_and_unit

Values = NDArray[np.float64] | InputError
_UP = frozenset("up rising auf hin increasing ascending".split())
_DOWN = frozenset("down falling ab zurueck rueck decreasing descending back".split())
_OURS = {("pulse", "us"): "pulse_width_us", ("pulse", "ms"): "pulse_width_ms", ("pulse", "s"): "pulse_width_s",
         ("angle", "deg"): "output_angle_deg", ("angle", "rad"): "output_angle_rad",
         ("feedback", "V"): "feedback_voltage_V", ("feedback", "mV"): "feedback_voltage_mV"}


class Dial(NamedTuple):
    """Columns under our names, and which way each row was read where two columns say so, −½ up and ½ down."""

    columns: dict[str, Values]
    ways: NDArray[np.float64] | None


def dial_columns(given: Mapping[str, Values], units: Mapping[str, str]) -> Dial | None:
    """Return columns under the names of a bench table, with a row for each way where they hold both.

    Parameters
    ----------
    given : mapping of str to ndarray or InputError
    units : mapping of str to str
        Of columns that have one below the header.

    Raises
    ------
    InputError
        If two columns mean the same.

    Examples
    --------
    >>> x = np.array([1.0, 2.0])
    >>> dial = dial_columns({"pulse [us]": x, "angle_up_deg": x, "angle_down_deg": x + 1.0}, {})
    >>> dial.columns["output_angle_deg"].tolist(), dial.ways.tolist()
    ([1.0, 2.0, 3.0, 2.0], [-0.5, -0.5, 0.5, 0.5])
    """
    ours: dict[tuple[str, str], str] = {}
    for column in given:
        named = _named(column, units.get(column, ""))
        if named is None:
            continue
        if named in ours:
            raise InputError(f"columns {ours[named]} and {column}", got="both the same", allowed="one, or the words up "
                             "and down in their names")
        ours[named] = column
    names = tuple(dict.fromkeys(name for name, _ in ours))
    if len(names) < 2:
        return None
    two = [name for name in names if {(name, "up"), (name, "down")} <= ours.keys()]
    if not two:
        return Dial({name: given[column] for (name, _), column in ours.items()}, None)
    once = [name for name, way in ours if not way]
    order = _order(given[ours[once[0], ""]]) if once else None
    columns: dict[str, Values] = {}
    for name in (name for name in names if name in two or (name, "") in ours):
        up, down = (given[ours[name, way if name in two else ""]] for way in ("up", "down"))
        columns[name] = _stacked(up, down, order)
    sizes = {values.size for values in columns.values() if not isinstance(values, InputError)}
    half = max(sizes, default=0) // 2
    return Dial(columns, np.repeat([-0.5, 0.5], half))


def _named(column: str, below: str) -> tuple[str, str] | None:
    """Return our name of a column, and "up" or "down" where it is of one way."""
    words, _ = words_and_unit(column, below)
    meant = meaning_of(column, below)
    if meant is None or (meant.role, meant.unit) not in _OURS:
        return None
    return _OURS[meant.role, meant.unit], "up" if words & _UP else "down" if words & _DOWN else ""


def _order(values: Values) -> NDArray[np.intp] | None:
    return None if isinstance(values, InputError) else np.argsort(values, kind="stable")


def _stacked(up: Values, down: Values, order: NDArray[np.intp] | None) -> Values:
    """Return the rows of the way up and, from the top on, those of the way down."""
    if isinstance(up, InputError):
        return up
    if isinstance(down, InputError):
        return down
    return np.concatenate([up, down[::-1]]) if order is None else np.concatenate([up[order], down[order][::-1]])
