"""What `servotwin robot mobile` reads, says and writes."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.cli import robot_files as files
from servotwin.cli.robot_page import STYLE, figure, film
from servotwin.cli.terminal import json_text, patience
from servotwin.look import document, escape, table
from servotwin.tables import csv_text

if TYPE_CHECKING:
    from servotwin.robots import WaypointRun
    from servotwin.robots.camera import Trail

PATH_TABLE, PATHS = "path.csv", "paths.png"
RATE = 12.5  # pictures of the video a second
_ASKED, _REAL = (0.9, 0.6, 0.0, 0.9), (0.0, 0.45, 0.7, 1.0)  # red, green, blue, opacity
_ABOVE = 0.002  # m, of lines over the ground
_SPARSE = 400  # points of a line


def points_of(text: str | None, task: str = "square", size: str | None = None) -> Any:
    """Return waypoints [m], shape (n, 2), of the words of their option; those of a round where there are none.

    Raises
    ------
    InputError
        If they have another form, or a round has none.

    Examples
    --------
    >>> points_of("0,0; 0.6,0").tolist()
    [[0.0, 0.0], [0.6, 0.0]]
    """
    from servotwin.errors import InputError
    from servotwin.robots import round_of
    from servotwin.units.quantities import quantity

    if text is None:
        return round_of(task, *([] if size is None else [quantity("--size", size, "length", bare=True)]))
    if size is not None:
        raise InputError("--size", got=size, allowed="a round (--task), not --waypoints")
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


def facts(run: WaypointRun, servo: str, encoders: int | None, *, unequal: bool, ideal: bool) -> dict[str, Any]:
    """Return what is worth knowing of a drive, in SI."""
    return {"robot": "mobile", "actuators": "ideal" if ideal else "servos", "servo": None if ideal else servo,
            "unequal": unequal and not ideal, "encoders": encoders, "waypoints": run.waypoints.tolist(),
            "arrived": run.arrived, "missed": run.missed, "turned_astray": run.turned_astray,
            "largest_off_path": float(run.off_path.max()), "largest_off_belief": float(run.off_belief.max())}


def told(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the same in words."""
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


def write(run: WaypointRun, found: dict[str, Any], targets: Sequence[Any], output_step: float, *, force: bool) -> None:
    """Write all files, or after an error none."""
    from servotwin import plotting
    from servotwin.cli.outputs import staged

    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        with patience("drawing"):
            label = "ideal wheels" if run.record is None else "servos"
            plotting.save(plotting.robot_paths([plotting.PathTrace(label, run.path, run.believed)], run.waypoints),
                          places[PATHS])
            places[PATH_TABLE].write_bytes(_path_table(run, output_step).encode())
            if run.record is not None:
                every = max(round(output_step / float(run.record.time[1] - run.record.time[0])), 1)
                run.record.save(places[files.SERVOS], every=every)
            places[files.SUMMARY].write_bytes((json_text(found) + "\n").encode())
            places[files.PAGE].write_bytes(_page(found, list(places)).encode())
        if files.PICTURE in places:
            _draw(run, places[files.PICTURE], places.get(files.VIDEO))


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
                                run.time, len(run.time) - 1, picture, video, RATE)


def _page(found: dict[str, Any], names: Sequence[str]) -> str:
    rows = [[escape(name), escape(words)] for name, words in told(found)]
    drawn = film(names).replace("The robot; pale: the same with ideal actuators.", "The robot and its waypoints.")
    body = (f"<h1>mobile: {len(found['waypoints'])} waypoints</h1>\n{drawn}<div class=\"joints\">"
            f"{table(['', ''], rows, text_columns=2)}</div>\n"
            + figure(PATHS, "Where the robot was, and where it believed to be."))
    return document("mobile robot", body, style=STYLE)
