"""The files of an arm that has done a task: beside those of its servos what its tool and its joints did."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin import plotting
from servotwin.cli import robot_report as files
from servotwin.cli.output_files import json_of, text_of
from servotwin.cli.robot_options import ERRORS, WINDOWS, degrees, validation_head, validation_rows
from servotwin.cli.robot_report import STYLE, film, joint_pages
from servotwin.cli.robot_report import run_facts as facts
from servotwin.cli.terminal import pairs, table
from servotwin.errors import InputError
from servotwin.look import escape
from servotwin.look.reports import Beside, Cards, Html, Report, Section, Table
from servotwin.robots.arms.controllers import STEERINGS
from servotwin.robots.arms.task_run import CONDITIONS, FIDELITIES, NOMINAL
from servotwin.robots.replay import ALL, SERVOS
from servotwin.tables import csv_text
from servotwin.text import shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from servotwin.cli.output_files import Writers
    from servotwin.robots import RobotValidation, Sizing, WaypointRun
    from servotwin.robots.arms.arm import Arm
    from servotwin.robots.arms.task_run import Comparison, IdealTask, Outcome, TaskRun
    from servotwin.robots.arms.tasks import Criterion, JointPath, ToolPath
    from servotwin.robots.camera import Trail
    Array = NDArray[np.float64]


# --- The page of an arm's task: contour error, and the use of a redundant joint ---------------------------------------

def task_sections(found: Mapping[str, Any], ways: Sequence[str], rows: Sequence[Sequence[str]]) -> list[Section]:
    """Return the sections on tool and redundancy, for the page of servos that did a task.

    Parameters
    ----------
    found : mapping
        Facts of the task.
    ways, rows : sequence
        Table of the ways in which the joints may move.
    """
    metrics, ideal = found["task_metrics"], found["ideal_contour"]
    head = ["actuators", "contour error, rms", "largest", "behind, rms", "servos' angles, rms", "motor voltage, rms",
            "command goes", "energy"]
    lines = [["servos", _mm(metrics["contour_rms"]), _mm(metrics["contour_largest"]), _mm(metrics["tool_rms"]),
              f"{math.degrees(metrics['angle_rms']):.2f}°", f"{metrics['effort']:.2f} V",
              _chatter(metrics["chatter"], bypassed=found["chips_bypassed"]), _joules(metrics["energy"])],
             ["ideal", _mm(ideal["rms"]), _mm(ideal["largest"]), "–", "–", "–", "–", "–"]]
    return [
        Section("The tool", ["The contour error is the distance of the tool from its path, however late it is.",
                             Table(head, lines, text_columns=len(head), kind="joints"),
                             Beside(["tool.png"], "The tool's path, asked for and done, and its distance from the path "
                                    "over time.")]),
        *_redundancy(ways, rows)]


def ideal_page(found: Mapping[str, Any], files: Sequence[str], ways: Sequence[str],
               rows: Sequence[Sequence[str]]) -> str:
    """Return the page of a task that ideal actuators did."""
    ideal, title = found["ideal_contour"], f"{found['robot']}: {found['task']}"
    torques = Table(["joint", "largest torque or force"], [
        [joint, f"{value:.3g} {'N' if joint == 'lift' else 'N m'}"]
        for joint, value in found["largest_torque"].items()], text_columns=2, kind="joints")
    lead = (f"Ideal actuators: joints are exactly where inverse kinematics wants them, for {found['duration']:.4g} s. "
            f"The tool is at most {_mm(ideal['largest'])} beside its path, {_mm(ideal['rms'])} rms.")
    return Report(title, lead, [
        Section("", [Html(film(files).replace("; pale: the same with ideal actuators", "")),
                     Beside(["tool.png"], "The tool's path and its distance from it over time.")]),
        *_redundancy(ways, rows), Section("What it takes", [torques])], style=STYLE).page


def _redundancy(ways: Sequence[str], rows: Sequence[Sequence[str]]) -> list[Section]:
    return [Section("Redundancy", [
        Table(ways, rows, text_columns=len(ways), kind="joints"),
        Beside(["redundancy.png"], "How far each hinge goes in its range, and its torque by rigid bodies alone, with "
               "ideal actuators. Limits left: distance to the nearest limit, of half a range.")])] if rows else []


def _mm(value: float) -> str:
    return f"{1e6 * value:.2g} µm" if value < 1e-5 else f"{1e3 * value:.3g} mm"


def _chatter(value: float, *, bypassed: bool) -> str:
    return f"{value:.3g} {'V/s' if bypassed else 'rad/s'}"


def _joules(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g} J"


# --- Waypoints, report and files of `servotwin robot mobile` ----------------------------------------------------------

PATH_TABLE, PATHS = "path.csv", "paths.png"
MOBILE_RATE = 12.5  # pictures of the video a second
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


def mobile_facts(run: WaypointRun, servo: str, encoders: int | None, *, unequal: bool, ideal: bool) -> dict[str, Any]:
    """Return the facts of a drive that matter, in SI."""
    return {"robot": "mobile", "actuators": "ideal" if ideal else "servos", "servo": None if ideal else servo,
            "unequal": unequal and not ideal, "encoders": encoders, "waypoints": run.waypoints.tolist(),
            "arrived": run.arrived, "missed": run.missed, "turned_astray": run.turned_astray,
            "largest_off_path": float(run.off_path.max()), "largest_off_belief": float(run.off_belief.max())}


def mobile_pairs(found: dict[str, Any]) -> list[tuple[str, str]]:
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


def mobile_result(run: WaypointRun, found: dict[str, Any], names: Sequence[str],
                  output_step: float) -> files.RobotResult:
    """Return what is printed and written of a drive."""
    label, record = "ideal wheels" if run.record is None else "servos", run.record

    def writers() -> Writers:
        servos: Writers = {} if record is None else {
            files.SERVOS: lambda path: record.save(path, every=files.every(record.time, output_step))}
        return {PATHS: lambda path: plotting.save(plotting.robot_paths(
                    [plotting.PathTrace(label, run.path, run.believed)], run.waypoints), path),
                PATH_TABLE: text_of(lambda: _path_table(run, output_step)), files.SUMMARY: json_of(found),
                files.PAGE: text_of(lambda: _page(found, names)), **servos}

    return files.RobotResult(facts=found, title=f"mobile: {len(run.waypoints)} waypoints", writers=writers,
                             lines=lambda more: [pairs([*mobile_pairs(found), *more])],
                             draw=lambda places: _draw(places, run))


def _path_table(run: WaypointRun, step: float) -> str:
    rows = slice(None, None, files.every(run.time, step))
    columns: dict[str, Any] = {"time_s": run.time}
    for who, values in (("is", run.path), ("believes", run.believed)):
        columns |= {f"{who}_x_m": values[:, 0], f"{who}_y_m": values[:, 1],
                    f"{who}_heading_deg": np.degrees(values[:, 2])}
    for k, side in enumerate(("left", "right")):
        columns[f"{side}_speed_rad/s"], columns[f"{side}_pulse_us"] = run.wheel_speeds[:, k], 1e6 * run.pulses[:, k]
    return csv_text({name: values[rows].tolist() for name, values in columns.items()}, digits=9)


def _draw(places: Mapping[str, Path], run: WaypointRun) -> None:
    from servotwin.robots.camera import Camera, Trail

    if files.PICTURE not in places:
        return
    corners = np.column_stack([run.waypoints, np.full(len(run.waypoints), _ABOVE)])
    driven = np.column_stack([run.path[:, :2], np.full(len(run.path), 2.0 * _ABOVE)])
    asked = Trail(corners, _ASKED)

    def trails(k: int) -> list[Trail]:
        return [asked, Trail(driven[:k + 1][::max(k // _SPARSE, 1)], _REAL)]

    with Camera(run.model, *files.SIZE, None, run.poses) as view:
        files.picture_and_video(lambda k: view.picture(run.poses[k], words=f"{run.time[k]:.2f} s", trails=trails(k)),
                                run.time, len(run.time) - 1, places, MOBILE_RATE)


def _page(found: dict[str, Any], names: Sequence[str]) -> str:
    drawn = film(names).replace("The robot; pale: the same with ideal actuators.", "The robot and its waypoints.")
    return Report(f"mobile: {len(found['waypoints'])} waypoints", "", [Section("", [
        Html(drawn), Table(["", ""], mobile_pairs(found), text_columns=2, kind="joints"),
        Beside([PATHS], "Where the robot was, and where it believed to be.")])], style=STYLE).page


# --- The report of `servotwin robot compare`: tables, factors, and where each controller loses ------------------------

TITLES = {
    "plain": "plain commands", "deadband": "deadband compensation", "feedforward": "(40) as feedforward",
    "pid": "PID", "motor-pid": "PID at motors", "play": "PID at motors, play compensated",
    "computed-torque": "computed torque", "observer": "disturbance observer"}
"""Of the controllers; the last five drive the motors past the chips."""
CONDITION_HEAD = ("controller", *CONDITIONS)
_NONE = math.nan
_BAD = 1.2  # times its nominal error: worth a word


def comparison_facts(comparison: Comparison, done: Sequence[Outcome]) -> dict[str, Any]:
    """Return all of it as plain numbers in SI units."""
    names = ("contour_rms", "contour_largest", "tool_rms", "angle_rms", "effort", "chatter", "energy")
    return {"servo": comparison.servo.name, "bus_servo": comparison.bus_servo.name, "speed": comparison.speed,
            "cases": [{**each.case._asdict(), **{name: _NONE if each.metrics is None else getattr(each.metrics, name)
                                                 for name in names}, "failure": each.failure} for each in done]}


def errors(done: Sequence[Outcome], controller: str, servos: str, condition: str, task: tuple[str, str] | None = None,
           what: str = "tool_rms") -> float:
    """Return a metric, the mean over all tasks unless one is named; nan where there is none."""
    found = [math.nan if each.metrics is None else float(getattr(each.metrics, what)) for each in done
             if (each.case.controller, each.case.servos, each.case.condition) == (controller, servos, condition)
             and (task is None or (each.case.robot, each.case.task) == task)]
    return sum(found) / len(found) if found else math.nan


def tasks(done: Sequence[Outcome]) -> list[tuple[str, str]]:
    """Return robots and their tasks, in order."""
    return list(dict.fromkeys((each.case.robot, each.case.task) for each in done))


def condition_rows(done: Sequence[Outcome]) -> list[list[str]]:
    """Return a row for each controller: its error in each condition, with pulse servos."""
    return [[TITLES[name], *(millimetres(errors(done, name, "pulse", condition)) for condition in CONDITIONS)]
            for name in STEERINGS]


def fidelity_rows(done: Sequence[Outcome], task: tuple[str, str], what: str) -> list[list[str]]:
    """Return a row for each controller: its error on a task by servos of every fidelity."""
    return [[TITLES[name], *(millimetres(errors(done, name, servos, NOMINAL, task, what)) for servos in FIDELITIES)]
            for name in STEERINGS]


def cost_rows(done: Sequence[Outcome], servos: str) -> list[list[str]]:
    """Return a row for each controller: effort, chatter and energy, means of all tasks; factor over plain commands."""
    rows = []
    for name, make in STEERINGS.items():
        effort, chatter, energy, tool = (errors(done, name, servos, NOMINAL, None, what)
                                         for what in ("effort", "chatter", "energy", "tool_rms"))
        plain = errors(done, "plain", servos, NOMINAL)
        unit = "V/s" if make().bare else "rad/s"
        rows.append([TITLES[name], f"{effort:.2f} V", f"{chatter:.3g} {unit}",
                     "-" if math.isnan(energy) else f"{energy:.1f} J", f"{plain / tool:.1f}"])
    return rows


def losses(done: Sequence[Outcome]) -> list[str]:
    """Return a sentence for each controller: where it loses most, against itself and against plain commands."""
    said = []
    for name in STEERINGS:
        own = errors(done, name, "pulse", NOMINAL)
        grown = {condition: errors(done, name, "pulse", condition) / own for condition in CONDITIONS
                 if condition != NOMINAL}
        grown = {condition: ratio for condition, ratio in grown.items() if not math.isnan(ratio)}
        if not grown:
            continue
        worst = max(grown, key=lambda condition: grown[condition])
        behind = [condition for condition in CONDITIONS if name != "plain" and errors(
            done, name, "pulse", condition) > errors(done, "plain", "pulse", condition)]
        text = f"{TITLES[name]}: {millimetres(own)} nominal"
        text += (f", {grown[worst]:.1f} times that in the worst condition ({worst})" if grown[worst] > _BAD else
                 ", and nearly the same in every condition")
        said.append(text + (f"; worse than plain commands: {', '.join(behind)}" if behind else ""))
    return said


def millimetres(value: float) -> str:
    """Return a length [m] in mm with three digits."""
    return "-" if math.isnan(value) else f"{1e3 * value:.3g} mm"


# --- The page of `servotwin robot compare`: HTML that needs nothing but the picture beside it -------------------------

COMPARED, COMPARED_PICTURE = "compare.csv", "conditions.png"
_STYLE = "figure img{width:100%;height:auto;max-width:48rem}td:nth-child(n+2){white-space:nowrap}"


def conditions_picture(done: Sequence[Outcome]) -> Figure:
    """Return the errors of all controllers in each condition, by pulse servos, mean of all tasks."""
    return plotting.ranking(
        [TITLES[name] for name in STEERINGS], x_label="tool behind, rms (mm)",
        values={condition: [1e3 * errors(done, name, "pulse", condition) for name in STEERINGS]
                for condition in CONDITIONS})


def comparison_result(found: dict[str, Any], done: Sequence[Outcome]) -> files.RobotResult:
    """Return what is printed and written of a comparison."""
    columns = {name: [case[name] for case in found["cases"]] for name in found["cases"][0]}
    return files.RobotResult(
        facts=found, title="distance of the tool from where it should be, rms, by pulse servos, mean of all tasks",
        lines=lambda more: [table(CONDITION_HEAD, condition_rows(done)), "", *losses(done), "", pairs(more)],
        writers=lambda: {
            COMPARED: text_of(csv_text(columns, digits=9)), files.SUMMARY: json_of(found),
            COMPARED_PICTURE: lambda path: plotting.save(conditions_picture(done), path),
            files.PAGE: text_of(lambda: comparison_page(found, done))})


def comparison_page(found: dict[str, Any], done: Sequence[Outcome]) -> str:
    """Return the page of a comparison."""
    lead = (f"{len(done)} runs: every task under every controller, by servos <code>{escape(found['servo'])}</code> of "
            f"every fidelity and by <code>{escape(found['bus_servo'])}</code>; then, by pulse servos, with wrong "
            "beliefs, load, a low battery and worn gears.")
    cost = ("controller", "motor voltage, rms", "commands go up and down by", "energy", "times better than plain")
    sections = [
        Section("When it gets hard", [
            Beside([COMPARED_PICTURE], "How far the tool is from where it should be, mean of all tasks, pulse servos."),
            Table(CONDITION_HEAD, condition_rows(done), "Tool behind, rms, mean of all tasks, pulse servos")]),
        Section("Where each loses", [f"{text}." for text in losses(done)]),
        Section("What it takes", [Table(cost, cost_rows(done, servos), f"Nominal, mean of all tasks, {servos} servos")
                                  for servos in ("pulse", "digital")])]
    sections += [Section(f"{robot}: {task}", [
        Table(("controller", *FIDELITIES), fidelity_rows(done, (robot, task), what), words)
        for what, words in (("tool_rms", "Tool behind, rms"), ("contour_rms", "Distance from the path, rms"))])
        for robot, task in tasks(done)]
    failed = [f"{' / '.join(each.case)}: {each.failure}" for each in done if each.failure]
    sections += [Section("What did not go", failed)] if failed else []
    return Report("Controllers of servos, compared", lead, [*sections, Section("", [Html(_READING)])],
                  style=_STYLE).page


_READING = """<section><h2>How to read this page</h2><ul>
<li><b>Behind</b>: how far the tool is from where it should be at the time, root mean square; <b>distance from the
path</b>: however late it is.</li>
<li><b>Fidelities.</b> Ideal torque: a motor gives what it is asked for, without friction or limit. Averaged: (35) to
(41) of the paper, no limit. Bounded: limit, deadband, stiction. Pulse: single pulses of the chip, and all that the file
gives. Digital: the bus servo. Plain commands, deadband compensation and (40) go through the servo's own loop; the
others drive the motor past the chip by encoders of 4096 counts, at the horns or at the motors.</li>
<li><b>Conditions.</b> 30 % wrong: controllers believe in 30 % more resistance and rotor inertia and in 30 % less
friction. With load: the tool carries twice what they know of. Low battery: four tired cells for all servos. Worn gears:
1° of play, which the play compensation knows.</li>
<li><b>Gains</b> follow from the servo's numbers by rule, not by hand.</li></ul></section>
"""


# --- The page of `servotwin robot validate`: HTML beside its pictures -------------------------------------------------

_BESIDE = 0.5  # s, that pictures show before and after a window


def errors_picture(found: RobotValidation) -> Figure:
    """Return the error of every joint by servos and rivals."""
    return plotting.ranking(list(found.joints), x_label="simulated less measured, rms (°)", values={
        name: [math.degrees(kinds[joint][ALL].rms) for joint in found.joints]
        for name, kinds in found.errors.items()})


def window_writers(found: RobotValidation) -> dict[str, Callable[[Path], object]]:
    """Return what draws the worst second of each joint, page by page, by the names of the files."""
    traces = []
    for window in found.windows:
        one = found.replays[window.replay]
        inside = (one.time >= window.start - _BESIDE) & (one.time <= window.stop + _BESIDE)
        goal = one.run.motion.angles.get(window.joint, np.full(len(one.time), math.nan))
        best = min((name for name in found.errors if name != SERVOS), key=found.rms)
        traces.append(plotting.ReplayTrace(
            f"{shortened(window.joint.replace('_', ' '))}: {degrees(window.rms)}° rms, {window.kind}", one.time[inside],
            goal[inside], one.measured[window.joint][inside],
            {name: one.simulated[name][window.joint][inside] for name in (SERVOS, best)}))
    return {name: partial(_save_windows, traces, page) for page, name in enumerate(
        joint_pages(WINDOWS, len(traces)), 1)}


def _save_windows(traces: Sequence[plotting.ReplayTrace], page: int, path: Path) -> None:
    plotting.save(plotting.replay_windows(traces, page=page), path)


def validation_result(found: RobotValidation, told: dict[str, Any]) -> files.RobotResult:
    """Return what is printed and written of a validation."""
    worst, titles, rows = found.windows[0], validation_head(found), validation_rows(found)
    late = ", ".join(f"{name} {1e3 * value:.0f} ms" for name, value in found.latency.items())
    first = [("goals act later by", late),
             ("worst second", f"{worst.joint}, {worst.start:.2f} s of {told['worst'][0]['episode']}, {worst.kind}: "
              f"{degrees(worst.rms)} deg rms"), *(("note", text) for text in told["notes"])]
    return files.RobotResult(
        facts=told, title=f"{told['robot']} beside {', '.join(told['episodes'][:3])}"
        f"{' ...' if len(told['episodes']) > 3 else ''}: simulated less measured joints, rms "
        f"{degrees(found.rms(SERVOS))} deg", lines=lambda more: [
            "", table(titles[:6], [row[:6] for row in rows]), "", "the same with other actuators, rms (deg)",
            table([titles[0], *titles[6:]], [[row[0], *row[6:]] for row in rows]), "", pairs([*first, *more])],
        writers=lambda: {files.SUMMARY: json_of(told), **validation_pictures(found),
                         files.PAGE: text_of(lambda: validation_page(found, told))})


def validation_pictures(found: RobotValidation) -> dict[str, Callable[[Path], object]]:
    """Return what draws the errors of all joints, and the worst second of each."""
    return {ERRORS: lambda path: plotting.save(errors_picture(found), path), **window_writers(found)}


def validation_page(found: RobotValidation, told: dict[str, Any]) -> str:
    """Return the page."""
    title = f"{told['robot']}: simulated beside measured"
    seconds = sum(one.run.motion.duration for one in found.replays)
    lead = (f"The goals of {len(found.replays)} episode{'s' * (len(found.replays) != 1)} ({seconds:.4g} s) went "
            f"through the robot with its servos ({', '.join(sorted(set(told['servos'].values())))}); its joints are "
            f"{degrees(found.rms())}° rms off the measured ones.")
    late = ", ".join(f"{name} {1e3 * value:.0f} ms" for name, value in found.latency.items())
    return Report(title, escape(lead), [
        Section("", [Cards([(f"{degrees(found.rms(name))}°", name) for name in found.errors])]),
        Section("Joint by joint", [
            Table(validation_head(found), validation_rows(found), "Simulated less measured angle, rms (°); at most: "
                  "the largest single one of the servos", kind="joints"), Beside([ERRORS], "The same, all samples.")]),
        Section("Where it is worst", [Beside(
            joint_pages(WINDOWS, len(found.windows)), "The second of each joint in which the servos are furthest off, "
            "the worst joint first; beside the best of the other actuators.")]),
        Section("When goals act", [f"Later than the positions of their row were read by: {late}; each is the one time "
                                   "of all joints at which it fits best.", Html(_READING_VALIDATION)])],
        told["notes"], STYLE).page


_READING_VALIDATION = """<section><h2>How to read this page</h2><ul>
<li><b>Moving</b>: goal or joint is faster than 4°/s; <b>resting</b>: neither is; <b>under load</b>: to hold or move the
joint as the goals say takes over a tenth of the torque that its servo has at standstill.</li>
<li><b>Ideal actuators</b> are exactly on the goals; <b>&lt;position&gt;</b> are MuJoCo's actuators, with numbers that
files for the SO-100 and SO-101 have: kp 998 (kv 2.7, damping 0.6, armature 0.028, 2.94 N m), kp 50 (damping 1, armature
0.005) and kp 17.8 (damping 0.6, armature 0.028, 3.35 N m).</li>
<li><b>Files.</b> <a href="summary.json">summary.json</a>: all numbers of this page, in SI units.</li></ul></section>
"""


# --- The files of an arm that has done a task -------------------------------------------------------------------------

TOOL_TABLE, TOOL_PICTURE, USE_PICTURE = "tool.csv", "tool.png", "redundancy.png"
TASK_RATE = 25.0  # pictures of a video a second
WAYS = ("redundancy", "limits left", "torque, rms", "way of the joints")
_LINE_STEP, _TRAIL_POINTS = 2e-3, 200  # m; points
_UP = 6e-4  # m, by which a trail lies above the path


def names(joints: int, *, ideal: bool, redundant: bool, picture: bool, video: bool) -> list[str]:
    """Return the names of all files of a task by an arm of `joints`; the page is the last."""
    servos = [] if ideal else [files.SERVOS, *files.servo_pictures(joints)]
    return [*servos, files.JOINTS, files.SUMMARY, TOOL_TABLE, TOOL_PICTURE, *([USE_PICTURE] if redundant else []),
            *files.drawn_names(picture=picture, video=video), files.PAGE]


def other_ways(arm: Arm, path: ToolPath, criterion: Criterion, joints: JointPath) -> dict[str, JointPath]:
    """Return how a redundant arm may move, without a criterion and with the one asked for, by name."""
    from servotwin.robots.arms.tasks import LeastMotion

    if not arm.redundant:
        return {}
    without = LeastMotion()
    return {without.name: joints if criterion.name == without.name else without.solve(arm, path)} | {
        criterion.name: joints}


# --- facts ------------------------------------------------------------------------------------------------------------


def task_facts(run: TaskRun, sized: Mapping[str, Sizing], ways: Ways, controller: str) -> dict[str, Any]:
    """Return the facts that matter of a task that servos have done, in SI, ready for JSON."""
    return facts(run.run, dict(sized), run.arm.name) | _of_task(ways) | {
        "controller": controller, "chips_bypassed": run.control_bypasses, "actuators": "servos",
        "task_metrics": run.metrics._asdict(),
        "ideal_contour": {"rms": run.ideal_contour.rms, "largest": run.ideal_contour.largest}}


def ideal_facts(done: IdealTask, ways: Ways) -> dict[str, Any]:
    """Return the facts that matter of a task that ideal actuators have done, in SI, ready for JSON."""
    return {"robot": ways.joints.arm.name, "motion": done.motion.source, "duration": done.motion.duration,
            **_of_task(ways), "actuators": "ideal",
            "ideal_contour": {"rms": done.contour.rms, "largest": done.contour.largest},
            "largest_torque": {joint: float(np.abs(values).max()) for joint, values in done.torque.items()}}


def _of_task(ways: Ways) -> dict[str, Any]:
    from servotwin.robots.arms.tasks import LeastMotion, LeastTorque

    return {"task": ways.joints.path.name, "redundant": ways.joints.arm.redundant, "ways": {
        name: {"limit_distance": way.limit_distance, "torque_rms": LeastTorque().measure(way),
               "length": LeastMotion().measure(way)} for name, way in ways.others.items()}}


def task_pairs(found: Mapping[str, Any]) -> list[tuple[str, str]]:
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


def task_result(run: TaskRun, sized: Mapping[str, Sizing], ways: Ways, names: Sequence[str], controller: str,
                output_step: float) -> files.RobotResult:
    """Return what is printed and written of a task that servos have done."""
    found, asked = task_facts(run, sized, ways, controller), ways.joints.path
    inside = run.moving
    time = run.run.time[inside]
    still = int(np.searchsorted(run.run.time, 0.85 * asked.duration))
    shown, tool = _line(asked), run.tool

    def trails(k: int) -> list[Trail]:
        return [shown, _trail(tool[inside & (run.run.time <= run.run.time[k])])]

    return _result(found, ways, lambda: {
        **files.run_writers(run.run, sized, names, found, output_step, task_sections(found, WAYS, way_rows(found)),
                            still),
        **_writers(asked, ways, [("servos", time, tool[inside], run.contour.error)], output_step)},
        lambda places: files.draw_run(places, run.run, None, TASK_RATE, trails, still))


def ideal_result(done: IdealTask, ways: Ways, names: Sequence[str], output_step: float) -> files.RobotResult:
    """Return what is printed and written of a task that ideal actuators have done."""
    found = ideal_facts(done, ways)
    trace = ("ideal actuators", done.time, done.tool, done.contour.error)
    return _result(found, ways, lambda: {
        **_writers(ways.joints.path, ways, [trace], output_step),
        files.JOINTS: text_of(lambda: _joint_table(done, ways.joints.arm, output_step)), files.SUMMARY: json_of(found),
        files.PAGE: text_of(lambda: ideal_page(found, names, WAYS, way_rows(found)))},
        lambda places: _draw_ideal(places, done, ways.joints))


def _result(found: dict[str, Any], ways: Ways, writers: Callable[[], Writers],
            draw: Callable[[Mapping[str, Path]], object]) -> files.RobotResult:
    path = ways.joints.path
    return files.RobotResult(
        facts=found, title=f"{found['robot']}: {path.name}, {path.duration:.4g} s", writers=writers, draw=draw,
        lines=lambda more: [pairs([*task_pairs(found), *more]),
                            *(["", table(WAYS, way_rows(found))] if found["redundant"] else [])])


def _writers(path: ToolPath, ways: Ways, traces: Sequence[tuple[str, Array, Array, Array]],
             output_step: float) -> dict[str, Callable[[Path], object]]:
    """Return the writers of what tool and joints did: label, times, places and errors of each trace."""
    from servotwin import plotting

    drawn = [plotting.ToolTrace(*trace) for trace in traces]
    made: dict[str, Callable[[Path], object]] = {
        TOOL_TABLE: text_of(lambda: _tool_table(path, drawn[0], output_step)),
        TOOL_PICTURE: lambda file: plotting.save(plotting.tool_paths(path.line, drawn), file)}
    if ways.others:
        made[USE_PICTURE] = lambda file: plotting.save(joint_uses(ways.others), file)
    return made


def joint_uses(ways: Mapping[str, JointPath]) -> Any:
    """Return the picture of how joints are used by each criterion: hinges alone."""
    from servotwin import plotting
    from servotwin.robots.arms.tasks import limits_of
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
    rows = slice(None, None, files.every(trace.time, output_step))
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

    rows, columns = slice(None, None, files.every(done.time, output_step)), {"time_s": done.time}
    for k, (joint, kind) in enumerate(joint_names(arm.model()).items()):
        unit, force = ("mm", "force_N") if kind == "length" else ("deg", "torque_Nm")
        columns[f"{joint}.ideal_{unit}"] = np.asarray(from_si(done.poses[:, k], unit, kind))
        columns[f"{joint}.needed_{force}"] = done.torque[joint]
    return csv_text({name: (values[rows] + 0.0).tolist() for name, values in columns.items()}, digits=9)


# --- drawing ----------------------------------------------------------------------------------------------------------


def _draw_ideal(places: Mapping[str, Path], done: IdealTask, joints: JointPath) -> None:
    """Draw the robot in the middle of its task, and all of it as a video."""
    from servotwin.robots.camera import Camera

    if files.PICTURE not in places:
        return
    shown = _line(joints.path)
    with Camera(joints.arm.model(), *files.SIZE, None, done.poses) as view:
        files.picture_and_video(
            lambda k: view.picture(done.poses[k], words=f"{done.time[k]:.2f} s", note="ideal actuators",
                                   trails=[shown, _trail(done.tool[:k + 1])]),
            done.time, 2 * len(done.time) // 3, places, TASK_RATE)


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


class Ways(NamedTuple):
    """How the joints of an arm may move for one path of its tool: as asked for, and by other criteria."""

    joints: JointPath
    others: Mapping[str, JointPath]
