"""Which controller a robot's servos have: plain commands, or one that knows them and the arm that they move.

What a controller believes is its own: an inverse of each servo, and a MuJoCo model of the arm, which may differ from
the ones that it is wired to.
"""

from __future__ import annotations

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
    Sensor,
    ServoInverse,
    inverse_of,
    joined,
    tuning,
)
from servotwin.robots.arm import Arm
from servotwin.robots.mount import Mount
from servotwin.robots.places import load_mujoco

Array = NDArray[np.float64]


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
    >>> from servotwin.robots.two_link import two_link
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
    """What a controller of an arm knows.

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
    """The same, told to go half of the play further than the tool has to."""

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
    """A disturbance observer at each joint, about a controller that knows neither friction nor the other joints."""

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        rates = self._rates(known)
        alone = ComputedTorque(period=self.period, inverse=known.loaded.frictionless, bandwidth=rates.bandwidth,
                               filter_rate=rates.filter_rate)
        return DisturbanceObserver(controller=alone, inverse=known.loaded, filter_rate=rates.observer_rate)


def known_of(arm: Arm, mounts: Mapping[str, Mount], angles: Mapping[str, float], *, speed: Any = 0.0,
             frame: float = 0.0, lag: float = 0.0) -> Known:
    """Return what a controller knows that believes in an arm, and in servos at its joints.

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
