"""Lists of sheets: a CSV file with one row for each servo and supply voltage."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from servotwin.errors import InputError, UnknownNameError
from servotwin.identification.sheets.sheet import ENDLESS, Sheet, SheetPoint
from servotwin.tables import read_table
from servotwin.text import checked_name

_DEG = math.pi / 180.0
_POINT = {"V": ("supply_voltage", 1.0), "stall_torque_Nm": ("stall_torque", 1.0),
          "noload_running_current_A": ("no_load_current", 1.0), "stall_current_A": ("stall_current", 1.0),
          "idle_current_A": ("idle_current", 1.0), "speed_s_per_60deg": ("no_load_speed", 1.0)}
_WHOLE = {"deadband_us": ("deadband", 1e-6), "travel_deg": ("travel", _DEG),
          "deg_per_us": ("angle_per_pulse", _DEG * 1e6),
          "mass_g": ("mass", 1e-3), "gear_ratio": ("gear_reduction", 1.0), "backlash_deg": ("backlash", _DEG),
          "neutral_us": ("neutral_pulse", 1e-6), "stop_travel_deg": ("stop_travel", _DEG)}
_RANGES = {"voltage_range_V": (("voltage_min", "voltage_max"), 1.0, "two voltages, such as 4.8-7.2"),
           "pulse_range_us": (("pulse_min", "pulse_max"), 1e-6, "two pulse widths, such as 500-2500")}
_TEXTS = ("maker", "model", "type", *_RANGES, "motor_type", "source", "note")
_UNUSED = ("gear_material", "spline_teeth", "pot_drive", "bearing", "length_mm", "width_mm", "height_mm")
COLUMNS = (*_TEXTS[:3], *_POINT, *_WHOLE, *_TEXTS[3:])


@dataclass(frozen=True, kw_only=True)
class SheetList:
    """The sheets of a file, and what in it is no sheet.

    Parameters
    ----------
    sheets : tuple of Sheet
    left_out : tuple of str
        Servos without torque and speed at any one voltage, each with the reason.
    """

    sheets: tuple[Sheet, ...]
    left_out: tuple[str, ...]


def read_sheets(path: str | Path) -> SheetList:
    r"""Return the sheets of a CSV file.

    Parameters
    ----------
    path : str or Path
        A header, and one row for each servo and voltage; an empty cell is not printed. Columns: maker, model, type, V,
        stall_torque_Nm, speed_s_per_60deg, noload_running_current_A, stall_current_A, idle_current_A,
        voltage_range_V (4.8-7.2), deadband_us, pulse_range_us (500-2500), travel_deg (of a servo that turns without
        end: endless), deg_per_us, mass_g, gear_ratio, backlash_deg, neutral_us,
        stop_travel_deg, motor_type, source, note; model, V, stall_torque_Nm and speed_s_per_60deg are needed.

    Raises
    ------
    InputError
        If the file cannot be read, lacks a column, has one that is not known, or a cell that is no such number.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "mine.csv"
    >>> _ = file.write_text("maker,model,V,stall_torque_Nm,speed_s_per_60deg\nAcme,S 1,6.0,0.4,0.19\n")
    >>> read_sheets(file).sheets[0].name
    'acme-s-1'
    """
    rows = _rows(Path(path))
    models: dict[tuple[str, str], list[tuple[int, Mapping[str, str]]]] = {}
    for line, row in rows:
        models.setdefault((row.get("maker", ""), row["model"]), []).append((line, row))
    sheets, left_out, names = [], [], set[str]()
    for (maker, model), own in models.items():
        title = checked_name(f"{path}: line {own[0][0]}, maker and model", f"{maker} {model}".strip())
        complete = [row for _, row in own if row["V"] and row["stall_torque_Nm"] and row["speed_s_per_60deg"]]
        if not complete:
            left_out.append(f"{title}: no torque and speed at one voltage")
            continue
        sheet = _sheet(Path(path), title, own)
        if sheet.name in names:
            raise InputError(f"{path}: line {own[0][0]}, model", got=title, allowed="one that gives another name than "
                             f"{sheet.name!r}, which is taken")
        names.add(sheet.name)
        sheets.append(sheet)
    return SheetList(sheets=tuple(sheets), left_out=tuple(left_out))


def short_name(title: str) -> str:
    """Return an id for a servo.

    Examples
    --------
    >>> short_name("Miuzei MS18 (SG90 class)")
    'miuzei-ms18-sg90-class'
    """
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "servo"


def _sheet(path: Path, title: str, rows: list[tuple[int, Mapping[str, str]]]) -> Sheet:
    source, whole = "", dict[str, Any]()
    points = []
    for line, row in rows:
        where = f"{path}: line {line}"
        source = source or row.get("source", "")
        for column, (name, by) in _WHOLE.items():
            if column == "travel_deg" and row.get(column, "").lower() in ENDLESS:
                whole["continuous"] = True
            elif row.get(column) and name not in whole:
                whole[name] = _number(where, column, row[column]) * by
        for name in ("motor_type", "note"):
            whole.setdefault(name, row.get(name, ""))
        if row.get("type"):
            whole.setdefault("modulation", "digital" if row["type"].startswith("digital") else "analog"
                             if row["type"].startswith("analog") else "")
        for column, (ends, by, allowed) in _RANGES.items():
            if row.get(column):
                for name, value in zip(ends, _two(f"{where}, {column}", row[column], allowed), strict=True):
                    whole.setdefault(name, value * by)
        if row["V"]:
            points.append(_point(where, row, source))
    try:
        return Sheet(name=short_name(title), title=title, points=tuple(points), source=source, **whole)
    except InputError as error:
        raise InputError(f"{path}: line {rows[0][0]}: {error.what}", got=error.got, allowed=error.allowed) from None


def _point(where: str, row: Mapping[str, str], source: str) -> SheetPoint:
    values: dict[str, Any] = {name: _number(where, column, row[column]) * by for column, (name, by) in _POINT.items()
                              if row.get(column)}
    if values.get("no_load_speed", 0.0) > 0.0:
        values["no_load_speed"] = math.pi / 3.0 / values["no_load_speed"]
    other = row.get("source", "")
    try:
        return SheetPoint(**values, source=other if other and other != source else "")
    except InputError as error:
        raise InputError(f"{where}: {error.what}", got=error.got, allowed=error.allowed) from None


def _number(where: str, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}, {column}", got=text, allowed="a number")
    return value


def _two(what: str, text: str, allowed: str) -> tuple[float, float]:
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*-\s*(\d+(?:\.\d+)?)\s*", text)
    if found is None:
        raise InputError(what, got=text, allowed=allowed)
    return float(found[1]), float(found[2])


def _rows(path: Path) -> list[tuple[int, Mapping[str, str]]]:
    table = read_table(path, lambda name: name in COLUMNS)
    header = table.header
    for column in header:
        if column not in COLUMNS and column not in _UNUSED:
            raise InputError(f"{path}: {UnknownNameError('column', column, COLUMNS)}")
    for needed in ("model", "V", "stall_torque_Nm", "speed_s_per_60deg"):
        if needed not in header:
            raise InputError(f"{path}: columns", got=", ".join(header), allowed=f"also {needed}")
    table.check_lengths(shorter=True)
    n = len(header)
    return [(line, {name: _plain(cell) if table.decimal == "," else cell
                    for name, cell in zip(header, [*cells, *[""] * (n - len(cells))][:n], strict=True)})
            for line, cells in table.rows]


def _plain(cell: str) -> str:
    """Return a number, or a range, with decimal points; texts stay as they are."""
    return cell.replace(",", ".") if re.fullmatch(r"[+-]?\d*,\d+|\d+(,\d+)?\s*-\s*\d+(,\d+)?", cell) else cell
