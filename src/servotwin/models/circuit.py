"""The electrical side of a model at many times: voltages, currents, and where the electrical power goes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin import physics
from servotwin.models.engine import currents
from servotwin.models.terms import bridge as bridge_term
from servotwin.models.terms.bridge import Bridge, Off
from servotwin.models.terms.source import Source
from servotwin.physics.laws import array_form

if TYPE_CHECKING:
    from servotwin.models.base import Model
    from servotwin.models.samples import Samples
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]


_NO_VOLTAGE = 5e-324  # V: a bus without any is still connected
_EDGE = 1e-6  # of a limit: what float32 rounds

_zone_of, _voltage, _current, _bus_voltage, _terminal_voltage, _bridge_drops = (
    array_form(law, __name__) for law in (
        currents.zone_of, currents.voltage, currents.current, bridge_term.bus_voltage, bridge_term.terminal_voltage,
        bridge_term.drops))


class Circuit(NamedTuple):
    """Voltages [V], currents [A] and powers [W], each of shape (n,) or, over lanes, (B, n)."""

    armature_voltage: Array
    armature_current: Array
    bus_voltage: Array
    supply_current: Array
    supply_power: Array
    bridge_power: Array
    brush_power: Array


def circuit_of(model: Model, plant: Numbers, samples: Samples, drive: Pieces) -> Circuit:
    """Return what happens electrically: behind a bridge, or where the voltage follows the command at once.

    `plant` is at the temperatures of the samples.
    """
    if np.any(plant.source.V > 0.0):
        return _behind_bridge(plant, samples)
    u, q, w = drive(samples.time), samples.angle, samples.speed
    zone = _zone_of(plant, u, 0.0, q, w, 0.0)
    v = np.asarray(_voltage(plant, zone, u, q))
    i = np.asarray(_current(plant, zone, u, q, w)) if plant.motor.L == 0.0 else samples.current
    return Circuit(v, i, np.full_like(v, np.nan), np.full_like(v, np.nan), v * i, np.zeros_like(v), np.zeros_like(v))


def _behind_bridge(plant: Numbers, samples: Samples) -> Circuit:
    s = samples.drive
    if np.any(bridge_term.heeds_silence(plant.bridge)):
        plant = plant._replace(bridge=_silent_where(plant.bridge, samples.silent))
    coasts = plant.bridge.off.coast > 0.0
    shared = getattr(samples, "bus", None)
    if shared is not None:
        plant = on_bus(plant, shared)
    w = samples.motor_speed if np.any(plant.play.half) else samples.speed
    u = s * np.maximum(plant.source.V, _NO_VOLTAGE)
    inductive = np.any(plant.motor.L > 0.0)
    i = _at_limit(plant, samples.current) if inductive else np.zeros_like(w)
    zone = _zone_of(plant, u, 0.0, 0.0, w, i)
    if not inductive:
        i = _current(plant, zone, u, 0.0, w)
    bus = np.asarray(_bus_voltage(plant.bridge, plant.source, plant.motor, zone, u, w, i))
    v = np.asarray(_terminal_voltage(plant.bridge, plant.source, plant.motor, u, w, i, bus))
    connected = (s != 0.0) | coasts
    of_supply = np.where(connected, physics.supply_current(i, s), 0.0)
    lost = np.where(connected, physics.bridge_loss(i, *_bridge_drops(plant.bridge, plant.source, plant.motor, u)), 0.0)
    return Circuit(v, i, bus, of_supply, bus * of_supply, lost, np.asarray(physics.brush_loss(i, plant.bridge.V_br)))


def _at_limit(plant: Numbers, i: Array) -> Array:
    """Return a current, at the limit of a regulator but for rounding just there."""
    with np.errstate(invalid="ignore"):
        near = np.abs(np.abs(i) - plant.source.I_max) <= _EDGE * plant.source.I_max
    return np.where(near & np.isfinite(plant.source.I_max), np.copysign(plant.source.I_max, i), i)


def on_bus(plant: Numbers, bus: Array) -> Numbers:
    """Return the plant of a servo on a bus whose voltage is known; that of its source is then left out."""
    bridge, source = plant.bridge, plant.source
    coasts = np.asarray(bridge.off.coast) > 0.0
    R: Any = bridge.off.R - np.where(coasts & np.isinf(source.I_max), source.R_b, 0.0)
    D: Any = np.where(coasts, bridge.off.D - source.V + bus, bridge.off.D)
    V: Any = bus
    off = Off(D, R, bridge.off.coast)
    return plant._replace(bridge=bridge._replace(off=off, silence=off, R_drive=bridge.R_drive - source.R_b),
                          source=Source(V, 0.0, math.inf))


def _silent_where(bridge: Bridge, silent: Array) -> Bridge:
    """Return the bridge as it is off at each time: between drives, or while no pulses come."""
    D, R, coast = (np.where(silent > 0, x, y) for x, y in zip(bridge.silence, bridge.off, strict=True))
    off: Any = Off(cast("Any", D), cast("Any", R), cast("Any", coast))
    return bridge._replace(off=off, silence=off)
