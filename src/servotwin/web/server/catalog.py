"""The catalog as the page lists it, and the curves of a servo."""

from __future__ import annotations

import math
import warnings
from functools import cache, lru_cache
from typing import Any

from servotwin.datasheet.full_drive import speed_curve
from servotwin.errors import UnknownNameError
from servotwin.models import BoundedServo, Model, default_model
from servotwin.parameters import catalog_names, load_servo
from servotwin.physics.thermal import REFERENCE_TEMPERATURE, Temperatures
from servotwin.web.live.facts import models_of, size_of


@cache
def catalog_list() -> list[dict[str, Any]]:
    """Return all servos of the catalog: id, title, kind, mass, models, and what their sheets print (SI).

    Examples
    --------
    >>> next(one for one in catalog_list() if one["id"] == "hitec-hs-755hb")["sheet"]["stall_torque"]
    1.2945
    """
    found = []
    for name in catalog_names():
        servo = load_servo(name)
        numbers = {key: one["value"] for key, one in servo.sheet.items()
                   if isinstance(one, dict) and isinstance(one.get("value"), int | float)}
        units = {key: str(servo.sheet[key].get("unit", "")) for key in numbers}
        found.append({"id": name, "title": servo.title or name, "kind": servo.kind, "models": models_of(servo),
                      "mass_kg": size_of(servo)["mass_kg"], "sheet": numbers, "units": units})
    return found


@lru_cache(maxsize=64)
def curves_data(name: str) -> dict[str, Any]:
    """Return torque, current and efficiency over speed at full drive, cold (SI).

    Raises
    ------
    UnknownNameError
        If the catalog has no such servo.
    ServotwinError
        If its file lacks what the curves need.

    Examples
    --------
    >>> sorted(curves_data("hitec-hs-755hb"))
    ['current', 'efficiency', 'id', 'power', 'speed', 'torque', 'voltage']
    """
    if name not in catalog_names():
        raise UnknownNameError("servo", name, catalog_names())
    servo = load_servo(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model: Model = default_model(servo) if servo.kind != "analog" else BoundedServo(servo)
        curve = speed_curve(model, Temperatures(REFERENCE_TEMPERATURE, REFERENCE_TEMPERATURE))
    step = 4
    shown = {key: [float(f"{value:.5g}") for value in getattr(curve, key)[::step].tolist()]
             for key in ("speed", "torque", "current", "power", "efficiency")}
    volts = servo.get("supply.open_circuit_voltage")
    return {"id": name, **shown, "voltage": volts if isinstance(volts, float) else math.nan}
