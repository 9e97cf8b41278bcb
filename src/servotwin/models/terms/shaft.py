"""The shaft: inertia, viscous friction and acceleration, and how it slides or rests."""

from __future__ import annotations

from typing import NamedTuple

from servotwin.models.state.modes import BACKWARD, FORWARD, FREE, ON_LOWER, ON_UPPER, STUCK
from servotwin.models.terms.dependence import BY_SHARE, SHOWN, SPRING, STRAIGHT, TWO_BODIES
from servotwin.models.terms.given import Given, Hung, inertia_on
from servotwin.physics.friction import sticks
from servotwin.physics.gear import output_inertia, output_viscous_friction
from servotwin.physics.shaft import shaft_acceleration


class Shaft(NamedTuple):
    """Numbers of motor and load as one body, and of the output side alone."""

    J: float  # N² J_m + J_L
    b: float  # N² B_m + B_L
    J_out: float
    b_out: float


NO_SHAFT = Shaft(1.0, 0.0, 0.0, 0.0)
_OF_OUTPUT = TWO_BODIES | SPRING | SHOWN
ACTS = {"J": STRAIGHT, "b": STRAIGHT, "J_out": _OF_OUTPUT, "b_out": _OF_OUTPUT | BY_SHARE}
"""Where each number acts."""


def accelerated(shaft: Shaft, torque: float) -> float:
    """Return ẇ [rad/s²] of motor and output as one by a torque alone."""
    return shaft_acceleration(torque, 0.0, 0.0, 0.0, 0.0, shaft.J)


def acceleration(shaft: Shaft, torque: float, w: float, dry: float, against: float) -> float:
    """Return ẇ [rad/s²] of motor and output as one."""
    return shaft_acceleration(torque, w, dry, against, shaft.b, shaft.J)


def motor_acceleration(shaft: Shaft, torque: float, w: float, dry: float) -> float:
    """Return ẇ [rad/s²] of the motor alone."""
    return shaft_acceleration(torque, w, dry, 0.0, shaft.b - shaft.b_out, shaft.J - shaft.J_out)


def output_acceleration(shaft: Shaft, w: float, dry: float, against: float) -> float:
    """Return ẇ [rad/s²] of the output side alone."""
    return shaft_acceleration(0.0, w, dry, against, shaft.b_out, shaft.J_out)


def sliding(forward: bool, dry: bool) -> int:
    """Return the contact of a shaft that moves, `dry` where there is dry friction."""
    if not dry:
        return FREE
    return FORWARD if forward else BACKWARD


def from_rest(torque: float, backward: float, forward: float, at_upper: bool, at_lower: bool, dry: bool) -> int:
    """Return the contact of a shaft at rest under a torque [N m], which friction holds up to two bounds [N m]."""
    if not sticks(torque, forward, backward):
        if torque > 0.0:
            return ON_UPPER if at_upper else sliding(True, dry)
        return ON_LOWER if at_lower else sliding(False, dry)
    if dry:
        return STUCK
    if at_upper and torque >= 0.0:
        return ON_UPPER
    return ON_LOWER if at_lower and torque <= 0.0 else FREE


def pack(given: Given, hung: Hung, reduction: float) -> Shaft:
    """Return the numbers of a servo's shaft: the motor reflected through the gear, and the load on it."""
    J_L, B_L = inertia_on(given, hung), hung.viscous_friction
    return Shaft(output_inertia(given.motor_rotor_inertia, J_L, reduction),
                 output_viscous_friction(given.motor_motor_viscous_friction, B_L, reduction), J_L, B_L)
