"""The potentiometer on the output shaft: angle to voltage and back, ideal or with the errors of a real one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from servotwin.physics._typing import Real
from servotwin.physics.laws import array_form

HALVINGS = 100  # from any table of volts to the last bit of an angle


def feedback_voltage(output_angle: float, feedback_gain: float, feedback_offset: float = 0.0) -> float:
    """Return the voltage of an ideal potentiometer.

    Parameters
    ----------
    output_angle : float or array
        q [rad].
    feedback_gain : float or array
        p [V/rad].
    feedback_offset : float or array
        b_o [V].

    Returns
    -------
    float or array
        v_o = p q + b_o [V].

    Notes
    -----
    The term p q of eq. 38 with the offset that the paper's own Table II asks for; eq. 38 as printed is b_o = 0.

    Examples
    --------
    >>> feedback_voltage(2.0, 0.5, 0.25)
    1.25
    """
    q, p, b_o = output_angle, feedback_gain, feedback_offset
    return p * q + b_o


def angle_from_voltage(feedback_voltage: float, feedback_gain: float, feedback_offset: float = 0.0) -> float:
    """Return the angle at which an ideal potentiometer gives this voltage.

    Parameters
    ----------
    feedback_voltage : float or array
        v_o [V].
    feedback_gain : float or array
        p, not 0 [V/rad].
    feedback_offset : float or array
        b_o [V].

    Returns
    -------
    float or array
        q = (v_o − b_o)/p [rad].

    Notes
    -----
    Inverse of `servotwin.physics.potentiometer.feedback_voltage`.

    Examples
    --------
    >>> angle_from_voltage(1.25, 0.5, 0.25)
    2.0
    """
    v_o, p, b_o = feedback_voltage, feedback_gain, feedback_offset
    return (v_o - b_o) / p


def quantised(voltage: float, quantisation: float) -> float:
    """Return the nearest voltage that a converter can tell from its neighbours.

    Parameters
    ----------
    voltage : float or array
        The voltage at the converter [V].
    quantisation : float or array
        Volt per count, positive [V].

    Returns
    -------
    float or array
        The nearest whole number of counts, as a voltage; half a count goes up [V].

    Notes
    -----
    A 10-bit converter over 2.5 V has 2.44 mV per count. The range of the converter is not limited here.

    Examples
    --------
    >>> float(quantised(1.30, 0.25))
    1.25
    """
    return quantisation * math.floor(voltage / quantisation + 0.5)


def error_between(output_angle: float, angle: float, error: float, next_angle: float, next_error: float) -> float:
    """Return the linearity error between two angles of a table.

    Parameters
    ----------
    output_angle : float or array
        q, between the two [rad].
    angle, next_angle : float or array
        Neighbours in the table, the second one larger [rad].
    error, next_error : float or array
        Voltage added at these angles [V].

    Returns
    -------
    float or array
        ε(q) [V].

    Examples
    --------
    >>> error_between(0.5, 0.0, 0.0, 1.0, 0.02)
    0.01
    """
    return error + (next_error - error) * ((output_angle - angle) / (next_angle - angle))


def linearity_error(output_angle: Real, angles: ArrayLike, errors: ArrayLike) -> Real:
    """Return what a potentiometer is off a straight line.

    Parameters
    ----------
    output_angle : float or array
        q, or the angle of the wiper where it has play [rad].
    angles : array_like, shape (n,)
        Increasing angles of the table [rad].
    errors : array_like, shape (n,)
        Voltage added at these angles [V].

    Returns
    -------
    float or array
        ε(q), linear between two angles of the table and constant beyond its ends [V].

    Examples
    --------
    >>> [float(linearity_error(q, [0.0, 1.0], [0.0, 0.02])) for q in (-1.0, 0.5, 2.0)]
    [0.0, 0.01, 0.02]
    """
    q, a, e = (np.asarray(x, dtype=np.float64) for x in (output_angle, angles, errors))
    epsilon = np.where(np.isnan(q), q, e[0])
    for k in range(1, len(a)):
        between = array_form(error_between)(q, a[k - 1], e[k - 1], a[k], e[k])
        epsilon = np.where(q >= a[k - 1], np.where(q < a[k], between, e[k]), epsilon)
    return epsilon[()]


def sensed_voltage(wiper_angle: Real, feedback_gain: Real, feedback_offset: Real = 0.0, angles: ArrayLike = (0.0,),
                   errors: ArrayLike = (0.0,), quantisation: Real | None = None) -> Real:
    """Return the voltage of a real potentiometer.

    Parameters
    ----------
    wiper_angle : float or array
        q_w, which follows the output with the play of `servotwin.physics.backlash.play` [rad].
    feedback_gain : float or array
        p [V/rad].
    feedback_offset : float or array
        b_o [V].
    angles, errors : array_like, shape (n,)
        Table of `linearity_error`; a straight line without it [rad, V].
    quantisation : float or array, optional
        Volt per count of a converter behind it [V].

    Returns
    -------
    float or array
        v_o = Quant(p q_w + b_o + ε(q_w)) [V].

    Examples
    --------
    >>> round(float(sensed_voltage(1.0, 0.42, 0.588, [0.0, 2.0], [0.0, 0.02], 0.0025)), 9)
    1.0175
    """
    v_o: Real = array_form(feedback_voltage)(wiper_angle, feedback_gain, feedback_offset)
    v_o = v_o + linearity_error(wiper_angle, angles, errors)
    return v_o if quantisation is None else array_form(quantised)(v_o, quantisation)


def angle_from_sensed_voltage(sensed_voltage: Real, feedback_gain: Real, feedback_offset: Real = 0.0,
                              angles: ArrayLike = (0.0,), errors: ArrayLike = (0.0,)) -> Real:
    """Return the angle at which a real potentiometer gives this voltage, quantisation apart.

    Parameters
    ----------
    sensed_voltage : float or array
        v_o [V].
    feedback_gain : float or array
        p, positive [V/rad].
    feedback_offset : float or array
        b_o [V].
    angles, errors : array_like, shape (n,)
        Table of `linearity_error`; a straight line without it [rad, V].

    Returns
    -------
    float or array
        q with p q + b_o + ε(q) = v_o, by bisection to the last bit. Where the errors fall faster than p rises there may
        be several such angles; it is then one at which the voltage rises [rad].

    Examples
    --------
    >>> round(float(angle_from_sensed_voltage(1.018, 0.42, 0.588, [0.0, 2.0], [0.0, 0.02])), 9)
    1.0
    """
    ideal: Real = array_form(angle_from_voltage)(sensed_voltage, feedback_gain, feedback_offset)
    low, high = (np.asarray(ideal - bound / feedback_gain) for bound in (np.max(errors), np.min(errors)))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        reached = middle + linearity_error(middle, angles, errors) / feedback_gain <= ideal
        low, high = np.where(reached, middle, low), np.where(reached, high, middle)
    q: Real = (0.5 * (low + high))[()]
    return q
