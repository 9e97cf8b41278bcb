"""Fits of whole robots: servos, supply, masses, zeros and latency, and what cannot be told apart."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import links
from servotwin.errors import InputError
from servotwin.identification.arms import identify_arm, search
from servotwin.identification.arms.arm_fit import BELIEFS, ArmCause, confirmed, shaken
from servotwin.identification.arms.rows import Noise, Numbers, beyond_scatter, episodes_from, used_rows, whitened
from servotwin.identification.arms.search import JointLanes, Problem, WholeArm
from servotwin.identification.fitting.search.case import LogPart
from servotwin.identification.fitting.uncertainty import Rows, Unidentifiable
from servotwin.robots import Motion, Mount, run_motion

pytestmark = pytest.mark.long

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
JOINTS, RATE, COUNT = ("shoulder", "elbow"), 30.0, 2.0 * math.pi / 4096.0
PLANT = mujoco.MjModel.from_xml_string(links(dt=2e-3))
SERVO = st.feetech_sts("lerobot", servo="feetech-sts3215-12v").replace({"gear.backlash": None})
BUS = st.parameters.Supply(open_circuit_voltage=12.0, internal_resistance=0.15)
SHARES = {"motor.torque_constant": 1.12, "motor.back_emf_constant": 1.12, "motor.rotor_inertia": 1.3,
          "friction.coulomb_torque_forward": 1.3, "friction.coulomb_torque_backward": 1.3}
ZERO, LATENCY = 0.04, 0.008


def goals(seed, seconds):
    rng, time = np.random.default_rng(seed), np.arange(int(seconds * RATE)) / RATE
    found = {}
    for joint in JOINTS:
        at, t = np.zeros(len(time)), 0.3
        while t < seconds:
            rise, way = rng.uniform(0.3, 0.9), rng.uniform(-0.7, 0.7) - at[-1]
            x = np.clip((time - t) / rise, 0.0, 1.0)
            at = at + way * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
            t += rise + rng.uniform(0.1, 0.8)
        found[joint] = COUNT * np.round(at / COUNT)
    return time, found


def recorded(seed=0, seconds=10.0, *, gain=1.0, hand=None, payload=1.0):
    """Return an episode of an arm whose servos, zeros and masses are not those of the files."""
    servo = SERVO.replace({name: share * SERVO.get(name) for name, share in SHARES.items()})
    servo = servo.replace({"firmware.proportional_gain": gain * servo.get("firmware.proportional_gain")})
    time, angles = goals(seed, seconds)
    mounts = {joint: Mount(st.DigitalServo(servo), ZERO) for joint in JOINTS}
    heavy = search.with_masses(PLANT, search.links_of(PLANT, JOINTS), np.array([1.0, 1.1 * payload]))
    run = run_motion(heavy, mounts, Motion(time=time, source="real", angles={
        joint: values + ZERO for joint, values in angles.items()}), bus=BUS, hold="previous")
    measured = {joint: COUNT * np.round((np.interp(time - LATENCY, run.time, run.record[joint]["joint_angle"]) - ZERO)
                                        / COUNT) for joint in JOINTS}
    if hand is not None:
        measured["elbow"] = measured["elbow"] + 0.3 * ((time > hand) & (time < hand + 0.8))
    return Motion(time=time, angles=angles, measured=measured, source=f"episode {seed}")


def fitted(motions, **more):
    return identify_arm(motions, PLANT, SERVO, **{"bus": BUS, **more})


@pytest.fixture(scope="module")
def fit():
    return fitted([recorded(seed) for seed in range(3)])


def test_an_arm_is_found_and_unseen_episodes_are_predicted(fit):
    assert fit.holdout.rms() < math.radians(0.12)
    assert fit.before_holdout.rms() > 3.0 * fit.holdout.rms()
    assert fit.latency == pytest.approx(LATENCY, abs=3e-3)
    truth = {"output_torque_constant": 1.12 * 345.0 * SERVO.motor.torque_constant, "latency": LATENCY,
             "output_coulomb_torque": 1.3 * 345.0 * SERVO.friction.coulomb_torque_forward, "zero.shoulder": ZERO,
             "zero.elbow": ZERO, "supply.open_circuit_voltage": 12.0}
    spreads = fit.intervals(0.99)
    for name, value in truth.items():
        assert spreads[name].lower <= value <= spreads[name].upper, name
    found = fit.servos["elbow"]
    assert found.source("motor.torque_constant").origin == "identified"
    assert found.motor.torque_constant == pytest.approx(fit.estimates["output_torque_constant"] / 345.0)
    assert not any("held out" in text for text in fit.warnings)


def test_what_cannot_be_told_apart_is_named(fit):
    """All masses, inertia, friction and the resistance are the scale of torque: no current was logged."""
    assert all(isinstance(one, Unidentifiable) for one in fit.unidentifiable)
    assert any("mass" in name for name in fit.undetermined)
    assert fit.intervals()[next(name for name in fit.undetermined if "mass" in name)].method == BELIEFS


def test_the_same_fit_twice_is_the_same_and_one_episode_says_so():
    motion = recorded(5, 6.0)
    one, other = (fitted([motion]) for _ in range(2))
    assert one.estimates == other.estimates
    np.testing.assert_array_equal([*one.intervals().values()], [*other.intervals().values()])
    assert one.training.rms() == other.training.rms()
    assert one.holdout is None
    assert any("nothing was held out" in text for text in one.warnings)


def test_without_intervals_none_are_sought():
    found = fitted([recorded(5, 6.0)], intervals=False)
    assert {interval.method for interval in found.intervals().values()} == {"not sought"}
    assert found.unknown == ()


def test_a_wrong_gain_is_named_first():
    found = fitted([recorded(7, 8.0, gain=0.5)], intervals=False)
    assert found.causes[0].name == "proportional gain"
    assert "8 in the place of 16" in found.causes[0].sentence
    assert set(found.causes[0].joints) == set(JOINTS)
    for joint in JOINTS:  # and the fit goes on with it
        gain = found.servos[joint].get("firmware.proportional_gain")
        assert gain == pytest.approx(0.5 * SERVO.get("firmware.proportional_gain"), rel=0.15)
    assert found.training.rms() < 0.3 * found.before.rms()


def test_a_payload_is_named_and_none_where_only_single_joints_look_like_one():
    found = fitted([recorded(seed, 12.0, payload=2.0) for seed in range(2)])
    assert found.causes[0].name == "masses"
    assert "times as heavy" in found.causes[0].sentence
    healthy = fitted([recorded(seed, 8.0) for seed in range(2)])
    episodes = episodes_from([recorded(0, 8.0)], JOINTS, dict.fromkeys(JOINTS, SERVO))
    what = Problem(PLANT, healthy.numbers, search.links_of(PLANT, JOINTS), episodes,
                   [used_rows(one) for one in episodes], lambda: None,
                   search.Demand(PLANT, JOINTS, search.links_of(PLANT, JOINTS)))
    arm, noise = what.whole(), Noise(np.array([healthy.noise[joint] for joint in JOINTS]), healthy.noise["clock"])
    slopes = [one.slopes for one in what.search(arm, noise).linear(healthy.best, central=True)]
    assert confirmed([ArmCause("masses", "as the first stage has it", 99.0)], what, arm, noise, healthy.best,
                     slopes) == ()


def test_what_a_hand_did_is_left_out():
    found = fitted([recorded(8, 8.0, hand=4.0)], intervals=False)
    window = next(one for one in found.left_out if one.joint == "elbow")
    assert window.start < 4.2
    assert window.stop > 4.6
    assert "neither servo nor arm explains" in str(window)
    assert not fitted([recorded(8, 8.0)], intervals=False).left_out


def test_without_a_robot_each_joint_gets_a_pendulum():
    with pytest.warns(FutureWarning, match="identify_arm"):  # until 0.2
        found = st.identify([recorded(9, 6.0)], SERVO, robot="unknown", bus=BUS, intervals=False)
    assert {f"mass.{joint}_{part}" for joint in JOINTS for part in ("weight", "inertia")} <= set(found.names)
    assert found.training.rms() < 0.7 * found.before.rms()
    assert any("no robot file" in text for text in found.warnings)


def test_inverse_dynamics_are_linear_in_the_masses():
    rng, bodies = np.random.default_rng(0), search.links_of(PLANT, JOINTS)
    motion = rng.normal(size=(3, 5, 2))
    factors = np.array([1.3, 0.8])
    torque, inertia = search.asked_of(PLANT, JOINTS, bodies, *motion).of(factors)
    heavy = search.with_masses(PLANT, bodies, factors)
    data = mujoco.MjData(heavy)
    for k in range(5):
        data.qpos[:], data.qvel[:], data.qacc[:] = motion[:, k]
        mujoco.mj_inverse(heavy, data)
        np.testing.assert_allclose(torque[k] + inertia[k] * motion[2, k], data.qfrc_inverse, rtol=1e-9, atol=1e-12)


def test_a_fit_simulates_what_a_run_does():
    """Rows of 30 Hz between ticks of 2 ms act at their time in both, not with the next tick."""
    motion = recorded(0, 3.0)
    episode = episodes_from([motion], JOINTS, dict.fromkeys(JOINTS, SERVO))[0]
    numbers = Numbers({joint: Mount(st.DigitalServo(SERVO)) for joint in JOINTS}, (), BUS)
    found = WholeArm(PLANT, numbers, []).angles(episode, numbers.start[None])[0]
    run = run_motion(PLANT, numbers.mounts, motion, bus=BUS, hold="previous", assume_heat=False)
    at = motion.time - numbers.latency(numbers.start)
    for j, joint in enumerate(JOINTS):
        np.testing.assert_allclose(found[:, j], np.interp(at, run.time, run.record[joint]["joint_angle"]), atol=1e-5)
        told = run.record[joint]["joint_command"]
        begun = run.time - run.model.opt.timestep
        np.testing.assert_allclose(told[np.searchsorted(begun, motion.time - 1e-6)], motion.angles[joint], atol=1e-9)


def test_copies_are_what_each_of_them_is_alone():
    """Copies of which a number moves one joint only share the lanes of the others."""
    bodies = search.links_of(PLANT, JOINTS)
    numbers = Numbers({joint: Mount(st.DigitalServo(SERVO)) for joint in JOINTS}, search.link_names(PLANT, bodies),
                      BUS, each=True)
    episode = episodes_from([recorded(0, 3.0)], JOINTS, dict.fromkeys(JOINTS, SERVO))[0]
    lanes = JointLanes(PLANT, numbers, bodies, lambda: None, search.Demand(PLANT, JOINTS, bodies))
    points = numbers.start + 0.01 * np.vstack([np.zeros(len(numbers)), np.eye(len(numbers))])
    found = lanes.angles(episode, points)
    for k in range(0, len(points), 5):
        np.testing.assert_allclose(found[k], lanes.angles(episode, points[k:k + 1])[0], atol=1e-9)
    moved = np.abs(found - found[0]).max(axis=1)
    assert (moved.max(axis=0) > 0.0).all()
    own = [k for k, name in enumerate(numbers.names) if name.startswith("elbow: ")]
    np.testing.assert_array_equal(moved[1:][own, 0], 0.0)


def test_rows_are_whitened_by_positions_and_clock():
    class Row:
        speed = np.array([[1.0, -2.0, 0.5]])

    noise = Noise(np.array([0.1, 0.2, 0.3]), 0.15)
    W = whitened(np.eye(3)[None], Row, noise, np.ones((1, 3), bool))[0]
    cov = np.diag(noise.positions**2) + noise.stamps**2 * np.outer(Row.speed[0], Row.speed[0])
    np.testing.assert_allclose(W @ cov @ W.T, np.eye(3), atol=1e-12)


def test_derivatives_that_are_noise_count_for_nothing():
    rng = np.random.default_rng(0)
    noise, true = rng.normal(size=(2, 4000, 2)), 30.0 * rng.normal(size=(4000, 1))
    slopes, scatter = noise[0] + true * [1.0, 1.0], noise[1]
    clean = slopes @ beyond_scatter(slopes, scatter)
    assert np.abs(clean @ [1.0, -1.0]).max() < 0.05 * np.abs(slopes @ [1.0, -1.0]).max()
    assert clean @ [1.0, 1.0] == pytest.approx(slopes @ [1.0, 1.0], rel=0.1, abs=3.0)


def test_derivatives_are_of_steps_that_an_arm_answers_by_about_its_noise():
    """An arm that its servos hardly lift answers a tenth more resistance otherwise than ten times a hundredth more."""
    low = st.parameters.Supply(open_circuit_voltage=2.0, internal_resistance=None)
    numbers = Numbers({joint: Mount(st.DigitalServo(SERVO)) for joint in JOINTS}, (), low)
    episode = episodes_from([recorded(3, 8.0)], JOINTS, dict.fromkeys(JOINTS, SERVO))[0]
    problem = Problem(PLANT, numbers, [], [episode], [used_rows(episode)], lambda: None,
                      search.Demand(PLANT, JOINTS, []))
    one = problem.search(problem.lanes(), Noise(np.full(2, 5e-4), 0.0))
    k = numbers.names.index("motor.armature_resistance")

    def slope():
        return one.linear(numbers.start, central=True)[0].slopes[..., k]

    coarse, own = slope(), slope()
    one.steps = np.full(len(numbers), 1e-3)
    true = slope()
    assert np.linalg.norm(coarse - true) > 0.1 * np.linalg.norm(true)
    assert np.linalg.norm(own - true) < 0.05 * np.linalg.norm(true)


@pytest.mark.parametrize(("logs", "servo", "words"), [
    (lambda: [replace(recorded(0, 2.0), measured={})], SERVO, "joints of episode 0"),
    (lambda: [recorded(0, 2.0)], None, "servo of a robot"),
    (lambda: [recorded(0, 2.0)], {"wrist": SERVO}, "wrist"),
    (lambda: [], SERVO, "logs of a robot"),
    (lambda: [recorded(0, 0.5)], SERVO, "at least 30"),
])
def test_bad_input_is_one_line(logs, servo, words):
    with pytest.raises(InputError, match=words) as caught:
        identify_arm(logs(), PLANT, servo)
    assert "\n" not in str(caught.value)


def test_report(fit, tmp_path):
    page = fit.report(tmp_path / "arm.html").read_text()
    assert "unseen, before" in page
    assert "zero.elbow" in page
    assert str(fit).startswith("the simulated joints are")


def test_turns_take_longer_than_stamps_that_count_them():
    """A clock of 3 % on stamps that are 3 % too short is the run itself; where rows are stamped, none is searched."""
    real = recorded(0, 8.0)
    late = replace(real, time=real.time / 1.03)
    numbers = Numbers({joint: Mount(st.DigitalServo(SERVO)) for joint in JOINTS}, (), BUS, counted=True)
    clock = np.where(np.array(numbers.names) == "clock", 3.0, numbers.start)
    angles = [WholeArm(PLANT, numbers, []).angles(episodes_from([motion], JOINTS, dict.fromkeys(JOINTS, SERVO))[0],
                                                  x[None])[0] for motion, x in ((real, numbers.start), (late, clock))]
    np.testing.assert_allclose(*angles, atol=1e-9)
    lower, upper, _ = fitted([late, replace(recorded(1, 8.0), time=late.time)]).intervals()["clock"]
    assert lower < 0.0 < upper < 0.05  # hardly told: a slower servo with lighter links moves alike
    wakes = np.random.default_rng(0).uniform(0.0, 1e-3, len(real.time))
    stamped = replace(real, time=real.time + wakes - wakes[0])
    assert "clock" not in fitted([stamped], intervals=False).names


def test_roughness_of_simulations_widens_what_it_moves():
    """A shake along a derivative is taken for a change of its number; one across all of them moves nothing."""
    rng = np.random.default_rng(0)
    slopes, _ = np.linalg.qr(rng.normal(size=(600, 3)))
    shakes = np.stack([0.3 * slopes[:, 0], slopes[:, 2], np.zeros(600)], axis=1)
    rows = [Rows(np.zeros(600), slopes[:, :2], np.ones(600))]
    found = shaken(rows, [LogPart(np.zeros(600), shakes, np.zeros((600, 0)))], np.eye(2))
    np.testing.assert_allclose(found, 2.0 * np.diag([0.3**2 / 2.0, 0.0]), atol=1e-12)
