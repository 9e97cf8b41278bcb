"""Values of parameters that the catalog's servo does not give, for tests that need every one (SI)."""

ABSENT = {
    "gear.output_inertia": 1e-4, "electronics.voltage_deadband": 0.02, "supply.bridge_drop_voltage": 0.3,
    "friction.breakaway_ratio": 1.4, "stops.lower_angle": -0.1, "stops.upper_angle": 0.6, "stops.restitution": 0.4,
    "electronics.voltage_to_pulse_gain": 7e-4, "electronics.command_pulse_offset": -2e-5,
    "electronics.command_offset": 0.1, "electronics.pulse_to_voltage_gain": 900.0,
    "electronics.one_shot_slope": 1.1e-3, "electronics.one_shot_offset": 1e-4, "potentiometer.feedback_offset": 0.1,
    "motor.brush_drop_voltage": 0.2, "electronics.frame_period": 0.015, "electronics.deadband": 5e-6,
    "electronics.minimum_drive_time": 2e-4, "electronics.stretcher_time_constant": 0.02,
    "electronics.back_emf_injection": 0.01, "electronics.supply_coupling": 0.05, "electronics.pulse_timeout": 0.05,
    "electronics.pulse_width_min": 2e-4, "electronics.pulse_width_max": 4e-3, "potentiometer.noise": 1e-3,
    "supply.internal_resistance": 0.2, "supply.bridge_drop_resistance": 0.3, "electronics.bridge_gain": 40.0,
    "electronics.comparator_gain": 1.0, "electronics.stretcher_gain": 80.0,
    "gear.backlash": 0.01, "friction.stribeck_speed": 8.0, "friction.stribeck_exponent": 1.2,
    "friction.load_friction": 0.05, "friction.load_friction_stribeck": 0.05, "friction.load_friction_motor": 0.05,
    "friction.load_friction_external": 0.05, "friction.load_friction_motor_stribeck": 0.05,
    "friction.load_friction_external_stribeck": 0.05, "friction.load_friction_motor_quad": 0.1,
    "friction.load_friction_external_quad": 0.1, "friction.bearing_coulomb_torque": 0.01,
    "potentiometer.backlash": 0.01,
    "potentiometer.quantisation": 2e-3, "supply.current_limit": 1.0, "thermal.winding_capacity": 0.2,
    "thermal.housing_capacity": 5.0, "thermal.winding_to_housing": 10.0, "thermal.housing_to_ambient": 20.0,
    "thermal.ambient": 300.0, "thermal.magnet_coefficient": 1e-3, "motor.armature_inductance": 5e-4,
    "gear.stiffness": 60.0, "gear.damping": 0.03,
}
TABLES = ("potentiometer.linearity_angle", "potentiometer.linearity_error")
HEAT = [f"thermal.{name}" for name in ("winding_capacity", "housing_capacity", "winding_to_housing",
                                       "housing_to_ambient")]
