"""Servos in the place of the actuators of Gymnasium environments."""

import copy
import math
import pickle
import subprocess
import sys
import warnings

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, MissingExtraError, SimulationError, UnknownNameError
from servotwin.robots import Mount, ServoDrive

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from servotwin.robots.gym import ServoActuated  # noqa: E402
from servotwin.robots.servos.command_map import CommandMap  # noqa: E402

MIDDLE = math.pi / 2  # of the travel of the analog servo, rad
ANALOG = Mount(st.PulseServo(st.load_servo("hitec-hs-755hb")), zero=-MIDDLE)
DIGITAL = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
REACH = math.pi / 2 + math.radians(15.0)  # of the analog servo from its middle: 0 to 180 degrees and 15 beyond each
LINK = '<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".03"/>'
ARM = f"""<mujoco><compiler angle="radian"/><option timestep=".005" {{option}}/>
<worldbody><body><joint name="shoulder" axis="0 0 1" damping=".1"/>{LINK}
<body pos=".1 0 0"><joint name="elbow" axis="0 1 0" range="-1.2 2.5" frictionloss=".01"/>{LINK}
<body pos=".1 0 0"><joint name="finger" type="slide" axis="1 0 0" range="0 .03"/>{LINK}</body></body></body>
<body pos="1 0 0"><joint name="ball" type="ball"/>{LINK}</body></worldbody>
<tendon><fixed name="both"><joint joint="shoulder" coef="1"/><joint joint="elbow" coef="1"/></fixed></tendon>
<actuator>{{actuators}}</actuator></mujoco>"""
MOTORS = """<motor name="turn" joint="shoulder" ctrlrange="-1 1" gear="20"/><motor joint="elbow" ctrlrange="-2 2"/>
<position name="grip" joint="finger" kp="30" ctrlrange="0 .02"/>"""
SERVOS = {"turn": ANALOG, "elbow": ANALOG, "grip": Mount(DIGITAL, ratio=0.01)}


class Arm(gymnasium.Env):
    """An environment that is not one of Gymnasium's own: it holds a model and lets it step."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (6,), np.float64)

    def __init__(self, actuators=MOTORS, option="", goes_back=True, skip=4):
        self.arguments = actuators, option, goes_back, skip
        self.model = mujoco.MjModel.from_xml_string(ARM.format(actuators=actuators, option=option))
        self.data, self.goes_back, self.skip = mujoco.MjData(self.model), goes_back, skip
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.model.nu,), np.float32)

    def __reduce__(self):
        return Arm, self.arguments

    def seen(self):
        return np.concatenate((self.data.qpos[:3], self.data.qvel[:3]))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        time = self.data.time
        mujoco.mj_resetData(self.model, self.data)
        if not self.goes_back:
            self.data.time = time
        self.data.qpos[:2] = self.np_random.uniform(-0.1, 0.1, 2)
        mujoco.mj_forward(self.model, self.data)
        return self.seen(), {}

    def step(self, action):
        self.data.ctrl[:] = action
        mujoco.mj_step(self.model, self.data, self.skip)
        return self.seen(), -float(np.square(self.data.ctrl).sum()), False, False, {}


class Strict(gymnasium.Wrapper):
    def step(self, action):
        reply = self.env.step(action)
        if np.isnan(action).any():
            raise ValueError("the environment's own")
        return reply


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings into the folder


@pytest.fixture
def own():
    """Make one of Gymnasium's own environments."""
    pytest.importorskip("gymnasium.envs.mujoco", reason="gymnasium[mujoco] is not installed")
    return gymnasium.make


def run(env, *, seed=3, steps=40, actions=None):
    """Return what is seen at the reset and after each step, with the rewards."""
    rows = [[*env.reset(seed=seed)[0], 0.0]]
    size = env.action_space.shape[0]
    for k in range(steps):
        action = np.sin(0.2 * k + np.arange(size)) if actions is None else actions[k]
        rows.append([*(reply := env.step(action.astype(np.float32)))[0], reply[1]])
    return np.array(rows)


def actuated(env, **options):
    """Return one of Gymnasium's own environments with servos."""
    if env.spec.id.startswith("Reacher"):
        return ServoActuated(env, {"joint0": ANALOG, "joint1": ANALOG}, **options)
    return ServoActuated(env, {"slide": Mount(ANALOG.model, zero=-MIDDLE * 0.1, ratio=0.1)}, **options)


# ---------------------------------------------------------------------------------------- an environment

@pytest.mark.long
@pytest.mark.parametrize("name", ["Reacher-v5", "InvertedPendulum-v5"])
def test_the_checker_finds_nothing_that_it_does_not_find_without_servos(own, name):
    found = []
    for env in (own(name).unwrapped, actuated(own(name))):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            check_env(env, skip_render_check=True)
        found.append({str(one.message) for one in caught})
    more = found[1] - found[0]
    assert all("is different from the unwrapped version" in words for words in more)
    assert found[0] <= found[1]


@pytest.mark.long
@pytest.mark.parametrize("name", ["Reacher-v5", "InvertedPendulum-v5"])
def test_same_seed_same_episode_bit_for_bit(own, name):
    env = actuated(own(name))
    first = run(env)
    run(env, seed=8, steps=7)
    assert np.array_equal(run(env), first)
    assert np.array_equal(run(actuated(own(name))), first)


@pytest.mark.long
@pytest.mark.parametrize("options", [{"goes_back": False}, {"option": 'integrator="RK4"'}, {"skip": 1}])
def test_reset_leaves_nothing_of_the_episode_before(options):
    env = ServoActuated(Arm(**options), SERVOS)
    first = run(env)
    run(env, seed=8, steps=7)
    run(env, seed=9, steps=1)
    assert np.array_equal(run(env), first)


@pytest.mark.long
@pytest.mark.parametrize(("option", "command"), [
    ("", None), ('integrator="RK4"', None), ('integrator="implicitfast"', None), ("", "identity")])
def test_an_environment_with_servos_is_the_loop_written_by_hand(option, command):
    env = ServoActuated(Arm(option=option), SERVOS, command=command)
    seen = run(env)[:, :6]
    bare = Arm(option=option)
    ends = [(-REACH, REACH), (-1.2, REACH)] if command is None else [(-1.0, 1.0), (-2.0, 2.0)]
    drive = ServoDrive(bare.model, {"shoulder": SERVOS["turn"], "elbow": SERVOS["elbow"], "finger": SERVOS["grip"]},
                       joint_friction="clear", controls={
                           name: CommandMap(name, *own) for name, own in zip(("shoulder", "elbow"), ends, strict=True)})
    rows = [bare.reset(seed=3)[0]]
    for k in range(40):
        controls = np.sin(0.2 * k + np.arange(3)).astype(np.float32).astype(float)
        bare.data.ctrl[:] = [one.offset + one.scale * c for one, c in zip(env.maps.values(), controls, strict=True)]
        drive.step(bare.data, 4)
        rows.append(bare.seen())
    assert np.array_equal(seen, np.array(rows))


@pytest.mark.long
def test_rewards_see_the_action_and_not_the_angle(own):
    env = actuated(own("Reacher-v5"))
    env.reset(seed=1)
    action = np.array([0.5, -0.25], np.float32)
    info = env.step(action)[4]
    assert info["reward_ctrl"] == -(0.5**2 + 0.25**2)
    assert np.array_equal(env.data.ctrl, action)
    assert env.action_space == env.env.action_space


@pytest.mark.long
def test_the_policy_finds_its_angle():
    env = ServoActuated(Arm(), SERVOS)
    action = np.array([0.5, 0.5, 0.01])
    asked = [one.angle(control) for one, control in zip(env.maps.values(), action, strict=True)]
    reached = run(env, actions=[action] * 150)[-1, :3]
    assert reached == pytest.approx(asked, abs=math.radians(2.0))  # deadband and friction


@pytest.mark.long
def test_a_control_beyond_its_range_counts_as_the_end_of_it():
    ends, beyond = (np.array([[1.0, -2.0, 0.02]] * 40) * factor for factor in (1.0, 5.0))
    assert np.array_equal(run(ServoActuated(Arm(), SERVOS), actions=ends)[:, :6],
                          run(ServoActuated(Arm(), SERVOS), actions=beyond)[:, :6])


@pytest.mark.long
@pytest.mark.parametrize(("options", "damping", "loss"), [({}, 0.0, 0.0), ({"joint_friction": "keep"}, 0.1, 0.01)])
def test_friction_of_the_joints_goes_unless_it_is_kept(options, damping, loss):
    model = ServoActuated(Arm(), SERVOS, **options).drive.model
    assert model.dof_damping[0].flat[0] == damping
    assert model.dof_frictionloss[1] == loss


@pytest.mark.long
def test_what_servos_have_done_is_kept_by_episode():
    env = ServoActuated(Arm(), SERVOS)
    env.record()
    run(env, steps=9)
    run(env, steps=5)
    current = env.result()["elbow"]["armature_current"]
    assert current.shape == (5 * 4,)
    assert np.abs(current).max() > 0.1
    info = env.step(np.zeros(3))[4]
    assert np.array_equal(info["servo_torque"], env.drive.torque(env.data))


@pytest.mark.long
def test_a_shared_supply_is_given_by_names_of_actuators():
    supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=1.0)
    both = {"turn": ANALOG, "elbow": ANALOG}
    runs = [run(ServoActuated(Arm(), both, bus=bus)) for bus in (
        supply, [(supply, ["turn", "elbow"])], [(supply, ["shoulder", "elbow"])], None)]
    assert np.array_equal(runs[0], runs[1])
    assert np.array_equal(runs[0], runs[2])
    assert not np.array_equal(runs[0], runs[3])


# ---------------------------------------------------------------------------------------- several at once

@pytest.mark.long
def test_environments_side_by_side_do_not_disturb_each_other():
    many = gymnasium.vector.SyncVectorEnv([lambda: ServoActuated(Arm(), SERVOS)] * 2)
    rows = [many.reset(seed=[3, 5])[0]]
    for k in range(20):
        rows.append(many.step(np.array([np.sin(0.2 * k + np.arange(3))] * 2, np.float32))[0])
    for n, seed in enumerate((3, 5)):
        assert np.array_equal(np.array(rows)[:, n], run(ServoActuated(Arm(), SERVOS), seed=seed, steps=20)[:, :6])


@pytest.mark.long
def test_the_callback_is_there_during_a_step_alone():
    env = ServoActuated(Arm(), SERVOS)
    run(env, steps=2)
    assert mujoco.get_mjcb_control() is None
    mujoco.set_mjcb_control(callback := env.drive.callback())
    run(env, steps=2)
    found = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(None)
    assert found is callback


@pytest.mark.long
def test_a_foreign_callback_is_refused_and_stays():
    env = ServoActuated(Arm(), SERVOS)
    run(env, steps=2)

    def foreign(model, data):
        pass

    mujoco.set_mjcb_control(foreign)
    try:
        with pytest.raises(InputError, match=r"MuJoCo's control callback: got .*one that is not this drive's"):
            env.step(np.zeros(3))
        assert mujoco.get_mjcb_control() is foreign
    finally:
        mujoco.set_mjcb_control(None)


@pytest.mark.long
@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_behaves_like_the_original(again):
    env = ServoActuated(Arm(), SERVOS, command={"elbow": (0.0, 1.0)})
    assert np.array_equal(run(again(env)), run(env))


@pytest.mark.long
def test_a_specification_makes_it_once_more(own):
    env = actuated(own("Reacher-v5"), command={"joint0": (-1.0, 1.0)})
    assert np.array_equal(run(env.spec.make()), run(env))


# ---------------------------------------------------------------------------------------- maps

@pytest.mark.long
@pytest.mark.parametrize(("actuator", "mount", "ends"), [
    ('<motor name="a" joint="shoulder" ctrlrange="-1 1"/>', ANALOG, (-1, 1, -REACH, REACH)),
    ('<motor name="a" joint="shoulder" ctrlrange="-1 1"/>', Mount(ANALOG.model, direction=-1), (
        -1, 1, -math.radians(195.0), math.radians(15.0))),
    ('<motor name="a" joint="shoulder" ctrlrange="0 4"/>', DIGITAL, (0, 4, -math.pi, math.pi * 2047 / 2048)),
    ('<motor name="a" joint="elbow" ctrlrange="-3 3"/>', DIGITAL, (-3, 3, -1.2, 2.5)),
    ('<motor name="a" joint="elbow" ctrlrange="-3 3"/>', ANALOG, (-3, 3, -1.2, REACH)),
    ('<velocity name="a" joint="elbow" kv="2" ctrlrange="-3 3"/>', DIGITAL, (-3, 3, -1.2, 2.5)),
    ('<intvelocity name="a" joint="elbow" kp="2" actrange="-1 1" ctrlrange="-3 3"/>', DIGITAL, (-3, 3, -1.2, 2.5)),
    ('<motor name="a" joint="finger" ctrlrange="0 1"/>', Mount(DIGITAL, ratio=0.005), (
        0, 1, 0.0, 0.005 * math.pi * 2047 / 2048)),
    ('<position name="a" joint="elbow" kp="7" ctrlrange="-1 2"/>', ANALOG, (-1, 2, -1, 2)),
    ('<position name="a" joint="elbow" kp="7"/>', ANALOG, (-math.inf, math.inf, -math.inf, math.inf)),
    ('<position name="a" joint="elbow" kp="7" timeconst=".1"/>', ANALOG, (-math.inf, math.inf, -math.inf, math.inf)),
    ('<position name="a" joint="elbow" kp="7" gear="-2" ctrlrange="-1 2"/>', ANALOG, (-1, 2, 0.5, -1)),
    ('<general name="a" joint="elbow" gainprm="2" biastype="affine" biasprm="1 -4" ctrlrange="0 2"/>', ANALOG, (
        0, 2, 0.25, 1.25)),
])
def test_maps_follow_from_the_model(actuator, mount, ends):
    one = ServoActuated(Arm(actuator), {"a": mount}).maps["a"]
    assert (one.low, one.high, one.angle_low, one.angle_high) == pytest.approx(ends, abs=1e-6)
    middle = 0.3 * ends[0] + 0.7 * ends[1]
    if math.isfinite(middle):
        assert one.control(one.angle(middle)) == pytest.approx(middle, abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(("command", "words"), [
    ({"turn": (-0.5, 1.5)}, "shoulder: control -1 to 1 is -0.5 to 1.5 rad"),
    ({"shoulder": np.array([-0.5, 1.5])}, "shoulder: control -1 to 1 is -0.5 to 1.5 rad"),
    ({"turn": "identity"}, "shoulder: control -1 to 1 is -1 to 1 rad"),
    ("identity", "shoulder: control -1 to 1 is -1 to 1 rad"),
    ({"turn": CommandMap("", 0.0, 1.0, scale=2.0)}, "shoulder: control 0 to 1 is 0 to 2 rad"),
    ({"grip": (0.0, 0.03)}, "finger: control 0 to 0.02 is 0 to 0.03 m"),
])
def test_maps_can_be_given(command, words):
    assert words in [str(one) for one in ServoActuated(Arm(), SERVOS, command=command).maps.values()]


@pytest.mark.long
def test_controls_are_found_behind_an_actuator_with_several():
    two = '<pid joint="finger" kp="3" input="pos vel"/>'
    env = ServoActuated(Arm(two + MOTORS.splitlines()[0]), {"turn": ANALOG, "elbow": ANALOG})
    reached = run(env, actions=[np.array([0.0, 0.0, 0.5, 1.0])] * 150)[-1, :2]
    assert reached == pytest.approx([env.maps["turn"].angle(0.5), env.maps["elbow"].angle(1.0)], abs=math.radians(2.0))


@pytest.mark.long
def test_an_actuator_goes_before_a_joint_of_its_name():
    actuators = '<motor name="elbow" joint="shoulder" ctrlrange="-1 1"/><position name="b" joint="elbow" kp="1"/>'
    env = ServoActuated(Arm(actuators), {"b": DIGITAL, "elbow": ANALOG}, command={"elbow": (0.0, 1.0)})
    assert [str(one) for one in env.maps.values()] == [
        "elbow: control -inf to inf is -inf to inf rad", "shoulder: control -1 to 1 is 0 to 1 rad"]
    assert env.drive.model.dof_armature[:2] == pytest.approx([0.006, 2e-6])  # of the rotors through their gears


@pytest.mark.long
def test_an_actuator_without_a_name_goes_by_its_joint():
    env = ServoActuated(Arm(), {"elbow": ANALOG, "shoulder": ANALOG})
    assert list(env.maps) == ["elbow", "shoulder"]
    assert env.drive.joints == ("elbow", "shoulder")
    assert env.drive.model.actuator_gainprm[:, 0].tolist() == [0.0, 0.0, 30.0]
    assert env.drive.model.actuator_ctrlrange.tolist() == [[-1.0, 1.0], [-2.0, 2.0], [0.0, 0.02]]


# ---------------------------------------------------------------------------------------- bad input

@pytest.mark.parametrize(("actuators", "servos", "options", "kind", "words"), [
    (MOTORS, {"trun": ANALOG}, {}, UnknownNameError, ("'trun'", "did you mean 'turn'?", "elbow")),
    (MOTORS, {"ball": ANALOG}, {}, UnknownNameError, ("actuator, or joint with an actuator", "'ball'")),
    (MOTORS, {3: ANALOG}, {}, UnknownNameError, ("3", "turn")),
    (MOTORS, {"turn": ANALOG, "shoulder": ANALOG}, {}, InputError, ("actuator shoulder", "the one of turn once more")),
    (MOTORS + '<motor name="pull" tendon="both"/>', {"pull": ANALOG}, {}, InputError, (
        "actuator pull", "one at a tendon", "a hinge or a slide")),
    (MOTORS + '<motor name="roll" joint="ball" ctrlrange="-1 1"/>', {"roll": ANALOG}, {}, InputError, (
        "joint ball of actuator roll", "a ball joint", "a hinge or a slide")),
    (MOTORS + '<damper name="more" joint="elbow" kv="1" ctrlrange="0 1"/>', {"elbow": ANALOG}, {}, InputError, (
        "actuators of joint elbow", "1, more", "one")),
    ('<pid name="a" joint="elbow" kp="3" input="pos vel"/>', {"a": ANALOG}, {}, InputError, (
        "actuator a", "2 controls")),
    ('<motor name="a" joint="elbow"/>', {"a": ANALOG}, {}, InputError, ("command of a", "without a control range")),
    (MOTORS, {"elbow": Mount(ANALOG.model, zero=9.0)}, {}, InputError, ("command of elbow", "a range in common")),
    (MOTORS, {}, {}, InputError, ("servos of an environment", "{}")),
    (MOTORS, ANALOG, {}, InputError, ("servos of an environment", "a mapping")),
    (MOTORS, {"turn": "hs-755hb"}, {}, InputError, ("servo of a joint", "'hs-755hb'", "PulseServo")),
    (MOTORS, SERVOS, {"command": {"turn": (0.0, math.nan)}}, InputError, ("command of turn", "nan", "finite")),
    (MOTORS, SERVOS, {"command": {"turn": (0.0, math.inf)}}, InputError, ("command of turn", "inf", "finite")),
    (MOTORS, SERVOS, {"command": {"turn": (1.0, -1.0)}}, InputError, ("command of turn", "(1.0, -1.0)", "lowest")),
    (MOTORS, SERVOS, {"command": {"turn": (1.0, 1.0)}}, InputError, ("command of turn", "(1.0, 1.0)", "lowest")),
    (MOTORS, SERVOS, {"command": {"turn": (1.0, 2.0, 3.0)}}, InputError, ("command of turn", "(lowest, highest)")),
    (MOTORS, SERVOS, {"command": {"turn": "angle"}}, InputError, ("command of turn", "'angle'", "'identity'")),
    (MOTORS, SERVOS, {"command": {"turm": (0.0, 1.0)}}, UnknownNameError, ("'turm'", "did you mean 'turn'?")),
    (MOTORS, {"turn": ANALOG}, {"command": {"elbow": (0.0, 1.0)}}, UnknownNameError, ("actuator with a servo", "turn")),
    (MOTORS, SERVOS, {"command": 3.0}, InputError, ("command", "3.0", "a mapping")),
    (MOTORS, SERVOS, {"bus": 3.0}, InputError, ("bus", "3.0", "a Supply")),
    (MOTORS, SERVOS, {"joint_friction": "refuse"}, InputError, ("damping", "shoulder 0.1", "'clear'")),
])
def test_bad_input_is_refused_in_one_line(actuators, servos, options, kind, words):
    with pytest.raises(kind) as caught:
        ServoActuated(Arm(actuators), servos, **options)
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.parametrize(("scale", "offset", "low", "high", "words"), [
    (0.0, 0.0, -1.0, 1.0, "scale 0.0"), (math.nan, 0.0, -1.0, 1.0, "scale nan"),
    (1.0, math.inf, -1.0, 1.0, "offset inf"), (1.0, 0.0, 1.0, 1.0, "1.0 to 1.0"),
    (1.0, 0.0, 1.0, -1.0, "low below high"), (1.0, 0.0, math.nan, 1.0, "nan"),
])
def test_a_map_that_is_none_is_refused(scale, offset, low, high, words):
    with pytest.raises(InputError, match=words):
        CommandMap("elbow", low, high, scale, offset)


@pytest.mark.long(but="<lambda>-words0")
@pytest.mark.parametrize(("make", "words"), [
    (lambda: gymnasium.make("CartPole-v1"), ("model and data of CartPoleEnv", "NoneType", "an MjModel and an MjData")),
    (lambda: Arm().model, ("env", "'MjModel'", "a gymnasium.Env")),
    (lambda: ServoActuated(Arm(), {"turn": ANALOG}), ("env", "one that has servos", "all servos at once")),
    (lambda: gymnasium.wrappers.TimeLimit(ServoActuated(Arm(), {"turn": ANALOG}), 5), ("one that has servos",)),
])
def test_an_environment_that_cannot_have_servos_is_refused(make, words):
    with pytest.raises(InputError) as caught:
        ServoActuated(make(), {"elbow": ANALOG})
    assert all(word in str(caught.value) for word in words), str(caught.value)


@pytest.mark.long
def test_an_environment_that_changes_its_model_is_refused():
    env = ServoActuated(bare := Arm(), SERVOS)
    bare.model, bare.data = Arm().model, mujoco.MjData(Arm().model)
    with pytest.raises(InputError, match="model of the environment: got 'another one"):
        env.reset()


@pytest.mark.long
def test_what_goes_wrong_in_a_step_is_told_and_the_next_episode_is_well():
    env = ServoActuated(Arm(), SERVOS)
    first = run(env)
    with pytest.raises(SimulationError, match="joint elbow: its angle, speed or command in MuJoCo is not a number"):
        env.step(np.array([0.0, math.nan, 0.0]))
    assert mujoco.get_mjcb_control() is None
    assert np.array_equal(run(env), first)
    strict = ServoActuated(Strict(Arm()), SERVOS)
    strict.reset()
    with pytest.raises(ValueError, match="the environment's own"):
        strict.step(np.array([0.0, math.nan, 0.0]))
    assert np.array_equal(run(strict), first)
    env.data.qvel[0] = 1e12
    with pytest.raises(SimulationError, match="has started anew"):
        env.step(np.zeros(3))
    assert np.array_equal(run(env), first)


# ---------------------------------------------------------------------------------------- imports

@pytest.mark.long
def test_robots_load_neither_gymnasium_nor_mujoco():
    code = "import sys, servotwin.robots; print({'gymnasium', 'mujoco'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_without_gymnasium_one_line_says_what_to_install(monkeypatch):
    monkeypatch.delitem(sys.modules, "servotwin.robots.gym")
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'servotwin\[robots\]'"):
        import servotwin.robots.gym  # noqa: F401


@pytest.mark.long
def test_options_that_nobody_reads_are_refused(own):
    env = actuated(own("Reacher-v5"))
    with pytest.raises(UnknownNameError, match="unknown option of reset 'angle': allowed: none"):
        env.reset(seed=1, options={"angle": 1.0})
    env.reset(seed=1, options={})
    ServoActuated(Arm(), SERVOS).reset(seed=1, options={"angle": 1.0})  # an own reset may read it


@pytest.mark.long
def test_info_has_what_the_servos_do():
    env = ServoActuated(Arm(), SERVOS)
    env.reset(seed=1)
    info = env.step(np.array([1.0, 2.0, 0.01]))[4]
    names = {f"servo_{name}" for name in ("torque", "current", "voltage", "trip")}
    assert {name: value.shape for name, value in info.items() if name in names} == dict.fromkeys(names, (3,))
    assert np.array_equal(info["servo_current"], env.drive.look(env.data, "armature_current"))
    assert np.abs(info["servo_current"]).max() > 0.1
    assert np.isfinite(info["servo_trip"]).any()  # of the bus servo
