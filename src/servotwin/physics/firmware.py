"""The program of a digital servo at a tick: counts, dead zone, terms of its law, limits.

Gains are in duty per unit of the output shaft; a duty of 1 is a bridge that is always on.
"""

from __future__ import annotations

import math

NEARLY = 1e-9  # of a step: what is so near to a whole number is that number
IN_FLOATS = {"NEARLY": 2e-4}


def counted(angle: float, angle_quantum: float) -> float:
    """Return the angle that a converter or an encoder shows.

    Parameters
    ----------
    angle : float or array
        q_s [rad].
    angle_quantum : float or array
        Δ, one count; 0: as it is [rad].

    Returns
    -------
    float or array
        Δ floor(q_s/Δ + ½) [rad].

    Examples
    --------
    >>> counted(0.9, 0.5), counted(0.9, 0.0)
    (1.0, 0.9)
    """
    if angle_quantum == 0.0:
        return angle
    return angle_quantum * math.floor(angle / angle_quantum + 0.5)


def cut(value: float, step: float) -> float:
    """Return a value cut towards 0 to a multiple of a step, as a division of whole numbers is.

    Parameters
    ----------
    value : float or array
    step : float or array
        0: as it is.

    Returns
    -------
    float or array
        The multiple; of what is within 1e-9 of one, that.

    Examples
    --------
    >>> cut(-1.9, 0.5), cut(1.4999999999999, 0.5), cut(0.7, 0.0)
    (-1.5, 1.5, 0.7)
    """
    if step == 0.0:
        return value
    return math.copysign(step, value) * math.floor(abs(value) / step + NEARLY)


def filtered_angle(before: float, angle: float, filter_weight: float) -> float:
    """Return the angle after a filter of first order.

    Parameters
    ----------
    before : float or array
        y of the tick before [rad].
    angle : float or array
        Δ c of this one [rad].
    filter_weight : float or array
        a [1].

    Returns
    -------
    float or array
        (1 − a) y + a Δ c [rad].

    Examples
    --------
    >>> filtered_angle(1.0, 2.0, 0.75)
    1.75
    """
    return (1.0 - filter_weight) * before + filter_weight * angle


def error_beyond_zone(error: float, deadband_angle: float, gate: bool = False) -> float:
    """Return what a dead zone leaves of an error.

    Parameters
    ----------
    error : float or array
        e [rad].
    deadband_angle : float or array
        h, half width [rad].
    gate : bool or array
        Whether all of the error counts outside.

    Returns
    -------
    float or array
        sgn(e) max(0, abs(e) − h), or e outside the zone and 0 within [rad].

    Examples
    --------
    >>> error_beyond_zone(-0.75, 0.5, False), error_beyond_zone(-0.75, 0.5, True)
    (-0.25, -0.75)
    """
    beyond = abs(error) - deadband_angle
    if beyond <= NEARLY * deadband_angle:
        return 0.0
    return error if gate else math.copysign(beyond, error)


def duty_of(gain: float, value: float, duty_quantum: float = 0.0) -> float:
    """Return a term of the control law: a gain times what it is of.

    Parameters
    ----------
    gain : float or array
        Duty per unit of the value.
    value : float or array
        An error [rad], a speed [rad/s] or an acceleration [rad/s²].
    duty_quantum : float or array
        δ, to which it is cut; 0: not [1].

    Returns
    -------
    float or array
        [1]

    Examples
    --------
    >>> duty_of(4.0, 0.03125), duty_of(4.0, 0.03125, 0.1)
    (0.125, 0.1)
    """
    return cut(gain * value, duty_quantum)


def integrated_error(before: float, error: float, excess: float, integral_gain: float, anti_windup: float,
                     control_period: float) -> float:
    """Return the integral of the error after a tick.

    Parameters
    ----------
    before : float or array
        J of the tick before [1].
    error : float or array
        z beyond the dead zone [rad].
    excess : float or array
        (u − w) + (J − I) of the tick before: what limits have taken [1].
    integral_gain : float or array
        k_i [1/(rad s)].
    anti_windup : float or array
        κ [rad].
    control_period : float or array
        T_c [s].

    Returns
    -------
    float or array
        J + k_i T_c (z − κ excess) [1].

    Examples
    --------
    >>> integrated_error(0.5, 0.25, 0.5, 2.0, 0.5, 0.5)
    0.5
    """
    return before + integral_gain * control_period * (error - anti_windup * excess)


def started_duty(duty: float, minimum_duty: float) -> float:
    """Return a duty with what is added so that the motor starts.

    Parameters
    ----------
    duty : float or array
        u of the control law [1].
    minimum_duty : float or array
        [1]

    Returns
    -------
    float or array
        u + sgn(u) times the minimum; 0 where u is, but for what rounding leaves of terms that cancel [1].

    Examples
    --------
    >>> started_duty(-0.25, 0.25), started_duty(0.0, 0.25), started_duty(0.1 + 0.2 - 0.3, 0.25)
    (-0.5, 0.0, 0.0)
    """
    if abs(duty) <= NEARLY * minimum_duty:
        return 0.0
    return duty + math.copysign(minimum_duty, duty)


def duty_for_motor_current(armature_current: float, back_emf: float, resistance: float, bus_voltage: float) -> float:
    """Return the duty at which the motor has a current.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    back_emf : float or array
        v_b = K_out q̇ [V].
    resistance : float or array
        R_a + r_c [Ω].
    bus_voltage : float or array
        V_bus [V].

    Returns
    -------
    float or array
        (v_b + R i)/V_bus: drops left out, as an ideal limit does [1].

    Examples
    --------
    >>> duty_for_motor_current(1.0, 1.0, 2.0, 6.0)
    0.5
    """
    return (back_emf + resistance * armature_current) / bus_voltage


def duty_for_bus_current(supply_current: float, back_emf: float, resistance: float, bus_voltage: float,
                         direction: float) -> float:
    """Return the duty at which the supply gives a current.

    Parameters
    ----------
    supply_current : float or array
        d i, not negative [A].
    back_emf, resistance, bus_voltage : float or array
        As in `duty_for_motor_current`.
    direction : float or array
        +1 or −1, of the two that there are [1].

    Returns
    -------
    float or array
        [v_b ± √(v_b² + 4 V_bus R i)]/(2 V_bus), from d (d V_bus − v_b)/R = i [1].

    Examples
    --------
    >>> duty_for_bus_current(0.5, 1.0, 2.0, 6.0, 1.0)
    0.5
    """
    root = math.sqrt(back_emf * back_emf + 4.0 * bus_voltage * resistance * supply_current)
    return (back_emf + direction * root) / (2.0 * bus_voltage)


def braking_distance(speed: float, acceleration: float, control_period: float) -> float:
    """Return how far a profile goes while it brakes, tick by tick.

    Parameters
    ----------
    speed : float or array
        abs(ṙ) [rad/s].
    acceleration : float or array
        a, positive; inf: it stops at once [rad/s²].
    control_period : float or array
        T_c [s].

    Returns
    -------
    float or array
        S = k (2 abs(ṙ) − (k + 1) a T_c) T_c/2 with k = floor(abs(ṙ)/(a T_c)) [rad].

    Examples
    --------
    >>> braking_distance(3.0, 1.0, 1.0), braking_distance(3.0, float("inf"), 1.0)
    (3.0, 0.0)
    """
    if acceleration == math.inf:
        return 0.0
    change = acceleration * control_period
    k = math.floor(speed / change + NEARLY)
    return 0.5 * k * (2.0 * speed - (k + 1.0) * change) * control_period


def resolved_pulse(pulse_width: float, pulse_resolution: float) -> float:
    """Return the width of a pulse as a program counts it.

    Parameters
    ----------
    pulse_width : float or array
        t_a [s].
    pulse_resolution : float or array
        q_t; 0: as it is [s].

    Returns
    -------
    float or array
        floor(t_a/q_t) q_t [s].

    Examples
    --------
    >>> resolved_pulse(1.75, 0.5), resolved_pulse(1.75, 0.0)
    (1.5, 1.75)
    """
    return cut(pulse_width, pulse_resolution)
