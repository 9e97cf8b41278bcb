"""The load on the shaft, inertia and damping apart: dry friction, spring, pendulum, and torque over time."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.terms.dependence import CURVED_Q, DRY, ON_Q
from servotwin.models.terms.given import Hung
from servotwin.physics.shaft import pendulum_stiffness, pendulum_torque, spring_torque

_TOO_FAR = 1e12  # rad


class Load(NamedTuple):
    """Numbers of the load."""

    coulomb: float  # dry friction
    stiffness: float
    rest_angle: float
    gravity: float  # m g l
    hanging_angle: float


NO_LOAD = Load(0.0, 0.0, 0.0, 0.0, 0.0)
ACTS = {"coulomb": DRY, "stiffness": ON_Q, "rest_angle": ON_Q, "gravity": CURVED_Q, "hanging_angle": CURVED_Q}
"""Where each number acts."""


def dry(load: Load) -> bool:
    """Tell whether the load has dry friction of its own."""
    return load.coulomb > 0.0


def springy(load: Load) -> bool:
    """Tell whether there is a spring."""
    return load.stiffness != 0.0


def swings(load: Load) -> bool:
    """Tell whether there is a pendulum."""
    return load.gravity != 0.0


def bends(load: Load) -> bool:
    """Tell whether the torque changes with the angle."""
    return load.stiffness != 0.0 or load.gravity != 0.0


def depends(load: Load) -> int:
    """Return on what the acceleration depends through the load, friction apart."""
    return (ON_Q if load.stiffness != 0.0 else 0) | (CURVED_Q if load.gravity != 0.0 else 0)


def external_torque(load: Load, tau: float, q: float) -> float:
    """Return τ_ext [N m] against +q, given its part `tau` that depends on time alone."""
    torque = tau + spring_torque(q, load.stiffness, load.rest_angle)
    if load.gravity != 0.0:
        if not abs(q) < _TOO_FAR:  # a trial step may be far too long
            return math.nan
        torque += pendulum_torque(q, load.gravity, load.hanging_angle)
    return torque


def stiffness_at(load: Load, q: float) -> float:
    """Return ∂τ_ext/∂q [N m/rad]."""
    k = spring_torque(1.0, load.stiffness)
    if load.gravity != 0.0:
        k += pendulum_stiffness(q, load.gravity, load.hanging_angle)
    return k


def pack(hung: Hung) -> Load:
    """Return the numbers of a load."""
    return Load(hung.coulomb_torque, hung.stiffness, hung.rest_angle, hung.gravity_torque, hung.hanging_angle)
