"""What follows from a pulse: the chip's own pulse, the time that it drives, and what both amount to in the mean."""

from __future__ import annotations

import numpy as np

from servotwin.physics._typing import Real


def one_shot_width(feedback_voltage: Real, one_shot_slope: Real, one_shot_offset: Real = 0.0) -> Real:
    """Return the width of the chip's own pulse, with which it compares the command's.

    Parameters
    ----------
    feedback_voltage : float or array
        What the one-shot sees of the potentiometer, at the rising edge of the pulse [V].
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
    return np.maximum(0.0, one_shot_offset + one_shot_slope * feedback_voltage)


def drive_time(error_time: Real, stretcher_gain: Real, deadband: Real = 0.0, minimum_drive_time: Real = 0.0,
               stretcher_time_constant: Real | None = None) -> Real:
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
        τ_s of an RC stretcher; a linear one without it [s].

    Returns
    -------
    float or array
        With u = abs(e) − w/2: 0 for u ≤ 0, else t_min + K u, or t_min + τ_s ln(1 + K u/τ_s) [s].

    Examples
    --------
    >>> round(float(drive_time(54e-6, 60.0, 8e-6)), 9), float(drive_time(4e-6, 60.0, 8e-6))
    (0.003, 0.0)
    """
    u = np.maximum(np.abs(error_time) - 0.5 * deadband, 0.0)
    stretched = stretcher_gain * u
    if stretcher_time_constant is not None:
        stretched = stretcher_time_constant * np.log1p(stretched / stretcher_time_constant)
    t_on: Real = np.where(u > 0.0, minimum_drive_time + stretched, 0.0)[()]
    return t_on


def full_drive_error(frame_period: Real, stretcher_gain: Real, deadband: Real = 0.0, minimum_drive_time: Real = 0.0,
                     stretcher_time_constant: Real | None = None) -> Real:
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
    if stretcher_time_constant is not None:
        rest = stretcher_time_constant * np.expm1(rest / stretcher_time_constant)
    return 0.5 * deadband + rest / stretcher_gain


def pulse_stiffness(torque_per_volt: Real, drive_voltage: Real, stretcher_gain: Real, pulse_per_angle: Real,
                    frame_period: Real) -> Real:
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
