"""Columns that are named after the registers of a bus servo and hold their raw numbers: counts, signs and steps."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.logs.column_values import MOST_DEGREES
from servotwin.logs.columns import Column
from servotwin.parameters import Servo
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.listing import register_family, register_words
from servotwin.parameters.registers.register import Register
from servotwin.parameters.registers.table import Family, family_label
from servotwin.tables import TextTable
from servotwin.units.words import unit_word

OPTION = "--registers"
_GOAL, _POSITION = "Goal_Position", "Present_Position"
# What a log holds of a servo's registers, of several for one signal the first: a servo tells its duty as PWM or as load
_SIGNALS = {"command_angle": (_GOAL,), "output_angle": (_POSITION,),
            "output_speed": ("Present_Velocity", "Present_Speed"),
            "current": ("Present_Current",), "bus_voltage": ("Present_Voltage", "Present_Input_Voltage"),
            "duty": ("Present_PWM", "Present_Load"), "housing_temperature": ("Present_Temperature",)}
_SENSED = {"motor": "armature_current", "bus": "supply_current"}
_BETWEEN = re.compile(r"[\s_-]+")
_STEP = re.compile(r"(?P<over>[\d.]+)?(?:/(?P<under>\d+))?\s*(?P<unit>[^\d,]*)(?:, assumed)?")
_ZERO_CELSIUS = 273.15


class RawRegisters(NamedTuple):
    """Whose registers the columns of a table may be named after.

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
    found = _found(table, raw.family, taken)
    if not raw.said and not _are_raw(table, found):
        return {}
    known = f"{OPTION} {raw.said}" if raw.said else f"register of {raw.family.model}"
    made: dict[str, RegisterColumn] = {}
    for signal, registers in _SIGNALS.items():
        name = next((name for name in registers if name in found and raw.family.registers[name].unit), None)
        if name is not None:
            one = raw.family.registers[name]
            _check(table, found[name], name, raw.family)
            own = _SENSED[raw.family.current_sense] if signal == "current" else signal
            made[own] = RegisterColumn(_column(found[name], raw.family, one),
                                       known + ", assumed" * one.unit.endswith("assumed"))
    return made


def named_after(table: TextTable, raw: RawRegisters) -> frozenset[str]:
    """Return the columns of a table that are named after registers, read or not."""
    return frozenset(_found(table, raw.family).values())


def _plain(name: str) -> str:
    return _BETWEEN.sub("", name).casefold()


def _names(family: Family) -> dict[str, str]:
    return {_plain(name): name for name in family.registers} | {
        _plain(other): name for other, name in family.other_names.items() if name in family.registers}


def _found(table: TextTable, family: Family, taken: Container[str] = ()) -> dict[str, str]:
    """Return the columns by register; raise where two are one register."""
    names = _names(family)
    found: dict[str, str] = {}
    for column in table.header:
        name = None if column in taken else names.get(_plain(column))
        if name is not None and found.setdefault(name, column) != column:
            raise InputError(f"{table.path}: register {name}", got=f"columns {found[name]} and {column}",
                             allowed="one of them")
    return found


def _positions(table: TextTable, found: Mapping[str, str]) -> Iterator[NDArray[np.float64]]:
    for name in (_GOAL, _POSITION):
        if name in found:
            try:
                values = table.numbers(found[name], missing=math.nan)
            except InputError:  # words; whoever reads the column says so
                return
            yield values[np.isfinite(values)]


def _are_raw(table: TextTable, found: Mapping[str, str]) -> bool:
    """Return whether positions are counts; raise where they may as well be degrees."""
    values = np.concatenate([np.empty(0), *_positions(table, found)])
    if not values.size or not (values == np.round(values)).all():
        return False
    if np.abs(values).max() > MOST_DEGREES:
        return True
    raise InputError(f"{table.path}: {found.get(_POSITION, found.get(_GOAL))}", got=f"whole numbers up to "
                     f"{np.abs(values).max():g}", allowed=f"{OPTION} feetech-sts or the like, if they are counts of "
                     f'registers, or --columns "{_degrees(found)}"')


def _degrees(found: Mapping[str, str]) -> str:
    return " ".join(f"{signal}={found[name]}:deg" for signal, name in (("command", _GOAL), ("angle", _POSITION))
                    if name in found)


def _ask(table: TextTable, taken: Container[str]) -> None:
    """Raise where columns are raw registers of a servo that nobody told."""
    fitting: dict[str, list[str]] = {}
    for word in register_words():
        family = register_family(word)
        found = _found(table, family, taken)
        values = np.concatenate([np.empty(0), *_positions(table, found)])
        low, high = _range(family, family.registers[_POSITION])
        if values.size and (values == np.round(values)).all() and values.max() > MOST_DEGREES \
                and low <= values.min() and values.max() <= high:
            fitting[word] = list(found.values())
    most = max(map(len, fitting.values()), default=0)
    if best := [word for word, columns in fitting.items() if len(columns) == most]:
        raise InputError(f"{table.path}: {', '.join(fitting[best[0]])}", got="names of registers of a bus servo, and "
                         "counts", allowed=f"{OPTION} {' or '.join(best)}, or a model such as XM430-W350, which says "
                         "counts, signs and steps")


def _range(family: Family, one: Register) -> tuple[int, int]:
    """Return the least and the greatest raw number of a register, with its sign told or not."""
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
                         allowed=f"a whole number from {low} to {high}, as register {name} holds; or --columns, which "
                         "says the unit of a column")


def _column(column: str, family: Family, one: Register) -> Column:
    """Return what the numbers of a register mean."""
    degrees = round(math.degrees(family.count), 12)  # 360/4096 is exact so
    unit, scale, offset = {"count": ("deg", degrees, -family.middle * degrees), "count/s": ("deg/s", degrees, 0.0),
                           "°C": ("K", 1.0, _ZERO_CELSIUS)}.get(one.unit) or _step(one.unit)
    return Column(column, unit, scale, offset, sign_bit=one.sign_bit, bits=8 * one.size if one.signed else None)


def _step(text: str) -> tuple[str, float, float]:
    """Return unit and scale of a step such as "6.5 mA", "1/885" or "0.1 %"; the offset is none."""
    match = _STEP.fullmatch(text)
    unit = None if match is None else unit_word(match["unit"])
    if match is None or (unit is None and match["unit"]):
        raise InputError("unit of a register", got=text, allowed="a number and a unit")
    return unit[0] if unit else "1", float(match["over"] or 1.0) / float(match["under"] or 1.0), 0.0
