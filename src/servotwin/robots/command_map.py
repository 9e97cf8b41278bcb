"""How the controls of a MuJoCo model that was made for other actuators become commands of servos."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from servotwin.datasheet.turning import is_pulsed
from servotwin.errors import InputError, UnknownNameError
from servotwin.models.base import PULSE_RANGE
from servotwin.robots.mount import Mount
from servotwin.robots.places import load_mujoco
from servotwin.robots.told import told
from servotwin.simulation import VectorSimulator
from servotwin.units import is_finite

_AT_JOINT = ("JOINT", "JOINTINPARENT")


@dataclass(frozen=True)
class CommandMap:
    """What a control asks of a servo: angle of the joint = `offset` + `scale` · control.

    Parameters
    ----------
    joint : str
    low, high : float
        Ends of the control, infinite where it has none. What is beyond them counts as the end, as in MuJoCo.
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
        """What the lowest control asks for [rad or m]."""
        return self.angle(self.low)

    @property
    def angle_high(self) -> float:
        """What the highest control asks for [rad or m]."""
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
        Its number, and where in `ctrl` it is told what to do.
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
    limits = (low, high) if model.actuator_ctrllimited[seat.control] else (-math.inf, math.inf)
    unit = "m" if mujoco.mjtJoint(int(model.jnt_type[seat.number])) == mujoco.mjtJoint.mjJNT_SLIDE else "rad"
    unit = told(mount).unit or unit
    if isinstance(given, CommandMap):
        return replace(given, joint=seat.joint, unit=unit)
    if isinstance(given, str) and given == "identity":
        return CommandMap(seat.joint, *limits, unit=unit)
    if given is None and not mount.model.endless:  # no spring pulls a wheel to an angle
        law = _spring(mujoco, model, seat.actuator)
        if law is not None:
            return CommandMap(seat.joint, *limits, scale=law[0], offset=law[1], unit=unit)
    ends = _given_ends(seat.key, given, unit) if given is not None else _reach(model, seat, mount)
    if not low < high:
        raise InputError(f"command of {seat.key}", got="an actuator without a control range",
                         allowed="'identity', or a range in the model")
    scale = (ends[1] - ends[0]) / (high - low)
    return CommandMap(seat.joint, low, high, scale, (ends[0] * high - ends[1] * low) / (high - low), unit)


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
    """Return where the joint can go that the servo can be told to go to as well, or all pulses that it takes."""
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
