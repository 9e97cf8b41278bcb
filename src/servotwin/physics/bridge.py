"""The switched bridge between supply and motor: what current flows while it drives, brakes or coasts."""

from __future__ import annotations

import numpy as np

from servotwin.physics._typing import Real


def bridge_current(source_voltage: Real, back_emf: Real, voltage_drop: Real, resistance: Real) -> Real:
    """Return the armature current of a motor behind a bridge, inductance neglected.

    Parameters
    ----------
    source_voltage : float or array
        s V_oc while the bridge drives with the sign s; 0 while it brakes or coasts [V].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    voltage_drop : float or array
        What has to be overcome before a current flows: V_ce0 + V_br while driving, V_br while braking,
        V_oc + V_ce0 + V_br through the diodes while coasting [V].
    resistance : float or array
        Of the whole circuit: R_a + r_c + R_b while driving, R_a while braking, R_a + R_b while coasting [Ω].

    Returns
    -------
    float or array
        i_a = (x − sgn(x) D)/R with x = s V_oc − v_b; 0 from x = −D to D [A].

    Notes
    -----
    The drops of transistors, diodes and brushes oppose the current whichever way it flows, and hold it at zero where
    nothing overcomes them. The source resistance stands in the same circuit, as the current is the supply's.

    Examples
    --------
    >>> float(bridge_current(6.0, 1.0, 0.4, 2.0)), float(bridge_current(0.0, 0.2, 0.4, 2.0))
    (2.3, -0.0)
    """
    x, D = source_voltage - back_emf, voltage_drop
    return np.copysign(np.maximum(np.abs(x) - D, 0.0), x) / resistance


def motor_voltage(armature_current: Real, back_emf: Real, armature_resistance: Real, brush_drop_voltage: Real,
                  open_circuit_voltage: Real) -> Real:
    """Return the voltage at the motor's terminals for a current behind a bridge.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    armature_resistance : float or array
        R_a [Ω].
    brush_drop_voltage : float or array
        V_br [V].
    open_circuit_voltage : float or array
        What stands there without current: v_b of an open bridge, 0 of a braked one [V].

    Returns
    -------
    float or array
        v_a = v_b + R_a i_a + V_br sgn(i_a) [V].

    Examples
    --------
    >>> float(motor_voltage(1.0, 1.0, 2.0, 0.3, 1.0))
    3.3
    """
    i, v_b, R_a, V_br = armature_current, back_emf, armature_resistance, brush_drop_voltage
    v_a: Real = np.where(i == 0.0, open_circuit_voltage, v_b + R_a * i + np.copysign(V_br, i))[()]
    return v_a
