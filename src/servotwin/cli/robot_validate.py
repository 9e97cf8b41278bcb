"""`servotwin robot validate`: how far a simulated robot is from the real one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import robot_options as options
from servotwin.cli import shared_options as shared
from servotwin.cli.terminal import emit_json, json_text, pairs, show, table

if TYPE_CHECKING:
    from servotwin.cli.outputs import Target
    from servotwin.robots import RobotValidation

SUMMARY, WINDOWS, ERRORS, PAGE = "summary.json", "windows.png", "errors.png", "index.html"

DatasetArgument = Annotated[Path, typer.Argument(
    metavar="DATASET", help="Folder of a LeRobot dataset, or CSV file with a time and an action and a state of each "
    "joint (action.elbow_deg, state.elbow_deg).")]
OutOption = Annotated[Path | None, typer.Option(
    metavar="FOLDER", help="Folder for page, pictures and numbers (default: none).", rich_help_panel=shared.OUTPUT)]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace existing files.", rich_help_panel=shared.OUTPUT)]


def validate(
    model_file: options.ModelArgument, dataset: DatasetArgument, servo: options.ServoOption = None,
    mount: options.MountOption = None, model: options.ModelOption = None, change: options.SetOption = None,
    register: options.RegisterOption = None, supply: options.SupplyOption = None,
    package: options.PackageOption = None,
    friction: options.FrictionOption = "refuse", calibration: options.CalibrationOption = None,
    episode: options.EpisodesOption = None, unit: options.UnitOption = None,
    latency: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Between the reading of positions and when the goal of the same row acts (default: "
        "the one that fits best).", rich_help_panel=options.MOTION)] = None,
    timestep: Annotated[float | None, typer.Option(
        metavar="SECONDS", help="Of MuJoCo (default: that of the model).", rich_help_panel=shared.OUTPUT)] = None,
    out: OutOption = None, force: ForceOption = False, as_json: shared.JsonOption = False,
) -> None:
    """Replay recorded goals, and compare with the measured joints."""
    from servotwin.cli import robot_files as files
    from servotwin.cli.robot_words import as_options
    from servotwin.robots import validate_robot
    from servotwin.robots.replay import measured_joints

    asked = options.asked_robot(model_file, dataset, servo=servo or [], mount=mount or [], model=model,
                                change=change or [], register=register or [], supply=supply, calibration=calibration,
                                episodes=episode or [], unit=unit or [], package=package or [])

    def done(targets: Sequence[Target]) -> dict[str, Any]:
        with as_options():
            found = validate_robot(asked.plant, asked.mounts, asked.motions, bus=asked.bus, joint_friction=friction,
                                   timestep=timestep, latency=latency, progress=True)
        told = facts(found, model_file, asked.said)
        _write(found, told, targets, force=force)
        told["files"] = [str(target.path) for target in targets]
        if not as_json:
            _show(found, told)
        return told

    if out is None:
        told = done([])
    else:
        with files.folder(out):
            windows = files.joint_pages(WINDOWS, len(measured_joints(asked.mounts, asked.motions)))
            told = done(files.targets_of(out, [SUMMARY, ERRORS, *windows, PAGE], force=force, inputs=[dataset]))
    if as_json:
        emit_json(told)


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


def degrees(value: float) -> str:
    """Return an angle [rad] in degrees, a dash where there is none."""
    return "-" if math.isnan(value) else f"{math.degrees(value):z.2f}"


def rows(found: RobotValidation) -> list[list[str]]:
    """Return a row for each joint: errors by kind of motion, and those of rivals [deg]."""
    from servotwin.robots.replay import ALL, KINDS, SERVOS

    made = []
    for joint in found.joints:
        own = found.errors[SERVOS][joint]
        made.append([joint, *(degrees(own[kind].rms) for kind in KINDS), degrees(own[ALL].largest),
                     *(degrees(kinds[joint][ALL].rms) for name, kinds in found.errors.items() if name != SERVOS)])
    return made


def head(found: RobotValidation) -> list[str]:
    """Return what stands above the rows."""
    from servotwin.robots.replay import KINDS, SERVOS

    return ["joint", *KINDS, "at most", *(name for name in found.errors if name != SERVOS)]


def _show(found: RobotValidation, told: dict[str, Any]) -> None:
    from servotwin.robots.replay import SERVOS

    worst = found.windows[0]
    late = ", ".join(f"{name} {1e3 * value:.0f} ms" for name, value in found.latency.items())
    servos, rivals = [row[:6] for row in rows(found)], [[row[0], *row[6:]] for row in rows(found)]
    titles = head(found)
    show(f"{told['robot']} beside {', '.join(told['episodes'][:3])}{' ...' if len(told['episodes']) > 3 else ''}: "
         f"simulated less measured joints, rms {degrees(found.rms(SERVOS))} deg", "",
         table(titles[:6], servos), "", "the same with other actuators, rms (deg)",
         table([titles[0], *titles[6:]], rivals), "",
         pairs([("goals act later by", late),
                ("worst second", f"{worst.joint}, {worst.start:.2f} s of {told['worst'][0]['episode']}, {worst.kind}: "
                 f"{degrees(worst.rms)} deg rms"),
                *(("note", text) for text in told["notes"]),
                *((("written", told["files"][-1]),) if told["files"] else ())]))


def _write(found: RobotValidation, told: dict[str, Any], targets: Sequence[Target], *, force: bool) -> None:
    if not targets:
        return
    from servotwin import plotting
    from servotwin.cli.outputs import staged
    from servotwin.cli.robot_validate_page import errors_picture, page, write_windows

    with staged(targets, force=force) as drafts:
        places: dict[str, Path] = {target.path.name: draft for target, draft in zip(targets, drafts, strict=True)}
        places[SUMMARY].write_bytes((json_text(told) + "\n").encode())
        plotting.save(errors_picture(found), places[ERRORS])
        write_windows(found, places)
        places[PAGE].write_bytes(page(found, told).encode())
