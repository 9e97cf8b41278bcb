"""`servotwin curves`: the sheets of servos as they should have been."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.terminal import emit_json, pairs, patience, show, show_report, table
from servotwin.errors import InputError

if TYPE_CHECKING:
    from servotwin.cli.output_files import Target
    from servotwin.datasheet import DataSheet
    from servotwin.models import Model

_MODELS = ("digital", "pulse", "pulse-inductive", "bounded")
_PICTURES = (".png", ".svg", ".pdf")
_ENDINGS = {"--out": (".html", ".htm"), "--csv": (".csv",)}
_ZERO_CELSIUS = 273.15
_ASKED = "What to compute"


@usual("voltage", "lift", "arm", "load", "set", "quick", "out", "plot", "force", "json")
@with_records
def curves(
    *,
    servos: Annotated[list[str], typer.Argument(
        metavar="ID...", help="Catalog ids, or paths of servo files (.toml).")],
    voltage: Annotated[list[str] | None, typer.Option(
        metavar="VOLTS", help="Supply voltages, such as 4.8,6 (default: the servo's own).",
        rich_help_panel=_ASKED)] = None,
    lift: Annotated[str | None, typer.Option(
        metavar="MASS", help="Mass to lift, such as 0.5kg, 120g, 4oz or 1lb; with --arm.",
        rich_help_panel=_ASKED)] = None,
    arm: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="Length of the arm, such as 10cm, 80mm or 4in.", rich_help_panel=_ASKED)] = None,
    load: Annotated[list[str] | None, typer.Option(
        metavar="PART=VALUE", help="torque=0.3 adds the operating point at 0.3 N m; arm=0.5kg:10cm means "
        "--lift 0.5kg --arm 10cm.", rich_help_panel=_ASKED)] = None,
    hot: Annotated[float, typer.Option(
        metavar="CELSIUS", help="Winding temperature for the hot curves.", rich_help_panel=_ASKED)] = 100.0,
    quick: Annotated[bool, typer.Option(
        "--quick", help="Leave out the bandwidth, which takes longer than everything else.",
        rich_help_panel=_ASKED)] = False,
    plant: Annotated[shared.Plant, {
        "load": LEFT_OUT, "change": "Change a parameter of all servos; repeatable."}],
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write a page with tables and pictures.", rich_help_panel=shared.OUTPUT)] = None,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw the curves: .png, .svg or .pdf; for several servos, torque and current "
        "side by side.", rich_help_panel=shared.OUTPUT)] = None,
    loop: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw the torque of a digital or bus servo over its error: .png, .svg or .pdf.",
        rich_help_panel=shared.OUTPUT)] = None,
    csv: Annotated[Path | None, typer.Option(
        "--csv", metavar="FILE.csv", help="Write the curves, a row per point.", rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Compute the sheets of servos from their parameters, beside what their makers print."""
    from servotwin.cli.curves_report import facts
    from servotwin.cli.option_values import loads_of

    asked, volts = loads_of(lift, arm, load or []), _voltages(voltage)
    targets = _targets({"--out": out, "--plot": plot, "--loop": loop, "--csv": csv}, servos,
                       1 if volts is None else len(volts), force=ending.force)
    models = _models(servos, plant)
    if voltage and plant.supply:
        raise InputError("--supply", got=f"also --voltage {','.join(voltage)}", allowed="one of them")
    _check_loop(loop, models)
    sheets = _computed(models, {
        "voltage": volts, "lift": asked.lift, "hot": hot + _ZERO_CELSIUS, "bandwidth": not quick})
    _write(sheets, targets, asked.torque, force=ending.force)
    files = [str(target.path) for target in targets]
    if ending.as_json:
        emit_json({"servos": [facts(sheet, asked.torque) for sheet in sheets], "files": files})
        return
    for sheet in sheets:
        _show(sheet, asked.torque)
    if len(sheets) > 1:
        _show_beside(sheets)
    if files:
        show(pairs([("written", name) for name in files]))


def _targets(paths: dict[str, Path | None], servos: list[str], voltages: int, *, force: bool) -> list[Target]:
    from servotwin.cli.output_files import Target, check_targets, page_name
    from servotwin.plotting import CURVES_A_PAGE, LOOPS_A_PAGE, pages

    repeated = next((name for name in servos if servos.count(name) > 1), None)
    if repeated is not None:
        raise InputError("servos", got=f"{repeated!r} twice", allowed="each once")
    several = {"--plot": pages(voltages if len(servos) == 1 else len(servos), CURVES_A_PAGE),
               "--loop": pages(voltages, LOOPS_A_PAGE)}
    targets = [Target(option=option, path=Path(page_name(str(path), page)), page=page,
                      endings=_ENDINGS.get(option, _PICTURES))
               for option, path in paths.items() if path is not None for page in several.get(option, [1])]
    check_targets(targets, force=force, inputs=[Path(servo) for servo in servos])
    return targets


def _voltages(words: list[str] | None) -> list[float] | None:
    """Return the voltages that are asked for, each once; None: the servo's own."""
    from servotwin.units.quantities import quantity

    if words is None:
        return None
    return list(dict.fromkeys(quantity("--voltage", part, "voltage", bare=True, positive=True)
                              for word in words for part in word.split(",")))


def _models(servos: list[str], plant: shared.Plant) -> list[Model]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*: computed as a")  # the notes say which model stands for it
        return [plant.of(servo, _MODELS) for servo in servos]


def _check_loop(path: Path | None, models: list[Model]) -> None:
    from servotwin.models import DigitalServo

    if path is not None and not (len(models) == 1 and isinstance(models[0], DigitalServo) and not models[0].endless):
        names = ", ".join(model.servo.name for model in models)
        raise InputError("--loop", got=names, allowed="one digital or bus servo, whose file has a program, and that "
                         "does not turn endlessly")


def _computed(models: list[Model], options: dict[str, Any]) -> list[DataSheet]:
    from servotwin.datasheet import curves as compute

    found = []
    for each in models:
        with patience(f"computing {each.servo.name}"):
            found.append(compute(each, **options))
    return found


def _write(sheets: list[DataSheet], targets: list[Target], torque: float | None, *, force: bool) -> None:
    from servotwin.cli.output_files import staged

    with patience("drawing"), staged(targets, force=force) as drafts:
        for target, draft in zip(targets, drafts, strict=True):
            if target.option == "--out":
                from servotwin.cli.curves_report import page

                draft.write_text(page(sheets, torque), encoding="utf-8", newline="\n")
            elif target.option == "--loop":
                from servotwin import plotting

                loops = [part.loop for part in sheets[0].voltages if part.loop]
                plotting.save(plotting.loop_curve(loops, page=target.page), draft)
            elif target.option == "--plot":
                from servotwin import plotting

                plotting.save(plotting.speed_curves(sheets[0], page=target.page) if len(sheets) == 1 else
                              plotting.compared_curves(sheets, page=target.page), draft)
            else:
                _write_points(sheets, draft)


def _write_points(sheets: list[DataSheet], path: Path) -> None:
    from servotwin.tables import csv_text
    from servotwin.units import from_si

    names = ("servo", "supply_voltage_V", "winding_temperature_K", "output_speed_deg_per_s", "load_torque_Nm",
             "supply_current_A", "load_power_W", "efficiency")
    rows = [(sheet.servo.name, float(part.voltage), float(curve.temperatures.winding), *point)
            for sheet in sheets for part in sheet.voltages for curve in (part.cold, part.hot)
            for point in zip([from_si(w, "deg/s", "speed") for w in curve.speed.tolist()], curve.torque,
                             curve.current, curve.power, curve.efficiency, strict=True)]
    path.write_bytes(csv_text(dict(zip(names, zip(*rows, strict=True), strict=True)), digits=12).encode())


def _show_beside(sheets: list[DataSheet]) -> None:
    """Show all servos in one table."""
    from servotwin.cli.curves_report import beside
    from servotwin.cli.which_words import side_by_side

    lifts = sheets[0].voltages[0].lift is not None
    volts = {part.voltage for sheet in sheets for part in sheet.voltages}
    at = f", at {volts.pop():g} V" if len(volts) == 1 else ""
    show(f"side by side, cold{at}", table(*side_by_side(beside(sheets))),
         "10 min: winding, after holding the arm horizontal; droop: below its command there" if lifts else
         "quarter load: held below its command, by a quarter of its own stall torque; at rest: free", "")


def _show(sheet: DataSheet, torque: float | None) -> None:
    from servotwin.cli.curves_report import hot_words, notes, sections
    from servotwin.cli.summary import model_name
    from servotwin.look.reports import Report

    servo = sheet.servo
    head = [f"{servo.title or servo.name} ({servo.name}), model {model_name(sheet.model)}",
            *(f"  note: {note}" for note in notes(sheet))]
    show_report("\n".join(head), Report(servo.title or servo.name, "", sections(sheet, torque)),
                f"cold: 25 deg C; hot: {hot_words(sheet.voltages[0])}", "")
