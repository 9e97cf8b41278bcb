"""The rig of arms: energy, swing and droop by formulas, one joint by the engine, and the clock of its recorder."""

import json
import math

import numpy as np
import pytest

import servotwin as st
from reference import arm_rig as rig
from reference import arm_rig_recorder as recorder
from reference.arm_rig_fits import left_by, servo_of, truths_of
from reference.arm_rig_servo import DELTA, USUAL, Servo, dynamixel, feetech

pytestmark = pytest.mark.skipif(rig.compiler() is None, reason="no C compiler")

FREE = Servo(R=1e9, K=1e-9, J=0.0, forward=0.0, backward=0.0, wheel=0.0)
POLE = rig.Link("pole", "hinge", (0.0, 0.0, 1.0), rig._FLAT, (-3.2, 3.2), 0.5, (0.2, 0.0, 0.0),
                (0.0, 0.5 * 0.2**2 / 12.0, 0.5 * 0.2**2 / 12.0, 0.0, 0.0, 0.0))
LEVER, INERTIA = 0.5 * rig.GRAVITY * 0.2, 0.5 * 0.2**2 * 13.0 / 12.0  # of the pole: N m, kg m2
ALL = [(robot, family) for robot in rig.ROBOTS.values() for family in rig.FAMILIES]


def arm(links, servos, V_oc=12.0, R_b=0.0):
    robot = rig.Robot("of a test", tuple(links), {}, {})
    return rig.Truth(robot, "feetech", np.ones(len(links)), tuple(servos), V_oc, R_b, 2e-3, 8e-3, 0)


def free(truth, first, duration, step, count=400):
    times = np.linspace(0.0, duration, count)
    none = np.full((1, len(first)), math.nan)
    return times, rig.simulated(truth, np.zeros(1), none, times, first=np.array(first), step=step)


def test_a_free_pole_swings_with_its_period():
    """Small about hanging: the axis lies along -y, so that x of the link is level at 0 and up at +90 degrees."""
    hanging = -math.pi / 2
    times, motion = free(arm([POLE], [FREE]), [hanging + 0.02], 10.0, 1e-4, 10001)
    x = motion.angle[:, 0] - hanging
    rises = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    at = times[rises] - x[rises] * (times[1] - times[0]) / (x[rises + 1] - x[rises])
    assert np.mean(np.diff(at)) == pytest.approx(2.0 * math.pi * math.sqrt(INERTIA / LEVER), rel=2e-4)


@pytest.mark.parametrize("robot", rig.ROBOTS.values(), ids=lambda robot: robot.name)
def test_free_arms_keep_their_energy(robot):
    lost = []
    for step in (2e-4, 1e-4):
        truth = arm(robot.links, len(robot.links) * [FREE])
        _, motion = free(truth, len(robot.links) * [0.3], 0.5, step)
        moved = np.max(np.abs(motion.speed))
        lost.append(abs(motion.energy["gained"]))
    assert moved > 1.0
    assert lost[1] < 0.6 * lost[0] + 1e-9  # first order
    assert lost[1] < 5e-3


@pytest.mark.parametrize(("robot", "family"), ALL, ids=lambda x: getattr(x, "name", x))
@pytest.mark.parametrize("play", [0.0, 0.015])
def test_what_the_source_gives_goes_somewhere(robot, family, play):
    truth = rig.random_truth(robot, family, 3, play=play)
    energy = recorder.record(truth, 4.0, pushes=recorder.pushed(truth, 4.0, 1)).motion.energy
    spent = sum(energy[name] for name in ("winding", "bridge", "wires", "dry", "viscous", "teeth", "gained"))
    assert spent == pytest.approx(energy["source"] + energy["pushed"], rel=3e-3)
    assert min(energy[name] for name in ("winding", "wires", "dry")) > 0.0


@pytest.mark.parametrize("robot", rig.ROBOTS.values(), ids=lambda robot: robot.name)
def test_the_file_of_a_robot_has_the_same_dynamics(robot):
    """Inertia and torques of rest by MuJoCo, of the file, against the first step of the free arm."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(rig.mjcf(robot))
    data = mujoco.MjData(model)
    q = np.linspace(-0.6, 0.9, len(robot.links))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    servos = [FREE._replace(J=0.01)] * len(robot.links)
    model.dof_armature[:] = 0.01
    model.opt.gravity[2] = -rig.GRAVITY
    mujoco.mj_forward(model, data)
    step = 1e-5
    motion = rig.simulated(arm(robot.links, servos), np.zeros(1), np.full((1, len(q)), math.nan), np.array([0.0]),
                           first=q, step=step)
    np.testing.assert_allclose(motion.speed[0] / step, data.qacc, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("servo", "full", "share"), [(feetech(), 1000.0, 4.0), (feetech(P=32.0), 1000.0, 4.0),
                                                      (dynamixel(P=400.0), 885.0, 128.0),
                                                      (dynamixel(P=400.0, divisor=256.0), 885.0, 256.0)])
def test_it_droops_as_its_registers_say(servo, full, share):
    """At rest: duty = P (e - zone) / share + start, cut; motor and load differ by no more than friction holds."""
    truth = arm([POLE], [servo._replace(R=4.3, K=2.3, J=0.03, forward=0.05, backward=0.05)])
    times = np.array([5.0])
    goal = DELTA * np.round(0.1 / DELTA)
    motion = rig.simulated(truth, np.zeros(1), np.full((1, 1), goal), times, first=np.zeros(1))
    y = math.floor(motion.angle[0, 0] / DELTA + 0.5)
    e = round(goal / DELTA) - y
    z = math.copysign(max(abs(e) - servo.zone, 0.0), e)
    duty = math.trunc(servo.P * z / share)
    duty = (duty + math.copysign(servo.startup, duty) if duty else 0.0) / full
    needed = LEVER * math.cos(motion.angle[0, 0])  # gravity turns it towards -q
    held = 2.3 * 12.0 * duty / 4.3
    assert motion.speed[0, 0] == 0.0
    assert e > 0
    assert abs(held - needed) <= 0.05 + 2.3 * 12.0 / 4.3 * servo.P / share / full * (feetech == servo) + 1e-9


CASES = {"feetech-sts3215-12v": 12.0, "feetech-sts3215-7v4": 7.4, "dynamixel-xl430-w250": 12.0,
         "dynamixel-xl330-m288": 5.0}


@pytest.mark.long(but="feetech-sts3215-12v")
@pytest.mark.parametrize("name", CASES)
def test_one_joint_moves_as_the_engine_moves_it(name):
    """Two solutions of one specification: a pole that goes up and down by steps, within a tenth of a count."""
    V_oc = CASES[name]
    lighter = POLE._replace(mass=0.15, inertia=tuple(0.3 * x for x in POLE.inertia))
    servo = USUAL[name]._replace(backward=USUAL[name].forward, wheel=0.0, phase=4e-4)
    at = np.array([0.0, 0.5, 1.2, 1.9, 2.6])
    goal = DELTA * np.round(np.array([0.0, 0.6, -0.5, -0.45, 0.2]) / DELTA)
    times = 0.02 * np.arange(1, 160)
    ours = rig.simulated(arm([lighter], [servo], V_oc), at, goal[:, None], times, first=np.zeros(1), step=5e-5)
    command = st.signals.samples(at, goal, unit="rad", hold="previous")
    load = st.loads.Pendulum(mass=0.15, length=0.2, inertia=0.3 * INERTIA, hanging_angle=-math.pi / 2,
                             gravity=rig.GRAVITY)
    theirs = st.simulate(st.DigitalServo(servo_of(name, servo, V_oc)), command, duration=3.3, load=load,
                         output_times=times, initial={"output_angle": 0.0})
    off = ours.angle[:, 0] - theirs["output_angle"]
    assert np.max(np.abs(ours.angle)) > 0.4
    assert np.sqrt(np.mean(off**2)) < 2e-4
    assert np.max(np.abs(off)) < 1e-3


def test_a_wrong_register_and_a_hand_show():
    truth = rig.random_truth(rig.PAN_TILT_LIFT, "feetech", 5)
    plain = recorder.record(truth, 6.0)
    weak = recorder.record(rig.with_wrong_gain(truth, 1, 0.5), 6.0)
    off = np.sqrt(np.mean((weak.true_angle - plain.true_angle) ** 2, axis=0))
    assert off[1] > 0.03
    assert off[1] > 3.0 * max(off[0], off[2])
    push = recorder.pushed(truth, 6.0, 2)
    hand = recorder.record(truth, 6.0, pushes=push)
    inside = (plain.true_time > push[0].start) & (plain.true_time < push[0].stop + 0.3)
    gap = np.abs(hand.true_angle - plain.true_angle)[:, push[0].joint]
    assert np.max(gap[inside]) > 0.02
    assert np.max(gap[plain.true_time < push[0].start]) == 0.0


def test_the_clock_is_that_of_a_loop():
    """Periods just above 1/30 s and some far above; stamps k/30; a goal shows in the next row at the earliest."""
    truth = rig.random_truth(rig.TWO_LINK, "feetech", 2)
    one = recorder.record(truth, 60.0, "steps")
    periods = np.diff(one.true_time)
    assert 1.0 / 30.0 <= periods.min() < 1.0 / 30.0 + 1e-4
    assert np.median(periods) < 1.0 / 30.0 + 1e-3 < periods.max()
    np.testing.assert_allclose(np.diff(one.time), 1.0 / 30.0, rtol=1e-9)
    assert 0.0 < one.true_time[-1] - one.time[-1] < 1.0
    np.testing.assert_array_equal(recorder.record(truth, 60.0, "steps", stamps="loop").time, one.true_time)
    jumped = np.flatnonzero(np.abs(np.diff(one.action[:, 0])) > np.radians(8.0))[:-1] + 1
    rested = jumped[np.abs(one.state[jumped, 0] - one.state[jumped - 1, 0]) < 2.5 * DELTA]
    assert len(rested) > 5
    after = np.abs(one.state[rested + 4, 0] - one.state[rested, 0])
    assert np.all(after > 3.0 * DELTA)  # and not at once: what it droops by has to be made up first
    assert truth.read_after < truth.write_after
    assert np.allclose(one.state / DELTA, np.round(one.state / DELTA))
    again = recorder.record(truth, 60.0, "steps")
    np.testing.assert_array_equal(again.state, one.state)


def test_an_episode_of_six_joints_takes_little_and_is_read_back(tmp_path):
    pytest.importorskip("pyarrow")
    truth = rig.random_truth(rig.SO101, "feetech", 1)
    episodes = [recorder.record(truth, 5.0, episode=k) for k in range(2)]
    assert np.any(episodes[0].action[:50] != episodes[1].action[:50])
    folder = recorder.write_dataset(episodes, truth, tmp_path / "set")
    logs = [log for log in st.read_logs(folder, joints="*:deg") if log.conditions["joint"] == "elbow_flex"]
    np.testing.assert_allclose(logs[1].measured["output_angle"], episodes[1].state[:, 2], atol=1e-6)
    np.testing.assert_allclose(logs[1].command, episodes[1].action[:, 2], atol=1e-6)
    wide = recorder.write_dataset(episodes, truth, tmp_path / "range", unit="range")
    assert json.loads((wide / "meta" / "info.json").read_text())["robot_type"] == "so101_follower"
    table = np.genfromtxt(recorder.write_table(episodes[0], truth, tmp_path / "rows.csv"), delimiter=",", names=True)
    assert table.dtype.names[1] == "actionshoulder_panpos"


def test_goals_and_positions_are_the_encoders():
    """A zero moves the joint, not what is recorded: encoder and goal differ by the droop of an arm without one."""
    truth = rig.random_truth(rig.PAN_TILT_LIFT, "feetech", 6)
    still = truth._replace(servos=tuple(servo._replace(zero=0.0) for servo in truth.servos))
    moved = truth._replace(servos=tuple(servo._replace(zero=z * DELTA) for servo, z in
                                        zip(still.servos, (20.0, -15.0, 10.0), strict=True)))
    plain, other = (recorder.record(one, 4.0, "smooth") for one in (still, moved))
    np.testing.assert_array_equal(plain.action, other.action)
    np.testing.assert_allclose(other.true_angle, plain.true_angle, atol=5e-3)
    np.testing.assert_allclose(other.motion.angle - plain.motion.angle,
                               np.tile(-DELTA * np.array([20.0, -15.0, 10.0]), (len(plain.time), 1)), atol=5e-3)


def test_smaller_steps_move_alike():
    truth = rig.random_truth(rig.SO101, "feetech", 4)
    coarse, fine = (recorder.record(truth, 5.0, "smooth", step=step).true_angle for step in (2e-4, 5e-5))
    assert np.sqrt(np.mean((coarse - fine) ** 2)) < 2e-3


def test_the_truth_leaves_little_of_an_episode():
    """Counts and the clock of the stamps alone: 10 ms late after a minute of late turns, at 1 rad/s half a degree."""
    truth = rig.random_truth(rig.PAN_TILT_LIFT, "dynamixel", 3)
    left = left_by(truth, recorder.record(truth, 10.0, "smooth", stamps="loop"))
    assert DELTA / math.sqrt(12.0) < left < 2.0 * DELTA
    assert left < left_by(truth, recorder.record(truth, 10.0, "smooth")) < math.radians(1.0)
    true = truths_of(truth)
    assert true["output_torque_constant"] == truth.servos[0].K
    assert true["zero.lift"] == -truth.servos[1].zero
