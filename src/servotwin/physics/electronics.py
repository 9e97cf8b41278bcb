"""The control board: command to control voltage, comparator with deadband, bridge.

The bridge's two averaged laws are here: without bounds, as the paper prints it (eq. 38), and with the deadband and
the supply's limit (`docs/theory/bounded.md`).
"""

from __future__ import annotations

import math


def feedback_error(command: float, feedback_voltage: float) -> float:
    """Return what the comparator sees: command less feedback.

    Parameters
    ----------
    command : float or array
        Control voltage v_c [V].
    feedback_voltage : float or array
        v_o [V].

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


def comparator_voltage(error: float, voltage_deadband: float) -> float:
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
    >>> [comparator_voltage(v_e, 1.0) for v_e in (0.5, 2.0, -2.0)]
    [0.0, 1.5, -1.5]
    """
    v_e, w_v = error, voltage_deadband
    if abs(v_e) <= 0.5 * w_v:
        return 0.0
    return error_beyond_deadband(v_e, math.copysign(1.0, v_e), w_v)


def error_beyond_deadband(error: float, side: float, voltage_deadband: float) -> float:
    """Return the error less half of the deadband, on one side of it.

    Parameters
    ----------
    error : float or array
        v_e [V].
    side : float or array
        +1 or −1: the sign of an error outside the deadband [1].
    voltage_deadband : float or array
        w_v, full width, at least 0 [V].

    Returns
    -------
    float or array
        v_e − side w_v/2 [V].

    Examples
    --------
    >>> error_beyond_deadband(-2.0, -1.0, 1.0)
    -1.5
    """
    return error - side * (0.5 * voltage_deadband)


def proportional_voltage(error: float, bridge_gain: float, comparator_gain: float = 1.0) -> float:
    """Return the mean armature voltage that the bridge makes of an error, unbounded.

    Parameters
    ----------
    error : float or array
        v_d, what counts of the error [V].
    bridge_gain, comparator_gain : float or array
        A and k_s [V/V].

    Returns
    -------
    float or array
        A k_s v_d [V].

    Notes
    -----
    The gains of eq. 38.

    Examples
    --------
    >>> proportional_voltage(0.25, 10.0, 2.0)
    5.0
    """
    A, k_s = bridge_gain, comparator_gain
    return A * k_s * error


def unbounded_armature_voltage(
    control_voltage: float, feedback_voltage: float, bridge_gain: float, comparator_gain: float
) -> float:
    """Return the armature voltage of the paper's control loop, which no supply limits.

    Parameters
    ----------
    control_voltage : float or array
        v_c, the command as the comparator gets it, offset included [V].
    feedback_voltage : float or array
        v_o [V].
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
    return proportional_voltage(feedback_error(control_voltage, feedback_voltage), bridge_gain, comparator_gain)


def bounded_armature_voltage(
    error: float, voltage_deadband: float, bridge_gain: float, comparator_gain: float, voltage_limit: float
) -> float:
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
    >>> [bounded_armature_voltage(v_e, 0.2, 10.0, 1.0, 6.0) for v_e in (0.05, 0.3, 5.0, -5.0)]
    [0.0, 2.0, 6.0, -6.0]
    """
    v_d, V_max = comparator_voltage(error, voltage_deadband), voltage_limit
    return max(-V_max, min(proportional_voltage(v_d, bridge_gain, comparator_gain), V_max))


def control_voltage_from_voltage(
    command_voltage: float, voltage_to_pulse_gain: float, pulse_to_voltage_gain: float, command_offset: float = 0.0
) -> float:
    """Return the control voltage of a voltage command.

    Parameters
    ----------
    command_voltage : float or array
        v_i [V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    pulse_to_voltage_gain : float or array
        k_p2 [V/s].
    command_offset : float or array
        b_i [V].

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


def control_voltage_from_pulse(pulse_width: float, one_shot_slope: float, one_shot_offset: float = 0.0) -> float:
    """Return the feedback voltage at which the chip's own pulse is as long as this one.

    Parameters
    ----------
    pulse_width : float or array
        t_a of the command [s].
    one_shot_slope : float or array
        1/s_r, not 0 [s/V].
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


def pulse_width_from_feedback(feedback_voltage: float, one_shot_slope: float, one_shot_offset: float = 0.0) -> float:
    """Return the pulse that is as long as the chip's own at a feedback voltage.

    Parameters
    ----------
    feedback_voltage : float or array
        v_o [V].
    one_shot_slope : float or array
        1/s_r [s/V].
    one_shot_offset : float or array
        T_0; it may be negative [s].

    Returns
    -------
    float or array
        T_0 + v_o/s_r, without the bound of `servotwin.physics.pulse.one_shot_width` [s].

    Notes
    -----
    Inverse of `control_voltage_from_pulse`.

    Examples
    --------
    >>> round(pulse_width_from_feedback(1.0, 0.001, 0.0005), 9)
    0.0015
    """
    return one_shot_offset + one_shot_slope * feedback_voltage


def control_voltage_from_paper_pulse(pulse_width: float, pulse_to_voltage_gain: float,
                                     command_pulse_offset: float = 0.0, command_offset: float = 0.0) -> float:
    """Return the control voltage that the paper's board makes of a pulse.

    Parameters
    ----------
    pulse_width : float or array
        t_a [s].
    pulse_to_voltage_gain : float or array
        k_p2 [V/s].
    command_pulse_offset : float or array
        t_0 [s].
    command_offset : float or array
        b_i [V].

    Returns
    -------
    float or array
        v_c = k_p2 (t_a − t_0) + b_i [V].

    Examples
    --------
    >>> control_voltage_from_paper_pulse(0.0015, 1000.0, 0.0005, 0.25)
    1.25
    """
    return pulse_to_voltage_gain * (pulse_width - command_pulse_offset) + command_offset


def pulse_width_from_voltage(
    command_voltage: float, voltage_to_pulse_gain: float, command_pulse_offset: float = 0.0
) -> float:
    """Return the pulse width that the transmitter makes of a voltage command.

    Parameters
    ----------
    command_voltage : float or array
        v_i [V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    command_pulse_offset : float or array
        t_0; it may be negative [s].

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
    supply_voltage: float, bridge_drop_voltage: float, stretcher_gain: float, frame_period: float, one_shot_slope: float
) -> float:
    """Return the product A k_s that the pulse-level board has in the mean over a frame.

    Parameters
    ----------
    supply_voltage : float or array
        V [V].
    bridge_drop_voltage : float or array
        V_ce0 of the conducting pair, at least 0 [V].
    stretcher_gain : float or array
        K [1].
    frame_period : float or array
        T_f, positive [s].
    one_shot_slope : float or array
        1/s_r [s/V].

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
