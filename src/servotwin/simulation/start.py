"""Where a servo starts, its state at t = 0 from what is given, one servo or many lanes; and how a simulation ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

import numpy as np

from servotwin.errors import InputError
from servotwin.models.base import Place
from servotwin.models.state.modes import Vector
from servotwin.models.terms import elastic
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.thermal import COPPER_COEFFICIENT, REFERENCE_TEMPERATURE
from servotwin.units import is_finite

# --- Where a servo starts ---------------------------------------------------------------------------------------------

_SLACK = 1e-12  # rad
COLDEST_WINDING = REFERENCE_TEMPERATURE - 1.0 / COPPER_COEFFICIENT  # K
_FINEST, _COARSEST = 1e-13, 1e-4  # rad: finer than rounding, or coarser than what a step could tell of


def accuracy_of(value: Any) -> float:
    """Return an accuracy [rad], or raise InputError."""
    if not (is_finite(value) and _FINEST <= value <= _COARSEST):
        raise InputError("accuracy", got=value, allowed=f"a number of radians, from {_FINEST:g} to {_COARSEST:g}")
    return float(value)


def start_vector(places: Sequence[Place], plant: Numbers, angle: Any, initial: Mapping[str, Any]) -> Vector:
    """Return a state at rest and at ambient temperature but for `initial`.

    Parameters
    ----------
    places : sequence of Place
        Places of the model's states.
    plant : Numbers
    angle : float or ndarray
        Where the command of just before asks for [rad].
    initial : mapping of str to float or ndarray
        By signal name (SI).

    Returns
    -------
    Vector
        Seven numbers or columns; the motor in the middle of its play, and no spring twisted, unless `initial` says
        otherwise.
    """
    sprung = bool(np.any(plant.elastic.k))
    given = {place.at: initial[place.name] / place.factor for place in places if place.name in initial}
    y = Vector(angle, 0.0, 0.0, plant.heat.T_amb, plant.heat.T_amb, angle, 0.0)._replace(**given)
    if "q_m" not in given:
        y = y._replace(q_m=y.q)
    if ("w_m" not in given and sprung) or not (sprung or np.any(plant.play.half)):
        y = y._replace(w_m=y.w)
    return y


def check_start(places: Sequence[Place], plant: Numbers, y: Vector) -> None:
    """Raise InputError if a start [rad] is beyond a stop, or the motor outside its play."""
    if not plant.stops.lower <= y.q <= plant.stops.upper:
        raise InputError(f"initial {places[0].name}", got=y.q,
                         allowed=f"{plant.stops.lower:.6g} to {plant.stops.upper:.6g} rad, between the stops")
    if plant.heat.C_w > 0.0 and not y.T_w > COLDEST_WINDING:
        raise InputError("initial winding_temperature", got=y.T_w,
                         allowed=f"more than {COLDEST_WINDING:.2f} K, where copper's law has no resistance left")
    if plant.heat.C_w > 0.0 and not y.T_h > 0.0:
        raise InputError("initial housing_temperature", got=y.T_h, allowed="a positive number of kelvin")
    if abs(y.q_m - y.q) > plant.play.half + _SLACK and not elastic.present(plant.elastic):
        N = next(place.factor for place in places if place.at == "q_m")
        raise InputError("initial motor_angle", got=N * y.q_m,
                         allowed=f"{N * (y.q - plant.play.half):.6g} to {N * (y.q + plant.play.half):.6g} rad, "
                         "within the play of the gear")


# --- How a simulation ended -------------------------------------------------------------------------------------------

class Status(Enum):
    """How a simulation ended; each member carries its message.

    Examples
    --------
    >>> Status.COMPLETED.ok, Status.DIVERGED.message
    (True, 'the state is no longer finite')
    """

    COMPLETED = 0, "reached the end"
    DIVERGED = 1, "the state is no longer finite"
    STEP_TOO_SMALL = 2, "no step is short enough for the tolerance"
    CHATTER = 3, "events follow each other without time going on"
    TOO_FAST = 4, "it oscillates too fast to be followed"
    CROWDED = 5, "frames follow each other faster than the chip decides: a third decision would have to wait"
    REFUSED = 6, "a command, a torque, or what another simulator imposes is nothing that the servo takes"

    def __init__(self, code: int, message: str) -> None:
        self.code = code
        self.message = message

    @classmethod
    def of_code(cls, code: int) -> Status:
        """Return the member with this code."""
        return next(status for status in cls if status.code == code)

    @property
    def ok(self) -> bool:
        """Whether the whole time was simulated."""
        return self is Status.COMPLETED
