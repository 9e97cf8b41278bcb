"""Servos as actuators of Isaac Lab, 2.3 or 3, as installed: its own classes around MuJoCo's joints.

Its simulator does not install here.
"""

import sys
from dataclasses import field
from importlib.util import find_spec
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
import warp as wp
from isaaclab import actuators as lab
from isaaclab.utils.string import resolve_matching_names
from isaaclab.utils.types import ArticulationActions

from servotwin.robots.trainers.isaaclab import ServoActuatorCfg

pytestmark = pytest.mark.slow
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
BUS = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": 0.0}))
TURNED = Mount(SERVO, zero=0.3, direction=-1, ratio=1.5)
NAMES = ["shoulder", "elbow"]
IN_THREE = hasattr(lab, "ActuatorCollection")
FILE = {"stiffness": 7.0, "damping": 0.7, "armature": 0.5, "friction": 0.1, "dynamic_friction": 0.1,
        "viscous_friction": 0.1, "effort_limit": 0.2, "velocity_limit": 9.0}  # of the joints, in the robot's file
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


class Joints:
    """Joints of an articulation and their actuators, which each version makes, asks and resets in its own way."""

    def __init__(self, cfgs, envs):
        self.envs, self.angle, self.speed, self.goal = envs, *(torch.zeros(envs, 2) for _ in range(3))
        self.written = {name: torch.full((envs, 2), value) for name, value in FILE.items()}
        self.groups = self.made_in_two(cfgs) if not IN_THREE else lab.ActuatorCollection(cfgs, control_of(self))

    def made_in_two(self, cfgs):
        """Return actuators as the articulation of 2.3 makes them, and write to its joints what they say."""
        groups = {}
        for name, cfg in cfgs.items():
            ids, names = resolve_matching_names(cfg.joint_names_expr, NAMES)
            groups[name] = one = cfg.class_type(
                cfg=cfg, joint_names=names, joint_ids=slice(None) if len(ids) == 2 else torch.tensor(ids),
                num_envs=self.envs, device="cpu", **{key: self.written[key][:, ids] for key in FILE})
            for key in FILE:
                limit = getattr(one, key + "_sim", None)
                self.written[key][:, ids] = getattr(one, key) if limit is None else limit
        return groups

    def efforts(self, goal, angle, speed):
        self.goal[:], self.angle[:], self.speed[:] = goal, angle, speed
        if IN_THREE:
            self.groups.target_command.position.torch[:] = goal
            self.groups.compute(dt=0.0)
            assert torch.equal(self.groups.applied_effort.torch, self.groups.output_command.effort.torch)
            return self.groups.output_command.effort.torch.clone()
        found = torch.full((self.envs, 2), torch.nan)
        for one in self.groups.values():
            at = one.joint_indices
            given = one.compute(ArticulationActions(goal[:, at], goal[:, at], goal[:, at]), angle[:, at], speed[:, at])
            assert given.joint_positions is given.joint_velocities is None
            assert torch.equal(given.joint_efforts, one.applied_effort)
            found[:, at] = given.joint_efforts
        return found

    def reset(self, env_ids):
        for one in [self.groups] if IN_THREE else self.groups.values():
            one.reset(env_ids)


def control_of(joints):
    """Return what stands between the actuators of Isaac Lab 3 and an articulation."""
    from isaaclab.utils.warp import ProxyArray

    keys = {key: key for key in FILE if not key.endswith("_limit")}
    keys |= {"joint_effort_limit": "effort_limit", "joint_velocity_limit": "velocity_limit"}

    class Control(lab.ActuatorControl):
        num_instances, num_joints, num_fixed_tendons, device = joints.envs, 2, 0, "cpu"
        joint_pos, joint_vel = (ProxyArray(wp.from_torch(one)) for one in (joints.angle, joints.speed))
        resolve_env_ids = resolve_joint_ids = assert_shape_and_dtype = assert_shape_and_dtype_mask = None
        submit_commands = None

        def find_joints(self, name_keys):
            ids, names = resolve_matching_names(name_keys, NAMES)
            return ProxyArray(wp.array(ids, dtype=wp.int32)), names

        def get_default_joint_properties(self, joint_ids):
            return {key: joints.written[of][:, joint_ids].clone() for key, of in keys.items()}

        def write_resolved_joint_properties(self, properties, joint_ids, *, implicit, native_managed):
            assert not implicit
            assert not native_managed
            for key, values in properties.items():
                joints.written[keys[key]][:, joint_ids] = values

    return Control()


def cfg_of(step=2e-3, **more):
    return ServoActuatorCfg(**{"joint_names_expr": [".*"], "servo": SERVO, "timestep": step} | more)


def actuator_of(envs=2, **more):
    return Joints({"arm": cfg_of(**more)}, envs).groups["arm"]


def mass_of(model, data):
    found = np.zeros((model.nv, model.nv))
    for row, unit in zip(found, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return found


def by_isaac_lab(servo, step, duration, free="", armature=True, groups=(".*",)):
    """Return the angles of an arm in MuJoCo under the efforts of the second of two environments."""
    joints = Joints({name: cfg_of(step, joint_names_expr=[name], servo=servo, armature_in_mass_matrix=armature)
                     for name in groups}, 2)
    model = model_of(step, free=free)
    model.dof_armature[-2:] = joints.written["armature"][1].numpy()
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data, angles = mujoco.MjData(model), []
    mujoco.mj_forward(model, data)

    def two(values):
        return torch.tensor(np.array([values, values]), dtype=torch.float32)

    for k in range(round(duration / step)):
        mass = mass_of(model, data)
        if not armature:
            mass[[-2, -1], [-2, -1]] -= model.dof_armature[-2:]
        for one in joints.groups.values():
            one.meet(two(mass), two(data.qacc[-2:]))
        data.qfrc_applied[-2:] = joints.efforts(two(goals(k * step)), two(data.qpos[-2:]), two(data.qvel[-2:]))[1]
        mujoco.mj_step(model, data)
        angles.append(data.qpos[-2:].copy())
    return np.array(angles)


@pytest.mark.parametrize(("servo", "more"), [
    (SERVO, {}), (BUS, {}), (TURNED, {"armature": False}), (BUS, {"free": '<freejoint/>'}), (BUS, {"groups": NAMES})],
    ids=["pulses", "bus", "by a gear, armature apart", "on a free base", "each in its own group"])
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


def test_joints_have_the_rotor_of_the_servo_and_nothing_of_their_file():
    model = model_of(1e-3, ACTUATORS)
    ServoDrive(model, dict.fromkeys(NAMES, TURNED))
    written = Joints({"arm": cfg_of(servo=TURNED).copy()}, 2).written
    assert written["armature"].numpy() == pytest.approx(np.array([model.dof_armature] * 2), rel=1e-6)
    for name in ("friction", "dynamic_friction", "viscous_friction"):
        assert not written[name].any()
    assert written["effort_limit"].min() >= 1e8
    assert cfg_of().replace(servo=TURNED).armature == cfg_of(servo=TURNED).armature != cfg_of().armature


@pytest.mark.parametrize("ids", [[1], torch.tensor([1]), wp.array([1], dtype=wp.int32), slice(1, 2)], ids=[
    "list", "torch", "warp", "slice"])
def test_environments_are_reset_by_number(ids):
    joints = Joints({"arm": cfg_of()}, 3)
    actuator = joints.groups["arm"]

    def step():
        actuator.meet(0.01 * torch.eye(2).repeat(3, 1, 1), torch.zeros(3, 2))
        return joints.efforts(torch.full((3, 2), 0.5), torch.zeros(3, 2), torch.zeros(3, 2))

    first = step()
    for _ in range(20):
        later = step()
    assert (later != first).any()
    joints.reset(ids)
    assert not actuator.torque[1].any()
    again = step()
    assert torch.equal(again[1], first[1])
    assert not torch.equal(again[0], first[0])
    joints.reset(None)
    assert torch.equal(step(), first)


@pytest.mark.parametrize(("more", "words"), [
    ({"armature": 0.1}, "^armature of a ServoActuatorCfg: got 0.1"), ({"timestep": 0.0}, "^timestep of a Servo"),
    ({"servo": "sts3215"}, "^servo"), ({"effort_limit": 3.0}, "^effort_limit of a S"),
    ({"servo": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, "got 'play'")])
def test_mistakes_are_said_in_a_line(more, words):
    with pytest.raises(InputError, match=words):
        actuator_of(**more)


def test_an_effort_without_inertias_is_refused():
    with pytest.raises(InputError, match=r"^inertias of joints with servos"):
        Joints({"arm": cfg_of()}, 2).efforts(*torch.zeros(3, 2, 2))


@pytest.mark.parametrize(("mass", "acceleration", "words"), [
    (torch.eye(2).repeat(2, 1, 1).double(), torch.zeros(2, 2), "^mass_matrix of .* got 'Tensor of torch.float64"),
    (torch.eye(1).repeat(2, 1, 1), torch.zeros(2, 2), r"^mass_matrix of .* \(2, 1, 1\).*, allowed: .* \(2, 2, 2\)"),
    (torch.eye(2).repeat(2, 1, 1), wp.zeros((2, 2)), r"^acceleration of .* got .array of .*\.torch"),
    (torch.eye(2).repeat(2, 1, 1), [[0.0, 0.0]], "^acceleration of .* got 'list of no numbers"),
    (1e-4 * torch.eye(2).repeat(2, 1, 1), torch.zeros(2, 2), "^armature_in_mass_matrix of .*got 'True, and")])
def test_inertias_and_accelerations_are_checked(mass, acceleration, words):
    with pytest.raises(InputError, match=words):
        actuator_of().meet(mass, acceleration)


def test_a_mass_matrix_of_bodies_alone_passes_where_it_is_said():
    actuator_of(armature_in_mass_matrix=False).meet(1e-4 * torch.eye(2).repeat(2, 1, 1), torch.zeros(2, 2))


def test_a_configuration_keeps_mounts_and_distributions_through_copies_of_configurations():
    from isaaclab.utils.configclass import configclass

    @configclass
    class Robot:
        actuators: dict = field(default_factory=dict)

    @configclass
    class Scene:
        robot: Robot = Robot(actuators={"arm": cfg_of(servo=TURNED, vary=st.distributions.stated(SERVO))})

    found = Scene().copy().robot.actuators["arm"]
    assert (found.servo.value, found.vary.value) == (TURNED, st.distributions.stated(SERVO))
    assert found.class_type is ServoActuatorCfg().class_type
