"""Servo files: TOML with one table per group, each value with unit, origin, source and spread."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin import units
from servotwin.errors import InputError, ParameterError, ServoFileError, UnitError, UnknownNameError
from servotwin.parameters.group import Group
from servotwin.parameters.groups import GROUPS
from servotwin.parameters.output_file import write_file
from servotwin.parameters.plausible import warn_of
from servotwin.parameters.quantity import ORIGINS, Quantity
from servotwin.parameters.servo import KINDS, Servo, unit_of
from servotwin.parameters.sheet_table import voltage_range
from servotwin.text import fault_of, load_toml

if TYPE_CHECKING:
    import tomlkit

_ENTRY_KEYS = ("value", "unit", "origin", "source", "std", "lower", "upper")
_TOP_KEYS = ("name", "title", "kind", "notes", "sheet", "fit", *GROUPS)


def read_servo_file(path: Path, name: str | None = None) -> Servo:
    """Return the servo that a file describes.

    Parameters
    ----------
    path : Path
    name : str, optional
        How errors call the file; its path unless given.

    Raises
    ------
    ServoFileError
        If the file cannot be read or holds something wrong: names file, table, key, got and allowed.
    """
    label = name or (str(path) if "\0" not in str(path) else repr(str(path)))
    return _servo_of(_read_toml(lambda: path.read_text(encoding="utf-8-sig"), label), label)


def read_servo_text(text: str, name: str) -> Servo:
    """Return the servo that the text of a servo file describes.

    Parameters
    ----------
    text : str
    name : str
        How errors call it.

    Raises
    ------
    ServoFileError
        As of `read_servo_file`.

    Examples
    --------
    >>> read_servo_text('name = "mine"', "a text").name
    'mine'
    """
    return _servo_of(_read_toml(lambda: text.removeprefix("\ufeff"), name), name)


def _servo_of(content: dict[str, Any], label: str) -> Servo:
    for key in content:
        if key not in _TOP_KEYS:
            near = UnknownNameError("table or key", key, _TOP_KEYS)
            raise ServoFileError(label, str(near))
    for key in ("name", "title", "kind", "notes"):
        if not isinstance(content.get(key, ""), str):
            raise ServoFileError(label, "not a text", key=key, got=content[key], allowed="a text")
    for key in ("name", "title"):
        if fault := fault_of(content.get(key, "")):
            raise ServoFileError(label, "not possible", key=key, got=content[key], allowed=fault)
    if not content.get("name"):
        raise ServoFileError(label, "missing", key="name", allowed='a short id, such as name = "my-servo"')
    if (kind_of_servo := content.get("kind", KINDS[0])) not in KINDS:
        raise ServoFileError(label, "not a kind of servo", key="kind", got=kind_of_servo, allowed=", ".join(KINDS))
    groups: dict[str, Group] = {}
    quantities: dict[str, Quantity] = {}
    for table, kind in GROUPS.items():
        if table in content:
            groups[table], found = _read_group(label, table, kind, content[table])
            quantities |= found
    sheet, fit = _table(label, content, "sheet"), _table(label, content, "fit")
    try:
        voltage_range(content["name"], sheet)
    except InputError as error:
        raise ServoFileError(label, f"{error.what} is not possible", got=error.got, allowed=error.allowed) from None
    try:
        servo = Servo(
            name=content["name"], title=content.get("title", content["name"]), notes=content.get("notes", ""),
            kind=kind_of_servo, sheet=sheet, fit=fit, quantities=quantities, **groups)  # type: ignore[arg-type]
    except ParameterError as error:  # what two groups say together
        raise ServoFileError(label, f"{error.what} is not possible", got=error.got, allowed=error.allowed) from None
    warn_of(servo, servo.names(), lambda name: _unit_in(content, name), stacklevel=5)
    return servo


def _unit_in(content: Mapping[str, Any], name: str) -> str | None:
    table, _, key = name.partition(".")
    unit = content[table][key].get("unit")
    return None if unit is None else str(unit)


def _read_toml(read: Callable[[], str], label: str) -> dict[str, Any]:
    try:
        return load_toml(read())
    except FileNotFoundError:
        raise ServoFileError(label, "no such file") from None
    except IsADirectoryError:
        raise ServoFileError(label, "is a folder, not a servo file") from None
    except UnicodeDecodeError:
        raise ServoFileError(label, "is not UTF-8 text") from None
    except OSError as error:
        raise ServoFileError(label, f"cannot be read ({error.strerror})") from None
    except ValueError as error:  # no TOML, one nested too deeply, an integer of thousands of digits, a path with a NUL
        raise ServoFileError(label, f"is not valid TOML: {error}") from None


def _table(label: str, content: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = content.get(key, {})
    if not isinstance(table, dict):
        raise ServoFileError(label, "not a table", key=key, got=table, allowed=f"a table [{key}]")
    return table


def _read_group(label: str, table: str, kind: type[Group], content: Any) -> tuple[Group, dict[str, Quantity]]:
    if not isinstance(content, dict):
        raise ServoFileError(label, "not a table", table=table, got=content, allowed=f"a table [{table}]")
    dimensions = {f.name: f.metadata["dimension"] for f in fields(kind)}
    quantities: dict[str, Quantity] = {}
    for key, entry in content.items():
        if key not in dimensions:
            raise ServoFileError(label, str(UnknownNameError("parameter", key, dimensions)), table=table)
        quantities[key] = _read_entry(label, table, key, dimensions[key], entry)
    try:
        group = kind(**{key: q.value for key, q in quantities.items()})
    except ParameterError as error:
        raise ServoFileError(label, "not possible", table=table, key=error.what.partition(".")[2], got=error.got,
                             allowed=error.allowed) from None
    return group, {f"{table}.{key}": quantity for key, quantity in quantities.items()}


def _read_entry(label: str, table: str, key: str, dimension: str, entry: Any) -> Quantity:
    def wrong(problem: str, got: object = None, allowed: str | None = None) -> ServoFileError:
        return ServoFileError(label, problem, table=table, key=key, got=got, allowed=allowed)

    if not isinstance(entry, dict):
        raise wrong("not a value with its origin", entry,
                    '{ value = ..., unit = "...", origin = "...", source = "..." }')
    for name in entry:
        if name not in _ENTRY_KEYS:
            raise wrong(str(UnknownNameError("entry", name, _ENTRY_KEYS)))
    if "value" not in entry:
        raise wrong("no value", allowed="value = ...")
    if "origin" not in entry:
        raise wrong("no origin", allowed=", ".join(ORIGINS))
    for name in ("unit", "origin", "source"):
        if name in entry and not isinstance(entry[name], str):
            raise wrong(f"{name} is not a text", entry[name], "a text")
    value, unit = entry["value"], entry.get("unit")
    numbers = {name: entry[name] for name in ("std", "lower", "upper") if name in entry}
    if dimension == "word":
        if unit is not None or numbers:
            raise wrong("a word has neither unit nor spread", unit or next(iter(numbers)), "value, origin, source")
        converted: Any = value
    else:
        if unit is None:
            raise wrong("no unit", allowed=", ".join(units.DIMENSIONS[dimension]))
        try:
            units.factor(unit, dimension)
        except UnitError as error:
            raise wrong("wrong unit", error.got, error.allowed) from None
        for name, number in numbers.items():
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise wrong(f"{name} is not a number", number, "a number")
        converted = _converted(value, unit, dimension)
        numbers = {name: _converted(number, unit, dimension) for name, number in numbers.items()}
    try:
        return Quantity(value=converted, unit="" if dimension == "word" else units.si_unit(dimension),
                        origin=entry["origin"], source=entry.get("source"), **numbers)
    except ParameterError as error:
        raise wrong(error.what, error.got, error.allowed) from None


def _converted(value: Any, unit: str, dimension: str) -> Any:
    """Convert numbers; anything else goes on as it is, for the group to refuse."""
    if isinstance(value, list):
        return tuple(_converted(x, unit, dimension) for x in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    try:
        return units.to_si(float(value), unit, dimension)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def servo_text(servo: Servo) -> str:
    """Return the text of a servo file, in SI.

    Examples
    --------
    >>> print(servo_text(Servo(name="mine")))
    name = "mine"
    title = ""
    <BLANKLINE>
    """
    return _document(servo).as_string()


def write_servo_file(servo: Servo, path: Path, *, overwrite: bool = False) -> None:
    """Write a servo file in SI; a failure leaves what was there untouched."""
    write_file(path, servo_text(servo), overwrite=overwrite)


def _document(servo: Servo) -> tomlkit.TOMLDocument:
    import tomlkit

    document = tomlkit.document()
    document["name"], document["title"] = servo.name, servo.title
    if servo.kind != KINDS[0]:
        document["kind"] = servo.kind
    if servo.notes:
        document["notes"] = servo.notes
    for group in GROUPS:
        names = [name for name in servo.names() if name.startswith(f"{group}.")]
        if not names:
            continue
        table = tomlkit.table()
        for name in names:
            table[name.partition(".")[2]] = _entry(servo.source(name), unit_of(name))
        document[group] = table
    for key in ("sheet", "fit"):
        if content := getattr(servo, key):
            document[key] = dict(content)
    return document


def _entry(quantity: Quantity, unit: str) -> tomlkit.items.InlineTable:
    import tomlkit

    entry = tomlkit.inline_table()
    entry["value"] = list(quantity.value) if isinstance(quantity.value, tuple) else quantity.value
    if unit:
        entry["unit"] = unit
    for name in ("origin", "source", "std", "lower", "upper"):
        if (item := getattr(quantity, name)) is not None:
            entry[name] = item
    return entry
