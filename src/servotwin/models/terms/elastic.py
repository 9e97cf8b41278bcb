"""A spring between two bodies: of the gear, between motor and output, or between the output and what hangs behind it.

Angle and speed of the second body stand where a gear with play has those of the motor: of the motor in an elastic
gear, of the load behind an elastic shaft.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from servotwin.errors import LoadError
from servotwin.loads import Load
from servotwin.models.state.modes import PUSH_BACKWARD, PUSH_FORWARD, SPRUNG, Vector
from servotwin.models.terms.dependence import ON_Q, SPRING, TWO_BODIES
from servotwin.models.terms.given import Given, Hung, either, is_given
from servotwin.models.terms.shaft import Shaft
from servotwin.parameters.groups import Relation
from servotwin.physics.shaft import stretch_beyond_play, twist_torque

READS = ("gear.backlash", "gear.stiffness", "gear.damping")
"""Optional numbers of a pulse servo."""

_PART = 3.0  # steps cover at most this part of the time in which the two ring


class Elastic(NamedTuple):
    """Numbers of the spring, and of the body behind the shaft."""

    k: float  # stiffness; 0: there is no spring
    c: float  # damping
    half: float  # of the play in which it does not act
    J: float  # of the body behind the shaft; 0: the spring is the gear's
    b: float
    gravity: float  # m g l of that body
    hanging_angle: float


NO_ELASTIC = Elastic(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ACTS = dict.fromkeys(("k", "c", "half", "J", "b", "gravity", "hanging_angle"), SPRING)
"""Where each number acts."""


def present(elastic: Elastic) -> bool:
    """Tell whether there is a spring between two bodies."""
    return elastic.k > 0.0


def behind(elastic: Elastic) -> bool:
    """Tell whether the spring is behind the output shaft."""
    return elastic.J > 0.0


def geared(elastic: Elastic) -> bool:
    """Tell whether the spring is that of the gear, so that the motor turns on its own."""
    return elastic.k > 0.0 and elastic.J == 0.0


def depends(elastic: Elastic, still: bool) -> int:
    """Return on what the acceleration depends through the spring, unless both bodies stand still."""
    return TWO_BODIES | ON_Q if elastic.k > 0.0 and not still else 0


def needs(elastic: Elastic) -> int:
    """Return what else there is to be followed of the spring."""
    return SPRING if elastic.k > 0.0 else 0


def turning(elastic: Elastic, y: Vector) -> float:
    """Return the speed of the motor [rad/s], of its rates the acceleration."""
    return y.w if elastic.J > 0.0 else y.w_m


def ahead(elastic: Elastic, q: float, other: float) -> float:
    """Return by how much the first of the two bodies is ahead [rad], or of speeds how much faster it is."""
    return q - other if elastic.J > 0.0 else other - q


def stretched(elastic: Elastic, mesh: int, twist: float) -> float:
    """Return by how much the spring is stretched where it acts in this way [rad]."""
    return (twist - elastic.half if mesh == PUSH_FORWARD else twist + elastic.half if mesh == PUSH_BACKWARD else twist)


def torque_at(elastic: Elastic, mesh: int, twist: float, rate: float) -> float:
    """Return the torque between the two bodies [N m], positive where it pushes the second one forward."""
    acts = mesh <= SPRUNG or mesh == PUSH_FORWARD or mesh == PUSH_BACKWARD
    return twist_torque(stretched(elastic, mesh, twist), rate, elastic.k, elastic.c) if acts else 0.0


def damper_loss(elastic: Elastic, torque: float, twist: float, rate: float) -> float:
    """Return the power that the damper takes [W]: what the torque gives and the spring does not keep."""
    return (torque - twist_torque(stretch_beyond_play(twist, elastic.half), 0.0, elastic.k, 0.0)) * rate


def longest_step(elastic: Elastic, shaft: Shaft) -> float:
    """Return the longest step that follows the ringing of the two bodies [s]: a third of its period, undamped."""
    first = shaft.J if elastic.J > 0.0 else shaft.J - shaft.J_out
    second = elastic.J if elastic.J > 0.0 else shaft.J_out
    return 2.0 * math.pi / (_PART * math.sqrt(elastic.k / first + elastic.k / second))


def pack(given: Given, hung: Hung) -> Elastic:
    """Return the spring of a servo's gear, or of its load."""
    if hung.flexible_stiffness > 0.0:
        return Elastic(hung.flexible_stiffness, hung.flexible_damping, 0.0, hung.flexible_inertia,
                       hung.flexible_viscous_friction, hung.flexible_gravity_torque, hung.flexible_hanging_angle)
    if not is_given(given.gear_stiffness):
        return NO_ELASTIC
    return Elastic(given.gear_stiffness, either(given.gear_damping, 0.0), 0.5 * either(given.gear_backlash, 0.0),
                   0.0, 0.0, 0.0, 0.0)


def check(given: Given, load: Load, load_inertia: Any) -> None:
    """Check the spring of a servo, or of lanes, and that of their load.

    Raises
    ------
    ParameterError
        If the gear is elastic without inertia behind it.
    LoadError
        If there is a body behind the shaft, and the gear is elastic or has play.
    """
    k = given.gear_stiffness
    has_spring, has_play = (bool(np.any(x == x)) for x in (k, given.gear_backlash))
    if load.flexibles:
        for name, there in (("gear.stiffness", has_spring), ("gear.backlash", has_play)):
            if there:
                raise LoadError("load.flexible", got=f"a servo that gives {name}",
                                allowed="one whose motor turns with its shaft: two bodies, not three")
        return
    if not has_spring:
        return
    has_body = np.asarray(np.asarray(load_inertia) > 0.0).ravel()
    alone = has_body.size == 1
    Relation("gear.stiffness", bool(has_body[0]) if alone else has_body,
             k if alone else np.broadcast_to(np.ravel(k), has_body.shape),
             "an elastic gear only with inertia behind it: gear.output_inertia, or a load that has some").check()
