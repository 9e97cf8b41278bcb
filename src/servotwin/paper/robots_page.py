"""The robots of Figures 28 to 30, each at one short task: pictures, tables and words for the report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from servotwin import plotting
from servotwin.errors import MissingExtraError
from servotwin.look import fixed, number, table
from servotwin.models import PulseServo
from servotwin.paper.figures import Drawing, Picture
from servotwin.paper.study import SERVO
from servotwin.parameters import load_servo

if TYPE_CHECKING:
    from servotwin.parameters import Servo
    from servotwin.robots import TaskRun, WaypointRun

FIGURES = "<!-- figures -->"
_SIZE, _SPEED = 0.04, 0.12  # m and m/s: a small circle, so that it is short
_ROUTE = ((0.0, 0.0), (0.35, 0.0), (0.35, 0.35))  # m
_COUNTS = 512  # of an encoder on a wheel
_ARMS = {"figure-28": "Figure 28: redundant SCARA robot", "figure-29": "Figure 29: SCARA robot"}
_WORDS = {"plain": "plain commands", "feedforward": "(40) as feedforward"}


@dataclass(frozen=True, kw_only=True)
class Robots:
    """What the three robots did.

    Parameters
    ----------
    arms : mapping of str to mapping of str to TaskRun
        By the name of the figure and that of the controller.
    torques : mapping of str to float
        Largest torque that the circle takes of a vertical joint of the redundant arm, by criterion [N m].
    drives : mapping of str to WaypointRun
        Of the mobile robot: on equal servos, and on unequal ones with and without encoders.
    """

    arms: Mapping[str, Mapping[str, TaskRun]]
    torques: Mapping[str, float]
    drives: Mapping[str, WaypointRun]


@dataclass(frozen=True, kw_only=True)
class RobotsPart:
    """What the report has of the robots: pictures, tables and words, headline numbers, and why they are left out."""

    drawings: tuple[Drawing, ...]
    words: str  # HTML; FIGURES where the pictures belong
    headline: Mapping[str, float]
    left_out: str


def robots_part(formats: Sequence[str]) -> RobotsPart:
    """Let the robots do their tasks, and draw what they did."""
    robots = run_robots(load_servo(SERVO))
    return RobotsPart(drawings=tuple(picture.drawn(formats) for picture in pictures(robots)),
                      words=section(robots), headline=headline(robots),
                      left_out=robots if isinstance(robots, str) else "")


def run_robots(servo: Servo) -> Robots | str:
    """Let the three robots do their tasks; where an extra is missing, return what to say."""
    try:
        return _done(servo)
    except MissingExtraError as error:
        return str(error)


def _done(servo: Servo) -> Robots:
    from servotwin.robots import (
        LeastMotion,
        LeastTorque,
        follow,
        ideal_task,
        run_task,
        run_waypoints,
        scara,
        task_path,
        unequal_servos,
    )
    from servotwin.robots.controllers import STEERINGS

    model, arms = PulseServo(servo), {}
    for name, third_link in (("figure-28", True), ("figure-29", False)):
        arm = scara(third_link=third_link)
        joints = follow(arm, task_path(arm, "circle", size=_SIZE, speed=_SPEED))
        arms[name] = {controller: run_task(arm, model, joints.path, steering=STEERINGS[controller](),
                                           joint_path=joints) for controller in _WORDS}
    arm = arms["figure-28"]["plain"].arm
    path, torques = task_path(arm, "circle", size=_SIZE, speed=_SPEED), {}
    for criterion in (LeastMotion(), LeastTorque()):
        taken = ideal_task(criterion.solve(arm, path)).torque
        torques[criterion.name] = float(max(np.abs(taken[joint]).max() for joint in ("shoulder", "elbow", "third")))
    worn = unequal_servos()
    drives = {"equal servos, odometry of pulses": run_waypoints(waypoints=_ROUTE),
              "unequal servos, odometry of pulses": run_waypoints(worn, _ROUTE),
              "unequal servos, encoders": run_waypoints(worn, _ROUTE, encoders=_COUNTS)}
    return Robots(arms=arms, torques=torques, drives=drives)


def pictures(robots: Robots | str) -> tuple[Picture, ...]:
    """Return the pictures of the robots' ways; none where an extra is missing."""
    if isinstance(robots, str):
        return ()
    drives = [plotting.PathTrace(words, run.path, run.believed) for words, run in robots.drives.items()]
    columns = {f"{name}_{axis}_m": side[:, k].tolist()
               for words, run in zip(("equal", "unequal", "encoders"), robots.drives.values(), strict=True)
               for name, side in ((words, run.path), (f"{words}_believed", run.believed))
               for k, axis in enumerate("xy")}
    longest = max(len(column) for column in columns.values())
    padded = {name: column + [math.nan] * (longest - len(column)) for name, column in columns.items()}
    return (*(_arm(name, title, robots.arms[name]) for name, title in _ARMS.items()),
            Picture(name="figure-30", title="Figure 30: mobile robot", columns=padded,
                    caption="The paper's Figure 30 is a photograph of its mobile robot. Here one drives along three "
                    "points on two HS-755HB that turn endlessly.", figure=plotting.robot_paths(drives, _ROUTE)))


def _arm(name: str, title: str, runs: Mapping[str, TaskRun]) -> Picture:
    traces: list[plotting.ToolTrace] = []
    columns: dict[str, list[float]] = {}
    for controller, run in runs.items():
        time, places = run.run.time[run.moving], run.tool[run.moving]
        traces.append(plotting.ToolTrace(_WORDS[controller], time, places, run.contour.error))
        columns |= {f"{controller}_{axis}_m": places[:, k].tolist() for k, axis in enumerate("xyz")}
        columns |= {f"{controller}_distance_m": run.contour.error.tolist()}
    first = next(iter(runs.values()))
    columns = {"time_s": first.run.time[first.moving].tolist()} | columns
    links = "three" if name == "figure-28" else "two"
    return Picture(name=name, title=title, columns=columns, figure=plotting.tool_paths(first.path.path.line, traces),
                   caption=f"The paper's {title.partition(':')[0]} is a photograph. Here a SCARA robot of {links} "
                   f"links draws a circle of {number(1e3 * _SIZE)} mm with an HS-755HB at each joint: the tool's path, "
                   "and its distance from the circle.")


def section(robots: Robots | str) -> str:
    """Return the words and tables, and FIGURES where the pictures belong."""
    if isinstance(robots, str):
        return f'<div class="note"><p>The robots are left out. {robots}</p></div>\n'
    least, most = robots.torques["torque"], robots.torques["none"]
    return f"""<p>The model is to serve “the development of control techniques for SCARA type robots with and without
link redundancy, … mobile robots, etc.” (§VII). The paper shows three of them and no dimensions: those here are assumed,
made for the servo <code>hitec-hs-755hb</code> and simulated with its pulses at every joint.</p>
<div class="figures">{FIGURES}</div>
{_arms(robots)}
<p>With the third link the arm may choose its posture. The one in which the circle takes the least torque needs
{number(least, 2)} N m at most of its vertical axes; without a criterion it is {number(most, 2)} N m.</p>
{_drives(robots)}
<p>The wheels of a mobile robot turn without end: the potentiometer stands still, the pulse sets a speed, and a neutral
that is off is a speed that is off. Odometry from the pulses sent does not see that; encoders do.</p>
"""


def _arms(robots: Robots) -> str:
    rows = [[title.partition(": ")[2], _WORDS[controller], fixed(1e3 * run.metrics.contour_rms, 2),
             fixed(1e3 * run.metrics.contour_largest, 2), fixed(1e3 * run.metrics.tool_rms, 1),
             fixed(run.metrics.energy, 1)]
            for name, title in _ARMS.items() for controller, run in robots.arms[name].items()]
    return table(("robot", "controller", "distance from the circle, rms (mm)", "largest (mm)",
                  "behind its time, rms (mm)", "energy (J)"), rows, text_columns=2,
                 caption=f"A circle of {number(1e3 * _SIZE)} mm at {number(_SPEED)} m/s, pulse servos")


def _drives(robots: Robots) -> str:
    rows = [[words, fixed(1e3 * run.missed, 0), fixed(1e3 * float(run.off_belief[-1]), 0)]
            for words, run in robots.drives.items()]
    return table(("mobile robot", "misses the last point by (mm)", "believes to be elsewhere by (mm)"), rows,
                 caption="Three points, 0.7 m")


def headline(robots: Robots | str) -> dict[str, float]:
    """Return the numbers that count."""
    if isinstance(robots, str):
        return {}
    found = {f"{name.replace('-', '_')}_{controller}_contour_rms_mm": 1e3 * run.metrics.contour_rms
             for name, runs in robots.arms.items() for controller, run in runs.items()}
    return found | {"figure_30_unequal_missed_mm": 1e3 * robots.drives["unequal servos, odometry of pulses"].missed}
