"""The paper's servo without armature inductance: the torque at the spindle, and the motion that it leaves.

Eq. 40 is an inverse statement: given a motion and a command it yields the torque at the spindle. A load closes it,
τ_L = J_L q̈ + B_L q̇ + τ_ext, and makes it the forward statement that a simulation needs.
"""

from __future__ import annotations

from servotwin.physics.electronics import control_voltage_from_voltage, unbounded_armature_voltage
from servotwin.physics.friction import smoothed_coulomb_torque
from servotwin.physics.gear import motor_from_output, output_inertia, output_torque
from servotwin.physics.motor import electromagnetic_torque, required_motor_torque, steady_armature_current
from servotwin.physics.potentiometer import feedback_voltage


def loop_voltage(
    output_angle: float,
    command_voltage: float,
    *,
    bridge_gain: float,
    comparator_gain: float,
    voltage_to_pulse_gain: float,
    pulse_to_voltage_gain: float,
    feedback_gain: float,
    command_offset: float = 0.0,
    feedback_offset: float = 0.0,
) -> float:
    """Return the armature voltage that the paper's control loop gives at this angle and command.

    Parameters
    ----------
    output_angle : float or array
        q [rad].
    command_voltage : float or array
        v_i [V].
    bridge_gain, comparator_gain : float or array
        A and k_s [V/V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    pulse_to_voltage_gain : float or array
        k_p2 [V/s].
    feedback_gain : float or array
        p [V/rad].
    command_offset, feedback_offset : float or array
        b_i and b_o, 0 as printed [V].

    Returns
    -------
    float or array
        v_a = A k_s [(k_p v_i + b_i) − (p q + b_o)], without bound [V].

    Notes
    -----
    Eq. 38 with offsets.

    Examples
    --------
    >>> loop_voltage(1.0, 2.0, bridge_gain=10.0, comparator_gain=2.0, voltage_to_pulse_gain=0.001,
    ...              pulse_to_voltage_gain=750.0, feedback_gain=0.5, feedback_offset=0.75)
    5.0
    """
    v_c = control_voltage_from_voltage(command_voltage, voltage_to_pulse_gain, pulse_to_voltage_gain, command_offset)
    v_o = feedback_voltage(output_angle, feedback_gain, feedback_offset)
    return unbounded_armature_voltage(v_c, v_o, bridge_gain, comparator_gain)


def driven_spindle_torque(
    output_speed: float,
    output_acceleration: float,
    armature_voltage: float,
    *,
    armature_resistance: float,
    torque_constant: float,
    back_emf_constant: float,
    rotor_inertia: float,
    motor_viscous_friction: float,
    gear_reduction: float,
    coulomb_torque_forward: float,
    coulomb_torque_backward: float,
    zero_crossing_slope: float,
) -> float:
    """Return the torque that a geared motor leaves for its load, for a stated motion and armature voltage.

    Parameters
    ----------
    output_speed : float or array
        q̇ [rad/s].
    output_acceleration : float or array
        q̈ [rad/s²].
    armature_voltage : float or array
        v_a [V].
    armature_resistance : float or array
        R_a [Ω].
    torque_constant : float or array
        k_a [N m/A].
    back_emf_constant : float or array
        k_b [V s/rad].
    rotor_inertia : float or array
        J_m [kg m²].
    motor_viscous_friction : float or array
        B_m [N m s/rad].
    gear_reduction : float or array
        N = 1/n [1].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        F_ec1 and F_ec2 at the motor shaft; 0 gives eq. 36 [N m].
    zero_crossing_slope : float or array
        k [s/rad].

    Returns
    -------
    float or array
        τ_L, positive towards +q; the load's own inertia and damping take their share of it [N m].

    Notes
    -----
    Eq. 37; without Coulomb friction eq. 36, which is eq. 35 solved for τ_L.

    Examples
    --------
    >>> tau_L = driven_spindle_torque(
    ...     0.0, 0.0, 6.0, armature_resistance=3.0, torque_constant=0.005, back_emf_constant=0.005, rotor_inertia=1e-7,
    ...     motor_viscous_friction=0.0, gear_reduction=200.0, coulomb_torque_forward=1e-3,
    ...     coulomb_torque_backward=1e-3, zero_crossing_slope=100.0)
    >>> round(float(tau_L), 9)
    2.0
    """
    N = gear_reduction
    qd_m, qdd_m = motor_from_output(output_speed, N), motor_from_output(output_acceleration, N)
    i_a = steady_armature_current(armature_voltage, qd_m, armature_resistance, back_emf_constant)
    tau_o = electromagnetic_torque(i_a, torque_constant)
    tau_m = required_motor_torque(qdd_m, qd_m, rotor_inertia, motor_viscous_friction)
    f_ec = smoothed_coulomb_torque(qd_m, coulomb_torque_forward, coulomb_torque_backward, zero_crossing_slope)
    return output_torque(tau_o - tau_m - f_ec, N)


def spindle_torque(
    output_angle: float,
    output_speed: float,
    output_acceleration: float,
    command_voltage: float,
    *,
    armature_resistance: float,
    torque_constant: float,
    back_emf_constant: float,
    rotor_inertia: float,
    motor_viscous_friction: float,
    gear_reduction: float,
    coulomb_torque_forward: float,
    coulomb_torque_backward: float,
    zero_crossing_slope: float,
    bridge_gain: float,
    comparator_gain: float,
    voltage_to_pulse_gain: float,
    pulse_to_voltage_gain: float,
    feedback_gain: float,
    command_offset: float = 0.0,
    feedback_offset: float = 0.0,
) -> float:
    """Return the torque at the spindle of the paper's servo, for a stated motion and command.

    Parameters
    ----------
    output_angle : float or array
        q [rad].
    output_speed : float or array
        q̇ [rad/s].
    output_acceleration : float or array
        q̈ [rad/s²].
    command_voltage : float or array
        v_i [V].
    armature_resistance : float or array
        R_a [Ω].
    torque_constant : float or array
        k_a [N m/A].
    back_emf_constant : float or array
        k_b [V s/rad].
    rotor_inertia : float or array
        J_m [kg m²].
    motor_viscous_friction : float or array
        B_m [N m s/rad].
    gear_reduction : float or array
        N = 1/n [1].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        F_ec1 and F_ec2 at the motor shaft [N m].
    zero_crossing_slope : float or array
        k [s/rad].
    bridge_gain, comparator_gain : float or array
        A and k_s [V/V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    pulse_to_voltage_gain : float or array
        k_p2 [V/s].
    feedback_gain : float or array
        p [V/rad].
    command_offset, feedback_offset : float or array
        b_i and b_o, 0 as printed [V].

    Returns
    -------
    float or array
        τ_L, positive towards +q; the load's own inertia and damping take their share of it [N m].

    Notes
    -----
    Eq. 40 with offsets: eq. 37 at the voltage of eq. 38. Both offsets 0 give eq. 40 as printed. The paper publishes no
    value of any of these parameters.

    Examples
    --------
    >>> servo = dict(armature_resistance=3.0, torque_constant=0.005, back_emf_constant=0.005, rotor_inertia=1e-7,
    ...              motor_viscous_friction=0.0, gear_reduction=200.0, coulomb_torque_forward=1e-3,
    ...              coulomb_torque_backward=1e-3, zero_crossing_slope=100.0, bridge_gain=10.0, comparator_gain=2.0,
    ...              voltage_to_pulse_gain=0.001, pulse_to_voltage_gain=750.0, feedback_gain=0.5)
    >>> round(float(spindle_torque(1.0, 0.0, 0.0, 2.0, feedback_offset=0.75, **servo)), 9)
    1.666666667
    """
    v_a = loop_voltage(
        output_angle,
        command_voltage,
        bridge_gain=bridge_gain,
        comparator_gain=comparator_gain,
        voltage_to_pulse_gain=voltage_to_pulse_gain,
        pulse_to_voltage_gain=pulse_to_voltage_gain,
        feedback_gain=feedback_gain,
        command_offset=command_offset,
        feedback_offset=feedback_offset,
    )
    return driven_spindle_torque(
        output_speed,
        output_acceleration,
        v_a,
        armature_resistance=armature_resistance,
        torque_constant=torque_constant,
        back_emf_constant=back_emf_constant,
        rotor_inertia=rotor_inertia,
        motor_viscous_friction=motor_viscous_friction,
        gear_reduction=gear_reduction,
        coulomb_torque_forward=coulomb_torque_forward,
        coulomb_torque_backward=coulomb_torque_backward,
        zero_crossing_slope=zero_crossing_slope,
    )


def forward_acceleration(
    output_angle: float,
    output_speed: float,
    command_voltage: float,
    *,
    load_inertia: float = 0.0,
    load_viscous_friction: float = 0.0,
    external_torque: float = 0.0,
    armature_resistance: float,
    torque_constant: float,
    back_emf_constant: float,
    rotor_inertia: float,
    motor_viscous_friction: float,
    gear_reduction: float,
    coulomb_torque_forward: float,
    coulomb_torque_backward: float,
    zero_crossing_slope: float,
    bridge_gain: float,
    comparator_gain: float,
    voltage_to_pulse_gain: float,
    pulse_to_voltage_gain: float,
    feedback_gain: float,
    command_offset: float = 0.0,
    feedback_offset: float = 0.0,
) -> float:
    """Return the acceleration of the output shaft of the paper's servo under a load.

    Parameters
    ----------
    output_angle : float or array
        q [rad].
    output_speed : float or array
        q̇ [rad/s].
    command_voltage : float or array
        v_i [V].
    load_inertia : float or array
        J_L, at least 0 [kg m²].
    load_viscous_friction : float or array
        B_L, at least 0 [N m s/rad].
    external_torque : float or array
        τ_ext [N m].
    armature_resistance : float or array
        R_a [Ω].
    torque_constant : float or array
        k_a [N m/A].
    back_emf_constant : float or array
        k_b [V s/rad].
    rotor_inertia : float or array
        J_m [kg m²].
    motor_viscous_friction : float or array
        B_m [N m s/rad].
    gear_reduction : float or array
        N = 1/n [1].
    coulomb_torque_forward, coulomb_torque_backward : float or array
        F_ec1 and F_ec2 at the motor shaft [N m].
    zero_crossing_slope : float or array
        k [s/rad].
    bridge_gain, comparator_gain : float or array
        A and k_s [V/V].
    voltage_to_pulse_gain : float or array
        k_p1 [s/V].
    pulse_to_voltage_gain : float or array
        k_p2 [V/s].
    feedback_gain : float or array
        p [V/rad].
    command_offset, feedback_offset : float or array
        b_i and b_o, 0 as printed [V].

    Returns
    -------
    float or array
        q̈ with (N² J_m + J_L) q̈ = N k_a i_a − (N² B_m + B_L) q̇ − N f_ec(N q̇) − τ_ext [rad/s²].

    Notes
    -----
    Eq. 40 with offsets, closed by τ_L = J_L q̈ + B_L q̇ + τ_ext.

    Examples
    --------
    >>> servo = dict(armature_resistance=3.0, torque_constant=0.005, back_emf_constant=0.005, rotor_inertia=1e-7,
    ...              motor_viscous_friction=0.0, gear_reduction=200.0, coulomb_torque_forward=1e-3,
    ...              coulomb_torque_backward=1e-3, zero_crossing_slope=100.0, bridge_gain=10.0, comparator_gain=2.0,
    ...              voltage_to_pulse_gain=0.001, pulse_to_voltage_gain=750.0, feedback_gain=0.5)
    >>> round(float(forward_acceleration(1.0, 0.0, 2.0, load_inertia=1e-3, feedback_offset=0.75, **servo)), 3)
    333.333
    """
    # Eq. 40 is linear in q̈, so its torque at q̈ = 0 is what accelerates rotor and load together.
    available = spindle_torque(
        output_angle,
        output_speed,
        0.0,
        command_voltage,
        armature_resistance=armature_resistance,
        torque_constant=torque_constant,
        back_emf_constant=back_emf_constant,
        rotor_inertia=rotor_inertia,
        motor_viscous_friction=motor_viscous_friction,
        gear_reduction=gear_reduction,
        coulomb_torque_forward=coulomb_torque_forward,
        coulomb_torque_backward=coulomb_torque_backward,
        zero_crossing_slope=zero_crossing_slope,
        bridge_gain=bridge_gain,
        comparator_gain=comparator_gain,
        voltage_to_pulse_gain=voltage_to_pulse_gain,
        pulse_to_voltage_gain=pulse_to_voltage_gain,
        feedback_gain=feedback_gain,
        command_offset=command_offset,
        feedback_offset=feedback_offset,
    )
    resisting = load_viscous_friction * output_speed + external_torque
    return (available - resisting) / output_inertia(rotor_inertia, load_inertia, gear_reduction)
