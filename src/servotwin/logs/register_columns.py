"""Columns that are named after the registers of a bus servo and hold their raw numbers: counts, signs and steps."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.column_words import SAID
from servotwin.logs.columns import MOST_DEGREES, Column
from servotwin.parameters import Servo
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.listing import register_family, register_words
from servotwin.parameters.registers.table import Family, Register, family_label
from servotwin.tables import TextTable
from servotwin.units.words import unit_word

OPTION = "--registers"
_GOAL, _POSITION = "Goal_Position", "Present_Position"
# Registers of a servo in a log, of several for one signal the first that the family has: the load of an STS
# is its duty, that of a Dynamixel, which has a register of its own for PWM, something estimated
_SIGNALS = {"command_angle": (_GOAL,), "output_angle": (_POSITION,),
            "output_speed": ("Present_Velocity", "Present_Speed"),
            "current": ("Present_Current",), "bus_voltage": ("Present_Voltage", "Present_Input_Voltage"),
            "duty": ("Present_PWM", "Present_Load"), "housing_temperature": ("Present_Temperature",)}
_SENSED = {"motor": "armature_current", "bus": "supply_current"}
_BETWEEN = re.compile(r"[\s_-]+")
_STEP = re.compile(r"(?P<over>[\d.]+)?(?:/(?P<under>\d+))?\s*(?P<unit>[^\d,]*)(?:, assumed)?")  # "0.1 V", "1/885"
_ZERO_CELSIUS = 273.15


class RawRegisters(NamedTuple):
    """The family and servo by whose registers the columns of a table may be named.

    Parameters
    ----------
    family : Family
    said : str
        The word that said so; empty where it is the servo's own, and the values have to show that they are raw.
    """

    family: Family
    said: str = ""


class RegisterColumn(NamedTuple):
    """A column of raw registers, and how that is known."""

    column: Column
    known: str


def raw_registers(registers: str | Servo | None) -> RawRegisters | None:
    """Return whose registers they are: of a family or model by its word, or of a servo; None of a servo without.

    Raises
    ------
    UnknownNameError
        If there is no family and no model of that name.

    Examples
    --------
    >>> raw_registers("XM430-W350").family.registers["Present_Current"].unit
    '2.69 mA'
    """
    if registers is None or isinstance(registers, str):
        return None if registers is None else RawRegisters(register_family(registers), registers)
    return None if family_label(registers) is None else RawRegisters(register_family_of(registers))


def register_named(family: Family, column: str) -> str | None:
    """Return the register of a family that a column is named after, None if there is none.

    Examples
    --------
    >>> family = register_family("feetech-sts")
    >>> [register_named(family, name) for name in ("present position", "PresentSpeed", "angle_deg")]
    ['Present_Position', 'Present_Velocity', None]
    """
    return _names(family).get(_plain(column))


def register_columns(table: TextTable, raw: RawRegisters | None, taken: Container[str] = (),
                     ) -> dict[str, RegisterColumn]:
    """Return the columns of a table that hold raw registers, by signal; none where nothing says that they do.

    Of a servo's own registers the positions show that they are raw: whole numbers beyond what degrees can be.

    Parameters
    ----------
    table : TextTable
    raw : RawRegisters, optional
        None: nobody said whose they are.
    taken : container of str
        Columns that are known already.

    Raises
    ------
    InputError
        If they are raw, but nobody said whose; if a number is none that its register holds; or if they may be degrees.
    """
    if not table.has_header:
        return {}
    if raw is None:
        _ask(table, taken)
        return {}
    named = _named(table, raw.family, taken)
    if not raw.said and not _are_raw(table, named):
        return {}
    known = f"{OPTION} {raw.said}" if raw.said else f"register of {raw.family.model}"
    made: dict[str, RegisterColumn] = {}
    for signal, registers in _SIGNALS.items():
        name = next((name for name in registers if name in raw.family.registers), "")
        if name in named.values() and raw.family.registers[name].unit:
            column, one = _only(table, named, name), raw.family.registers[name]
            _check(table, column, name, raw.family)
            own = _SENSED[raw.family.current_sense] if signal == "current" else signal
            made[own] = RegisterColumn(_column(column, raw.family, one),
                                       known + ", assumed" * one.unit.endswith("assumed"))
    return made


def named_after_any(table: TextTable) -> frozenset[str]:
    """Return the columns of a table that are named after a register of any family, read or not."""
    return frozenset(column for word in register_words() for column in _named(table, register_family(word)))


def _plain(name: str) -> str:
    return _BETWEEN.sub("", name).casefold()


def _names(family: Family) -> dict[str, str]:
    return {_plain(name): name for name in family.registers} | {
        _plain(other): name for other, name in family.other_names.items() if name in family.registers}


def _named(table: TextTable, family: Family, taken: Container[str] = ()) -> dict[str, str]:
    """Return the registers by the columns that are named after them."""
    names = _names(family)
    return {column: names[_plain(column)] for column in table.header
            if column not in taken and _plain(column) in names}


def _only(table: TextTable, named: Mapping[str, str], name: str) -> str:
    """Return the column of a register; raise where two are."""
    columns = [column for column, register in named.items() if register == name]
    if len(columns) > 1:
        raise InputError(f"{table.path}: register {name}", got=f"columns {' and '.join(columns)}",
                         allowed="one of them")
    return columns[0]


def _positions(table: TextTable, named: Mapping[str, str]) -> NDArray[np.float64]:
    """Return all goals and positions; none where they are not whole numbers."""
    columns = [column for column, name in named.items() if name in (_GOAL, _POSITION)]
    try:
        values = np.concatenate([np.empty(0), *(table.numbers(column, missing=math.nan) for column in columns)])
    except InputError:  # words; whoever reads the column says so
        return np.empty(0)
    values = values[np.isfinite(values)]
    return values if (values == np.round(values)).all() else np.empty(0)


def _are_raw(table: TextTable, named: Mapping[str, str]) -> bool:
    """Return whether positions are counts; raise where they may as well be degrees."""
    values = np.abs(_positions(table, named))
    if not values.size or values.max() > MOST_DEGREES:
        return bool(values.size)
    words = {_GOAL: "command", _POSITION: "angle"}
    said = [f"{words[name]}={column}:deg" for column, name in named.items() if name in words]
    raise InputError(f"{table.path}: {', '.join(column for column, name in named.items() if name in words)}",
                     got=f"whole numbers up to {values.max():g}", allowed=f"{OPTION} feetech-sts or the like, if they "
                     f'are counts of registers, or {SAID} "{" ".join(said)}"')


def _ask(table: TextTable, taken: Container[str]) -> None:
    """Raise where columns are raw registers of a servo that is not given."""
    fitting: dict[str, list[str]] = {}
    for word in register_words():
        family = register_family(word)
        named = _named(table, family, taken)
        values, (low, high) = _positions(table, named), _range(family, family.registers[_POSITION])
        if values.size and values.max() > MOST_DEGREES and low <= values.min() and values.max() <= high:
            fitting[word] = list(named)
    most = max(map(len, fitting.values()), default=0)
    if best := [word for word, columns in fitting.items() if len(columns) == most]:
        raise InputError(f"{table.path}: {', '.join(fitting[best[0]])}", got="names of registers of a bus servo, and "
                         "counts", allowed=f"{OPTION} {' or '.join(best)}, or a model such as XM430-W350, which says "
                         f"counts, signs and steps; or {SAID}, which says them of each column")


def _range(family: Family, one: Register) -> tuple[int, int]:
    """Return the least and the greatest raw number of a register, with its sign stated or not."""
    if one.signed:
        return -2 ** (8 * one.size - 1), 2 ** (8 * one.size) - 1
    if one.sign_bit is not None:
        return -(2**one.sign_bit - 1), 2 ** (one.sign_bit + 1) - 1
    return 0, 2 * family.middle - 1 if one.unit == "count" else 2 ** (8 * one.size) - 1


def _check(table: TextTable, column: str, name: str, family: Family) -> None:
    """Raise where a column holds what its register cannot: names line and value."""
    low, high = _range(family, family.registers[name])
    values = table.numbers(column, missing=math.nan)
    wrong = np.flatnonzero((values != np.round(values)) | (values < low) | (values > high))
    wrong = wrong[np.isfinite(values[wrong])]
    if wrong.size:
        row = table.rows[wrong[0]]
        raise InputError(f"{table.path}: line {row.line}, {column}", got=f"{values[wrong[0]]:g}",
                         allowed=f"a whole number from {low} to {high}, as register {name} holds; or {SAID}, which "
                         "says the unit of a column")


def _column(column: str, family: Family, one: Register) -> Column:
    """Return what the numbers of a register mean."""
    match = _STEP.fullmatch(one.unit)
    if match is None:
        raise InputError("unit of a register", got=one.unit, allowed="a number and a unit")
    degrees = round(math.degrees(family.count), 12)  # 360/4096 is exact so
    unit, scale, offset = {
        "count": ("deg", degrees, -family.middle * degrees), "count/s": ("deg/s", degrees, 0.0),
        "°C": ("K", 1.0, _ZERO_CELSIUS), "": ("1", 1.0, 0.0)}.get(match["unit"]) or (
        (unit_word(match["unit"]) or ("",))[0], 1.0, 0.0)
    return Column(column, unit, float(match["over"] or 1.0) / float(match["under"] or 1.0) * scale, offset,
                  sign_bit=one.sign_bit, bits=8 * one.size if one.signed else None)
