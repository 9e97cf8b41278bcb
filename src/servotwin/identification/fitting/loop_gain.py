"""The gain that a log says its servo's loop had, as the firmware has it: runs at several gains tell of one plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from servotwin.logs.bam_actuators import writes_gain
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.parameters.registers import REGISTER_FAMILIES
from servotwin.units import is_finite

GAIN = "firmware.proportional_gain"
_REGISTERS = {"feetech-sts": "P_Coefficient", "dynamixel-x": "Position_P_Gain", "dynamixel-mx": "P_Gain",
              "dynamixel-xl320": "P_Gain"}
_LOOP = ("electronics.stretcher_gain", "electronics.one_shot_slope", "electronics.frame_period")
_OF_PULSES = ("electronics.", "potentiometer.")


def with_loop_gain(log: Log, model: Model) -> Log:
    """Return a log of a servo on a bus with the gain of its loop as a number of the firmware.

    A log's condition `gain` is the register for P: of a servo whose sheet names its registers it makes the duty per
    angle as they do, and of others as the log's convention of pulses does, times the error_gain_ratio of a file of
    BAM. What stands for pulses in such a log is left out: a bus servo has none.

    Parameters
    ----------
    log : Log
    model : Model
        Other models, and logs that say their gain themselves or none at all, are left as they are.

    Raises
    ------
    ParameterError
        If the register cannot have this value.
    """
    if not isinstance(model, DigitalServo) or not model.takes_goals:
        return log
    own = {name: value for name, value in log.parameters.items() if not name.startswith(_OF_PULSES)}
    if GAIN not in own:
        gain = _of_registers(model.servo, log)
        gain = _of_pulses(log, model.servo) if gain is None else gain
        own |= {} if gain is None else {GAIN: gain}
    return log if len(own) == len(log.parameters) and GAIN in log.parameters else replace(log, parameters=own)


def _of_registers(servo: Servo, log: Log) -> float | None:
    written, family = log.conditions.get("gain"), str(servo.sheet.get("registers", ""))
    if not is_finite(written) or family not in _REGISTERS or not writes_gain(log.conditions.get("motor")):
        return None
    value = REGISTER_FAMILIES[family]({_REGISTERS[family]: written}, servo=servo).get(GAIN)  # type: ignore[dict-item]
    return float(value) if isinstance(value, int | float) else None


def _of_pulses(log: Log, servo: Servo) -> float | None:
    """Return the duty per angle of a chip that stretches K s_µ per angle in each frame [1/rad]."""
    K, s_mu, T_f = (log.parameters.get(name) for name in _LOOP)
    p = log.parameters.get("potentiometer.feedback_gain")
    rig = servo.sheet.get("bam")
    ratio = rig.get("error_gain_ratio", 1.0) if isinstance(rig, Mapping) else 1.0
    return None if K is None or s_mu is None or T_f is None or p is None else K * s_mu * p / T_f * ratio
