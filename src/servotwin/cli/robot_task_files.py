"""The files of an arm that has done a task: beside those of its servos what its tool and its joints did."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.cli import robot_files as files
from servotwin.cli.robot_facts import facts
from servotwin.cli.robot_task_page import ideal_page, task_section
from servotwin.cli.terminal import json_text, patience
from servotwin.tables import csv_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.cli.outputs import Target
    from servotwin.cli.robot_arm import Ways
    from servotwin.robots import Sizing
    from servotwin.robots.arm import Arm
    from servotwin.robots.camera import Trail
    from servotwin.robots.kinematics import JointPath
    from servotwin.robots.redundancy import Criterion
    from servotwin.robots.task_run import IdealTask, TaskRun
    from servotwin.robots.tasks import ToolPath

    Array = NDArray[np.float64]

TOOL_TABLE, TOOL_PICTURE, USE_PICTURE = "tool.csv", "tool.png", "redundancy.png"
RATE = 25.0  # pictures of a video a second
WAYS = ("redundancy", "limits left", "torque, rms", "way of the joints")
_ASKED, _REAL = (0.9, 0.6, 0.0, 0.9), (0.0, 0.45, 0.7, 1.0)  # red, green, blue, opacity
_LINE_STEP, _TRAIL_POINTS = 2e-3, 200  # m; points
_UP = 6e-4  # m, by which a trail lies above the path


def names(joints: int, *, ideal: bool, redundant: bool, picture: bool, video: bool) -> list[str]:
    """Return the names of all files of a task by an arm of `joints`; the page is the last."""
    servos = [] if ideal else [files.SERVOS, *files.servo_pictures(joints)]
    return [*servos, files.JOINTS, files.SUMMARY, TOOL_TABLE, TOOL_PICTURE, *([USE_PICTURE] if redundant else []),
            *files.drawn_names(picture=picture, video=video), files.PAGE]


def other_ways(arm: Arm, path: ToolPath, criterion: Criterion, joints: JointPath) -> dict[str, JointPath]:
    """Return how a redundant arm may move, without a criterion and with the one asked for, by name."""
    from servotwin.robots.redundancy import LeastMotion

    if not arm.redundant:
        return {}
    without = LeastMotion()
    return {without.name: joints if criterion.name == without.name else without.solve(arm, path)} | {
        criterion.name: joints}


# --- facts ------------------------------------------------------------------------------------------------------------


def task_facts(run: TaskRun, sized: Mapping[str, Sizing], ways: Ways, controller: str) -> dict[str, Any]:
    """Return what is worth knowing of a task that servos have done, in SI, ready for JSON."""
    return facts(run.run, dict(sized), run.arm.name) | _of_task(ways) | {
        "controller": controller, "chips_bypassed": run.control_bypasses, "actuators": "servos",
        "task_metrics": run.metrics._asdict(),
        "ideal_contour": {"rms": run.ideal_contour.rms, "largest": run.ideal_contour.largest}}


def ideal_facts(done: IdealTask, ways: Ways) -> dict[str, Any]:
    """Return what is worth knowing of a task that ideal actuators have done, in SI, ready for JSON."""
    return {"robot": ways.joints.arm.name, "motion": done.motion.source, "duration": done.motion.duration,
            **_of_task(ways), "actuators": "ideal",
            "ideal_contour": {"rms": done.contour.rms, "largest": done.contour.largest},
            "largest_torque": {joint: float(np.abs(values).max()) for joint, values in done.torque.items()}}


def _of_task(ways: Ways) -> dict[str, Any]:
    from servotwin.robots.redundancy import LeastMotion, LeastTorque

    return {"task": ways.joints.path.name, "redundant": ways.joints.arm.redundant, "ways": {
        name: {"limit_distance": way.limit_distance, "torque_rms": LeastTorque().measure(way),
               "length": LeastMotion().measure(way)} for name, way in ways.others.items()}}


def told(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what the terminal says of a task."""
    ideal = found["ideal_contour"]
    if found["actuators"] == "ideal":
        return [("contour error", f"{1e6 * ideal['rms']:.2g} um rms, {1e6 * ideal['largest']:.2g} um at most"),
                ("largest torque", ", ".join(f"{joint} {value:.3g}" for joint, value in found["largest_torque"].items())
                 + " N m (lift: N)" * ("lift" in found["largest_torque"]))]
    metrics = found["task_metrics"]
    kind = ("chip bypassed" if found["chips_bypassed"] else "model {}").format
    servos = sorted({f"{each['servo']}, {kind(each['model'])}" for each in found["joints"].values()})
    return [("servos", "; ".join(servos)), ("controller", found["controller"]),
            ("contour error", f"{1e3 * metrics['contour_rms']:.3g} mm rms, {1e3 * metrics['contour_largest']:.3g} mm "
             f"at most; with ideal actuators {1e6 * ideal['largest']:.2g} um"),
            ("behind by", f"{1e3 * metrics['tool_rms']:.3g} mm rms, the lag included"),
            ("big enough", "all servos" if found["big_enough"] else "not all servos: see the page"),
            *(("note", text) for text in found["notes"][:6])]


def way_rows(found: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the rows below `WAYS`."""
    return [(name, f"{100.0 * way['limit_distance']:.1f} %", f"{1e3 * way['torque_rms']:.3g} mN m",
             f"{way['length']:.3g} rad") for name, way in found["ways"].items()]


# --- files ------------------------------------------------------------------------------------------------------------


def write_task(run: TaskRun, sized: Mapping[str, Sizing], ways: Ways, targets: Sequence[Target],
               found: Mapping[str, Any], *, force: bool, output_step: float) -> None:
    """Write all files of a task that servos have done, or after an error none."""
    asked = ways.joints.path
    inside = run.moving
    time = run.run.time[inside]
    more = _writers(asked, ways, [("servos", time, run.tool[inside], run.contour.error)], output_step)
    shown = _line(asked)
    places = run.tool

    def trails(k: int) -> list[Trail]:
        return [shown, _trail(places[inside & (run.run.time <= run.run.time[k])])]

    files.write_all(run.run, sized, targets, found, force=force, output_step=output_step, camera=None, rate=RATE,
                    more=more, section=task_section(found, WAYS, way_rows(found)), trails=trails,
                    still=int(np.searchsorted(run.run.time, 0.85 * asked.duration)))


def write_ideal(done: IdealTask, ways: Ways, targets: Sequence[Target], found: Mapping[str, Any], *, force: bool,
                output_step: float) -> None:
    """Write all files of a task that ideal actuators have done, or after an error none."""
    from servotwin.cli.outputs import staged

    with staged(targets, force=force) as drafts:
        places = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        writers = _writers(ways.joints.path, ways, [("ideal actuators", done.time, done.tool, done.contour.error)],
                           output_step) | {
            files.JOINTS: lambda path: path.write_bytes(_joint_table(done, ways.joints.arm, output_step).encode()),
            files.SUMMARY: lambda path: path.write_bytes((json_text(found) + "\n").encode()),
            files.PAGE: lambda path: path.write_bytes(
                ideal_page(found, list(places), WAYS, way_rows(found)).encode())}
        with patience("drawing"):
            for name, writer in writers.items():
                writer(places[name])
        if files.PICTURE in places:
            _draw(done, ways.joints, places[files.PICTURE], places.get(files.VIDEO))


def _writers(path: ToolPath, ways: Ways, traces: Sequence[tuple[str, Array, Array, Array]],
             output_step: float) -> dict[str, Callable[[Path], object]]:
    """Return the writers of what tool and joints did: label, times, places and errors of each trace."""
    from servotwin import plotting

    drawn = [plotting.ToolTrace(*trace) for trace in traces]
    made: dict[str, Callable[[Path], object]] = {
        TOOL_TABLE: lambda file: file.write_bytes(_tool_table(path, drawn[0], output_step).encode()),
        TOOL_PICTURE: lambda file: plotting.save(plotting.tool_paths(path.line, drawn), file)}
    if ways.others:
        made[USE_PICTURE] = lambda file: plotting.save(joint_uses(ways.others), file)
    return made


def joint_uses(ways: Mapping[str, JointPath]) -> Any:
    """Return the picture of how joints are used by each criterion: hinges alone."""
    from servotwin import plotting
    from servotwin.robots.kinematics import limits_of
    from servotwin.robots.model_file import joint_names

    arm = next(iter(ways.values())).arm
    model = arm.model()
    hinges = [k for k, kind in enumerate(joint_names(model).values()) if kind == "angle"]
    lower, upper = limits_of(model, arm)
    return plotting.joint_use([list(arm.joints)[k] for k in hinges], [plotting.JointUse(
        name, ((way.angles - 0.5 * (lower + upper)) / (0.5 * (upper - lower)))[:, hinges],
        np.sqrt(np.mean(way.torque()**2, axis=0))[hinges]) for name, way in ways.items()])


def _tool_table(path: ToolPath, trace: Any, output_step: float) -> str:
    """Return where the tool was and should have been, in mm, as CSV."""
    rows = _every(trace.time, output_step)
    wanted = np.stack([np.interp(trace.time, path.time, column) for column in path.places.T], axis=1)
    columns: dict[str, Array] = {"time_s": trace.time}
    for k, axis in enumerate("xyz"):
        columns[f"wanted_{axis}_mm"], columns[f"tool_{axis}_mm"] = 1e3 * wanted[:, k], 1e3 * trace.places[:, k]
    columns["contour_error_mm"] = 1e3 * trace.error
    return csv_text({name: (values[rows] + 0.0).tolist() for name, values in columns.items()}, digits=9)


def _joint_table(done: IdealTask, arm: Arm, output_step: float) -> str:
    """Return angles and torques of ideal actuators as CSV."""
    from servotwin.robots.model_file import joint_names
    from servotwin.units import from_si

    rows, columns = _every(done.time, output_step), {"time_s": done.time}
    for k, (joint, kind) in enumerate(joint_names(arm.model()).items()):
        unit, force = ("mm", "force_N") if kind == "length" else ("deg", "torque_Nm")
        columns[f"{joint}.ideal_{unit}"] = np.asarray(from_si(done.poses[:, k], unit, kind))
        columns[f"{joint}.needed_{force}"] = done.torque[joint]
    return csv_text({name: (values[rows] + 0.0).tolist() for name, values in columns.items()}, digits=9)


def _every(time: Array, step: float) -> slice:
    return slice(None, None, max(round(step / float(time[1] - time[0])), 1))


# --- drawing ----------------------------------------------------------------------------------------------------------


def _draw(done: IdealTask, joints: JointPath, picture: Path, video: Path | None) -> None:
    """Draw the robot in the middle of its task, and all of it as a video."""
    from servotwin.robots.camera import Camera

    shown = _line(joints.path)
    with Camera(joints.arm.model(), *files.SIZE, None, done.poses) as view:
        files.picture_and_video(
            lambda k: view.picture(done.poses[k], words=f"{done.time[k]:.2f} s", note="ideal actuators",
                                   trails=[shown, _trail(done.tool[:k + 1])]),
            done.time, 2 * len(done.time) // 3, picture, video, RATE)


def _line(path: ToolPath) -> Trail:
    """Return the path asked for as a line in space."""
    from servotwin.robots.camera import Trail

    return Trail(_thinned(path.line, _LINE_STEP), _ASKED)


def _trail(places: Array) -> Trail:
    """Return where the tool has been as a line in space, a little above."""
    from servotwin.robots.camera import Trail

    thin = places[::max(len(places) // _TRAIL_POINTS, 1)]
    return Trail(_thinned(thin, 2e-4) + np.array([0.0, 0.0, _UP]), _REAL)


def _thinned(points: Array, step: float) -> Array:
    """Return points none of which are close together [m]."""
    kept: list[Array] = []
    for point in points:
        if not kept or np.linalg.norm(point - kept[-1]) > step:
            kept.append(point)
    return np.array([*kept, points[-1]]) if kept else np.zeros((0, 3))


