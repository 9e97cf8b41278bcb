"""The potentiometer on the output shaft: angle to voltage and back."""

from __future__ import annotations

import numpy as np

from servotwin.physics._typing import Real


def feedback_voltage(output_angle: Real, feedback_gain: Real, feedback_offset: Real = 0.0) -> Real:
    """Return the voltage of an ideal potentiometer.

    Parameters
    ----------
    output_angle : float or array
        q, from the angle that the servo file calls zero [rad].
    feedback_gain : float or array
        p [V/rad].
    feedback_offset : float or array
        b_o, the voltage at q = 0 [V].

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


def angle_from_voltage(feedback_voltage: Real, feedback_gain: Real, feedback_offset: Real = 0.0) -> Real:
    """Return the angle at which an ideal potentiometer gives this voltage.

    Parameters
    ----------
    feedback_voltage : float or array
        v_o [V].
    feedback_gain : float or array
        p, not 0 [V/rad].
    feedback_offset : float or array
        b_o, the voltage at q = 0 [V].

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


def quantised(voltage: Real, quantisation: Real) -> Real:
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
    return quantisation * np.floor(voltage / quantisation + 0.5)
