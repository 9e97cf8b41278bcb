"""A data sheet: what a maker or a shop prints about a servo, at one or several supply voltages."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.parameters import GROUPS, KINDS, REGISTER_FAMILIES, Quantity, Servo, dimension_of, unit_of, write_file
from servotwin.parameters.servo_file import ELSE, POINT, WHOLE, check_voltages, figure, printed
from servotwin.tables import read_table
from servotwin.text import checked_name

# --- A data sheet: what a maker or a shop prints about a servo, at one or several supply voltages ---------------------

MODULATIONS = ("analog", "digital", "bus", "")
ENDLESS = ("endless", "continuous")
"""The word for the travel of a servo that turns without end."""
_USUAL_VOLTAGE = 6.0  # where makers print most
# Figures that no servo has, from the smallest to the largest: a figure outside it is one in another unit
_PLAUSIBLE: dict[str, tuple[float, float, str]] = {
    **dict.fromkeys(("supply_voltage", "voltage_min", "voltage_max"), (1.0, 60.0, "V")),
    "stall_torque": (1e-4, 200.0, "N m"), "no_load_speed": (0.02, 300.0, "rad/s"),
    "no_load_current": (1e-4, 50.0, "A"), "stall_current": (1e-3, 200.0, "A"), "idle_current": (1e-7, 5.0, "A"),
    "deadband": (1e-8, 1e-3, "s"), "pulse_min": (1e-5, 0.01, "s"), "pulse_max": (1e-5, 0.01, "s"),
    "neutral_pulse": (1e-5, 0.01, "s"), "travel": (0.01, 500.0, "rad"), "stop_travel": (0.01, 500.0, "rad"),
    "angle_per_pulse": (1.0, 1e5, "rad/s"), "mass": (1e-4, 50.0, "kg"), "gear_reduction": (1.0, 1e5, "1"),
    "backlash": (1e-6, 0.5, "rad"),
}


@dataclass(frozen=True, kw_only=True)
class SheetPoint:
    """Printed figures for one supply voltage; None is not printed.

    Parameters
    ----------
    supply_voltage : float
        [V].
    stall_torque : float, optional
        [N m].
    no_load_speed : float, optional
        60° in 0.23 s are 4.55 rad/s [rad/s].
    no_load_current : float, optional
        Running without load [A].
    stall_current : float, optional
        With the shaft held [A].
    idle_current : float, optional
        Standing without load [A].
    source : str
        Where it was read; that of the sheet unless given.

    Raises
    ------
    InputError
        If a figure is no number, or none that a servo has.

    Examples
    --------
    >>> SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553).complete
    True
    """

    supply_voltage: float
    stall_torque: float | None = None
    no_load_speed: float | None = None
    no_load_current: float | None = None
    stall_current: float | None = None
    idle_current: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        _check(self)
        if self.stall_current is not None and self.no_load_current is not None \
                and self.stall_current <= self.no_load_current:
            raise InputError(f"stall current at {self.supply_voltage:g} V", got=self.stall_current,
                             allowed=f"more than the no-load current {self.no_load_current:g} A")

    @property
    def complete(self) -> bool:
        """Whether it has torque and speed, without which no motor follows."""
        return self.stall_torque is not None and self.no_load_speed is not None


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """All that a sheet prints about one servo; None is not printed, and nothing is filled in here.

    Parameters
    ----------
    name : str
        Id of the servo, which is the name of its file too, such as ``"my-servo"``.
    points : tuple of SheetPoint
        One for each supply voltage, or several for one voltage out of several sources. The points whose source is that
        of the first one make the servo; those of other sources only widen its ranges.
    title : str
        For people; the name unless given.
    voltage_min, voltage_max : float, optional
        Supply voltages between which the maker lets it run [V].
    deadband : float, optional
        [s].
    pulse_min, pulse_max : float, optional
        Pulse widths between which the servo turns through `travel` [s].
    neutral_pulse : float, optional
        Pulse width of the middle position [s].
    travel : float, optional
        Angle between `pulse_min` and `pulse_max` [rad].
    angle_per_pulse : float, optional
        Angle per pulse width; it goes before `travel` [rad/s].
    stop_travel : float, optional
        Angle from stop to stop [rad].
    mass : float, optional
        [kg].
    gear_reduction : float, optional
        Motor turns per turn of the output [1].
    backlash : float, optional
        Total play at the output [rad].
    motor_type : str
        Such as ``"3-pole"`` or ``"coreless"``.
    modulation : {"analog", "digital", "bus", ""}
    continuous : bool
        Whether it turns without end; it then has no travel, no angle per pulse width and no stops.
    registers : {"feetech-sts", "dynamixel-x", "dynamixel-mx", "dynamixel-ax", ""}
        Of a bus servo, and only of one: whose registers it has; the firmware is the factory's.
    source : str
        Where the figures were read.
    sources : mapping of str to str
        Where single figures were read, by the names above.
    note : str
        For people; goes to the notes of the servo.

    Raises
    ------
    InputError
        If a figure is no number, none that a servo has, or does not fit another; if there is no voltage with both
        torque and speed.

    Examples
    --------
    >>> point = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=4.553, no_load_current=0.285)
    >>> Sheet(name="my-servo", points=(point,), deadband=8e-6, source="the box").title
    'my-servo'
    """

    name: str
    points: tuple[SheetPoint, ...]
    title: str = ""
    voltage_min: float | None = None
    voltage_max: float | None = None
    deadband: float | None = None
    pulse_min: float | None = None
    pulse_max: float | None = None
    neutral_pulse: float | None = None
    travel: float | None = None
    angle_per_pulse: float | None = None
    stop_travel: float | None = None
    mass: float | None = None
    gear_reduction: float | None = None
    backlash: float | None = None
    motor_type: str = ""
    modulation: str = ""
    continuous: bool = False
    registers: str = ""
    source: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    note: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z0-9][\w.-]*", self.name):
            raise InputError("name of a servo", got=self.name,
                             allowed='a short id of letters, digits, "-", "_" and ".", such as "my-servo"')
        _check(self)
        if self.modulation not in MODULATIONS:
            raise InputError("modulation", got=self.modulation, allowed="analog, digital, bus, or nothing")
        if self.modulation == "bus" and self.registers not in REGISTER_FAMILIES:
            raise _no_family(self.registers)
        if self.modulation != "bus" and self.registers:
            raise InputError("registers", got=self.registers, allowed='nothing, for modulation is not "bus"')
        self._check_endless()
        check_voltages("voltage range", self.voltage_min, self.voltage_max)
        if (self.pulse_min is None) != (self.pulse_max is None) or not (self.pulse_min or 0.0) < (self.pulse_max or 1):
            raise InputError("pulse range", got=f"{self.pulse_min} to {self.pulse_max} s",
                             allowed="two pulse widths, the shorter one first")
        if self.neutral_pulse is not None and self.pulse_min is not None and self.pulse_max is not None \
                and not self.pulse_min < self.neutral_pulse < self.pulse_max:
            raise InputError("neutral pulse", got=self.neutral_pulse, allowed="one inside the pulse range [s]")
        object.__setattr__(self, "points", tuple(self.points))
        object.__setattr__(self, "sources", MappingProxyType(dict(self.sources)))
        object.__setattr__(self, "title", self.title or self.name)
        self._check_points()

    def _check_endless(self) -> None:
        if not self.continuous:
            return
        if self.modulation == "bus":
            raise InputError("continuous", got='modulation "bus"', allowed="analog or digital: the registers of a bus "
                             "servo say whether it turns without end")
        for name in ("travel", "angle_per_pulse", "stop_travel"):
            if getattr(self, name) is not None:
                raise InputError(f"{name.replace('_', ' ')} of a servo that turns without end", got=getattr(self, name),
                                 allowed="none")

    def _check_points(self) -> None:
        if self.main:
            return
        has = {name for point in self.points for name in ("stall_torque", "no_load_speed")
               if getattr(point, name) is not None}
        if not has:
            raise InputError(f"sheet of {self.name!r}", got="neither stall torque nor speed",
                             allowed="both, at one supply voltage at least")
        one = next(iter(has))
        raise InputError(f"sheet of {self.name!r}", got="torque and speed at different voltages" if len(has) == 2
                         else ("torque without speed" if one == "stall_torque" else "speed without torque"),
                         allowed="stall torque and speed at one and the same supply voltage")

    @property
    def own(self) -> tuple[SheetPoint, ...]:
        """All points of the first source, those without torque or speed too: their currents count."""
        return tuple(point for point in self.points if point.source == self.points[0].source)

    @property
    def main(self) -> tuple[SheetPoint, ...]:
        """The complete points of the first source, by rising voltage: they make the servo."""
        return tuple(sorted((point for point in self.own if point.complete), key=lambda point: point.supply_voltage))

    @property
    def others(self) -> tuple[SheetPoint, ...]:
        """The complete points of other sources: they widen its ranges."""
        return tuple(point for point in self.points if point.complete and point.source != self.points[0].source)

    @property
    def nominal(self) -> SheetPoint:
        """The point whose voltage becomes the supply of the servo: that nearest 6 V; of a bus servo the first one."""
        if self.modulation == "bus":
            return next(point for point in self.own if point.complete)
        return min(self.main, key=lambda point: abs(point.supply_voltage - _USUAL_VOLTAGE))

    def at(self, supply_voltage: float) -> Sheet:
        """Return the sheet without the points at other voltages.

        Raises
        ------
        InputError
            If no point with torque and speed has this voltage.
        """
        from dataclasses import replace

        kept = tuple(point for point in self.points if abs(point.supply_voltage - supply_voltage) < 1e-9)
        if not any(point.complete for point in kept):
            raise InputError("supply voltage", got=supply_voltage, allowed=", ".join(
                f"{point.supply_voltage:g}" for point in self.main) + " V, where the sheet has torque and speed")
        return replace(self, points=kept)

    def source_of(self, name: str) -> str:
        """Return where a figure was read."""
        return self.sources.get(name) or self.source or "data sheet"

    def source_at(self, point: SheetPoint) -> str:
        """Return where the figures of a point were read."""
        return point.source or self.source or "data sheet"


def _no_family(registers: str) -> InputError | UnknownNameError:
    """Return the error of a bus servo without registers, or with those of a family that has no table."""
    allowed = (f"{', '.join(REGISTER_FAMILIES)}; of another family (LX-16A, SCS, HTS) no table says what its registers "
               "do: modulation digital makes its motor, its gear and an assumed program that pulses command")
    if not registers:
        return InputError("registers of a bus servo", got="nothing", allowed=allowed)
    return UnknownNameError("family of registers", registers, REGISTER_FAMILIES, allowed=allowed)


def _check(given: SheetPoint | Sheet) -> None:
    at = f" at {given.supply_voltage:g} V" if isinstance(given, SheetPoint) and units.is_finite(
        given.supply_voltage) else ""
    for name, value in _figures(given):
        low, high, unit = _PLAUSIBLE[name]
        if not (units.is_finite(value) and low <= value <= high):
            raise InputError(name.replace("_", " ") + (at if name != "supply_voltage" else ""), got=value,
                             allowed=f"a number from {low:g} to {high:g} {unit}")
        object.__setattr__(given, name, float(value))


def _figures(given: SheetPoint | Sheet) -> Iterator[tuple[str, float]]:
    for f in fields(given):
        value = getattr(given, f.name)
        if f.name in _PLAUSIBLE and value is not None:
            yield f.name, value


# --- The sheet inside a servo file ------------------------------------------------------------------------------------

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


# --- Lists of sheets: a CSV file with one row for each servo and supply voltage ---------------------------------------

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
                text = row[column]
                found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*-\s*(\d+(?:\.\d+)?)\s*", text)
                if found is None:
                    raise InputError(f"{where}, {column}", got=text, allowed=allowed)
                for name, value in zip(ends, (float(found[1]), float(found[2])), strict=True):
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
