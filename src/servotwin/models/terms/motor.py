"""The motor: torque and back-EMF at the output shaft, resistance and inductance of its winding."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.terms.dependence import FREE_RUNNING, ON_I, STRAIGHT
from servotwin.models.terms.given import Given, either
from servotwin.physics.gear import motor_from_output, output_torque


class Motor(NamedTuple):
    """Numbers of the motor, at the output shaft."""

    K: float  # N k_a
    K_b: float  # N k_b
    R: float
    L: float  # 0: the current follows at once


NO_MOTOR = Motor(0.0, 0.0, 1.0, 0.0)
ACTS = {"K": STRAIGHT, "K_b": STRAIGHT, "R": STRAIGHT, "L": ON_I}
"""Where each number acts."""


def inductive(motor: Motor) -> bool:
    """Tell whether the current has inertia."""
    return motor.L > 0.0


def depends(motor: Motor) -> int:
    """Return on what the acceleration depends through the motor."""
    return ON_I if motor.L > 0.0 else 0


def needs(motor: Motor) -> int:
    """Return what else there is to be followed of the motor."""
    return 0 if motor.K_b > 0.0 else FREE_RUNNING


def pack(given: Given, reduction: float) -> Motor:
    """Return the numbers of a servo's motor."""
    return Motor(output_torque(given.motor_torque_constant, reduction),
                 motor_from_output(given.motor_back_emf_constant, reduction),
                 given.motor_armature_resistance, either(given.motor_armature_inductance, 0.0))
