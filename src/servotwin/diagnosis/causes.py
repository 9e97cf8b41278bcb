"""The table of causes: which numbers each is made of, what is usual of them, and how far they are taken away."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from servotwin.diagnosis.numbers import (
    Number,
    Usual,
    friction_now,
    gravity,
    parameter,
    with_friction,
    with_gravity,
    with_load,
    with_values,
    zone_name,
)
from servotwin.models import BoundedServo, DigitalServo
from servotwin.parameters import printed_fact
from servotwin.simulation.metrics import resolution

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.diagnosis.numbers import Patient

_DEG, _US, _MS, _MNM = math.degrees(1.0), 1e6, 1e3, 1e3
_ANALOG_ZONE, _DIGITAL_ZONE = (4e-6, 10e-6), (1e-6, 4e-6)  # s, full width
_ASSUMED = "assumed"
_CATALOG = "as the catalog assumes of a servo without a printed one"


def _zone_usual(patient: Patient) -> Usual:
    model = patient.model
    if isinstance(model, DigitalServo) and model.takes_goals:
        quantum = float(model.firmware().quantum)
        return Usual(quantum, 4.0 * quantum, "one to four counts, assumed")
    width = _DIGITAL_ZONE if isinstance(model, DigitalServo) else _ANALOG_ZONE
    printed = printed_fact(model.servo.sheet, "deadband")
    low, high = (width if printed is None else (min(width[0], printed), max(width[1], printed)))
    by = _per_width(patient)
    return Usual(by * low, by * high, "the sheet, and what is usual of its kind" if printed else _CATALOG)


def _per_width(patient: Patient) -> float:
    """Return what a second of pulse width is in the unit of the model's deadband."""
    model = patient.model
    slope = model.value_or("electronics.one_shot_slope", 1.0)
    if isinstance(model, BoundedServo):
        return 1.0 / slope
    if isinstance(model, DigitalServo):
        return 0.5 / (slope * model.value_or("potentiometer.feedback_gain", 1.0))
    return 1.0


def _zone_now(patient: Patient) -> float | None:
    model = patient.model
    if isinstance(model, DigitalServo):
        return float(model.firmware().h)
    return float(model.value_or(zone_name(model), 0.0))


def finest_of(patient: Patient) -> float:
    """Return what a servo need not tell apart: its count, or its deadband, that of none wider than usual [rad].

    What only a wide deadband makes is a symptom.
    """
    own, usual = float(resolution(patient.model)), _zone_usual(patient).high
    if (_zone_now(patient) or 0.0) <= usual:
        return own
    return min(own, float(resolution(_put_zone(patient, usual).model)))


def _put_zone(patient: Patient, value: float) -> Patient:
    return with_values(patient, {zone_name(patient.model): value})


def _zone(*, rises: bool) -> tuple[Number, ...]:
    def row(kind: Callable[[Patient], bool], unit: str, factor: float) -> Number:
        return Number(
            "deadband", "deadband", rises, lambda patient: _zone_now(patient) if kind(patient) else None, _zone_usual,
            lambda patient: _zone_usual(patient).high if rises else _zone_usual(patient).low, _put_zone,
            "widen it to {}" if rises else "narrow it to {}", unit, factor)

    return (row(lambda patient: isinstance(patient.model, DigitalServo), "deg either way", _DEG),
            row(lambda patient: isinstance(patient.model, BoundedServo), "mV", 1e3),
            row(lambda patient: not isinstance(patient.model, DigitalServo | BoundedServo), "us", _US))


def _digital_gain(patient: Patient) -> Usual:
    model = patient.model
    if isinstance(model, DigitalServo) and model.takes_goals:
        return Usual(1.1, 5.3, "the factory's registers, from an XL330 to an STS3215")
    return Usual(3.0, 20.0, _CATALOG)


def _bridge_gain(patient: Patient) -> Usual:
    now = patient.model.value("electronics.bridge_gain")
    return Usual(now / 3.0, now * 3.0, "a third to three times as it is")


def _fixed(low: float, high: float, source: str = _CATALOG) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low, high, source)


def _stall_share(low: float, high: float, source: str) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low * patient.stall_torque, high * patient.stall_torque, source)


def _current(low: float, source: str) -> Callable[[Patient], Usual]:
    return lambda patient: Usual(low * patient.stall_current, 1.2 * patient.stall_current, source)


def _zero(patient: Patient) -> float:
    return 0.0


def _gains() -> tuple[Number, ...]:
    rows = []
    for name, usual, unit in (("electronics.stretcher_gain", _fixed(60.0, 200.0), ""),
                              ("electronics.bridge_gain", _bridge_gain, ""),
                              ("firmware.proportional_gain", _digital_gain, "1/rad")):
        rows += [parameter("gain", name, "lower it to {}", rises=False, usual=usual, unit=unit),
                 parameter("gain", name, "raise it to {}", rises=True, usual=usual, unit=unit)]
    return (*rows, parameter("gain", "firmware.integral_gain", "lower the integral's to {}", rises=False,
                             usual=_fixed(0.0, 10.0, _ASSUMED), unit="1/(rad s)"))


def _frames() -> tuple[Number, ...]:
    frame, tick = _fixed(10e-3, 20e-3), _fixed(0.3e-3, 3e-3)
    return (
        parameter("frame rate", "electronics.frame_period", "send pulses every {}", rises=False, usual=frame,
                  unit="ms", factor=_MS),
        parameter("frame rate", "electronics.frame_period", "send pulses every {} only", rises=True, usual=frame,
                  unit="ms", factor=_MS),
        parameter("frame rate", "firmware.control_period", "a tick of {}", rises=False, usual=tick, unit="ms",
                  factor=_MS),
        parameter("frame rate", "firmware.compute_delay", "a delay of {}", rises=False, usual=_fixed(0.0, 1e-3),
                  unit="ms", factor=_MS))


def _plays() -> tuple[Number, ...]:
    usual = _fixed(0.0, math.radians(1.0), "about 1 deg, as of an STS3215")
    return tuple(parameter("play", name, text, rises=False, usual=usual, end=_zero, unit="deg", factor=_DEG)
                 for name, text in (("gear.backlash", "at most {} in the gear"),
                                    ("potentiometer.backlash", "at most {} before the potentiometer")))


def _frictions() -> tuple[Number, ...]:
    def usual(patient: Patient) -> Usual:
        low, high = (0.005, 0.1) if patient.model.servo.sheet.get("registers") == "dynamixel-x" else (0.04, 0.3)
        return _stall_share(low, high, f"{100.0 * low:g} to {100.0 * high:g} % of the stall torque, as the catalog "
                            "assumes")(patient)

    rubs = _stall_share(0.0, 0.1, "a tenth of the stall torque at most, assumed")
    return (
        Number("friction", "friction", False, friction_now, usual, lambda patient: usual(patient).low, with_friction,
               "at most {} at the output", "mN m", _MNM),
        parameter("friction", "friction.breakaway_ratio", "at most {} times as much at rest as sliding", rises=False,
                  usual=_fixed(1.0, 2.0)),
        Number("friction", "load.coulomb_torque", False, lambda patient: patient.load.coulomb_torque, rubs, _zero,
               lambda patient, value: with_load(patient, coulomb_torque=value), "at most {} of the load", "mN m", _MNM),
        Number("friction", "load.viscous_friction", False, lambda patient: patient.load.viscous_friction,
               _fixed(0.0, 1.0, _ASSUMED), _zero, lambda patient, value: with_load(patient, viscous_friction=value),
               "at most {} of the load", "N m s/rad"))


def _supplies() -> tuple[Number, ...]:
    def volts(patient: Patient) -> Usual:
        return Usual(*patient.voltages, "the voltages of its sheet")

    return (
        parameter("supply", "supply.internal_resistance", "at most {} between source and servo", rises=False,
                  usual=lambda patient: Usual(0.0, 0.1 * patient.resistance, "a tenth of the winding's, assumed"),
                  end=_zero, unit="ohm"),
        parameter("supply", "supply.open_circuit_voltage", "{} or more", rises=True, usual=volts, unit="V"),
        parameter("supply", "supply.open_circuit_voltage", "{} or less", rises=False, usual=volts, unit="V"),
        parameter("supply", "supply.current_limit", "one that gives {}", rises=True, unit="A",
                  usual=_current(1.0, "what it draws at stall")))


def _registers() -> tuple[Number, ...]:
    most = _fixed(0.8, 1.0, _ASSUMED)
    rows = [parameter("register", f"firmware.{name}", f"{text} of {{}}", rises=True, usual=usual, unit=unit,
                      factor=factor) for name, text, usual, unit, factor in (
        ("torque_limit", "torque limit", most, "%", 100.0), ("duty_limit", "duty limit", most, "%", 100.0),
        ("overload_duty", "overload torque", _fixed(0.5, 1.0, _ASSUMED), "%", 100.0),
        ("trip_current", "protection current", _current(0.6, _ASSUMED), "A", 1.0),
        ("current_limit", "current limit", _current(0.6, _ASSUMED), "A", 1.0))]
    return (*rows, parameter(
        "register", "firmware.undervoltage", "an undervoltage of {}", rises=False, unit="V",
        usual=lambda patient: Usual(0.3 * patient.voltages[0], 0.85 * patient.voltages[0],
                                    "85 % of the sheet's lowest, assumed")),
        parameter("register", "firmware.minimum_duty", "a startup force of {}", rises=False, usual=_fixed(0.0, 0.1),
                  unit="%", factor=100.0))


def _loads() -> tuple[Number, ...]:
    third = _stall_share(0.0, 1.0 / 3.0, "a third of the stall torque, as Feetech rates its servos")

    def put_torque(patient: Patient, value: float) -> Patient:
        return with_load(patient, torque=math.copysign(value, patient.load.torque))

    def put_springs(patient: Patient, value: float) -> Patient:
        by = value / _stiffness(patient)
        softer = tuple(replace(each, stiffness=each.stiffness * by) for each in patient.load.springs)
        return patient._replace(load=replace(patient.load, springs=softer))

    return (
        Number("load", "load.torque", False, lambda patient: abs(patient.load.torque), third, _zero, put_torque,
               "at most {}", "mN m", _MNM),
        Number("load", "load.pendulum", False, lambda patient: gravity(patient.load), third, _zero, with_gravity,
               "at most {} of its weight", "mN m", _MNM),
        Number("load", "load.inertia", False, lambda patient: patient.load.inertia, lambda patient: Usual(
            0.0, 10.0 * patient.rotor, "ten times the rotor's at the output, a rule of motion control, assumed"), _zero,
            lambda patient, value: with_load(patient, inertia=value), "an inertia of at most {}", "g m2", 1e3),
        Number("load", "load.spring", False, _stiffness, _stall_share(0.0, 1.0, _ASSUMED), _zero, put_springs,
               "a spring of at most {}", "N m/rad"))


def _stiffness(patient: Patient) -> float:
    return sum(each.stiffness for each in patient.load.springs)


NUMBERS: tuple[Number, ...] = (*_zone(rises=True), *_zone(rises=False), *_gains(), *_frames(), *_plays(),
                               *_frictions(), *_supplies(), *_registers(), *_loads())
CAUSES: tuple[str, ...] = tuple(dict.fromkeys(number.cause for number in NUMBERS))
