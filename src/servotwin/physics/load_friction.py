"""Friction of the gear train that grows with the torque through it, at the output shaft.

One law holds the models M1 to M6 of Duclusaud et al., "Extended Friction Models for the Physics Simulation of Servo
Actuators", ICRA 2025: what a model lacks is 0. Motor torque τ_m and external torque τ_e are both positive in +q, so
their difference is the sum of their magnitudes where the motor holds a load.
"""

from __future__ import annotations

import math

from servotwin.physics.elementary import exp, log
from servotwin.physics.friction import breakaway_torque, sticks

_NOTHING_LEFT = 7.0  # exp(−exp(7)) is 0, and a trial step may be far too fast for a power


def stribeck_factor(speed: float, stribeck_speed: float = 0.0, stribeck_exponent: float = 1.0) -> float:
    """Return how much of the static friction is left at a speed.

    Parameters
    ----------
    speed : float or array
        w, of the shaft at which `stribeck_speed` is given [rad/s].
    stribeck_speed : float or array, optional
        w_s; at the output shaft it is v_s/N. Without it, or with 0, static friction ends where motion begins [rad/s].
    stribeck_exponent : float or array
        α, positive [1].

    Returns
    -------
    float or array
        S = exp(−abs(w/w_s)^α): 1 at rest, 0 far beyond w_s [1].

    Notes
    -----
    Duclusaud et al., 2025. The limit w_s → 0 is what holds without `stribeck_speed`.

    Examples
    --------
    >>> [round(stribeck_factor(w, 2.0), 4) for w in (0.0, 2.0, -4.0)], stribeck_factor(1e-9)
    ([1.0, 0.3679, 0.1353], 0.0)
    """
    if speed == 0.0:
        return 1.0
    if stribeck_speed == 0.0:
        return 0.0
    log_power = stribeck_exponent * log(abs(speed) / stribeck_speed)
    return exp(-exp(log_power)) if log_power < _NOTHING_LEFT else 0.0


def torque_on_gear(external_torque: float, output_speed: float, load_viscous_friction: float) -> float:
    """Return the torque with which a load acts on the gear.

    Parameters
    ----------
    external_torque : float or array
        τ_ext [N m].
    output_speed : float or array
        q̇ [rad/s].
    load_viscous_friction : float or array
        B_L [N m s/rad].

    Returns
    -------
    float or array
        τ_e = −τ_ext − B_L q̇, towards +q [N m].

    Examples
    --------
    >>> torque_on_gear(0.5, 2.0, 0.25)
    -1.0
    """
    return -external_torque - load_viscous_friction * output_speed


def share_balance(motor_torque: float, external_torque_on_gear: float, motor_share: float,
                  external_share: float) -> float:
    """Return the torque through a gear whose magnitude makes friction.

    Parameters
    ----------
    motor_torque, external_torque_on_gear, motor_share, external_share : float or array
        As in `torque_share`.

    Returns
    -------
    float or array
        K_m τ_m − K_e τ_e [N m].

    Examples
    --------
    >>> share_balance(1.0, -0.5, 0.5, 0.25)
    0.625
    """
    return motor_share * motor_torque - external_share * external_torque_on_gear


def torque_share(motor_torque: float, external_torque_on_gear: float, motor_share: float,
                 external_share: float) -> float:
    """Return the friction that the torques through a gear make.

    Parameters
    ----------
    motor_torque : float or array
        τ_m [N m].
    external_torque_on_gear : float or array
        τ_e [N m].
    motor_share, external_share : float or array
        K_m and K_e of sliding, or K_ms and K_es of static friction [1].

    Returns
    -------
    float or array
        abs(K_m τ_m − K_e τ_e) [N m].

    Notes
    -----
    Models M3 to M6 of Duclusaud et al., 2025.

    Examples
    --------
    >>> torque_share(1.0, -0.5, 0.5, 0.25)
    0.625
    """
    return abs(share_balance(motor_torque, external_torque_on_gear, motor_share, external_share))


def quadratic_gear_friction(motor_torque: float, external_torque_on_gear: float, load_friction_motor_quad: float = 0.0,
                            load_friction_external_quad: float = 0.0) -> float:
    """Return the part of the static gear friction that is quadratic in a torque.

    Parameters
    ----------
    motor_torque : float or array
        τ_m = N k_a i_a [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext − B_L q̇ [N m].
    load_friction_motor_quad, load_friction_external_quad : float or array
        K_mq and K_eq, at least 0 [1/(N m)].

    Returns
    -------
    float or array
        Q: 0 where the torques have one sign or one size, else K_eq τ_e² where τ_m is the larger one and K_mq τ_m²
        where τ_e is. It is the square of the smaller one in either case [N m].

    Notes
    -----
    Model M6 of Duclusaud et al., 2025.

    Examples
    --------
    >>> [float(quadratic_gear_friction(m, e, 0.1, 0.5)) for m, e in ((2.0, 1.0), (2.0, -1.0), (1.0, -2.0))]
    [0.0, 0.5, 0.1]
    """
    tau_m, tau_e = motor_torque, external_torque_on_gear
    if tau_m * tau_e >= 0.0 or abs(tau_m) == abs(tau_e):
        return 0.0
    if abs(tau_m) > abs(tau_e):
        return load_friction_external_quad * (tau_e * tau_e)  # as a power it would be an error to overflow
    return load_friction_motor_quad * (tau_m * tau_m)


def sliding_gear_friction(motor_torque: float, external_torque_on_gear: float, coulomb_torque: float,
                          load_friction_motor: float = 0.0, load_friction_external: float = 0.0) -> float:
    """Return the dry friction of a gear that slides fast.

    Parameters
    ----------
    motor_torque, external_torque_on_gear : float or array
        τ_m and τ_e [N m].
    coulomb_torque : float or array
        N F_c of the direction in question [N m].
    load_friction_motor, load_friction_external : float or array
        K_m and K_e, both K_l for one share [1].

    Returns
    -------
    float or array
        N F_c + abs(K_m τ_m − K_e τ_e), a magnitude [N m].

    Notes
    -----
    Models M3 and M5 of Duclusaud et al., 2025, without viscous friction.

    Examples
    --------
    >>> sliding_gear_friction(1.0, -0.5, 0.25, 0.5, 0.25)
    0.875
    """
    return coulomb_torque + torque_share(motor_torque, external_torque_on_gear, load_friction_motor,
                                         load_friction_external)


def static_gear_friction(motor_torque: float, external_torque_on_gear: float, coulomb_torque: float,
                         breakaway_ratio: float = 1.0, load_friction_motor_stribeck: float = 0.0,
                         load_friction_external_stribeck: float = 0.0, load_friction_motor_quad: float = 0.0,
                         load_friction_external_quad: float = 0.0) -> float:
    """Return what a gear at rest holds beyond its sliding friction.

    Parameters
    ----------
    motor_torque, external_torque_on_gear : float or array
        τ_m and τ_e [N m].
    coulomb_torque : float or array
        N F_c of the direction in question [N m].
    breakaway_ratio : float or array
        r, at least 1 [1].
    load_friction_motor_stribeck, load_friction_external_stribeck : float or array
        K_ms and K_es, both K_ls for one share [1].
    load_friction_motor_quad, load_friction_external_quad : float or array
        K_mq and K_eq [1/(N m)].

    Returns
    -------
    float or array
        N (r − 1) F_c + abs(K_ms τ_m − K_es τ_e) + Q, a magnitude [N m].

    Notes
    -----
    Models M2, M4 and M6 of Duclusaud et al., 2025; `stribeck_factor` says how it fades with speed.

    Examples
    --------
    >>> static_gear_friction(1.0, -0.5, 0.25, 2.0, 0.5, 0.25)
    0.875
    """
    Q = quadratic_gear_friction(motor_torque, external_torque_on_gear, load_friction_motor_quad,
                                load_friction_external_quad)
    return (breakaway_torque(coulomb_torque, breakaway_ratio) - coulomb_torque
            + torque_share(motor_torque, external_torque_on_gear, load_friction_motor_stribeck,
                           load_friction_external_stribeck) + Q)


def gear_friction_budget(
    output_speed: float, motor_torque: float, external_torque_on_gear: float, *, coulomb_torque: float,
    breakaway_ratio: float = 1.0, stribeck_speed: float = 0.0, stribeck_exponent: float = 1.0,
    load_friction_motor: float = 0.0, load_friction_external: float = 0.0,
    load_friction_motor_stribeck: float = 0.0, load_friction_external_stribeck: float = 0.0,
    load_friction_motor_quad: float = 0.0, load_friction_external_quad: float = 0.0,
) -> float:
    """Return the dry friction that the gear can bring up against a motion, or against its start.

    Parameters
    ----------
    output_speed : float or array
        w = q̇ [rad/s].
    motor_torque : float or array
        τ_m = N k_a i_a [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext − B_L q̇ [N m].
    coulomb_torque : float or array
        N F_c,d of the direction in question: N F_ec1 forward, N F_ec2 backward [N m].
    breakaway_ratio : float or array
        r, at least 1 [1].
    stribeck_speed : float or array, optional
        w_s = v_s/N, at the output shaft [rad/s].
    stribeck_exponent : float or array
        α [1].
    load_friction_motor, load_friction_external : float or array
        K_m and K_e, both K_l for one share [1].
    load_friction_motor_stribeck, load_friction_external_stribeck : float or array
        K_ms and K_es, both K_ls for one share [1].
    load_friction_motor_quad, load_friction_external_quad : float or array
        K_mq and K_eq [1/(N m)].

    Returns
    -------
    float or array
        G = N F_c + abs(K_m τ_m − K_e τ_e) + S (N (r − 1) F_c + abs(K_ms τ_m − K_es τ_e) + Q), a magnitude [N m].

    Notes
    -----
    Models M1 to M6 of Duclusaud et al., 2025, without their viscous term, which is N² B_m here as everywhere. A shaft
    that slides has the friction −sgn(w) G; one at rest is held up to G (`gear_sticks`).

    Examples
    --------
    A motor that drives 1 N m forward against a load of 0.5 N m, with a share of 10 %, sliding without Stribeck:

    >>> round(float(gear_friction_budget(1.0, 1.0, -0.5, coulomb_torque=0.2, breakaway_ratio=1.5,
    ...                                  load_friction_motor=0.1, load_friction_external=0.1)), 9)
    0.35
    """
    tau_m, tau_e, N_F_c = motor_torque, external_torque_on_gear, coulomb_torque
    S = stribeck_factor(output_speed, stribeck_speed, stribeck_exponent)
    static = static_gear_friction(
        tau_m, tau_e, N_F_c, breakaway_ratio, load_friction_motor_stribeck, load_friction_external_stribeck,
        load_friction_motor_quad, load_friction_external_quad)
    return sliding_gear_friction(tau_m, tau_e, N_F_c, load_friction_motor, load_friction_external) + S * static


def gear_sticks(
    motor_torque: float, external_torque_on_gear: float, *, coulomb_torque_forward: float,
    coulomb_torque_backward: float, load_coulomb_torque: float = 0.0, breakaway_ratio: float = 1.0,
    load_friction_motor: float = 0.0, load_friction_external: float = 0.0,
    load_friction_motor_stribeck: float = 0.0, load_friction_external_stribeck: float = 0.0,
    load_friction_motor_quad: float = 0.0, load_friction_external_quad: float = 0.0,
) -> bool:
    """Return whether a gear at rest stays at rest.

    Parameters
    ----------
    motor_torque : float or array
        τ_m = N k_a i_a [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext [N m].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        N F_ec1 and N F_ec2 [N m].
    load_coulomb_torque : float or array
        c_L, dry friction of the load itself [N m].
    breakaway_ratio, load_friction_motor, load_friction_external, load_friction_motor_stribeck, \
    load_friction_external_stribeck, load_friction_motor_quad, load_friction_external_quad : float or array
        As in `gear_friction_budget`.

    Returns
    -------
    bool or array of bool
        True where −(G_b + c_L) ≤ τ_m + τ_e ≤ G_f + c_L, with the budgets forward and backward at S = 1.

    Notes
    -----
    With no shares it is `servotwin.physics.friction.sticks` at the output shaft. Where it is false the shaft starts in
    the direction of τ_m + τ_e.

    Examples
    --------
    >>> friction = {"coulomb_torque_forward": 0.2, "coulomb_torque_backward": 0.2}
    >>> gear_sticks(0.0, -0.3, **friction), gear_sticks(0.0, -0.3, **friction, load_friction_external=0.4)
    (False, True)
    """
    tau = motor_torque + external_torque_on_gear
    more = load_coulomb_torque + sliding_gear_friction(
        motor_torque, external_torque_on_gear, 0.0, load_friction_motor, load_friction_external)
    more += static_gear_friction(
        motor_torque, external_torque_on_gear, 0.0, 1.0, load_friction_motor_stribeck, load_friction_external_stribeck,
        load_friction_motor_quad, load_friction_external_quad)
    return sticks(tau, breakaway_torque(coulomb_torque_forward, breakaway_ratio) + more,
                  breakaway_torque(coulomb_torque_backward, breakaway_ratio) + more)


def forward_efficiency(load_friction_motor: float, load_friction_external: float) -> float:
    """Return what part of the motor's torque beyond Coulomb friction reaches a load that it drives.

    Parameters
    ----------
    load_friction_motor : float or array
        K_m, below 1 in a gear that a motor can turn [1].
    load_friction_external : float or array
        K_e [1].

    Returns
    -------
    float or array
        η = (1 − K_m)/(1 + K_e) [1].

    Notes
    -----
    From the balance τ_m + τ_e = K_m τ_m − K_e τ_e with τ_e = −η τ_m. It does not say how well the gear runs backward:
    that is `back_drive_torque`.

    Examples
    --------
    >>> round(float(forward_efficiency(0.1, 0.125)), 9)
    0.8
    """
    return (1.0 - load_friction_motor) / (1.0 + load_friction_external)


def back_drive_torque(coulomb_torque: float, load_friction_external: float) -> float:
    """Return the torque at the output that begins to turn an unpowered gear.

    Parameters
    ----------
    coulomb_torque : float or array
        τ_c, what friction holds without load; static friction included where the start is meant [N m].
    load_friction_external : float or array
        K_e, and K_es more where the start is meant [1].

    Returns
    -------
    float or array
        τ_c/(1 − K_e); inf from K_e = 1 on, where the gear locks itself as a worm does [N m].

    Notes
    -----
    From the balance τ_e = τ_c + K_e τ_e without a motor torque.

    Examples
    --------
    >>> float(back_drive_torque(0.2, 0.5)), float(back_drive_torque(0.2, 1.0))
    (0.4, inf)
    """
    turns = 1.0 - load_friction_external
    return coulomb_torque / turns if turns > 0.0 else math.inf
