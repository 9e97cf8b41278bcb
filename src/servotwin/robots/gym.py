"""`ServoActuated`: servos in the place of the actuators of a Gymnasium environment.

Importing this gives Gymnasium the names of servotwin's own: `servotwin/SO101Reach-v0` and `servotwin/Biped-v0`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from servotwin.errors import InputError, MissingExtraError, ServotwinError, SimulationError, UnknownNameError
from servotwin.models import Model
from servotwin.robots.drive import ServoDrive
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.command_map import CommandMap, maps, seats
from servotwin.robots.servos.mount import Mount
from servotwin.robots.servos.record import Record

try:
    import gymnasium
except ImportError:
    raise MissingExtraError("gymnasium", "robots") from None

_T = TypeVar("_T")
_OWN = {"SO101Reach": 100, "Biped": 500}  # environments, and steps of an episode
for _name, _steps in _OWN.items():
    if f"servotwin/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(f"servotwin/{_name}-v0", entry_point=f"servotwin.robots.trainers.environments:{_name}",
                           max_episode_steps=_steps)
_LOOKS = {"servo_current": "armature_current", "servo_voltage": "bus_voltage",
          "servo_temperature": "winding_temperature", "servo_trip": "trip"}
_LOST = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")  # after each of these MuJoCo starts anew


def seen(drive: ServoDrive, data: Any) -> dict[str, Any]:
    """Return what `info` has of servos, in the order of `drive.joints`; a signal that not all have is left out."""
    found = {name: drive.look(data, signal) for name, signal in _LOOKS.items()}
    found["servo_trip"] = np.nan_to_num(found["servo_trip"])  # what has no protection does not trip
    known = {name: values for name, values in found.items() if np.isfinite(values).all()}
    return {"servo_torque": drive.torque(data), **known}


class ServoActuated(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """A Gymnasium environment on MuJoCo whose joints real servos move, in the place of its actuators.

    Controls that the environment writes into `data.ctrl` stay there, for its rewards, and are the command of the servo
    by a map that `maps` shows. The control of a position actuator means the angle that it meant. Of a motor, and of
    anything else, the control range goes linearly onto where the joint can go that the servo can be sent to as
    well. Action space, observations and rewards are those of the environment. A policy for torques has to be trained
    anew: the action now says where to go.

    The servos begin anew at `reset`. In `qfrc_actuator` and `actuator_force` there is nothing of them: MuJoCo has their
    torques [N m], or forces [N], among the passive ones. After each step `info` has them as "servo_torque", currents of
    the windings as "servo_current" [A], voltages of the supplies as "servo_voltage" [V], temperatures of the windings
    as "servo_temperature" [K], and as "servo_trip" the protections that act (0: none, 1 overload, 2 current, 3 heat,
    4 undervoltage), each in the order of `drive.joints`; a signal that not all servos have is left out.

    Parameters
    ----------
    env : gymnasium.Env
        Its `unwrapped` has an MjModel as `model` and an MjData as `data`, and lets `mujoco.mj_step` advance them.
        The model is changed.
    servos : mapping of str to Model or Mount
        By the name of the actuator, or of its joint.
    command : mapping or str, optional
        Other maps of actuators: (lowest, highest) angle of the joint [rad] or place [m] for the control range, a
        `CommandMap`, or "identity" where the control is the angle; "identity" alone: of all.
    bus : Supply or sequence of tuple (Supply, names), optional
        Supplies that servos share.
    joint_friction : str
        Treatment of damping and friction loss of these joints: "clear" (they stand for the actuator's, and a servo
        has its own), "keep", where they are those of a bearing, or "refuse".
    assume_heat : bool
        As of `ServoDrive`.

    Attributes
    ----------
    drive : ServoDrive
    maps : dict of str to CommandMap
        By the names in `servos`.

    Raises
    ------
    InputError
        Or one of its kinds, on bad input; also while stepping, if another control callback of MuJoCo is active.
    SimulationError
        While stepping, if a servo or MuJoCo cannot continue.
    MissingExtraError
        If MuJoCo or Gymnasium is not installed.

    Examples
    --------
    >>> import gymnasium
    >>> import servotwin as st
    >>> servo = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    >>> env = ServoActuated(gymnasium.make("Reacher-v5"), {"joint0": servo, "joint1": servo})
    >>> print(env.maps["joint1"])
    joint1: control -1 to 1 is -3 to 3 rad
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step([0.1, -0.1])
    >>> info["servo_torque"].shape
    (2,)
    """

    def __init__(self, env: gymnasium.Env[Any, Any], servos: Mapping[str, Model | Mount], *, command: Any = None,
                 bus: Any = None, joint_friction: str = "clear", assume_heat: bool = True) -> None:
        _check(env, servos)
        kept = {"servos": dict(servos), "command": command, "bus": bus, "joint_friction": joint_friction,
                "assume_heat": assume_heat}
        gymnasium.utils.RecordConstructorArgs.__init__(self, **kept)
        gymnasium.Wrapper.__init__(self, env)
        self._kept, model = kept, self._bare.model
        places = seats(model, servos)
        mounts = {key: given if isinstance(given, Mount) else Mount(given) for key, given in servos.items()}
        self.maps: dict[str, CommandMap] = maps(model, places, mounts, command)
        self.drive = ServoDrive(
            model, {seat.joint: mounts[seat.key] for seat in places}, joint_friction=joint_friction,
            assume_heat=assume_heat, bus=_by_joint(bus, {seat.key: seat.joint for seat in places}),
            controls={one.joint: one for one in self.maps.values()})

    @property
    def data(self) -> Any:
        """MuJoCo's data of the environment."""
        return self._bare.data

    @property
    def _bare(self) -> Any:
        return self.unwrapped

    # --- what an environment does -------------------------------------------------------------------------------------

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Advance the environment with its servos."""
        observation, reward, terminated, truncated, info = self._with_servos(lambda: self.env.step(action))
        lost = [name for name in _LOST if self.data.warning[getattr(load_mujoco().mjtWarning, name)].number]
        if lost:
            raise SimulationError("MUJOCO", float(self.data.time), "MuJoCo has met a number that is not finite, or too "
                                  f"large, and has started anew ({', '.join(lost)})")
        return observation, reward, terminated, truncated, {**info, **seen(self.drive, self.data)}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Let the environment begin anew, and the servos with it, at rest.

        Raises
        ------
        InputError, UnknownNameError
            If options are no mapping, or given to an environment that reads none, as those of Gymnasium on MuJoCo.
        """
        if options is not None and not isinstance(options, Mapping):
            raise InputError("options of reset", got=options, allowed="a mapping, or None")
        if options and not _reads_options(self.env):
            raise UnknownNameError("option of reset", next(iter(options)), (),
                                   allowed="none: the environment reads none")
        with contextlib.suppress(ServotwinError):
            self.drive.raise_failure(self.data)  # what went wrong in the episode before
        self.drive.reset(self.data)
        return self._with_servos(lambda: self.env.reset(seed=seed, options=options))

    def _with_servos(self, call: Callable[[], _T]) -> _T:
        """Return what a call returns, with the servos in MuJoCo's control callback meanwhile."""
        mujoco = load_mujoco()
        if self._bare.model is not self.drive.model:
            raise InputError("model of the environment", got="another one than when it was wrapped",
                             allowed="the same: wrap an environment that changes its model anew")
        before, servos = mujoco.get_mjcb_control(), self.drive.callback()
        mujoco.set_mjcb_control(servos)
        try:
            result = call()
        finally:
            mujoco.set_mjcb_control(before)
        self.drive.raise_failure(self.data)
        return result

    # --- what shows ---------------------------------------------------------------------------------------------------

    def record(self) -> None:
        """Keep from now on what shows of all servos at the end of each tick, of the last episode."""
        self.drive.record(self.data)

    def result(self) -> Record:
        """Return what was kept, by joint.

        Raises
        ------
        InputError
            If nothing is kept.
        """
        return self.drive.result(self.data)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy by the constructor's arguments, as Gymnasium's environments on MuJoCo do."""
        return _again, (type(self), self.env, {**self._kept, "command": self.maps})


def _again(kind: type[ServoActuated], env: Any, arguments: dict[str, Any]) -> ServoActuated:
    return kind(env, **arguments)


def _reads_options(env: Any) -> bool:
    """Tell whether an environment may read the options of its reset: those of Gymnasium on MuJoCo do not."""
    from gymnasium.envs.mujoco import MujocoEnv

    layers = [env]
    while isinstance(layers[-1], gymnasium.Wrapper):
        layers.append(layers[-1].env)
    return any(not type(one).reset.__module__.startswith("gymnasium.") for one in layers) or not isinstance(
        layers[-1], MujocoEnv)


def _check(env: Any, servos: Any) -> None:
    """Raise InputError if an environment cannot have servos."""
    mujoco = load_mujoco()
    if not isinstance(env, gymnasium.Env):
        raise InputError("env", got=type(env).__name__, allowed="a gymnasium.Env, one of a vector at a time")
    below = env
    while isinstance(below, gymnasium.Wrapper):
        if isinstance(below, ServoActuated):
            raise InputError("env", got="one that has servos", allowed="one without: give all servos at once")
        below = below.env
    bare = env.unwrapped
    found = getattr(bare, "model", None), getattr(bare, "data", None)
    if not isinstance(found[0], mujoco.MjModel) or not isinstance(found[1], mujoco.MjData):
        raise InputError(f"model and data of {type(bare).__name__}", got=", ".join(type(one).__name__ for one in found),
                         allowed="an MjModel and an MjData")
    if not isinstance(servos, Mapping) or not servos:
        raise InputError("servos of an environment", got=servos, allowed="a mapping of actuators to models or Mounts")


def _by_joint(bus: Any, joints: Mapping[str, str]) -> Any:
    """Return supplies with names of joints for those of actuators; anything else as it is, for the drive to refuse."""
    try:
        return [(supply, [joints.get(name, name) for name in names]) for supply, names in bus]
    except (TypeError, ValueError):
        return bus

