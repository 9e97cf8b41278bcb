"""Which controller a robot's servos have: plain commands, or one that knows them and the arm that they move.

What a controller believes is its own: an inverse of each servo, and a MuJoCo model of the arm, which may differ from
the ones that it is wired to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.control import Controller, PlainCommand, Sensor, ServoInverse, inverse_of, joined
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
    frame : float
        How often a new command can matter, 0 at any time [s].
    """

    inverse: ServoInverse
    body: RigidBody
    start: Array
    frame: float


class Steering(Protocol):
    """Makes the controller of an arm."""

    @property
    def bare(self) -> bool:
        """Whether the chips of the servos are bypassed: it commands voltages."""
        ...

    @property
    def sensors(self) -> Sequence[Sensor]:
        """What it has to see."""
        ...

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        ...


@dataclass(frozen=True, kw_only=True)
class Plain:
    """Sends each servo where it has to be: what a program without a controller does.

    Parameters
    ----------
    period : float
        Where the servos have no frame [s].
    """

    period: float = 0.02

    bare = False
    sensors: tuple[Sensor, ...] = ()

    def controller(self, known: Known) -> Controller:
        """Return the controller."""
        return PlainCommand(period=known.frame or self.period)


def known_of(arm: Arm, mounts: Mapping[str, Mount], start: Array, frame: float) -> Known:
    """Return what a controller knows that believes in an arm and in servos at its joints."""
    return Known(inverse=joined([inverse_of(mount.model) for mount in mounts.values()]),
                 body=RigidBody(arm.model(), mounts), start=start, frame=frame)


STEERINGS: dict[str, Callable[[], Steering]] = {"plain": Plain}
"""By name."""
