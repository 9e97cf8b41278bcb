"""The electrical side of a model at many times: voltages, currents, and where the electrical power goes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import physics
from servotwin.models.terms import armature
from servotwin.physics.laws import array_form

if TYPE_CHECKING:
    from servotwin.models.base import Model
    from servotwin.models.samples import Samples
    from servotwin.models.terms.plant import Plant
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]


_NO_VOLTAGE = 5e-324  # V: a bus without any is still connected
_EDGE = 1e-6  # of a limit: what float32 rounds

_zone_of, _error_of, _voltage, _current, _bus_voltage, _terminal_voltage, _bridge_drops = (
    array_form(law, __name__) for law in (
        armature.zone_of, armature.error_of, armature.voltage, armature.current, armature.bus_voltage,
        armature.terminal_voltage, armature.bridge_drops))


class Circuit(NamedTuple):
    """Voltages [V], currents [A] and powers [W], each of shape (n,) or, over lanes, (B, n)."""

    armature_voltage: Array
    armature_current: Array
    bus_voltage: Array
    supply_current: Array
    supply_power: Array
    bridge_power: Array
    brush_power: Array


def circuit_of(model: Model, plant: Plant, samples: Samples, drive: Pieces) -> Circuit:
    """Return what happens electrically: behind a bridge, or where the voltage follows the command at once.

    `plant` is at the temperatures of the samples.
    """
    if np.any(plant.V > 0.0):
        return _behind_bridge(model, plant, samples)
    u, q, w = drive(samples.time), samples.angle, samples.speed
    zone = _zone_of(plant, u, 0.0, q, w, 0.0)
    v = np.asarray(_voltage(plant, zone, _error_of(plant, u, q)))
    i = np.asarray(_current(plant, zone, u, q, w)) if plant.L == 0.0 else samples.current
    return Circuit(v, i, np.full_like(v, np.nan), np.full_like(v, np.nan), v * i, np.zeros_like(v), np.zeros_like(v))


def _behind_bridge(model: Model, plant: Plant, samples: Samples) -> Circuit:
    s = samples.drive
    coasts = plant.D_off >= plant.V  # nothing flows before the back-EMF opens the diodes
    shared = getattr(samples, "bus", None)
    if shared is not None:
        plant = on_bus(plant, shared)
    V_br = model.value_or("motor.brush_drop_voltage", 0.0)
    w = samples.motor_speed if np.any(plant.half_play) else samples.speed
    u = s * np.maximum(plant.V, _NO_VOLTAGE)
    inductive = np.any(plant.L > 0.0)
    i = _at_limit(plant, samples.current) if inductive else np.zeros_like(w)
    zone = _zone_of(plant, u, 0.0, 0.0, w, i)
    if not inductive:
        i = _current(plant, zone, u, 0.0, w)
    bus = np.asarray(_bus_voltage(plant, zone, u, w, i, coasts))
    v = np.asarray(_terminal_voltage(plant, V_br, u, w, i, bus, coasts))
    connected = (s != 0.0) | coasts
    of_supply = np.where(connected, physics.supply_current(i, s), 0.0)
    lost = np.where(connected, physics.bridge_loss(i, *_bridge_drops(plant, V_br, u)), 0.0)
    return Circuit(v, i, bus, of_supply, bus * of_supply, lost, np.asarray(physics.brush_loss(i, V_br)))


def _at_limit(plant: Plant, i: Array) -> Array:
    """Return a current, at the limit of a regulator but for rounding just there."""
    with np.errstate(invalid="ignore"):
        near = np.abs(np.abs(i) - plant.I_max) <= _EDGE * plant.I_max
    return np.where(near & np.isfinite(plant.I_max), np.copysign(plant.I_max, i), i)


def on_bus(plant: Plant, bus: Array) -> Plant:
    """Return the plant of a servo on a bus whose voltage is known; that of its source is then left out."""
    coasts = plant.D_off >= plant.V
    R_off = plant.R_off - np.where(coasts & np.isinf(plant.I_max), plant.R_b, 0.0)
    changed: dict[str, Any] = {"V": bus, "D_off": np.where(coasts, plant.D_off - plant.V + bus, plant.D_off),
                               "R_off": R_off, "R_drive": plant.R_drive - plant.R_b, "R_b": 0.0, "I_max": math.inf}
    return plant._replace(**changed)
