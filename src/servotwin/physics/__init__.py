"""Physics: every law once, a pure function without state.

In its own module a law is a function over numbers, which the engine runs: `physics.motor.back_emf`. Under the name of
this package, `physics.back_emf`, it broadcasts over arrays; of numbers it returns a number.

Equation numbers are those of Urrea and Kern, "A New Model for Analog Servo Motors", Canadian Journal on Automation,
Control and Intelligent Systems 2(2), 2011; `docs/theory` lists them all. Everything is SI: rad, s, V, A, N m, kg m².
A mechanical quantity names its shaft, `motor_` or `output_`, unless it can belong to one alone.
"""

from servotwin.physics import (
    analog_servo,
    backlash,
    bridge,
    electronics,
    firmware,
    friction,
    gear,
    load_friction,
    motor,
    potentiometer,
    pulse,
    pwm,
    shaft,
    supply,
    thermal,
)
from servotwin.physics.friction import creep_speed, undamped_creep_speed
from servotwin.physics.laws import array_form
from servotwin.physics.potentiometer import angle_from_sensed_voltage, linearity_error, sensed_voltage
from servotwin.physics.sheet import (
    SheetMotor,
    load_share,
    motor_from_sheet,
    no_load_current_of,
    sheet_efficiency,
    sheet_growth,
    sheet_resistance,
    sheet_stall_torque,
    sheet_torque_constant,
    stall_current_for,
    stall_torque,
)
from servotwin.physics.supply import Conduction, bus_voltage
from servotwin.physics.thermal import Temperatures, ThermalTimes

driven_spindle_torque = array_form(analog_servo.driven_spindle_torque)
forward_acceleration = array_form(analog_servo.forward_acceleration)
loop_voltage = array_form(analog_servo.loop_voltage)
spindle_torque = array_form(analog_servo.spindle_torque)

impact_energy = array_form(backlash.impact_energy)
impact_speed = array_form(backlash.impact_speed)
play = array_form(backlash.play)
rebound_speed = array_form(backlash.rebound_speed)

bridge_current = array_form(bridge.bridge_current)
bridge_loss = array_form(bridge.bridge_loss)
bridge_voltage = array_form(bridge.bridge_voltage)
brush_loss = array_form(bridge.brush_loss)
driving_voltage = array_form(bridge.driving_voltage)
motor_voltage = array_form(bridge.motor_voltage)
needed_voltage = array_form(bridge.needed_voltage)

averaged_bridge_gain = array_form(electronics.averaged_bridge_gain)
bounded_armature_voltage = array_form(electronics.bounded_armature_voltage)
comparator_voltage = array_form(electronics.comparator_voltage)
control_voltage_from_paper_pulse = array_form(electronics.control_voltage_from_paper_pulse)
control_voltage_from_pulse = array_form(electronics.control_voltage_from_pulse)
control_voltage_from_voltage = array_form(electronics.control_voltage_from_voltage)
error_beyond_deadband = array_form(electronics.error_beyond_deadband)
feedback_error = array_form(electronics.feedback_error)
proportional_voltage = array_form(electronics.proportional_voltage)
pulse_width_from_feedback = array_form(electronics.pulse_width_from_feedback)
pulse_width_from_voltage = array_form(electronics.pulse_width_from_voltage)
unbounded_armature_voltage = array_form(electronics.unbounded_armature_voltage)

braking_distance = array_form(firmware.braking_distance)
counted = array_form(firmware.counted)
cut = array_form(firmware.cut)
duty_for_bus_current = array_form(firmware.duty_for_bus_current)
duty_for_motor_current = array_form(firmware.duty_for_motor_current)
duty_of = array_form(firmware.duty_of)
error_beyond_zone = array_form(firmware.error_beyond_zone)
filtered_angle = array_form(firmware.filtered_angle)
integrated_error = array_form(firmware.integrated_error)
resolved_pulse = array_form(firmware.resolved_pulse)
started_duty = array_form(firmware.started_duty)

breakaway_torque = array_form(friction.breakaway_torque)
coulomb_torque = array_form(friction.coulomb_torque)
smoothed_coulomb_slope = array_form(friction.smoothed_coulomb_slope)
smoothed_coulomb_torque = array_form(friction.smoothed_coulomb_torque)
sticks = array_form(friction.sticks)

motor_from_output = array_form(gear.motor_from_output)
output_inertia = array_form(gear.output_inertia)
output_torque = array_form(gear.output_torque)
output_viscous_friction = array_form(gear.output_viscous_friction)
reflected_inertia = array_form(gear.reflected_inertia)
reflected_viscous_friction = array_form(gear.reflected_viscous_friction)

back_drive_torque = array_form(load_friction.back_drive_torque)
forward_efficiency = array_form(load_friction.forward_efficiency)
gear_friction_budget = array_form(load_friction.gear_friction_budget)
gear_sticks = array_form(load_friction.gear_sticks)
quadratic_gear_friction = array_form(load_friction.quadratic_gear_friction)
sliding_gear_friction = array_form(load_friction.sliding_gear_friction)
static_gear_friction = array_form(load_friction.static_gear_friction)
stribeck_factor = array_form(load_friction.stribeck_factor)
torque_on_gear = array_form(load_friction.torque_on_gear)
share_balance = array_form(load_friction.share_balance)
torque_share = array_form(load_friction.torque_share)

armature_current_rate = array_form(motor.armature_current_rate)
back_emf = array_form(motor.back_emf)
circuit_current = array_form(motor.circuit_current)
electromagnetic_torque = array_form(motor.electromagnetic_torque)
magnetic_energy = array_form(motor.magnetic_energy)
required_motor_torque = array_form(motor.required_motor_torque)
steady_armature_current = array_form(motor.steady_armature_current)

angle_from_voltage = array_form(potentiometer.angle_from_voltage)
error_between = array_form(potentiometer.error_between)
feedback_voltage = array_form(potentiometer.feedback_voltage)
quantised = array_form(potentiometer.quantised)

decision_delay = array_form(pulse.decision_delay)
drive_time = array_form(pulse.drive_time)
effective_voltage = array_form(pulse.effective_voltage)
error_time = array_form(pulse.error_time)
full_drive_error = array_form(pulse.full_drive_error)
one_shot_width = array_form(pulse.one_shot_width)
pulse_stiffness = array_form(pulse.pulse_stiffness)

averaged_drop = array_form(pwm.averaged_drop)
averaged_resistance = array_form(pwm.averaged_resistance)
chopped_resistance = array_form(pwm.chopped_resistance)

kinetic_energy = array_form(shaft.kinetic_energy)
load_torque = array_form(shaft.load_torque)
pendulum_stiffness = array_form(shaft.pendulum_stiffness)
pendulum_torque = array_form(shaft.pendulum_torque)
shaft_acceleration = array_form(shaft.shaft_acceleration)
spring_energy = array_form(shaft.spring_energy)
spring_torque = array_form(shaft.spring_torque)
stretch_beyond_play = array_form(shaft.stretch_beyond_play)
twist_torque = array_form(shaft.twist_torque)

bridge_supply_current = array_form(supply.bridge_supply_current)
conduction = array_form(supply.conduction)
source_voltage = array_form(supply.source_voltage)
supply_current = array_form(supply.supply_current)

copper_loss = array_form(thermal.copper_loss)
heat_flow = array_form(thermal.heat_flow)
magnet_factor = array_form(thermal.magnet_factor)
steady_temperatures = array_form(thermal.steady_temperatures)
thermal_time_constants = array_form(thermal.thermal_time_constants)
two_mass_temperatures = array_form(thermal.two_mass_temperatures)
warming_rate = array_form(thermal.warming_rate)
winding_resistance = array_form(thermal.winding_resistance)

ANALYSIS = (
    "averaged_bridge_gain", "back_drive_torque", "bounded_armature_voltage", "bridge_current",
    "bridge_supply_current", "bus_voltage", "comparator_voltage", "conduction", "creep_speed",
    "driven_spindle_torque", "forward_acceleration", "forward_efficiency", "full_drive_error", "gear_sticks",
    "impact_energy", "load_share", "loop_voltage", "motor_from_sheet", "no_load_current_of", "pulse_stiffness",
    "reflected_inertia", "reflected_viscous_friction", "required_motor_torque", "sheet_efficiency", "sheet_growth",
    "sheet_resistance", "sheet_stall_torque", "sheet_torque_constant", "spindle_torque", "stall_current_for",
    "stall_torque", "steady_temperatures", "thermal_time_constants", "two_mass_temperatures",
    "unbounded_armature_voltage", "undamped_creep_speed",
)
"""Laws that no run calls: they tell of a servo as a whole, or join laws of which the engine runs each alone."""

__all__ = [
    "ANALYSIS",
    "Conduction",
    "SheetMotor",
    "Temperatures",
    "ThermalTimes",
    "angle_from_sensed_voltage",
    "angle_from_voltage",
    "armature_current_rate",
    "averaged_bridge_gain",
    "averaged_drop",
    "averaged_resistance",
    "back_drive_torque",
    "back_emf",
    "bounded_armature_voltage",
    "braking_distance",
    "breakaway_torque",
    "bridge_current",
    "bridge_loss",
    "bridge_supply_current",
    "bridge_voltage",
    "brush_loss",
    "bus_voltage",
    "chopped_resistance",
    "circuit_current",
    "comparator_voltage",
    "conduction",
    "control_voltage_from_paper_pulse",
    "control_voltage_from_pulse",
    "control_voltage_from_voltage",
    "copper_loss",
    "coulomb_torque",
    "counted",
    "creep_speed",
    "cut",
    "decision_delay",
    "drive_time",
    "driven_spindle_torque",
    "driving_voltage",
    "duty_for_bus_current",
    "duty_for_motor_current",
    "duty_of",
    "effective_voltage",
    "electromagnetic_torque",
    "error_between",
    "error_beyond_deadband",
    "error_beyond_zone",
    "error_time",
    "feedback_error",
    "feedback_voltage",
    "filtered_angle",
    "forward_acceleration",
    "forward_efficiency",
    "full_drive_error",
    "gear_friction_budget",
    "gear_sticks",
    "heat_flow",
    "impact_energy",
    "impact_speed",
    "integrated_error",
    "kinetic_energy",
    "linearity_error",
    "load_share",
    "load_torque",
    "loop_voltage",
    "magnet_factor",
    "magnetic_energy",
    "motor_from_output",
    "motor_from_sheet",
    "motor_voltage",
    "needed_voltage",
    "no_load_current_of",
    "one_shot_width",
    "output_inertia",
    "output_torque",
    "output_viscous_friction",
    "pendulum_stiffness",
    "pendulum_torque",
    "play",
    "proportional_voltage",
    "pulse_stiffness",
    "pulse_width_from_feedback",
    "pulse_width_from_voltage",
    "quadratic_gear_friction",
    "quantised",
    "rebound_speed",
    "reflected_inertia",
    "reflected_viscous_friction",
    "required_motor_torque",
    "resolved_pulse",
    "sensed_voltage",
    "shaft_acceleration",
    "share_balance",
    "sheet_efficiency",
    "sheet_growth",
    "sheet_resistance",
    "sheet_stall_torque",
    "sheet_torque_constant",
    "sliding_gear_friction",
    "smoothed_coulomb_slope",
    "smoothed_coulomb_torque",
    "source_voltage",
    "spindle_torque",
    "spring_energy",
    "spring_torque",
    "stall_current_for",
    "stall_torque",
    "started_duty",
    "static_gear_friction",
    "steady_armature_current",
    "steady_temperatures",
    "sticks",
    "stretch_beyond_play",
    "stribeck_factor",
    "supply_current",
    "thermal_time_constants",
    "torque_on_gear",
    "torque_share",
    "twist_torque",
    "two_mass_temperatures",
    "unbounded_armature_voltage",
    "undamped_creep_speed",
    "warming_rate",
    "winding_resistance",
]
