"""The sheet inside a servo file: its table [sheet], written and read, and the servo file that people read and edit."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from servotwin import units
from servotwin.errors import InputError
from servotwin.identification.sheets.sheet import Sheet, SheetPoint
from servotwin.parameters import GROUPS, KINDS, Quantity, Servo, dimension_of, unit_of, write_file
from servotwin.parameters.sheet_table import ELSE, POINT, WHOLE, figure, printed

_FLAGS, _NOTE = "flags", "note"
_WORDS = ("motor_type", "modulation", "continuous", "registers")
# parameters whose SI unit makes awkward numbers
_UNITS = {"motor.armature_inductance": "mH", "motor.torque_constant": "mN m/A", "motor.back_emf_constant": "mV s/rad",
          "motor.rotor_inertia": "g cm2", "gear.backlash": "deg", "gear.output_inertia": "g cm2",
          "friction.coulomb_torque_forward": "mN m", "friction.coulomb_torque_backward": "mN m",
          "electronics.voltage_to_pulse_gain": "us/V", "electronics.command_pulse_offset": "us",
          "electronics.one_shot_slope": "ms/V", "electronics.one_shot_offset": "ms",
          "electronics.voltage_deadband": "mV", "electronics.deadband": "us", "electronics.frame_period": "ms",
          "electronics.minimum_drive_time": "ms", "electronics.pulse_width_min": "us",
          "electronics.pulse_width_max": "us", "stops.lower_angle": "deg", "stops.upper_angle": "deg"}


def sheet_table(sheet: Sheet, flags: Iterable[str] = ()) -> dict[str, Any]:
    """Return the table [sheet] of a servo file: facts as printed, each with unit and source.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=0.4, no_load_speed=5.5)
    >>> sheet_table(Sheet(name="a", points=(point,), deadband=8e-6, source="the box"))["deadband"]
    {'value': 8.0, 'unit': 'us', 'source': 'the box'}
    """
    found: dict[str, Any] = {_FLAGS: list(flags)}
    if sheet.note:
        found[_NOTE] = sheet.note
    found |= {name: getattr(sheet, name) for name in _WORDS if getattr(sheet, name)}
    nominal = sheet.nominal
    found |= _entries(nominal, POINT, {}, sheet.source_at(nominal))
    found |= _entries(sheet, WHOLE, sheet.sources, sheet.source or "data sheet")
    rest = [point for point in sheet.points if point is not nominal]
    if rest:
        found[ELSE] = [_entries(point, POINT, {}, sheet.source_at(point)) for point in rest]
    return found


def sheet_of(servo: Servo) -> Sheet:
    """Return the sheet that a servo file holds, from which `servo_from_sheet` makes it again.

    Raises
    ------
    InputError
        If the file has no table [sheet], or something in it is not what a sheet prints.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(sheet_of(load_servo("hitec-hs-755hb")).nominal.stall_torque, 4)
    1.2945
    """
    table = servo.sheet
    if not table:
        raise InputError(f"servo {servo.name!r} has no table [sheet]")
    known = (*POINT, *WHOLE, *_WORDS, _FLAGS, _NOTE, ELSE)
    for key in table:
        if key not in known:
            raise InputError(f"[sheet] of {servo.name!r}", got=key, allowed=", ".join(known))
    values, sources = _read(servo, table, WHOLE)
    rows = table.get(ELSE, [])
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise InputError(f"[sheet] {ELSE} of {servo.name!r}", got=rows, allowed=f"tables [[sheet.{ELSE}]]")
    points = [_read_point(servo, row) for row in (table, *rows)]
    source = points[0].source
    values |= {name: str(table.get(name, "")) for name in _WORDS if name != "continuous"}
    values["continuous"] = table.get("continuous") is True
    return Sheet(
        name=servo.name, title=servo.title, source=source, points=tuple(points),
        sources={name: said for name, said in sources.items() if said != source}, note=str(table.get(_NOTE, "")),
        **values)


def _entries(given: Sheet | SheetPoint, keys: Mapping[str, tuple[str, str, str]], sources: Mapping[str, str],
             source: str) -> dict[str, Any]:
    found = {}
    for key, (name, dimension, unit) in keys.items():
        value = getattr(given, name)
        if value is not None:
            found[key] = {"value": float(f"{units.from_si(printed(key, value), unit, dimension):.10g}"), "unit": unit,
                          "source": sources.get(name) or source}
    return found


def _read_point(servo: Servo, row: Mapping[str, Any]) -> SheetPoint:
    values, sources = _read(servo, row, POINT)
    if "supply_voltage" not in values:
        raise InputError(f"[sheet] of {servo.name!r}", got="figures without supply_voltage", allowed="both")
    return SheetPoint(**values, source=sources.get("stall_torque") or next(iter(sources.values())))


def _read(servo: Servo, row: Mapping[str, Any], keys: Mapping[str, tuple[str, str, str]]
          ) -> tuple[dict[str, Any], dict[str, str]]:
    values, sources = {}, {}
    for key, (name, _, _) in keys.items():
        found = figure(servo.name, key, row[key]) if key in row else None
        if found is not None:
            values[name], sources[name] = found.value, found.source
    return values, sources


def servo_file_text(servo: Servo) -> str:
    """Return a servo file as the catalog has them: one line for each value, units that people use, six digits.

    Numbers of the firmware have all their digits.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> print(servo_file_text(servo_from_values("mine", {"motor": {"torque_constant": 3.7e-3}})))
    name = "mine"
    title = ""
    <BLANKLINE>
    [motor]
    torque_constant = { value = 3.7, unit = "mN m/A", origin = "assumed" }
    <BLANKLINE>
    """
    lines = [f"name = {_text(servo.name)}", f"title = {_text(servo.title)}"]
    if servo.kind != KINDS[0]:
        lines += [f"kind = {_text(servo.kind)}"]
    if servo.notes:
        body = servo.notes.strip("\n").replace("\\", "\\\\").replace('"""', '""\\"')
        lines += [f'notes = """\n{body}\n"""']
    if servo.sheet:
        lines += ["", *_sheet_lines(servo.sheet)]
    for group in GROUPS:
        names = [name for name in servo.names() if name.startswith(f"{group}.")]
        if names:
            lines += ["", f"[{group}]", *(_line(name, servo.source(name)) for name in names)]
    return "\n".join(lines) + "\n"


def write_servo_text(servo: Servo, path: str | Path, *, overwrite: bool = False) -> None:
    """Write `servo_file_text` to a file, whole or not at all.

    Raises
    ------
    OutputExistsError, OutputError
        If the file exists and `overwrite` is false, or it cannot be written.
    """
    write_file(path, servo_file_text(servo), overwrite=overwrite)


def _sheet_lines(table: Mapping[str, Any]) -> list[str]:
    lines = ["[sheet]  # facts as printed"]
    for key, entry in table.items():
        if key != ELSE:
            lines.append(f"{key} = {_toml(entry)}")
    for row in table.get(ELSE, []):
        lines += ["", f"[[sheet.{ELSE}]]", *(f"{key} = {_toml(entry)}" for key, entry in row.items())]
    return lines


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return _text(value) if isinstance(value, str) else repr(value)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _line(name: str, quantity: Quantity) -> str:
    dimension = dimension_of(name)
    unit = _UNITS.get(name, unit_of(name))

    def number(x: Any) -> Any:
        if not isinstance(x, float):
            return [number(item) for item in x] if isinstance(x, tuple) else x
        if name.startswith("firmware."):  # of whole counts and steps: a digit less would change what it computes
            return x
        return float(f"{units.from_si(x, unit, dimension):.6g}") + 0.0  # a range may end at -0

    entry: dict[str, Any] = {"value": number(quantity.value)}
    if unit:
        entry["unit"] = unit
    entry["origin"] = quantity.origin
    if quantity.source:
        entry["source"] = quantity.source
    entry |= {key: number(getattr(quantity, key)) for key in ("std", "lower", "upper")
              if getattr(quantity, key) is not None}
    return f"{name.partition('.')[2]} = {_toml(entry)}"
