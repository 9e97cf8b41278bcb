"""Arms that do tasks: fidelities, controllers, wrong beliefs, and what is told of a run."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.control import Encoder, Reference
from servotwin.errors import InputError
from servotwin.robots import follow, run_task, task_path, two_link
from servotwin.robots.arms.controllers import STEERINGS, Delayed, DrivePort, Plain, RigidBody
from servotwin.robots.arms.task_run import Belief
from servotwin.robots.arms.tasks import circle

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
pytest.importorskip("mink", reason="the extra `robots` is not installed")
SERVO = st.load_servo("hitec-hs-755hb")
ARM = two_link(payload=0.05)


@pytest.fixture(scope="module")
def joints():
    return follow(ARM, circle(ARM.centre, 0.03, speed=0.12, plane=ARM.plane))


def done(joints, model, steering=None, belief=None, **options):
    return run_task(ARM, model, joints.path, steering=steering, believed=belief, settle=0.3, joint_path=joints,
                    **options)


@pytest.mark.long
def test_the_inverse_of_the_papers_servo_is_exact_at_its_joints(joints):
    """(40) as feedforward on the servo that (35)-(41) describe: nothing is left but the steps of the controller."""
    plain = done(joints, st.AveragedServo(SERVO))
    ahead = done(joints, st.AveragedServo(SERVO), STEERINGS["feedforward"]())
    assert plain.metrics.contour_rms > 1e-3
    assert ahead.metrics.contour_rms < 1e-5
    assert ahead.metrics.angle_rms < 0.05 * plain.metrics.angle_rms
    assert math.isnan(plain.metrics.energy)
    assert plain.ideal_contour.largest < 1e-6


@pytest.mark.long(but="feedforward")
@pytest.mark.parametrize("name", ["feedforward", "pid", "computed-torque", "observer"])
def test_every_controller_is_better_than_none(joints, name):
    plain = done(joints, st.PulseServo(SERVO)).metrics
    found = done(joints, st.PulseServo(SERVO), STEERINGS[name]()).metrics
    assert found.contour_rms < 0.6 * plain.contour_rms
    assert found.tool_rms < 0.6 * plain.tool_rms
    assert 0.0 < found.energy < 2.0 * plain.energy
    assert found.effort < 6.0  # V


@pytest.mark.long
def test_wrong_beliefs_cost_accuracy(joints):
    bare = STEERINGS["computed-torque"]()
    right = done(joints, st.PulseServo(SERVO), bare).metrics
    light = done(joints, st.PulseServo(SERVO), bare, Belief(arm=two_link())).metrics
    both = done(joints, st.PulseServo(SERVO), bare, Belief(
        arm=two_link(), parameters={"motor.armature_resistance": 0.7})).metrics
    assert 2.0 * right.contour_rms < light.contour_rms < both.contour_rms


def test_a_shared_supply_sags_for_all(joints):
    supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
    run = done(joints, st.PulseServo(SERVO), bus=supply)
    volts = {joint: run.run.record[joint]["bus_voltage"].min() for joint in ARM.joints}
    assert volts["shoulder"] == pytest.approx(volts["elbow"])
    assert volts["shoulder"] < 5.7


def test_rigid_bodies_by_hand():
    """Gravity of the stretched arm, and its inertia, through mounts that turn the other way round too."""
    arm = two_link()
    mounts = arm.mounts(st.PulseServo(SERVO))
    body = RigidBody(arm.model(), mounts)
    at = np.array([(0.0 - mount.zero) / mount.gain for mount in mounts.values()])
    model = arm.model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(body(at, np.zeros(2), np.zeros(2)), data.qfrc_bias, atol=1e-12)
    assert body.inertia(at) == pytest.approx(model.dof_M0, rel=1e-9)
    turned = {name: st.robots.Mount(mount.model, zero=mount.zero, direction=-1) for name, mount in mounts.items()}
    other = RigidBody(arm.model(), turned)
    at = np.array([(0.0 - mount.zero) / mount.gain for mount in turned.values()])
    np.testing.assert_allclose(other(at, np.zeros(2), np.zeros(2)), -data.qfrc_bias, atol=1e-12)


def port(model, sensors=()):
    mounts = ARM.mounts(model)
    drive = st.robots.ServoDrive(ARM.model(), mounts)
    motion = st.robots.Motion(time=[0.0, 1.0], angles={"shoulder": [0.8, 0.8], "elbow": [-1.3, -1.3]}, source="rest")
    return DrivePort(drive, mounts, motion, settle=0.1, sensors=sensors), mounts


@pytest.mark.long
def test_a_port_measures_and_sends_angles_of_shafts():
    wired, mounts = port(st.PulseServo(SERVO), [Encoder(count=0.0)])
    zero = np.array([mount.zero for mount in mounts.values()])
    np.testing.assert_allclose(wired.measure()["output_angle"], np.array([0.8, -1.3]) - zero)
    assert (wired.takes, wired.frame) == ("command_angle", 0.02)
    wired.send(np.array([1.0, -1.0]) - zero)
    wired.wait(0.6)
    assert wired.time == pytest.approx(0.6)
    np.testing.assert_allclose(wired.data.qpos, [1.0, -1.0], atol=0.15)  # droop and deadband
    np.testing.assert_allclose(wired.measure()["output_angle"], wired.data.qpos - zero, atol=1e-3)


@pytest.mark.long
def test_pulses_are_sent_in_steps():
    wired, mounts = port(st.PulseServo(SERVO))
    zero = mounts["shoulder"].zero
    found = []
    for k in range(41):
        wired.send(np.array([1.0 + 1e-4 * k, 1.0]))
        wired.wait(wired.time + 0.001)
        found.append(wired.drive.look(wired.data, "command_angle")[0])
    steps = np.unique(np.round(found, 9))
    # 1 us is s_r/p of an angle
    assert np.diff(steps) == pytest.approx(1e-6 / (1.35937e-3 * 0.41966), rel=1e-3)
    assert np.abs(np.array(found) - 1.0 - 1e-4 * np.arange(41)).max() <= 0.51 * np.diff(steps).max()
    assert zero < 0.0


@pytest.mark.long
def test_a_port_takes_one_kind_of_command():
    mixed = {"shoulder": st.PulseServo(SERVO), "elbow": st.control.bare_bridge(SERVO)}
    with pytest.raises(InputError, match="servos of one controller: got 'armature_voltage and command_angle'"):
        port(mixed)
    wired, _ = port(st.PulseServo(SERVO))
    with pytest.raises(InputError, match=r"command at 0 s: got .*, allowed: finite numbers"):
        wired.send(np.array([0.1, math.nan]))


def test_a_delayed_path_rests_before_and_after():
    path = Delayed(st.control.quintic([0.0, 1.0], times=[0.0, 2.0]), 0.5)
    assert path.duration == 3.0
    assert path.at(0.2) == Reference(0.0)
    assert path.at(1.5).angle == pytest.approx(0.5)
    assert path.at(2.8).angle == pytest.approx(1.0)


def test_plain_commands_have_the_period_of_the_slowest():
    known = type("Known", (), {"frame": 0.05})
    assert Plain().controller(known).period == 0.05
    assert Plain(period=0.1).controller(known).period == 0.1


def test_a_criterion_is_asked_where_no_way_is_given():
    arm = two_link()
    run = run_task(arm, st.BoundedServo(SERVO), task_path(arm, "square", size=0.01, speed=0.2), settle=0.1)
    assert run.metrics.contour_rms < 0.01
    assert run.path.angles.shape[1] == 2
    assert np.isfinite(run.metrics[:6]).all()
