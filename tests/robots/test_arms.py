"""SCARA and two-link arms: where their tools are, what they weigh, and how servos sit at their joints."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.robots import mjcf_models as mjcf
from servotwin.robots import scara, two_link
from servotwin.robots.arms.arm import HEIGHT, LENGTHS, PINION, SERVO_MASS
from servotwin.robots.arms.arm import TWO_LENGTHS as LINKS
from servotwin.robots.arms.task_run import tool_places

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
DRAWS = np.random.default_rng(3)


def some_poses(arm, count=20):
    lower, upper = arm.model().jnt_range.T
    return lower + (upper - lower) * DRAWS.random((count, len(lower)))


@pytest.mark.parametrize("third_link", [True, False])
def test_the_tool_of_a_scara_is_where_its_links_put_it(third_link):
    arm = scara(third_link=third_link)
    poses = some_poses(arm)
    lengths = LENGTHS if third_link else LENGTHS[:2]
    turned = np.cumsum(poses[:, :len(lengths)], axis=1)
    found = tool_places(arm.model(), poses)
    np.testing.assert_allclose(found[:, 0], np.cos(turned) @ lengths, atol=1e-12)
    np.testing.assert_allclose(found[:, 1], np.sin(turned) @ lengths, atol=1e-12)
    lift = poses[:, list(arm.joints).index("lift")]
    np.testing.assert_allclose(found[:, 2] - lift, found[0, 2] - lift[0], atol=1e-12)  # whatever the hinges do


def test_gravity_is_nothing_to_the_hinges_of_a_scara():
    model = scara(payload=0.2).model()
    data = mujoco.MjData(model)
    for pose in some_poses(scara()):
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        weight = data.qfrc_bias[3]
        assert abs(data.qfrc_bias[[0, 1, 2, 4]]).max() < 1e-12
    assert weight == pytest.approx(9.81 * (model.body("carriage").mass[0] + model.body("wrist_link").mass[0]))


def test_the_tool_of_two_links_is_where_the_closed_form_has_it():
    arm = two_link()
    poses = some_poses(arm)
    turned = np.cumsum(poses, axis=1)
    found = tool_places(arm.model(), poses)
    np.testing.assert_allclose(found[:, 0], np.cos(turned) @ LINKS, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], HEIGHT + np.sin(turned) @ LINKS, atol=1e-12)


def test_a_payload_weighs_on_the_links():
    torques = []
    for payload in (0.0, 0.1):
        model = two_link(payload=payload).model()
        data = mujoco.MjData(model)  # stretched out along x
        mujoco.mj_forward(model, data)
        torques.append(data.qfrc_bias.copy())
    np.testing.assert_allclose(torques[1] - torques[0], 0.1 * 9.81 * np.array([sum(LINKS), LINKS[1]]), rtol=1e-9)


@pytest.mark.parametrize("payload", [-0.1, math.nan, math.inf])
def test_a_payload_is_a_mass(payload):
    for make in (scara, two_link):
        with pytest.raises(InputError, match=r"payload: got .*, allowed: a mass that is not negative"):
            make(payload=payload)


def test_servos_reach_what_their_joints_do():
    servo = st.load_servo("hitec-hs-755hb")
    for arm in (scara(), scara(third_link=False), two_link()):
        for joint, mount in arm.mounts(st.PulseServo(servo)).items():
            low, high = arm.model().joint(joint).range
            ends = sorted(math.degrees((end - mount.zero) / mount.gain) for end in (low, high))
            assert -1e-6 <= ends[0] < ends[1] <= 180.0 + 1e-6, joint  # of Table II
    assert scara().mounts(st.PulseServo(servo))["lift"].ratio == PINION


def test_a_bus_servo_sits_with_its_middle_at_that_of_the_joint():
    mounts = two_link().mounts(st.DigitalServo(st.load_servo("feetech-sts3215-12v")))
    assert math.degrees(mounts["shoulder"].zero) == pytest.approx(30.0, abs=0.1)


def test_each_joint_has_a_servo():
    with pytest.raises(InputError, match="servos of two-link: got 'elbow', allowed: shoulder, elbow"):
        two_link().mounts({"elbow": st.PulseServo(st.load_servo("hitec-hs-755hb"))})


def test_a_servo_weighs_what_its_list_says():
    assert st.load_servo("hitec-hs-755hb").sheet["mass"]["value"] == pytest.approx(1e3 * SERVO_MASS)  # g


def test_blocks_make_the_inertia_of_two_boxes():
    """The same as two bodies that MuJoCo adds up from boxes with density."""
    root, _, world = mjcf.new_robot("pair")
    body = mjcf.Xml.SubElement(world, "body")
    mjcf.Xml.SubElement(body, "freejoint")
    blocks = [mjcf.Block(0.2, (0.1, 0.0, 0.02), (0.05, 0.01, 0.02)), mjcf.Block(0.3, (-0.02, 0.03, 0.0), (0.01,) * 3)]
    mjcf.add_blocks(body, blocks)
    own = mujoco.MjModel.from_xml_string(mjcf.text(root))
    boxes = "".join(f'<geom type="box" pos="{mjcf.words(b.centre)}" size="{mjcf.words(b.half)}" mass="{b.mass}"/>'
                    for b in blocks)
    other = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><body><freejoint/>{boxes}</body></worldbody></mujoco>")
    np.testing.assert_allclose(own.body_ipos[1], other.body_ipos[1], atol=1e-12)
    np.testing.assert_allclose(own.body_inertia[1], other.body_inertia[1], rtol=1e-6)
