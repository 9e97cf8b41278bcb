"""Which servos lift a mass: those of the catalog that do, lightest first, and why the others do not."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from servotwin.datasheet.conditions import at_voltage, highest_voltage
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.lift import check_lift, swing_up
from servotwin.errors import InputError
from servotwin.models import DigitalServo, default_model
from servotwin.parameters import catalog_names, load_servo, printed_fact, printed_flags
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.models import Model
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
    torque, most = check_lift(mass, arm), highest_voltage(servo)
    if voltage > 2.0 * most > 0.0:
        return Refused(servo=servo, kind="voltage", reason=f"its sheet ends at {most:g} V")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # said in the notes
            drive = FullDrive(at_voltage(default_model(servo), voltage))
    except InputError as error:
        return Refused(servo=servo, kind="voltage", reason=str(error))
    capable = min(drive.stall_torque, drive.starting_torque)
    if capable <= torque:
        return Refused(servo=servo, kind="torque", reason=f"lifts {capable:.3g} N m of {torque:.3g}")
    swing = swing_up(drive, mass, arm)
    if math.isnan(swing.time) or (time is not None and swing.time > time):
        return Refused(servo=servo, kind="time", reason="creeps" if math.isnan(swing.time) else
                       f"takes {swing.time:.2f} s")
    weight = printed_fact(servo.sheet, "mass")
    return Lifter(servo=servo, mass=math.nan if weight is None else weight, most_torque=capable,
                     margin=capable / torque, time=swing.time, notes=_notes(drive.model, voltage, most))


def _notes(model: Model, voltage: float, most: float) -> tuple[str, ...]:
    servo = model.servo
    notes = [f"its sheet ends at {most:g} V"] if 0.0 < most < voltage else []
    if servo.kind != "analog":
        notes.append(servo.kind if isinstance(model, DigitalServo) else f"{servo.kind}, computed as analog")
    flags = printed_flags(servo)
    notes += ["impossible sheet"] if any(flag.startswith("impossible") for flag in flags) else []
    notes += ["sources disagree"] if any(flag.startswith("sources disagree") for flag in flags) else []
    return tuple(notes)
