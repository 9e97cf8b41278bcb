"""The mobile robot: it stands, rolls and does not slip; rounds of waypoints with equal and unequal servos."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import (
    Mount,
    Odometry,
    Pose,
    ServoDrive,
    ideal_waypoints,
    mobile_robot,
    run_waypoints,
    unequal_servos,
    wheel_servo,
)
from servotwin.robots.mjcf_models import MASS, TRACK, WHEEL_RADIUS, WHEELS

mujoco = pytest.importorskip("mujoco")

NEW = wheel_servo()
ERRORS = [(6e-5, 6e-5), (5e-4, 5e-4), (1e-4, -1e-4), (6e-5, 1.5e-4)]  # s of each wheel from its neutral pulse


@pytest.fixture
def robot():
    drive = ServoDrive(mujoco.MjModel.from_xml_string(mobile_robot(scene=False)), {
        "left_wheel": NEW, "right_wheel": Mount(NEW, direction=-1)})
    data = mujoco.MjData(drive.model)
    drive.step(data, 100)
    return drive, data


def pose_of(data):
    w, x, y, z = data.qpos[3:7]
    return Pose(data.qpos[0], data.qpos[1], math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


@pytest.mark.long
def test_it_weighs_what_it_is_made_of_and_stands_on_three_points(robot):
    drive, data = robot
    assert float(drive.model.body_mass.sum()) == pytest.approx(MASS)
    assert data.ncon == 3
    assert data.qpos[2] == pytest.approx(WHEEL_RADIUS, abs=1e-5)
    np.testing.assert_allclose(data.qpos[:2], 0.0, atol=1e-5)
    assert st.robots.robot_model("mobile").ncam == 1


@pytest.mark.long
@pytest.mark.parametrize(("left", "right"), ERRORS)
def test_wheels_neither_slip_nor_bounce(robot, left, right):
    # where odometry of the true angles of the wheels has the robot is where it is
    drive, data = robot
    drive.command(data, {"left_wheel": NEW.neutral_pulse + left, "right_wheel": NEW.neutral_pulse - right})
    wheels, before, turned, heights = Odometry(radius=WHEEL_RADIUS, track=TRACK), data.qpos[-2:].copy(), 0.0, []
    pose = start = pose_of(data)
    for _ in range(300):
        drive.step(data, 5)
        pose = wheels.step(pose, *(data.qpos[-2:] - before))
        turned += np.abs(data.qpos[-2:] - before).sum()
        before = data.qpos[-2:].copy()
        heights.append(data.qpos[2])
    way = 0.5 * turned * WHEEL_RADIUS
    assert way > 0.03
    now = pose_of(data)
    assert math.hypot(pose.x - now.x, pose.y - now.y) < 1e-3 * way
    turned = abs(pose.heading - start.heading)
    assert abs(math.remainder(pose.heading - now.heading, math.tau)) < 1e-3 * max(turned, 1.0)
    assert np.ptp(heights) < 2e-5


@pytest.mark.long
def test_constant_unequal_speeds_drive_the_arc_of_the_textbook(robot):
    drive, data = robot
    drive.command(data, {"left_wheel": NEW.neutral_pulse + 1e-4, "right_wheel": NEW.neutral_pulse - 5e-4})
    drive.step(data, 500)
    places, angles = [], data.qpos[-2:].copy()
    for _ in range(200):
        drive.step(data, 20)
        places.append(data.qpos[:2].copy())
    left, right = data.qpos[-2:] - angles
    radius = 0.5 * TRACK * (right + left) / (right - left)
    x, y = np.array(places).T
    (a, b, c), *_ = np.linalg.lstsq(np.stack([2.0 * x, 2.0 * y, np.ones_like(x)], axis=1), x * x + y * y)
    assert math.sqrt(c + a * a + b * b) == pytest.approx(radius, rel=2e-3)


@pytest.mark.long
def test_a_straight_line_with_equal_servos_is_straight():
    run = run_waypoints(waypoints=[(0.0, 0.0), (0.4, 0.0)], encoders=4096)
    assert run.off_path.max() < 1e-3
    assert run.missed < 0.021
    assert 0.4 / 0.08 - 0.5 < run.arrived < 0.4 / 0.08 + 0.5
    assert run.time[-1] == pytest.approx(run.arrived + 0.5, abs=0.021)
    np.testing.assert_allclose(run.path[-1], run.path[-5], atol=1e-4)  # and it stands
    np.testing.assert_allclose(np.round(1e6 * run.pulses), 1e6 * run.pulses, atol=1e-6)
    assert len(run.poses) == len(run.time) == len(run.pulses)
    width = run.record["left_wheel"]["pulse_width"]
    assert width[10] == run.pulses[0, 0]
    assert run.record.time[-1] == pytest.approx(run.time[-1])


@pytest.mark.long
def test_unequal_servos_lead_a_robot_astray_that_believes_in_its_pulses():
    corner = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2)]
    equal, unequal = run_waypoints(None, corner), run_waypoints(unequal_servos(), corner)
    assert equal.missed < 0.03
    assert unequal.missed > 0.05
    for run in (equal, unequal):  # both believe to have come there
        assert math.hypot(*(run.believed[-1, :2] - run.waypoints[-1])) < 0.021
        assert run.off_belief[-1] == pytest.approx(math.hypot(*(run.path - run.believed)[-1, :2]))
    assert abs(unequal.turned_astray) > 0.3 > 20.0 * abs(equal.turned_astray)


@pytest.mark.long
def test_encoders_bring_unequal_servos_there():
    run = run_waypoints(unequal_servos(), [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2)], encoders=512)
    step = math.tau / 512 * WHEEL_RADIUS
    assert run.off_belief.max() < 3.0 * step
    assert run.missed < 0.021 + 3.0 * step
    assert not np.isnan(run.arrived)


def test_ideal_wheels_know_where_they_are():
    run = ideal_waypoints()
    assert run.off_belief.max() < 1e-12
    assert run.missed < 0.02
    assert run.off_path.max() < 0.03
    assert (run.record, run.poses.size) == (None, 0)
    np.testing.assert_array_equal(run.wheel_speeds[1:], run.asked_speeds[:-1])


@pytest.mark.slow
def test_a_whole_round_with_all_of_it():
    equal, led = run_waypoints(encoders=512), run_waypoints(unequal_servos(), encoders=512)
    for run in (equal, led):
        assert run.missed < 0.025
        assert run.off_path.max() < 0.04
    astray = run_waypoints(unequal_servos(), bus=st.Supply(open_circuit_voltage=6.0, internal_resistance=0.3))
    assert astray.missed > 0.2
    assert astray.record["left_wheel"]["bus_voltage"].min() < 5.9


@pytest.mark.parametrize(("wrong", "text"), [
    ({"servos": [NEW]}, "two models, left and right"),
    ({"servos": [NEW, st.PulseServo(st.load_servo("hitec-hs-755hb"))]}, "servo of a wheel"),
    ({"servos": [NEW, st.PulseServo(NEW.servo.replace({"electronics.frame_period": 0.015}))]}, "frame_period"),
    ({"speed": 1.0}, "speed of the mobile robot: got 1.0, allowed: at most 0.116 m/s"),
    ({"encoders": 0}, "counts of a turn"), ({"duration": -1.0}, "duration"), ({"pulse_resolution": -1.0}, "resolution"),
    ({"waypoints": [(0.0, 0.0)]}, "at least two pairs")])
def test_bad_input(wrong, text):
    with pytest.raises(InputError, match=text):
        run_waypoints(**wrong)


def test_the_wheels_are_where_the_odometry_has_them():
    model = mujoco.MjModel.from_xml_string(mobile_robot())
    places = np.array([model.body(name).pos for name in WHEELS])
    np.testing.assert_allclose(places, [[0.0, 0.5 * TRACK, 0.0], [0.0, -0.5 * TRACK, 0.0]])
    np.testing.assert_allclose(model.geom("left_wheel").size[:2], WHEEL_RADIUS)
