"""Nomenclature: symbol, unit and meaning of the arguments that several laws have, once.

The docstring of a law gives an argument's symbol, its unit, and what holds in this law alone. Arguments that are
numbers of a servo file, such as `armature_resistance`, have their meaning in `servotwin.parameters`.
"""

from __future__ import annotations

from typing import NamedTuple


class Argument(NamedTuple):
    """An argument of laws: its symbol, its unit, and its meaning."""

    symbol: str
    unit: str
    meaning: str


ARGUMENTS: dict[str, Argument] = {
    "acceleration": Argument("a", "rad/s²", "acceleration of the shaft that a law names"),
    "angle": Argument("q", "rad", "angle that a law names, of a shaft unless it says otherwise"),
    "armature_current": Argument("i_a", "A", "current of the armature, positive where it turns the motor towards +q"),
    "armature_voltage": Argument("v_a", "V", "voltage at the motor's terminals"),
    "back_emf": Argument("v_b", "V", "voltage that the turning motor induces in its own winding"),
    "bus_voltage": Argument("V_bus", "V", "voltage of the supply at the bridge, under load"),
    "command_voltage": Argument("v_i", "V", "command at the transmitter"),
    "coulomb_torque": Argument("F_c", "N m", "Coulomb friction of one direction, at the shaft that a law names"),
    "direction": Argument("±1", "1", "direction of what a law names: +1 or −1; 0 where it says so"),
    "draws_above": Argument("v⁺", "V", "voltage of the supply above which a bridge draws current"),
    "drive": Argument("s", "1", "state of the bridge: +1 or −1 while it drives, 0 while it brakes or coasts"),
    "driving_torque": Argument("τ", "N m", "torque that drives a shaft towards +q"),
    "drop_voltage": Argument("V_d", "V", "voltage lost in bridge and brushes, of a servo described by its sheet"),
    "dry_friction": Argument("f", "N m", "dry friction that opposes motion towards +q"),
    "duty": Argument("d", "1", "share of a PWM period for which the bridge drives, at the place that a law names"),
    "external_share": Argument("K_e", "1", "gear friction per torque from outside, sliding or static"),
    "external_torque": Argument("τ_ext", "N m", "torque of the load, positive where it pushes the shaft towards −q"),
    "external_torque_on_gear": Argument("τ_e", "N m", "torque on the gear from outside, towards +q, at the output"),
    "feedback_voltage": Argument("v_o", "V", "voltage of the potentiometer, its offset included"),
    "gear_efficiency": Argument("η_g", "1", "share of the motor's power that the gear passes on"),
    "gravity_torque": Argument("m g l", "N m", "torque of a pendulum that is held level"),
    "hanging_angle": Argument("q_h", "rad", "angle of the shaft at which a pendulum hangs straight down"),
    "inertia": Argument("J", "kg m²", "inertia of all that turns with the shaft that a law names"),
    "load_inertia": Argument("J_L", "kg m²", "inertia of the load, at the output shaft"),
    "load_viscous_friction": Argument("B_L", "N m s/rad", "viscous friction of the load, at the output shaft"),
    "motor_share": Argument("K_m", "1", "gear friction per torque of the motor, sliding or static"),
    "motor_speed": Argument("w", "rad/s", "speed of the motor shaft"),
    "motor_torque": Argument("τ_m", "N m", "torque of the motor towards +q, at the shaft that a law names"),
    "no_load_current": Argument("I_0", "A", "current of a servo that runs without load"),
    "no_load_speed": Argument("ω_0", "rad/s", "speed of the output without load"),
    "one_shot_width": Argument("T_os", "s", "width of the chip's own pulse"),
    "other_inertia": Argument("J_2", "kg m²", "inertia of the other of two bodies, seen at the same shaft"),
    "other_speed": Argument("w_2", "rad/s", "speed of the other of two bodies, at the same shaft"),
    "output_acceleration": Argument("q̈", "rad/s²", "acceleration of the output shaft"),
    "output_angle": Argument("q", "rad", "angle of the output shaft, from the one that the servo file calls zero"),
    "output_speed": Argument("q̇", "rad/s", "speed of the output shaft"),
    "output_torque_constant": Argument("K_out", "N m/A", "torque at the output per current"),
    "power": Argument("P", "W", "heat of the winding"),
    "pulse_width": Argument("t_a", "s", "width of the pulse that the servo gets"),
    "resistance": Argument("R", "Ω", "resistance of the circuit that a law names"),
    "returns_below": Argument("v⁻", "V", "voltage of the supply below which the diodes of a bridge return current"),
    "source_voltage": Argument("s V", "V", "voltage that a law names, with the sign of the drive; 0 without drive"),
    "speed": Argument("w", "rad/s", "speed of the shaft that a law names"),
    "stall_current": Argument("I_s", "A", "current of a servo that is held"),
    "stall_torque": Argument("T_s", "N m", "torque of a servo that is held, at the output"),
    "supply_voltage": Argument("V", "V", "voltage of the supply"),
    "twist": Argument("δ", "rad", "angle by which the first of two bodies is ahead of the second"),
    "viscous_friction": Argument("b", "N m s/rad", "viscous friction at the shaft that a law names"),
    "viscous_share": Argument("s", "1", "share of the friction at the no-load speed that grows with the speed"),
    "voltage": Argument("v", "V", "voltage that a law names"),
    "voltage_drop": Argument("D", "V", "voltage lost in transistors, diodes and brushes"),
}
"""Arguments that several laws have in one unit, beside the numbers of a servo file."""
