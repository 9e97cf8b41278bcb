"""Coulomb friction of the motor and gear train, at the motor shaft: smooth, true, and what each can hold.

"Forward" is the friction that resists q̇ > 0 or the start of it. Both torques are magnitudes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from servotwin.physics._typing import Real
from servotwin.physics.elementary import tanh

_MAX_STEPS = 200  # Newton's method ends after about ten; this is a stop for NaN only


def smoothed_coulomb_torque(
    motor_speed: float, coulomb_torque_forward: float, coulomb_torque_backward: float, zero_crossing_slope: float
) -> float:
    """Return the paper's Coulomb friction, smooth through zero speed.

    Parameters
    ----------
    motor_speed : float or array
        w [rad/s].
    coulomb_torque_forward : float or array
        F_ec1, at least 0 [N m].
    coulomb_torque_backward : float or array
        F_ec2, at least 0 [N m].
    zero_crossing_slope : float or array
        k, positive [s/rad].

    Returns
    -------
    float or array
        f_ec(w), against the motion for the sign +: it is subtracted from the driving torque [N m].

    Notes
    -----
    Eq. 41. Shaft and argument are the motor's, f_ec(q̇/n), as eq. 37 has it. There is no static term in it although the
    paper announces one: at rest it gives no torque at all, and a loaded shaft creeps (see `creep_speed`).

    Examples
    --------
    >>> [round(float(smoothed_coulomb_torque(w, 2.0, 3.0, 100.0)), 6) for w in (-1.0, 0.0, 1.0)]
    [-3.0, 0.0, 2.0]
    """
    w, k = motor_speed, zero_crossing_slope
    return (coulomb_torque_forward if w >= 0.0 else coulomb_torque_backward) * tanh(k * w)


def smoothed_coulomb_slope(motor_speed: float, coulomb_torque_forward: float, coulomb_torque_backward: float,
                           zero_crossing_slope: float) -> float:
    """Return by how much the paper's friction grows with the speed.

    Parameters
    ----------
    motor_speed : float or array
        w [rad/s].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        F_ec1 and F_ec2, at least 0 [N m].
    zero_crossing_slope : float or array
        k, positive [s/rad].

    Returns
    -------
    float or array
        df_ec/dw = F_ec k (1 − tanh²(k w)) [N m s/rad].

    Notes
    -----
    The derivative of eq. 41.

    Examples
    --------
    >>> smoothed_coulomb_slope(0.0, 2.0, 3.0, 100.0)
    200.0
    """
    w, k = motor_speed, zero_crossing_slope
    x = tanh(k * w)
    return (coulomb_torque_forward if w >= 0.0 else coulomb_torque_backward) * k * (1.0 - x * x)


def coulomb_torque(motor_speed: float, coulomb_torque_forward: float, coulomb_torque_backward: float) -> float:
    """Return the Coulomb friction of a sliding shaft by the true law of signs.

    Parameters
    ----------
    motor_speed : float or array
        w [rad/s].
    coulomb_torque_forward : float or array
        F_ec1, at least 0 [N m].
    coulomb_torque_backward : float or array
        F_ec2, at least 0 [N m].

    Returns
    -------
    float or array
        F_ec1 for w > 0, −F_ec2 for w < 0, and 0 at rest, where `sticks` decides [N m].

    Notes
    -----
    Eq. 41 in the limit k → ∞.

    Examples
    --------
    >>> [float(coulomb_torque(w, 2.0, 3.0)) for w in (-1.0, 0.0, 1.0)]
    [-3.0, 0.0, 2.0]
    """
    if motor_speed == 0.0:
        return 0.0
    return coulomb_torque_forward if motor_speed > 0.0 else -coulomb_torque_backward


def breakaway_torque(coulomb_torque: float, breakaway_ratio: float) -> float:
    """Return the torque up to which dry friction holds.

    Parameters
    ----------
    coulomb_torque : float or array
        F_c of one direction [N m].
    breakaway_ratio : float or array
        r = F_s/F_c, at least 1 [1].

    Returns
    -------
    float or array
        F_s = r F_c [N m].

    Examples
    --------
    >>> breakaway_torque(2.0, 1.25)
    2.5
    """
    return breakaway_ratio * coulomb_torque


def sticks(
    torque: float, coulomb_torque_forward: float, coulomb_torque_backward: float, breakaway_ratio: float = 1.0
) -> bool:
    """Return whether a shaft at rest stays at rest.

    Parameters
    ----------
    torque : float or array
        τ_a = k_a i_a − n τ_ext, what pushes the resting motor shaft towards +q [N m].
    coulomb_torque_forward : float or array
        F_ec1, at least 0 [N m].
    coulomb_torque_backward : float or array
        F_ec2, at least 0 [N m].
    breakaway_ratio : float or array
        r = F_s/F_c, at least 1 [1].

    Returns
    -------
    bool or array of bool
        True where −r F_ec2 ≤ τ_a ≤ r F_ec1.

    Notes
    -----
    Not in the paper, whose eq. 41 holds nothing.

    Examples
    --------
    >>> sticks(2.4, 2.0, 3.0, 1.25), sticks(2.6, 2.0, 3.0, 1.25), sticks(-2.6, 2.0, 3.0, 1.25)
    (True, False, True)
    """
    r = breakaway_ratio
    return -breakaway_torque(coulomb_torque_backward, r) <= torque <= breakaway_torque(coulomb_torque_forward, r)


def undamped_creep_speed(
    driving_torque: Real,
    gear_reduction: Real,
    coulomb_torque_forward: Real,
    coulomb_torque_backward: Real,
    zero_crossing_slope: Real,
) -> Real:
    """Return the creep speed of the smooth friction law alone, without viscous or electrical damping.

    Parameters
    ----------
    driving_torque : float or array
        τ, what drives the unpowered output shaft towards +q; the load torque with the other sign [N m].
    gear_reduction : float or array
        N = 1/n, positive [1].
    coulomb_torque_forward : float or array
        F_ec1, at least 0 [N m].
    coulomb_torque_backward : float or array
        F_ec2, at least 0 [N m].
    zero_crossing_slope : float or array
        k, positive [s/rad].

    Returns
    -------
    float or array
        w = atanh(n τ/F)/k of the motor shaft; ±inf where the friction cannot balance the torque [rad/s].

    Notes
    -----
    Eq. 41 solved for the speed; F is the one of the direction of τ.

    Examples
    --------
    >>> round(float(undamped_creep_speed(0.5, 1.0, 1.0, 1.0, 100.0)), 6)
    0.005493
    """
    T = np.asarray(driving_torque / gear_reduction)
    F = np.where(T >= 0, coulomb_torque_forward, coulomb_torque_backward)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(T == 0, 0.0, np.minimum(np.abs(T) / F, 1.0))
        w: Real = (np.sign(T) * np.arctanh(ratio) / zero_crossing_slope)[()]
    return w


def creep_speed(
    driving_torque: Real,
    gear_reduction: Real,
    coulomb_torque_forward: Real,
    coulomb_torque_backward: Real,
    zero_crossing_slope: Real,
    motor_damping: Real = 0.0,
) -> Real:
    """Return the steady motor speed at which a loaded shaft creeps under the paper's friction.

    Parameters
    ----------
    driving_torque : float or array
        τ, what drives the unpowered output shaft towards +q; the load torque with the other sign [N m].
    gear_reduction : float or array
        N = 1/n, positive [1].
    coulomb_torque_forward : float or array
        F_ec1, at least 0 [N m].
    coulomb_torque_backward : float or array
        F_ec2, at least 0 [N m].
    zero_crossing_slope : float or array
        k, positive [s/rad].
    motor_damping : float or array
        c at the motor shaft, at least 0: B_m, and k_a k_b/R_a more where the bridge brakes [N m s/rad].

    Returns
    -------
    float or array
        w with n τ = f_ec(w) + c w; ±inf where c = 0 and the friction cannot balance the torque [rad/s].

    Notes
    -----
    Eq. 41 in the balance of a shaft that does not accelerate. It is not a property of a servo but of the smooth law,
    and goes to 0 as 1/k for a torque below the friction.

    Examples
    --------
    >>> w = creep_speed(0.5, 1.0, 1.0, 1.0, 100.0, 2.0)
    >>> round(float(smoothed_coulomb_torque(w, 1.0, 1.0, 100.0) + 2.0 * w), 9)
    0.5
    """
    free = undamped_creep_speed(
        driving_torque, gear_reduction, coulomb_torque_forward, coulomb_torque_backward, zero_crossing_slope
    )
    T, c, k, free = np.broadcast_arrays(driving_torque / gear_reduction, motor_damping, zero_crossing_slope, free)
    F = np.where(T >= 0, coulomb_torque_forward, coulomb_torque_backward)
    damped = c > 0
    w_abs = _balance(np.abs(T), F, k, np.where(damped, c, 1.0))
    w: Real = np.where(damped, np.sign(T) * w_abs, free)[()]
    return w


def _balance(
    T: NDArray[np.float64], F: NDArray[np.float64], k: NDArray[np.float64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the w ≥ 0 with F tanh(k w) + c w = T ≥ 0, for c > 0."""
    # The left side is concave, so Newton's method from a lower bound of the root rises to it without overshoot.
    w = np.maximum(T / (F * k + c), (T - F) / c)
    for _ in range(_MAX_STEPS):
        t = np.tanh(k * w)
        step = (T - F * t - c * w) / (F * k * (1 - t * t) + c)
        w = w + step
        if np.all(np.abs(step) <= 4e-16 * np.abs(w)):
            break
    return w
