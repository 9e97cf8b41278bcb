"""What compiled code reads of servos at the joints of a model, and what the model learns of them."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.robots.command_map import CommandMap, own_map
from servotwin.robots.coupling import silence
from servotwin.robots.crews import Berth
from servotwin.robots.joints_layout import ARRAYS, DRIVE
from servotwin.robots.mount import Joint
from servotwin.robots.places import Places
from servotwin.robots.told import told

Arrays = dict[str, NDArray[Any]]


def longest_tick(joints: Sequence[Joint]) -> tuple[float, str]:
    """Return the shortest frame of all servos [s], inf where none has frames, and the joint of its servo."""
    return min((float(joint.mount.model.value_or("electronics.frame_period", math.inf)), joint.name)
               for joint in joints)


def check_options(mujoco: Any, model: Any, joints: Sequence[Joint]) -> None:
    """Raise InputError where MuJoCo's options do not go with the servos."""
    longest, who = longest_tick(joints)
    if model.opt.timestep > longest:
        raise InputError("timestep of the model", got=float(model.opt.timestep),
                         allowed=f"at most a frame of the servo at joint {who}, {longest:g} s")
    if model.opt.enableflags & int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0)):
        raise InputError("option sleep of the model", got="enabled", allowed="disabled: servos do not sleep")


def maps_of(model: Any, joints: Sequence[Joint], controls: Mapping[str, CommandMap] | None) -> list[CommandMap]:
    """Return what the control of each joint's actuator asks of it: what it means itself unless another map is given.

    Raises
    ------
    UnknownNameError, InputError
        If a joint has no servo or no actuator, what is given is no map, or a control range is no angle.
    """
    given, names = dict(controls or {}), [joint.name for joint in joints]
    for name, one in given.items():
        if name not in names:
            raise UnknownNameError("joint with a servo", name, names)
        if not isinstance(one, CommandMap):
            raise InputError(f"control of joint {name}", got=one, allowed="a CommandMap")
        if joints[names.index(name)].actuator < 0:
            raise InputError(f"control of joint {name}", got=str(one), allowed="nothing: it has no actuator")
    return [given.get(joint.name) or own_map(model, joint) for joint in joints]


def arrays_of(joints: Sequence[Joint], berths: Sequence[Berth], maps: Sequence[CommandMap]) -> Arrays:
    """Return the arrays of `joints_layout.ARRAYS`, for all servos."""
    arrays: Arrays = {name: np.zeros(len(joints), np.int64 if name.endswith("_at") else np.float64) for name in ARRAYS}
    for k, (joint, one) in enumerate(zip(joints, maps, strict=True)):
        how = told(joint.mount)
        own = {"angle_at": joint.angle_at, "speed_at": joint.speed_at, "command_at": joint.command_at,
               "gain": joint.mount.gain, "zero": joint.mount.zero, "control_scale": one.scale,
               "control_offset": one.offset, "control_low": one.low, "control_high": one.high, "told_gain": how.gain,
               "told_zero": how.zero, "rest": how.rest}
        for name, value in own.items():
            arrays[name][k] = value
    for berth in berths:
        which = berth.crew.which
        arrays["lower"][which], arrays["upper"][which] = berth.entry.travel()
        arrays["low"][which], arrays["high"][which] = berth.entry.commands(berth.kind)
        arrays["armature"][which] = berth.entry.own_inertia() / arrays["gain"][which] ** 2
    return arrays


def put_into_model(mujoco: Any, model: Any, joints: Sequence[Joint], armature: NDArray[np.float64]) -> None:
    """Let MuJoCo know of rotors and gears, and silence the actuators that servos replace."""
    for joint, own in zip(joints, armature.tolist(), strict=True):
        model.dof_armature[joint.speed_at] = own
        if joint.actuator >= 0:
            silence(model, joint.actuator)
    mujoco.mj_setConst(model, mujoco.MjData(model))


def words_of(model: Any, joints: Sequence[Joint], arrays: Arrays, at: Places, more: Mapping[str, int],
             asked: Any) -> NDArray[np.int64]:
    """Return the words of `joints_layout.DRIVE`, of which `more` has some; `asked` is what compiled code may call."""
    own = [joint.actuator for joint in joints if joint.actuator >= 0]
    values = {
        "servos": len(joints), "dofs": model.nv, "coordinates": model.nq, "wide": int(at.wide), "bodies": model.nbody,
        "timestep": at.timestep, "integrator": at.integrator, **at.data, **at.functions, "slot": at.slot,
        "others": int(len(model.actuator_trntype) > len(own)),
        **{name: array.ctypes.data for name, array in arrays.items()},
        "longest": int(np.float64(longest_tick(joints)[0]).view(np.int64)),
        "ask": ctypes.cast(asked, ctypes.c_void_p).value or 0, **more}
    return np.array([values[name] for name in DRIVE], np.int64)
