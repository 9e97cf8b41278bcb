"""What a cause is made of: one number of a servo or its load, and how it is taken away."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models import BoundedServo, DigitalServo
from servotwin.parameters import printed_points
from servotwin.physics.gear import output_torque

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.loads import Load
    from servotwin.models import Model

_LEAST = 1e-3  # of its end, from which a number of 0 goes there


class Patient(NamedTuple):
    """A servo and its load, and what is usual is measured by.

    Parameters
    ----------
    model : Model
    load : Load
    voltages : tuple of float
        Lowest and highest of the sheet; the servo's own without one [V].
    resistance : float
        Of the winding [ohm].
    stall_torque, stall_current : float
        At the sheet's highest voltage, from a source that gives all [N m], [A].
    rotor : float
        Inertia of the rotor at the output [kg m²].
    own_frames : bool
        Whether frames come as the servo's file says, and not as the command does.
    """

    model: Model
    load: Load
    voltages: tuple[float, float]
    resistance: float
    stall_torque: float
    stall_current: float
    rotor: float
    own_frames: bool = True


class Usual(NamedTuple):
    """Between which values a number usually lies (SI), and where that is from."""

    low: float
    high: float
    source: str


class Number(NamedTuple):
    """One row of the table of causes.

    Parameters
    ----------
    cause : str
        Such as "deadband".
    name : str
        Dotted, such as "electronics.deadband".
    rises : bool
        Whether it is taken away upwards.
    now : callable
        Returns the number of a patient; None where there is none.
    usual : callable
        Returns what is usual.
    end : callable
        Returns how far it is taken.
    put : callable
        Returns the patient with another value.
    cure : str
        With a place for the needed value, such as "widen to {}".
    unit : str
    factor : float
        From SI to the unit.
    """

    cause: str
    name: str
    rises: bool
    now: Callable[[Patient], float | None]
    usual: Callable[[Patient], Usual]
    end: Callable[[Patient], float]
    put: Callable[[Patient, float], Patient]
    cure: str
    unit: str = ""
    factor: float = 1.0

    def stops(self, patient: Patient) -> tuple[float, ...]:
        """Return the values to which it is taken: into what is usual, and to its end; none where it is there."""
        now = self.now(patient)
        if now is None:
            return ()
        usual, end = self.usual(patient), self.end(patient)
        near = usual.low if self.rises else usual.high
        wanted = dict.fromkeys((near, end))
        return tuple(value for value in wanted if (value > now if self.rises else value < now))

    def oddness(self, patient: Patient) -> float:
        """Return how far the number is from what is usual, in its direction: the logarithm of their ratio, or 0."""
        now, usual = self.now(patient), self.usual(patient)
        if now is None or (now == 0.0 and not self.name.startswith("supply")):
            return 0.0  # it is off
        if self.rises:
            return max(0.0, math.log(usual.low / now)) if now > 0.0 and usual.low > 0.0 else 0.0
        return max(0.0, math.log(now / usual.high)) if usual.high > 0.0 else (math.inf if now > 0.0 else 0.0)

    def between(self, now: float, end: float, share: float) -> float:
        """Return the value that is a share of the way from one to the other."""
        if now < 0.0 or end <= 0.0:
            return now + share * (end - now)
        start = max(now, _LEAST * end)
        return float(start * (end / start)**share)


def patient_of(model: Model, load: Load, *, own_frames: bool = True) -> Patient:
    """Return a servo and its load with what is usual is measured by."""
    own = float(model.value("supply.open_circuit_voltage"))
    printed = [point.supply_voltage for point in printed_points(model.servo) if point.supply_voltage]
    low, high = min(printed, default=own), max(printed, default=own)
    resistance = model.value("motor.armature_resistance")
    current = max(high - model.value_or("supply.bridge_drop_voltage", 0.0)
                  - model.value_or("motor.brush_drop_voltage", 0.0), 0.1 * high) / resistance
    reduction = model.value("gear.gear_reduction")
    return Patient(
        model=model, load=load, voltages=(low, high), resistance=resistance,
        stall_torque=float(output_torque(model.value("motor.torque_constant") * current, reduction)),
        stall_current=current, rotor=model.value("motor.rotor_inertia") * reduction**2, own_frames=own_frames)


def with_values(patient: Patient, values: dict[str, float | None]) -> Patient:
    """Return a patient with other parameters of the servo."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return patient._replace(model=type(patient.model)(patient.model.servo.replace(values)))


def parameter(cause: str, name: str, cure: str, *, rises: bool, usual: Callable[[Patient], Usual],
              end: Callable[[Patient], float] | None = None, unit: str = "", factor: float = 1.0) -> Number:
    """Return the row of one parameter; it ends at the far end of what is usual unless said otherwise."""
    def now(patient: Patient) -> float | None:
        if name.startswith("electronics.frame") and not patient.own_frames:
            return None
        value = patient.model.value_or(name, math.nan) if name in _reads(patient.model) else math.nan
        return None if math.isnan(value) else float(value)

    def far(patient: Patient) -> float:
        return usual(patient).high if rises else usual(patient).low

    def put(patient: Patient, value: float) -> Patient:
        return with_values(patient, {name: value})

    return Number(cause, name, rises, now, usual, end or far, put, cure, unit, factor)


def _reads(model: Model) -> tuple[str, ...]:
    return (*model.requires, *model.optional)


def zone_name(model: Model) -> str:
    """Return the parameter that is the deadband of a model."""
    return ("firmware.deadband_angle" if isinstance(model, DigitalServo) else "electronics.voltage_deadband"
            if isinstance(model, BoundedServo) else "electronics.deadband")


def friction_now(patient: Patient) -> float:
    """Return the Coulomb torque of motor and gear at the output, the larger of both ways [N m]."""
    model = patient.model
    most = max(model.value_or("friction.coulomb_torque_forward", 0.0),
               model.value_or("friction.coulomb_torque_backward", 0.0))
    return float(output_torque(most, model.value("gear.gear_reduction")))


def with_friction(patient: Patient, value: float) -> Patient:
    """Return a patient with another Coulomb torque of motor and gear [N m]."""
    by = value / friction_now(patient)
    return with_values(patient, {name: by * patient.model.value_or(name, 0.0) for name in (
        "friction.coulomb_torque_forward", "friction.coulomb_torque_backward")})


def with_load(patient: Patient, **values: Any) -> Patient:
    """Return a patient with other numbers of its load."""
    return patient._replace(load=replace(patient.load, **values))


def gravity(load: Load) -> float:
    """Return the most torque of all pendulums together [N m]."""
    return float(sum(each.gravity_torque for each in load.pendulums))


def with_gravity(patient: Patient, value: float) -> Patient:
    """Return a patient whose pendulums are lighter, so that they pull with so much [N m]."""
    load = patient.load
    by = value / gravity(load)
    lighter = tuple(replace(each, mass=each.mass * by, inertia=None if each.inertia is None else each.inertia * by)
                    for each in load.pendulums) if by > 0.0 else ()
    return patient._replace(load=replace(load, pendulums=lighter))
