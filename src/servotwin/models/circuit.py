"""The electrical side of a model at many times: voltages, currents, and where the electrical power goes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.physics import bridge, electronics, motor, potentiometer

if TYPE_CHECKING:
    from servotwin.models.base import Model
    from servotwin.models.kernels.hybrid import Plant
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
    """Return what happens electrically: behind a bridge, or where the voltage follows the command at once."""
    if np.any(plant.V > 0.0):
        return _behind_bridge(model, plant, samples)
    error = electronics.feedback_error(drive(samples.time), potentiometer.feedback_voltage(
        samples.angle, plant.p, plant.b_o))
    v = np.asarray(electronics.bounded_armature_voltage(
        error, 2.0 * plant.half_deadband, plant.gain, 1.0, plant.V_max))
    i = samples.current
    if plant.L == 0.0:
        i = np.asarray(motor.steady_armature_current(v, samples.speed, plant.R, plant.K_b))
    return Circuit(v, i, np.full_like(v, np.nan), np.full_like(v, np.nan), v * i, np.zeros_like(v), np.zeros_like(v))


def _behind_bridge(model: Model, plant: Plant, samples: Samples) -> Circuit:
    s, driven = samples.drive, samples.drive != 0.0
    R_b = model.value_or("supply.internal_resistance", 0.0)
    V_br = model.value_or("motor.brush_drop_voltage", 0.0)
    v_b = plant.K_b * samples.speed
    i = np.asarray(bridge.bridge_current(s * plant.V, v_b, np.where(driven, plant.D_drive, plant.D_off),
                                         np.where(driven, plant.R_drive, plant.R_off)))
    coasts = plant.D_off >= plant.V  # nothing flows before the back-EMF opens the diodes
    v = np.asarray(bridge.motor_voltage(i, v_b, plant.R, V_br, np.where(driven | coasts, v_b, 0.0)))
    of_supply = np.where(driven, s * i, np.where(coasts, -np.abs(i), 0.0))
    bus = plant.V - R_b * of_supply
    V_ce0 = model.value_or("supply.bridge_drop_voltage", 0.0)
    r_c = np.where(driven, model.value_or("supply.bridge_drop_resistance", 0.0), 0.0)
    lost = np.where(driven | coasts, (V_ce0 + r_c * np.abs(i)) * np.abs(i), 0.0)
    return Circuit(v, i, bus, of_supply, bus * of_supply, lost, V_br * np.abs(i))
