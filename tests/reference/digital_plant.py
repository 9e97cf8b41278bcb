"""What the digital servo's reference knows of motor, gear, friction, stops, heat and load, all at the output shaft.

Torques: τ_m = K i and τ_e = −τ_ext − B_L w, both positive in +q; a budget is what friction can hold or take.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

COPPER, REFERENCE = 0.00385, 298.15  # 1/K, K
REST = 1e-6  # rad/s: a slower rebound rests


class Piece(NamedTuple):
    """A constant or sloping stretch of something, right-continuous."""

    start: float
    value: float
    slope: float = 0.0

    def at(self, t: float) -> float:
        return self.value if self.slope == 0.0 else self.value + self.slope * (t - self.start)


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Numbers of one servo with its load."""

    J: float
    R_a: float
    K: float
    K_b: float
    V_br: float
    V_ce0: float
    r_c: float
    V_oc: float
    R_b: float
    I_max: float | None
    B_gear: float
    B_load: float
    forward: float
    backward: float
    breakaway: float
    w_s: float | None
    alpha: float
    shares: tuple[float, float, float, float, float, float]  # K_m, K_e, K_ms, K_es, K_mq, K_eq
    lower: float
    upper: float
    restitution: float
    hot: bool
    C_w: float
    C_h: float
    R_wh: float
    R_ha: float
    ambient: float
    magnet: float
    torque: tuple[Piece, ...]
    stiffness: float
    rest: float
    gravity: float

    @property
    def linear(self) -> bool:
        """Whether the shaft obeys a linear law with constant numbers by pieces of its speed."""
        return not (self.hot or self.stiffness or self.gravity or self.w_s or any(self.shares))

    def electric(self, T_w: float, T_h: float) -> tuple[float, float, float]:
        """R_a, K and K_b at these temperatures [K]."""
        if not self.hot:
            return self.R_a, self.K, self.K_b
        magnets = 1.0 + self.magnet * (T_h - REFERENCE)
        return self.R_a * (1.0 + COPPER * (T_w - REFERENCE)), self.K * magnets, self.K_b * magnets

    def external(self, piece: Piece, t: float, q: float) -> float:
        """τ_ext [N m], positive towards −q."""
        tau = piece.at(t) + self.stiffness * (q - self.rest)
        return tau + self.gravity * math.sin(q) if self.gravity else tau

    def budget(self, side: int, tau_m: float, tau_e: float, S: float) -> float:
        """Dry friction of gear and motor that resists a motion towards `side` [N m]."""
        F = self.forward if side > 0 else self.backward
        K_m, K_e, K_ms, K_es, K_mq, K_eq = self.shares
        static = (self.breakaway - 1.0) * F + abs(K_ms * tau_m - K_es * tau_e)
        if tau_m * tau_e < 0.0 and abs(tau_m) != abs(tau_e):
            static += K_eq * tau_e**2 if abs(tau_m) > abs(tau_e) else K_mq * tau_m**2
        return F + abs(K_m * tau_m - K_e * tau_e) + S * static

    def fading(self, speed: float) -> float:
        """S of a moving shaft; a step that looks a little beyond speed 0 sees it go on smoothly where it can."""
        if self.w_s is None:
            return 0.0
        x = max(speed / self.w_s, -1.0)
        return math.exp(-x if self.alpha == 1.0 else -(abs(x) ** self.alpha))

    def slack(self, tau_m: float, tau_ext: float) -> tuple[float, float]:
        """How far a resting shaft is from starting backward and forward [N m]; negative: it starts."""
        net = tau_m - tau_ext
        return (self.budget(-1, tau_m, -tau_ext, 1.0) + net, self.budget(1, tau_m, -tau_ext, 1.0) - net)


def make_plant(values: Mapping[str, Mapping[str, Any]], load: Mapping[str, Any]) -> Plant:
    """Plant of a servo's values by group and field, and of a load."""
    motor, supply, stops = values["motor"], values["supply"], values.get("stops", {})
    gear, friction, heat = values["gear"], values.get("friction", {}), values.get("thermal", {})
    if gear.get("backlash"):
        raise ValueError("this reference knows no play of the gear")
    N, pendulum = gear["gear_reduction"], load.get("pendulum") or {"mass": 0.0, "length": 0.0}
    m, length = pendulum["mass"], pendulum["length"]
    one, one_static = friction.get("load_friction", 0.0), friction.get("load_friction_stribeck", 0.0)
    v_s = friction.get("stribeck_speed")
    return Plant(
        J=N**2 * motor["rotor_inertia"] + gear.get("output_inertia", 0.0) + load.get("inertia", 0.0) + m * length**2,
        R_a=motor["armature_resistance"], K=N * motor["torque_constant"], K_b=N * motor["back_emf_constant"],
        V_br=motor.get("brush_drop_voltage", 0.0), V_ce0=supply.get("bridge_drop_voltage", 0.0),
        r_c=supply.get("bridge_drop_resistance", 0.0), V_oc=supply["open_circuit_voltage"],
        R_b=supply.get("internal_resistance", 0.0), I_max=supply.get("current_limit"),
        B_gear=N**2 * motor.get("motor_viscous_friction", 0.0), B_load=load.get("viscous_friction", 0.0),
        forward=N * friction.get("coulomb_torque_forward", 0.0),
        backward=N * friction.get("coulomb_torque_backward", 0.0),
        breakaway=friction.get("breakaway_ratio", 1.0), w_s=None if v_s is None else v_s / N,
        alpha=friction.get("stribeck_exponent", 1.0),
        shares=(friction.get("load_friction_motor", one), friction.get("load_friction_external", one),
                friction.get("load_friction_motor_stribeck", one_static),
                friction.get("load_friction_external_stribeck", one_static),
                friction.get("load_friction_motor_quad", 0.0), friction.get("load_friction_external_quad", 0.0)),
        lower=stops.get("lower_angle", -math.inf), upper=stops.get("upper_angle", math.inf),
        restitution=stops.get("restitution", 0.0),
        hot="winding_capacity" in heat, C_w=heat.get("winding_capacity", 1.0), C_h=heat.get("housing_capacity", 1.0),
        R_wh=heat.get("winding_to_housing", 1.0), R_ha=heat.get("housing_to_ambient", 1.0),
        ambient=heat.get("ambient", REFERENCE), magnet=heat.get("magnet_coefficient", 0.0),
        torque=_pieces(load.get("torque", 0.0)), stiffness=load.get("stiffness", 0.0), rest=load.get("rest", 0.0),
        gravity=m * length * pendulum.get("gravity", 9.80665),
    )


def _pieces(torque: float | Sequence[Sequence[float]]) -> tuple[Piece, ...]:
    """One number, or stretches (start, value, slope)."""
    return (Piece(0.0, torque),) if isinstance(torque, (int, float)) else tuple(Piece(*piece) for piece in torque)
