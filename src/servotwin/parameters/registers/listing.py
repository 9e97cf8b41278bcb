"""The tables of registers, to be printed: every register of every model with its value and the page that prints it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

from servotwin.errors import UnknownNameError
from servotwin.parameters.registers.dynamixel_one import (
    AX_MODELS,
    MX_MODELS,
    XL320_MODELS,
    ax_family,
    mx_family,
    xl320_family,
)
from servotwin.parameters.registers.dynamixel_x import X_MODELS, x_family
from servotwin.parameters.registers.feetech import STS_MODELS, sts_family
from servotwin.parameters.registers.table import Family

_FAMILIES: dict[str, tuple[Callable[[Any], Family], tuple[Any, ...]]] = {
    "feetech-sts": (sts_family, STS_MODELS), "dynamixel-x": (x_family, X_MODELS),
    "dynamixel-mx": (mx_family, MX_MODELS), "dynamixel-ax": (ax_family, AX_MODELS),
    "dynamixel-xl320": (xl320_family, XL320_MODELS)}


def register_words() -> tuple[str, ...]:
    """Return the words of the families with registers.

    Examples
    --------
    >>> register_words()[:2]
    ('feetech-sts', 'dynamixel-x')
    """
    return tuple(_FAMILIES)


@cache
def register_family(word: str) -> Family:
    """Return registers by the word of a family, such as feetech-sts, or by the name of a model.

    Of a family alone, steps that differ between its models have no unit; one that is only assumed of a model does not
    count.

    Raises
    ------
    UnknownNameError
        If there is no family and no model of this name.

    Examples
    --------
    >>> [register_family(word).registers["Present_Current"].unit for word in (
    ...     "feetech-sts", "dynamixel-x", "xl330-m288")]
    ['6.5 mA', '', '1 mA']
    """
    plain = word.strip().lower()
    if plain not in _FAMILIES:
        models = {model.name.lower(): model for model in _models()}
        if plain not in models:
            raise UnknownNameError("registers", word, [*_FAMILIES, *(model.name for model in models.values())])
        return models[plain].table
    make, models_of = _FAMILIES[plain]
    tables = [make(model).registers for model in models_of]
    units = {name: {table[name].unit for table in tables if name in table and "assumed" not in table[name].unit}
             for name in tables[0]}
    family = make(models_of[0])
    return replace(family, model=plain, registers={
        name: replace(one, unit=next(iter(units[name])) if len(units[name]) == 1 else "")
        for name, one in family.registers.items()})


class ListedModel(NamedTuple):
    """A model of a family.

    Parameters
    ----------
    family, name : str
    number : int
        That it answers with.
    rows, assumed : int
        How many registers its table has, and of how many no page prints the value.
    page : str
        Address of the page; empty where none was seen.
    table : Family
    """

    family: str
    name: str
    number: int
    rows: int
    assumed: int
    page: str
    table: Family


class Row(NamedTuple):
    """A register of a model.

    Parameters
    ----------
    name : str
    address : int
    value : int
        When the servo is new, or after power-up.
    lower, upper : int
        Range.
    numbers : tuple of str
        Of the firmware group, that follow from it.
    document : str
        Document and section that print the value; empty: it is assumed.
    page : str
        Address of that page, where it is the model's own.
    """

    name: str
    address: int
    value: int
    lower: int
    upper: int
    numbers: tuple[str, ...]
    document: str
    page: str


def listed_models() -> list[ListedModel]:
    """Return all models of all families.

    Examples
    --------
    >>> [model.name for model in listed_models() if model.family == "dynamixel-xl320"]
    ['XL-320']
    """
    return list(_models())


def listed_model(name: str) -> ListedModel:
    """Return a model by its name.

    Raises
    ------
    UnknownNameError
        If there is none of this name.

    Examples
    --------
    >>> listed_model("xl330-m288").number
    1200
    """
    found = {model.name.lower(): model for model in _models()}
    if name.strip().lower() not in found:
        raise UnknownNameError("model with registers", name, [model.name for model in found.values()])
    return found[name.strip().lower()]


def rows_of(model: ListedModel) -> list[Row]:
    """Return the registers of a model by address; what the servo itself writes, such as its angle, is left out.

    Examples
    --------
    >>> next(row for row in rows_of(listed_model("XC330-M288")) if row.name == "Position_P_Gain").value
    1100
    """
    family, rows = model.table, []
    for name, register in sorted(family.registers.items(), key=lambda item: item[1].address):
        if register.reading:
            continue
        numbers = tuple(setting.name for setting in family.settings if name in setting.registers)
        document = family.document(name)
        rows.append(Row(name, register.address, register.factory, register.lower, register.upper, numbers, document,
                        model.page if document == family.reference else ""))
    return rows


class WireRow(NamedTuple):
    """A register of a model as it lies in the memory.

    Parameters
    ----------
    address, size : int
        Size in bytes.
    name : str
    sign : str
        "", "bit 15" that says minus, or "two's complement".
    memory : str
        "EEPROM" or "RAM".
    value : str
        When the servo is new, or after power-up; empty of what it writes itself.
    range : str
    unit : str
    source : str
        Document that prints the value, or "assumed".
    does : str
        Effect of a write on a wire.
    """

    address: int
    size: int
    name: str
    sign: str
    memory: str
    value: str
    range: str
    unit: str
    source: str
    does: str


def wire_rows(model: ListedModel) -> list[WireRow]:
    """Return all registers of a model, those that it writes itself too, by address.

    Examples
    --------
    >>> row = next(row for row in wire_rows(listed_model("STS3215-12V")) if row.name == "Homing_Offset")
    >>> row.address, row.size, row.sign, row.memory, row.does
    (31, 2, 'bit 11', 'EEPROM', 'acts')
    """
    family, found = model.table, []
    for name, one in sorted(family.registers.items(), key=lambda item: item[1].address):
        sign = "" if one.sign_bit is None else f"bit {one.sign_bit}"
        found.append(WireRow(
            one.address, one.size, name, "two's complement" if one.signed else sign, "EEPROM" if one.stored else "RAM",
            "" if one.reading else str(one.factory), "" if one.reading else f"{one.lower} to {one.upper}", one.unit,
            "" if one.reading else family.document(name) or "assumed", family.does(name)))
    return found


@cache
def _models() -> tuple[ListedModel, ...]:
    made = []
    for name, (make, models) in _FAMILIES.items():
        for model in models:
            family = make(model)
            shown = [key for key, register in family.registers.items() if not register.reading]
            made.append(ListedModel(name, model.name, model.number, len(shown),
                                    sum(not family.document(key) for key in shown), model.page, family))
    return tuple(made)
