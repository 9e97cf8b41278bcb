"""`servotwin catalog from-sheet`: what a maker prints becomes a servo file."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli.terminal import emit_json, patience, show, table

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.identification import Sheet

_POINT, _WHOLE, _MANY, _OUTPUT = ("At a supply voltage (repeatable)", "Whole servo", "Other ways to give a sheet",
                                  "Result")
_Figures = list[str] | None


def _at(metavar: str, text: str) -> Any:
    return typer.Option(metavar=metavar, help=text, rich_help_panel=_POINT)


def _of(metavar: str, text: str) -> Any:
    return typer.Option(metavar=metavar, help=text, rich_help_panel=_WHOLE)


def from_sheet(
    again: Annotated[str | None, typer.Argument(
        metavar="SERVO", help="A servo whose own \\[sheet] to use: catalog id, or path.")] = None,
    torque: Annotated[_Figures, _at('"1.29 N m @6.0"', "Stall torque: N m, N cm, kgf.cm, oz.in.")] = None,
    speed: Annotated[_Figures, _at('"0.23 s/60deg @6.0"', "No-load speed: s/60deg, deg/s, rad/s, rpm.")] = None,
    running_current: Annotated[_Figures, _at('"285 mA @6.0"', "Current when running without load: A, mA.")] = None,
    stall_current: Annotated[_Figures, _at('"1.8 A @6.0"', "Current with the shaft held still: A, mA.")] = None,
    idle_current: Annotated[_Figures, _at('"9 mA @6.0"', "Current at rest: A, mA.")] = None,
    at: Annotated[str | None, typer.Option(
        metavar="VOLTAGE", help="Supply voltage for figures that do not name one.", rich_help_panel=_POINT)] = None,
    name: Annotated[str | None, _of("ID", "Short id, such as my-servo.")] = None,
    title: Annotated[str | None, _of("TEXT", "Name for human readers.")] = None,
    voltage_range: Annotated[str | None, _of('"4.8-7.2 V"', "Supply voltages that the maker states.")] = None,
    deadband: Annotated[str | None, _of('"8 us"', "Deadband, taken as its full width.")] = None,
    pulse_range: Annotated[str | None, _of('"500-2500 us"', "Pulse widths between which the servo turns.")] = None,
    travel: Annotated[str | None, _of('"180 deg"', "Angle between these pulses; endless: as --continuous.")] = None,
    continuous: Annotated[bool, typer.Option(
        "--continuous", help="Turns without end: a pulse is a speed, the deadband the pulses at which it stands.",
        rich_help_panel=_WHOLE)] = False,
    rate: Annotated[str | None, _of('"45 deg/400us"', "Angle per pulse width.")] = None,
    neutral: Annotated[str | None, _of('"1500 us"', "Pulse width at the middle position.")] = None,
    stops: Annotated[str | None, _of('"200 deg"', "Angle from stop to stop.")] = None,
    mass: Annotated[str | None, _of('"40 g"', "Mass: g, kg, oz.")] = None,
    gear_ratio: Annotated[str | None, _of("280:1", "Motor turns per output turn.")] = None,
    backlash: Annotated[str | None, _of('"0.5 deg"', "Play of the gear.")] = None,
    motor_type: Annotated[str, _of("TEXT", "Such as 3-pole or coreless.")] = "",
    modulation: Annotated[str, _of("WORD", "analog, digital or bus.")] = "",
    registers: Annotated[str, _of("WORD", "Of a bus servo: feetech-sts, dynamixel-x, -mx or -ax.")] = "",
    source: Annotated[str, _of("TEXT", "Where the figures come from.")] = "",
    note: Annotated[str, _of("TEXT", "Remark for human readers.")] = "",
    list_file: Annotated[Path | None, typer.Option(
        "--csv", metavar="FILE", help="A list of servos, one row for each servo and voltage: maker, model, V, "
        "stall_torque_Nm, speed_s_per_60deg, ... (see the guide).", rich_help_panel=_MANY)] = None,
    plain: Annotated[bool, typer.Option(
        "--plain", help="Leave out play and the gear losses that grow with the load: faster, but too strong.",
        rich_help_panel=_OUTPUT)] = False,
    allow_impossible: Annotated[bool, typer.Option(
        "--allow-impossible", help="Make a servo even from a sheet that contradicts itself, and flag it.",
        rich_help_panel=_OUTPUT)] = False,
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.toml", help="Write the servo file; with --csv, a folder.", rich_help_panel=_OUTPUT)] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=_OUTPUT)] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.", rich_help_panel=_OUTPUT)] = False,
) -> None:
    """Make a servo file from a data sheet."""
    points = {"stall_torque": torque, "no_load_speed": speed, "no_load_current": running_current,
              "stall_current": stall_current, "idle_current": idle_current}
    whole = {"name": name, "title": title, "voltage_range": voltage_range, "deadband": deadband,
             "pulse_range": pulse_range, "travel": travel, "rate": rate, "neutral": neutral, "stops": stops,
             "mass": mass, "gear_ratio": gear_ratio, "backlash": backlash, "continuous": continuous,
             "motor_type": motor_type, "modulation": modulation, "registers": registers, "source": source,
             "note": note}
    typed = [f"--{option.replace('_', '-')}" for option, given in (
        *whole.items(), ("torque", torque), ("speed", speed), ("running-current", running_current),
        ("stall-current", stall_current), ("idle-current", idle_current), ("at", at)) if given]
    how = {"load_friction": not plain, "backlash": not plain, "allow_impossible": allow_impossible}
    if list_file is not None:
        _one_way("--csv", typed, again)
        _many(list_file, how, out, force=force, as_json=as_json)
        return
    if again is not None:
        _one_way("SERVO", [word for word in typed if word not in ("--name", "--title")], None)
    sheet = _again(again, name, title) if again is not None else _sheet(points, whole, at)
    weighed = any(unit in text for text in torque or () for unit in ("kg", "oz"))
    _one(sheet, how, out, weighed=weighed, force=force, as_json=as_json)


def _one_way(way: str, typed: list[str], again: str | None) -> None:
    from servotwin.errors import InputError

    beside = [*typed, *([again] if again is not None else [])]
    if beside:
        raise InputError(f"{way} holds the sheet already", got=", ".join(beside), allowed="one way to give a sheet")


def _again(servo: str, name: str | None, title: str | None) -> Sheet:
    from dataclasses import replace

    from servotwin.identification import sheet_of
    from servotwin.parameters import load_servo

    sheet = sheet_of(load_servo(servo))
    return replace(sheet, name=name or sheet.name, title=title or (name or sheet.title))


def _sheet(points: dict[str, _Figures], whole: dict[str, Any], at: str | None) -> Sheet:
    from servotwin.cli import figures as fig
    from servotwin.errors import InputError
    from servotwin.identification import Sheet
    from servotwin.identification.sheets.sheet import ENDLESS
    from servotwin.units.quantities import quantity

    if not whole["name"]:
        raise InputError("--name is missing", allowed="a short id, such as --name my-servo")
    usual = None if at is None else quantity("--at", at, "voltage", bare=True, positive=True)
    endless = (whole["travel"] or "").strip().lower() in ENDLESS
    (lowest, highest), (low, high) = (
        fig.two_ends(f"--{name.replace('_', '-')}", whole[name], dimension) if whole[name] else (None, None)
        for name, dimension in (("voltage_range", "voltage"), ("pulse_range", "time")))

    def one(option: str, dimension: str) -> float | None:
        text = whole[option]
        return None if text is None or (option == "travel" and endless) else quantity(
            f"--{option}", text, dimension, positive=True)

    return Sheet(
        name=whole["name"], title=whole["title"] or "", points=_points(points, usual), pulse_min=low, pulse_max=high,
        voltage_min=lowest, voltage_max=highest, deadband=one("deadband", "time"),
        neutral_pulse=one("neutral", "time"), travel=one("travel", "angle"),
        stop_travel=one("stops", "angle"), mass=one("mass", "mass"), backlash=one("backlash", "angle"),
        angle_per_pulse=fig.rate("--rate", whole["rate"]) if whole["rate"] else None,
        gear_reduction=fig.ratio("--gear-ratio", whole["gear_ratio"]) if whole["gear_ratio"] else None,
        motor_type=whole["motor_type"], modulation=whole["modulation"], registers=whole["registers"],
        continuous=whole["continuous"] or endless,
        source=whole["source"], note=whole["note"])


def _points(given: dict[str, _Figures], usual: float | None) -> tuple[Any, ...]:
    from servotwin.cli import figures as fig
    from servotwin.errors import InputError
    from servotwin.identification import SheetPoint
    from servotwin.units.quantities import quantity

    options = {"stall_torque": "--torque", "no_load_speed": "--speed", "no_load_current": "--running-current",
               "stall_current": "--stall-current", "idle_current": "--idle-current"}
    found: dict[float, dict[str, Any]] = {}
    for field, texts in given.items():
        option = options[field]
        for text in texts or ():
            words, volts = fig.without_voltage(option, text, usual)
            value = fig.speed(option, words) if field == "no_load_speed" else quantity(
                option, words, "torque" if field == "stall_torque" else "current", positive=True)
            if field in found.setdefault(volts, {}):
                raise InputError(f"{option} at {volts:g} V",
                                 got=f"two, {found[volts][field]:.4g} and {value:.4g} in SI",
                                 allowed="one figure")
            found[volts][field] = value
    if not found:
        raise InputError("no figures of a sheet are given", allowed="at least --torque and --speed; or --csv, or the "
                         "servo whose [sheet] is taken")
    return tuple(SheetPoint(supply_voltage=volts, **values) for volts, values in sorted(found.items()))


def _one(sheet: Sheet, how: dict[str, bool], out: Path | None, *, weighed: bool, force: bool, as_json: bool) -> None:
    from servotwin.cli.from_sheet_words import lines, sheet_facts
    from servotwin.cli.servo_page import parameter_table
    from servotwin.identification import servo_from_sheet, write_servo_text

    with warnings.catch_warnings():
        if weighed:
            warnings.filterwarnings("ignore", message=".*kgf cm")  # who typed these meant them
        servo = servo_from_sheet(sheet, **how)
    if out is not None:
        write_servo_text(servo, out, overwrite=force)
    with patience("simulating"):
        found = sheet_facts(sheet, servo)
    if as_json:
        emit_json({**found, "files": [] if out is None else [str(out)]})
        return
    parts: list[RenderableType] = [f"{sheet.title} ({sheet.name}), from its sheet", *lines(found)]
    if out is None:
        parts += ["", *parameter_table(found["parameters"])]
    else:
        parts += ["", f"written: {out}"]
    show(*parts)


def _many(path: Path, how: dict[str, bool], out: Path | None, *, force: bool, as_json: bool) -> None:
    from servotwin.cli.from_sheet_words import ranged, sheet_facts
    from servotwin.cli.interrupts import held
    from servotwin.errors import OutputExistsError
    from servotwin.identification import read_sheets, servo_from_sheet, sheet_contradictions, write_servo_text

    found = read_sheets(path)
    kept = [sheet for sheet in found.sheets if how["allow_impossible"] or not sheet_contradictions(sheet)]
    refused = [sheet for sheet in found.sheets if sheet not in kept]
    servos = [servo_from_sheet(sheet, **how) for sheet in kept]
    files = [] if out is None else [out / f"{servo.name}.toml" for servo in servos]
    for file in files:
        if file.exists() and not force:  # before the first is written
            raise OutputExistsError(file)
    if out is not None:
        _folder(out)
        with held():
            for servo, file in zip(servos, files, strict=True):
                write_servo_text(servo, file, overwrite=force)
    rows = [sheet_facts(sheet, servo, steady=True) for sheet, servo in zip(kept, servos, strict=True)]
    left = [*found.left_out, *(f"{sheet.title}: {sheet_contradictions(sheet)[0].text}" for sheet in refused)]
    if as_json:
        emit_json({"servos": rows, "left_out": left, "files": [str(file) for file in files]})
        return
    show(table(("id", "resistance", "torque per current", "efficiency", "flags"), [
        (row["id"], *(ranged(row["motor"][name]) for name in (
            "resistance", "output_torque_constant", "gear_efficiency")), "; ".join(row["flags"])) for row in rows]),
         "", *[f"left out: {text}" for text in left],
         *([f"written: {len(files)} servo files to {out}"] if out is not None else []))


def _folder(out: Path) -> None:
    from servotwin.errors import OutputError

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{out} cannot be written ({error.strerror})") from None
