"""Common options of the commands that move a robot of a file."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from servotwin.cli import shared_options as shared
from servotwin.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from servotwin.models import Model
    from servotwin.parameters import Supply
    from servotwin.robots import Motion, Mount, RobotValidation
    from servotwin.robots.model_file import Plant


# --- Servos, mounts and supplies of a robot out of the words of its options -------------------------------------------

ALL = "*"
MODELS = ("digital", "pulse", "pulse-inductive", "bounded", "averaged")
_MOUNT = "JOINT=ZERO[:DIRECTION[:RATIO]], such as elbow=90deg:-1 or slider=0mm:1:9mm"
_PYTHON = (("joint_friction='clear' sets it so, 'keep'", "--friction clear sets it so, --friction keep"),
           ("with calibration=,", "with --calibration,"), (" or ranges=, the limits of the joint in rad", ""),
           ('unit="deg" or unit="range"', "--unit deg or --unit range"), ("unit=", "--unit "),
           ("mount it with another zero or direction", "--mount gives it another zero or direction"))
_OPTIONS = {"joint_friction": "--friction", "hold": "--hold", "settle": "--settle", "timestep": "--timestep",
            "within": "--within", "masses": "--masses", "holdout": "--holdout", "latency": "--latency"}

_ARM_SERVO = "feetech-sts3215-12v"


class Chosen(NamedTuple):
    """A servo of the catalog or a file, and sets of registers that it is assumed to have."""

    servo: str
    registers: Sequence[str] = ()


def chosen_servos(robot: str, words: Sequence[str], joints: Mapping[str, str], *,
                  driven: Container[str] | None = None) -> dict[str, Chosen]:
    """Return the servo of each joint that has one, in the order of the joints.

    Parameters
    ----------
    robot : str
        As the command names it; an `so101` for which no servo is named has six STS3215 with LeRobot's registers.
    words : sequence of str
        Such as ``"elbow=hitec-hs-755hb"``; ``"*=ID"`` stands for all driven hinges that are not named themselves.
    joints : mapping of str to str
        "angle" of a hinge or "length" of a slide, by name.
    driven : container of str, optional
        Joints that the robot drives: `*` leaves others out. All hinges unless given.

    Raises
    ------
    InputError
        If a word has another form, a joint comes twice, or there is none.
    UnknownNameError
        If there is no such joint.

    Examples
    --------
    >>> found = chosen_servos("arm.xml", ["*=mg996r", "wrist=sg90"], {"elbow": "angle", "wrist": "angle"})
    >>> {joint: each.servo for joint, each in found.items()}
    {'elbow': 'mg996r', 'wrist': 'sg90'}
    """
    if not words and robot == "so101":
        from servotwin.parameters.registers.held import set_of_robot

        return {joint: Chosen(_ARM_SERVO, [set_of_robot(robot, joint)]) for joint in joints}
    if not words:
        raise InputError("servos of the robot", got="none",
                         allowed=f"--servo JOINT=ID, repeatable; joints: {', '.join(joints) or 'none has a name'}")
    given = dict(named_words("--servo", words, "JOINT=ID, such as elbow=hitec-hs-755hb", joints))
    if ALL in given:
        given = {joint: given[ALL] for joint, kind in joints.items()
                 if kind == "angle" and (driven is None or joint in driven)} | given
    found = {joint: Chosen(given[joint]) for joint in joints if joint in given}
    if not found:
        raise InputError("--servo", got=words[0], allowed="a robot whose driven hinges have names, or JOINT=ID: "
                         f"{', '.join(joints) or 'none has a name'}")
    return found


def servos_at(robot: str, words: Sequence[str], plant: Plant, motion: Motion) -> tuple[dict[str, Chosen],
                                                                                      tuple[str, ...]]:
    """Return the servo of each joint that has one, and sentences on joints that `*` left out.

    Raises
    ------
    InputError, UnknownNameError
        As `chosen_servos` does.
    """
    from servotwin.robots import joint_names
    from servotwin.robots.model_file import driven_joints

    named = {word.partition("=")[0].strip() for word in words}
    driven = driven_joints(plant, motion.joints, named)
    return (chosen_servos(robot, words, joint_names(plant.model), driven=driven.joints),
            driven.said if ALL in named else ())


def packages_of(words: Sequence[str]) -> dict[str, Path]:
    """Return the folders of ROS packages that words such as ``"arm_description=ros/arm"`` name.

    Raises
    ------
    InputError
        If a word has another form, names a package twice, or there is no such folder.
    """
    found: dict[str, Path] = {}
    for word in words:
        name, _, folder = (part.strip() for part in word.partition("="))
        if not (name and folder):
            raise InputError("--package", got=word, allowed="NAME=FOLDER, such as arm_description=ros/arm_description")
        if name in found:
            raise InputError(f"--package {name}", got=f"{found[name]} and {folder}", allowed="one")
        if not Path(folder).is_dir():
            raise InputError(f"--package {name}", got=folder, allowed="a folder that is there")
        found[name] = Path(folder)
    return found


def named_words(option: str, words: Sequence[str], form: str, joints: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Give joint and text of words such as ``JOINT=TEXT``, each joint once; `*` stands for others.

    Raises
    ------
    InputError
        If a word has another form, or a joint comes twice.
    UnknownNameError
        If there is no such joint.

    Examples
    --------
    >>> list(named_words("--servo", ["elbow=sg90"], "JOINT=ID", {"elbow": "angle"}))
    [('elbow', 'sg90')]
    """
    seen: dict[str, str] = {}
    for word in words:
        name, equals, text = (word.partition("=")[k].strip() for k in range(3))
        if not (name and equals and text):
            raise InputError(option, got=word, allowed=form)
        if name != ALL and name not in joints:
            raise UnknownNameError(f"joint of {option}", name, joints)
        if name in seen:
            raise InputError(f"{option} {name}", got=f"{seen[name]} and {text}", allowed="one")
        seen[name] = text
        yield name, text


def models_of(chosen: Mapping[str, Chosen], model: str | None, change: Sequence[str],
              register: Sequence[str]) -> dict[str, Model]:
    """Return the model of each joint's servo; joints with the same servo share it.

    Raises
    ------
    ServotwinError
        If a servo, the model, a register or a changed parameter is not known or not possible.
    """
    from servotwin.cli.shared_options import model_of

    made: dict[tuple[str, tuple[str, ...]], Model] = {}
    found = {}
    for joint, (servo, own) in chosen.items():
        key = servo, tuple(own)
        if key not in made:
            made[key] = model_of(servo, model, change, MODELS, register, assumed=own)
        found[joint] = made[key]
    return found


def mounts_of(models: Mapping[str, Model], words: Sequence[str], joints: Mapping[str, str]) -> dict[str, Mount]:
    """Return how the servos sit at their joints.

    Parameters
    ----------
    models : mapping of str to Model
    words : sequence of str
        Such as ``"elbow=90deg:-1:0.5"``: angle of the joint where the servo's is 0 (of a slide its place), direction,
        and turns of the joint per turn of the servo (of a slide metres per radian).
    joints : mapping of str to str

    Raises
    ------
    InputError
        If a word has another form, or a number is not possible.
    UnknownNameError
        If there is no such joint.
    """
    from servotwin.robots import Mount

    given = dict(named_words("--mount", words, _MOUNT, joints))
    missing = next((name for name in given if name != ALL and name not in models), None)
    if missing is not None:
        raise InputError(f"--mount {missing}", got="a joint without a servo", allowed=f"--servo {missing}=ID too")
    return {joint: Mount(model, **_mount(joint, given.get(joint, given.get(ALL, "")), joints[joint]))
            for joint, model in models.items()}


def _mount(joint: str, text: str, kind: str) -> dict[str, Any]:
    from servotwin.units.quantities import quantity

    what, parts = f"--mount {joint}", [part.strip() for part in text.split(":")]
    if len(parts) > 3:
        raise InputError(what, got=text, allowed=_MOUNT)
    zero, direction, ratio = (*parts, "", "")[:3]
    found: dict[str, Any] = {}
    if zero:
        found["zero"] = quantity(what, zero, kind, bare=True)
    if direction:
        if direction not in ("1", "+1", "-1"):
            raise InputError(f"{what}: direction", got=direction, allowed="1 or -1")
        found["direction"] = int(direction)
    if ratio:
        found["ratio"] = quantity(f"{what}: ratio", ratio, "length" if kind == "length" else "number", bare=True,
                                  positive=True)
    return found


def supply_of(text: str | None) -> Supply | None:
    """Return the supply that all servos share; None where each has its own.

    Raises
    ------
    InputError
        If it has another form.

    Examples
    --------
    >>> supply = supply_of("12V:150mohm")
    >>> supply.open_circuit_voltage, supply.internal_resistance
    (12.0, 0.15)
    """
    from servotwin.parameters import Supply

    return None if text is None else Supply.of(text, what="--supply")


def overlap_of(text: str | None) -> str:
    """Return what to do with shapes that overlap, of the words of `--contact`.

    Raises
    ------
    InputError
        If it is anything but ``"overlap=ignore"``.
    """
    if text not in (None, "overlap=ignore"):
        raise InputError("--contact", got=text, allowed="overlap=ignore")
    return "keep" if text is None else "ignore"


def units_of(words: Sequence[str]) -> str | dict[str, str] | None:
    """Return the unit of a dataset's goals, by joint where a word names one.

    Examples
    --------
    >>> units_of(["deg"]), units_of(["*=deg", "elbow_flex=deg-90"]), units_of([])
    ('deg', {'*': 'deg', 'elbow_flex': 'deg-90'}, None)
    """
    pairs = [(name if equals else ALL, text if equals else name)
             for name, equals, text in (word.partition("=") for word in words)]
    if len(dict(pairs)) < len(pairs):
        raise InputError("--unit", got=", ".join(words), allowed="one unit, or one of each joint, JOINT=UNIT")
    found = {name.strip(): text.strip() for name, text in pairs}
    return found[ALL] if list(found) == [ALL] else found or None


@contextlib.contextmanager
def as_options() -> Iterator[None]:
    """Let errors name options of the command line instead of arguments of functions.

    Examples
    --------
    >>> with as_options():
    ...     raise InputError("zero", allowed="unit=, as it was")
    Traceback (most recent call last):
    ...
    servotwin.errors.InputError: zero: allowed: --unit , as it was
    """
    try:
        yield
    except InputError as error:
        texts = [_OPTIONS.get(error.what, error.what), error.allowed or ""]
        for python, words in _PYTHON:
            texts = [text.replace(python, words) for text in texts]
        if texts == [error.what, error.allowed or ""]:
            raise
        raise InputError(texts[0], got=error.got, allowed=texts[1] or None) from None


# --- Common options of the commands that move a robot of a file -------------------------------------------------------

MOTION, ROBOT = "Motion", "Servos of the robot"  # panels of the help

ModelArgument = Annotated[str, typer.Argument(
    metavar="MODEL.xml", help="MJCF or URDF file of the robot, with or without actuators; or so101, an arm that "
    "comes with servotwin: without --servo it has six STS3215 with LeRobot's registers.")]
PackageOption = Annotated[Sequence[str], typer.Option(
    metavar="NAME=FOLDER", help="Folder of a ROS package that package://NAME/ names, repeatable (default: found above "
    "the robot's file).", rich_help_panel=ROBOT)]
FrictionOption = Annotated[str, typer.Option(
    metavar="HOW", help="What to do with damping and friction that the model's joints have themselves: refuse, "
    "clear (the servo has its own) or keep.", rich_help_panel=ROBOT)]
ContactOption = Annotated[str | None, typer.Option(
    metavar="overlap=ignore", help="Leave out contacts of shapes that lie in each other in the first pose or where the "
    "motion begins (default: they count, and the servos are not judged).", rich_help_panel=ROBOT)]


@dataclass(frozen=True, kw_only=True)
class Servos:
    """The options that say which servos a robot has and how they sit, as they were typed."""

    servo: Annotated[Sequence[str], typer.Option(
        metavar="JOINT=ID", help="Servo of a joint, repeatable: catalog id, or path of a servo file (.toml); "
        "'*=ID' for all other hinges that the robot drives: those of its actuators or transmissions, else those that "
        "the motion moves.", rich_help_panel=ROBOT)] = ()
    mount: Annotated[Sequence[str], typer.Option(
        metavar="JOINT=ZERO:DIRECTION:RATIO", help="How a servo sits at its joint, repeatable: angle of the joint "
        "where the servo's is 0, 1 or -1, turns of the joint per turn of the servo, such as elbow=-90deg:-1; of a "
        "slide its place and its way per radian, slider=0mm:1:9mm.", rich_help_panel=ROBOT)] = ()
    model: Annotated[str | None, typer.Option(
        metavar="MODEL", help="digital, pulse, pulse-inductive, bounded or averaged (default: by the kind of each "
        "servo).", rich_help_panel=ROBOT)] = None
    change: Annotated[Sequence[str], typer.Option(
        "--set", metavar="GROUP.NAME=VALUE", help="Change a parameter of all servos; repeatable; with a unit, or in SI "
        "units.", rich_help_panel=ROBOT)] = ()
    register: Annotated[Sequence[str], typer.Option(
        metavar="NAME=VALUE", help="Write a register of all servos, such as P_Coefficient=16, or a set such as "
        "lerobot; repeatable, or with commas.", rich_help_panel=ROBOT)] = ()
    supply: Annotated[str | None, typer.Option(
        metavar=shared.SUPPLY_FORM, help=f"Supply that all servos share: {shared.SUPPLY_HELP} (default: each its own).",
        rich_help_panel=ROBOT)] = None
    package: PackageOption = ()

    @property
    def bus(self) -> Supply | None:
        """The supply that they share."""
        return supply_of(self.supply)

    def mounts(self, chosen: Mapping[str, Chosen], joints: Mapping[str, str]) -> dict[str, Mount]:
        """Return how the servos that were chosen sit at their joints."""
        return mounts_of(models_of(chosen, self.model, self.change, self.register), self.mount, joints)


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """The options that say what was recorded of a robot, as they were typed."""

    calibration: Annotated[Path | None, typer.Option(
        metavar="FILE.json", help="LeRobot's calibration of the robot.", rich_help_panel=MOTION)] = None
    episode: Annotated[Sequence[int], typer.Option(
        "--episode", metavar="NUMBER", help="Episode of the dataset, repeatable (default: all).",
        rich_help_panel=MOTION)] = ()
    unit: Annotated[Sequence[str], typer.Option(
        metavar="[JOINT=]UNIT", help="Unit of a dataset's goals, if it is not known: deg, range (-100 to 100), or such "
        "as deg-90; repeatable.", rich_help_panel=MOTION)] = ()


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
        Assumptions about the servos.
    """

    plant: Any
    mounts: Mapping[str, Mount]
    bus: Supply | None
    motions: list[Motion]
    said: tuple[str, ...]


def asked_robot(model_file: str, dataset: Path, servos: Servos, recorded: Recorded, plant: Any = None) -> Asked:
    """Return a robot and the recorded episodes of it, of the words of options; `plant` is one without a file."""
    from servotwin.cli.terminal import patience
    from servotwin.robots import joint_names, joint_ranges, read_motion
    from servotwin.robots.model_file import Plant, plant_of
    from servotwin.robots.motion import episodes_of

    found = plant_of(model_file, packages_of(servos.package)) if plant is None else Plant(plant)
    joints = joint_names(found.model)
    with as_options(), patience(f"reading {dataset}"):
        numbers = list(dict.fromkeys(recorded.episode)) or list(episodes_of(dataset))
        motions = [read_motion(dataset, joints, ranges=joint_ranges(found.model), unit=units_of(recorded.unit),
                               calibration=recorded.calibration, episode=number) for number in numbers]
    chosen, left = servos_at(model_file, servos.servo, found, motions[0])
    mounts = servos.mounts(chosen, joints)
    if servos.register:  # who says registers does not have them assumed
        motions = [replace(one, robot="") for one in motions]
    own = sorted({name for each in chosen.values() for name in each.registers}) if not servos.register else []
    said = (f"registers assumed as LeRobot writes them for {model_file} (sets {', '.join(own)})",) if own else ()
    return Asked(plant=found.model, mounts=mounts, bus=servos.bus, motions=motions, said=(*found.said, *said, *left))


_RATES = (1.0, 120.0)  # pictures a second


def check_numbers(*, output_step: float, rate: float, blend: float | None) -> None:
    """Raise InputError unless numbers of options are possible."""
    from servotwin.units import is_finite

    for option, value in (("--output-step", output_step), ("--blend", 1.0 if blend is None else blend)):
        if not (is_finite(value) and value > 0.0):
            raise InputError(option, got=value, allowed="a positive number of seconds")
    if not _RATES[0] <= rate <= _RATES[1]:
        raise InputError("--fps", got=rate, allowed=f"{_RATES[0]:g} to {_RATES[1]:g} pictures a second")


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


# --- Files and tables of `servotwin robot validate` -------------------------------------------------------------------

SUMMARY, WINDOWS, ERRORS, PAGE = "summary.json", "windows.png", "errors.png", "index.html"


def degrees(value: float) -> str:
    """Return an angle [rad] in degrees, a dash where there is none."""
    return "-" if math.isnan(value) else f"{math.degrees(value):z.2f}"


def validation_rows(found: RobotValidation) -> list[list[str]]:
    """Return a row for each joint: errors by kind of motion, and those of rivals [deg]."""
    from servotwin.robots.replay import ALL, KINDS, SERVOS

    made = []
    for joint in found.joints:
        own = found.errors[SERVOS][joint]
        made.append([joint, *(degrees(own[kind].rms) for kind in KINDS), degrees(own[ALL].largest),
                     *(degrees(kinds[joint][ALL].rms) for name, kinds in found.errors.items() if name != SERVOS)])
    return made


def validation_head(found: RobotValidation) -> list[str]:
    """Return what stands above the rows."""
    from servotwin.robots.replay import KINDS, SERVOS

    return ["joint", *KINDS, "at most", *(name for name in found.errors if name != SERVOS)]
