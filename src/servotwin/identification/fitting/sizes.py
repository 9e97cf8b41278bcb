"""How large searched parameters are where a servo says nothing of them, and between which bounds they are sought."""

TYPICAL: dict[str, float] = {  # where a servo gives nothing, or 0: the size at which a parameter begins to matter
    "friction.breakaway_ratio": 1.3, "friction.stribeck_exponent": 1.0,
    "friction.load_friction": 0.1, "friction.load_friction_stribeck": 0.1,
    "friction.load_friction_motor": 0.1, "friction.load_friction_external": 0.1,
    "friction.load_friction_motor_stribeck": 0.1, "friction.load_friction_external_stribeck": 0.1,
    "friction.load_friction_motor_quad": 0.05, "friction.load_friction_external_quad": 0.05,
    "electronics.deadband": 5e-6, "electronics.minimum_drive_time": 2e-4, "electronics.stretcher_time_constant": 0.02,
    "electronics.back_emf_injection": 0.02, "electronics.supply_coupling": 0.05, "electronics.one_shot_offset": 1e-4,
    "electronics.voltage_deadband": 5e-3, "electronics.command_offset": 0.05,
    "potentiometer.feedback_offset": 0.05, "potentiometer.backlash": 5e-3, "gear.backlash": 0.01,
    "firmware.derivative_gain": 0.05, "firmware.integral_gain": 1.0, "firmware.deadband_angle": 5e-3,
    "firmware.minimum_duty": 0.02, "firmware.filter_weight": 0.5, "firmware.compute_delay": 1e-3,
    "firmware.duty_limit": 0.9, "firmware.torque_limit": 0.9, "firmware.velocity_feedforward": 0.02,
    "firmware.acceleration_feedforward": 1e-3, "motor.brush_drop_voltage": 0.2, "supply.internal_resistance": 0.3,
    "supply.bridge_drop_voltage": 0.3, "supply.bridge_drop_resistance": 0.2, "stops.restitution": 0.2,
}
RANGES: dict[str, tuple[float, float]] = {  # of what is searched between bounds of its own, unless the caller says
    "firmware.filter_weight": (0.02, 1.0), "firmware.minimum_duty": (0.0, 0.5), "firmware.duty_limit": (0.05, 1.0),
    "firmware.torque_limit": (0.05, 1.0), "firmware.control_period": (2e-4, 0.02),
}
JUMPS = (  # what acts by jumps, where no search finds its way
    "firmware.angle_quantum", "firmware.duty_quantum", "firmware.pulse_resolution", "firmware.derivative_ticks",
    "firmware.control_phase",
)
