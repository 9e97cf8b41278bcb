"""Where a servo starts: its state at t = 0 from an angle and from what else is given, one servo or many lanes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from servotwin.errors import InputError
from servotwin.models.base import Place
from servotwin.models.terms import elastic
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.thermal import COPPER_COEFFICIENT, REFERENCE_TEMPERATURE
from servotwin.units import is_finite

_SLACK = 1e-12  # rad
COLDEST_WINDING = REFERENCE_TEMPERATURE - 1.0 / COPPER_COEFFICIENT  # K

_FINEST, _COARSEST = 1e-13, 1e-4  # rad: finer than rounding, or coarser than what a step could tell of


def accuracy_of(value: Any) -> float:
    """Return an accuracy [rad], or raise InputError."""
    if not (is_finite(value) and _FINEST <= value <= _COARSEST):
        raise InputError("accuracy", got=value, allowed=f"a number of radians, from {_FINEST:g} to {_COARSEST:g}")
    return float(value)


def start_vector(places: Sequence[Place], plant: Numbers, angle: Any, initial: Mapping[str, Any]) -> Any:
    """Return the numbers of `engine.modes.Vector`, at rest and at ambient temperature but for `initial`.

    Parameters
    ----------
    places : sequence of Place
        What the model has as states.
    plant : Numbers
    angle : float or ndarray
        Where the command of just before asks for [rad].
    initial : mapping of str to float or ndarray
        By signal name (SI).

    Returns
    -------
    tuple
        Seven numbers or columns; the motor in the middle of its play, and no spring twisted, unless `initial` says
        otherwise.
    """
    y: list[Any] = [angle, 0.0, 0.0, plant.heat.T_amb, plant.heat.T_amb, None, None if np.any(plant.elastic.k) else 0.0]
    moved = {place.at: initial[place.name] / place.factor for place in places if place.name in initial}
    for index, value in moved.items():
        y[index] = value
    if y[5] is None:
        y[5] = y[0]
    if y[6] is None or (not np.any(plant.play.half) and not np.any(plant.elastic.k)):
        y[6] = y[1]
    return tuple(y)


def check_start(places: Sequence[Place], plant: Numbers, y: Sequence[float]) -> None:
    """Raise InputError if a start [rad] is beyond a stop, or the motor outside its play."""
    if not plant.stops.lower <= y[0] <= plant.stops.upper:
        raise InputError(f"initial {places[0].name}", got=y[0],
                         allowed=f"{plant.stops.lower:.6g} to {plant.stops.upper:.6g} rad, between the stops")
    if plant.heat.C_w > 0.0 and not y[3] > COLDEST_WINDING:
        raise InputError("initial winding_temperature", got=y[3],
                         allowed=f"more than {COLDEST_WINDING:.2f} K, where copper's law has no resistance left")
    if plant.heat.C_w > 0.0 and not y[4] > 0.0:
        raise InputError("initial housing_temperature", got=y[4], allowed="a positive number of kelvin")
    if abs(y[5] - y[0]) > plant.play.half + _SLACK and not elastic.present(plant.elastic):
        N = next(place.factor for place in places if place.at == 5)
        raise InputError("initial motor_angle", got=N * y[5],
                         allowed=f"{N * (y[0] - plant.play.half):.6g} to {N * (y[0] + plant.play.half):.6g} rad, "
                         "within the play of the gear")
