"""What cannot be is refused in one line, before anything runs, or told by the joint that it happened at."""

import sys

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import hinge, links, servo
from servotwin.errors import InputError, MissingExtraError, SimulationError, UnknownNameError

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")


@pytest.fixture(autouse=True)
def no_callback():
    yield
    mujoco.set_mjcb_control(None)


PULSE = servo(st.PulseServo)
TWO_AT_ONE = '<actuator><motor joint="elbow"/><position joint="elbow" name="pull"/></actuator>'
BALL = """<mujoco><worldbody><body><joint name="wrist" type="ball"/><geom size=".1"/></body></worldbody></mujoco>"""
TENDON = """<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
  <tendon><fixed name="cord"><joint joint="a" coef="1"/></fixed></tendon></mujoco>"""
STIFF = hinge(joint='axis="0 1 0" damping="0.3" frictionloss="0.1"')
BATTERY = st.Supply(open_circuit_voltage=6.0)


@pytest.mark.parametrize(("xml", "servos", "more", "message"), [
    (links(), {"elbw": PULSE}, {}, "unknown joint 'elbw'; did you mean 'elbow'"),
    (BALL, {"wrist": PULSE}, {}, "joint wrist: got 'a ball joint', allowed: a hinge or a slide"),
    (TENDON, {"cord": PULSE}, {}, "joint cord: got 'a tendon'"),
    (links(actuators=TWO_AT_ONE), {"elbow": PULSE}, {}, "actuators of joint elbow: got .*pull.* allowed: one"),
    (STIFF, {"elbow": PULSE}, {}, "damping of joints with servos: got 'elbow 0.3', allowed: 0"),
    (STIFF, {"elbow": PULSE}, {"joint_friction": "ignore"}, "joint_friction: got 'ignore'"),
    (hinge(dt=0.03), {"elbow": PULSE}, {}, "timestep of the model: got 0.03, allowed: at most a frame"),
    (hinge(), {}, {}, "servos of a ServoDrive"),
    (hinge(), [PULSE], {}, "servos of a ServoDrive"),
    (hinge(), {"elbow": "hitec-hs-755hb"}, {}, "servo of a joint: got 'hitec-hs-755hb'"),
    (hinge(), {"elbow": st.DCMotor(st.load_servo("hitec-hs-755hb"))}, {}, "servo of a joint"),
    (hinge(), {"elbow": PULSE}, {"bus": 6.0}, "bus: got 6.0, allowed: a Supply"),
    (hinge(), {"elbow": PULSE}, {"bus": [(BATTERY, ["knee"])]}, "unknown joint with a servo 'knee'"),
    (hinge(), {"elbow": PULSE}, {"bus": [(BATTERY, ["elbow"]), (BATTERY, ["elbow"])]}, "bus of joint elbow: got 'two'"),
    (links(), {"elbow": PULSE, "shoulder": servo(st.DigitalServo)}, {"bus": BATTERY}, "joint shoulder on a bus"),
    (hinge(), {"elbow": PULSE}, {"controls": {"elbow": st.robots.CommandMap("elbow", -1.0, 1.0)}}, "no actuator"),
    (hinge(), {"elbow": PULSE}, {"controls": {"knee": 1.0}}, "unknown joint with a servo 'knee'"),
])
def test_what_a_drive_refuses(xml, servos, more, message):
    model = mujoco.MjModel.from_xml_string(xml)
    before = model.dof_armature.copy(), model.dof_damping.copy()
    with pytest.raises(InputError, match=message) as caught:
        st.robots.ServoDrive(model, servos, **more)
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(model.dof_armature, before[0])
    np.testing.assert_array_equal(model.dof_damping, before[1])


@pytest.mark.parametrize(("arguments", "message"), [
    ({"ratio": 0.0}, "ratio of a servo"), ({"ratio": float("nan")}, "ratio of a servo"),
    ({"direction": 0}, "direction of a servo"), ({"zero": float("inf")}, "zero of a servo")])
def test_what_a_mount_refuses(arguments, message):
    with pytest.raises(InputError, match=message):
        st.robots.Mount(PULSE, **arguments)


def test_no_model_is_refused():
    with pytest.raises(InputError, match="model of a ServoDrive: got 'str'"):
        st.robots.ServoDrive("arm.xml", {"elbow": PULSE})


@pytest.mark.long
def test_friction_of_the_joint_is_cleared_or_kept():
    for how, left in (("clear", 0.0), ("keep", 0.3)):
        model = mujoco.MjModel.from_xml_string(STIFF)
        st.robots.ServoDrive(model, {"elbow": PULSE}, joint_friction=how)
        assert model.dof_damping[0] == left


def arm():
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(hinge()), {"elbow": PULSE})
    return drive, mujoco.MjData(drive.model)


@pytest.mark.long
@pytest.mark.parametrize(("field", "value"), [("qpos", np.nan), ("qvel", np.inf), ("qpos", 1e300)])
def test_numbers_that_are_none_are_told(field, value):
    drive, data = arm()
    drive.step(data, 5)
    getattr(data, field)[0] = value
    with pytest.raises(SimulationError, match="MuJoCo has met a number that is not finite, or too large"):
        drive.step(data)
    drive.step(data, 5)  # it has started anew
    assert np.isfinite(data.qpos[0])
    mujoco.set_mjcb_control(drive.callback())
    getattr(data, field)[0] = np.nan
    mujoco.mj_forward(drive.model, data)
    with pytest.raises(SimulationError, match="joint elbow: its angle, speed or command in MuJoCo is not a number"):
        drive.check(data)
    drive.check(data)  # told once


@pytest.mark.long
def test_a_control_that_is_no_number_is_told():
    actuator = '<actuator><motor joint="elbow"/></actuator>'
    xml = hinge().replace("</mujoco>", f"{actuator}</mujoco>")
    drive = st.robots.ServoDrive(mujoco.MjModel.from_xml_string(xml), {"elbow": PULSE})
    data = mujoco.MjData(drive.model)
    data.ctrl[0] = np.nan
    with pytest.raises(SimulationError, match="joint elbow: its angle, speed or command"):
        drive.step(data)
    data.ctrl[0] = 0.1
    drive.step(data, 5)


@pytest.mark.long
def test_a_step_that_gets_longer_than_a_frame_is_told():
    drive, data = arm()
    drive.step(data, 5)
    drive.model.opt.timestep = 0.05
    with pytest.raises(SimulationError, match="longer than a frame"):
        drive.step(data)


@pytest.mark.long
def test_one_callback_at_a_time():
    (one, data), (other, more) = arm(), arm()
    mujoco.set_mjcb_control(one.callback())
    one.step(data)
    with pytest.raises(InputError, match="control callback: got \"another drive's\""):
        other.step(more)
    with pytest.raises(InputError, match="control callback"):
        other.callback()
    mujoco.set_mjcb_control(None)
    other.step(more)
    one.step(data)
    mujoco.set_mjcb_control(lambda model, data: None)
    for call in (lambda: one.step(data), lambda: other.step(more), one.callback):
        with pytest.raises(InputError, match="one that is not this drive's"):
            call()


@pytest.mark.long
@pytest.mark.parametrize(("call", "message"), [
    (lambda drive, data: drive.command(data, {"elbo": 1.0}), "unknown joint with a servo 'elbo'; did you mean 'elbow'"),
    (lambda drive, data: drive.command(data, {"elbow": np.nan}), "goal of joint elbow"),
    (lambda drive, data: drive.result(data), "no record"),
    (lambda drive, data: drive.restore(data, 3), "restore"),
    (lambda drive, data: drive.torque("data"), "data: got 'str'"),
    (lambda drive, data: drive.step("data"), "data: got 'str'"),
    (lambda drive, data: drive.step(mujoco.MjData(mujoco.MjModel.from_xml_string(links()))), "another model"),
    (lambda drive, data: drive.step(data, -1), "steps"),
    (lambda drive, data: drive.step(data, 1.5), "steps"),
    (lambda drive, data: drive.torque(mujoco.MjData(mujoco.MjModel.from_xml_string(links()))), "another model"),
])
def test_what_its_calls_refuse(call, message):
    drive, data = arm()
    with pytest.raises(InputError, match=message):
        call(drive, data)
    assert isinstance(UnknownNameError("a", "b", ["c"]), InputError)


def test_a_missing_package_is_told_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"mujoco is needed for this: pip install 'servotwin\[robots\]'"):
        st.robots.ServoDrive(None, {"elbow": PULSE})


@pytest.mark.long
def test_memory_of_data_that_is_gone_is_given_up():
    drive, _ = arm()
    for k in range(50):
        data = mujoco.MjData(drive.model)
        assert not drive._harbour.of(data).block.any()  # it was told nothing
        drive.command(data, {"elbow": 0.1 * (k % 5)})
        drive.step(data)
        del data
    assert len(drive._harbour._found) <= 2
