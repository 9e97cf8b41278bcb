"""Digital servos for tests: a Feetech STS by its registers, locked or free, and a plain one on a bus."""

import math

import servotwin as st

COUNT = 2.0 * math.pi / 4096.0
PLANT = {
    "motor": {"armature_resistance": 3.0, "torque_constant": 3e-3, "back_emf_constant": 3e-3, "rotor_inertia": 1e-8,
              "motor_viscous_friction": 0.0},
    "gear": {"gear_reduction": 345.0},
    "friction": {"coulomb_torque_forward": 2e-4, "coulomb_torque_backward": 2e-4},
    "supply": {"open_circuit_voltage": 12.0},
}
SMOOTH = {"coulomb_torque_forward": 0.0, "coulomb_torque_backward": 0.0}
LOCKED = {"coulomb_torque_forward": 1e3, "coulomb_torque_backward": 1e3}


def digital(firmware, **groups):
    """Return the model of a servo on a bus with this firmware; groups are changed as named."""
    values = {name: {**PLANT.get(name, {}), **groups.get(name, {})} for name in {**PLANT, **groups}}
    firmware = {"control_period": 1e-3, "command_kind": "goal", **firmware}
    return st.DigitalServo(st.servo_from_values("test", {**values, "firmware": firmware}, kind="bus"))


def feetech(P, zone, startup, *, friction=LOCKED, **more):
    """Return a servo with the firmware of a Feetech STS, by its registers 21, 26 and 24, and other numbers."""
    firmware = {
        "angle_quantum": COUNT, "whole_counts": "yes", "duty_quantum": 1e-3, "filter_weight": 0.8, "duty_limit": 0.97,
        "proportional_gain": P / (4000.0 * COUNT), "deadband_angle": zone * COUNT, "minimum_duty": startup / 1000.0,
        "overload_duty": 0.8, "overload_time": 2.0, "overload_output": 0.2, "stall_travel": 50.0 * COUNT}
    return digital(firmware | more, friction=friction)


def goal(counts):
    """Return a constant goal, in counts."""
    return st.signals.constant(counts * COUNT, unit="rad")


def standing(model, command, duration, **more):
    """Return the result of a servo that starts at angle 0, sampled every millisecond."""
    return st.simulate(model, command, duration=duration, initial={"output_angle": 0.0}, **more)
