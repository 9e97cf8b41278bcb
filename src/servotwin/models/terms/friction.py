"""Dry friction of motor and gear: Coulomb and static friction, Stribeck, and what the torques through the gear add.

The budget at the output shaft is `load_friction.gear_friction_budget`; at rest S = 1, and friction takes whatever is
to be held, up to the budget.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.state.modes import CORE, at_rest
from servotwin.models.terms.dependence import BY_SHARE, CURVED_W, DRY, FADING, STEEP_W
from servotwin.models.terms.given import Given, either
from servotwin.physics.elementary import exp, log
from servotwin.physics.friction import breakaway_torque, coulomb_torque
from servotwin.physics.gear import motor_from_output, output_torque
from servotwin.physics.load_friction import (
    gear_friction_budget,
    quadratic_gear_friction,
    share_balance,
    sliding_gear_friction,
    static_gear_friction,
    stribeck_factor,
    torque_share,
)

_FADED = 39.0  # exp(−39) is less than rounding: beyond (w/w_s)^α = 39 no static friction counts
_SATURATED_TANH = 20.0  # tanh(20) is 1 to rounding: beyond it the smoothed friction is constant
_SHARES = {"K_m": "motor", "K_e": "external", "K_ms": "motor_stribeck", "K_es": "external_stribeck",
           "K_mq": "motor_quad", "K_eq": "external_quad"}

READS = (
    "friction.breakaway_ratio", "friction.stribeck_speed", "friction.stribeck_exponent", "friction.load_friction",
    "friction.load_friction_stribeck", "friction.load_friction_motor", "friction.load_friction_external",
    "friction.load_friction_motor_stribeck", "friction.load_friction_external_stribeck",
    "friction.load_friction_motor_quad", "friction.load_friction_external_quad",
)
"""Optional numbers of a pulse servo."""


class Friction(NamedTuple):
    """Numbers of the dry friction, at the output shaft."""

    F_forward: float  # N F_ec1
    F_backward: float  # N F_ec2
    breakaway: float  # F_s / F_c
    kappa: float  # N k, slope of tanh (41); 0: true sticking
    varies: float  # 1: sliding friction is not constant
    w_s: float  # v_s / N; 0: static friction ends as soon as the shaft moves
    alpha: float
    K_m: float
    K_e: float
    K_ms: float
    K_es: float
    K_mq: float
    K_eq: float


NO_FRICTION = Friction(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_VARIES = BY_SHARE | FADING | CURVED_W
ACTS = {"F_forward": DRY, "F_backward": DRY, "breakaway": DRY, "kappa": STEEP_W, "varies": _VARIES,
        "w_s": FADING | CURVED_W, "alpha": FADING | CURVED_W, **dict.fromkeys(_SHARES, _VARIES)}
"""Where each number acts."""


def present(friction: Friction) -> bool:
    """Tell whether the gear has any dry friction."""
    return friction.F_forward > 0.0 or friction.F_backward > 0.0 or friction.varies > 0.0


def smoothed(friction: Friction) -> bool:
    """Tell whether the friction is the paper's tanh (41), without sticking."""
    return friction.kappa > 0.0


def varying(friction: Friction) -> bool:
    """Tell whether sliding friction changes with the speed or with the torques."""
    return friction.varies > 0.0


def depends(friction: Friction, contact: int) -> int:
    """Return on what the acceleration depends through the friction of a shaft in a contact."""
    return (STEEP_W if contact == CORE else 0 if friction.varies == 0.0 or at_rest(contact)
            else CURVED_W if not straight(friction) else BY_SHARE | FADING if friction.w_s > 0.0 else BY_SHARE)


def straight(friction: Friction) -> bool:
    """Tell whether sliding friction follows the torques in straight lines, and lets the motor turn the gear."""
    return friction.K_m < 1.0 and friction.K_e <= 1.0


def shared(friction: Friction) -> bool:
    """Tell whether the torques through the gear add to sliding friction."""
    return friction.K_m > 0.0 or friction.K_e > 0.0


def fades(friction: Friction) -> bool:
    """Tell whether friction fades as the shaft speeds up, and not at once."""
    return friction.varies > 0.0 and friction.w_s > 0.0


def frozen(friction: Friction, w: float, tau_m: float, tau_e: float) -> Friction:
    """Return friction that fades no more, with what it has faded to at a speed and under torques in +q."""
    S = stribeck_factor(w, friction.w_s, friction.alpha)
    ratio = 1.0 + (friction.breakaway - 1.0) * S
    more = S * (torque_share(tau_m, tau_e, friction.K_ms, friction.K_es)
                + quadratic_gear_friction(tau_m, tau_e, friction.K_mq, friction.K_eq))
    return Friction(friction.F_forward * ratio + more, friction.F_backward * ratio + more, 1.0, friction.kappa,
                    friction.varies, 0.0, 1.0, friction.K_m, friction.K_e, 0.0, 0.0, 0.0, 0.0)


def creeping_speed(friction: Friction) -> float:
    """Return the output speed [rad/s] up to which a shaft creeps: from there on no static friction is left."""
    return friction.w_s * exp(log(_FADED) / friction.alpha) if fades(friction) else 0.0


def static_share(friction: Friction, tau_m: float, tau_e: float) -> float:
    """Return the torque through the gear [N m] whose magnitude adds to static friction."""
    return share_balance(tau_m, tau_e, friction.K_ms, friction.K_es)


def share(friction: Friction, tau_m: float, tau_e: float) -> float:
    """Return the torque through the gear [N m] whose magnitude adds to sliding friction."""
    return share_balance(tau_m, tau_e, friction.K_m, friction.K_e)


def share_slopes(friction: Friction, forward: bool, sign: float) -> tuple[float, float]:
    """Return by how much friction against +q grows per τ_m and per τ_e [1], where the share has this sign."""
    F = sliding_friction(friction, forward, math.inf, 0.0, 0.0)
    toward = sign if forward else -sign
    return (toward * (sliding_friction(friction, forward, math.inf, 1.0, 0.0) - F),
            -toward * (sliding_friction(friction, forward, math.inf, 0.0, 1.0) - F))


def core_speed(friction: Friction) -> float:
    """Return the output speed [rad/s] beyond which the smoothed friction (41) is constant; 0 for true sticking."""
    return _SATURATED_TANH / friction.kappa if friction.kappa > 0.0 else 0.0


def coulomb(friction: Friction, forward: bool) -> float:
    """Return the magnitude of the gear's Coulomb friction [N m]."""
    return abs(coulomb_torque(1.0 if forward else -1.0, friction.F_forward, friction.F_backward))


def sliding_friction(friction: Friction, forward: bool, w: float, tau_m: float, tau_e: float) -> float:
    """Return the magnitude of the gear's friction [N m] at the speed w, for the torques of motor and load in +q."""
    F = coulomb(friction, forward)
    if friction.varies == 0.0:
        return F
    if friction.w_s == 0.0:  # static friction ends as soon as the shaft moves
        return sliding_gear_friction(tau_m, tau_e, F, friction.K_m, friction.K_e)
    return gear_friction_budget(
        w, tau_m, tau_e, coulomb_torque=F, breakaway_ratio=friction.breakaway, stribeck_speed=friction.w_s,
        stribeck_exponent=friction.alpha, load_friction_motor=friction.K_m, load_friction_external=friction.K_e,
        load_friction_motor_stribeck=friction.K_ms, load_friction_external_stribeck=friction.K_es,
        load_friction_motor_quad=friction.K_mq, load_friction_external_quad=friction.K_eq)


def sliding_against(friction: Friction, forward: bool, sign: int, w: float, tau_m: float, tau_e: float) -> float:
    """Return the same while the share keeps its sign: beyond its zero too, where it is known and nothing fades."""
    if sign == 0 or fades(friction):
        return sliding_friction(friction, forward, w, tau_m, tau_e)
    return sliding_friction(friction, forward, w, 0.0, 0.0) + sign * share(friction, tau_m, tau_e)


def holding_friction(friction: Friction, forward: bool, tau_m: float, tau_e: float) -> float:
    """Return the torque [N m] up to which the gear holds against a start forward or backward."""
    F = coulomb(friction, forward)
    if friction.varies == 0.0:
        return breakaway_torque(F, friction.breakaway)
    static = static_gear_friction(
        tau_m, tau_e, F, friction.breakaway, friction.K_ms, friction.K_es, friction.K_mq, friction.K_eq)
    return sliding_gear_friction(tau_m, tau_e, F, friction.K_m, friction.K_e) + static


def pack_smoothed(given: Given, reduction: float) -> Friction:
    """Return the friction (41) of a servo."""
    forward, backward = _coulomb(given, reduction)
    kappa = motor_from_output(given.friction_zero_crossing_slope, reduction)
    return Friction(forward, backward, 1.0, kappa, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def pack_sticking(given: Given, reduction: float) -> Friction:
    """Return the Coulomb and static friction of a servo."""
    forward, backward = _coulomb(given, reduction)
    ratio = either(given.friction_breakaway_ratio, 1.0)
    return Friction(forward, backward, ratio, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def pack(given: Given, reduction: float) -> Friction:
    """Return all friction of a servo's gear."""
    forward, backward = _coulomb(given, reduction)
    ratio = either(given.friction_breakaway_ratio, 1.0)
    w_s = either(given.friction_stribeck_speed, 0.0) / reduction
    share, static = either(given.friction_load_friction, 0.0), either(given.friction_load_friction_stribeck, 0.0)
    K_m = either(given.friction_load_friction_motor, 0.0) + share
    K_e = either(given.friction_load_friction_external, 0.0) + share
    K_ms = either(given.friction_load_friction_motor_stribeck, 0.0) + static
    K_es = either(given.friction_load_friction_external_stribeck, 0.0) + static
    K_mq = either(given.friction_load_friction_motor_quad, 0.0)
    K_eq = either(given.friction_load_friction_external_quad, 0.0)
    fading = w_s > 0.0 and ratio > 1.0
    shares = K_m != 0.0 or K_e != 0.0 or K_ms != 0.0 or K_es != 0.0 or K_mq != 0.0 or K_eq != 0.0
    return Friction(forward, backward, ratio, 0.0, 1.0 if fading or shares else 0.0, w_s,
                    either(given.friction_stribeck_exponent, 1.0), K_m, K_e, K_ms, K_es, K_mq, K_eq)


def _coulomb(given: Given, reduction: float) -> tuple[float, float]:
    return (output_torque(given.friction_coulomb_torque_forward, reduction),
            output_torque(given.friction_coulomb_torque_backward, reduction))
