"""An episode of an SO-101 runs on servos with LeRobot's registers where they have the factory's: assumed, and said."""

import pytest

import servotwin as st
from servotwin.robots import Motion, Mount
from servotwin.robots.run import as_motion_says

STS = "feetech-sts3215-7v4"


def nod(robot):
    angles = {"elbow_flex": [0.0, 0.1], "gripper": [0.0, 0.1]}
    return Motion(time=[0.0, 1.0], angles=angles, source="a nod", robot=robot)


@pytest.mark.parametrize(("robot", "sets"), [
    ("so101_follower", "lerobot and lerobot-gripper"), ("bi_so100_follower", "lerobot and lerobot-gripper"),
    ("koch_follower", ""), ("", "")])
def test_the_registers_follow_from_the_robot(robot, sets):
    mounts = {joint: Mount(st.DigitalServo(st.load_servo(STS)), zero=0.1) for joint in ("elbow_flex", "gripper")}
    found, said = as_motion_says(mounts, nod(robot))
    assert said == ((f"registers assumed as LeRobot writes them for {robot} (set {sets}), not the factory's",)
                    if sets else ())
    for joint, name in (("elbow_flex", "lerobot"), ("gripper", "lerobot-gripper")):
        expected = st.feetech_sts(name if sets else {}, servo=STS)
        assert found[joint].model.servo.firmware == expected.firmware
        assert found[joint].zero == 0.1


def test_servos_that_were_set_stay_as_they_are():
    mounts = {"elbow_flex": Mount(st.DigitalServo(st.feetech_sts("lerobot", servo=STS))),
              "gripper": Mount(st.DigitalServo(st.load_servo("dynamixel-xl330-m288")))}
    assert as_motion_says(mounts, nod("so101_follower")) == (mounts, ())
