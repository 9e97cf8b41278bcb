"""The electrical side of a model at many times: voltages, currents, and where the electrical power goes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import physics

if TYPE_CHECKING:
    from servotwin.models.base import Model
    from servotwin.models.kernels.plant import Plant
    from servotwin.models.samples import Samples
    from servotwin.physics.pieces import Pieces

Array = NDArray[np.float64]


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
    error = physics.feedback_error(drive(samples.time), physics.feedback_voltage(
        samples.angle, plant.p, plant.b_o))
    v = np.asarray(physics.bounded_armature_voltage(
        error, 2.0 * plant.half_deadband, plant.gain, 1.0, plant.V_max))
    if plant.L == 0.0:
        i = np.asarray(physics.steady_armature_current(v, samples.speed, plant.R, plant.K_b))
    else:
        i = samples.current
    return Circuit(v, i, np.full_like(v, np.nan), np.full_like(v, np.nan), v * i, np.zeros_like(v), np.zeros_like(v))


def _behind_bridge(model: Model, plant: Plant, samples: Samples) -> Circuit:
    s, driven = samples.drive, samples.drive != 0.0
    coasts = plant.D_off >= plant.V  # nothing flows before the back-EMF opens the diodes
    shared = getattr(samples, "bus", None)
    if shared is not None:
        plant = on_bus(plant, shared)
    V_br, V_ce0 = (model.value_or(name, 0.0) for name in ("motor.brush_drop_voltage", "supply.bridge_drop_voltage"))
    v_b = plant.K_b * (samples.motor_speed if np.any(plant.half_play) else samples.speed)
    inductive = np.any(plant.L > 0.0)
    i = samples.current if inductive else np.asarray(physics.bridge_current(
        s * plant.V, v_b, np.where(driven, plant.D_drive, plant.D_off), np.where(driven, plant.R_drive, plant.R_off)))
    if not inductive and np.any(np.isfinite(plant.I_max)):
        i = np.where(driven, _from_regulator(plant, s, v_b, i), i)
    of_supply = np.where(driven, s * i, np.where(coasts, -np.abs(i), 0.0))
    bus = plant.V - plant.R_b * of_supply
    if np.any(np.isfinite(plant.I_max)):
        bus = _regulated(plant, s, v_b, i, of_supply, bus)
    r_c = np.where(driven, model.value_or("supply.bridge_drop_resistance", 0.0), 0.0)
    if inductive:
        v = np.where(driven, s * bus - np.copysign(V_ce0, i) - r_c * i,
                     np.where(coasts, -np.copysign(bus + V_ce0, i), 0.0))
        v = np.where(i == 0.0, np.where(driven | coasts, v_b, 0.0), v)
    else:
        v = np.asarray(physics.motor_voltage(i, v_b, plant.R, V_br, np.where(driven | coasts, v_b, 0.0)))
    lost = np.where(driven | coasts, (V_ce0 + r_c * np.abs(i)) * np.abs(i), 0.0)
    return Circuit(v, i, bus, of_supply, bus * of_supply, lost, V_br * np.abs(i))


def on_bus(plant: Plant, bus: Array) -> Plant:
    """Return the plant of a servo on a bus whose voltage is known; that of its source is then left out."""
    coasts = plant.D_off >= plant.V
    R_off = plant.R_off - np.where(coasts & np.isinf(plant.I_max), plant.R_b, 0.0)
    changed: dict[str, Any] = {"V": bus, "D_off": np.where(coasts, plant.D_off - plant.V + bus, plant.D_off),
                               "R_off": R_off, "R_drive": plant.R_drive - plant.R_b, "R_b": 0.0, "I_max": math.inf}
    return plant._replace(**changed)


def _from_regulator(plant: Plant, s: Array, v_b: Array, i: Array) -> Array:
    """Return the current of a drive from a source that gives so much and no more, and takes none back."""
    x, R = s * plant.V - v_b, plant.R_drive - plant.R_b
    along = s * x
    back = physics.bridge_current(s * plant.V, v_b, plant.D_drive, R)
    short = s * (along - plant.V - plant.D_drive) / R
    most = np.where(along > plant.D_drive + R * plant.I_max + plant.V, short, s * plant.I_max)
    return np.where(along < 0.0, back, np.where(along > plant.D_drive + plant.R_drive * plant.I_max, most, i))


def _regulated(plant: Plant, s: Array, v_b: Array, i: Array, of_supply: Array, bus: Array) -> Array:
    """Return the bus voltage behind a regulator, where `bus` is that of a battery."""
    edge = 1e-9
    needed = s * ((plant.R_drive - plant.R_b) * i + v_b) + plant.D_drive
    limited = np.where(of_supply > plant.I_max * (1.0 + edge), 0.0, np.clip(needed, 0.0, bus))
    return np.where(of_supply < 0.0, plant.V, np.where(of_supply >= plant.I_max * (1.0 - edge), limited, bus))
