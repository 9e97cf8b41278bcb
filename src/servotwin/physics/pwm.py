"""A bridge that is switched many times in an electrical time constant: what its duty is worth in the mean.

Between source and motor it is an ideal transformer: a duty d makes d V_bus of the voltage and takes d i of the current.
"""

from __future__ import annotations


def averaged_drop(duty: float, bridge_drop_voltage: float, brush_drop_voltage: float) -> float:
    """Return what has to be overcome before a current flows behind a bridge in the mean.

    Parameters
    ----------
    duty : float or array
        abs(d) of the PWM [1].
    bridge_drop_voltage : float or array
        V_ce0 of a conducting pair [V].
    brush_drop_voltage : float or array
        V_br [V].

    Returns
    -------
    float or array
        abs(d) V_ce0 + V_br [V].

    Examples
    --------
    >>> averaged_drop(0.5, 0.5, 0.25)
    0.5
    """
    return duty * bridge_drop_voltage + brush_drop_voltage


def averaged_resistance(duty: float, armature_resistance: float, bridge_drop_resistance: float,
                        internal_resistance: float) -> float:
    """Return the resistance of the motor's circuit behind a bridge in the mean.

    Parameters
    ----------
    duty : float or array
        abs(d) of the PWM [1].
    armature_resistance, bridge_drop_resistance, internal_resistance : float or array
        R_a, r_c and R_b [Ω].

    Returns
    -------
    float or array
        R_a + abs(d) r_c + d² R_b [Ω].

    Notes
    -----
    A capacitor holds the bus over a PWM period, so that the source gives d i in the mean, and the motor feels
    d (V_oc − R_b d i).

    Examples
    --------
    >>> averaged_resistance(0.5, 3.0, 0.2, 0.4)
    3.2
    """
    d = duty
    return armature_resistance + d * bridge_drop_resistance + d * d * internal_resistance


def chopped_resistance(duty: float, armature_resistance: float, bridge_drop_resistance: float) -> float:
    """Return the resistance that the mean current meets where it flows during the on-time alone.

    Parameters
    ----------
    duty : float or array
        abs(d) of the PWM, not 0 [1].
    armature_resistance, bridge_drop_resistance : float or array
        R_a and r_c [Ω].

    Returns
    -------
    float or array
        (R_a + r_c)/abs(d), of the mean current abs(d) i_on [Ω].

    Examples
    --------
    >>> chopped_resistance(0.5, 3.0, 0.25)
    6.5
    """
    return (armature_resistance + bridge_drop_resistance) / duty
