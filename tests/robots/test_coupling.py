"""Joints that an equality couples to others: they follow, have no servo, and their need counts at what drives them."""

import math

import mujoco
import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.models import default_model
from servotwin.robots import Motion, ServoDrive, run_motion, sizing_of
from servotwin.robots.servos.coupling import couple, couplings_of

G, MASS, LENGTH = 9.81, 0.02, 0.02  # of a finger
SERVO = default_model(st.load_servo("towerpro-mg996r"))
FINGER = f"""<body pos="{{}} 0 0"><joint name="{{}}" axis="0 {{}} 0" {{}}/>
  <inertial pos="0 0 {LENGTH}" mass="{MASS}" diaginertia="1e-6 1e-6 1e-6"/></body>"""
MIMIC = '<equality><joint joint1="grip2" joint2="grip" polycoef="0 {} 0 0 0"/></equality>'
CORD = ('<tendon><fixed name="cord"><joint joint="grip2" coef="1"/><joint joint="grip" coef="-1"/></fixed></tendon>'
        '<equality><tendon tendon1="cord"/></equality>')


def fingers(rest, axis=-1, own=""):
    """Return two fingers that stand up and fall outwards."""
    return f"""<mujoco><option timestep="0.001"/><worldbody>{FINGER.format(.01, "grip", 1, "")}
      {FINGER.format(-.01, "grip2", axis, own)}</worldbody>{rest}</mujoco>"""


def model_of(rest, **more):
    return mujoco.MjModel.from_xml_string(fingers(rest, **more))


BEND = '<joint joint1="a" joint2="b" polycoef="0.1 2 .5 0 0"/>'
BODY = '<body><joint name="{}" axis="0 1 0"/><geom size=".1"/></body>'
TENDONS = """<tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed>
  <fixed name="u"><joint joint="c" coef="2"/></fixed></tendon>"""
PULL = '<actuator><position joint="a"/></actuator>'


@pytest.mark.parametrize(("rest", "words", "angles"), [
    (f"<equality>{BEND}</equality>", ["a follows b"], [0.1 + 0.4 + 0.02, 0.2, 0.3]),
    (f"<equality>{BEND}</equality>{PULL}", ["b follows a"], [0.1, math.nan, 0.3]),
    (f'<equality>{BEND}<joint joint1="a" joint2="c"/></equality>', ["a follows b", "c follows b"],
     [0.52, 0.2, 0.52]),
    ('<equality><joint joint1="c" joint2="b" polycoef="0 2 0 0 0"/><joint joint1="b" joint2="a"/></equality>',
     ["b follows a", "c follows a"], [0.1, 0.1, 0.2]),
    ('<equality><joint joint1="a" joint2="b" active="false"/></equality>', [], [0.1, 0.2, 0.3]),
    ('<equality><joint joint1="a" polycoef=".2 0 0 0 0"/></equality>', ["a is held by an equality"], [0.2, 0.2, 0.3]),
    (f'{TENDONS}<equality><tendon tendon1="t"/></equality>', ["a follows b"], [0.2, 0.2, 0.3]),
    (f'{TENDONS}<equality><tendon tendon1="t" tendon2="u"/></equality>', ["a follows b and c"], [0.8, 0.2, 0.3]),
    ("", [], [0.1, 0.2, 0.3])])
def test_what_follows_what(rest, words, angles):
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{''.join(BODY.format(name) for name in 'abc')}</worldbody>{rest}</mujoco>")
    found = couplings_of(model)
    assert sorted(each.words.removesuffix(" and gets no servo") for each in found.values()) == words
    qpos = np.array([0.1, 0.2, 0.3])
    couple(model, qpos)
    at = dict(zip("abc", qpos, strict=True))
    for name, angle in zip("abc", angles, strict=True):
        assert math.isnan(angle) or at[name] == pytest.approx(angle, abs=1e-9)
    if BEND in rest:  # of which b is found backwards
        assert at["a"] == pytest.approx(0.1 + 2.0 * at["b"] + 0.5 * at["b"]**2, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(("rest", "axis", "ratio"), [
    (MIMIC.format(1), -1, 1.0), (MIMIC.format(-1), 1, 1.0), (MIMIC.format(0.5), -1, 0.5), (CORD, -1, 1.0)])
def test_what_a_pair_needs_counts_at_its_driver(rest, axis, ratio):
    """Held at 0.4 rad: m g l (sin q + r sin r q); a motion without the follower does not hold it at 0."""
    model = model_of(rest, axis=axis)
    motion = Motion(time=[0.0, 0.2, 0.4], angles={"grip": [0.4, 0.4, 0.4]}, source="hold")
    run = run_motion(model, {"grip": SERVO}, motion, settle=0.1)
    expected = MASS * G * LENGTH * (math.sin(0.4) + ratio * math.sin(ratio * 0.4))
    assert -run.ideal.torque["grip"][-1] == pytest.approx(expected, rel=1e-9)
    assert abs(run.poses[-1, 1]) == pytest.approx(ratio * run.poses[-1, 0], abs=5e-3)
    assert run.notes[0] == "grip2 follows grip and gets no servo"
    assert list(sizing_of(run)) == ["grip"]


@pytest.mark.long
def test_goals_and_actuators_of_a_follower_are_left_out():
    """A recorded motion has a column of each joint."""
    both = '<actuator><position joint="grip" kp="5"/><position name="hold" joint="grip2" kp="5"/></actuator>'
    motion = Motion(time=[0.0, 0.2], angles={"grip": [0.3, 0.3], "grip2": [0.0, 0.0]}, source="recorded")
    run = run_motion(model_of(MIMIC.format(1) + both), {"grip": SERVO}, motion, settle=0.1)
    assert run.motion.joints == ("grip",)
    assert run.notes == ("grip2 follows grip and gets no servo",
                         "actuator hold at grip2 has no force: the joint follows",
                         "goals of joint grip2 are left out: it follows")
    assert run.poses[-1, 1] == pytest.approx(run.poses[-1, 0], abs=5e-3)
    alone = Motion(time=[0.0, 0.2], angles={"grip2": [0.0, 0.0]}, source="recorded")
    with pytest.raises(InputError, match="joints of recorded: got 'grip2', allowed: one that does not follow"):
        run_motion(model_of(MIMIC.format(1)), {"grip": SERVO}, alone)


@pytest.mark.parametrize("rest", [MIMIC.format(1), CORD])
def test_a_servo_at_a_follower_is_refused_by_name(rest):
    with pytest.raises(InputError, match="servo of joint grip2: got 'one of its own', allowed: none: grip2 follows"):
        ServoDrive(model_of(rest), {"grip": SERVO, "grip2": SERVO})


def test_an_actuator_at_a_tendon_of_a_joint_with_a_servo_is_refused():
    cord = ('<tendon><fixed name="cord"><joint joint="grip" coef="1"/><joint joint="grip2" coef="1"/></fixed></tendon>'
            '<actuator><motor name="pull" tendon="cord"/></actuator>')
    with pytest.raises(InputError, match="actuators of joint grip: got 'pull at a tendon of it'"):
        ServoDrive(model_of(cord), {"grip": SERVO})
