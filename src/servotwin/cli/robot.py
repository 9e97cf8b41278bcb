"""`servotwin robot`: robots whose joints are servos."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_options as options
from servotwin.cli import shared_options as shared
from servotwin.cli.robot_arm import add_to
from servotwin.cli.robot_compare import compare
from servotwin.cli.robot_fit import fit
from servotwin.cli.robot_mobile import mobile
from servotwin.cli.robot_validate import validate
from servotwin.cli.terminal import emit_help, emit_json, pairs, patience, show, table

if TYPE_CHECKING:
    from servotwin.robots import Motion, RobotRun, Sizing

_MOST_NOTES = 6  # that are told
_RATES = (1.0, 120.0)  # pictures a second

robot = typer.Typer(
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
def run(
    model_file: options.ModelArgument,
    motion: Annotated[Path, typer.Option(
        metavar="FILE", help="CSV file with a column time_s and one of each joint that moves (elbow_deg, elbow_rad, "
        "slider_mm), or the folder of a LeRobot dataset.", rich_help_panel=options.MOTION)],
    out: Annotated[Path, typer.Option(
        metavar="FOLDER", help="Folder for tables, pictures, video and page.", rich_help_panel=shared.OUTPUT)],
    servo: options.ServoOption = None, mount: options.MountOption = None, model: options.ModelOption = None,
    change: options.SetOption = None, register: options.RegisterOption = None, supply: options.SupplyOption = None,
    friction: options.FrictionOption = "refuse", contact: options.ContactOption = None,
    package: options.PackageOption = None, calibration: options.CalibrationOption = None,
    episode: Annotated[int | None, typer.Option(
        metavar="NUMBER", help="Episode of the dataset (default: its first).", rich_help_panel=options.MOTION)] = None,
    unit: options.UnitOption = None,
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
    force: Annotated[bool, typer.Option(
        "--force", help="Replace existing files.", rich_help_panel=shared.OUTPUT)] = False,
    as_json: shared.JsonOption = False,
) -> None:
    """Let a robot follow a motion, and say whether its servos are big enough."""
    from servotwin.cli import robot_files as files
    from servotwin.cli.robot_facts import facts
    from servotwin.cli.robot_words import (
        as_options,
        models_of,
        mounts_of,
        overlap_of,
        packages_of,
        servos_at,
        supply_of,
        units_of,
    )
    from servotwin.robots import joint_names, joint_ranges, run_motion, sizing_of
    from servotwin.robots.model_file import plant_of
    from servotwin.robots.motion import is_dataset

    check_numbers(output_step=output_step, rate=rate, blend=blend)
    plant, overlap = plant_of(model_file, packages_of(package or [])), overlap_of(contact)
    joints = joint_names(plant.model)
    with as_options():
        followed = _read(motion, joints, joint_ranges(plant.model), unit=units_of(unit or []), calibration=calibration,
                         episode=episode)
    chosen, left = servos_at(model_file, servo or [], plant, followed)
    mounts = mounts_of(models_of(chosen, model, change or [], register or []), mount or [], joints)
    bus = supply_of(supply)
    if register:  # who says registers does not have them assumed
        followed = replace(followed, robot="")
    picture = check_drawing(plant.model, camera, video=video)
    inputs = [Path(model_file), motion, *([] if calibration is None else [calibration])]
    with files.folder(out):
        targets = files.targets_in(out, servos=len(mounts), picture=picture, video=video, force=force, inputs=inputs)
        with as_options():
            done = run_motion(plant, mounts, followed, bus=bus, joint_friction=friction, timestep=timestep,
                              settle=settle, hold=hold or ("previous" if is_dataset(motion) else "linear"),
                              window=blend, overlap=overlap, progress=True)
            done = replace(done, said=(*done.said, *left))
            sized = sizing_of(done)
        found = facts(done, sized, model_file)
        files.write_all(done, sized, targets, found, force=force, output_step=output_step, camera=camera, rate=rate)
    found["files"] = [str(target.path) for target in targets]
    if as_json:
        emit_json(found)
    else:
        _show(done, sized, found)


def check_numbers(*, output_step: float, rate: float, blend: float | None) -> None:
    """Raise InputError unless numbers of options are possible."""
    from servotwin.errors import InputError
    from servotwin.units import is_finite

    for option, value in (("--output-step", output_step), ("--blend", 1.0 if blend is None else blend)):
        if not (is_finite(value) and value > 0.0):
            raise InputError(option, got=value, allowed="a positive number of seconds")
    if not _RATES[0] <= rate <= _RATES[1]:
        raise InputError("--fps", got=rate, allowed=f"{_RATES[0]:g} to {_RATES[1]:g} pictures a second")


def _read(path: Path, joints: dict[str, str], ranges: dict[str, tuple[float, float]], **options: Any) -> Motion:
    from servotwin.robots import read_motion

    with patience(f"reading {path}"):
        return read_motion(path, joints, ranges=ranges, **options)


def check_drawing(plant: Any, camera: str | None, *, video: bool) -> bool:
    """Return whether the robot can be drawn; raise if it cannot and a video is wanted."""
    from servotwin.look.opencv import load_opencv
    from servotwin.robots.camera import Camera, NoDrawingError

    if video:
        load_opencv()
    try:
        with Camera(plant, 16, 16, camera):
            return True
    except NoDrawingError as error:
        if video:
            raise NoDrawingError(f"{error}; --no-video does without") from None
        warnings.warn(f"robot.png is left out: {error}", stacklevel=2)
        return False


def _show(done: RobotRun, sized: dict[str, Sizing], found: dict[str, Any]) -> None:
    from servotwin.cli.robot_facts import HEAD, heat_is_assumed, place, row

    servos: dict[str, list[str]] = {}
    for joint, mount in done.mounts.items():
        servos.setdefault(f"{mount.model.servo.name}, model {found['joints'][joint]['model']}", []).append(joint)
    assumed = [joint for joint in done.mounts if heat_is_assumed(done, joint) and sized[joint].heating is not None]
    unknown = [joint for joint in done.mounts if sized[joint].heating is None]
    show(f"{found['robot']} follows {done.motion.source}, {done.motion.duration:.4g} s",
         pairs([(name, ", ".join(joints)) for name, joints in servos.items()]), "",
         table(HEAD, [row(done, each) for each in sized.values()]), "",
         "are the servos big enough?",
         pairs([(joint, each.verdict) for joint, each in sized.items()]), "",
         pairs([*([("assumed", f"thermal numbers by mass: {', '.join(assumed)}")] if assumed else []),
                *([("not known", f"temperatures, for neither thermal numbers nor a mass are given: "
                    f"{', '.join(unknown)}")] if unknown else []),
                *([("off the measured joints", ", ".join(
                    f"{joint} {place(done.measured_error(joint), done.slides(joint))}" for joint in done.mounts
                    if joint in done.motion.measured) + ", rms")] if done.motion.measured else []),
                *(("note", text) for text in found["notes"][:_MOST_NOTES]),
                ("written", found["files"][-1])]))


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
