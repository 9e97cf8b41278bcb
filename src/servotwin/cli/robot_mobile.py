"""`servotwin robot mobile`: the robot on wheels drives along waypoints, by odometry."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from servotwin.cli import robot_files as files
from servotwin.cli import shared_options as shared
from servotwin.cli.robot_page import STYLE, figure, film
from servotwin.cli.terminal import emit_json, json_text, pairs, patience, show
from servotwin.look import document, escape, table
from servotwin.tables import csv_text

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.robots import WaypointRun
    from servotwin.robots.camera import Trail

_DRIVE, _WHEELS = "Waypoints", "Robot and servos"
_PATH_TABLE, _PATHS = "path.csv", "paths.png"
_RATE = 12.5  # pictures of the video a second
_ASKED, _REAL = (0.9, 0.6, 0.0, 0.9), (0.0, 0.45, 0.7, 1.0)  # red, green, blue, opacity
_ABOVE = 0.002  # m, of lines over the ground
_SPARSE = 400  # points of a line


def mobile(
    out: Annotated[Path, typer.Option(
        metavar="FOLDER", help="Folder for tables, pictures, video and page.", rich_help_panel=shared.OUTPUT)],
    waypoints: Annotated[str | None, typer.Option(
        metavar="X,Y;X,Y;...", help="In metres, such as '0,0; 0.6,0; 0.6,0.6'; or a CSV file with columns x_m and y_m "
        "(default: a square of 0.6 m).", rich_help_panel=_DRIVE)] = None,
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
    from servotwin.cli.robot import check_drawing, check_numbers
    from servotwin.cli.robot_words import as_options
    from servotwin.robots import robot_model

    check_numbers(output_step=output_step, rate=_RATE, blend=None)
    corners = points_of(waypoints)
    servos = _servos(servo, unequal=unequal)
    picture = not ideal and check_drawing(robot_model("mobile"), None, video=video)
    names = [*([] if ideal else [files.SERVOS]), _PATH_TABLE, files.SUMMARY, _PATHS,
             *files.drawn_names(picture=picture, video=video and picture), files.PAGE]
    with files.folder(out):
        targets = files.targets_of(out, names, force=force)
        with as_options():
            run = _run(corners, servos, _wheel(servo), speed, lookahead, encoders, supply, ideal=ideal)
        found = _facts(run, servo, encoders, unequal=unequal, ideal=ideal)
        _write(run, found, targets, output_step, force=force)
    found["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(found)
    else:
        show(f"mobile: {len(run.waypoints)} waypoints", pairs([*_told(found), ("written", found["files"][-1])]))


def points_of(text: str | None) -> Any:
    """Return waypoints [m], shape (n, 2), of the words of their option; a square where there are none.

    Raises
    ------
    InputError
        If they have another form.

    Examples
    --------
    >>> points_of("0,0; 0.6,0").tolist()
    [[0.0, 0.0], [0.6, 0.0]]
    """
    from servotwin.errors import InputError
    from servotwin.robots.waypoints import SQUARE

    if text is None:
        return np.array(SQUARE)
    form = "X,Y;X,Y;... in metres, such as '0,0; 0.6,0', or a CSV file with columns x_m and y_m"
    try:
        if text.lower().endswith(".csv"):
            with Path(text).open(newline="", encoding="utf-8") as file:
                return np.array([[float(row["x_m"]), float(row["y_m"])] for row in csv.DictReader(file)])
        found = [[float(number) for number in point.split(",")] for point in text.split(";")]
        if any(len(point) != 2 for point in found):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError("--waypoints", got=text, allowed=form) from None
    return np.array(found)


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


def _facts(run: WaypointRun, servo: str, encoders: int | None, *, unequal: bool, ideal: bool) -> dict[str, Any]:
    return {"robot": "mobile", "actuators": "ideal" if ideal else "servos", "servo": None if ideal else servo,
            "unequal": unequal and not ideal, "encoders": encoders, "waypoints": run.waypoints.tolist(),
            "arrived": run.arrived, "missed": run.missed, "turned_astray": run.turned_astray,
            "largest_off_path": float(run.off_path.max()), "largest_off_belief": float(run.off_belief.max())}


def _told(found: dict[str, Any]) -> list[tuple[str, str]]:
    arrived = found["arrived"]
    servos = "ideal wheels" if found["servo"] is None else found["servo"] + ", unequal" * found["unequal"]
    belief = "its pulses" if found["encoders"] is None else f"encoders of {found['encoders']} counts"
    return [("servos", servos), ("odometry", "exact" if found["servo"] is None else belief),
            ("arrived", "it believes not to have arrived" if math.isnan(arrived) else f"after {arrived:.1f} s, as it "
             "believes"),
            ("missed by", f"{1e3 * found['missed']:.3g} mm, of the last waypoint"),
            ("off its path", f"{1e3 * found['largest_off_path']:.3g} mm at most"),
            ("odometry off", f"{1e3 * found['largest_off_belief']:.3g} mm at most, "
             f"{math.degrees(found['turned_astray']):z.2g} deg at the end")]


def _write(run: WaypointRun, found: dict[str, Any], targets: Sequence[Any], output_step: float, *, force: bool) -> None:
    from servotwin import plotting
    from servotwin.cli.outputs import staged

    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        with patience("drawing"):
            label = "ideal wheels" if run.record is None else "servos"
            plotting.save(plotting.robot_paths([plotting.PathTrace(label, run.path, run.believed)], run.waypoints),
                          places[_PATHS])
            places[_PATH_TABLE].write_bytes(_path_table(run, output_step).encode())
            if run.record is not None:
                every = max(round(output_step / float(run.record.time[1] - run.record.time[0])), 1)
                _sparse(run.record, every).save(places[files.SERVOS])
            places[files.SUMMARY].write_bytes((json_text(found) + "\n").encode())
            places[files.PAGE].write_bytes(_page(found, list(places)).encode())
        if files.PICTURE in places:
            _draw(run, places[files.PICTURE], places.get(files.VIDEO))


def _sparse(record: Any, every: int) -> Any:
    from servotwin.robots import Record

    rows = np.column_stack([record.time, *(one.columns for one in record.values())])
    return Record(tuple(record), {joint: one.mount for joint, one in record.items()}, rows[::every])


def _path_table(run: WaypointRun, step: float) -> str:
    rows = slice(None, None, max(round(step / float(run.time[1] - run.time[0])), 1))
    columns: dict[str, Any] = {"time_s": run.time}
    for who, values in (("is", run.path), ("believes", run.believed)):
        columns |= {f"{who}_x_m": values[:, 0], f"{who}_y_m": values[:, 1],
                    f"{who}_heading_deg": np.degrees(values[:, 2])}
    for k, side in enumerate(("left", "right")):
        columns[f"{side}_speed_rad/s"], columns[f"{side}_pulse_us"] = run.wheel_speeds[:, k], 1e6 * run.pulses[:, k]
    return csv_text({name: values[rows].tolist() for name, values in columns.items()}, digits=9)


def _draw(run: WaypointRun, picture: Path, video: Path | None) -> None:
    from servotwin.robots.camera import Camera, Trail

    corners = np.column_stack([run.waypoints, np.full(len(run.waypoints), _ABOVE)])
    places = np.column_stack([run.path[:, :2], np.full(len(run.path), 2.0 * _ABOVE)])
    asked = Trail(corners, _ASKED)

    def trails(k: int) -> list[Trail]:
        return [asked, Trail(places[:k + 1][::max(k // _SPARSE, 1)], _REAL)]

    with Camera(run.model, *files.SIZE, None, run.poses) as view:
        files.picture_and_video(lambda k: view.picture(run.poses[k], words=f"{run.time[k]:.2f} s", trails=trails(k)),
                                run.time, len(run.time) - 1, picture, video, _RATE)


def _page(found: dict[str, Any], names: Sequence[str]) -> str:
    rows = [[escape(name), escape(words)] for name, words in _told(found)]
    drawn = film(names).replace("The robot; pale: the same with ideal actuators.", "The robot and its waypoints.")
    body = (f"<h1>mobile: {len(found['waypoints'])} waypoints</h1>\n{drawn}<div class=\"joints\">"
            f"{table(['', ''], rows, text_columns=2)}</div>\n"
            + figure(_PATHS, "Where the robot was, and where it believed to be."))
    return document("mobile robot", body, style=STYLE)
