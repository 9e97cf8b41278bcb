"""Which servos lift a mass: those of the catalog that do, lightest first, and why the others do not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin.datasheet.choice import Limits, candidate
from servotwin.datasheet.lift import check_lift
from servotwin.errors import InputError
from servotwin.parameters import catalog_names, load_servo
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters import Servo


@dataclass(frozen=True, kw_only=True)
class Lifter:
    """A servo that lifts the mass.

    Parameters
    ----------
    servo : Servo
    mass : float
        Of the servo, as its sheet prints it; nan where it does not [kg].
    most_torque : float
        The most that it lifts [N m].
    margin : float
        That torque over the one that is asked for.
    time : float
        From 30° below the horizontal to 30° above, from rest [s].
    notes : tuple of str
        What to know of it before buying.
    """

    servo: Servo
    mass: float
    most_torque: float
    margin: float
    time: float
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Refused:
    """A servo that does not lift the mass, or not in time; `kind` is "voltage", "torque" or "time"."""

    servo: Servo
    kind: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Lifters:
    """Which servos lift a mass: those that do, lightest first and unknown masses last, and those that do not."""

    torque: float
    voltage: float
    found: tuple[Lifter, ...]
    refused: tuple[Refused, ...]


def servos_that_lift(mass: float, arm: float, *, voltage: float, time: float | None = None,
                     servos: Iterable[Servo] | None = None) -> Lifters:
    """Return the servos that lift a mass on an arm at all angles, lightest first.

    Parameters
    ----------
    mass, arm : float
        Of the point mass [kg], and its distance from the shaft [m].
    voltage : float
        Of the supply [V].
    time : float, optional
        The longest that 60° may take, from 30° below the horizontal to 30° above, from rest [s].
    servos : iterable of Servo, optional
        Those of the catalog unless given.

    Returns
    -------
    Lifters

    Raises
    ------
    InputError
        If a number is not positive.

    Examples
    --------
    >>> import servotwin as st
    >>> found = st.servos_that_lift(0.02, 0.05, voltage=5.0).found
    >>> found[0].servo.name, round(found[0].margin)
    ('hitec-hs-55', 11)
    """
    torque = check_lift(mass, arm)
    for name, value, unit in (("voltage", voltage, "V"), ("time", time, "s")):
        if value is not None and not (is_finite(value) and value > 0.0):
            raise InputError(name, got=value, allowed=f"a positive number [{unit}]")
    among = [load_servo(name) for name in catalog_names()] if servos is None else list(servos)
    judged = [_judged(servo, mass, arm, voltage, time) for servo in among]
    found = [each for each in judged if isinstance(each, Lifter)]
    order = sorted(found, key=lambda each: (math.isnan(each.mass), each.mass, -each.margin, each.servo.name))
    return Lifters(torque=torque, voltage=voltage, found=tuple(order),
                   refused=tuple(each for each in judged if isinstance(each, Refused)))


def _judged(servo: Servo, mass: float, arm: float, voltage: float, time: float | None) -> Lifter | Refused:
    found = candidate(servo, voltage, lift=(mass, arm), limits=Limits(time=time))
    if found.reasons:
        return Refused(servo=servo, kind=found.reasons[0].kind, reason=found.reasons[0].text)
    return Lifter(servo=servo, mass=found.mass, most_torque=found.most_torque, margin=found.margin, time=found.time,
                  notes=found.notes)
