"""Dry friction of the gear: Coulomb and static friction, Stribeck, and what the torques through the gear add.

The budget at the output shaft is `load_friction.gear_friction_budget`; at rest S = 1, and friction takes whatever is
to be held, up to the budget.
"""

from __future__ import annotations

import math

from servotwin.models.terms.plant import Plant
from servotwin.physics import friction, load_friction


def sliding_friction(plant: Plant, forward: bool, w: float, tau_m: float, tau_e: float) -> float:
    """Return the magnitude of the gear's friction [N m] at the speed w, for the torques of motor and load in +q."""
    F = coulomb(plant, forward)
    if plant.varies == 0.0:
        return F
    speed = w if plant.w_s > 0.0 else math.inf  # else static friction ends as soon as the shaft moves
    return load_friction.gear_friction_budget(
        speed, tau_m, tau_e, coulomb_torque=F, breakaway_ratio=plant.breakaway, stribeck_speed=plant.w_s,
        stribeck_exponent=plant.alpha, load_friction_motor=plant.K_m, load_friction_external=plant.K_e,
        load_friction_motor_stribeck=plant.K_ms, load_friction_external_stribeck=plant.K_es,
        load_friction_motor_quad=plant.K_mq, load_friction_external_quad=plant.K_eq)


def coulomb(plant: Plant, forward: bool) -> float:
    """Return the magnitude of the gear's Coulomb friction [N m]."""
    return abs(friction.coulomb_torque(1.0 if forward else -1.0, plant.F_forward, plant.F_backward))


def holding_friction(plant: Plant, forward: bool, tau_m: float, tau_e: float) -> float:
    """Return the torque [N m] up to which the gear holds against a start forward or backward."""
    F = coulomb(plant, forward)
    if plant.varies == 0.0:
        return friction.breakaway_torque(F, plant.breakaway)
    static = load_friction.static_gear_friction(
        tau_m, tau_e, F, plant.breakaway, plant.K_ms, plant.K_es, plant.K_mq, plant.K_eq)
    return load_friction.sliding_gear_friction(tau_m, tau_e, F, plant.K_m, plant.K_e) + static


def has_gear_friction(plant: Plant) -> bool:
    """Tell whether the gear has any dry friction."""
    return plant.F_forward > 0.0 or plant.F_backward > 0.0 or plant.varies > 0.0
