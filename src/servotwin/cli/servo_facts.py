"""What the catalog commands tell of a servo, ready for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from servotwin.errors import MissingParameterError, ServotwinError
from servotwin.models import MODELS

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
    seconds = _fact(servo, "speed_per_60deg", "time")
    return {
        "id": servo.name, "title": servo.title, "kind": servo.kind,
        "supply_voltage": _fact(servo, "supply_voltage", "voltage"),
        "stall_torque": _fact(servo, "stall_torque", "torque"),
        "speed": 60.0 / seconds if seconds else None,
        "flags": list(servo.flags),
    }


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


def _fact(servo: Servo, name: str, dimension: str) -> float | None:
    entry = servo.sheet.get(name)
    return servo.sheet_values(name, dimension)[0] if isinstance(entry, dict) else None
