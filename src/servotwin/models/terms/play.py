"""The play of the gear: where motor and output meet, and the speed with which they go on."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from servotwin.models.engine.modes import INSIDE, ON_BACKWARD, ON_FORWARD, Vector
from servotwin.models.terms.dependence import TWO_BODIES
from servotwin.models.terms.given import Given
from servotwin.models.terms.shaft import Shaft
from servotwin.parameters.group import Relation
from servotwin.physics.backlash import impact_speed

_LAST_IMPACT = 1e-12  # rad/s: an impact of motor and output this slow is the last one of many


class Play(NamedTuple):
    """Numbers of the gear's play."""

    half: float  # of the play; 0: motor and output are one body


NO_PLAY = Play(0.0)


def present(play: Play) -> bool:
    """Tell whether the gear has play."""
    return play.half > 0.0


def depends(mesh: int, still: bool) -> int:
    """Return on what the acceleration depends through the play, unless both bodies stand still."""
    return TWO_BODIES if mesh == INSIDE and not still else 0


def met(play: Play, shaft: Shaft, forward: bool, y: Vector) -> Vector:
    """Return the state after motor and output have met at an end of the play: one speed, momentum kept."""
    w = impact_speed(shaft.J - shaft.J_out, y[6], shaft.J_out, y[1])
    if abs(w) < _LAST_IMPACT:
        w = 0.0
    return with_motor(play, ON_FORWARD if forward else ON_BACKWARD, (y[0], w, y[2], y[3], y[4], y[5], w))


def with_motor(play: Play, mesh: int, y: Vector) -> Vector:
    """Return a state of one body with the motor where the play has it."""
    q, w, i, T_w, T_h, _, _ = y
    ahead = play.half if mesh == ON_FORWARD else -play.half if mesh == ON_BACKWARD else 0.0
    return (q, w, i, T_w, T_h, q + ahead, w)


def pack(model: Given, load_inertia: Any) -> Play:
    """Return the play of a model's gear; that of an elastic one belongs to its spring.

    Raises
    ------
    ParameterError
        If there is play without inertia behind it.
    """
    if model.servo.get("gear.stiffness") is not None:
        return NO_PLAY
    play: Any = model.value_or("gear.backlash", 0.0)
    has_body = np.asarray((np.asarray(play) == 0.0) | (np.asarray(load_inertia) > 0.0)).ravel()
    Relation("gear.backlash", has_body if has_body.size > 1 else bool(has_body[0]), np.broadcast_to(
        np.ravel(play), has_body.shape) if has_body.size > 1 else play,
        "play only with inertia behind it: gear.output_inertia, or a load that has some").check()
    return Play(0.5 * play)
