"""Physics: every law one pure, broadcasting function without state.

Equation numbers are those of Urrea and Kern, "A New Model for Analog Servo Motors", Canadian Journal on Automation,
Control and Intelligent Systems 2(2), 2011; `docs/theory` lists them all. Everything is SI: rad, s, V, A, N m, kg m².
A mechanical quantity names its shaft, `motor_` or `output_`, unless it can belong to one alone.
"""

from servotwin.physics.analog_servo import driven_spindle_torque, forward_acceleration, loop_voltage, spindle_torque
from servotwin.physics.backlash import impact_energy, impact_speed, play
from servotwin.physics.bridge import bridge_current, motor_voltage
from servotwin.physics.electronics import (
    averaged_bridge_gain,
    bounded_armature_voltage,
    comparator_voltage,
    control_voltage_from_pulse,
    control_voltage_from_voltage,
    feedback_error,
    pulse_width_from_voltage,
    unbounded_armature_voltage,
)
from servotwin.physics.friction import (
    coulomb_torque,
    creep_speed,
    smoothed_coulomb_torque,
    sticks,
    undamped_creep_speed,
)
from servotwin.physics.gear import (
    motor_from_output,
    output_inertia,
    output_viscous_friction,
    reflected_inertia,
    reflected_viscous_friction,
)
from servotwin.physics.load_friction import (
    back_drive_torque,
    forward_efficiency,
    gear_friction_budget,
    gear_sticks,
    quadratic_gear_friction,
    stribeck_factor,
)
from servotwin.physics.motor import (
    armature_current_rate,
    back_emf,
    electromagnetic_torque,
    required_motor_torque,
    steady_armature_current,
)
from servotwin.physics.potentiometer import (
    angle_from_sensed_voltage,
    angle_from_voltage,
    feedback_voltage,
    linearity_error,
    quantised,
    sensed_voltage,
)
from servotwin.physics.pulse import drive_time, full_drive_error, one_shot_width, pulse_stiffness
from servotwin.physics.sheet import (
    SheetMotor,
    load_share,
    motor_from_sheet,
    sheet_efficiency,
    sheet_growth,
    stall_current_for,
    stall_torque,
)
from servotwin.physics.supply import Conduction, bridge_supply_current, bus_voltage, conduction, source_voltage
from servotwin.physics.thermal import (
    Temperatures,
    ThermalTimes,
    magnet_factor,
    steady_temperatures,
    thermal_time_constants,
    two_mass_temperatures,
    winding_resistance,
)

__all__ = [
    "Conduction",
    "SheetMotor",
    "Temperatures",
    "ThermalTimes",
    "angle_from_sensed_voltage",
    "angle_from_voltage",
    "armature_current_rate",
    "averaged_bridge_gain",
    "back_drive_torque",
    "back_emf",
    "bounded_armature_voltage",
    "bridge_current",
    "bridge_supply_current",
    "bus_voltage",
    "comparator_voltage",
    "conduction",
    "control_voltage_from_pulse",
    "control_voltage_from_voltage",
    "coulomb_torque",
    "creep_speed",
    "drive_time",
    "driven_spindle_torque",
    "electromagnetic_torque",
    "feedback_error",
    "feedback_voltage",
    "forward_acceleration",
    "forward_efficiency",
    "full_drive_error",
    "gear_friction_budget",
    "gear_sticks",
    "impact_energy",
    "impact_speed",
    "linearity_error",
    "load_share",
    "loop_voltage",
    "magnet_factor",
    "motor_from_output",
    "motor_from_sheet",
    "motor_voltage",
    "one_shot_width",
    "output_inertia",
    "output_viscous_friction",
    "play",
    "pulse_stiffness",
    "pulse_width_from_voltage",
    "quadratic_gear_friction",
    "quantised",
    "reflected_inertia",
    "reflected_viscous_friction",
    "required_motor_torque",
    "sensed_voltage",
    "sheet_efficiency",
    "sheet_growth",
    "smoothed_coulomb_torque",
    "source_voltage",
    "spindle_torque",
    "stall_current_for",
    "stall_torque",
    "steady_armature_current",
    "steady_temperatures",
    "sticks",
    "stribeck_factor",
    "thermal_time_constants",
    "two_mass_temperatures",
    "unbounded_armature_voltage",
    "undamped_creep_speed",
    "winding_resistance",
]
