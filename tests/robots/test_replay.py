"""Recorded goals that go through a simulated robot, beside what was measured."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import links, servo
from servotwin.errors import InputError
from servotwin.robots import Motion, run_motion, validate_robot
from servotwin.robots.replay import ALL, IDEAL, LOADED, MOVING, RESTING, SERVOS, Gains, position_run

pytestmark = pytest.mark.long

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
RATE, JOINTS = 30.0, ("shoulder", "elbow")
PLANT = mujoco.MjModel.from_xml_string(links(dt=2e-3))


def model(gain=1.0):
    own = servo(st.DigitalServo).servo
    return st.DigitalServo(own.replace({name: gain * own.get(name) for name in (
        "motor.torque_constant", "motor.back_emf_constant")}))


def goals(seconds=2.0):
    time = np.arange(int(seconds * RATE)) / RATE
    wave = 0.2 * (1.0 - np.cos(2.0 * np.pi * np.clip(time - 0.3, 0.0, 1.0)))
    return time, {"shoulder": wave, "elbow": -0.5 * wave}


def recorded(late=0.012, gain=1.3):
    """Return a motion whose goals acted later than positions were read, by servos of another gain."""
    time, angles = goals()
    run = run_motion(PLANT, dict.fromkeys(JOINTS, model(gain)), Motion(time=time, angles=angles, source="real"),
                     hold="previous")
    return Motion(time=time, angles=angles, source="recorded", measured={
        joint: np.interp(time - late, run.time, run.record[joint]["joint_angle"]) for joint in JOINTS})


def test_the_robot_that_was_recorded_is_not_off_and_the_latency_is_found():
    found = validate_robot(PLANT, dict.fromkeys(JOINTS, model(1.3)), recorded())
    assert found.latency[SERVOS] == pytest.approx(0.012, abs=1e-3)
    assert found.rms() < math.radians(0.05)
    assert found.rms(IDEAL) > 10.0 * found.rms()
    off = validate_robot(PLANT, dict.fromkeys(JOINTS, model()), recorded(), rivals=())
    assert off.rms() > 5.0 * found.rms()
    assert set(off.errors) == {SERVOS, IDEAL}


def test_errors_by_joint_and_kind_are_those_of_the_samples():
    found = validate_robot(PLANT, dict.fromkeys(JOINTS, model()), [recorded(), recorded()], rivals=(), latency=0.0)
    one = found.replays[1]
    error = one.simulated[SERVOS]["elbow"] - one.measured["elbow"]
    told = found.errors[SERVOS]["elbow"]
    assert told[ALL].rms == pytest.approx(math.sqrt(np.mean(error**2)))
    assert told[ALL].largest == pytest.approx(np.abs(error).max())
    assert told[MOVING].samples + told[RESTING].samples == told[ALL].samples == 2 * len(one.time)
    assert 10 < told[MOVING].samples / 2 < 50
    assert told[LOADED].samples == 0
    worst = found.windows[0]
    inside = (one.time >= worst.start) & (one.time <= worst.stop)
    seen = one.simulated[SERVOS][worst.joint][inside] - one.measured[worst.joint][inside]
    assert worst.rms == pytest.approx(math.sqrt(np.mean(seen**2)))
    assert worst.stop - worst.start == pytest.approx(1.0, abs=0.05)


def test_position_actuators_are_those_of_mujoco():
    time, angles = goals()
    run = run_motion(PLANT, dict.fromkeys(JOINTS, model()), Motion(time=time, angles=angles, source="x"))
    gains = Gains(name="own", stiffness=20.0, velocity_gain=0.3, damping=0.1, friction=0.01, armature=0.01, force=0.5)
    xml = links(dt=2e-3).replace('axis="0 1 0"', 'axis="0 1 0" damping="0.1" frictionloss="0.01" armature="0.01"')
    drives = "".join(f'<position joint="{joint}" kp="20" kv="0.3" forcerange="-0.5 0.5"/>' for joint in JOINTS)
    other = mujoco.MjModel.from_xml_string(xml.replace("</mujoco>", f"<actuator>{drives}</actuator></mujoco>"))
    data, reached = mujoco.MjData(other), []
    for t in run.time - 2e-3:
        k = max(int(np.searchsorted(time, t + 1e-9, side="right")) - 1, 0)
        data.ctrl[:] = [angles[joint][k] for joint in JOINTS]
        mujoco.mj_step(other, data)
        reached.append(data.qpos.copy())
    found = position_run(run, gains)
    np.testing.assert_allclose(np.stack([found[joint] for joint in JOINTS], 1), reached, atol=2e-3)


@pytest.mark.parametrize(("change", "words"), [
    ({"measured": {}}, "measured positions: got 'none'"), ({"measured": {"wrist": np.zeros(60)}}, "joints of recorded"),
])
def test_bad_input(change, words):
    with pytest.raises(InputError, match=words):
        validate_robot(PLANT, dict.fromkeys(JOINTS, model()), replace(recorded(), **change))
