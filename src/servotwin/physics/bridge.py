"""The switched bridge between supply and motor: what current flows while it drives, brakes or coasts."""

from __future__ import annotations

import math

from servotwin.physics.motor import circuit_current


def driving_voltage(source_voltage: float, direction: float, voltage_drop: float) -> float:
    """Return what drives a current of known direction through the motor's circuit.

    Parameters
    ----------
    source_voltage : float or array
        s V_bus [V].
    direction : float or array
        sgn(i): +1 or −1, or 0 where nothing drops [1].
    voltage_drop : float or array
        D of transistors, diodes and brushes, as in `bridge_current` [V].

    Returns
    -------
    float or array
        s V_bus − sgn(i) D, back-EMF and resistance apart [V].

    Examples
    --------
    >>> driving_voltage(6.0, 1.0, 0.5), driving_voltage(6.0, -1.0, 0.5)
    (5.5, 6.5)
    """
    return source_voltage - direction * voltage_drop


def needed_voltage(armature_current: float, back_emf: float, voltage_drop: float, resistance: float) -> float:
    """Return the voltage that a circuit needs for a current.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    voltage_drop : float or array
        sgn(i_a) D of transistors, diodes and brushes [V].
    resistance : float or array
        R of the circuit [Ω].

    Returns
    -------
    float or array
        R i_a + sgn(i_a) D + v_b [V].

    Examples
    --------
    >>> needed_voltage(2.0, 1.0, 0.5, 3.0)
    7.5
    """
    return resistance * armature_current + voltage_drop + back_emf


def bridge_current(source_voltage: float, back_emf: float, voltage_drop: float, resistance: float) -> float:
    """Return the armature current of a motor behind a bridge, inductance neglected.

    Parameters
    ----------
    source_voltage : float or array
        s V_oc [V].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    voltage_drop : float or array
        D, overcome before a current flows: V_ce0 + V_br while driving, V_br while braking, V_oc + V_ce0 + V_br
        through the diodes while coasting [V].
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
    >>> round(bridge_current(6.0, 1.0, 0.4, 2.0), 9), bridge_current(0.0, 0.2, 0.4, 2.0)
    (2.3, 0.0)
    """
    x, D = source_voltage - back_emf, voltage_drop
    if abs(x) <= D:
        return 0.0
    return circuit_current(driving_voltage(source_voltage, math.copysign(1.0, x), D), back_emf, resistance)


def bridge_voltage(armature_current: float, bus_voltage: float, drive: float, bridge_drop_voltage: float,
                   bridge_drop_resistance: float) -> float:
    """Return the voltage that a conducting bridge puts on the motor.

    Parameters
    ----------
    armature_current : float or array
        i_a, not 0 [A].
    bus_voltage : float or array
        V_bus [V].
    drive : float or array
        s, +1 or −1; of the diodes of a coasting bridge −sgn(i_a) [1].
    bridge_drop_voltage : float or array
        V_ce0 of the conducting pair [V].
    bridge_drop_resistance : float or array
        r_c of the transistors; diodes have none [Ω].

    Returns
    -------
    float or array
        v_a = s V_bus − V_ce0 sgn(i_a) − r_c i_a [V].

    Examples
    --------
    >>> bridge_voltage(2.0, 6.0, 1.0, 0.5, 0.25), bridge_voltage(2.0, 6.0, -1.0, 0.5, 0.0)
    (5.0, -6.5)
    """
    i = armature_current
    return drive * bus_voltage - math.copysign(bridge_drop_voltage, i) - bridge_drop_resistance * i


def motor_voltage(armature_current: float, back_emf: float, armature_resistance: float, brush_drop_voltage: float,
                  open_circuit_voltage: float) -> float:
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
        Voltage that stands there without current: v_b of an open bridge, 0 of a braked one [V].

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
    if i == 0.0:
        return open_circuit_voltage
    return v_b + R_a * i + math.copysign(V_br, i)


def bridge_loss(armature_current: float, bridge_drop_voltage: float, bridge_drop_resistance: float) -> float:
    """Return the heat in the conducting pair of a bridge.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    bridge_drop_voltage : float or array
        V_ce0 [V].
    bridge_drop_resistance : float or array
        r_c of transistors; diodes have none [Ω].

    Returns
    -------
    float or array
        (V_ce0 + r_c abs(i_a)) abs(i_a) [W].

    Examples
    --------
    >>> bridge_loss(-2.0, 0.5, 0.25)
    2.0
    """
    size = abs(armature_current)
    return (bridge_drop_voltage + bridge_drop_resistance * size) * size


def brush_loss(armature_current: float, brush_drop_voltage: float) -> float:
    """Return the heat at the brushes.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    brush_drop_voltage : float or array
        V_br [V].

    Returns
    -------
    float or array
        V_br abs(i_a) [W].

    Examples
    --------
    >>> brush_loss(-2.0, 0.25)
    0.5
    """
    return brush_drop_voltage * abs(armature_current)
