"""The bench's servos, loads and recordings as a user of the package would describe them."""

from __future__ import annotations

import math
from typing import Any

import servotwin as st

from .rig import SAMPLE, Load, Recording, Servo

REDUCTION = 280.0
_VOLTAGE_PER_ANGLE = 0.42  # V/rad: only its product with the one-shot's slope acts


def servo_of(servo: Servo, period: float = 0.02, name: str = "of the bench", *, given: bool = False) -> st.Servo:
    """Return the servo file of a servo of the bench; a digital one is described as analog.

    `given` says that the supply's resistance, viscous friction and friction at rest are known, 0 or not; else they are
    assumed, as in most files.
    """
    N = REDUCTION
    groups: dict[str, dict[str, Any]] = {
        "motor": {"armature_resistance": servo.R, "torque_constant": servo.K / N, "back_emf_constant": servo.K / N,
                  "rotor_inertia": servo.J / N**2, "motor_viscous_friction": servo.B / N**2},
        "gear": {"gear_reduction": N},
        "friction": {"coulomb_torque_forward": servo.forward / N, "coulomb_torque_backward": servo.backward / N,
                     "breakaway_ratio": servo.breakaway},
        "electronics": {"one_shot_slope": servo.slope / _VOLTAGE_PER_ANGLE, "one_shot_offset": servo.zero,
                        "stretcher_gain": servo.gain, "deadband": servo.deadband, "minimum_drive_time": servo.t_min,
                        "frame_period": period, "off_state": "coast" if servo.coasts else "brake"},
        "potentiometer": {"feedback_gain": _VOLTAGE_PER_ANGLE, "feedback_offset": 0.0},
        "supply": {"open_circuit_voltage": servo.V_oc, "bridge_drop_voltage": servo.V_ce0},
    }
    more = {"friction.load_friction": servo.load_share, "friction.load_friction_motor": servo.motor_share,
            "friction.load_friction_external": servo.external_share, "gear.backlash": servo.play,
            "gear.output_inertia": servo.wheel, "potentiometer.backlash": servo.wiper_play,
            "friction.stribeck_speed": servo.stribeck * N,
            "supply.internal_resistance": servo.R_b, "supply.bridge_drop_resistance": servo.r_c,
            "motor.brush_drop_voltage": servo.V_br}
    for dotted, value in more.items():
        if value:
            groups[dotted.split(".")[0]][dotted.split(".")[1]] = value
    if math.isfinite(servo.timeout):
        groups["electronics"]["pulse_timeout"] = servo.timeout
    made = st.servo_from_values(name, groups)
    return made.replace({"supply.internal_resistance": servo.R_b, "motor.motor_viscous_friction": servo.B / N**2,
                         "friction.breakaway_ratio": servo.breakaway}) if given else made


def load_of(load: Load) -> st.loads.Load:
    """Return a load of the bench."""
    made = st.loads.Inertia(load.inertia) + st.loads.Constant(load.torque) + st.loads.Viscous(load.viscous)
    if load.gravity:  # the arm's inertia is counted above
        length = 0.2
        made = made + st.loads.Pendulum(mass=load.gravity / 9.80665 / length, length=length, inertia=0.0,
                                        hanging_angle=load.hanging)
    return made


def log_of(recording: Recording, load: Load, name: str, motion: str = "", **more: Any) -> st.Log:
    """Return a recording as a log of pulse widths and angles."""
    return st.Log(name=name, motion=motion, time=recording.time, command=recording.command,
                  command_kind="pulse_width", measured={"output_angle": recording.angle}, load=load_of(load), **more)


__all__ = ["SAMPLE", "load_of", "log_of", "servo_of"]
