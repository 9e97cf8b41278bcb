"""The arm against what its makers publish, and what it may touch."""

import math

import numpy as np
import pytest

from servotwin.robots.mjcf_models import JOINTS, LIMITS, so101

mujoco = pytest.importorskip("mujoco")

# TheRobotStudio/SO-ARM100, Simulation/SO101/so101_new_calib.urdf, commit 0aee1d0f885a9643b91f544be1ef86d1200432c2:
# link: its joint, origin of the joint (xyz, rpy), limits, mass, centre of mass, inertia (xx, xy, xz, yy, yz, zz)
PUBLISHED = {
    "shoulder": ("shoulder_pan", (0.0207909, -0.0230745, 0.0948817), (-3.14159, 6.03684e-16, 1.5708),
                 (-1.91986, 1.91986), 0.100006, (-0.0307604, -1.66727e-05, -0.0252713),
                 (8.3759e-05, 7.55525e-08, -1.16342e-06, 8.10403e-05, 1.54663e-07, 2.39783e-05)),
    "upper_arm": ("shoulder_lift", (-0.0303992, -0.0182778, -0.0542), (-1.5708, -1.5708, 0), (-1.74533, 1.74533), 0.103,
                  (-0.0898471, -0.00838224, 0.0184089),
                  (4.08002e-05, -1.97819e-05, -4.03016e-08, 0.000147318, 8.97326e-09, 0.000142487)),
    "lower_arm": ("elbow_flex", (-0.11257, -0.028, 2.46331e-16), (-1.22818e-15, 5.75928e-16, 1.5708), (-1.69, 1.69),
                  0.104, (-0.0980701, 0.00324376, 0.0182831),
                  (2.87438e-05, 7.41152e-06, 1.26409e-06, 0.000159844, -4.90188e-08, 0.00014529)),
    "wrist": ("wrist_flex", (-0.1349, 0.0052, 1.65232e-16), (3.2474e-15, 2.86219e-15, -1.5708), (-1.65806, 1.65806),
              0.079, (-0.000103312, -0.0386143, 0.0281156),
              (3.68263e-05, 1.7893e-08, -5.28128e-08, 2.5391e-05, 3.6412e-06, 2.1e-05)),
    "gripper": ("wrist_roll", (0, -0.0611, 0.0181), (1.5708, -9.38083e-08, 3.14159), (-2.79253, 2.79253), 0.087,
                (0.000213627, 0.000245138, -0.025187),
                (2.75087e-05, -3.35241e-07, -5.7352e-06, 4.33657e-05, -5.17847e-08, 3.45059e-05)),
    "moving_jaw": ("gripper", (0.0202, 0.0188, -0.0234), (1.5708, -5.14108e-17, -1.38655e-14), (-0.174533, 1.74533),
                   0.012, (-0.00157495, -0.0300244, 0.0192755),
                   (6.61427e-06, -3.19807e-07, -5.90717e-09, 1.89032e-06, -1.09945e-07, 5.28738e-06)),
}
BASE_FRAME = (0.020791, 0.0157608, 0.0324817)  # of `baseframe` in `base`; the arm looks along -y of it
BASE_MASS, BASE_CENTRE = 0.147, (0.020739, 0.00204287, 0.065966)
TOOL = (-0.0079, -0.000218121, -0.0981274)  # `gripperframe` in `gripper`
POSES = [(0.0,) * 6, (0.5, -0.4, 0.8, 0.3, -1.2, 0.5), (-1.9, 1.7, -1.6, 1.6, 2.7, 1.7),
         (1.2, -1.7, 1.6, -1.6, -2.7, -0.1)]


def turned(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return (np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
            @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]]))


def published(pose):
    """Return the place and axes of each link, as the publication gives them."""
    axes = turned((0, 0, math.pi / 2))
    place = axes @ -np.array(BASE_FRAME)
    frames = {"base": (place, axes)}
    for (link, (_, xyz, rpy, *_)), angle in zip(PUBLISHED.items(), pose, strict=True):
        place, axes = place + axes @ xyz, axes @ turned(rpy) @ turned((0, 0, angle))
        frames[link] = place, axes
    return frames


def tool_of(frames):
    place, axes = frames["gripper"]
    return place + axes @ TOOL


@pytest.fixture(scope="module")
def arm():
    return mujoco.MjModel.from_xml_string(so101())


def posed(model, pose):
    data = mujoco.MjData(model)
    data.qpos[:len(JOINTS)] = pose
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("pose", POSES)
def test_links_and_tool_are_where_the_publication_has_them(arm, pose):
    data, frames = posed(arm, pose), published(pose)
    np.testing.assert_allclose(data.site("tool").xpos, tool_of(frames), atol=1e-5)
    for link in PUBLISHED:
        # its angles have five digits
        np.testing.assert_allclose(data.body(link).xpos, frames[link][0], atol=1e-5)
        np.testing.assert_allclose(data.body(link).xmat.reshape(3, 3), frames[link][1], atol=1e-4)


def test_the_tool_looks_where_the_fingers_point(arm):
    np.testing.assert_allclose(posed(arm, POSES[0]).site("tool").xmat.reshape(3, 3), np.eye(3), atol=1e-12)


def test_masses_and_inertias_are_the_published_ones(arm):
    assert arm.body("base").mass[0] == BASE_MASS
    assert float(arm.body_mass.sum()) == pytest.approx(0.632006, abs=1e-9)  # sum of the links in the publication
    for link, (*_, mass, _, (xx, xy, xz, yy, yz, zz)) in PUBLISHED.items():
        assert arm.body(link).mass[0] == pytest.approx(mass, rel=1e-12)
        about = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        np.testing.assert_allclose(np.sort(arm.body(link).inertia), about, rtol=1e-6)


@pytest.mark.parametrize("pose", POSES)
def test_the_centre_of_mass_is_the_published_one(arm, pose):
    frames = published(pose)
    links = {link: (mass, centre) for link, (*_, mass, centre, _) in PUBLISHED.items()}
    links["base"] = BASE_MASS, BASE_CENTRE
    mean = sum(mass * (frames[link][0] + frames[link][1] @ centre) for link, (mass, centre) in links.items()) / 0.632006
    np.testing.assert_allclose(posed(arm, pose).subtree_com[arm.body("base").id], mean, atol=1e-5)


def test_joints_are_named_and_limited_as_published(arm):
    assert [arm.joint(k).name for k in range(arm.njnt)] == list(JOINTS) == list(LIMITS)
    for joint, _, _, limits, *_ in PUBLISHED.values():
        assert LIMITS[joint] == limits
        np.testing.assert_allclose(arm.joint(joint).range, limits, rtol=1e-9)
        assert arm.jnt_limited[arm.joint(joint).id]


def test_what_the_servos_bring_is_not_in_the_joints(arm):
    for name in ("dof_damping", "dof_frictionloss", "dof_armature", "jnt_stiffness"):
        assert not np.any(getattr(arm, name)), name
    assert arm.nu == 0


def test_motors_are_there_on_request():
    model = mujoco.MjModel.from_xml_string(so101(motors=True))
    data = posed(model, POSES[1])
    data.ctrl[:] = torque = np.arange(1.0, 7.0)
    mujoco.mj_forward(model, data)
    assert [model.actuator(k).name for k in range(model.nu)] == list(JOINTS)
    np.testing.assert_allclose(data.qfrc_actuator, torque)


def test_the_arm_alone_has_no_scene():
    model = mujoco.MjModel.from_xml_string(so101(scene=False))
    assert (model.nlight, model.ncam, model.nbody) == (0, 0, 8)
    assert not np.any(model.geom_bodyid == 0)


def test_the_arm_touches_the_ground_but_never_itself(arm):
    rng, (low, high) = np.random.default_rng(0), np.array(list(LIMITS.values())).T
    touched = 0
    for _ in range(300):
        data = posed(arm, rng.uniform(low, high))
        bodies = {min(arm.geom_bodyid[contact.geom]) for contact in data.contact}
        assert bodies <= {0}
        touched += bool(bodies)
    assert touched > 30
    assert posed(arm, POSES[0]).ncon == 0


def test_fingers_touch_what_is_between_them():
    spec = mujoco.MjSpec.from_string(so101())
    place = tool_of(published((0.0,) * 6))
    cube = spec.worldbody.add_body(name="cube", pos=[*place])
    cube.add_freejoint()
    cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01, 0.01, 0.01], mass=0.01)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[5] = -0.1
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    assert {model.body(b).name for contact in data.contact for b in model.geom_bodyid[contact.geom]} == {
        "cube", "gripper", "moving_jaw"}


def test_fingers_meet_at_the_tool_when_the_gripper_is_closed(arm):
    pads = [g for g in range(arm.ngeom) if arm.geom_matid[g] == arm.material("pad").id]
    gaps, lines = [], []
    for angle in (LIMITS["gripper"][0], 0.0, 0.5, 1.0):
        data, line = posed(arm, (*POSES[0][:5], angle)), np.zeros(6)
        gaps.append(mujoco.mj_geomDistance(arm, data, *pads, 1.0, line))
        lines.append(line.reshape(2, 3))
    assert abs(gaps[0]) < 1.5e-3
    assert np.linalg.norm(lines[0].mean(axis=0) - data.site("tool").xpos) < 0.012
    assert np.all(np.diff(gaps) > 0.01)


@pytest.mark.long
def test_the_camera_sees_the_whole_arm(arm):
    rng, (low, high) = np.random.default_rng(1), np.array(list(LIMITS.values())).T
    half = math.tan(0.5 * math.radians(arm.camera("side").fovy[0]))
    corners = np.array(np.meshgrid(*3 * [(-1.0, 1.0)])).reshape(3, -1)
    poses = [*POSES, *rng.uniform(low, high, (200, 6)), (0.0, 0.0, -math.pi / 2, 0.0, 0.0, 0.0),
             (1.57, 1.57, -1.57, 0.0, 0.0, 0.0), (-1.57, 1.57, -1.57, 0.0, 0.0, 0.0)]  # upright, away, towards it
    for pose in poses:
        data = posed(arm, pose)
        axes, place = data.camera("side").xmat.reshape(3, 3), data.camera("side").xpos
        for g in range(arm.ngeom):
            box = np.c_[arm.geom_aabb[g][3:]] * corners + np.c_[arm.geom_aabb[g][:3]]
            seen = axes.T @ (np.c_[data.geom_xpos[g] - place] + data.geom_xmat[g].reshape(3, 3) @ box)
            if arm.geom_bodyid[g] and np.all(data.geom_xpos[g][2] > 0.0):
                assert np.all(np.abs(seen[1]) < -seen[2] * half)
                assert np.all(np.abs(seen[0]) < -seen[2] * half * 4 / 3)  # of a picture of 4 to 3
