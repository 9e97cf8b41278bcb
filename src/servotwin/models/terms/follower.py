"""The mean-voltage law of the bounded and averaged models: the armature voltage follows the error at once.

It is saturated, linear, or zero in the deadband.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.state.modes import (
    DEAD,
    LINEAR,
    LINEAR_BACKWARD,
    SATURATED,
    SATURATED_BACKWARD,
    in_linear_zone,
)
from servotwin.models.terms.dependence import CURVED_T, FOLLOWS
from servotwin.physics.electronics import error_beyond_deadband, proportional_voltage
from servotwin.physics.pieces import Piece

_TIE = 1e-13  # V
IN_FLOATS = {"_TIE": 1e-6}


class Follower(NamedTuple):
    """Numbers of the mean-voltage law."""

    gain: float  # A k_s
    half_deadband: float
    V_max: float


NO_FOLLOWER = Follower(1.0, 0.0, math.inf)
ACTS = {"gain": FOLLOWS, "half_deadband": FOLLOWS, "V_max": FOLLOWS}
"""Where each number acts."""
INPUTS = {"sweep": CURVED_T}
"""Where numbers of a command act, by their names in its pieces."""


def depends(zone: int, u: Piece) -> int:
    """Return on what the acceleration depends through the voltage u that a servo follows."""
    return CURVED_T if u.sweep != 0.0 and in_linear_zone(zone) else 0


def zone_limits(follower: Follower, zone: int) -> tuple[float, float]:
    """Return the errors [V] between which a zone lies."""
    e1 = follower.half_deadband
    e2 = saturating_error(follower)
    if zone == SATURATED:
        return e2, math.inf
    if zone == SATURATED_BACKWARD:
        return -math.inf, -e2
    if zone == DEAD:
        return -e1, e1
    if e1 == 0.0:  # one linear zone: without a deadband nothing happens at v_e = 0
        return -e2, e2
    return (e1, e2) if zone == LINEAR else (-e2, -e1)


def saturating_error(follower: Follower) -> float:
    """Return the error v_e [V] at which the voltage reaches its limit."""
    return follower.half_deadband + follower.V_max / proportional_voltage(1.0, follower.gain)


def zone_of(follower: Follower, error: float, rate: float) -> int:
    """Return the zone of an error [V]; on a boundary, the one that it moves into."""
    e = error
    if rate != 0.0:
        e += math.copysign(2.0 * _TIE * (1.0 + abs(error)), rate)
    size = abs(e)
    if size > saturating_error(follower):
        return SATURATED if e > 0.0 else SATURATED_BACKWARD
    if follower.half_deadband == 0.0:
        return LINEAR
    if size <= follower.half_deadband:
        return DEAD
    return LINEAR if e > 0.0 else LINEAR_BACKWARD


def neighbour(follower: Follower, zone: int, step: int) -> int:
    """Return the zone that follows on one that has ended, one `step` (−1, +1) away."""
    if follower.half_deadband > 0.0:
        return zone + step
    return 2 * step if zone == LINEAR else LINEAR


def voltage(follower: Follower, zone: int, error: float) -> float:
    """Return the armature voltage [V] of a zone at the error v_e [V]."""
    if zone == DEAD:
        return 0.0
    if zone == SATURATED or zone == SATURATED_BACKWARD:
        return math.copysign(follower.V_max, zone)
    return proportional_voltage(error_beyond_deadband(error, zone, 2.0 * follower.half_deadband), follower.gain)


def voltage_slope(follower: Follower, de: float) -> float:
    """Return the rate of the voltage [V/s] in the linear zone, by that of the error [V/s]."""
    return proportional_voltage(error_beyond_deadband(de, 1.0, 0.0), follower.gain)
