"""What moves, as plain numbers, and the modes that it can be in.

A mode says which of the laws hold: the zone of the voltage law, how the shaft moves, and where the play of the gear
is. What a model lacks has a neutral value (no supply limit: infinite; no deadband, stop, friction or play: absent),
so every law stands once and serves all models. All quantities are at the output shaft (a bare motor has N = 1).
"""

from __future__ import annotations

from typing import NamedTuple

from servotwin.physics import thermal


class Plant(NamedTuple):
    """Everything that the automaton reads, as plain floats in SI; the first five change with temperature."""

    K: float  # N k_a
    K_b: float  # N k_b
    R: float
    R_drive: float  # R_a + r_c + R_b
    R_off: float
    J: float  # N² J_m + J_L
    b: float  # N² B_m + B_L
    L: float  # 0: the current follows at once
    F_forward: float  # N F_ec1
    F_backward: float  # N F_ec2
    breakaway: float  # F_s / F_c
    kappa: float  # N k, slope of tanh (41); 0: true sticking
    coulomb: float  # dry friction of the load
    stiffness: float
    rest_angle: float
    gravity: float  # m g l
    hanging_angle: float
    gain: float  # A k_s
    p: float
    b_o: float
    half_deadband: float
    V_max: float
    lower: float
    upper: float
    restitution: float
    V: float  # V_oc behind a switched bridge; 0: there is none, and the voltage follows the error
    D_drive: float  # V_ce0 + V_br: no current flows where |s V − K_b w| is less
    D_off: float  # the same between drives
    R_b: float  # of the source, a part of R_drive and, where the bridge coasts, of R_off
    I_max: float  # most that a regulator gives; inf: a battery
    varies: float  # 1: sliding friction is not constant
    w_s: float  # v_s / N; 0: static friction ends as soon as the shaft moves
    alpha: float
    K_m: float
    K_e: float
    K_ms: float
    K_es: float
    K_mq: float
    K_eq: float
    half_play: float  # of the gear
    J_out: float  # of the output side alone
    b_out: float
    half_slack: float  # half of the play between output and potentiometer
    C_w: float  # of the winding [J/K]; 0: temperatures stay
    C_h: float
    G_wh: float  # [W/K]
    G_ha: float
    T_amb: float
    magnet: float  # [1/K]


class Mode(NamedTuple):
    """Zone of the voltage law, contact of the shaft, place in the play, and contact of the motor inside the play."""

    zone: int
    contact: int
    mesh: int
    motor: int


Vector = tuple[float, float, float, float, float, float, float]
"""Angle, speed and current; temperatures of winding and housing; angle and speed of the motor, at the output shaft.

Without inductance the current is kept as 0, without heat the temperatures stay; where motor and output are one body,
the motor's angle and speed go with the output's.
"""

NOWHERE: Vector = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

SATURATED_BACKWARD, LINEAR_BACKWARD, DEAD, LINEAR, SATURATED = -2, -1, 0, 1, 2
# Behind a bridge, in the order of the voltage that drives the current. Conducting: without drops, either way.
# Limited: the regulator gives its most. Short: even at no bus voltage more flows.
CONDUCTING, SHORT_BACKWARD, LIMITED_BACKWARD, CURRENT_BACKWARD, NO_CURRENT = 3, 4, 5, 6, 7
CURRENT_FORWARD, LIMITED_FORWARD, SHORT_FORWARD = 8, 9, 10

FREE, FORWARD, BACKWARD, CORE, STUCK, ON_LOWER, ON_UPPER = range(7)

RIGID, INSIDE, ON_FORWARD, ON_BACKWARD = range(4)  # forward: where the motor pushes the output forward


def at_rest(contact: int) -> bool:
    """Tell whether a shaft stands still in this contact."""
    return contact >= STUCK


def at_temperature(plant: Plant, T_w: float, T_h: float) -> Plant:
    """Return the plant with a winding and a housing of these temperatures [K]: copper and magnets follow them."""
    R = thermal.winding_resistance(T_w, plant.R)
    more = R - plant.R
    field = thermal.magnet_factor(T_h, plant.magnet)
    return Plant(plant.K * field, plant.K_b * field, R, plant.R_drive + more, plant.R_off + more, *plant[5:])
