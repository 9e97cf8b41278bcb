"""Servos among mjlab's actuators, in mjlab itself."""

import mujoco
import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import Mount, WarpDrive

pytest.importorskip("mjlab", reason="mjlab is not installed: it needs a MuJoCo and an environment of its own")
import mujoco_warp as mjw
import torch
import warp as wp
from mjlab.actuator import BuiltinPositionActuatorCfg
from mjlab.entity import EntityArticulationInfoCfg, EntityCfg
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg
from mjlab.envs.mdp import joint_pos_rel, time_out
from mjlab.envs.mdp.actions import JointPositionActionCfg
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.managers.termination_manager import TerminationTermCfg
from mjlab.scene import Scene, SceneCfg
from mjlab.sim import MujocoCfg, Simulation, SimulationCfg

from servotwin.robots.trainers.mjlab import ServoActuatorCfg

pytestmark = pytest.mark.slow
SERVO = st.PulseServo(st.load_servo("hitec-hs-755hb"))
BUS = st.DigitalServo(st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": 0.0}))
ARM = """<mujoco><worldbody><body name="base"><body name="upper" pos="0 0 .1"><joint name="shoulder" axis="0 -1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".1"/><body name="lower" pos=".1 0 0">
<joint name="elbow" axis="0 -1 0"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".08"/>
</body></body></body></worldbody></mujoco>"""
CONTROLLED = ARM.replace("</mujoco>", """<option timestep=".002" integrator="implicitfast"/><actuator>
<position joint="shoulder"/><position joint="elbow"/></actuator></mujoco>""")


def scene_of(*actuators, worlds=3):
    """Return a scene with an arm, and its simulation at 2 ms."""
    arm = EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(ARM),
                    articulation=EntityArticulationInfoCfg(actuators=actuators))
    scene = Scene(SceneCfg(num_envs=worlds, entities={"arm": arm}), device="cpu")
    sim = Simulation(worlds, SimulationCfg(mujoco=MujocoCfg(timestep=2e-3)), scene.compile(), device="cpu")
    scene.initialize(sim.mj_model, sim.model, sim.data)
    return scene, sim


def goals(k):
    return [0.4 + 0.3 * np.sin(8e-3 * k), 0.3 * np.cos(1e-2 * k)]


def run(scene, sim, steps, first=0):
    found = []
    for k in range(first, first + steps):
        scene["arm"].set_joint_position_target(torch.tensor([goals(k)] * sim.num_envs, dtype=torch.float32))
        scene.write_data_to_sim()
        sim.step()
        scene.update(2e-3)
        found.append(scene["arm"].data.joint_pos.numpy().copy())
    return np.array(found)


@pytest.mark.parametrize("groups", [
    [ServoActuatorCfg(target_names_expr=(".*",), servo=BUS)],
    [ServoActuatorCfg(target_names_expr=(name,), servo=BUS) for name in ("elbow", "shoulder")]],
    ids=["one group", "two groups"])
def test_an_arm_is_that_of_warp_drive(groups):
    scene, sim = scene_of(*groups)
    found = run(scene, sim, 200)
    model = mujoco.MjModel.from_xml_string(CONTROLLED)
    drive = WarpDrive(model, {"shoulder": BUS, "elbow": BUS}, worlds=3)
    own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=3)
    drive.attach(own)
    for k in range(200):
        data.ctrl.assign(np.float32([goals(k)] * 3))
        mjw.step(own, data)
    assert np.ptp(found[:, 0], axis=0).min() > 0.1
    assert found[-1] == pytest.approx(data.qpos.numpy(), abs=1e-5)
    assert sum(group.torque.shape[1] for group in scene["arm"].actuators) == 2


def test_a_look_at_the_state_lets_no_time_pass_and_worlds_are_reset_by_number():
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO))
    plain = run(scene, sim, 120)
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO))
    for k in range(120):
        looked = run(scene, sim, 1, first=k)
        sim.forward()
    assert looked[-1] == pytest.approx(plain[-1], abs=1e-3)
    draw = np.random.default_rng(1)
    for _ in range(50):
        which = torch.tensor(np.flatnonzero(draw.random(3) < 0.5))
        before = scene["arm"].data.joint_pos.numpy().copy()
        sim.reset(which)
        scene.reset(which)
        sim.forward()
        others = np.setdiff1d(np.arange(3), which.numpy())
        assert np.array_equal(scene["arm"].data.joint_pos.numpy()[others], before[others])
        assert not scene["arm"].data.joint_pos.numpy()[which].any()
        run(scene, sim, 2)
    sim.reset()
    scene.reset()
    assert run(scene, sim, 120)[-1] == pytest.approx(plain[-1], abs=1e-5)


def test_servos_vary_from_world_to_world_by_the_seed_of_pytorch():
    def ends(seed, **more):
        torch.manual_seed(seed)
        groups = [ServoActuatorCfg(target_names_expr=("elbow",), servo=SERVO),
                  ServoActuatorCfg(target_names_expr=("shoulder",), servo=SERVO, **more)]
        return run(*scene_of(*groups), 100)[-1]

    vary = {"output_inertia": "uniform:30%", "friction.coulomb_torque_forward": "uniform:30%"}
    found = ends(1, vary=vary)
    assert np.ptp(ends(1), axis=0).max() == 0.0
    assert np.ptp(found[:, 0]) > 1e-3
    assert np.array_equal(ends(1, vary=vary), found)
    assert not np.array_equal(ends(2, vary=vary), found)


def test_servos_that_vary_are_others_after_a_reset():
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO, vary={
        "output_inertia": "uniform:30%"}))
    actuator = scene["arm"].actuators[0]
    before, numbers = sim.model.dof_armature.clone(), actuator.drive.parameters()
    scene["arm"].reset(torch.tensor([1]))
    changed = (sim.model.dof_armature != before).any(dim=1)
    assert changed.tolist() == [k == 1 for k in range(len(changed))]
    for name, columns in actuator.drive.parameters().items():
        for number, values in columns.items():  # of rotor and gear
            assert (values == numbers[name][number]).tolist() == [k != 1 for k in range(len(changed))]


def test_an_environment_decimates_resets_and_looks_as_it_does():
    arm = EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(ARM), articulation=EntityArticulationInfoCfg(
        actuators=(ServoActuatorCfg(target_names_expr=(".*",), servo=BUS),)))
    cfg = ManagerBasedRlEnvCfg(
        decimation=10, scene=SceneCfg(num_envs=3, entities={"arm": arm}), seed=1, episode_length_s=0.4,
        sim=SimulationCfg(mujoco=MujocoCfg(timestep=2e-3)),
        observations={"actor": ObservationGroupCfg(terms={"joints": ObservationTermCfg(
            func=joint_pos_rel, params={"asset_cfg": SceneEntityCfg("arm")})})},
        actions={"joints": JointPositionActionCfg(entity_name="arm", actuator_names=(".*",), use_default_offset=False)},
        terminations={"time_out": TerminationTermCfg(func=time_out, time_out=True)})
    env = ManagerBasedRlEnv(cfg, device="cpu")
    env.reset()
    found, ended = [], 0
    for k in range(45):  # episodes of 20 steps
        _, _, _, timed_out, _ = env.step(torch.tensor([goals(10 * (k % 20))] * 3, dtype=torch.float32))
        ended += int(timed_out.sum())
        found.append(env.scene["arm"].data.joint_pos.numpy().copy())
    model = mujoco.MjModel.from_xml_string(CONTROLLED)
    drive = WarpDrive(model, {"shoulder": BUS, "elbow": BUS})
    own, data = mjw.put_model(model), mjw.put_data(model, mujoco.MjData(model), nworld=1)
    drive.attach(own)
    for k in range(19):
        data.ctrl.assign(np.float32([goals(10 * k)]))
        for _ in range(10):
            mjw.step(own, data)
        for at in (k, 20 + k):
            if at < 45:
                assert found[at] == pytest.approx(np.tile(data.qpos.numpy(), (3, 1)), abs=1e-3)
    assert ended == 6


def test_a_delay_of_mjlab_delays_the_command():
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO, delay_min_lag=5, delay_max_lag=5))
    late = run(scene, sim, 100)
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO))
    assert np.abs(run(scene, sim, 100) - late).max() > 5e-3


@pytest.mark.parametrize(("make", "error", "words"), [
    (lambda: ServoActuatorCfg(target_names_expr=(".*",), servo=SERVO, armature=0.1), InputError, "^armature of a S"),
    (lambda: scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo="sts3215")), InputError, "^servo of"),
    (lambda: scene_of(ServoActuatorCfg(target_names_expr=("knee",), servo=SERVO)), ValueError, "knee"),
    (lambda: scene_of(ServoActuatorCfg(target_names_expr=(".*",), servo=Mount(SERVO), joint_friction="none")),
     InputError, "^joint_friction")])
def test_mistakes_are_said_in_a_line(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_joints_with_actuators_of_mjlab_stay_with_them():
    scene, sim = scene_of(ServoActuatorCfg(target_names_expr=("shoulder",), servo=SERVO),
                          BuiltinPositionActuatorCfg(target_names_expr=("elbow",), stiffness=5.0, damping=0.2))
    found = run(scene, sim, 150)
    assert scene["arm"].actuators[0].drive.joints == ("arm/shoulder",)
    assert np.ptp(found[:, 0], axis=0).min() > 0.05
    assert wp.to_torch(scene["arm"].actuators[0].drive.torque).shape == (3, 1)
