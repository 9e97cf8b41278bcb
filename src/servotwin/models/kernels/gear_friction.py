"""Dry friction of the gear: Coulomb and static friction, Stribeck, and what the torques through the gear add.

The budget at the output shaft, with S = exp(−|w/w_s|^α), is

    F_c + |K_m τ_m − K_e τ_e| + S [(r − 1) F_c + |K_ms τ_m − K_es τ_e| + Q]

where one share K_l for all torque through the gear means K_m = K_e = K_l (M3, M4 of Duclusaud et al. 2025). At rest
S = 1, and friction takes whatever is to be held, up to the budget.
"""

from __future__ import annotations

import math

from servotwin.models.kernels.plant import Plant


def sliding_friction(plant: Plant, forward: bool, w: float, tau_m: float, tau_e: float) -> float:
    """Return the magnitude of the gear's friction [N m] at the speed w, for the torques of motor and load in +q."""
    F = plant.F_forward if forward else plant.F_backward
    if plant.varies == 0.0:
        return F
    budget = F + abs(plant.K_m * tau_m - plant.K_e * tau_e)
    if plant.w_s > 0.0:
        budget += _fading(plant, abs(w)) * ((plant.breakaway - 1.0) * F + _static_share(plant, tau_m, tau_e))
    return budget


def _fading(plant: Plant, speed: float) -> float:
    """Return S, what is left of static friction at this speed [rad/s]."""
    if speed == 0.0:
        return 1.0
    power = plant.alpha * math.log(speed / plant.w_s)
    return math.exp(-math.exp(power)) if power < 7.0 else 0.0  # a trial step may be far too fast


def holding_friction(plant: Plant, forward: bool, tau_m: float, tau_e: float) -> float:
    """Return the torque [N m] up to which the gear holds against a start forward or backward."""
    held = plant.breakaway * (plant.F_forward if forward else plant.F_backward)
    if plant.varies == 0.0:
        return held
    return held + abs(plant.K_m * tau_m - plant.K_e * tau_e) + _static_share(plant, tau_m, tau_e)


def _static_share(plant: Plant, tau_m: float, tau_e: float) -> float:
    share = abs(plant.K_ms * tau_m - plant.K_es * tau_e)
    if tau_m * tau_e < 0.0 and abs(tau_m) != abs(tau_e):
        share += plant.K_eq * tau_e * tau_e if abs(tau_m) > abs(tau_e) else plant.K_mq * tau_m * tau_m
    return share


def has_gear_friction(plant: Plant) -> bool:
    """Tell whether the gear has any dry friction."""
    return plant.F_forward > 0.0 or plant.F_backward > 0.0 or plant.varies > 0.0
