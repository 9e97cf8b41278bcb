"""Columns of a log file: which signal each one is, and in which unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from servotwin import units
from servotwin.errors import InputError, UnitError
from servotwin.logs.column_values import CLOCKS
from servotwin.models.outputs import SIGNALS
from servotwin.units.words import unit_word

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Sequence

    from numpy.typing import NDArray

TIME, SWITCH = "time", "torque_on"
# column -> (kind of command, SI unit); where a file has several, the first of these counts
COMMANDS = {"pulse_width": "pulse_width", "command_angle": "angle", "command_voltage": "voltage"}
UNITS = {name: output.unit for name, output in SIGNALS.items()}
"""SI unit of each signal that a log may hold; one behind the shaft may be measured before a model has it."""
NAMES = (TIME, *COMMANDS, SWITCH, *(name for name in UNITS if name not in COMMANDS))
_OF_SI = {"s": "time", "V": "voltage", "A": "current", "rad": "angle", "rad/s": "speed", "N m": "torque",
          "K": "temperature", "1": "number"}
# dimension -> {suffix of a column: unit}
_SUFFIXES = {
    "time": {"s": "s", "ms": "ms", "us": "us", "ns": "ns"}, "voltage": {"V": "V", "mV": "mV"},
    "current": {"A": "A", "mA": "mA"}, "angle": {"deg": "deg", "rad": "rad"},
    "speed": {"deg_per_s": "deg/s", "rad_per_s": "rad/s", "rpm": "rpm"},
    "torque": {"Nm": "N m", "mNm": "mN m"}, "temperature": {"K": "K"}, "number": {},
}
_NANOSECOND = 1e-9


@dataclass(frozen=True)
class Column:
    """Where a file holds a signal, and what its numbers mean: (scale · number + offset) in `unit`.

    Raw numbers of a program's memory may say minus in a bit, or be written without the sign that they had.

    Parameters
    ----------
    column : str
        As the header says it.
    unit : str
        Of the number after `scale` and `offset`; "iso" and "clock" for times that are dates and times of day.
    scale, offset : float
        Of raw numbers, such as counts.
    from_first : bool
        Times count from the first row; for stamps that count from 1970.
    sign_bit : int, optional
        Bit of the number that says minus, the lower bits the magnitude.
    bits : int, optional
        Of a two's complement: numbers of the upper half are negative.
    """

    column: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    from_first: bool = False
    sign_bit: int | None = None
    bits: int | None = None

    def to_si(self, values: NDArray[np.float64], name: str) -> NDArray[np.float64]:
        """Return the values of the signal `name` in SI; exact where they are in SI already."""
        if self.sign_bit is not None:
            values = np.where(values >= 2.0**self.sign_bit, 2.0**self.sign_bit - values, values)
        if self.bits is not None:
            values = np.where(values >= 2.0 ** (self.bits - 1), values - 2.0**self.bits, values)
        if self.scale != 1.0 or self.offset != 0.0:
            values = self.scale * values + self.offset
        if self.unit == "ns":
            return np.asarray(values / round(1.0 / _NANOSECOND))
        return np.asarray(units.to_si(values, self.unit, dimension_of_signal(name)))


def dimension_of_signal(name: str) -> str:
    """Return the dimension of a column's signal, as `servotwin.units` calls it.

    Examples
    --------
    >>> dimension_of_signal("time"), dimension_of_signal("output_angle")
    ('time', 'angle')
    """
    return "time" if name == TIME else "number" if name == SWITCH else _OF_SI[UNITS[name]]


def si_unit_of(name: str) -> str:
    """Return the SI unit of a column's signal."""
    return units.si_unit(dimension_of_signal(name))


def check_unit(what: str, unit: object, name: str) -> str:
    """Return a unit that measures the signal.

    Raises
    ------
    UnitError
        If it does not.
    """
    if unit == "ns" and dimension_of_signal(name) == "time":
        return "ns"
    if isinstance(unit, str) and unit in CLOCKS and name == TIME:
        return unit
    if not isinstance(unit, str):
        raise UnitError(what, got=unit, allowed="a text, such as " + si_unit_of(name))
    try:
        units.factor(unit, dimension_of_signal(name))
    except UnitError as error:
        more = (", ns" if dimension_of_signal(name) == "time" else "") + (", iso, clock" if name == TIME else "")
        raise UnitError(what, got=error.got, allowed=f"{error.allowed}{more}") from None
    return unit


def columns_of(header: Sequence[str], where: object, *, taken: Container[str] = (),
               says_more: Callable[[str], object] = lambda column: None) -> dict[str, Column]:
    """Return which columns of a header hold which signal, by their names; others are passed over.

    Parameters
    ----------
    header : sequence of str
    where : object
        What errors name.
    taken : container of str
        Signals that are known already.
    says_more : callable
        Whether a name that is nearly one of these says something else.

    Raises
    ------
    InputError
        If a signal comes twice, in a unit that is not its own, or is nearly but not quite spelled right.

    Examples
    --------
    >>> columns_of(["time_s", "output_angle_deg", "remark"], "run.csv")["output_angle"].unit
    'deg'
    """
    found: dict[str, Column] = {}
    for column in header:
        name = _name_of(column, where, says_more)
        if name is None or name in taken:
            continue
        if name in found:
            raise InputError(f"{where}: {name}", got=f"columns {found[name].column} and {column}",
                             allowed="one of them")
        found[name] = Column(column, _unit_behind(column, name) or si_unit_of(name))
    return found


def own_columns() -> dict[str, tuple[str, Column]]:
    """Return every name of a column that needs no guess: which signal it is, and what its numbers mean.

    Examples
    --------
    >>> name, column = own_columns()["output_angle_deg"]
    >>> name, column.unit, "angle" in own_columns()
    ('output_angle', 'deg', False)
    """
    names = (f"{name}_{suffix}" if suffix else name for name in NAMES
             for suffix in ("", *_SUFFIXES[dimension_of_signal(name)]))
    return {column: found for column in names for found in columns_of([column], column).items()}


def _unit_behind(column: str, name: str) -> str | None:
    """Return the unit behind a name, None where it is none of the signal's."""
    suffix = column[len(name) + 1:]
    known = _SUFFIXES[dimension_of_signal(name)]
    if suffix in known:
        return known[suffix]
    unit, dimension = unit_word(suffix) or ("", "")
    return unit if suffix and dimension == dimension_of_signal(name) else None


def _name_of(column: str, where: object, says_more: Callable[[str], object]) -> str | None:
    """Return the signal that a column's name says, None where it says none."""
    if column in NAMES:
        return column
    name = max((name for name in NAMES if column.startswith(f"{name}_")), key=len, default="")
    if name:
        if _unit_behind(column, name) is not None:
            return name
        if name in (TIME, SWITCH, "drive"):  # "time_of_day", "drive_mode": another thing
            return None
        raise UnitError(f"{where}: unit of column {column}", got=column[len(name) + 1:],
                        allowed=f"{', '.join(_SUFFIXES[dimension_of_signal(name)]) or 'none'}; without one it is in "
                        f"{si_unit_of(name)}")
    near = get_close_matches(_stem(column), NAMES, n=1, cutoff=0.85)
    if near and not says_more(column):
        raise InputError(f"{where}: column", got=column,
                         allowed=f'{near[0]}, if that is meant; --columns or "columns" of a sidecar says which column '
                         "is what")
    return None


def _stem(column: str) -> str:
    """Return a column's name without a unit behind it."""
    suffixes = sorted({s for known in _SUFFIXES.values() for s in known}, key=len, reverse=True)
    return next((column[:-len(s) - 1] for s in suffixes if column.endswith(f"_{s}")), column)


def switch_value(text: str) -> float:
    """Return 1 or 0 for a word that means on or off, nan for any other.

    Examples
    --------
    >>> switch_value("True"), switch_value("0")
    (1.0, 0.0)
    """
    word = text.strip().lower()
    return 1.0 if word in ("1", "1.0", "true", "on", "yes") else 0.0 if word in (
        "0", "0.0", "false", "off", "no") else math.nan
