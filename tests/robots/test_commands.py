"""What a control asks of a servo: an angle is followed, what is no angle is refused, what is changed is told."""


import mujoco
import pytest

import servotwin as st
from robots.robots_cases import hinge, servo
from servotwin.errors import InputError
from servotwin.robots import CommandMap, Motion, ServoDrive, run_motion, wheel_servo

DIGITAL = servo(st.DigitalServo)


def driven(actuator, mount=DIGITAL, **more):
    xml = hinge().replace("</mujoco>", f"<actuator>{actuator}</actuator></mujoco>")
    drive = ServoDrive(mujoco.MjModel.from_xml_string(xml), {"elbow": mount}, **more)
    return drive, mujoco.MjData(drive.model)


@pytest.mark.parametrize(("actuator", "words"), [
    ('<motor joint="elbow"/>', "elbow: control -inf to inf is -inf to inf rad"),
    ('<position joint="elbow" kp="5" ctrlrange="-1 2"/>', "elbow: control -1 to 2 is -1 to 2 rad"),
    ('<position joint="elbow" kp="5" gear="2" ctrlrange="-1 2"/>', "elbow: control -1 to 2 is -0.5 to 1 rad"),
    ('<dcmotor joint="elbow" motorconst="1 1" resistance="2" input="pos" controller="3 0 1 0 0 12" ctrlrange="-1 1"/>',
     "elbow: control -1 to 1 is -1 to 1 rad")])
def test_what_a_control_means_can_be_printed(actuator, words):
    drive, _ = driven(actuator)
    assert str(drive.maps["elbow"]) == words
    again = ServoDrive(drive.model, {"elbow": DIGITAL}, controls=drive.maps)
    assert again.maps == drive.maps


@pytest.mark.parametrize("actuator", [
    '<motor joint="elbow" ctrlrange="-1 1"/>', '<velocity joint="elbow" kv="2" ctrlrange="-3 3"/>',
    '<intvelocity joint="elbow" kp="2" actrange="-1 1" ctrlrange="-3 3"/>',
    '<dcmotor joint="elbow" motorconst="1 1" resistance="2" ctrlrange="-12 12"/>'])
def test_a_range_that_is_no_angle_is_refused(actuator):
    """-1.2 rad became -1.0 at the range of a torque motor."""
    with pytest.raises(InputError, match=r"control range of the actuator at joint elbow: got '-\d+ to \d+, which is"):
        driven(actuator)
    low, high = -1.0, 1.0
    drive, data = driven(actuator, controls={"elbow": CommandMap("elbow", low, high, scale=1.5)})
    drive.command(data, {"elbow": -1.2})
    assert data.ctrl[0] == pytest.approx(-0.8)


def test_a_wheel_takes_a_range_of_pulses_alone():
    wheel = wheel_servo()
    for span, fits in (("0.001 0.002", True), ("-1 1", False)):
        actuator = f'<motor joint="elbow" ctrlrange="{span}"/>'
        if fits:
            assert str(driven(actuator, wheel)[0].maps["elbow"]) == "elbow: control 0.001 to 0.002 is 0.001 to 0.002 s"
        else:
            with pytest.raises(InputError, match="which is no pulse width"):
                driven(actuator, wheel)


def test_a_motion_leaves_the_range_of_a_torque_motor_out():
    xml = hinge().replace("</mujoco>", '<actuator><motor joint="elbow" ctrlrange="-.1 .1"/></actuator></mujoco>')
    motion = Motion(time=[0.0, 0.5], angles={"elbow": [0.2, 0.6]}, source="test")
    run = run_motion(mujoco.MjModel.from_xml_string(xml), {"elbow": DIGITAL}, motion, settle=0.2)
    assert run.notes == ("control range of the actuator at joint elbow is left out: -0.1 to 0.1, which is no angle",)
    assert run.poses[-1, 0] == pytest.approx(0.6, abs=0.05)
