"""Servo files: TOML with one table per group, each value with unit, origin, source and spread."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin import units
from servotwin.errors import InputError, ParameterError, ServoFileError, ServotwinError, UnitError, UnknownNameError
from servotwin.parameters.groups import GROUPS, Group
from servotwin.parameters.output_file import write_file
from servotwin.parameters.servo import KINDS, ORIGINS, Quantity, Servo, unit_of, warn_of
from servotwin.text import fault_of, load_toml

if TYPE_CHECKING:
    import tomlkit


# --- The table [sheet] of a servo file: the figures that a maker prints, each with unit and source --------------------

ELSE = "also_at"
"""Key of the rows with figures at other voltages and of other sources."""

# key of the file -> name, dimension, unit; a speed is printed as the time for 60 degrees
POINT = {"supply_voltage": ("supply_voltage", "voltage", "V"), "stall_torque": ("stall_torque", "torque", "N m"),
         "speed_per_60deg": ("no_load_speed", "time", "s"), "no_load_current": ("no_load_current", "current", "A"),
         "stall_current": ("stall_current", "current", "A"), "idle_current": ("idle_current", "current", "A")}
WHOLE = {"voltage_min": ("voltage_min", "voltage", "V"), "voltage_max": ("voltage_max", "voltage", "V"),
         "deadband": ("deadband", "time", "us"), "pulse_min": ("pulse_min", "time", "us"),
         "pulse_max": ("pulse_max", "time", "us"), "neutral_pulse": ("neutral_pulse", "time", "us"),
         "travel": ("travel", "angle", "deg"), "travel_per_400us": ("angle_per_pulse", "angle", "deg"),
         "stop_travel": ("stop_travel", "angle", "deg"), "backlash": ("backlash", "angle", "deg"),
         "gear_reduction": ("gear_reduction", "number", "1"), "mass": ("mass", "mass", "g")}
_SPREADS = ("std", "lower", "upper")
_TWO = "two positive voltages, the lower one first"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A printed figure in SI; a speed as such, and not as the time for 60 degrees.

    Parameters
    ----------
    value : float
    source : str
    std, lower, upper : float, optional
        How far servos of this kind scatter about it, where the file says so.
    """

    value: float
    source: str
    std: float | None = None
    lower: float | None = None
    upper: float | None = None


def printed(key: str, value: float) -> float:
    """Return a value (SI) as sheets print it, still in SI; for speeds it is its own inverse.

    Examples
    --------
    >>> round(printed("speed_per_60deg", printed("speed_per_60deg", 4.0)), 12)
    4.0
    """
    return math.pi / 3.0 / value if key == "speed_per_60deg" else value * 400e-6 if key == "travel_per_400us" else value


def figure(servo: str, key: str, entry: Any) -> Figure | None:
    """Return a figure of a table [sheet]; None where it is assumed, written by hand for what is not printed.

    Parameters
    ----------
    servo : str
        Name of the servo, for errors.
    key : str
        One of `POINT` and `WHOLE`.
    entry : mapping
        With value, unit and source; std, or lower and upper, are the spread of the figure.

    Raises
    ------
    InputError
        If it is no figure, or its spread does not fit it.

    Examples
    --------
    >>> found = figure("mine", "speed_per_60deg", {"value": 0.23, "unit": "s", "source": "the box"})
    >>> round(found.value, 3)
    4.553
    """
    _, dimension, unit = {**POINT, **WHOLE}[key]
    if isinstance(entry, Mapping) and str(entry.get("source", "")).startswith("assumed"):
        return None
    try:
        value = units.to_si(float(entry["value"]), str(entry["unit"]), dimension)
        spread = {name: units.to_si(float(entry[name]), str(entry["unit"]), dimension)
                  for name in _SPREADS if name in entry}
        if not math.isfinite(value):
            raise ValueError
    except (KeyError, TypeError, ValueError, ServotwinError):
        raise InputError(f"[sheet] {key} of {servo!r}", got=entry,
                         allowed=f'{{ value = ..., unit = "{unit}", source = "..." }}') from None
    _check_spread(f"[sheet] {key} of {servo!r}", value, spread)
    source = str(entry.get("source", ""))
    if key == "speed_per_60deg" and value > 0.0:
        speed = printed(key, value)
        std = speed * spread["std"] / value if "std" in spread else None
        ends = {new: printed(key, spread[old]) for new, old in (("lower", "upper"), ("upper", "lower"))
                if old in spread}
        return Figure(value=speed, source=source, std=std, **ends)
    by = 400e-6 if key == "travel_per_400us" else 1.0
    return Figure(value=value / by, source=source, **{name: x / by for name, x in spread.items()})


def voltage_range(servo: str, table: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage that a maker states for operation [V]; None where not stated.

    Raises
    ------
    InputError
        If the table has one end only, or one that is no voltage, or the low one is above the high one.

    Examples
    --------
    >>> volts = {"voltage_min": {"value": 4.8, "unit": "V"}, "voltage_max": {"value": 7200, "unit": "mV"}}
    >>> voltage_range("mine", volts)
    (4.8, 7.2)
    """
    low, high = (figure(servo, key, table[key]) if key in table else None for key in ("voltage_min", "voltage_max"))
    check_voltages(f"[sheet] voltage_min and voltage_max of {servo!r}", None if low is None else low.value,
                   None if high is None else high.value)
    return None if low is None or high is None else (low.value, high.value)


def check_voltages(what: str, low: float | None, high: float | None) -> None:
    """Raise an InputError if these are not the two ends of a range of voltages [V], or None both."""
    if low is None or high is None:
        if low is not high:
            raise InputError(what, got="one end alone", allowed=_TWO)
    elif not 0.0 < low <= high:
        raise InputError(what, got=f"{low:g} to {high:g} V", allowed=_TWO)


def _check_spread(what: str, value: float, spread: Mapping[str, float]) -> None:
    std, lower, upper = (spread.get(name) for name in _SPREADS)
    if std is not None and (not 0.0 <= std < math.inf or lower is not None or upper is not None):
        raise InputError(f"{what}: std", got=std, allowed="at least 0, and either std or lower and upper")
    if lower is not None and not 0.0 < lower <= value:
        raise InputError(f"{what}: lower", got=lower, allowed=f"positive and at most the value {value!r} (SI)")
    if upper is not None and not value <= upper < math.inf:
        raise InputError(f"{what}: upper", got=upper, allowed=f"at least the value {value!r} (SI)")


# --- Printed figures of a servo: the [sheet] of its file as numbers ---------------------------------------------------

_FIGURES = {**POINT, **WHOLE}


@dataclass(frozen=True, kw_only=True)
class PrintedPoint:
    """Printed figures for one supply voltage; None is not printed.

    Parameters
    ----------
    supply_voltage : float, optional
        [V].
    stall_torque : float, optional
        [N m].
    time_60 : float, optional
        Time for 60 degrees without load [s].
    no_load_current, stall_current : float, optional
        [A].
    """

    supply_voltage: float | None
    stall_torque: float | None
    time_60: float | None
    no_load_current: float | None
    stall_current: float | None


def printed_fact(table: Mapping[str, Any], key: str) -> float | None:
    """Return a figure of a table of a sheet (SI) by its key in the file, such as "mass"; None where it is not one.

    Unlike `sheet_table.figure`, which computes with it, this shows what is there: a person's own [sheet] may hold
    anything.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> printed_fact(load_servo("towerpro-mg996r").sheet, "mass")
    0.055
    """
    entry = table.get(key)
    if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
        return None
    try:
        value = units.to_si(entry["value"], str(entry.get("unit")), _FIGURES[key][1])
    except ServotwinError:
        return None
    return value if math.isfinite(value) else None


def printed_points(servo: Servo) -> tuple[PrintedPoint, ...]:
    """Return what is printed at each voltage, the sheet's main one first; a voltage may come from several sources.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [point.stall_torque for point in printed_points(load_servo("emax-es08a"))]
    [0.177, 0.147]
    """
    others = servo.sheet.get(ELSE)
    tables = [servo.sheet, *(others if isinstance(others, list) else [])]
    return tuple(_point(table) for table in tables if isinstance(table, Mapping))


def operating_voltages(servo: Servo) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage that the maker states for operation; None where not stated [V].

    Raises
    ------
    InputError
        As of `sheet_table.voltage_range`; files are checked when they are read.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [operating_voltages(load_servo(name)) for name in ("towerpro-mg996r", "gobilda-2000-135")]
    [(4.8, 7.2), None]
    """
    return voltage_range(servo.name, servo.sheet)


def sheet_voltages(servo: Servo) -> tuple[float, float] | None:
    """Return the lowest and the highest supply voltage of a sheet; None where it has none [V].

    Those that the maker states for operation, else those that figures are printed for.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> [sheet_voltages(load_servo(name)) for name in ("towerpro-mg996r", "gobilda-2000-135")]
    [(4.8, 7.2), (4.8, 7.4)]
    """
    printed = [point.supply_voltage for point in printed_points(servo) if point.supply_voltage]
    return operating_voltages(servo) or ((min(printed), max(printed)) if printed else None)


def printed_flags(servo: Servo) -> tuple[str, ...]:
    """Return what the [sheet] says of itself: what it lacks, and where it contradicts itself.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> printed_flags(servo_from_values("mine", {}))
    ()
    """
    found = servo.sheet.get("flags")
    return tuple(flag for flag in found if isinstance(flag, str)) if isinstance(found, list) else ()


def _point(table: Mapping[str, Any]) -> PrintedPoint:
    return PrintedPoint(
        supply_voltage=printed_fact(table, "supply_voltage"),
        stall_torque=printed_fact(table, "stall_torque"),
        time_60=printed_fact(table, "speed_per_60deg"),
        no_load_current=printed_fact(table, "no_load_current"),
        stall_current=printed_fact(table, "stall_current"))


# --- Servo files: TOML with one table per group, each value with unit, origin, source and spread ----------------------

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
    """Convert numbers; anything else passes as it is, for the group to refuse."""
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
