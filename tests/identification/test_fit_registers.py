"""Logs of an SO-100 or SO-101 are of servos with LeRobot's registers: assumed, and said."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.identification import validate
from servotwin.identification.fitting.registers import as_logs_say, of_no_robot
from servotwin.models import default_model

STS = "feetech-sts3215-7v4"


def log(joint="elbow_flex", robot="so101_follower", **more):
    t = np.linspace(0.0, 0.5, 26)
    return st.Log(name=f"{joint} of {robot or 'none'}", time=t, command_kind="angle",
                  command=np.where(t < 0.1, 0.0, 0.2),
                  measured={"output_angle": 0.2 * (1.0 - np.exp(-t / 0.1))},
                  conditions={"joint": joint, **({"robot": robot} if robot else {}), **more})


@pytest.mark.parametrize(("logs", "servo", "registers"), [
    ([log()], STS, "lerobot"), ([log(robot="so100")], STS, "lerobot"), ([log("gripper")], STS, "lerobot-gripper"),
    ([log("gripper"), log()], STS, "lerobot"), ([log(robot="koch_follower")], STS, None), ([log(robot="")], STS, None),
    ([log(), log(robot="so100")], STS, None), ([log()], "dynamixel-xl330-m288", None),
    ([log()], "hitec-hs-755hb", None),
])
def test_the_registers_follow_from_the_robot(logs, servo, registers):
    model = default_model(st.load_servo(servo))
    found, said = as_logs_say(model, logs)
    if registers is None:
        assert found is model
        assert said == ()
        return
    assert found.servo.firmware == st.feetech_sts(registers, servo=servo).firmware
    gain = found.servo.source("firmware.proportional_gain")
    assert gain.origin == "assumed"
    assert "P_Coefficient (21) = 16 assumed" in gain.source
    assert said == (f"registers assumed as LeRobot writes them for {logs[0].conditions['robot']} (set {registers}), "
                    "not the factory's",)


def test_a_servo_whose_registers_were_written_keeps_them():
    model = st.DigitalServo(st.feetech_sts({"P_Coefficient": 20}, servo=STS))
    assert as_logs_say(model, [log()]) == (model, ())
    factory = st.DigitalServo(st.load_servo(STS))
    assert as_logs_say(factory, of_no_robot([log()])) == (factory, ())


@pytest.mark.long
def test_validate_says_it():
    found = validate([log()], st.load_servo(STS))
    assert found.warnings[0].startswith("registers assumed as LeRobot writes them for so101_follower (set lerobot)")
    assert found.servo.firmware.proportional_gain == pytest.approx(16 / (4000 * 2 * math.pi / 4096))
    said = validate([log()], st.feetech_sts({"P_Coefficient": 20}, servo=STS))
    assert not any("registers" in text for text in said.warnings)
