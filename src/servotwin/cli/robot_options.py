"""What the commands that move a robot of a file ask for in the same words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from servotwin.cli import shared_options as shared

if TYPE_CHECKING:
    from servotwin.parameters import Supply
    from servotwin.robots import Motion, Mount

MOTION, ROBOT = "Motion", "Servos of the robot"  # panels of the help

ModelArgument = Annotated[str, typer.Argument(
    metavar="MODEL.xml", help="MJCF or URDF file of the robot, with or without actuators; or so101, an arm that "
    "comes with servotwin: without --servo it has six STS3215 with LeRobot's registers.")]
ServoOption = Annotated[list[str] | None, typer.Option(
    metavar="JOINT=ID", help="Servo of a joint, repeatable: catalog id, or path of a servo file (.toml); "
    "'*=ID' for all other hinges that the robot drives: those of its actuators or transmissions, else those that the "
    "motion moves.", rich_help_panel=ROBOT)]
PackageOption = Annotated[list[str] | None, typer.Option(
    metavar="NAME=FOLDER", help="Folder of a ROS package that package://NAME/ names, repeatable (default: found above "
    "the robot's file).", rich_help_panel=ROBOT)]
MountOption = Annotated[list[str] | None, typer.Option(
    metavar="JOINT=ZERO:DIRECTION:RATIO", help="How a servo sits at its joint, repeatable: angle of the joint "
    "where the servo's is 0, 1 or -1, turns of the joint per turn of the servo, such as elbow=-90deg:-1; of a "
    "slide its place and its way per radian, slider=0mm:1:9mm.", rich_help_panel=ROBOT)]
ModelOption = Annotated[str | None, typer.Option(
    metavar="MODEL", help="digital, pulse, pulse-inductive, bounded or averaged (default: by the kind of each "
    "servo).", rich_help_panel=ROBOT)]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="GROUP.NAME=VALUE", help="Change a parameter of all servos; repeatable; with a unit, or in SI "
    "units.", rich_help_panel=ROBOT)]
RegisterOption = Annotated[list[str] | None, typer.Option(
    metavar="NAME=VALUE", help="Write a register of all servos, such as P_Coefficient=16, or a set such as "
    "lerobot; repeatable, or with commas.", rich_help_panel=ROBOT)]
SupplyOption = Annotated[str | None, typer.Option(
    metavar=shared.SUPPLY_FORM, help=f"Supply that all servos share: {shared.SUPPLY_HELP} (default: each its own).",
    rich_help_panel=ROBOT)]
FrictionOption = Annotated[str, typer.Option(
    metavar="HOW", help="What to do with damping and friction that the model's joints have themselves: refuse, "
    "clear (the servo has its own) or keep.", rich_help_panel=ROBOT)]
ContactOption = Annotated[str | None, typer.Option(
    metavar="overlap=ignore", help="Leave out contacts of shapes that lie in each other in the first pose or where the "
    "motion begins (default: they count, and the servos are not judged).", rich_help_panel=ROBOT)]
CalibrationOption = Annotated[Path | None, typer.Option(
    metavar="FILE.json", help="LeRobot's calibration of the robot.", rich_help_panel=MOTION)]
EpisodesOption = Annotated[list[int] | None, typer.Option(
    "--episode", metavar="NUMBER", help="Episode of the dataset, repeatable (default: all).", rich_help_panel=MOTION)]
UnitOption = Annotated[list[str] | None, typer.Option(
    metavar="[JOINT=]UNIT", help="Unit of a dataset's goals, if it is not known: deg, range (-100 to 100), or such "
    "as deg-90; repeatable.", rich_help_panel=MOTION)]


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A robot with its servos, and what was recorded of it.

    Parameters
    ----------
    plant : MjModel
    mounts : mapping of str to Mount
    bus : Supply, optional
    motions : list of Motion
        One an episode.
    said : tuple of str
        What was assumed of the servos.
    """

    plant: Any
    mounts: Mapping[str, Mount]
    bus: Supply | None
    motions: list[Motion]
    said: tuple[str, ...]


def asked_robot(model_file: str, dataset: Path, *, servo: Sequence[str], mount: Sequence[str], model: str | None,
                change: Sequence[str], register: Sequence[str], supply: str | None, calibration: Path | None,
                episodes: Sequence[int], unit: Sequence[str], package: Sequence[str] = (), plant: Any = None
                ) -> Asked:
    """Return a robot and the recorded episodes of it, of the words of options; `plant` is one without a file."""
    from dataclasses import replace

    from servotwin.cli.robot_words import (
        as_options,
        models_of,
        mounts_of,
        packages_of,
        servos_at,
        supply_of,
        units_of,
    )
    from servotwin.cli.terminal import patience
    from servotwin.robots import joint_names, joint_ranges, read_motion
    from servotwin.robots.episode import episodes_of
    from servotwin.robots.model_file import Plant, plant_of

    found = plant_of(model_file, packages_of(package)) if plant is None else Plant(plant)
    joints = joint_names(found.model)
    with as_options(), patience(f"reading {dataset}"):
        numbers = list(dict.fromkeys(episodes)) or list(episodes_of(dataset))
        motions = [read_motion(dataset, joints, ranges=joint_ranges(found.model), unit=units_of(unit),
                               calibration=calibration, episode=number) for number in numbers]
    chosen, left = servos_at(model_file, servo, found, motions[0])
    mounts = mounts_of(models_of(chosen, model, change, register), mount, joints)
    if register:  # who says registers does not have them assumed
        motions = [replace(one, robot="") for one in motions]
    own = sorted({name for each in chosen.values() for name in each.registers}) if not register else []
    said = (f"registers assumed as LeRobot writes them for {model_file} (sets {', '.join(own)})",) if own else ()
    return Asked(plant=found.model, mounts=mounts, bus=supply_of(supply), motions=motions,
                 said=(*found.said, *said, *left))
