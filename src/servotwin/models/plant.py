"""From parameters and load to the plant that the engine reads; what a model lacks gets its neutral value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.kernels.plant import Plant

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.base import Model


def make_plant(model: Model, load: Load, *, reduction: float, inductance: float = 0.0,
               friction: tuple[float, float] = (0.0, 0.0), breakaway: float = 1.0, slope: float = 0.0,
               gain: float = 1.0, p: float = 0.0, b_o: float = 0.0, deadband: float = 0.0,
               voltage_limit: float = math.inf, stops: tuple[float, float] = (-math.inf, math.inf),
               restitution: float = 0.0, **more: Any) -> Plant:
    """Return the plant at the output shaft: the motor reflected through the gear, and the load on it.

    `more` are other fields of the plant, at the output shaft, which are neutral unless given.
    """
    N = reduction
    stiffness, rest_angle = load.elasticity
    gravity, hanging = load.gravity
    numbers: dict[str, Any] = dict.fromkeys(Plant._fields, 0.0) | {
        "J": N * N * model.value("motor.rotor_inertia") + model.load_inertia(load),
        "b": N * N * model.value("motor.motor_viscous_friction") + load.viscous_friction,
        "K": N * model.value("motor.torque_constant"), "K_b": N * model.value("motor.back_emf_constant"),
        "R": model.value("motor.armature_resistance"), "L": inductance,
        "F_forward": N * friction[0], "F_backward": N * friction[1], "breakaway": breakaway, "kappa": N * slope,
        "coulomb": load.coulomb_torque, "stiffness": stiffness, "rest_angle": rest_angle,
        "gravity": gravity, "hanging_angle": hanging,
        "gain": gain, "p": p, "b_o": b_o, "half_deadband": 0.5 * deadband, "V_max": voltage_limit,
        "lower": stops[0], "upper": stops[1], "restitution": restitution, "I_max": math.inf, "alpha": 1.0,
        "J_out": model.load_inertia(load), "b_out": load.viscous_friction}
    return Plant(**numbers | more)
