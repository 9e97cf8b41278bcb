"""What the values of a column say: of its unit, where its name says nothing, and of the step of what counts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs import column_names as names
from servotwin.logs.stamps import stamps_of
from servotwin.tables import TextTable

_SINCE_1970 = 1e8  # s; times that are larger count from no start of a run
MOST_DEGREES = 400.0
"""The largest angle in degrees that is one without being said."""
_TURN = 7.0  # above it no angle of one turn is in radians
_PULSES = (300.0, 3000.0)  # us; what receivers send, and servos take, is 500 to 2500
_STEPS = (5e-4, 0.2)  # s, between samples: one unit of time only puts a step between these
_SAME = 0.8  # of the values differ from all others: nobody counts so finely that it matters
_WHOLE = 0.02  # of a step
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class Guess(NamedTuple):
    """A unit, and what it was seen by."""

    unit: str
    dimension: str
    why: str
    from_first: bool = False


def guess(table: TextTable, column: str, role: str) -> Guess | None:
    """Return the unit that the values of a column can be in, None where that is in doubt."""
    if role in (names.TIME, names.SOME_TIME):
        return _time(table, column)
    values = _values(table, column)
    if values is None:
        return None
    largest = float(np.max(np.abs(values)))
    unit: tuple[str, str] | None = None
    if role in (names.PULSE, names.COMMAND):
        sent = values[values != 0.0]
        unit = next((("time", name) for name, by in (("us", 1.0), ("ms", 1e3), ("s", 1e6))
                     if sent.size and _PULSES[0] <= by * sent.min() and by * sent.max() <= _PULSES[1]
                     and (role == names.PULSE or name == "us")), None)
    if unit is None and role in (names.COMMAND, names.COMMAND_ANGLE, names.ANGLE):
        unit = ("angle", "deg") if _TURN < largest <= MOST_DEGREES else None
    elif role in (names.SUPPLY_CURRENT, names.ARMATURE_CURRENT):
        whole = bool((values == np.round(values)).all())
        unit = ("current", "mA") if largest > 30.0 else None if whole else ("current", "A")
    elif role == names.VOLTAGE:
        unit = ("voltage", "mV") if largest > 1000.0 else ("voltage", "V") if 1.0 < largest < 60.0 else None
    return None if unit is None else Guess(unit[1], unit[0], f"its values, {_shown(values)}")


def _time(table: TextTable, column: str) -> Guess | None:
    stamps = stamps_of(table, column)
    if stamps is not None:
        return Guess(stamps.unit, "time", f"its values, {stamps.form}", from_first=True)
    values = _values(table, column)
    if values is None or values.size < 2:
        return None
    steps = np.diff(values)
    steps = steps[steps > 0.0]
    if not steps.size:
        return None
    step = float(np.median(steps))
    unit = next((name for name, by in _TIMES.items() if _STEPS[0] <= by * step <= _STEPS[1]), None)
    if unit is None:
        return None
    return Guess(unit, "time", f"its values, steps of {step:.3g}",
                 from_first=abs(values[0]) * _TIMES[unit] > _SINCE_1970)


def is_increasing(table: TextTable, column: str) -> bool:
    """Return whether a column can be a time: it holds stamps, or numbers that mostly grow."""
    if stamps_of(table, column) is not None:
        return True
    values = _values(table, column)
    return values is not None and values.size > 1 and bool(np.mean(np.diff(values) > 0.0) > 0.5)


def are_counts(table: TextTable, column: str) -> bool:
    """Return whether the values of a column look like counts of a converter: whole, none below 0, beyond a turn."""
    values = _values(table, column) if column in table.header else None
    return values is not None and bool((values == np.round(values)).all() and values.min() >= 0.0
                                       and values.max() > MOST_DEGREES)


def range_of(table: TextTable, column: str) -> str:
    """Return what the values of a column are, for a message.

    Raises
    ------
    InputError
        If a cell holds no number.
    """
    values = table.numbers(column, missing=np.nan)
    finite = values[np.isfinite(values)]
    return f"values {_shown(finite)}" if finite.size else "without values"


def _shown(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g} to {high:.6g}" if low < high else f"{low:.6g} throughout"


def _values(table: TextTable, column: str) -> NDArray[np.float64] | None:
    """Return the finite numbers of a column, None where there are none."""
    try:
        values = table.numbers(column, missing=np.nan)
    except InputError:
        return None
    finite = values[np.isfinite(values)]
    return finite if finite.size else None


def step_of(values: NDArray[np.float64]) -> float:
    """Return the step of an instrument that counts; 0 where none is seen.

    All differences are then whole multiples of it, and many values are the same.

    Examples
    --------
    >>> angle = np.sin(np.arange(100) / 20.0)
    >>> round(step_of(0.05 * np.round(angle / 0.05)), 3), step_of(angle)
    (0.05, 0.0)
    """
    apart = np.diff(np.unique(values))
    apart = apart[apart > 1e-9 * max(float(np.abs(values).max(initial=0.0)), 1e-12)]
    if not len(apart) or len(apart) > _SAME * len(values):
        return 0.0
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    off = np.abs(apart / step - np.round(apart / step))
    return step if float(np.quantile(off, 0.98)) < _WHOLE * max(1.0, float(np.median(apart / step))) else 0.0
