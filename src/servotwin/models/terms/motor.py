"""The motor: torque and back-EMF at the output shaft, resistance and inductance of its winding."""

from __future__ import annotations

from typing import NamedTuple

from servotwin import physics
from servotwin.models.terms.dependence import FREE_RUNNING, ON_I, STRAIGHT
from servotwin.models.terms.given import Given


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


def pack(model: Given, reduction: float, inductance: float) -> Motor:
    """Return the numbers of a model's motor."""
    return Motor(K=physics.output_torque(model.value("motor.torque_constant"), reduction),
                 K_b=physics.motor_from_output(model.value("motor.back_emf_constant"), reduction),
                 R=model.value("motor.armature_resistance"), L=inductance)
