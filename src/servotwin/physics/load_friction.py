"""Friction of the gear train that grows with the torque through it, at the output shaft.

One law holds the models M1 to M6 of Duclusaud et al., "Extended Friction Models for the Physics Simulation of Servo
Actuators", ICRA 2025: what a model lacks is 0. Motor torque τ_m and external torque τ_e are both positive in +q, so
their difference is the sum of their magnitudes where the motor holds a load.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.physics._typing import Real


def stribeck_factor(speed: Real, stribeck_speed: Real | None = None, stribeck_exponent: Real = 1.0) -> Real:
    """Return how much of the static friction is left at a speed.

    Parameters
    ----------
    speed : float or array
        w, of the shaft at which `stribeck_speed` is given [rad/s].
    stribeck_speed : float or array, optional
        w_s, positive; at the output shaft it is v_s/N. Without it static friction ends where motion begins [rad/s].
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
    >>> [round(float(stribeck_factor(w, 2.0)), 4) for w in (0.0, 2.0, -4.0)], float(stribeck_factor(1e-9))
    ([1.0, 0.3679, 0.1353], 0.0)
    """
    S: Real
    if stribeck_speed is None:
        S = np.where(np.asarray(speed) == 0.0, 1.0, 0.0)[()]
        return S
    with np.errstate(over="ignore"):  # a power beyond all numbers leaves nothing of it, as it should
        S = np.exp(-np.power(np.abs(np.asarray(speed / stribeck_speed)), stribeck_exponent))[()]
    return S


def quadratic_gear_friction(motor_torque: Real, external_torque_on_gear: Real, load_friction_motor_quad: Real = 0.0,
                            load_friction_external_quad: Real = 0.0) -> Real:
    """Return the part of the static gear friction that is quadratic in a torque.

    Parameters
    ----------
    motor_torque : float or array
        τ_m = N k_a i_a, at the output shaft [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext − B_L q̇, what acts on the gear from outside, towards +q [N m].
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
    m, e = np.abs(tau_m), np.abs(tau_e)
    larger = np.where(m > e, load_friction_external_quad * e**2, load_friction_motor_quad * m**2)
    Q: Real = np.where((np.sign(tau_m) == np.sign(tau_e)) | (m == e), 0.0, larger)[()]
    return Q


def gear_friction_budget(
    output_speed: Real, motor_torque: Real, external_torque_on_gear: Real, *, coulomb_torque: Real,
    breakaway_ratio: Real = 1.0, stribeck_speed: Real | None = None, stribeck_exponent: Real = 1.0,
    load_friction_motor: Real = 0.0, load_friction_external: Real = 0.0,
    load_friction_motor_stribeck: Real = 0.0, load_friction_external_stribeck: Real = 0.0,
    load_friction_motor_quad: Real = 0.0, load_friction_external_quad: Real = 0.0,
) -> Real:
    """Return the dry friction that the gear can bring up against a motion, or against its start.

    Parameters
    ----------
    output_speed : float or array
        w = q̇ [rad/s].
    motor_torque : float or array
        τ_m = N k_a i_a, at the output shaft [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext − B_L q̇, what acts on the gear from outside, towards +q [N m].
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
    K_m, K_e = load_friction_motor, load_friction_external
    K_ms, K_es = load_friction_motor_stribeck, load_friction_external_stribeck
    S = stribeck_factor(output_speed, stribeck_speed, stribeck_exponent)
    Q = quadratic_gear_friction(tau_m, tau_e, load_friction_motor_quad, load_friction_external_quad)
    static = N_F_c * (breakaway_ratio - 1.0) + np.abs(K_ms * tau_m - K_es * tau_e) + Q
    return N_F_c + np.abs(K_m * tau_m - K_e * tau_e) + S * static


def gear_sticks(
    motor_torque: Real, external_torque_on_gear: Real, *, coulomb_torque_forward: Real,
    coulomb_torque_backward: Real, load_coulomb_torque: Real = 0.0, **shares: Real,
) -> bool | NDArray[np.bool_]:
    """Return whether a gear at rest stays at rest.

    Parameters
    ----------
    motor_torque : float or array
        τ_m = N k_a i_a, at the output shaft [N m].
    external_torque_on_gear : float or array
        τ_e = −τ_ext, what acts on the gear from outside, towards +q [N m].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        N F_ec1 and N F_ec2 [N m].
    load_coulomb_torque : float or array
        c_L, dry friction of the load itself [N m].
    **shares : float or array
        `breakaway_ratio` and the shares of `gear_friction_budget`.

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
    common: dict[str, Any] = shares
    G_f, G_b = (gear_friction_budget(0.0, motor_torque, external_torque_on_gear, coulomb_torque=F, **common)
                for F in (coulomb_torque_forward, coulomb_torque_backward))
    held = np.asarray((-(G_b + load_coulomb_torque) <= tau) & (tau <= G_f + load_coulomb_torque))
    return held if held.ndim else bool(held)


def forward_efficiency(load_friction_motor: Real, load_friction_external: Real) -> Real:
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


def back_drive_torque(coulomb_torque: Real, load_friction_external: Real) -> Real:
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
    turns = np.asarray(1.0 - load_friction_external)
    tau: Real = np.where(turns > 0.0, coulomb_torque / np.where(turns > 0.0, turns, 1.0), np.inf)[()]
    return tau
