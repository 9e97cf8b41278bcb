"""`servotwin robot mobile`: the robot on wheels drives along waypoints, by odometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, pairs, show

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.robots import WaypointRun

_DRIVE, _WHEELS = "Waypoints", "Robot and servos"


def mobile(
    out: Annotated[Path, typer.Option(
        metavar="FOLDER", help="Folder for tables, pictures, video and page.", rich_help_panel=shared.OUTPUT)],
    task: Annotated[str, typer.Option(
        metavar="ROUND", help="square or circle.", rich_help_panel=_DRIVE)] = "square",
    size: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="Side or diameter of the round, such as 60cm (the default).",
        rich_help_panel=_DRIVE)] = None,
    waypoints: Annotated[str | None, typer.Option(
        metavar="X,Y;X,Y;...", help="Instead of a round, in metres, such as '0,0; 0.6,0; 0.6,0.6'; or a CSV file with "
        "columns x_m and y_m.", rich_help_panel=_DRIVE)] = None,
    speed: Annotated[float, typer.Option(
        metavar="M/S", help="Of the robot.", rich_help_panel=_DRIVE)] = 0.08,
    lookahead: Annotated[float, typer.Option(
        metavar="METRES", help="How far ahead on its path it steers to.", rich_help_panel=_DRIVE)] = 0.1,
    servo: Annotated[str, typer.Option(
        metavar="ID", help="Servo of both wheels, rebuilt to turn endlessly: catalog id, or path of a servo file.",
        rich_help_panel=_WHEELS)] = "hitec-hs-755hb",
    unequal: Annotated[bool, typer.Option(
        "--unequal", help="With servos as one buys them: one neutral 8 us off, one motor with 0.9 of its torque.",
        rich_help_panel=_WHEELS)] = False,
    encoders: Annotated[int | None, typer.Option(
        metavar="COUNTS", help="Encoders on the wheels, counts of a turn (default: none; it believes in its pulses).",
        rich_help_panel=_WHEELS)] = None,
    ideal: Annotated[bool, typer.Option(
        "--ideal", help="On ideal wheels.", rich_help_panel=_WHEELS)] = False,
    supply: Annotated[str | None, typer.Option(
        metavar="VOLTS[:OHMS]", help="Supply that both servos share, such as 6V:0.1ohm.",
        rich_help_panel=_WHEELS)] = None,
    output_step: Annotated[float, typer.Option(
        metavar="SECONDS", help="Time between rows of the tables.", rich_help_panel=shared.OUTPUT)] = 0.02,
    video: Annotated[bool, typer.Option(
        "--video/--no-video", help="Draw a video.", rich_help_panel=shared.OUTPUT)] = True,
    force: Annotated[bool, typer.Option(
        "--force", help="Replace existing files.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Let the mobile robot drive along waypoints."""
    from servotwin.cli import robot_files as files
    from servotwin.cli import robot_mobile_files as written
    from servotwin.cli.robot import check_drawing, check_numbers
    from servotwin.cli.robot_words import as_options
    from servotwin.robots import robot_model

    check_numbers(output_step=output_step, rate=written.RATE, blend=None)
    corners = written.points_of(waypoints, task, size)
    servos = _servos(servo, unequal=unequal)
    picture = not ideal and check_drawing(robot_model("mobile"), None, video=video)
    names = [*([] if ideal else [files.SERVOS]), written.PATH_TABLE, files.SUMMARY, written.PATHS,
             *files.drawn_names(picture=picture, video=video and picture), files.PAGE]
    with files.folder(out):
        targets = files.targets_of(out, names, force=force)
        with as_options():
            run = _run(corners, servos, _wheel(servo), speed, lookahead, encoders, supply, ideal=ideal)
        found = written.facts(run, servo, encoders, unequal=unequal, ideal=ideal)
        written.write(run, found, targets, output_step, force=force)
    found["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(found)
    else:
        show(f"mobile: {len(run.waypoints)} waypoints", pairs([*written.told(found), ("written", found["files"][-1])]))


def _servos(servo: str, *, unequal: bool) -> tuple[Model, Model]:
    from servotwin.robots import unequal_servos

    return unequal_servos(servo) if unequal else (_wheel(servo),) * 2


def _wheel(servo: str) -> Model:
    from servotwin.robots import wheel_servo

    return wheel_servo(servo)


def _run(corners: Any, servos: Sequence[Model], nominal: Model, speed: float, lookahead: float, encoders: int | None,
         supply: str | None, *, ideal: bool) -> WaypointRun:
    from servotwin.cli.robot_words import supply_of
    from servotwin.robots import ideal_waypoints, run_waypoints

    if ideal:
        return ideal_waypoints(corners, speed=speed, lookahead=lookahead)
    return run_waypoints(servos, corners, encoders=encoders, nominal=nominal, speed=speed, lookahead=lookahead,
                         bus=supply_of(supply), progress=True)
