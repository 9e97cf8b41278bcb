"""The modes that a servo can be in, and its state.

A mode says which of the laws hold: the zone of the voltage law, how the shaft moves, and where the play of the gear
is. All quantities are at the output shaft (a bare motor has N = 1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

# --- The modes that a servo can be in, and its state ------------------------------------------------------------------

class Mode(NamedTuple):
    """Zone of the voltage law, contact of the shaft, place in the play, contact of the motor inside the play, share.

    A motor behind an elastic gear has a contact of its own as well.
    The share is the sign of the torques through a sliding gear of whose magnitude friction is made; 0 where it is not.
    """

    zone: int
    contact: int
    mesh: int
    motor: int
    share: int


class Vector(NamedTuple):
    """The state, or its rates: `y.w` is the speed, `dy.w` the acceleration.

    Without inductance the current is kept as 0, without heat the temperatures stay; where motor and output are one
    body, the motor's angle and speed go with the output's. A body behind an elastic shaft has the motor's places.
    """

    q: float  # angle [rad]
    w: float  # speed [rad/s]
    i: float  # current [A]
    T_w: float  # temperature of the winding [K]
    T_h: float  # and of the housing
    q_m: float  # angle of the motor, at the output shaft
    w_m: float


NOWHERE = Vector(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LOST = Vector(math.nan, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


def moving(y: Vector, q: float, w: float, w_m: float) -> Vector:
    """Return a state with the output at another angle, and other speeds of output and motor."""
    return Vector(q, w, y.i, y.T_w, y.T_h, y.q_m, w_m)


def one_body(q: float, w: float, y: Vector) -> Vector:
    """Return a state with another angle and speed, motor and output being one body."""
    return Vector(q, w, y.i, y.T_w, y.T_h, q, w)


SATURATED_BACKWARD, LINEAR_BACKWARD, DEAD, LINEAR, SATURATED = -2, -1, 0, 1, 2
# Behind a bridge, in the order of the voltage that drives the current. Conducting: without drops, either way.
# Limited: the regulator gives its most. Short: even at no bus voltage more flows.
CONDUCTING, SHORT_BACKWARD, LIMITED_BACKWARD, CURRENT_BACKWARD, NO_CURRENT = 3, 4, 5, 6, 7
CURRENT_FORWARD, LIMITED_FORWARD, SHORT_FORWARD = 8, 9, 10
FREE, FORWARD, BACKWARD, CORE, STUCK, ON_LOWER, ON_UPPER = range(7)
RIGID, INSIDE, ON_FORWARD, ON_BACKWARD = range(4)  # forward: where the motor pushes the output forward
# A spring behind the shaft, or in the gear; with play it is loose, pushes, or trails behind an output that runs away.
BEHIND, SPRUNG, LOOSE, PUSH_FORWARD, PUSH_BACKWARD, TRAIL_FORWARD, TRAIL_BACKWARD = range(4, 11)


def at_rest(contact: int) -> bool:
    """Tell whether a shaft stands still in this contact."""
    return contact >= STUCK


def slides(contact: int) -> bool:
    """Tell whether a shaft slides in this contact."""
    return contact == FORWARD or contact == BACKWARD


def sign_of(zone: int) -> float:
    """Return the sign of the current in a zone behind a bridge; 0 where it does not matter."""
    if zone > NO_CURRENT:
        return 1.0
    return -1.0 if CONDUCTING < zone < NO_CURRENT else 0.0


def limited(zone: int) -> bool:
    """Tell whether the source gives its most, so that the current stays."""
    return zone == LIMITED_FORWARD or zone == LIMITED_BACKWARD


def constant_current(zone: int) -> bool:
    """Tell whether the current of a zone behind a bridge does not change with the speed."""
    return zone == NO_CURRENT or limited(zone)


def in_linear_zone(zone: int) -> bool:
    """Tell whether the armature voltage follows the error in this zone."""
    return zone == LINEAR or zone == LINEAR_BACKWARD


# --- The rest that rounding leaves of a number ------------------------------------------------------------------------

UNIT = 2e-16  # relative to it
IN_FLOATS = {"UNIT": 1.2e-7}
"""The same where numbers have 32 bits, in C of floats; other modules say so of theirs under this name."""
