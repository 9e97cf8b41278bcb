"""The plant behind the drive, dry friction and play apart, as matrices of a linear system."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, LoadError
from servotwin.models.terms import elastic
from servotwin.models.terms.motor import inductive
from servotwin.physics.shaft import pendulum_stiffness
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.terms.numbers import Numbers

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Plant(NamedTuple):
    """Motor, gear and load: ẋ = A x + B v_a, with rows that give signals of x.

    Parameters
    ----------
    states : tuple of str
        Signal names of x; of the motor at the output shaft.
    A : ndarray, shape (n, n)
    B : ndarray, shape (n,)
        For the armature voltage v_a [V].
    angle : ndarray, shape (n,)
        Row of the output angle q [rad].
    motor_angle, motor_speed : ndarray, shape (n,)
        Rows of the motor's angle [rad] and speed [rad/s], at the output shaft.
    current : ndarray, shape (n,)
        Row of the armature current i [A].
    feedthrough : float
        Of v_a to the current: 1/R where there is no inductance [A/V].
    """

    states: tuple[str, ...]
    A: Array
    B: Array
    angle: Array
    motor_angle: Array
    motor_speed: Array
    current: Array
    feedthrough: float

    def response(self, omega: Array) -> Complex:
        """Return P(jω), output angle per armature voltage [rad/V], in the shape of `omega`."""
        s = 1j * np.asarray(omega, dtype=np.float64)[..., np.newaxis, np.newaxis] * np.eye(len(self.B))
        found: Complex = np.linalg.solve(s - self.A, self.B[:, np.newaxis])[..., 0] @ self.angle
        return found


def plant_of(numbers: Numbers, load: Load, angle: float | None = None) -> Plant:
    """Return the plant of packed numbers; pendulums count by their stiffness at `angle`, or where they hang.

    Raises
    ------
    InputError
        If the angle is not finite.
    LoadError
        If several pendulums do not hang the same way, and no angle is given.
    """
    if angle is not None and not is_finite(angle):
        raise InputError("angle", got=angle, allowed="a finite number [rad]")
    if angle is None and len({pendulum.hanging_angle for pendulum in load.pendulums}) > 1:
        raise LoadError("load", got="pendulums with several hanging angles", allowed="one hanging angle, or an angle "
                        "about which to linearise")
    shaft, twist, own = numbers.shaft, numbers.elastic, numbers.load
    k = own.stiffness + _pendulum(own.gravity, own.hanging_angle, angle)
    if not elastic.present(twist):
        return _assembled(numbers, ("output_angle", "output_speed"), np.array([shaft.J]), np.array([[shaft.b]]),
                          np.array([[k]]), output=0)
    if elastic.geared(twist):
        names = ("motor_angle", "output_angle", "motor_speed", "output_speed")
        J, b = (shaft.J - shaft.J_out, shaft.J_out), (shaft.b - shaft.b_out, shaft.b_out)
        stiffness, output = (0.0, k), 1
    else:
        names = ("output_angle", "load_angle", "output_speed", "load_speed")
        J, b = (shaft.J, twist.J), (shaft.b, twist.b)
        stiffness, output = (k, _pendulum(twist.gravity, twist.hanging_angle, angle)), 0
    between = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return _assembled(numbers, names, np.array(J), np.diag(b) + twist.c * between,
                      np.diag(stiffness) + twist.k * between, output=output)


def _pendulum(gravity: float, hanging_angle: float, angle: float | None) -> float:
    """Return the stiffness of a pendulum [N m/rad] at an angle, or where it hangs."""
    return pendulum_stiffness(hanging_angle if angle is None else angle, gravity, hanging_angle) if gravity else 0.0


def _assembled(numbers: Numbers, names: tuple[str, ...], J: Array, b: Array, k: Array, *, output: int) -> Plant:
    """Return the plant of bodies J q̈ + b q̇ + k q = (K i, 0): the motor drives the first of them."""
    motor, bodies = numbers.motor, len(J)
    K, K_b, R = motor.K, motor.K_b, motor.R
    rows, fast = np.eye(2 * bodies), inductive(motor)
    turned, first = rows[0], rows[bodies]  # angle and speed of the motor
    A = np.block([[np.zeros((bodies, bodies)), np.eye(bodies)], [-k / J[:, None], -b / J[:, None]]])
    push = first * K / J[0]  # of the current
    angle = rows[output]
    if not fast:  # R i = v_a − K_b q̇_m
        return Plant(names, A - np.outer(push, K_b / R * first), push / R, angle, turned, first, -K_b / R * first,
                     1.0 / R)
    A = np.block([[A, push[:, None]], [-K_b / motor.L * first[None, :], np.array([[-R / motor.L]])]])
    grown = 2 * bodies + 1
    return Plant((*names, "armature_current"), A, np.eye(grown)[-1] / motor.L, np.append(angle, 0.0),
                 np.append(turned, 0.0), np.append(first, 0.0), np.eye(grown)[-1], 0.0)
