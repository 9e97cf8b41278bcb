"""The play of the gear: where motor and output meet, how fast they are then, and the friction behind the play."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from servotwin.models.state.modes import INSIDE, ON_BACKWARD, ON_FORWARD, Vector, moving
from servotwin.models.terms.dependence import PLAY, TWO_BODIES
from servotwin.models.terms.given import Given, either, is_given
from servotwin.models.terms.shaft import Shaft
from servotwin.parameters.groups import Relation
from servotwin.physics.backlash import impact_speed
from servotwin.physics.gear import output_torque
from servotwin.physics.laws import array_form

_LAST_IMPACT = 1e-12  # rad/s: an impact of motor and output this slow is the last one of many
_BEARING_SHARE = 0.06  # of the Coulomb friction, where the servo does not say: assumed, 0.02 to 0.15
_ROUNDING = 1e-12  # relative
IN_FLOATS = {"_LAST_IMPACT": 1e-6, "_ROUNDING": 1e-6}
_BEARING = "friction.bearing_coulomb_torque"

READS = (_BEARING,)
"""Optional numbers of a servo with play, the play apart."""


class Play(NamedTuple):
    """Numbers of the gear's play."""

    half: float  # of the play; 0: motor and output are one body
    bearing: float  # T_o: the part of the Coulomb friction that acts on the output inside the play


NO_PLAY = Play(0.0, 0.0)
ACTS = {"half": PLAY, "bearing": PLAY}
"""Where each number acts."""


def present(play: Play) -> bool:
    """Tell whether the gear has play."""
    return play.half > 0.0


def depends(mesh: int, still: bool) -> int:
    """Return on what the acceleration depends through the play, unless both bodies stand still."""
    return TWO_BODIES if mesh == INSIDE and not still else 0


def needs(play: Play) -> int:
    """Return what else there is to be followed of the play."""
    return PLAY if play.half > 0.0 else 0


def met(play: Play, shaft: Shaft, forward: bool, y: Vector) -> Vector:
    """Return the state after motor and output have met at an end of the play: one speed, momentum kept."""
    w = impact_speed(shaft.J - shaft.J_out, y.w_m, shaft.J_out, y.w)
    if abs(w) < _LAST_IMPACT:
        w = 0.0
    return with_motor(play, ON_FORWARD if forward else ON_BACKWARD, moving(y, y.q, w, w))


def with_motor(play: Play, mesh: int, y: Vector) -> Vector:
    """Return a state of one body with the motor where the play has it."""
    return Vector(y.q, y.w, y.i, y.T_w, y.T_h, y.q + ahead(play, mesh), y.w)


def ahead(play: Play, mesh: int) -> float:
    """Return by which angle the motor is ahead of the output [rad] where they touch."""
    return play.half if mesh == ON_FORWARD else -play.half if mesh == ON_BACKWARD else 0.0


def pack(given: Given) -> Play:
    """Return the play of a servo's gear and the friction behind it; that of an elastic gear belongs to its spring."""
    play = either(given.gear_backlash, 0.0)
    if is_given(given.gear_stiffness):
        return NO_PLAY
    most = _least_coulomb(given)
    bearing = either(given.friction_bearing_coulomb_torque, _BEARING_SHARE * most)
    return Play(0.5 * play, min(bearing, most) if play > 0.0 else 0.0)


def _least_coulomb(given: Given) -> float:
    """Return the smaller Coulomb friction of both ways, at the output shaft [N m]."""
    N = given.gear_gear_reduction
    return min(output_torque(given.friction_coulomb_torque_forward, N),
               output_torque(given.friction_coulomb_torque_backward, N))


def check(given: Given, load_inertia: Any) -> None:
    """Check the play of a servo, or of lanes.

    Raises
    ------
    ParameterError
        If there is play without inertia behind it, or more friction behind it than the gear has either way; if there
        is friction behind the play of an elastic gear.
    """
    if not np.any(given.gear_backlash > 0.0) and not np.any(given.gear_stiffness > 0.0):
        return
    play, bearing = (np.asarray(x) for x in (given.gear_backlash, given.friction_bearing_coulomb_torque))
    if np.any(given.gear_stiffness == given.gear_stiffness):
        _require(_BEARING, np.all(bearing != bearing), bearing, "none beside gear.stiffness: the output of an elastic "
                 "gear has the dry friction of the load alone")
        return
    _require("gear.backlash", ~(play > 0.0) | (np.asarray(load_inertia) > 0.0), play,
             "play only with inertia behind it: gear.output_inertia, or a load that has some")
    most = array_form(_least_coulomb)(given)
    _require(_BEARING, ~(play > 0.0) | ~(bearing > most * (1.0 + _ROUNDING)), bearing,
             "at most the Coulomb friction either way, at the output shaft: it is a part of that")


def _require(name: str, holds: Any, value: Any, allowed: str) -> None:
    """Raise ParameterError where a relation does not hold; names the lane of columns."""
    lanes = np.asarray(holds).ravel()
    if lanes.size > 1:
        Relation(name, lanes, np.broadcast_to(np.ravel(value), lanes.shape), allowed).check()
    else:
        Relation(name, bool(lanes[0]), np.asarray(value).item(), allowed).check()
