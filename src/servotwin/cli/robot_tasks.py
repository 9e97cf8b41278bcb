"""`servotwin robot scara` and `two-link`: arms whose tool follows a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, usual, with_records
from servotwin.cli.robot_options import (
    ALL,
    Chosen,
    as_options,
    check_drawing,
    check_numbers,
    models_of,
    named_words,
    supply_of,
)
from servotwin.cli.terminal import patience
from servotwin.errors import UnknownNameError

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.robots import WaypointRun
    from servotwin.robots.arms.arm import Arm
    from servotwin.robots.arms.task_run import Comparison, Outcome
    from servotwin.robots.arms.tasks import Criterion, ToolPath


# --- `servotwin robot mobile`: the robot on wheels drives along waypoints, by odometry --------------------------------

_DRIVE, _WHEELS = "Waypoints", "Robot and servos"


@usual("task", "waypoints", "speed", "servo", "unequal", "encoders", "out", "video", "force", "json")
@with_records
def mobile(
    *,
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
    ending: shared.Ending,
) -> None:
    """Let the mobile robot drive along waypoints."""
    from servotwin.cli import robot_report as files
    from servotwin.cli import robot_task_report as written
    from servotwin.robots import robot_model

    check_numbers(output_step=output_step, rate=written.MOBILE_RATE, blend=None)
    corners = written.points_of(waypoints, task, size)
    servos = _servos(servo, unequal=unequal)
    picture = not ideal and check_drawing(robot_model("mobile"), None, video=video)
    names = [*([] if ideal else [files.SERVOS]), written.PATH_TABLE, files.SUMMARY, written.PATHS,
             *files.drawn_names(picture=picture, video=video and picture), files.PAGE]

    def drive() -> files.RobotResult:
        with as_options():
            run = _run(corners, servos, _wheel(servo), speed, lookahead, encoders, supply, ideal=ideal)
        found = written.mobile_facts(run, servo, encoders, unequal=unequal, ideal=ideal)
        return written.mobile_result(run, found, names, output_step)

    files.carried_out(drive, out, names, force=ending.force, as_json=ending.as_json)


def _servos(servo: str, *, unequal: bool) -> tuple[Model, Model]:
    from servotwin.robots import unequal_servos

    return unequal_servos(servo) if unequal else (_wheel(servo),) * 2


def _wheel(servo: str) -> Model:
    from servotwin.robots import wheel_servo

    return wheel_servo(servo)


def _run(corners: Any, servos: Sequence[Model], nominal: Model, speed: float, lookahead: float, encoders: int | None,
         supply: str | None, *, ideal: bool) -> WaypointRun:
    from servotwin.robots import ideal_waypoints, run_waypoints

    if ideal:
        return ideal_waypoints(corners, speed=speed, lookahead=lookahead)
    return run_waypoints(servos, corners, encoders=encoders, nominal=nominal, speed=speed, lookahead=lookahead,
                         bus=supply_of(supply), progress=True)


# --- `servotwin robot scara` and `two-link`: arms whose tool follows a path -------------------------------------------

_TASK, _ARM = "Task", "Arm and servos"
_SERVO = "hitec-hs-755hb"

SpeedOption = Annotated[float, typer.Option(
    metavar="M/S", help="Of the tool along its path.", rich_help_panel=_TASK)]
OutOption = Annotated[Path, typer.Option(
    metavar="FOLDER", help="Folder for tables, pictures, video and page.", rich_help_panel=shared.OUTPUT)]


@dataclass(frozen=True, kw_only=True)
class Asked:
    """The options that say what an arm does, and with which servos, as they were typed."""

    out: OutOption
    task: Annotated[str, typer.Option(
        metavar="TASK", help="What the tool does: circle, square or pick-and-place.", rich_help_panel=_TASK)] = "circle"
    size: Annotated[str | None, typer.Option(
        metavar="LENGTH", help="Radius of the circle, half of the side of the square, half of the way over, such as "
        "40mm (default).", rich_help_panel=_TASK)] = None
    speed: SpeedOption = 0.08
    servo: Annotated[Sequence[str], typer.Option(
        metavar="[JOINT=]ID", help=f"Servo of all joints, or of one; repeatable: catalog id, or path of a servo file "
        f"(default: {_SERVO}).", rich_help_panel=_ARM)] = ()
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="digital, pulse, pulse-inductive, bounded or averaged (default: by the kind of each "
        "servo).", rich_help_panel=_ARM)] = None
    controller: Annotated[str, typer.Option(
        metavar="NAME", help="What commands the servos: plain, feedforward, pid, computed-torque or "
        "observer; the last three bypass the chips.", rich_help_panel=_ARM)] = "plain"
    redundancy: Annotated[str, typer.Option(
        metavar="CRITERION", help="What the third link is used for: none (joints move little), limits (far from the "
        "joints' limits) or torque (little torque).", rich_help_panel=_ARM)] = "none"
    payload: Annotated[str | None, typer.Option(
        metavar="MASS", help="That the tool carries, such as 100g (default: none).", rich_help_panel=_ARM)] = None
    ideal: Annotated[bool, typer.Option(
        "--ideal", help="With ideal actuators instead of servos.", rich_help_panel=_ARM)] = False
    supply: Annotated[str | None, typer.Option(
        metavar=shared.SUPPLY_FORM, help=f"Supply that all servos share: {shared.SUPPLY_HELP} (default: each its own).",
        rich_help_panel=_ARM)] = None
    change: Annotated[Sequence[str], typer.Option(
        "--set", metavar="GROUP.NAME=VALUE", help="Change a parameter of all servos; repeatable; with a unit, or in SI "
        "units.", rich_help_panel=_ARM)] = ()
    output_step: Annotated[float, typer.Option(
        metavar="SECONDS", help="Time between rows of the tables.", rich_help_panel=shared.OUTPUT)] = 0.01
    video: Annotated[bool, typer.Option(
        "--video/--no-video", help="Draw a video.", rich_help_panel=shared.OUTPUT)] = True
    force: shared.ForceOption = False
    as_json: shared.JsonOption = False


@usual("task", "servo", "controller", "third-link", "redundancy", "out", "force", "json")
@with_records
def scara(
    *, asked: Asked,
    third_link: Annotated[bool, typer.Option(
        "--third-link/--no-third-link", help="With the third link, which makes it redundant.",
        rich_help_panel=_ARM)] = True,
) -> None:
    """Let the SCARA robot do a task."""
    from servotwin.robots import scara as made

    with as_options():
        arm = made(third_link=third_link, payload=mass(asked.payload))
    _do(arm, asked)


@usual("task", "size", "servo", "controller", "payload", "supply", "out", "video", "force", "json")
@with_records
def two_link(*, asked: Annotated[Asked, {"redundancy": LEFT_OUT}]) -> None:
    """Let the two-link arm do a task."""
    from servotwin.robots import two_link as made

    with as_options():
        arm = made(payload=mass(asked.payload))
    _do(arm, asked)


def add_to(robot: typer.Typer) -> None:
    """Add the commands of this module to `servotwin robot`."""
    robot.command("scara", help="Let the paper's SCARA robot, redundant or not, do a task: contour error, joints, "
                  "currents, sag, heat, video.", epilog=(
        "Example: servotwin robot scara --task circle --out circle\n\n"
        "Example: servotwin robot scara --task square --redundancy torque --supply 6V:0.1ohm --out square\n\n"
        "Example: servotwin robot scara --no-third-link --ideal --out ideal"))(scara)
    robot.command("two-link", help="Let an arm of two links in a vertical plane do a task.", epilog=(
        "Example: servotwin robot two-link --task square --payload 50g --out square"))(two_link)


def _do(arm: Arm, asked: Asked) -> None:
    """Do a task, write its files and tell of it."""
    from servotwin.cli import robot_report as files
    from servotwin.cli import robot_task_report as written
    from servotwin.robots import sizing_of
    from servotwin.robots.arms.controllers import STEERINGS
    from servotwin.robots.arms.task_run import ideal_task, run_task

    check_numbers(output_step=asked.output_step, rate=written.TASK_RATE, blend=None)
    if asked.controller not in STEERINGS:
        raise UnknownNameError("controller", asked.controller, STEERINGS)
    criterion, steering = _criterion(arm, asked.redundancy), STEERINGS[asked.controller]()
    path = path_of(arm, asked.task, asked.size, asked.speed)
    models = _models(arm, asked)
    picture = check_drawing(arm.model(), None, video=asked.video)
    names = written.names(len(arm.joints), ideal=asked.ideal, redundant=arm.redundant, picture=picture,
                          video=asked.video)

    def do() -> files.RobotResult:
        with patience("inverse kinematics"):
            joints = criterion.solve(arm, path)
            ways = written.Ways(joints, written.other_ways(arm, path, criterion, joints))
        if asked.ideal:
            return written.ideal_result(ideal_task(joints), ways, names, asked.output_step)
        with as_options(), patience("following the path"):
            run = run_task(arm, models, path, steering=steering, bus=supply_of(asked.supply), assume_heat=True,
                           joint_path=joints)
            sized = sizing_of(run.run)
        return written.task_result(run, sized, ways, names, asked.controller, asked.output_step)

    files.carried_out(do, asked.out, names, force=asked.force, as_json=asked.as_json)


def path_of(arm: Arm, task: str, size: str | None, speed: float) -> ToolPath:
    """Return the path of a task, of the words of its options."""
    from servotwin.robots.arms.tasks import task_path
    from servotwin.units.quantities import quantity

    length = None if size is None else quantity("--size", size, "length", bare=True, positive=True)
    with as_options():
        return task_path(arm, task, speed=speed, size=length)


def _criterion(arm: Arm, name: str) -> Criterion:
    from servotwin.robots.arms.tasks import CRITERIA, LeastMotion, check_redundant

    known = {one.name: one for one in CRITERIA}
    if name not in known:
        raise UnknownNameError("redundancy", name, known)
    if not isinstance(known[name], LeastMotion):
        check_redundant(arm, name)
    return known[name]


def _models(arm: Arm, asked: Asked) -> dict[str, Model]:
    words = [word if "=" in word else f"{ALL}={word}" for word in asked.servo]
    chosen = dict(named_words("--servo", words, "ID or JOINT=ID", dict.fromkeys(arm.joints, "angle")))
    each = {joint: Chosen(chosen.get(joint, chosen.get(ALL, _SERVO))) for joint in arm.joints}
    return models_of(each, asked.model, asked.change, [])


def mass(text: str | None) -> float:
    """Return the payload of an option [kg]."""
    from servotwin.units.quantities import quantity

    return 0.0 if text is None else quantity("--payload", text, "mass", bare=True)


# --- `servotwin robot compare` ----------------------------------------------------------------------------------------

_WHAT = "What to compare"


@with_records
def compare(
    *, out: OutOption,
    robot: Annotated[list[str] | None, typer.Option(
        metavar="ROBOT", help="scara or two-link; repeatable (default: both).", rich_help_panel=_WHAT)] = None,
    task: Annotated[list[str] | None, typer.Option(
        metavar="TASK", help="circle, square or pick-and-place; repeatable (default: all that a robot has).",
        rich_help_panel=_WHAT)] = None,
    speed: SpeedOption = 0.08,
    servo: Annotated[str, typer.Option(
        metavar="ID", help="Analog servo of all joints: catalog id, or path of a servo file.",
        rich_help_panel=_WHAT)] = "hitec-hs-755hb",
    bus_servo: Annotated[str, typer.Option(
        metavar="ID", help="Digital servo that it is compared with.", rich_help_panel=_WHAT)] = "feetech-sts3215-12v",
    ending: shared.Ending,
) -> None:
    """Compare controllers on all tasks by all fidelities, and when it gets hard."""
    from servotwin.cli import robot_report as files
    from servotwin.cli import robot_task_report as words
    from servotwin.cli.shared_options import servo_of
    from servotwin.robots.arms.task_run import Comparison

    chosen = _cases(robot, task)
    comparison = Comparison(servo=servo_of(servo, []), bus_servo=servo_of(bus_servo, []), speed=speed)

    def do() -> files.RobotResult:
        done = _outcomes(comparison, chosen, quiet=ending.as_json)
        return words.comparison_result(words.comparison_facts(comparison, done), done)

    files.carried_out(do, out, [words.COMPARED, files.SUMMARY, words.COMPARED_PICTURE, files.PAGE], force=ending.force,
                      as_json=ending.as_json)


def _cases(robots: list[str] | None, tasks: list[str] | None) -> list[Any]:
    from servotwin.robots.arms import task_run

    for name in robots or []:
        if name not in task_run.ROBOTS:
            raise UnknownNameError("robot to compare on", name, task_run.ROBOTS)
    known = {task for each in task_run.TASKS.values() for task in each}
    for name in tasks or []:
        if name not in known:
            raise UnknownNameError("task to compare", name, sorted(known))
    chosen = list(task_run.cases(robots or tuple(task_run.ROBOTS), tasks))
    if not chosen:
        raise UnknownNameError("task of these robots", ", ".join(tasks or []),
                               [task for name in robots or task_run.ROBOTS for task in task_run.TASKS[name]])
    return chosen


def _outcomes(comparison: Comparison, chosen: Sequence[Any], *, quiet: bool) -> list[Outcome]:
    """Do all cases; the path of the joints is found once a task."""
    from servotwin.simulation.progress import shown

    paths: dict[tuple[str, str], Any] = {}
    done = []
    with shown(not quiet, len(chosen), "doing tasks") as tell:
        for case in chosen:
            key = (case.robot, case.task)
            if key not in paths:
                with as_options():
                    paths[key] = comparison.joints(case)
            done.append(comparison.outcome(case, paths[key]))
            tell(len(done))
    return done
