"""Registers of a robot's servos that nobody recorded: found before its fit, of all servos alike and of single ones."""

import math

import numpy as np
import pytest

import servotwin as st
from reference import arm_rig as rig
from reference import arm_rig_recorder as recorder
from reference.arm_rig_fits import FREE, files_of
from robots.robots_cases import links
from servotwin.identification.arms import search
from servotwin.identification.arms.identify_arm import arm_registers
from servotwin.identification.arms.rows import Numbers, episodes_from, used_rows
from servotwin.identification.arms.search import Problem
from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.table import set_registers, written
from servotwin.robots import Motion, Mount, robot_model, run_motion

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
JOINTS, COUNT, SECONDS = ("shoulder", "elbow"), 2.0 * math.pi / 4096.0, 6.0
PLANT = mujoco.MjModel.from_xml_string(links(dt=2e-3))
FACTORY = st.load_servo("feetech-sts3215-12v").replace({"gear.backlash": None})
LEROBOT = set_registers(register_family_of(FACTORY), "lerobot", FACTORY, assumed=True)
BUS = st.parameters.Supply(open_circuit_voltage=12.0, internal_resistance=0.15)
WRONG = {"motor.torque_constant": 1.06, "motor.back_emf_constant": 1.06, "motor.rotor_inertia": 1.3,
         "friction.coulomb_torque_forward": 1.3, "friction.coulomb_torque_backward": 1.3}  # of the files


def having(servo, **registers):
    return set_registers(register_family_of(servo), registers, servo)


def recorded(servos, seed=0):
    """Return an episode of an arm of these servos, whose numbers are not those of the files: moves and steps."""
    rng, time = np.random.default_rng(seed), np.arange(int(SECONDS * 30.0)) / 30.0
    angles = {}
    for joint in JOINTS:
        at, t = np.zeros(len(time)), 0.7
        while t < SECONDS:
            rise, way = rng.uniform(0.05, 0.9), rng.uniform(-0.7, 0.7) - at[-1]
            x = np.clip((time - t) / rise, 0.0, 1.0)
            at = at + way * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
            t += rise + rng.uniform(0.1, 0.8)
        angles[joint] = COUNT * np.round(at / COUNT)
    true = {joint: Mount(st.DigitalServo(servo.replace({name: share * servo.get(name)
                                                        for name, share in WRONG.items()})))
            for joint, servo in zip(JOINTS, servos, strict=True)}
    run = run_motion(PLANT, true, Motion(time=time, source="real", angles=angles), bus=BUS, hold="previous")
    measured = {joint: COUNT * np.round(np.interp(time - 0.008, run.time, run.record[joint]["joint_angle"]) / COUNT)
                for joint in JOINTS}
    return Motion(time=time, angles=angles, measured=measured, source="real")


def searched(believed, true):
    mounts = {joint: Mount(st.DigitalServo(servo)) for joint, servo in zip(JOINTS, believed, strict=True)}
    bodies, episodes = search.links_of(PLANT, JOINTS), episodes_from([recorded(true)], JOINTS, mounts)

    def make(mounts):
        return Numbers(mounts, search.link_names(PLANT, bodies), BUS)

    found, after = arm_registers(Problem(PLANT, make(mounts), bodies, episodes, [used_rows(one) for one in episodes],
                                         lambda: None, search.Demand(PLANT, JOINTS, bodies)), make)
    return found, [written(register_family_of(LEROBOT), after[joint].model.servo) for joint in JOINTS]


@pytest.mark.parametrize(("believed", "true", "P", "acceleration"), [
    (FACTORY, LEROBOT, 16, 254),  # as who fits an arm that LeRobot drove, with the servos of the catalog
    (LEROBOT, having(LEROBOT, Acceleration=20), 16, 20),
    pytest.param(LEROBOT, having(LEROBOT, P_Coefficient=32), 32, 254, marks=pytest.mark.long),
])
def test_registers_of_all_servos_are_taken(believed, true, P, acceleration):
    found, raw = searched([believed] * 2, [true] * 2)
    assert found.best[0].error < 0.5 * found.given.error
    assert found.joints == {}
    assert [(one["P_Coefficient"], one["Acceleration"]) for one in raw] == [(P, acceleration)] * 2
    assert "registers that nobody recorded are not as the servo file has them: as if with" in found.sentences[0]


def test_those_of_one_servo_are_taken_apart():
    found, raw = searched([LEROBOT] * 2, [LEROBOT, having(LEROBOT, P_Coefficient=8)])
    assert found.taken is None
    assert {joint: dict(one.registers) for joint, one in found.joints.items()} == {"elbow": {"P_Coefficient": 8}}
    assert [one["P_Coefficient"] for one in raw] == [16, 8]
    assert found.facts["joints"]["elbow"]["registers"] == {"P_Coefficient": 8}
    assert "the servo of elbow has other registers than the others: as if with P_Coefficient 8" in found.sentences[0]


def test_what_is_right_stays_though_numbers_are_wrong():
    found, raw = searched([LEROBOT] * 2, [LEROBOT] * 2)
    assert (found.taken, found.joints, found.sentences) == (None, {}, ())
    assert [one["P_Coefficient"] for one in raw] == [16, 16]


def test_what_was_given_is_held_and_doubted():
    found, raw = searched([having(FACTORY, P_Coefficient=64)] * 2, [LEROBOT] * 2)
    assert [one["P_Coefficient"] for one in raw] == [64, 64]
    assert found.doubted.registers["P_Coefficient"] == 16
    assert found.sentences[-1].startswith("the registers that were given are doubtful: as if with")


def test_servos_without_registers_have_none_to_search():
    servo = st.load_servo("hitec-hs-755hb")
    numbers = Numbers({joint: Mount(st.PulseServo(servo)) for joint in JOINTS}, (), BUS)
    problem = Problem(PLANT, numbers, [], [], [], lambda: None, search.Demand(PLANT, JOINTS, []))
    assert arm_registers(problem, lambda mounts: numbers) == (None, numbers.mounts)


def unsaid(servo, registers):
    """Return a servo of the rig's files of whose registers nobody said anything."""
    plain = servo.replace({name: None for name in servo.names() if name.startswith("firmware.")})
    return set_registers(register_family_of(servo), registers, plain, assumed=True)


@pytest.mark.long
@pytest.mark.skipif(rig.compiler() is None, reason="no C compiler")
@pytest.mark.parametrize(("seed", "believed", "odd", "P", "alone"), [
    (520, "lerobot", None, 16, {}), (521, {}, None, 16, {}), (522, "lerobot", 3, 16, {"wrist_flex": 8}),
    (523, {}, 1, 16, {"shoulder_lift": 8}),
])
def test_registers_of_an_arm_that_others_simulated(tmp_path, seed, believed, odd, P, alone):
    """An SO-101 with LeRobot's registers, in one servo half of P; masses, servos and stamps are not as files say."""
    truth = rig.random_truth(rig.SO101, "feetech", seed)
    truth = truth if odd is None else rig.with_wrong_gain(truth, odd, 0.5)
    made, joints = recorder.record(truth, 20.0, "mixed"), truth.robot.joints
    (tmp_path / "so101.xml").write_text(rig.mjcf(truth.robot))
    plant = robot_model(tmp_path / "so101.xml")
    motion = Motion(time=made.time, angles=dict(zip(joints, made.action.T, strict=True)), source="rig",
                    measured=dict(zip(joints, made.state.T, strict=True)))
    mounts = {joint: Mount(st.DigitalServo(unsaid(servo, believed))) for joint, servo in files_of(truth).items()}
    bodies, episodes = search.links_of(plant, joints), episodes_from([motion], joints, mounts)

    def make(mounts):
        return Numbers(mounts, search.link_names(plant, bodies), BUS, free=FREE)

    found, after = arm_registers(Problem(plant, make(mounts), bodies, episodes, [used_rows(one) for one in episodes],
                                         lambda: None, search.Demand(plant, joints, bodies)), make)
    raw = {joint: written(register_family_of(LEROBOT), mount.model.servo) for joint, mount in after.items()}
    assert {joint: one["P_Coefficient"] for joint, one in raw.items()} == {joint: P for joint in joints} | alone
    assert {one["Acceleration"] for one in raw.values()} == {254}
    assert {joint: one.registers["P_Coefficient"] for joint, one in found.joints.items()} == alone
