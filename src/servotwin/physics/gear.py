"""The gear train: motions, inertias and viscous frictions seen from either shaft.

`gear_reduction` N is motor turns per output turn, above 1 in a servo. The paper's ratio n = n_1/n_2 (eq. 18) is its
inverse, n = 1/N. The train is rigid and has no losses here; friction is in `servotwin.physics.friction`.
"""

from __future__ import annotations


def motor_from_output(output_motion: float, gear_reduction: float) -> float:
    """Return the angle, speed or acceleration of the motor shaft that goes with one of the output shaft.

    Parameters
    ----------
    output_motion : float or array
        q, q̇ or q̈ of the output shaft [rad, rad/s or rad/s²].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        The same motion of the motor shaft, q_m = q/n = N q [as given].

    Notes
    -----
    Eq. 33, and its derivatives.

    Examples
    --------
    >>> motor_from_output(0.5, 250.0)
    125.0
    """
    q, N = output_motion, gear_reduction
    return N * q


def output_torque(motor_torque: float, gear_reduction: float) -> float:
    """Return the torque at the output shaft that goes with one at the motor shaft.

    Parameters
    ----------
    motor_torque : float or array
        At the motor shaft [N m].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        The same torque at the output shaft, N times as large [N m].

    Notes
    -----
    Eq. 23 without inertia and friction.

    Examples
    --------
    >>> output_torque(0.01, 250.0)
    2.5
    """
    return gear_reduction * motor_torque


def reflected_inertia(rotor_inertia: float, load_inertia: float, gear_reduction: float) -> float:
    """Return the total inertia as the motor shaft feels it.

    Parameters
    ----------
    rotor_inertia : float or array
        J_m [kg m²].
    load_inertia : float or array
        J_L [kg m²].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        J_o = J_m + n² J_L [kg m²].

    Notes
    -----
    Eq. 19.

    Examples
    --------
    >>> reflected_inertia(1.0, 8.0, 2.0)
    3.0
    """
    J_m, J_L, N = rotor_inertia, load_inertia, gear_reduction
    return J_m + J_L / N**2


def reflected_viscous_friction(
    motor_viscous_friction: float, load_viscous_friction: float, gear_reduction: float
) -> float:
    """Return the total viscous friction as the motor shaft feels it.

    Parameters
    ----------
    motor_viscous_friction : float or array
        B_m [N m s/rad].
    load_viscous_friction : float or array
        B_L [N m s/rad].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        B_o = B_m + n² B_L [N m s/rad].

    Notes
    -----
    Eq. 20.

    Examples
    --------
    >>> reflected_viscous_friction(1.0, 8.0, 2.0)
    3.0
    """
    B_m, B_L, N = motor_viscous_friction, load_viscous_friction, gear_reduction
    return B_m + B_L / N**2


def output_inertia(rotor_inertia: float, load_inertia: float, gear_reduction: float) -> float:
    """Return the total inertia as the output shaft feels it.

    Parameters
    ----------
    rotor_inertia : float or array
        J_m [kg m²].
    load_inertia : float or array
        J_L [kg m²].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        N² J_m + J_L = N² J_o [kg m²].

    Notes
    -----
    Eq. 19 times N². In an unloaded servo the rotor's share is nearly all of it.

    Examples
    --------
    >>> output_inertia(1.0, 8.0, 2.0)
    12.0
    """
    J_m, J_L, N = rotor_inertia, load_inertia, gear_reduction
    return N**2 * J_m + J_L


def output_viscous_friction(
    motor_viscous_friction: float, load_viscous_friction: float, gear_reduction: float
) -> float:
    """Return the total viscous friction as the output shaft feels it.

    Parameters
    ----------
    motor_viscous_friction : float or array
        B_m [N m s/rad].
    load_viscous_friction : float or array
        B_L [N m s/rad].
    gear_reduction : float or array
        N = 1/n, positive [1].

    Returns
    -------
    float or array
        N² B_m + B_L = N² B_o [N m s/rad].

    Notes
    -----
    Eq. 20 times N².

    Examples
    --------
    >>> output_viscous_friction(1.0, 8.0, 2.0)
    12.0
    """
    B_m, B_L, N = motor_viscous_friction, load_viscous_friction, gear_reduction
    return N**2 * B_m + B_L
