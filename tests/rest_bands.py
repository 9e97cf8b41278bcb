"""How far from its goal Coulomb friction may hold a servo, in closed form."""


def averaged(servo) -> float:
    """Return half the band of `BoundedServo` at the output [rad]: half the deadband, and A k_s v_d = F R / k_a."""
    electronics = servo.electronics
    error = _holding_voltage(servo) / (electronics.bridge_gain * electronics.comparator_gain)  # V, beyond the deadband
    return (0.5 * (electronics.voltage_deadband or 0.0) + error) / servo.potentiometer.feedback_gain


def proportional(servo) -> float:
    """Return half the band of a `DigitalServo` with P and D [rad]: its deadband, and P e V_oc - V_ce0 = F R / k_a."""
    voltage = _holding_voltage(servo) + servo.supply.bridge_drop_voltage
    gain = servo.firmware.proportional_gain * servo.supply.open_circuit_voltage
    return (servo.firmware.deadband_angle or 0.0) + voltage / gain


def _holding_voltage(servo) -> float:
    friction, motor = servo.friction, servo.motor
    coulomb = max(friction.coulomb_torque_forward, friction.coulomb_torque_backward)
    return (friction.breakaway_ratio or 1.0) * coulomb * motor.armature_resistance / motor.torque_constant
