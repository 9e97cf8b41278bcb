"""A robot with ideal actuators: it is on its motion, and its torques are those of mechanics."""

import copy
import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Motion, ServoDrive
from servotwin.robots.tracking import blend_window, course, ideal_run

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
DT, G, START = 1e-3, 9.81, -0.1
SERVO = st.BoundedServo(st.load_servo("hitec-hs-755hb"))


def weight(mass=0.2, length=0.1, joint='axis="0 -1 0"', more=""):
    """Return a weight on a hinge that turns upwards from the horizontal, or on a slide."""
    return f"""<mujoco><option timestep="{DT}" gravity="0 0 {-G}"/><worldbody>{more}<body name="lever">
      <joint name="a" {joint}/><inertial pos="{length} 0 0" mass="{mass}" diaginertia="1e-6 1e-6 1e-6"/>
      </body></worldbody></mujoco>"""


def motion_of(values, duration=1.0, joint="a"):
    time = np.linspace(0.0, duration, len(values))
    return Motion(time=time, angles={joint: np.asarray(values, dtype=np.float64)}, source="test")


def ideal(xml, motion, servos=None, **options):
    drive = ServoDrive(mujoco.MjModel.from_xml_string(xml), servos or {"a": SERVO})
    time = np.arange(START, motion.duration + 0.1, drive.model.opt.timestep)
    return drive.model, ideal_run(drive.model, drive.joints, motion, time, **options)


@pytest.mark.parametrize(("step", "window"), [(1.0, 0.1), (1.0 / 30.0, 1.0 / 15.0), (0.01, 0.05), (1e-3, 0.05)])
def test_the_window_goes_with_the_samples(step, window):
    motion = Motion(time=[0.0, step, 2.0 * step], angles={"a": [0, 1, 0]}, source="")
    assert blend_window(motion) == pytest.approx(window)


WAVY = motion_of(np.random.default_rng(1).uniform(-1.0, 1.0, 7))


@pytest.mark.parametrize("window", [0.05, 0.1])
def test_speed_and_acceleration_belong_to_the_angle(window):
    time = np.linspace(-0.2, 1.2, 14001)
    found = course(WAVY, "a", time, window)
    np.testing.assert_allclose(np.gradient(found.angle, time)[1:-1], found.speed[1:-1], atol=0.01)
    away = np.min(np.abs(time[:, None] - np.add.outer([-window / 2, window / 2], WAVY.time).ravel()), axis=1) > 2e-4
    np.testing.assert_allclose(np.gradient(found.speed, time)[away], found.acceleration[away], rtol=1e-9, atol=1e-9)


def test_away_from_the_corners_it_is_the_motion():
    time = np.linspace(-0.2, 1.2, 1401)
    found = course(WAVY, "a", time, 0.1)
    away = np.min(np.abs(time[:, None] - WAVY.time), axis=1) >= 0.05
    np.testing.assert_allclose(found.angle[away], WAVY.at("a", time[away]), atol=1e-14)
    assert np.all(found.acceleration[away & (time % 0.5 > 0.06)] == pytest.approx(0.0, abs=1e-12))


@pytest.mark.parametrize(("mass", "length", "middle"), [(0.2, 0.1, 0.0), (0.5, 0.05, 0.8), (0.05, 0.3, -1.2)])
def test_a_lever_takes_its_weight_and_its_inertia(mass, length, middle):
    model, found = ideal(weight(mass, length), motion_of(middle + np.sin(np.linspace(0.0, 6.0, 201))))
    way = found.courses["a"]
    J = mass * length**2 + 1e-6 + model.dof_armature[0]
    expected = mass * G * length * np.cos(way.angle) + J * way.acceleration
    np.testing.assert_allclose(found.torque["a"], expected, atol=1e-9)
    np.testing.assert_allclose(found.poses[:, 0], way.angle, atol=1e-12)
    assert found.touches == ()


def test_a_slide_takes_a_force():
    servos = {"a": st.robots.Mount(SERVO, ratio=0.01)}
    model, found = ideal(weight(joint='type="slide" axis="0 0 1"'), motion_of([0.0, 0.05]), servos)
    expected = (0.2 + model.dof_armature[0]) * found.courses["a"].acceleration + 0.2 * G
    np.testing.assert_allclose(found.torque["a"], expected, atol=1e-9)


LINKS = f"""<mujoco><option timestep="{DT}" integrator="Euler"/><worldbody>
  <body><joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .15 0 0" size=".01" mass=".1"/>
    <body pos=".15 0 0"><joint name="free" axis="0 1 0" damping="1e-4"/>
      <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".1"/></body></body>
  <body pos="1 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""


def test_its_torques_move_the_robot_along_its_motion():
    """Forward dynamics under the torques, with a link that hangs free and a ball that falls."""
    model, found = ideal(LINKS, motion_of(0.5 * (1.0 - np.cos(np.linspace(0.0, 6.0, 101)))))
    data, moved = mujoco.MjData(model), []
    for torque in found.torque["a"]:
        moved.append(data.qpos.copy())
        data.qfrc_applied[0] = torque
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(np.array(moved)[:, :2], found.poses[:, :2], atol=5e-3)  # of Euler's steps
    assert np.ptp(found.poses[:, 1]) > 0.5
    assert found.poses[-1, 4] == pytest.approx(-0.5 * G * (found.time[-1] - START) ** 2, rel=2e-3)


WALL = '<geom name="wall" type="box" size=".02 .1 .02" pos=".1 0 -.06"/>'


def test_what_does_not_yield_is_told_and_does_not_count():
    ball = weight().replace("</body>", '<geom size=".02" pos=".1 0 0"/></body>')
    down = motion_of(np.linspace(0.0, -0.6, 11))
    _, free = ideal(ball, down)
    _, met = ideal(ball.replace("<worldbody>", f"<worldbody>{WALL}"), down)
    np.testing.assert_allclose(met.torque["a"], free.torque["a"], atol=1e-9)
    (touch,) = met.touches
    assert (touch.first, touch.second) == ("lever", "what is fixed")
    assert touch.time == pytest.approx(0.3, abs=0.1)
    assert "lever runs into what is fixed" in touch.words
    assert free.touches == ()


@pytest.mark.long
def test_what_yields_counts():
    """A ball in free space that rests on the lever weighs on it."""
    resting = f"""<mujoco><option timestep="{DT}"/><worldbody>
      <body name="lever"><joint name="a" axis="0 -1 0"/>
        <geom type="box" size=".1 .1 .01" pos=".1 0 0" mass=".1"/></body>
      <body pos=".1 0 .03"><joint type="slide" axis="0 0 1"/><geom size=".02" mass=".3"/></body></worldbody></mujoco>"""
    _, found = ideal(resting, motion_of([0.0, 0.0]))
    assert found.torque["a"][-1] == pytest.approx(0.4 * G * 0.1, rel=0.01)
    assert found.touches == ()


def test_the_model_stays_as_it_is():
    drive = ServoDrive(mujoco.MjModel.from_xml_string(weight()), {"a": SERVO})
    before = copy.copy(drive.model)
    ideal_run(drive.model, ("a",), motion_of([0.0, 1.0]), np.arange(0.0, 0.1, DT))
    assert (before.dof_armature == drive.model.dof_armature).all()
    assert (before.jnt_limited == drive.model.jnt_limited).all()


@pytest.mark.parametrize("window", [0.0, -1.0, math.nan, math.inf])
def test_the_window_is_positive(window):
    with pytest.raises(InputError, match="window"):
        ideal(weight(), motion_of([0.0, 1.0]), window=window)
