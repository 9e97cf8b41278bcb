"""The permanent-magnet DC motor: torque, back-EMF and armature circuit.

Equation numbers are those of Urrea and Kern, "A New Model for Analog Servo Motors", Canadian Journal on Automation,
Control and Intelligent Systems 2(2), 2011.
"""

from __future__ import annotations


def electromagnetic_torque(armature_current: float, torque_constant: float) -> float:
    """Return the torque that the current makes in the armature.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    torque_constant : float or array
        k_a, positive [N m/A].

    Returns
    -------
    float or array
        k_a i_a, in +q for a positive current [N m].

    Notes
    -----
    Eq. 4, which calls it τ_m, and eq. 26, which calls it τ_o. It is the signal `motor_torque`.

    Examples
    --------
    >>> electromagnetic_torque(2.0, 0.005)
    0.01
    """
    i_a, k_a = armature_current, torque_constant
    return k_a * i_a


def back_emf(motor_speed: float, back_emf_constant: float) -> float:
    """Return the voltage that the turning armature induces in itself.

    Parameters
    ----------
    motor_speed : float or array
        w [rad/s].
    back_emf_constant : float or array
        k_b, positive [V s/rad].

    Returns
    -------
    float or array
        v_b = k_b q̇_m [V].

    Notes
    -----
    Eq. 24. Eq. 6 should say the same; it is printed as a copy of eq. 5, with k ψ in the place of k_b.

    Examples
    --------
    >>> back_emf(400.0, 0.005)
    2.0
    """
    qd_m, k_b = motor_speed, back_emf_constant
    return k_b * qd_m


def armature_current_rate(
    armature_voltage: float,
    armature_current: float,
    motor_speed: float,
    armature_resistance: float,
    armature_inductance: float,
    back_emf_constant: float,
) -> float:
    """Return the rate of change of the armature current.

    Parameters
    ----------
    armature_voltage : float or array
        v_a [V].
    armature_current : float or array
        i_a [A].
    motor_speed : float or array
        w [rad/s].
    armature_resistance : float or array
        R_a, positive [Ω].
    armature_inductance : float or array
        L_a, positive [H].
    back_emf_constant : float or array
        k_b, positive [V s/rad].

    Returns
    -------
    float or array
        di_a/dt [A/s].

    Notes
    -----
    Eq. 7 and 27, solved for the derivative.

    Examples
    --------
    >>> armature_current_rate(6.0, 1.0, 200.0, 3.0, 0.001, 0.005)
    2000.0
    """
    v_a, i_a = armature_voltage, armature_current
    R_a, L_a = armature_resistance, armature_inductance
    return (v_a - R_a * i_a - back_emf(motor_speed, back_emf_constant)) / L_a


def steady_armature_current(
    armature_voltage: float, motor_speed: float, armature_resistance: float, back_emf_constant: float
) -> float:
    """Return the current that flows where the armature inductance is neglected.

    Parameters
    ----------
    armature_voltage : float or array
        v_a [V].
    motor_speed : float or array
        w [rad/s].
    armature_resistance : float or array
        R_a, positive [Ω].
    back_emf_constant : float or array
        k_b, positive [V s/rad].

    Returns
    -------
    float or array
        i_a = (v_a − k_b q̇_m)/R_a [A].

    Notes
    -----
    Eq. 7 with L_a = 0, the step from eq. 31 to eq. 35.

    Examples
    --------
    >>> steady_armature_current(6.0, 600.0, 3.0, 0.005)
    1.0
    """
    return circuit_current(armature_voltage, back_emf(motor_speed, back_emf_constant), armature_resistance)


def circuit_current(voltage: float, back_emf: float, resistance: float) -> float:
    """Return the current that a voltage drives through a circuit against the back-EMF, inductance neglected.

    Parameters
    ----------
    voltage : float or array
        Voltage that drives the current, drops taken off [V].
    back_emf : float or array
        v_b = k_b q̇_m [V].
    resistance : float or array
        R of the circuit, positive [Ω].

    Returns
    -------
    float or array
        i = (V − v_b)/R [A].

    Notes
    -----
    Eq. 7 with L_a = 0.

    Examples
    --------
    >>> circuit_current(6.0, 3.0, 3.0)
    1.0
    """
    return (voltage - back_emf) / resistance


def magnetic_energy(armature_current: float, armature_inductance: float) -> float:
    """Return the energy in the magnetic field of the armature.

    Parameters
    ----------
    armature_current : float or array
        i_a [A].
    armature_inductance : float or array
        L_a [H].

    Returns
    -------
    float or array
        L_a i_a²/2 [J].

    Examples
    --------
    >>> magnetic_energy(2.0, 0.5)
    1.0
    """
    return 0.5 * armature_inductance * armature_current * armature_current


def required_motor_torque(
    motor_acceleration: float, motor_speed: float, rotor_inertia: float, motor_viscous_friction: float
) -> float:
    """Return the torque that moves the bare rotor as stated.

    Parameters
    ----------
    motor_acceleration : float or array
        Acceleration of the motor shaft [rad/s²].
    motor_speed : float or array
        w [rad/s].
    rotor_inertia : float or array
        J_m, positive [kg m²].
    motor_viscous_friction : float or array
        B_m, at least 0 [N m s/rad].

    Returns
    -------
    float or array
        J_m q̈_m + B_m q̇_m [N m].

    Notes
    -----
    Eq. 10 and 25, where it is called τ_m. It equals `electromagnetic_torque` only for a motor without load and without
    Coulomb friction (eq. 11).

    Examples
    --------
    >>> round(required_motor_torque(1000.0, 100.0, 1e-6, 1e-6), 9)
    0.0011
    """
    qdd_m, qd_m = motor_acceleration, motor_speed
    J_m, B_m = rotor_inertia, motor_viscous_friction
    return J_m * qdd_m + B_m * qd_m
