"""`servotwin robot`: robots whose joints are servos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_options as options
from servotwin.cli import shared_options as shared
from servotwin.cli.option_records import LEFT_OUT, Commands, usual, with_records
from servotwin.cli.robot_options import (
    ERRORS,
    PAGE,
    SUMMARY,
    WINDOWS,
    as_options,
    check_drawing,
    check_numbers,
    overlap_of,
    packages_of,
    servos_at,
    units_of,
)
from servotwin.cli.robot_tasks import add_to, compare, mobile
from servotwin.cli.terminal import emit_help, pairs, patience, table
from servotwin.text import file_stems

if TYPE_CHECKING:
    from rich.console import RenderableType

    from servotwin.cli.robot_report import RobotResult
    from servotwin.identification.arms import ArmFit
    from servotwin.robots import Motion, RobotRun, RobotValidation, Sizing


# --- `servotwin robot validate`: how far a simulated robot is from the real one ---------------------------------------


DatasetArgument = Annotated[Path, typer.Argument(
    metavar="DATASET", help="Folder of a LeRobot dataset, or CSV file with a time and an action and a state of each "
    "joint (action.elbow_deg, state.elbow_deg).")]
OutOption = Annotated[Path | None, typer.Option(
    metavar="FOLDER", help="Folder for page, pictures and numbers (default: none).", rich_help_panel=shared.OUTPUT)]


@usual("servo", "calibration", "episode", "unit", "out", "force", "json")
@with_records
def validate(
    *, model_file: options.ModelArgument, dataset: DatasetArgument, servos: options.Servos,
    friction: options.FrictionOption = "refuse", recorded: options.Recorded,
    latency: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Between the reading of positions and when the goal of the same row acts (default: "
        "the one that fits best).", rich_help_panel=options.MOTION)] = None,
    timestep: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Of MuJoCo (default: that of the model).", rich_help_panel=shared.OUTPUT)] = None,
    out: OutOption = None, ending: shared.Ending,
) -> None:
    """Replay recorded goals, and compare with the measured joints."""
    from servotwin.cli import robot_report as files
    from servotwin.cli.robot_task_report import validation_result
    from servotwin.robots import validate_robot
    from servotwin.robots.replay import measured_joints

    asked = options.asked_robot(model_file, dataset, servos, recorded)

    def compared() -> files.RobotResult:
        with as_options():
            found = validate_robot(asked.plant, asked.mounts, asked.motions, bus=asked.bus, joint_friction=friction,
                                   timestep=timestep, latency=latency, progress=True)
        return validation_result(found, facts(found, model_file, asked.said))

    windows = files.joint_pages(WINDOWS, len(measured_joints(asked.mounts, asked.motions)))
    files.carried_out(compared, out, [SUMMARY, ERRORS, *windows, PAGE], force=ending.force, as_json=ending.as_json,
                      inputs=[dataset])


def facts(found: RobotValidation, robot: str, said: Sequence[str]) -> dict[str, Any]:
    """Return all of it as plain numbers in SI units."""
    return {
        "robot": robot, "episodes": [one.run.motion.source for one in found.replays],
        "servos": {joint: mount.model.servo.name for joint, mount in found.replays[0].run.mounts.items()},
        "latency": dict(found.latency), "rms": {name: found.rms(name) for name in found.errors},
        "errors": {name: {joint: {kind: error._asdict() for kind, error in kinds.items()}
                          for joint, kinds in joints.items()} for name, joints in found.errors.items()},
        "worst": [{**window._asdict(), "episode": found.replays[window.replay].run.motion.source}
                  for window in found.windows],
        "notes": list(dict.fromkeys((*said, *found.said)))}


# --- `servotwin robot fit`: servos, supply, links, zeros and latency of a robot from its episodes ---------------------

_FIT = "Fit"


@usual("servo", "calibration", "episode", "unit", "out", "force", "json")
@with_records
def fit(
    *, model_file: options.ModelArgument, logs: DatasetArgument, servos: options.Servos, recorded: options.Recorded,
    each: Annotated[bool, typer.Option("--each", help="Fit every servo by itself (default: one for all that are "
                                       "equal).", rich_help_panel=_FIT)] = False,
    masses: Annotated[float, typer.Option(metavar="SHARE", help="How far the masses of the robot's file may be off, as "
                                          "a standard deviation; 0: they are right.", rich_help_panel=_FIT)] = 0.1,
    holdout: Annotated[int | None, typer.Option(metavar="COUNT", help="Episodes, the last ones, that are not fitted "
                                                "but predicted (default: a fourth, at least one of two).",
                                                rich_help_panel=_FIT)] = None,
    intervals: Annotated[bool, typer.Option("--intervals/--no-intervals", help="Without them it is a first result in a "
                                            "third of the time.", rich_help_panel=_FIT)] = True,
    diagnose: Annotated[bool, typer.Option("--trials/--no-trials", help="Whether causes are sought where a belief "
                                           "is pushed far.", rich_help_panel=_FIT)] = True,
    within: Annotated[str | None, typer.Option(metavar="DURATION", help="Stop after this time, such as 90s or 5min, "
                                               "and keep the best so far, as Ctrl-C does.",
                                               rich_help_panel=_FIT)] = None,
    out: OutOption = None, ending: shared.Ending,
) -> None:
    """Fit the servos of a robot."""
    from servotwin.cli import robot_report as files
    from servotwin.cli.fit_report import duration
    from servotwin.cli.shared_options import best_kept, end_if_stopped
    from servotwin.identification.arms import identify_arm
    from servotwin.identification.arms.identify_arm import UNKNOWN, mounts_of, plant_of
    from servotwin.robots.motion import joints_of_dataset

    limit = duration("--within", within)
    plant, unknown = plant_of(UNKNOWN, joints_of_dataset(logs)) if model_file == UNKNOWN else (None, ())
    asked = options.asked_robot(model_file, logs, servos, recorded, plant)

    def fitted() -> files.RobotResult:
        with as_options(), best_kept(shown=not ending.as_json) as progress:
            found = identify_arm(asked.motions, UNKNOWN if unknown else asked.plant, asked.mounts, bus=asked.bus,
                                 each=each, masses=masses, holdout=holdout, intervals=intervals, diagnose=diagnose,
                                 within=limit, progress=progress)
        told = {"robot": model_file, "episodes": [one.source for one in asked.motions], **found.facts()}
        told["warnings"] = [*asked.said, *told["warnings"]]
        return _fit_result(found, told, stems)

    with as_options():  # of the servos at recorded joints, the only ones that are fitted
        stems = file_stems(mounts_of(asked.mounts, model_file, asked.plant, asked.motions)[0])
    names = [*(f"{stem}.toml" for stem in stems.values()), SUMMARY, ERRORS,
             *files.joint_pages(WINDOWS, len(stems)), PAGE]
    result = files.carried_out(fitted, out, names, force=ending.force, as_json=ending.as_json, inputs=[logs])
    end_if_stopped(result.fit, timed=within is not None)


def _fit_result(found: ArmFit, told: dict[str, Any], stems: dict[str, str]) -> RobotResult:
    from servotwin.cli.output_files import Writers, json_of, text_of
    from servotwin.cli.robot_report import RobotResult, joint_pages
    from servotwin.cli.robot_task_report import validation_pictures
    from servotwin.identification.report.page import arm_page, error_rows, estimate_rows
    from servotwin.look.reports import Beside

    judged = found.holdout or found.training
    pictures = [Beside([ERRORS], "The same beside ideal actuators."), Beside(
        joint_pages(WINDOWS, len(judged.windows)), "The second of each joint in which the fitted servos are furthest "
        "off, the worst joint first.")]
    said = [*map(str, found.unidentifiable), *map(str, found.left_out), *told["warnings"]]

    def writers() -> Writers:
        return {**{f"{stems[joint]}.toml": partial(servo.save, overwrite=True)
                   for joint, servo in found.servos.items()}, SUMMARY: json_of(told), **validation_pictures(judged),
                PAGE: text_of(lambda: arm_page(found, pictures))}

    return RobotResult(
        facts=told, title=f"{told['robot']}: {told['sentence']}", writers=writers, fit=found, lines=lambda more: [
            *(f"! {cause.sentence}" for cause in found.causes), "", "simulated less measured, rms (deg)",
            table(*error_rows(found)), "",
            table(("number", "value", f"{100 * found.level:g} % interval", "known"), estimate_rows(found)), "",
            pairs([*(("note", text) for text in said), *more])])


# --- `servotwin robot`: robots whose joints are servos ----------------------------------------------------------------

_MOST_NOTES = 6  # that are printed


robot = Commands(
    help="Let a robot with servos at its joints follow a motion.",
    epilog="Example: servotwin robot run so101 --motion wave.csv --out wave")


@robot.callback(invoke_without_command=True)
def _robot(context: typer.Context) -> None:
    """Show the help where nothing is asked."""
    if context.invoked_subcommand is None:
        emit_help(context)


@robot.command("run", help="Let a robot follow a motion: tracking, currents, sag, heat, video, and whether its servos "
               "are big enough.", epilog=(
    "Example: servotwin robot run arm.xml --servo shoulder=hitec-hs-755hb --servo elbow=towerpro-mg996r "
    "--mount '*=-90deg' --motion wave.csv --out wave\n\n"
    "Example: servotwin robot run so101 --motion lerobot/svla_so101_pickplace --episode 3 --unit range "
    "--calibration follower.json --supply 12V:0.1ohm --out pick"))
@usual("motion", "servo", "out", "video", "force", "json")
@with_records
def run(
    *,
    model_file: options.ModelArgument,
    motion: Annotated[Path, typer.Option(
        metavar="FILE", help="CSV file with a column time_s and one of each joint that moves (elbow_deg, elbow_rad, "
        "slider_mm), or the folder of a LeRobot dataset.", rich_help_panel=options.MOTION)],
    out: Annotated[Path, typer.Option(
        metavar="FOLDER", help="Folder for tables, pictures, video and page.", rich_help_panel=shared.OUTPUT)],
    servos: options.Servos,
    friction: options.FrictionOption = "refuse", contact: options.ContactOption = None,
    episode: Annotated[int | None, typer.Option(
        metavar="NUMBER", help="Episode of the dataset (default: its first).", rich_help_panel=options.MOTION)] = None,
    recorded: Annotated[options.Recorded, {"episode": LEFT_OUT}],
    hold: Annotated[str | None, typer.Option(
        metavar="HOW", help="What servos are told between samples: linear (default of tables) or previous (default of "
        "datasets, as LeRobot sends them).", rich_help_panel=options.MOTION)] = None,
    blend: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Over which ideal actuators round the corners of the motion (default: two samples, "
        "0.05 to 0.1 s).", rich_help_panel=options.MOTION)] = None,
    settle: Annotated[float, typer.Option(
        metavar="SECONDS", help="For which the robot holds its first goal before the motion, and its last one after "
        "it.", rich_help_panel=options.MOTION)] = 0.5,
    timestep: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Of MuJoCo (default: that of the model).", rich_help_panel=shared.OUTPUT)] = None,
    output_step: Annotated[float, typer.Option(
        metavar="SECONDS", help="Time between rows of the tables.", rich_help_panel=shared.OUTPUT)] = 0.01,
    video: Annotated[bool, typer.Option(
        "--video/--no-video", help="Draw a video.", rich_help_panel=shared.OUTPUT)] = True,
    camera: Annotated[str | None, typer.Option(
        metavar="NAME", help="Camera of the model (default: one that sees all of the motion).",
        rich_help_panel=shared.OUTPUT)] = None,
    rate: Annotated[float, typer.Option(
        "--fps", metavar="HZ", help="Pictures of the video a second.", rich_help_panel=shared.OUTPUT)] = 25.0,
    ending: shared.Ending,
) -> None:
    """Let a robot follow a motion, and say whether its servos are big enough."""
    from servotwin.cli import robot_report as files
    from servotwin.cli.robot_report import run_facts as facts
    from servotwin.robots import joint_names, joint_ranges, run_motion, sizing_of
    from servotwin.robots.model_file import plant_of
    from servotwin.robots.motion import is_dataset

    check_numbers(output_step=output_step, rate=rate, blend=blend)
    plant, overlap = plant_of(model_file, packages_of(servos.package)), overlap_of(contact)
    joints = joint_names(plant.model)
    with as_options():
        followed = _read(motion, joints, joint_ranges(plant.model), unit=units_of(recorded.unit),
                         calibration=recorded.calibration, episode=episode)
    chosen, left = servos_at(model_file, servos.servo, plant, followed)
    mounts = servos.mounts(chosen, joints)
    if servos.register:  # who says registers does not have them assumed
        followed = replace(followed, robot="")
    picture = check_drawing(plant.model, camera, video=video)
    inputs = [Path(model_file), motion, *([] if recorded.calibration is None else [recorded.calibration])]
    names = files.run_names(len(mounts), picture=picture, video=video)

    def follow() -> files.RobotResult:
        with as_options():
            done = run_motion(plant, mounts, followed, bus=servos.bus, joint_friction=friction, timestep=timestep,
                              settle=settle, hold=hold or ("previous" if is_dataset(motion) else "linear"),
                              window=blend, overlap=overlap, progress=True)
            done = replace(done, said=(*done.said, *left))
            sized = sizing_of(done)
        found = facts(done, sized, model_file)
        return files.RobotResult(
            facts=found, title=f"{found['robot']} follows {done.motion.source}, {done.motion.duration:.4g} s",
            lines=lambda more: _lines(done, sized, found, more),
            writers=lambda: files.run_writers(done, sized, names, found, output_step),
            draw=lambda places: files.draw_run(places, done, camera, rate))

    files.carried_out(follow, out, names, force=ending.force, as_json=ending.as_json, inputs=inputs)


def _read(path: Path, joints: dict[str, str], ranges: dict[str, tuple[float, float]], **options: Any) -> Motion:
    from servotwin.robots import read_motion

    with patience(f"reading {path}"):
        return read_motion(path, joints, ranges=ranges, **options)


def _lines(done: RobotRun, sized: dict[str, Sizing], found: dict[str, Any],
           more: Sequence[tuple[str, str]]) -> list[RenderableType]:
    from servotwin.cli.robot_report import HEAD, heat_is_assumed, place, row

    servos: dict[str, list[str]] = {}
    for joint, mount in done.mounts.items():
        servos.setdefault(f"{mount.model.servo.name}, model {found['joints'][joint]['model']}", []).append(joint)
    assumed = [joint for joint in done.mounts if heat_is_assumed(done, joint) and sized[joint].heating is not None]
    unknown = [joint for joint in done.mounts if sized[joint].heating is None]
    return [pairs([(name, ", ".join(joints)) for name, joints in servos.items()]), "",
            table(HEAD, [row(done, each) for each in sized.values()]), "", "are the servos big enough?",
            pairs([(joint, each.verdict) for joint, each in sized.items()]), "",
            pairs([*([("assumed", f"thermal numbers by mass: {', '.join(assumed)}")] if assumed else []),
                   *([("not known", f"temperatures, for neither thermal numbers nor a mass are given: "
                       f"{', '.join(unknown)}")] if unknown else []),
                   *([("off the measured joints", ", ".join(
                       f"{joint} {place(done.measured_error(joint), done.slides(joint))}" for joint in done.mounts
                       if joint in done.motion.measured) + ", rms")] if done.motion.measured else []),
                   *(("note", text) for text in found["notes"][:_MOST_NOTES]),
                   *more])]


add_to(robot)
robot.command("mobile", help="Let the paper's mobile robot drive along waypoints, and say how far its odometry is off.",
              epilog="Example: servotwin robot mobile --unequal --encoders 512 --out round")(mobile)
robot.command("compare", help="Compare all controllers on all tasks of the arms, by every fidelity.",
              epilog="Example: servotwin robot compare --robot two-link --out compared")(compare)
robot.command("validate", help="Send the recorded goals of a robot through its servos, and say how far the simulated "
              "joints are from the measured ones.", epilog=(
    "Example: servotwin robot validate so101 lerobot/svla_so101_pickplace --episode 3 --unit range "
    "--calibration follower.json --supply 12V:0.1ohm --out compared\n\n"
    "Example: servotwin robot validate so101 arm.csv --servo '*=fitted.toml'"))(validate)
robot.command("fit", help="Fit the servos of a robot, their supply, the masses of its links and the latency of the "
              "loop to recorded episodes.", epilog=(
    "Example: servotwin robot fit so101 lerobot/svla_so101_pickplace --unit range --calibration follower.json "
    "--supply 12V:0.1ohm --out fitted\n\n"
    "Example: servotwin robot fit unknown arm.csv --servo '*=feetech-sts3215-12v' --no-intervals"))(fit)
