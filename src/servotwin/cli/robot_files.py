"""The files that `servotwin robot run` writes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.cli.outputs import Target, check_targets, page_name, staged
from servotwin.cli.robot_facts import margin_words
from servotwin.cli.terminal import json_text, patience
from servotwin.errors import OutputError
from servotwin.parameters.output_file import undone

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from servotwin.robots import RobotRun, Sizing
    from servotwin.robots.camera import Trail

    Trails = Callable[[int], Sequence[Trail]]

SERVOS, JOINTS, SUMMARY, PAGE = "run.csv", "joints.csv", "summary.json", "index.html"
TRACKING, ELECTRICAL, SIZING, PICTURE, VIDEO = (
    "tracking.png", "electrical.png", "sizing.png", "robot.png", "robot.webm")
SIZE = (640, 480)  # pixels of picture and video
_OPTION = "--out"


@contextmanager
def folder(out: Path) -> Iterator[None]:
    """Let a folder be there; one that was not and stays empty goes again.

    Raises
    ------
    OutputError
        If it cannot be made.
    """
    with ExitStack() as stack:
        try:
            if not out.exists():
                out.mkdir()
                stack.enter_context(undone(partial(_remove_if_empty, out)))
            elif not out.is_dir():
                raise OutputError(f"{_OPTION} {out} is no folder")
        except FileNotFoundError:
            raise OutputError(f"{_OPTION} {out}: the folder {out.parent} does not exist") from None
        except (OSError, ValueError) as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(f"{_OPTION} {str(out)!r} cannot be made "
                              f"({getattr(error, 'strerror', None) or error})") from None
        yield


def _remove_if_empty(path: Path) -> None:
    with suppress(OSError):
        path.rmdir()


def targets_in(out: Path, *, servos: int, picture: bool, video: bool, force: bool,
               inputs: Sequence[Path] = ()) -> list[Target]:
    """Return the files to be written of so many servos into a folder that is there, checked.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_targets` does.
    """
    names = [SERVOS, JOINTS, SUMMARY, *servo_pictures(servos), *drawn_names(picture=picture, video=video)]
    return targets_of(out, [*names, PAGE], force=force, inputs=inputs)


def servo_pictures(servos: int) -> list[str]:
    """Return the names of the pictures of what so many servos have done, all pages of each."""
    return [name for picture in (TRACKING, ELECTRICAL, SIZING) for name in joint_pages(picture, servos)]


def joint_pages(picture: str, joints: int) -> list[str]:
    """Return the names of the pages on which a picture shows so many joints."""
    from servotwin.plotting import JOINTS_A_PAGE, pages

    return [page_name(picture, page) for page in pages(joints, JOINTS_A_PAGE)]


def drawn_names(*, picture: bool, video: bool) -> list[str]:
    """Return the names of what is drawn of the robot."""
    return [*([PICTURE] if picture else []), *([VIDEO] if video else [])]


def targets_of(out: Path, names: Iterable[str], *, force: bool, inputs: Sequence[Path] = ()) -> list[Target]:
    """Return files of these names in a folder, checked.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_targets` does.
    """
    found = [Target(option=_OPTION, path=out / name, endings=(Path(name).suffix,)) for name in names]
    check_targets(found, force=force, inputs=inputs)
    return found


def write_all(run: RobotRun, sized: Mapping[str, Sizing], targets: Sequence[Target], found: Mapping[str, Any], *,
              force: bool, output_step: float, camera: str | None, rate: float,
              more: Mapping[str, Callable[[Path], object]] | None = None, section: str = "",
              trails: Trails | None = None, still: int | None = None) -> None:
    """Write all files, or after an error none.

    Parameters
    ----------
    run : RobotRun
    sized : mapping of str to Sizing
    targets : sequence of Target
    found : mapping
        What `facts` says of the run.
    force : bool
        Whether files that are there may be replaced.
    output_step : float
        Between the rows of tables [s]
    camera : str, optional
        By which the robot is seen.
    rate : float
        Pictures of the video a second [Hz]
    more : mapping of str to callable
        Writers of further files, by name.
    section : str
        HTML on them, for the page.
    trails : callable
        Lines that are drawn in pictures, by the number of the row.
    still : int, optional
        Row that the picture is of; that of the largest error unless given.
    """
    from servotwin.cli.robot_page import page

    with staged(targets, force=force) as drafts:
        places = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        writers: dict[str, Callable[[Path], object]] = {
            SERVOS: lambda path: run.record.save(path, every=_every(run, output_step)),
            JOINTS: lambda path: path.write_bytes(_joint_table(run, output_step).encode()),
            SUMMARY: lambda path: path.write_bytes((json_text(found) + "\n").encode()),
            PAGE: lambda path: path.write_bytes(page(
                run, sized, found, list(places), section,
                "At the time of the largest error." if still is None else f"At {run.time[still]:.2f} s.").encode()),
            **_pictures(run, sized), **(more or {}),
        }
        with patience("drawing"):
            for name, writer in writers.items():
                writer(places[name])
        if PICTURE in places:
            _robot(run, places[PICTURE], places.get(VIDEO), camera, rate, trails or (lambda k: ()), still)


def _every(run: RobotRun, output_step: float) -> int:
    return max(round(output_step / float(run.time[1] - run.time[0])), 1)


def _joint_table(run: RobotRun, output_step: float) -> str:
    """Return goal, real and ideal place of all joints, and what the motion takes of them, as CSV."""
    from servotwin.tables import csv_text
    from servotwin.units import from_si

    every, columns = _every(run, output_step), {"time_s": run.time}
    for joint in run.mounts:
        slides = run.slides(joint)
        unit, dimension = ("mm", "length") if slides else ("deg", "angle")
        places: dict[str, NDArray[np.float64]] = {
            "goal": run.goal(joint), "place" if slides else "angle": run.record[joint]["joint_angle"],
            "ideal": run.ideal.courses[joint].angle}
        if (measured := run.measured(joint)) is not None:
            places["measured"] = measured
        for name, values in places.items():
            columns[f"{joint}.{name}_{unit}"] = np.asarray(from_si(values, unit, dimension))
        columns[f"{joint}.needed_{'force_N' if slides else 'torque_Nm'}"] = run.ideal.torque[joint]
        columns[f"{joint}.delivered_{'force_N' if slides else 'torque_Nm'}"] = run.record[joint]["joint_torque"]
    return csv_text({name: (values[::every] + 0.0).tolist() for name, values in columns.items()}, digits=9)


def _pictures(run: RobotRun, sized: Mapping[str, Sizing]) -> dict[str, Callable[[Path], object]]:
    from servotwin import plotting

    record = run.record
    followed = [plotting.JointTrace(
        joint, run.time, run.goal(joint), record[joint]["joint_angle"], run.ideal.courses[joint].angle,
        run.slides(joint), run.measured(joint)) for joint in run.mounts]
    drawn = [plotting.ServoTrace(joint, run.time, record[joint]["armature_current"], *(
        record[joint].get(name) for name in ("bus_voltage", "winding_temperature", "housing_temperature")))
        for joint in run.mounts]
    inside = (run.time >= 0.0) & (run.time <= run.motion.duration)
    shafts = [_shaft(each, inside) for each in sized.values()]
    pictures: dict[str, Callable[[int], Figure]] = {
        TRACKING: lambda page: plotting.joint_tracking(followed, events=(0.0, run.motion.duration), page=page),
        ELECTRICAL: lambda page: plotting.servo_electrics(drawn, page=page),
        SIZING: lambda page: plotting.shaft_torques(shafts, page=page),
    }
    return {name: partial(_save, draw, page) for picture, draw in pictures.items()
            for page, name in enumerate(joint_pages(picture, len(run.mounts)), 1)}


def _save(draw: Callable[[int], Figure], page: int, path: Path) -> None:
    """Write a page of a picture into a file."""
    from servotwin import plotting

    plotting.save(draw(page), path)


def _shaft(sized: Sizing, inside: Any) -> Any:
    from servotwin import plotting

    curves = [(f"alone on {sized.voltage:g} V", sized.curve)]
    if sized.sagged is not None:
        curves.append(("with what the others leave", sized.sagged))
    needed, delivered = (plotting.Cloud(each.speed[inside], each.torque[inside])
                         for each in (sized.needed, sized.delivered))
    worst = None if math.isinf(sized.margin) else (sized.worst.speed, sized.worst.torque)
    return plotting.ShaftTrace(sized.joint, f"{margin_words(sized.margin)}×", curves, needed, delivered, worst,
                               sized.rms_torque, sized.lasting_torque)


def _robot(run: RobotRun, picture: Path, video: Path | None, camera: str | None, rate: float, trails: Trails,
           still: int | None) -> None:
    """Draw the robot where it is furthest off, or at a row, and all of it as a video."""
    from servotwin.robots.camera import Camera

    errors = np.max([np.abs(run.goal(joint) - run.record[joint]["joint_angle"]) for joint in run.mounts], axis=0)
    inside = np.flatnonzero((run.time >= 0.0) & (run.time <= run.motion.duration))

    with Camera(run.model, *SIZE, camera, run.poses) as view:
        def drawn(k: int) -> Any:
            return view.picture(run.poses[k], run.ideal.poses[k], words=f"{max(run.time[k], 0.0):.2f} s",
                                note="pale: with ideal actuators", trails=trails(k))

        worst = int(inside[np.argmax(errors[inside])])
        picture_and_video(drawn, run.time, worst if still is None else still, picture, video, rate)


def picture_and_video(drawn: Callable[[int], Any], time: NDArray[np.float64], still: int, picture: Path,
                      video: Path | None, rate: float) -> None:
    """Write one picture, and all as a video.

    Parameters
    ----------
    drawn : callable
        Returns the picture of a row.
    time : ndarray, shape (n,)
        Of the rows [s]
    still : int
        Which row the picture is of.
    picture, video : Path
        None: no video.
    rate : float
        [Hz]
    """
    from servotwin.robots.video import Video, png
    from servotwin.simulation.progress import shown

    picture.write_bytes(png(drawn(still)))
    if video is None:
        return
    times = np.arange(0.0, time[-1], 1.0 / rate)
    frames = np.minimum(np.searchsorted(time, times), len(time) - 1).tolist()
    with Video(video, *SIZE, rate) as written, shown(True, len(frames), "drawing the video") as tell:
        for done, k in enumerate(frames):
            written.add(drawn(k))
            tell(done + 1)
