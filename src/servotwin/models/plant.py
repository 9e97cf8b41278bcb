"""From parameters and load to the plant that the engine reads; what a model lacks gets its neutral value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin import physics
from servotwin.models.terms.plant import Plant

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
        "J": physics.output_inertia(model.value("motor.rotor_inertia"), model.load_inertia(load), N),
        "b": physics.output_viscous_friction(model.value("motor.motor_viscous_friction"), load.viscous_friction, N),
        "K": physics.output_torque(model.value("motor.torque_constant"), N),
        "K_b": physics.motor_from_output(model.value("motor.back_emf_constant"), N),  # per speed of the output
        "R": model.value("motor.armature_resistance"), "L": inductance,
        "F_forward": physics.output_torque(friction[0], N), "F_backward": physics.output_torque(friction[1], N),
        "breakaway": breakaway, "kappa": physics.motor_from_output(slope, N),
        "coulomb": load.coulomb_torque, "stiffness": stiffness, "rest_angle": rest_angle,
        "gravity": gravity, "hanging_angle": hanging,
        "gain": gain, "p": p, "b_o": b_o, "half_deadband": 0.5 * deadband, "V_max": voltage_limit,
        "lower": stops[0], "upper": stops[1], "restitution": restitution, "I_max": math.inf, "alpha": 1.0,
        "J_out": model.load_inertia(load), "b_out": load.viscous_friction}
    return Plant(**numbers | more)
