"""Servos as actuators of Isaac Lab: its own classes around MuJoCo's joints, for its simulator does not install here."""

import sys
from importlib.util import find_spec
from types import SimpleNamespace
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Mount, ServoDrive

pytest.importorskip("isaaclab", reason="isaaclab is not installed: it needs an environment of its own")
if find_spec("carb") is None:  # Omniverse, of which nothing is called
    sys.modules |= {part: MagicMock() for part in ("carb", "omni", "omni.client", "omni.log")}
import torch
from isaaclab.utils.types import ArticulationActions

from servotwin.robots.trainers.isaaclab import ServoActuatorCfg

pytestmark = pytest.mark.slow
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
BUS = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": 0.0}))
TURNED = Mount(SERVO, zero=0.3, direction=-1, ratio=1.5)
NAMES = ["shoulder", "elbow"]
ARM = """<mujoco><option timestep="{step}" integrator="implicitfast"/><worldbody><body pos="0 0 .1">{free}
<geom size=".05" mass="2"/><body><joint name="shoulder" axis="0 -1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".1"/><body pos=".1 0 0"><joint name="elbow" axis="0 -1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".08"/></body></body></body></worldbody>{actuators}
</mujoco>"""
ACTUATORS = '<actuator><position joint="shoulder"/><position joint="elbow"/></actuator>'


def goals(time):
    return [0.4 + 0.3 * np.sin(4 * time), 0.3 * np.cos(5 * time)]


def model_of(step, actuators="", free=""):
    return mujoco.MjModel.from_xml_string(ARM.format(step=step, actuators=actuators, free=free))


def by_servo_drive(servo, step, duration, free=""):
    model = model_of(step, ACTUATORS, free)
    drive, data = ServoDrive(model, dict.fromkeys(NAMES, servo)), mujoco.MjData(model)
    drive.reset(data)
    angles = []
    for k in range(round(duration / step)):
        data.ctrl[:] = goals(k * step)
        drive.step(data)
        angles.append(data.qpos[-2:].copy())
    return np.array(angles)


def actuator_of(step=2e-3, envs=2, ids=slice(None), **more):
    cfg = ServoActuatorCfg(**{"joint_names_expr": [".*"], "servo": SERVO, "timestep": step} | more)
    return cfg.class_type(cfg, NAMES, ids, envs, "cpu")


def mass_of(model, data):
    found = np.zeros((model.nv, model.nv))
    for row, unit in zip(found, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return found


def by_isaac_lab(servo, step, duration, free="", armature=True):
    """Return the angles of an arm in MuJoCo under the efforts of the second of two environments."""
    actuator, model = actuator_of(step, servo=servo, armature_in_mass_matrix=armature), model_of(step, free=free)
    model.dof_armature[-2:] = actuator.armature[1].numpy()
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data, angles, kept = mujoco.MjData(model), [], None
    mujoco.mj_forward(model, data)

    def two(values):
        return torch.tensor(np.array([values, values]), dtype=torch.float32)

    for k in range(round(duration / step)):
        mass = mass_of(model, data)
        if not armature:
            mass[[-2, -1], [-2, -1]] -= model.dof_armature[-2:]
        actuator.meet(two(mass), two(data.qacc[-2:]))
        action = ArticulationActions(two(goals(k * step)), torch.zeros(2, 2), torch.zeros(2, 2))
        given = actuator.compute(action, two(data.qpos[-2:]), two(data.qvel[-2:]))
        assert given.joint_positions is given.joint_velocities is None
        data.qfrc_applied[-2:] = kept = given.joint_efforts[1].numpy()
        mujoco.mj_step(model, data)
        angles.append(data.qpos[-2:].copy())
    assert kept is not None
    return np.array(angles)


@pytest.mark.parametrize(("servo", "more"), [
    (SERVO, {}), (BUS, {}), (TURNED, {"armature": False}), (BUS, {"free": '<freejoint/>'})],
    ids=["pulses", "bus", "by a gear, armature apart", "on a free base"])
def test_joints_are_those_of_servo_drive_by_steps_of_first_order(servo, more):
    true = by_servo_drive(servo, 2.5e-4, 0.6, more.get("free", ""))
    at_two, at_four = (
        np.sqrt(np.mean((by_isaac_lab(servo, step, 0.6, **more) - true[each - 1::each]) ** 2, axis=0)).max()
        for step, each in ((2e-3, 8), (4e-3, 16)))
    assert at_two <= 2.5e-3
    assert at_four >= 1.4 * at_two


def test_servos_vary_from_environment_to_environment():
    actuator = actuator_of(envs=4, vary={"output_inertia": "uniform:30%"})
    assert actuator.armature.shape == (4, 2)
    assert len(torch.unique(actuator.armature)) == 8
    assert len(torch.unique(actuator_of(envs=4).armature)) == 1
    for vary, other in (("output_inertia", False), ("friction.coulomb_torque_forward", True)):
        actuator = actuator_of(envs=4, vary={vary: "uniform:30%"})
        before = actuator.parameters()
        actuator.reset([2])
        for joint, columns in actuator.parameters().items():
            for name, values in columns.items():
                assert (values == before[joint][name]).tolist() == [True, True, not other, True]


def test_environments_are_reset_by_number():
    actuator = actuator_of(envs=3)

    def step():
        actuator.meet(0.01 * torch.eye(2).repeat(3, 1, 1), torch.zeros(3, 2))
        action = ArticulationActions(torch.full((3, 2), 0.5), None, None)
        return actuator.compute(action, torch.zeros(3, 2), torch.zeros(3, 2)).joint_efforts.clone()

    first = step()
    for _ in range(20):
        later = step()
    assert (later != first).any()
    actuator.reset([1])
    assert not actuator.torque[1].any()
    again = step()
    assert torch.equal(again[1], first[1])
    assert not torch.equal(again[0], first[0])


@pytest.mark.parametrize(("more", "words"), [
    ({"armature": 0.1}, "^armature of a ServoActuatorCfg: got 0.1"), ({"timestep": 0.0}, "^timestep of a Servo"),
    ({"servo": "sts3215"}, "^servo"), ({"effort_limit": 3.0}, "^effort_limit of a S"),
    ({"servo": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, "got 'play'")])
def test_mistakes_are_said_in_a_line(more, words):
    with pytest.raises(InputError, match=words):
        actuator_of(**more)


def test_an_effort_without_inertias_is_refused():
    action = SimpleNamespace(joint_positions=torch.zeros(2, 2))
    with pytest.raises(InputError, match=r"^inertias of joints with servos"):
        actuator_of().compute(action, torch.zeros(2, 2), torch.zeros(2, 2))
