"""Which controller a robot's servos have: plain commands, or one with a model of them and of the arm.

A controller has models of its own: an inverse of each servo, and a MuJoCo model of the arm, which may differ from
the ones that it is wired to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.control import (
    AheadOfServo,
    ComputedTorque,
    Controller,
    DeadbandCompensation,
    DisturbanceObserver,
    Encoder,
    Feedforward,
    Pid,
    PlainCommand,
    PlayCompensation,
    Reference,
    Sensor,
    ServoInverse,
    inverse_of,
    joined,
    tuning,
)
from servotwin.control.controller import Measured, Readings
from servotwin.control.ports import wire_of
from servotwin.errors import InputError
from servotwin.robots.arms.arm import Arm
from servotwin.robots.drive import ServoDrive
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import begin
from servotwin.robots.servos.command_map import told
from servotwin.robots.servos.mount import Mount
from servotwin.robots.servos.record import ServoRecord

# --- Servos of a robot as what controllers are wired to: the port of `servotwin.control`, with joints as --------------

# All angles here are those of the servos' shafts, as their controllers see them; a `Mount` makes them the joints'.

Array = NDArray[np.float64]
_SOON = 1e-3  # of a step


class DrivePort:
    """All servos of a `ServoDrive` as one port: it measures arrays (n,), and takes them.

    Time 0 of the port is the beginning of the settling before the motion.

    Parameters
    ----------
    drive : ServoDrive
    mounts : mapping of str to Mount
        Of its joints.
    motion : Motion
        Where the robot begins, and what it is to do.
    settle : float
        How long it rests before the motion [s]
    sensors : sequence of Sensor
        All that a controller sees; each looks at all servos.
    resolution : float
        Of pulses that are sent [s].
    seed : int
        Of all noise.

    Raises
    ------
    InputError
        If some servos take voltages and others angles.
    """

    def __init__(self, drive: ServoDrive, mounts: Mapping[str, Mount], motion: Motion, *, settle: float,
                 sensors: Sequence[Sensor] = (), resolution: float = 1e-6, seed: int = 0) -> None:
        self.drive, self.motion, self._mounts, self._settle = drive, motion, mounts, settle
        self._sensors, self._seed = tuple(sensors), seed
        ordered = [mounts[joint] for joint in drive.joints]
        self._zero, self._gain = (np.array(column) for column in zip(
            *((mount.zero, mount.gain) for mount in ordered), strict=True))
        self._told_zero, self._told_gain = (np.array(column) for column in zip(
            *((each.zero, each.gain) for each in map(told, ordered)), strict=True))
        self._wires = [_Sent(mount, resolution) for mount in ordered]
        self._takes = {wire.takes for wire in self._wires}
        if len(self._takes) > 1:
            raise InputError("servos of one controller", got=" and ".join(sorted(self._takes)), allowed="one of them")
        self._begin()

    def _begin(self) -> None:
        self.data = load_mujoco().MjData(self.drive.model)
        begin(self.drive, self.data, self.motion, self._mounts, -self._settle)
        self.poses: list[Array] = []
        self._readings = Readings(self._sensors, self._seed, len(self._zero))

    @property
    def takes(self) -> str:
        """A voltage of bare bridges, an angle of servos."""
        return next(iter(self._takes))

    @property
    def frame(self) -> float:
        """The longest of all servos [s]."""
        return max(wire.frame for wire in self._wires)

    @property
    def lag(self) -> float:
        """The longest of all servos [s]."""
        return max(wire.lag for wire in self._wires)

    @property
    def nominal(self) -> ServoInverse | None:
        """Nothing: what the joints carry changes with the posture."""
        return None

    @property
    def time(self) -> float:
        """Now, since the beginning of the settling [s]."""
        return float(self.data.time) + self._settle

    def start(self, angle: Any) -> None:
        """Begin anew where the motion begins."""
        if self.poses:
            self._begin()

    def measure(self) -> Measured:
        """Return what the sensors show now, arrays (n,)."""
        return self._readings.at(self.time, self._true)

    def _true(self, name: str) -> Array:
        if name == "output_angle":  # before the first tick servos show nothing yet
            places = [self._at(joint) for joint in self.drive.joints]
            return np.asarray((self.data.qpos[places] - self._zero) / self._gain)
        if name == "motor_angle" and not self.poses:  # centred in the play
            reductions = [self._mounts[joint].model.value("gear.gear_reduction") for joint in self.drive.joints]
            return np.asarray(self._true("output_angle") * reductions)
        return self.drive.look(self.data, name)

    def _at(self, joint: str) -> int:
        return int(self.drive.model.jnt_qposadr[self.drive.model.joint(joint).id])

    def send(self, command: Any) -> None:
        """Command voltages [V] or angles [rad] from now on, an array (n,), the nearest that the wires carry."""
        values = np.broadcast_to(np.asarray(command, dtype=np.float64), self._zero.shape).tolist()
        if not all(map(math.isfinite, values)):
            raise InputError(f"command at {self.time:g} s", got=values, allowed="finite numbers")
        shafts = np.array([wire.shaft(value) for wire, value in zip(self._wires, values, strict=True)])
        goals = self._told_zero + self._told_gain * shafts
        self.drive.command(self.data, dict(zip(self.drive.joints, goals.tolist(), strict=True)))

    def wait(self, until: float) -> None:
        """Return at a time [s]."""
        step = float(self.drive.model.opt.timestep)
        while self.time < until - _SOON * step:
            self.drive.step(self.data)
            self.poses.append(self.data.qpos.copy())

    def record(self, time: Array) -> Mapping[str, Any]:
        """Return true signals of all servos at times since the beginning [s], by name, of shape (m, n)."""
        return _Signals(list(self.drive.result(self.data).values()), time - self._settle)


class _Signals(Mapping[str, Array]):
    """Signals of several servos, side by side."""

    def __init__(self, records: Sequence[ServoRecord], time: Array) -> None:
        self._records, self._time = records, time

    def __getitem__(self, name: str) -> Array:
        return np.stack([np.interp(self._time, record.time, record[name]) for record in self._records], axis=1)

    def __iter__(self) -> Any:
        return iter(name for name in self._records[0].names if all(name in one.names for one in self._records))

    def __len__(self) -> int:
        return len(list(iter(self)))


class _Sent:
    """How a command gets to one servo: pulses in steps, duties as goals."""

    def __init__(self, mount: Mount, resolution: float) -> None:
        model = mount.model
        wire = wire_of(model, model.servo, resolution)
        self.takes, self.frame, self.lag, self._carried = wire.takes, wire.frame, wire.lag, wire.carried
        self._per_angle, self._first = 1.0, 0.0
        if wire.unit == "s":  # pulses: back to the angle that they stand for
            exact = wire_of(model, model.servo, 0.0).carried
            middle = 0.5 * math.pi
            self._per_angle = (exact(middle + 0.1) - exact(middle - 0.1)) / 0.2
            self._first = exact(middle) - self._per_angle * middle

    def shaft(self, value: float) -> float:
        """Return the angle [rad] that the drive has to be given: of a bare bridge its duty."""
        return (self._carried(value) - self._first) / self._per_angle


class Delayed:
    """A path that begins later, and ends as much later.

    Parameters
    ----------
    path : Path
    by : float
        [s]
    """

    def __init__(self, path: Any, by: float) -> None:
        self._path, self._by = path, by

    @property
    def duration(self) -> float:
        """When it ends, with as long a rest behind it as before it [s]."""
        return float(self._path.duration) + 2.0 * self._by

    def at(self, time: Any) -> Reference:
        """Return what is asked for at `time` [s]."""
        found: Reference = self._path.at(np.asarray(time, dtype=np.float64) - self._by)
        return found


# --- Which controller a robot's servos have: plain commands, or one with a model of them and of the arm ---------------


class RigidBody:
    """Load torques at the shafts of servos, by inverse dynamics of the arm that a controller believes in.

    Parameters
    ----------
    model : MjModel
        Without rotors, which belong to the inverse of the servo.
    mounts : mapping of str to Mount

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots.arms.arm import two_link
    >>> arm = two_link()
    >>> body = RigidBody(arm.model(), arm.mounts(st.PulseServo(st.load_servo("hitec-hs-755hb"))))
    >>> body(np.zeros(2), np.zeros(2), np.zeros(2)).shape
    (2,)
    """

    def __init__(self, model: Any, mounts: Mapping[str, Mount]) -> None:
        self._mujoco, self._model = load_mujoco(), model
        self._data = self._mujoco.MjData(model)
        self._zero = np.array([mount.zero for mount in mounts.values()])
        self._gain = np.array([mount.gain for mount in mounts.values()])
        joints = [model.joint(name) for name in mounts]
        self._angles = [int(joint.qposadr[0]) for joint in joints]
        self._dofs = [int(joint.dofadr[0]) for joint in joints]

    def __call__(self, angle: Any, speed: Any, acceleration: Any) -> Array:
        """Return the torque [N m] that each servo has to give for a motion of all shafts [rad], [rad/s], [rad/s²]."""
        data = self._data
        data.qpos[self._angles] = self._zero + self._gain * angle
        data.qvel[self._dofs] = self._gain * speed
        data.qacc[self._dofs] = self._gain * acceleration
        self._mujoco.mj_inverse(self._model, data)
        return np.asarray(self._gain * data.qfrc_inverse[self._dofs])

    def inertia(self, angle: Any) -> Array:
        """Return the inertia [kg m²] that each servo feels, the others standing, at angles of all shafts [rad]."""
        own = np.eye(len(self._gain))
        rest = self(angle, 0.0, 0.0 * self._gain)
        return np.array([self(angle, 0.0, row)[k] - rest[k] for k, row in enumerate(own)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """Knowledge of an arm's controller.

    Parameters
    ----------
    inverse : ServoInverse
        Of all servos, arrays (n,).
    body : RigidBody
    start : ndarray, shape (n,)
        Angles at the beginning [rad].
    speed : ndarray, shape (n,)
        Of the motion, root mean square [rad/s].
    play : ndarray, shape (n,)
        Of the gears, in all [rad].
    frame : float
        How often a new command can matter, 0 at any time [s].
    lag : float
        From a command until it acts [s].
    """

    inverse: ServoInverse
    body: RigidBody
    start: Array
    speed: Array
    play: Array
    frame: float
    lag: float

    @cached_property
    def loaded(self) -> ServoInverse:
        """The servos with what each feels of the arm at the beginning, the others standing."""
        return self.inverse.replace(load_inertia=self.body.inertia(self.start))


class Steering(Protocol):
    """Makes the controller of an arm."""

    @property
    def bare(self) -> bool:
        """Whether the chips of the servos are bypassed: it commands voltages."""
        ...

    def sensors(self, mounts: Mapping[str, Mount]) -> Sequence[Sensor]:
        """Return what it has to see of the servos at these joints."""
        ...

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        ...


@dataclass(frozen=True, kw_only=True)
class _Through:
    """Commands angles through the servos' own loops, every `period` [s] where frames are not longer, blindly."""

    period: float = 0.02

    bare = False

    def sensors(self, mounts: Mapping[str, Mount]) -> tuple[Sensor, ...]:
        """None."""
        return ()

    def _every(self, known: Known) -> float:
        return max(known.frame, self.period)


@dataclass(frozen=True, kw_only=True)
class Plain(_Through):
    """Sends each servo where it has to be: what a program without a controller does.

    Parameters
    ----------
    period : float
        Of its commands, where frames are not longer [s].
    """

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        return PlainCommand(period=self._every(known))


@dataclass(frozen=True, kw_only=True)
class BeyondDeadband(_Through):
    """Asks each servo for so much more as its deadband and friction swallow; no sensor.

    Parameters
    ----------
    period : float
        Of its commands, where frames are not longer [s].
    """

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        swallowed = tuning.lag_angle(known.loaded, speed=known.speed, frame=known.frame)
        return DeadbandCompensation(controller=PlainCommand(period=self._every(known)), half_width=swallowed)


@dataclass(frozen=True, kw_only=True)
class Ahead(_Through):
    """Asks each servo for so much more that its own loop gives the voltage that the arm takes, by (40); no sensor.

    Parameters
    ----------
    period : float
        Of its commands, where frames are not longer [s].
    """

    period: float = 0.005

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        return AheadOfServo(inverse=known.inverse, controller=Feedforward(
            period=self._every(known), inverse=known.inverse, load_torque=known.body))


@dataclass(frozen=True, kw_only=True)
class _Bare:
    """Commands voltages past the chips, every `period` [s], by what encoders at the horns show."""

    period: float = 0.002
    encoder: Encoder = field(default_factory=Encoder)

    bare = True

    def sensors(self, mounts: Mapping[str, Mount]) -> tuple[Sensor, ...]:
        """Return the encoders."""
        return (self.encoder,)

    def _rates(self, known: Known) -> tuning.Rates:
        """Return the rates that suit the slowest joint: one filter for all."""
        each = tuning.rates(known.loaded, period=self.period, lag=known.lag, frame=known.frame,
                            count=self.encoder.count)
        return tuning.Rates(*(float(np.min(rate)) for rate in each))


@dataclass(frozen=True, kw_only=True)
class OwnPid(_Bare):
    """A PID at each joint, its poles placed for motor and arm at the beginning of the task."""

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        rates, most = self._rates(known), known.inverse.voltage_limit
        return Pid(period=self.period, filter_rate=rates.filter_rate, lower=-most, upper=most,
                   **tuning.pid_gains(known.loaded, rates.bandwidth)._asdict())


@dataclass(frozen=True, kw_only=True)
class AtMotor(OwnPid):
    """The same by encoders at the motors, as finely at the horn: it does not see the play of the gears."""

    def sensors(self, mounts: Mapping[str, Mount]) -> tuple[Sensor, ...]:
        """Return the encoders, that show the horns' angles where there is no play."""
        reductions = np.array([mount.model.value("gear.gear_reduction") for mount in mounts.values()])
        return (replace(self.encoder, signal="motor_angle", shows="output_angle", ratio=1.0 / reductions),)


@dataclass(frozen=True, kw_only=True)
class BeyondPlay(AtMotor):
    """The same, commanded to go half of the play further than the tool has to."""

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        return PlayCompensation(controller=super().controller(known), play=known.play)


@dataclass(frozen=True, kw_only=True)
class RigidBodyTorque(_Bare):
    """Computed torque: rigid-body dynamics of the arm, friction and motor of each servo by (40)."""

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        rates = self._rates(known)
        return ComputedTorque(period=self.period, inverse=known.inverse, bandwidth=rates.bandwidth,
                              filter_rate=rates.filter_rate, load_torque=known.body)


@dataclass(frozen=True, kw_only=True)
class Observed(_Bare):
    """A disturbance observer at each joint, about a controller that models neither friction nor the other joints."""

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        rates = self._rates(known)
        alone = ComputedTorque(period=self.period, inverse=known.loaded.frictionless, bandwidth=rates.bandwidth,
                               filter_rate=rates.filter_rate)
        return DisturbanceObserver(controller=alone, inverse=known.loaded, filter_rate=rates.observer_rate)


def known_of(arm: Arm, mounts: Mapping[str, Mount], angles: Mapping[str, float], *, speed: Any = 0.0,
             frame: float = 0.0, lag: float = 0.0) -> Known:
    """Return the model that a controller has of an arm, and of servos at its joints.

    Parameters
    ----------
    arm : Arm
    mounts : mapping of str to Mount
    angles : mapping of str to float
        Of the joints, at the beginning [rad or m]
    speed : float or ndarray, shape (n,)
        Of the servos' shafts in the motion, root mean square [rad/s].
    frame, lag : float
        Of what the controller is wired to [s].
    """
    start = np.array([(angles[joint] - mount.zero) / mount.gain for joint, mount in mounts.items()])
    return Known(inverse=joined([inverse_of(mount.model) for mount in mounts.values()]),
                 body=RigidBody(arm.model(), mounts), start=start, speed=np.broadcast_to(speed, start.shape),
                 play=np.array([mount.model.value_or("gear.backlash", 0.0) for mount in mounts.values()]),
                 frame=frame, lag=lag)


STEERINGS: Mapping[str, Callable[[], Steering]] = MappingProxyType({
    "plain": Plain, "deadband": BeyondDeadband, "feedforward": Ahead, "pid": OwnPid, "motor-pid": AtMotor,
    "play": BeyondPlay, "computed-torque": RigidBodyTorque, "observer": Observed})
"""By name."""
