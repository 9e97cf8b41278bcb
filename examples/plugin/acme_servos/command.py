"""`servotwin reserve`: what torque a servo has left over the torque that it holds, in a table and a picture."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import servotwin as st
from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.output_files import Target, check_targets, staged
from servotwin.cli.terminal import emit_json, pairs, show_report
from servotwin.look import axes_grid, context, finished
from servotwin.look.plain_data import plain
from servotwin.look.reports import Picture, Report, Section, Table


@usual("torque", "set", "out", "force", "json")
@with_records
def reserve(
    *,
    servo: shared.ServoArgument,
    torque: Annotated[float, typer.Option(metavar="NEWTON-METRES", help="Torque that it holds.")] = 0.1,
    plant: Annotated[shared.Plant, {"load": LEFT_OUT}],
    out: Annotated[Path | None, typer.Option(
        metavar="FILE.html", help="Write a page.", rich_help_panel=shared.OUTPUT)] = None,
    ending: shared.Ending,
) -> None:
    """Show how fast a servo still turns under a torque, by supply voltage."""
    targets = [] if out is None else [Target(option="--out", path=out, endings=(".html",))]
    check_targets(targets, force=ending.force, inputs=[Path(servo)])
    model = plant.of(servo)
    found = speeds(model, torque)
    if ending.as_json:
        emit_json(plain({"servo": model.servo.name, "torque": torque, "speeds": found}))
        return
    report = described(model, torque, found)
    with staged(targets, force=ending.force) as drafts:
        for draft in drafts:
            draft.write_text(report.page, encoding="utf-8", newline="\n")
    show_report(report.title, report, *(["", pairs([("written", str(out))])] if out else []))


def described(model, torque, found):
    """Return the result in words, a table and a picture: the terminal and the page show the same."""
    rows = [(f"{volts:.1f} V", f"{np.degrees(speed):.0f} deg/s") for volts, speed in found.items()]
    return Report(f"{model.servo.title}, holding {torque:g} N m", "", [Section("", [
        Table(("supply", "speed that is left"), rows),
        Picture(lambda: [drawn(found)], "Speed at full drive under this torque, over the supply's voltage.")])])


def drawn(found):
    """Return a picture of the speeds."""
    with context():
        figure, (ax,) = axes_grid()
        ax.plot(list(found), np.degrees(list(found.values())))
        ax.set(xlabel="supply (V)", ylabel="speed (°/s)")
        return finished(figure)


def speeds(model, torque):
    """Return the steady speed at full drive under a torque [rad/s], by supply voltage [V]."""
    found = {}
    for volts in np.linspace(4.0, 8.0, 9).tolist():
        drive = st.datasheet.FullDrive(type(model)(model.servo.replace({"supply.open_circuit_voltage": volts})))
        found[volts] = float(drive.speed(torque)) if torque < drive.stall_torque else 0.0
    return found
