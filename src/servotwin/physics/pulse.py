"""Consequences of a pulse: the chip's own pulse, the time that it drives, and what both amount to in the mean."""

from __future__ import annotations

from servotwin.physics.electronics import pulse_width_from_feedback
from servotwin.physics.elementary import expm1, log1p


def one_shot_width(feedback_voltage: float, one_shot_slope: float, one_shot_offset: float = 0.0) -> float:
    """Return the width of the chip's own pulse, with which it compares the command's.

    Parameters
    ----------
    feedback_voltage : float or array
        v_o at the one-shot, at the rising edge of the pulse [V].
    one_shot_slope : float or array
        1/s_r [s/V].
    one_shot_offset : float or array
        T_0, the width at 0 V; may be negative [s].

    Returns
    -------
    float or array
        T_os = max(0, T_0 + v/s_r) [s].

    Examples
    --------
    >>> round(float(one_shot_width(1.0, 1.36e-3, -0.16e-3)), 9)
    0.0012
    """
    return max(0.0, pulse_width_from_feedback(feedback_voltage, one_shot_slope, one_shot_offset))


def effective_voltage(feedback_voltage: float, noise: float, motor_voltage: float, sag: float,
                      back_emf_injection: float, supply_coupling: float) -> float:
    """Return what the one-shot sees of the potentiometer.

    Parameters
    ----------
    feedback_voltage : float or array
        v_o [V].
    noise : float or array
        Added at this frame [V].
    motor_voltage : float or array
        v_m at the motor's terminals, at the rising edge [V].
    sag : float or array
        V_bus − V_oc there [V].
    back_emf_injection, supply_coupling : float or array
        β and c_s [1].

    Returns
    -------
    float or array
        v_eff = v_o + noise + β v_m + c_s (V_bus − V_oc) [V].

    Examples
    --------
    >>> effective_voltage(1.0, 0.0, 2.0, -0.5, 0.125, 0.5)
    1.0
    """
    return feedback_voltage + noise + back_emf_injection * motor_voltage + supply_coupling * sag


def error_time(pulse_width: float, one_shot_width: float) -> float:
    """Return the difference that the chip decides on.

    Parameters
    ----------
    pulse_width : float or array
        t_a = t_in of the command [s].
    one_shot_width : float or array
        T_os [s].

    Returns
    -------
    float or array
        e = t_in − T_os, positive where the shaft has to go to +q [s].

    Examples
    --------
    >>> round(error_time(0.0015, 0.0012), 9)
    0.0003
    """
    return pulse_width - one_shot_width


def decision_delay(pulse_width: float, one_shot_width: float) -> float:
    """Return how long after its rising edge a pulse is decided on.

    Parameters
    ----------
    pulse_width : float or array
        t_a = t_in of the command [s].
    one_shot_width : float or array
        T_os [s].

    Returns
    -------
    float or array
        The longer of the two [s].

    Examples
    --------
    >>> decision_delay(0.0015, 0.0012)
    0.0015
    """
    return max(pulse_width, one_shot_width)


def drive_time(error_time: float, stretcher_gain: float, deadband: float = 0.0, minimum_drive_time: float = 0.0,
               stretcher_time_constant: float = 0.0) -> float:
    """Return for how long the bridge drives after a decision, if no other decision comes first.

    Parameters
    ----------
    error_time : float or array
        e = t_in − T_os [s].
    stretcher_gain : float or array
        K [1].
    deadband : float or array
        w, full width [s].
    minimum_drive_time : float or array
        t_min [s].
    stretcher_time_constant : float or array, optional
        τ_s of an RC stretcher; a linear one without it, or with 0 [s].

    Returns
    -------
    float or array
        With u = abs(e) − w/2: 0 for u ≤ 0, else t_min + K u, or t_min + τ_s ln(1 + K u/τ_s) [s].

    Examples
    --------
    >>> round(float(drive_time(54e-6, 60.0, 8e-6)), 9), float(drive_time(4e-6, 60.0, 8e-6))
    (0.003, 0.0)
    """
    K, t_min, tau_s = stretcher_gain, minimum_drive_time, stretcher_time_constant
    u = abs(error_time) - 0.5 * deadband
    if u <= 0.0:
        return 0.0
    if tau_s > 0.0:
        return t_min + tau_s * log1p(K * u / tau_s)
    return t_min + K * u


def full_drive_error(frame_period: float, stretcher_gain: float, deadband: float = 0.0, minimum_drive_time: float = 0.0,
                     stretcher_time_constant: float = 0.0) -> float:
    """Return the error from which on the bridge drives without a pause.

    Parameters
    ----------
    frame_period : float or array
        T_f [s].
    stretcher_gain, deadband, minimum_drive_time, stretcher_time_constant : float or array
        As in `drive_time`.

    Returns
    -------
    float or array
        w/2 + (T_f − t_min)/K, or with an RC stretcher w/2 + (τ_s/K)(e^((T_f − t_min)/τ_s) − 1) [s].

    Examples
    --------
    >>> round(float(full_drive_error(0.02, 100.0, 8e-6)), 9)
    0.000204
    """
    rest = frame_period - minimum_drive_time
    if stretcher_time_constant > 0.0:
        rest = stretcher_time_constant * expm1(rest / stretcher_time_constant)
    return 0.5 * deadband + rest / stretcher_gain


def pulse_stiffness(torque_per_volt: float, drive_voltage: float, stretcher_gain: float, pulse_per_angle: float,
                    frame_period: float) -> float:
    """Return the mean torque per angle of a pulse-level servo just outside its deadband.

    Parameters
    ----------
    torque_per_volt : float or array
        K_out/R = N k_a/R, at the output shaft [N m/V].
    drive_voltage : float or array
        V_oc − V_ce0 [V].
    stretcher_gain : float or array
        K [1].
    pulse_per_angle : float or array
        s_µ = p/s_r [s/rad].
    frame_period : float or array
        T_f [s].

    Returns
    -------
    float or array
        k_θ = (K_out/R)(V_oc − V_ce0) K s_µ/T_f [N m/rad].

    Notes
    -----
    Brake, linear stretcher, no minimum drive time; the delay of the frame apart. With J the inertia at the output,
    ω_n = √(k_θ/J) and ζ = (K_out²/R + b)/(2√(k_θ J)).

    Examples
    --------
    >>> round(float(pulse_stiffness(1.03 / 3.1, 5.6, 60.0, 573e-6, 0.02)), 3)
    3.198
    """
    return torque_per_volt * drive_voltage * stretcher_gain * pulse_per_angle / frame_period
