"""One servo with its load in SI at the output shaft, and the laws of its friction, heat and armature loop.

All of it is a reading of docs/theory: friction M1 to M6 in one formula (what is absent is 0), armature and bridge, the
copper's and the magnets' temperature. Torques: τ_m = N k_a i and τ_e = −τ_ext − B_L w, both positive in +q.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

COPPER = 0.00385  # 1/K
REFERENCE = 298.15  # K
GRAVITY = 9.80665  # m/s²


class Signs(NamedTuple):
    """Signs that decide which branch of the friction law holds; frozen while a smooth piece lasts."""

    sliding: int = 0  # of K_m τ_m − K_e τ_e
    static: int = 0  # of K_ms τ_m − K_es τ_e
    motor: int = 0
    external: int = 0
    total: int = 0


class Loop(NamedTuple):
    """What closes around the armature: source voltage, voltage lost whatever the current, resistance."""

    source: float
    lost: float
    R: float


@dataclass(frozen=True, kw_only=True)
class Plant:
    """Motor, bridge, gear, stops, heat and load; at the output shaft, at 25 °C."""

    N: float
    J_m: float  # N² J_m
    J_L: float  # load and what turns with it
    B_m: float
    B_L: float
    K: float
    K_b: float
    R: float
    L: float  # 0: neglected
    V_br: float
    V_ce0: float
    r_c: float
    coasts: bool
    forward: float  # N F_ec1
    backward: float
    bearing: float  # T_o: of it, what acts on the output inside the play
    r: float
    w_s: float | None
    alpha: float
    K_m: float
    K_e: float
    K_ms: float
    K_es: float
    K_mq: float
    K_eq: float
    play: float
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
    coulomb: float
    torque: float
    stiffness: float
    rest: float
    gravity: float
    hanging: float

    @property
    def J(self) -> float:
        return self.J_m + self.J_L

    def external(self, q: float) -> float:
        """τ_ext [N m], positive towards −q."""
        return self.torque + self.stiffness * (q - self.rest) + self.gravity * math.sin(q - self.hanging)

    def electric(self, T_w: float, T_h: float) -> tuple[float, float, float]:
        """R_a, N k_a and N k_b at these temperatures [K]."""
        if not self.hot:
            return self.R, self.K, self.K_b
        magnets = 1.0 + self.magnet * (T_h - REFERENCE)
        return self.R * (1.0 + COPPER * (T_w - REFERENCE)), self.K * magnets, self.K_b * magnets

    def loop(self, drive: int, V_bus: float, R_a: float) -> Loop:
        """Driven, braked or coasting."""
        if drive:
            return Loop(drive * V_bus, self.V_ce0 + self.V_br, R_a + self.r_c)
        if self.coasts:
            return Loop(0.0, V_bus + self.V_ce0 + self.V_br, R_a)
        return Loop(0.0, self.V_br, R_a)

    def stribeck(self, speed: float) -> float:
        """S of a moving shaft; `speed` = |w|, where a step may look a little beyond 0 as if it went on smoothly."""
        if self.w_s is None:
            return 0.0
        x = max(speed / self.w_s, -1.0)
        return math.exp(-x if self.alpha == 1.0 else -x * x if self.alpha == 2.0 else -(abs(x) ** self.alpha))

    def signs(self, tau_m: float, tau_e: float) -> Signs:
        return Signs(
            sgn(self.K_m * tau_m - self.K_e * tau_e), sgn(self.K_ms * tau_m - self.K_es * tau_e), sgn(tau_m),
            sgn(tau_e), sgn(tau_m + tau_e))

    def budget(self, direction: int, tau_m: float, tau_e: float, S: float, signs: Signs) -> float:
        """G [N m]: what gear and motor can hold or take; the signs are those of the torques, or were."""
        F = self.forward if direction > 0 else self.backward
        static = (self.r - 1.0) * F + signs.static * (self.K_ms * tau_m - self.K_es * tau_e)
        if signs.motor * signs.external < 0 and signs.total:
            static += self.K_eq * tau_e**2 if signs.total == signs.motor else self.K_mq * tau_m**2
        return F + signs.sliding * (self.K_m * tau_m - self.K_e * tau_e) + S * static

    def holds(self, tau_m: float, tau_e: float, coulomb: float) -> tuple[float, float]:
        """Largest backward and forward τ_m + τ_e that leave a resting shaft at rest (S = 1)."""
        signs = self.signs(tau_m, tau_e)
        return (-self.budget(-1, tau_m, tau_e, 1.0, signs) - coulomb,
                self.budget(1, tau_m, tau_e, 1.0, signs) + coulomb)

    @property
    def behind(self) -> float:
        """Dry friction of the output inside the play [N m]."""
        return self.coulomb + self.bearing


def sgn(x: float) -> int:
    return (x > 0.0) - (x < 0.0)


def _heat(v: Mapping[str, Any]) -> dict[str, Any]:
    names = ("winding_capacity", "housing_capacity", "winding_to_housing", "housing_to_ambient")
    given = [v.get(f"thermal.{name}") for name in names]
    hot = None not in given
    if not hot and any(x is not None for x in given):
        raise ValueError(f"thermal: some but not all of {names}")
    C_w, C_h, R_wh, R_ha = given if hot else (1.0, 1.0, 1.0, 1.0)
    return {"hot": hot, "C_w": C_w, "C_h": C_h, "R_wh": R_wh, "R_ha": R_ha,
            "ambient": v.get("thermal.ambient", REFERENCE), "magnet": v.get("thermal.magnet_coefficient", 0.0)}


def _friction(v: Mapping[str, Any], N: float) -> dict[str, Any]:
    def of(name: str, default: float = 0.0) -> float:
        return float(v.get(f"friction.{name}", default))

    v_s, one, one_static = v.get("friction.stribeck_speed"), of("load_friction"), of("load_friction_stribeck")
    return {
        "forward": N * of("coulomb_torque_forward"), "backward": N * of("coulomb_torque_backward"),
        "bearing": of("bearing_coulomb_torque", 0.06 * N * min(of("coulomb_torque_forward"),
                                                               of("coulomb_torque_backward"))),
        "r": of("breakaway_ratio", 1.0), "w_s": None if v_s is None else v_s / N,
        "alpha": of("stribeck_exponent", 1.0),
        "K_m": of("load_friction_motor", one), "K_e": of("load_friction_external", one),
        "K_ms": of("load_friction_motor_stribeck", one_static),
        "K_es": of("load_friction_external_stribeck", one_static),
        "K_mq": of("load_friction_motor_quad"), "K_eq": of("load_friction_external_quad"),
    }


def make_plant(v: Mapping[str, Any], load: Mapping[str, float]) -> Plant:
    """Plant of a servo's values by dotted name and of a load's numbers (names as in `Case`)."""
    N, m, length = v["gear.gear_reduction"], load.get("pendulum.mass", 0.0), load.get("pendulum.length", 0.0)
    J_L = load.get("inertia", 0.0) + m * length**2 + v.get("gear.output_inertia", 0.0)
    play = v.get("gear.backlash", 0.0)
    if play and J_L <= 0.0:
        raise ValueError("backlash without inertia on the output side")
    return Plant(
        N=N, J_m=N**2 * v["motor.rotor_inertia"], J_L=J_L, B_m=N**2 * v.get("motor.motor_viscous_friction", 0.0),
        B_L=load.get("viscous_friction", 0.0), K=N * v["motor.torque_constant"], K_b=N * v["motor.back_emf_constant"],
        R=v["motor.armature_resistance"], L=v.get("motor.armature_inductance", 0.0),
        V_br=v.get("motor.brush_drop_voltage", 0.0), V_ce0=v.get("supply.bridge_drop_voltage", 0.0),
        r_c=v.get("supply.bridge_drop_resistance", 0.0), coasts=v["electronics.off_state"] == "coast",
        play=play, lower=v.get("stops.lower_angle", -math.inf), upper=v.get("stops.upper_angle", math.inf),
        restitution=v.get("stops.restitution", 0.0),
        coulomb=load.get("coulomb_torque", 0.0), torque=load.get("torque", 0.0),
        stiffness=load.get("spring.stiffness", 0.0), rest=load.get("spring.rest_angle", 0.0),
        gravity=m * GRAVITY * length, hanging=load.get("pendulum.hanging_angle", 0.0),
        **_friction(v, N), **_heat(v),
    )
