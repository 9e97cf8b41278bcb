"""What the catalog commands tell of a servo, ready for JSON."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from servotwin.errors import MissingParameterError, ServotwinError
from servotwin.loads import as_load
from servotwin.models import MODELS, DigitalServo, default_model
from servotwin.models.engine.dynamics.currents import stall_current
from servotwin.models.terms.duty import at_duty
from servotwin.parameters import printed_flags, printed_points
from servotwin.physics import stall_torque

if TYPE_CHECKING:
    from servotwin.parameters import Servo


def headline(servo: Servo) -> dict[str, Any]:
    """Return id, title, kind, supply voltage [V], stall torque [N m] and speed [deg/s] of its data sheet, and flags.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> headline(load_servo("hitec-hs-755hb"))["title"]
    'Hitec HS-755HB'
    """
    printed = printed_points(servo)[0]
    return {
        "id": servo.name, "title": servo.title, "kind": servo.kind,
        "supply_voltage": printed.supply_voltage,
        "stall_torque": printed.stall_torque,
        "twin_stall_torque": twin_torque(servo),
        "speed": 60.0 / printed.time_60 if printed.time_60 else None,
        "flags": list(printed_flags(servo)),
    }


def twin_torque(servo: Servo) -> float | None:
    """Return the stall torque [N m] of the twin at the voltage of the sheet; None where the file has no motor.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(twin_torque(load_servo("hitec-hs-755hb")), 2)
    1.65
    """
    voltage = printed_points(servo)[0].supply_voltage
    at = servo if voltage is None else servo.replace({"supply.open_circuit_voltage": voltage})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            model = default_model(at)
            plant = model.pack(as_load(None))
        except ServotwinError:
            return None
    if isinstance(model, DigitalServo):
        plant = at_duty(plant, float(model.most_duty))
    current = stall_current(plant, plant.source.V)
    return float(stall_torque(current, plant.motor.K, plant.friction.F_forward, plant.friction.K_m, plant.friction.K_e))


def parameters(servo: Servo) -> list[dict[str, Any]]:
    """Return every given parameter with value (SI), unit, origin, spread and source.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> parameters(servo_from_values("mine", {"motor": {"armature_resistance": 3.0}}))[0]["origin"]
    'assumed'
    """
    rows = []
    for name in servo.names():
        q = servo.source(name)
        value = list(q.value) if isinstance(q.value, tuple) else q.value
        rows.append({"name": name, "value": value, "unit": q.unit, "origin": q.origin, "spread": q.spread,
                     "std": q.std, "lower": q.lower, "upper": q.upper, "source": q.source})
    return rows


def readiness(servo: Servo) -> dict[str, dict[str, Any]]:
    """Return for each model whether the servo can run it, what it lacks, and what would not be read.

    Examples
    --------
    >>> from servotwin.parameters import servo_from_values
    >>> readiness(servo_from_values("mine", {"gear": {"gear_reduction": 280.0}}))["dc-motor"]["lacks"][0]
    'motor.armature_resistance'
    """
    found: dict[str, dict[str, Any]] = {}
    for name, kind in MODELS.items():
        lacks: list[str] = []
        ignored: list[str] = []
        problem = None
        try:
            ignored = list(kind(servo).ignored)
        except MissingParameterError as error:
            lacks = list(error.names)
        except ServotwinError as error:
            problem = str(error)
        found[name] = {"runs": not lacks and problem is None, "lacks": lacks, "problem": problem, "ignored": ignored}
    return found
