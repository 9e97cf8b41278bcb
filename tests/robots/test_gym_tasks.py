"""Gymnasium environments of robots on servos: an arm that reaches, a biped that stands and is to walk."""

import copy
import math
import pickle
import warnings

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, ParameterError, UnknownNameError

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
gymnasium = pytest.importorskip("gymnasium", reason="the extra `robots` is not installed")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

import servotwin.robots.gym  # noqa: E402 - it gives Gymnasium the names
from servotwin.robots.camera import NoDrawingError  # noqa: E402
from servotwin.robots.mjcf_models import BIPED_HEIGHT, JOINTS  # noqa: E402
from servotwin.robots.trainers import environments  # noqa: E402

REACH, BIPED = "servotwin/SO101Reach-v0", "servotwin/Biped-v0"
SERVO = st.load_servo("feetech-sts3215-12v")
LOOSE = {"motor.torque_constant": "normal:5%", "gear.backlash": "uniform:50%", "motor.rotor_inertia": "uniform:30%",
         "firmware.proportional_gain": "uniform:20%", "supply.open_circuit_voltage": "uniform:10V..12.6V"}


def waving(env, steps, seed=None, size=0.3):
    """Return observations and rewards under actions that swing, after a reset, and what that has told."""
    observation, info = env.reset(seed=seed)
    rows = [[*observation, 0.0]]
    for k in range(steps):
        action = size * np.sin(0.4 * k + np.arange(env.action_space.shape[0]))
        observation, reward, *_ = env.step(action.astype(np.float32))
        rows.append([*observation, reward])
    return np.array(rows), info


# ------------------------------------------------------------------------------------------------- by the book

@pytest.mark.long
@pytest.mark.parametrize("name", [REACH, BIPED])
@pytest.mark.parametrize("vary", [None, LOOSE])
def test_the_checker_of_gymnasium_finds_nothing(name, vary):
    check_env(gymnasium.make(name, vary=vary).unwrapped)  # a warning is an error here


def test_they_are_made_of_a_name_that_says_its_module():
    env = gymnasium.make(f"servotwin.robots.gym:{REACH}", max_episode_steps=2)
    env.reset(seed=1)
    ends = [env.step(env.action_space.sample())[2:4] for _ in range(2)]
    assert ends == [(False, False), (False, True)]
    assert env.metadata["render_fps"] == env.unwrapped.rate == 20


@pytest.mark.long(but="None-servotwin/SO101Reach-v0")
@pytest.mark.parametrize("name", [REACH, BIPED])
@pytest.mark.parametrize("vary", [None, LOOSE])
def test_a_seed_decides_everything(name, vary):
    env = gymnasium.make(name, vary=vary).unwrapped
    first, told = waving(env, 12, seed=3)
    later = waving(env, 5)[1]  # the episode after it, of the same random numbers
    again = gymnasium.make(name, vary=vary).unwrapped
    for one in (env, again, copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        rows, info = waving(one, 12, seed=3)
        assert np.array_equal(rows, first)
        if vary is not None:
            np.testing.assert_equal(info["servo_parameters"], told["servo_parameters"])
            np.testing.assert_equal(waving(one, 5)[1]["servo_parameters"], later["servo_parameters"])
    assert not np.array_equal(waving(env, 12, seed=4)[0], first)
    if vary is not None:
        assert not np.array_equal(told["servo_parameters"]["gear.backlash"], later["servo_parameters"]["gear.backlash"])


def test_a_seed_is_the_same_task_whatever_the_servos():
    envs = [gymnasium.make(REACH, **more).unwrapped for more in (
        {}, {"vary": LOOSE}, {"servo": st.DigitalServo(SERVO), "supply": st.Supply(open_circuit_voltage=9.0)})]
    points = [env.reset(seed=6)[0][24:27] for env in (*envs, pickle.loads(pickle.dumps(envs[2])))]
    assert np.ptp(points, axis=0).max() == 0.0


@pytest.mark.long(but="servotwin/SO101Reach-v0")
@pytest.mark.parametrize("name", [REACH, BIPED])
def test_the_space_holds_all_that_is_observed(name):
    env = gymnasium.make(name).unwrapped
    random = np.random.default_rng(0)
    env.reset(seed=0)
    for _ in range(40):
        observation, _, ended, _, info = env.step(random.choice([-3.0, 3.0], env.action_space.shape))
        assert env.observation_space.contains(observation)
        assert (env.data.ctrl >= env._low).all()
        assert (env.data.ctrl <= env._high).all()
        assert all(info[key].shape == env.action_space.shape for key in info if key.startswith("servo_"))
        if ended:
            env.reset()


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_of_them_begins_anew_as_gymnasium_says(mode):
    """Two environments with episodes of three steps are each what one alone is."""
    vector = gymnasium.make_vec(REACH, 2, max_episode_steps=3, vary={"gear.backlash": "uniform:50%"},
                                vector_kwargs={"autoreset_mode": mode})
    alone = [gymnasium.make(REACH, max_episode_steps=3, vary={"gear.backlash": "uniform:50%"}) for _ in range(2)]
    actions = np.full((2, len(JOINTS)), 0.5, np.float32)
    seen, told = vector.reset(seed=[5, 9])
    for k, env in enumerate(alone):
        observation, info = env.reset(seed=[5, 9][k])
        assert np.array_equal(seen[k], observation)
        assert np.array_equal(told["servo_parameters"]["gear.backlash"][k], info["servo_parameters"]["gear.backlash"])
    for step in range(3):
        seen, _, ended, cut, told = vector.step(actions)
        last = [env.step(action) for env, action in zip(alone, actions, strict=True)]
        assert cut.tolist() == [step == 2] * 2
        assert not ended.any()
    begun = [env.reset() for env in alone]
    if mode == AutoresetMode.SAME_STEP:
        for k in range(2):
            assert np.array_equal(told["final_obs"][k], last[k][0])
            assert told["final_info"]["distance"][k] == last[k][4]["distance"]
        assert told["_final_obs"].all()
        assert told["_servo_parameters"].all()
    else:
        assert "final_obs" not in told
        assert "servo_parameters" not in told
        assert np.array_equal(seen, [one[0] for one in last])
    if mode == AutoresetMode.NEXT_STEP:
        seen, reward, _, cut, told = vector.step(actions)
        assert not reward.any()
        assert not cut.any()
    elif mode == AutoresetMode.DISABLED:
        seen, told = vector.reset(options={"reset_mask": np.array([True, False])})
        assert told["_servo_parameters"].tolist() == [True, False]
        begun[1] = last[1]
    assert np.array_equal(seen, [one[0] for one in begun])
    vector.close()


@pytest.mark.slow
def test_processes_of_them_are_one_after_the_other():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of fork where threads are
        vectors = [gymnasium.make_vec(REACH, 2, vectorization_mode=mode, vary=LOOSE) for mode in ("sync", "async")]
    rows = []
    for vector in vectors:
        rows.append([vector.reset(seed=1)[0]])
        rows[-1] += [vector.step(np.full((2, len(JOINTS)), 0.3, np.float32))[0] for _ in range(10)]
        vector.close()
    assert np.array_equal(*rows)


@pytest.mark.long
def test_pictures_show_the_robot_or_a_line_says_why_not(monkeypatch):
    env = gymnasium.make(BIPED, render_mode="rgb_array", width=64, height=48).unwrapped
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (48, 64, 3)

    def blind(*_):
        raise NoDrawingError("nothing can be drawn")

    monkeypatch.setattr(environments, "Camera", blind)
    dark = gymnasium.make(BIPED, render_mode="rgb_array").unwrapped
    dark.reset(seed=0)
    with pytest.warns(UserWarning, match="are black: nothing can be drawn"):
        assert not dark.render().any()
    assert not dark.render().any()  # said once
    env.close()


# ------------------------------------------------------------------------------------------------- servos

@pytest.mark.long(but="motor.rotor_inertia-choice:4e-7kg m2-4e-07")
@pytest.mark.parametrize(("name", "word", "value"), [
    ("motor.rotor_inertia", "choice:4e-7kg m2", 4e-7), ("motor.armature_resistance", "choice:6ohm", 6.0),
    ("gear.backlash", "choice:1.5deg", math.radians(1.5)),
    ("firmware.compute_delay", "choice:0.9ms", 0.9e-3)])
def test_what_is_drawn_is_what_servos_have(name, word, value):
    """All of a number that can be but one value: the robot moves as one whose servos' file says so."""
    drawn, made, plain = (gymnasium.make(REACH, **more).unwrapped for more in (
        {"vary": {name: word}}, {"servo": SERVO.replace({name: value})}, {}))
    places = []
    for env in (drawn, made, plain):
        waving(env, 15, seed=2)
        places.append(env.data.qpos.copy())
    assert places[0] == pytest.approx(places[1], abs=1e-9)
    assert np.abs(places[0] - places[2]).max() > 1e-5
    np.testing.assert_allclose(drawn.model.dof_armature, made.model.dof_armature, rtol=1e-12)


@pytest.mark.long
def test_each_joint_draws_its_own_about_its_own_registers():
    env = gymnasium.make(REACH, vary=LOOSE).unwrapped
    draws = [env.reset(seed=seed)[1]["servo_parameters"] for seed in range(40)]
    constant = np.array([one["motor.torque_constant"] for one in draws]) / SERVO.motor.torque_constant - 1.0
    play = np.array([one["gear.backlash"] for one in draws]) / SERVO.gear.backlash - 1.0
    assert np.abs(np.mean(constant)) < 4.0 * 0.05 / math.sqrt(constant.size)
    assert np.std(constant) == pytest.approx(0.05, rel=0.2)
    assert np.abs(play).max() < 0.5
    assert np.abs(np.corrcoef(np.hstack([constant, play]).T) - np.eye(12)).max() < 0.7  # joints, and numbers, differ
    volts = np.array([one["supply.open_circuit_voltage"] for one in draws])
    assert 10.0 < volts.min() < 10.5
    assert 12.1 < volts.max() < 12.6
    env.step(np.zeros(6))
    assert env.drive.look(env.data, "bus_voltage") == pytest.approx(volts[-1], abs=0.3)


def test_joints_vary_as_each_is_said_to():
    env = gymnasium.make(REACH, vary={"gripper": {"gear.backlash": "uniform:1deg..2deg"}}).unwrapped
    play = env.reset(seed=0)[1]["servo_parameters"]["gear.backlash"]
    assert play[:5].tolist() == [SERVO.gear.backlash] * 5
    assert math.radians(1.0) < play[5] < math.radians(2.0)


@pytest.mark.long
@pytest.mark.parametrize("name", [REACH, BIPED])
def test_all_that_a_file_says_may_vary(name):
    info = gymnasium.make(name, vary="stated").reset(seed=0)[1]
    names = set(info["servo_parameters"])
    assert {"motor.armature_resistance", "motor.torque_constant", "gear.backlash"} < names
    assert not any(name.startswith("supply.open") for name in names)


def test_servos_have_the_registers_of_lerobot_and_those_that_are_given():
    plain, given = (gymnasium.make(REACH, **more).unwrapped._nominal for more in (
        {}, {"registers": {"P_Coefficient": 8}}))
    arm, gripper = (st.feetech_sts(name, servo="feetech-sts3215-12v") for name in ("lerobot", "lerobot-gripper"))
    assert plain[0].servo.firmware == arm.firmware
    assert plain[5].servo.firmware == gripper.firmware
    assert given[5].servo.firmware.torque_limit == gripper.firmware.torque_limit
    assert given[5].servo.firmware.proportional_gain == pytest.approx(0.5 * gripper.firmware.proportional_gain)
    assert gymnasium.make(BIPED).unwrapped._nominal[0].servo == SERVO


@pytest.mark.long
@pytest.mark.parametrize("servo", [
    "hitec-hs-755hb", st.PulseServo(st.load_servo("hitec-hs-755hb")), st.load_servo("dynamixel-xl430-w250")])
def test_other_servos_stand_in_the_middle_of_their_travel(servo):
    env = gymnasium.make(BIPED, servo=servo).unwrapped
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.zeros(10))
    assert np.abs(env.data.qpos[7:] - env._stance).max() < 0.2


@pytest.mark.parametrize(("supply", "volts", "sags"), [
    (11.0, 11.0, False), (st.Supply(open_circuit_voltage=9.0, internal_resistance=0.5), 9.0, True), (None, 12.0, True)])
def test_all_servos_are_on_one_supply(supply, volts, sags):
    env = gymnasium.make(REACH, supply=supply).unwrapped
    env.reset(seed=0)
    found = np.array([env.step(np.array([1.0, 1.0, -1.0, 1.0, 0.0, 0.0]))[4]["servo_voltage"] for _ in range(6)])
    assert np.ptp(found, axis=1).max() < 1e-9
    assert found.max() <= volts + 0.3
    assert bool(found.min() < volts - 0.02) is sags


# ------------------------------------------------------------------------------------------------- tasks

@pytest.mark.long
def test_an_arm_that_goes_after_the_point_gets_there():
    """By the Jacobian of its tip: all points are within reach, and increments make up for what the servos droop."""
    env, got = gymnasium.make(REACH).unwrapped, 0
    for seed in range(12):
        env.reset(seed=seed)
        for _ in range(100):
            jacobian = np.zeros((3, env.model.nv))
            mujoco.mj_jacSite(env.model, env.data, jacobian, None, env.model.site("tool").id)
            way = env.model.site("target").pos - env.data.site("tool").xpos
            turn = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 4e-4 * np.eye(3), 0.3 * way)
            observation, reward, ended, _, info = env.step(turn / env.STEP)
            assert info["is_success"] == (info["distance"] < env.NEAR)
            assert reward == pytest.approx(1.0 - math.tanh(info["distance"] / env.CLOSE))
            assert not ended
        got += info["is_success"]
        assert observation[-3:] == pytest.approx(way - 0.0, abs=0.05)
    assert got >= 11


def test_observed_angles_are_counts_of_the_encoders():
    env = gymnasium.make(REACH).unwrapped
    before = env.reset(seed=0)[0]
    after = env.step(np.full(6, 0.7))[0]
    counts = after[:6] / (2.0 * math.pi / 4096.0)
    assert counts == pytest.approx(np.round(counts), abs=1e-3)
    assert np.abs(after[:6] - env.data.qpos).max() < math.pi / 4096.0 + 1e-6
    assert after[6:12] == pytest.approx((after[:6] - before[:6]) * env.rate, abs=1e-4)
    assert after[12:18] == pytest.approx(env.data.ctrl, abs=1e-6)
    assert after[18:24] == pytest.approx(0.7)


@pytest.mark.long
@pytest.mark.parametrize("vary", [None, "stated"])
def test_the_biped_stands_for_the_whole_episode(vary):
    env = gymnasium.make(BIPED, vary=vary)
    for seed in range(1 if vary is None else 4):
        env.reset(seed=seed)
        cut, steps = False, 0
        while not cut:
            observation, reward, ended, cut, info = env.step(np.zeros(10, np.float32))
            steps += 1
            assert not ended
            assert info["height"] == pytest.approx(BIPED_HEIGHT, rel=0.03)
        assert steps == 500
        assert observation[:3] == pytest.approx([0.0, 0.0, -1.0], abs=0.05)
        assert reward == pytest.approx(0.5, abs=0.05)  # upright, at rest, a fifth of an ampere
        assert abs(info["distance"]) < 0.02


def test_a_biped_that_folds_its_legs_has_fallen():
    env = gymnasium.make(BIPED)
    env.reset(seed=0)
    for _ in range(200):
        *_, ended, cut, info = env.step(np.tile([0.0, 1.0, -1.0, 1.0, 0.0], 2).astype(np.float32))
        if ended:
            break
    assert ended
    assert not cut
    assert info["height"] < 0.6 * BIPED_HEIGHT or env.unwrapped.data.body("body").xmat[8] < 0.5


def test_the_imu_of_a_biped_turns_with_it():
    """Gravity in the axes of a body that leans forward points ahead in it."""
    env = gymnasium.make(BIPED).unwrapped
    env.reset(seed=0)
    env.data.qpos[3:7] = math.cos(0.1), 0.0, math.sin(0.1), 0.0  # 0.2 rad about y
    env.data.qvel[3:6] = 0.0, 1.5, 0.0
    mujoco.mj_forward(env.model, env.data)
    seen = env._observed()
    assert seen[:6] == pytest.approx([math.sin(0.2), 0.0, -math.cos(0.2), 0.0, 1.5, 0.0], abs=1e-6)


# ------------------------------------------------------------------------------------------------- what is refused

@pytest.mark.parametrize(("more", "kind", "words"), [
    ({"render_mode": "human"}, InputError, "render_mode"), ({"supply": -1.0}, InputError, "supply"),
    ({"supply": "12V"}, InputError, "supply"), ({"vary": "everything"}, InputError, "'stated'"),
    ({"vary": {"motor.torque": "normal:5%"}}, UnknownNameError, "motor.torque"),
    ({"vary": {"elbow": {"gear.backlash": "normal:5%"}}}, UnknownNameError, "elbow_flex"),
    ({"vary": {"gear.backlash": "nomal:5%"}}, ParameterError, "normal"),
    ({"servo": "hitec-hs-755hb", "registers": {"P_Coefficient": 16}}, InputError, "registers of hitec-hs-755hb")])
def test_bad_arguments_are_said(more, kind, words):
    with pytest.raises(kind, match=words):
        environments.SO101Reach(**more)


def test_bad_calls_are_said():
    env = gymnasium.make(REACH).unwrapped
    with pytest.raises(UnknownNameError, match="option of reset"):
        env.reset(options={"target": (0.1, 0.0, 0.1)})
    env.reset(seed=0)
    for action in (np.zeros(5), np.full(6, math.nan)):
        with pytest.raises(InputError, match="6 finite numbers"):
            env.step(action)
