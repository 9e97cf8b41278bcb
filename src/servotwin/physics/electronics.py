"""The control board: command to control voltage, comparator with deadband, bridge.

The bridge's two averaged laws are here: without bounds, as the paper prints it (eq. 38), and with the deadband and
the supply's limit (`docs/theory/bounded.md`).
"""

from __future__ import annotations

import numpy as np

from servotwin.physics._typing import Real


def feedback_error(command: Real, feedback_voltage: Real) -> Real:
    """Return what the comparator sees: command less feedback.

    Parameters
    ----------
    command : float or array
        Control voltage v_c [V].
    feedback_voltage : float or array
        v_o of the potentiometer [V].

    Returns
    -------
    float or array
        v_e = v_c − v_o, positive where the shaft has to go to +q [V].

    Notes
    -----
    The bracket of eq. 38.

    Examples
    --------
    >>> feedback_error(1.5, 1.25)
    0.25
    """
    v_c, v_o = command, feedback_voltage
    return v_c - v_o


def comparator_voltage(error: Real, voltage_deadband: Real) -> Real:
    """Return the part of the error that lies outside the deadband.

    Parameters
    ----------
    error : float or array
        v_e [V].
    voltage_deadband : float or array
        w_v, full width, centred on zero error, at least 0 [V].

    Returns
    -------
    float or array
        v_d = 0 inside the deadband, both edges included, v_e − sgn(v_e) w_v/2 outside; continuous [V].

    Notes
    -----
    Not in the paper, whose comparator has no deadband (w_v = 0).

    Examples
    --------
    >>> comparator_voltage(np.array([0.5, 2.0, -2.0]), 1.0)
    array([ 0. ,  1.5, -1.5])
    """
    v_e, w_v = error, voltage_deadband
    return np.sign(v_e) * np.maximum(np.abs(v_e) - w_v / 2, 0.0)


def unbounded_armature_voltage(
    control_voltage: Real, feedback_voltage: Real, bridge_gain: Real, comparator_gain: Real
) -> Real:
    """Return the armature voltage of the paper's control loop, which no supply limits.

    Parameters
    ----------
    control_voltage : float or array
        v_c, the command as the comparator gets it, offset included [V].
    feedback_voltage : float or array
        v_o of the potentiometer, offset included [V].
    bridge_gain : float or array
        A [V/V].
    comparator_gain : float or array
        k_s [V/V].

    Returns
    -------
    float or array
        v_a = A k_s (v_c − v_o) [V].

    Notes
    -----
    Eq. 38. The paper has no offsets: with v_c = k_p1 k_p2 v_i and v_o = p q it is eq. 38 as printed.

    Examples
    --------
    >>> unbounded_armature_voltage(1.5, 1.25, 10.0, 2.0)
    5.0
    """
    A, k_s = bridge_gain, comparator_gain
    return A * k_s * feedback_error(control_voltage, feedback_voltage)


def bounded_armature_voltage(
    error: Real, voltage_deadband: Real, bridge_gain: Real, comparator_gain: Real, voltage_limit: Real
) -> Real:
    """Return the mean armature voltage with a deadband and a supply that ends.

    Parameters
    ----------
    error : float or array
        v_e = v_c − v_o [V].
    voltage_deadband : float or array
        w_v, full width, at least 0 [V].
    bridge_gain : float or array
        A [V/V].
    comparator_gain : float or array
        k_s [V/V].
    voltage_limit : float or array
        V_max, the open-circuit voltage less the bridge's drop, at least 0 [V].

    Returns
    -------
    float or array
        v_a = A k_s v_d, cut at ±V_max [V].

    Notes
    -----
    Eq. 38 with the two properties that it lacks; w_v = 0 and V_max = ∞ give eq. 38 back.

    Examples
    --------
    >>> bounded_armature_voltage(np.array([0.05, 0.3, 5.0, -5.0]), 0.2, 10.0, 1.0, 6.0)
    array([ 0.,  2.,  6., -6.])
    """
    A, k_s, V_max = bridge_gain, comparator_gain, voltage_limit
    return np.maximum(-V_max, np.minimum(A * k_s * comparator_voltage(error, voltage_deadband), V_max))


def control_voltage_from_voltage(
    command_voltage: Real, voltage_to_pulse_gain: Real, pulse_to_voltage_gain: Real, command_offset: Real = 0.0
) -> Real:
    """Return the control voltage of a voltage command.

    Parameters
    ----------
    command_voltage : float or array
        v_i [V].
    voltage_to_pulse_gain : float or array
        k_p1 of the transmitter [s/V].
    pulse_to_voltage_gain : float or array
        k_p2 of the servo's board [V/s].
    command_offset : float or array
        b_i, the control voltage at v_i = 0 [V].

    Returns
    -------
    float or array
        v_c = k_p v_i + b_i with k_p = k_p1 k_p2 [V].

    Notes
    -----
    The command's side of eq. 38 with the offset that the paper's Table II asks for; as printed b_i = 0.

    Examples
    --------
    >>> control_voltage_from_voltage(2.0, 0.001, 750.0, 0.125)
    1.625
    """
    v_i, k_p1, k_p2, b_i = command_voltage, voltage_to_pulse_gain, pulse_to_voltage_gain, command_offset
    return k_p1 * k_p2 * v_i + b_i


def control_voltage_from_pulse(pulse_width: Real, one_shot_slope: Real, one_shot_offset: Real = 0.0) -> Real:
    """Return the feedback voltage at which the chip's own pulse is as long as this one.

    Parameters
    ----------
    pulse_width : float or array
        t_a of the command [s].
    one_shot_slope : float or array
        1/s_r, growth of the chip's own pulse with the feedback voltage, not 0 [s/V].
    one_shot_offset : float or array
        T_0, its length at 0 V; it may be negative [s].

    Returns
    -------
    float or array
        v_c = (t_a − T_0)/one_shot_slope [V].

    Notes
    -----
    The same as k_p2 t_a + b_t, with k_p2 = s_r and b_t = −s_r T_0.

    Examples
    --------
    >>> control_voltage_from_pulse(0.0015, 0.001, 0.0005)
    1.0
    """
    t_a, T_0 = pulse_width, one_shot_offset
    return (t_a - T_0) / one_shot_slope


def pulse_width_from_voltage(
    command_voltage: Real, voltage_to_pulse_gain: Real, command_pulse_offset: Real = 0.0
) -> Real:
    """Return the pulse width that the transmitter makes of a voltage command.

    Parameters
    ----------
    command_voltage : float or array
        v_i [V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    command_pulse_offset : float or array
        t_0, the pulse width at v_i = 0; it may be negative [s].

    Returns
    -------
    float or array
        t_a = k_p1 v_i + t_0 [s].

    Notes
    -----
    The first block of the paper's Fig. 7 and 8, with an offset; Table II gives t_0 = −21.5 µs.

    Examples
    --------
    >>> pulse_width_from_voltage(1.5, 0.001, -0.0005)
    0.001
    """
    v_i, k_p1, t_0 = command_voltage, voltage_to_pulse_gain, command_pulse_offset
    return k_p1 * v_i + t_0


def averaged_bridge_gain(
    supply_voltage: Real, bridge_drop_voltage: Real, stretcher_gain: Real, frame_period: Real, one_shot_slope: Real
) -> Real:
    """Return the product A k_s that the pulse-level board has in the mean over a frame.

    Parameters
    ----------
    supply_voltage : float or array
        V_oc, open circuit [V].
    bridge_drop_voltage : float or array
        V_ce0 of the conducting pair, at least 0 [V].
    stretcher_gain : float or array
        K, drive time per error time [1].
    frame_period : float or array
        T_f, positive [s].
    one_shot_slope : float or array
        1/s_r, growth of the chip's own pulse with the feedback voltage [s/V].

    Returns
    -------
    float or array
        A k_s = (V_oc − V_ce0) K/(T_f s_r) [V/V].

    Notes
    -----
    An error of v_e lasts v_e/s_r; stretched it lasts K v_e/s_r of every T_f, at V_oc − V_ce0. This holds for a bridge
    that brakes between pulses, a linear stretcher without a least drive time, and no coupling of the motor into the
    one-shot. The paper names A and k_s and gives no value of either.

    Examples
    --------
    >>> round(averaged_bridge_gain(6.0, 0.4, 60.0, 0.02, 0.00136), 6)
    22.848
    """
    V_oc, V_ce0, K, T_f = supply_voltage, bridge_drop_voltage, stretcher_gain, frame_period
    return (V_oc - V_ce0) * K * one_shot_slope / T_f
