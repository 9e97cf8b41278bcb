"""How the controls of a MuJoCo model that was made for other actuators become commands of servos."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from servotwin.datasheet.turning import is_pulsed
from servotwin.errors import InputError, UnknownNameError
from servotwin.models.switched import SwitchedServo
from servotwin.models.terms.wiring import PULSE_RANGE
from servotwin.robots.model_file import joint_names
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import Joint, Mount, joints_of
from servotwin.simulation import VectorSimulator
from servotwin.units import is_finite

# --- The command of the servo at a joint ------------------------------------------------------------------------------

class Told(NamedTuple):
    """How a command of a joint becomes that of its servo: (command − zero)/gain.

    Parameters
    ----------
    kind : str
        Of the servo's command, "command_angle" or "pulse_width".
    gain, zero : float
        1 and 0 where the servo turns endlessly: it takes a pulse width or a goal, whatever its mount.
    rest : float
        Its command before the first one is given; nan: to hold where it begins.
    unit : str
        Of a command of the joint; empty where that is the joint's own, rad of a hinge and m of a slide.
    """

    kind: str
    gain: float
    zero: float
    rest: float
    unit: str

    def check(self, joint: str, goal: float, frame: float) -> None:
        """Raise InputError unless a command of a joint is finite, and a pulse shorter than a frame [s]."""
        if self.kind == "pulse_width" and not 0.0 < goal < frame:
            raise InputError(f"pulse of joint {joint}", got=goal,
                             allowed=f"a width of more than 0 and less than a frame of {frame:g} s: its servo turns "
                             "endlessly, and no angle is asked of it")
        if not math.isfinite(goal):
            raise InputError(f"goal of joint {joint}", got=goal,
                             allowed=f"a finite number of {self.unit or 'rad, or m of a slide'}")


def told(mount: Mount) -> Told:
    """Return how the servo of a mount is commanded where to go, or how fast to turn."""
    model = mount.model
    if not model.endless or not isinstance(model, SwitchedServo):
        return Told("command_angle", mount.gain, mount.zero, math.nan, "")
    if is_pulsed(model):
        return Told("pulse_width", 1.0, 0.0, model.neutral_pulse, "s")
    return Told("command_angle", 1.0, 0.0, model.value("potentiometer.fixed_angle"), "1")


# --- How the controls of a MuJoCo model that was made for other actuators become commands of servos -------------------

_AT_JOINT = ("JOINT", "JOINTINPARENT")
_OF_PLACE = 1  # MuJoCo's word for a control that is a place, from 4 on


@dataclass(frozen=True)
class CommandMap:
    """The map of a control to a servo: angle of the joint = `offset` + `scale` · control.

    Parameters
    ----------
    joint : str
    low, high : float
        Ends of the control, infinite where it has none. A control beyond them counts as the end, as in MuJoCo.
    scale, offset : float
    unit : str
        Of the angle: "rad", or "m" of a slide; "s" of the pulses of a servo that turns endlessly.

    Examples
    --------
    >>> turn = CommandMap("elbow", -1.0, 1.0, scale=1.5, offset=0.5)
    >>> print(turn)
    elbow: control -1 to 1 is -1 to 2 rad
    >>> turn.angle(0.0), turn.control(1.25)
    (0.5, 0.5)
    """

    joint: str
    low: float
    high: float
    scale: float = 1.0
    offset: float = 0.0
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Check."""
        if not (is_finite(self.scale) and is_finite(self.offset)) or self.scale == 0.0:
            raise InputError(f"map of joint {self.joint}", got=f"scale {self.scale}, offset {self.offset}",
                             allowed="finite numbers, the scale not 0")
        if not self.low < self.high:
            raise InputError(f"control of joint {self.joint}", got=f"{self.low} to {self.high}",
                             allowed="low below high")

    @property
    def angle_low(self) -> float:
        """The place of the lowest control [rad or m]."""
        return self.angle(self.low)

    @property
    def angle_high(self) -> float:
        """The place of the highest control [rad or m]."""
        return self.angle(self.high)

    @property
    def is_identity(self) -> bool:
        """Whether the control is the angle."""
        return self.scale == 1.0 and self.offset == 0.0

    def angle(self, control: float) -> float:
        """Return what a control asks for [rad or m]."""
        return self.offset + self.scale * min(max(control, self.low), self.high)

    def control(self, angle: float) -> float:
        """Return the control that asks for an angle [rad or m], or for the nearest that there is."""
        return min(max((angle - self.offset) / self.scale, self.low), self.high)

    def __str__(self) -> str:
        ends = f"{self.low:.4g} to {self.high:.4g}"
        return f"{self.joint}: control {ends} is {self.angle_low:.4g} to {self.angle_high:.4g} {self.unit}"


@dataclass(frozen=True)
class Seat:
    """A place for a servo: an actuator of a model that moves one joint.

    Parameters
    ----------
    key : str
        By which somebody asked for it.
    actuator, control : int
        Its number, and where in `ctrl` its command is.
    joint : str
    number : int
        Of the joint.
    """

    key: str
    actuator: int
    control: int
    joint: str
    number: int


def seats(model: Any, keys: Mapping[str, object]) -> list[Seat]:
    """Return the actuators that are meant by their own names, or by those of their joints.

    Raises
    ------
    UnknownNameError
        If there is no such actuator and no such joint with an actuator.
    InputError
        If an actuator is not at a hinge or a slide or has not one control, or two names mean one of them.
    """
    found: list[Seat] = []
    for key in keys:
        seat = _seat(model, key)
        other = next((one.key for one in found if one.actuator == seat.actuator), None)
        if other is not None:
            raise InputError(f"actuator {key}", got=f"the one of {other} once more", allowed="one servo in its place")
        found.append(seat)
    return found


def _seat(model: Any, key: str) -> Seat:
    mujoco = load_mujoco()
    kinds = [mujoco.mjtTrn(int(kind)).name.removeprefix("mjTRN_") for kind in model.actuator_trntype]
    named = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or "" for k in range(len(kinds))]
    moved = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, model.actuator_trnid[k, 0]) or ""
             if kind in _AT_JOINT else "" for k, kind in enumerate(kinds)]
    known = list(dict.fromkeys(name for pair in zip(named, moved, strict=True) for name in pair if name))
    if key not in known:
        raise UnknownNameError("actuator, or joint with an actuator,", key, known)
    k = named.index(key) if key in named else moved.index(key)
    if kinds[k] not in _AT_JOINT:
        raise InputError(f"actuator {key}", got=f"one at a {kinds[k].lower()}", allowed="one at a hinge or a slide")
    number = int(model.actuator_trnid[k, 0])
    kind = mujoco.mjtJoint(int(model.jnt_type[number])).name.removeprefix("mjJNT_").lower()
    if kind not in ("hinge", "slide"):
        raise InputError(f"joint {moved[k]} of actuator {key}", got=f"a {kind} joint",
                         allowed="a hinge or a slide: one servo moves one degree of freedom")
    controls = int(model.actuator_ctrlnum[k]) if hasattr(model, "actuator_ctrlnum") else 1  # from MuJoCo 4 on
    if controls != 1:
        raise InputError(f"actuator {key}", got=f"one with {controls} controls", allowed="one with one control")
    control = int(model.actuator_ctrladr[k]) if hasattr(model, "actuator_ctrladr") else k
    return Seat(key, k, control, moved[k], number)


def maps(model: Any, places: list[Seat], mounts: Mapping[str, Mount], command: Any) -> dict[str, CommandMap]:
    """Return what the controls of actuators ask of the servos in their places, by key.

    Raises
    ------
    InputError
        If what is given is no map, or none is given and none follows from the model.
    """
    given = dict.fromkeys(mounts, command) if isinstance(command, str) else command or {}
    if not isinstance(given, Mapping):
        raise InputError("command", got=command, allowed="'identity', or a mapping of actuators to maps")
    by_actuator = {seat.actuator: seat.key for seat in places}
    known = [name for seat in places for name in dict.fromkeys((seat.key, seat.joint))]
    asked: dict[str, Any] = {}
    for name, value in given.items():
        key = by_actuator.get(_seat(model, name).actuator) if name in known else None
        if key is None:
            raise UnknownNameError("actuator with a servo", name, known)
        asked[key] = value
    return {seat.key: _map(model, seat, mounts[seat.key], asked.get(seat.key)) for seat in places}


def _map(model: Any, seat: Seat, mount: Mount, given: Any) -> CommandMap:
    """Return the map that is given, or that follows from the model."""
    mujoco = load_mujoco()
    low, high = map(float, model.actuator_ctrlrange[seat.control])
    limits, unit = _limits(model, seat.control), _unit(model, seat.number, mount)
    if isinstance(given, CommandMap):
        return replace(given, joint=seat.joint, unit=unit)
    if isinstance(given, str) and given == "identity":
        return CommandMap(seat.joint, *limits, unit=unit)
    if given is None and not mount.model.endless:  # no spring pulls a wheel to an angle
        law = _law(mujoco, model, seat.actuator)
        if law is not None:
            return CommandMap(seat.joint, *limits, scale=law[0], offset=law[1], unit=unit)
    ends = _given_ends(seat.key, given, unit) if given is not None else _reach(model, seat, mount)
    if not low < high:
        raise InputError(f"command of {seat.key}", got="an actuator without a control range",
                         allowed="'identity', or a range in the model")
    scale = (ends[1] - ends[0]) / (high - low)
    return CommandMap(seat.joint, low, high, scale, (ends[0] * high - ends[1] * low) / (high - low), unit)


def own_map(model: Any, joint: Joint) -> CommandMap:
    """Return what the control of an actuator asks of the servo in its place by itself.

    That is the angle at which an actuator like a spring has no force. Of another, and where there is none, it is the
    angle itself; then a control range, which was for something else, is refused.

    Raises
    ------
    InputError
        If the control has a range that is no angle, or no pulse of a servo that turns endlessly.
    """
    unit, law, how = _unit(model, joint.number, joint.mount), None, told(joint.mount)
    if joint.actuator < 0:
        return CommandMap(joint.name, -math.inf, math.inf, unit=unit)
    low, high = _limits(model, joint.command_at)
    if how.kind == "pulse_width":
        frame = joint.mount.model.value_or("electronics.frame_period", 0.02)
        fits = math.isinf(low) or 0.0 < low < high < frame
    else:
        law = None if joint.mount.model.endless else _law(load_mujoco(), model, joint.actuator)
        silent = not (model.actuator_gainprm[joint.actuator].any() or model.actuator_biasprm[joint.actuator].any())
        fits = law is not None or math.isinf(low) or joint.mount.model.endless or silent  # by a drive before
    if not fits:
        meant = "pulse width" if how.kind == "pulse_width" else "place" if unit == "m" else "angle"
        raise InputError(f"control range of the actuator at joint {joint.name}", allowed="none, one of a position "
                         f"actuator, or a CommandMap in controls=: what it asks of the servo [{unit}]",
                         got=f"{low:g} to {high:g}, which is no {meant}")
    scale, offset = law or (1.0, 0.0)
    return CommandMap(joint.name, low, high, scale=scale, offset=offset, unit=unit)


def unused_ranges(model: Any, mounts: Mapping[str, Mount]) -> tuple[dict[str, CommandMap], tuple[str, ...]]:
    """Return maps without an end in the place of control ranges that are no angles, and a sentence on each of them.

    They are for joints whose goals are angles, and that nobody tells anything by `ctrl`.
    """
    found, said = {}, []
    known = {name: mount for name, mount in mounts.items() if name in joint_names(model)}
    for joint in joints_of(model, known):
        try:
            own_map(model, joint)
        except InputError as error:
            unit = _unit(model, joint.number, joint.mount)
            found[joint.name] = CommandMap(joint.name, -math.inf, math.inf, unit=unit)
            said.append(f"control range of the actuator at joint {joint.name} is left out: {error.got}")
    return found, tuple(said)


def _limits(model: Any, control: int) -> tuple[float, float]:
    """Return the range of a control, infinite where it has none."""
    if not model.actuator_ctrllimited[control]:
        return -math.inf, math.inf
    low, high = map(float, model.actuator_ctrlrange[control])
    return low, high


def _unit(model: Any, joint: int, mount: Mount) -> str:
    """Return the unit of a command of a joint."""
    mujoco = load_mujoco()
    slides = mujoco.mjtJoint(int(model.jnt_type[joint])) == mujoco.mjtJoint.mjJNT_SLIDE
    return told(mount).unit or ("m" if slides else "rad")


def _law(mujoco: Any, model: Any, actuator: int) -> tuple[float, float] | None:
    """Return scale and offset of the angle that a control asks for by itself; None where it asks for something else."""
    if int(model.actuator_gaintype[actuator]) != int(getattr(mujoco.mjtGain, "mjGAIN_DCMOTOR", -1)):
        return _spring(mujoco, model, actuator)
    if not hasattr(model, "actuator_ctrlspec") or int(model.actuator_ctrlspec[actuator]) != _OF_PLACE:
        return None
    gear = float(model.actuator_gear[actuator, 0])
    return None if gear == 0.0 else (1.0 / gear, 0.0)


def _spring(mujoco: Any, model: Any, actuator: int) -> tuple[float, float] | None:
    """Return scale and offset of the angle where an actuator like a spring has no force; None where it is no spring."""
    gain, (force, stiffness) = float(model.actuator_gainprm[actuator, 0]), model.actuator_biasprm[actuator, :2].tolist()
    fixed = int(model.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    affine = int(model.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    summed = int(model.actuator_dyntype[actuator]) == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    gear = float(model.actuator_gear[actuator, 0])
    if not (fixed and affine) or summed or not stiffness < 0.0 or gain == 0.0 or gear == 0.0:
        return None
    return gain / -stiffness / gear, force / -stiffness / gear


def _given_ends(key: str, given: Any, unit: str) -> tuple[float, float]:
    ends = tuple(given) if isinstance(given, tuple | list | np.ndarray) else ()
    if len(ends) != 2 or not all(map(is_finite, ends)) or not ends[0] < ends[1]:
        raise InputError(f"command of {key}", got=given,
                         allowed=f"'identity', or (lowest, highest) angle of the joint, finite numbers of {unit}")
    return float(ends[0]), float(ends[1])


def _reach(model: Any, seat: Seat, mount: Mount) -> tuple[float, float]:
    """Return where the joint can go that the servo can be commanded to go to as well, or all pulses that it takes."""
    if mount.model.endless:
        return _pulses(seat, mount)
    ends = VectorSimulator(mount.model, 1).c_entry().commands("command_angle")
    servo = sorted(mount.zero + mount.gain * float(end[0]) for end in ends)
    joint = model.jnt_range[seat.number].tolist() if model.jnt_limited[seat.number] else [-math.inf, math.inf]
    low, high = max(servo[0], joint[0]), min(servo[1], joint[1])
    if not (low < high and math.isfinite(low) and math.isfinite(high)):
        raise InputError(f"command of {seat.key}", got=f"a joint of {joint[0]:.4g} to {joint[1]:.4g} and a servo of "
                         f"{servo[0]:.4g} to {servo[1]:.4g}", allowed="a range in common that has ends: by the zero of "
                         "its Mount, or command={...: (lowest, highest)}")
    return low, high


def _pulses(seat: Seat, mount: Mount) -> tuple[float, float]:
    """Return the shortest and the longest pulse of a servo that turns endlessly [s]."""
    if not is_pulsed(mount.model):
        raise InputError(f"command of {seat.key}", got="a servo on a bus that turns endlessly",
                         allowed="'identity', or command={...: (lowest, highest)} of its goals")
    low, high = (mount.model.value_or(f"electronics.pulse_width_{end}", usual)
                 for end, usual in zip(("min", "max"), PULSE_RANGE, strict=True))
    return low, high
