"""Robot files whose links overlap, or that nothing carries: what touches what, and whether their servos are judged."""

import math

import numpy as np
import pytest

import servotwin as st
from robots.robots_cases import servo
from servotwin.errors import InputError
from servotwin.robots import Motion, run_motion, sizing_of, validate_robot
from servotwin.robots.model_file import plant_of, robot_model
from servotwin.robots.overlaps import fall_of, leave_out, leave_out_measured, overlaps
from servotwin.robots.servos.record import FROM_NOWHERE

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
SERVO = st.DigitalServo(st.load_servo("feetech-sts3215-7v4"))
INERTIA = '<inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/>'


def link(name, mass, spread, centre, box, at):
    """Return a link of a URDF: mass [kg], inertia [kg m²], centre [m], sides and centre of its box [m]."""
    shape = "" if box is None else (
        f'<collision><origin xyz="{at}"/><geometry><box size="{box}"/></geometry></collision>')
    return (f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>{INERTIA.format(spread)}'
            f"</inertial>{shape}</link>")


def joint(name, parent, child, origin, axis):
    return (f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/><limit lower="-2" upper="2" effort="2" velocity="5"/>'
            '</joint>')


def arm(base="0.06 0.06 0.05", shoulder="0.05 0.05 0.05", upper="0.03 0.03 0.1", upper_at="0 0 0.06"):
    """Return the URDF of an arm of two joints, whose shoulder stands 26 mm in its base if both have their boxes."""
    return ('<robot name="arm">' + link("base", 0.3, 2e-4, "0 0 0", base, "0 0 0.02")
            + link("shoulder", 0.1, 5e-5, "0 0 0.02", shoulder, "0 0 0.02")
            + link("upper", 0.08, 4e-5, "0 0 0.06", upper, upper_at)
            + joint("pan", "base", "shoulder", "0 0 0.024", "0 0 1")
            + joint("lift", "shoulder", "upper", "0 0 0.05", "0 1 0") + "</robot>")


MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><inertial pos="0 0 0" mass=".3"
  diaginertia="2e-4 2e-4 2e-4"/><body name="shoulder" pos="0 0 .024"><joint name="pan" axis="0 0 1"/>
  <inertial pos="0 0 .02" mass=".1" diaginertia="5e-5 5e-5 5e-5"/><body name="upper" pos="0 0 .05">
  <joint name="lift" axis="0 1 0"/><inertial pos="0 0 .06" mass=".08" diaginertia="4e-5 4e-5 4e-5"/></body></body>
  </body></worldbody></mujoco>"""  # the same without shapes


def motion(*joints, rise=0.5, duration=0.6):
    time = np.linspace(0.0, duration, 31)
    way = 0.5 * rise * (1.0 - np.cos(2.0 * np.pi * time / duration))
    return Motion(time=time, angles=dict.fromkeys(joints, way), source="motion.csv")


def spec(text):
    return mujoco.MjSpec.from_string(text)


def followed(model, *joints, own=SERVO, **options):
    return run_motion(model, dict.fromkeys(joints, own), motion(*joints), settle=0.1, **options)


def touching(model):
    """Return the pairs of shapes in contact in the first pose."""
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    return {tuple(sorted(int(geom) for geom in contact.geom)) for contact in data.contact}


def test_a_urdf_whose_shoulder_is_in_its_base_is_its_mjcf_without_shapes(tmp_path):
    """The pair gives peak torque and errors within 10 %; with that contact they would be tens of times as large."""
    path = tmp_path / "arm.urdf"
    path.write_text(arm())
    urdf, mjcf = (followed(model, "pan", "lift") for model in (path, mujoco.MjModel.from_xml_string(MJCF)))
    for name in ("pan", "lift"):
        peaks = [run.record[name].peak("joint_torque") for run in (urdf, mjcf)]
        assert peaks[0] == pytest.approx(peaks[1], rel=0.1)
        assert urdf.tracking[name].rms == pytest.approx(mjcf.tracking[name].rms, rel=0.1)
    assert urdf.unjudged == ""
    assert all(each.big_enough for each in sizing_of(urdf).values())
    assert urdf.notes[0] == ("base and shoulder overlap by 26 mm in the first pose; joint pan joins them: left out of "
                             "contact")


FLOOR = '<geom name="floor" type="plane" size="1 1 .1" pos="0 0 .03"/>'
BASE = '<body name="base"><geom type="box" size=".03 .03 .03"/>{}</body>'
TURRET = '<body name="turret" pos="0 0 {}"><joint name="pan"/><geom type="box" size=".02 .02 .02"/></body>'


@pytest.mark.parametrize(("world", "more", "kept"), [
    (BASE.format(TURRET.format(".04")), "", 0),  # 10 mm deep: left out
    (BASE.format(TURRET.format(".0495")), "", 1),  # half a millimetre: the file's own choice
    (BASE.format(TURRET.format(".04")) + FLOOR, "", 1),  # the floor beside it touches the turret
    ('<geom type="box" size=".03 .03 .03"/>' + TURRET.format(".04"), "", 1),  # of a scene, as a table is
    ('<geom type="box" name="b" size=".03 .03 .03"/>' + TURRET.format(".04").replace("<geom", '<geom name="t"'),
     '<contact><pair geom1="b" geom2="t"/></contact>', 1),
    (BASE.replace("<geom", '<geom name="b"').format(TURRET.format(".04").replace("<geom", '<geom name="t"')),
     '<contact><pair geom1="b" geom2="t"/></contact>', 1),
    (BASE.format('<freejoint/>' + TURRET.format(".04")), '<option><flag filterparent="disable"/></option>', 0)])
def test_links_that_a_joint_joins_do_not_touch(world, more, kept):
    assert len(touching(robot_model(spec(f"<mujoco>{more}<worldbody>{world}</worldbody></mujoco>")))) == kept


def test_the_floor_under_a_urdf_is_none_of_it():
    """Its root is merged into the world, as the floor and a table are that somebody adds."""
    urdf = spec(arm())
    urdf.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], pos=[0, 0, 0.03])
    urdf.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 0.1], pos=[0, 0, -0.07])
    model = plant_of(urdf).model
    assert {tuple(model.geom(geom).name for geom in pair) for pair in touching(model)} == {
        ("floor", ""), ("table", "")}
    assert {int(model.geom_bodyid[b]) for _, b in touching(model)} == {model.body("shoulder").id}


@pytest.mark.parametrize("seed", range(4))
def test_pairs_are_left_out_and_no_others(seed):
    """Shapes with random bits all in one place: MuJoCo itself says what touches."""
    rng = np.random.default_rng(seed)
    bodies = "".join(f'<body><freejoint/><geom size=".1" contype="{rng.integers(4)}" conaffinity="{rng.integers(4)}"/>'
                     "</body>" for _ in range(12))
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    before = touching(model)
    out = {tuple(sorted(pair)) for pair in rng.choice(12, (8, 2)).tolist()}
    leave_out(model, out)
    assert touching(model) == before - out
    assert before & out


def test_more_kinds_than_a_filter_has_are_refused():
    bodies = "".join('<body><freejoint/><geom size=".1"/></body>' for _ in range(40))
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    with pytest.raises(InputError, match="up to 31"):
        leave_out(model, [(k, k + 1) for k in range(0, 39)])


def test_other_overlaps_withhold_the_verdict_unless_they_are_ignored():
    """The upper arm's box reaches 20 mm into the base, which no joint joins to it."""
    deep, bare = spec(arm(shoulder=None, upper_at="0 0 0.001")), spec(arm(shoulder=None, upper=None))
    kept, ignored, free = (followed(model, "pan", "lift", overlap=overlap) for model, overlap in (
        (deep, "keep"), (deep, "ignore"), (bare, "keep")))
    words = "upper lies 20 mm in what is fixed where the motion begins"
    assert kept.unjudged == f"{words} (overlap=ignore leaves such contacts out)"
    assert kept.notes[0] == words
    for each in sizing_of(kept).values():
        assert each.verdict == f"not judged: {kept.unjudged}"
        assert not each.big_enough
    assert (ignored.unjudged, ignored.notes) == ("", (f"{words}: left out of contact",))
    np.testing.assert_array_equal(ignored.poses, free.poses)
    with pytest.raises(InputError, match="'keep' or 'ignore'"):
        followed(bare, "pan", overlap="no")


LEG = """<body name="leg{0}" pos="0 {1} 0"><joint name="hip{0}" axis="0 1 0"/><geom type="capsule"
  fromto="0 0 -.02 0 0 -.1" size=".01" mass=".1" contype="0" conaffinity="0"/>
  <geom type="box" size=".06 .03 .01" pos="0 0 -.11" mass=".05"/></body>"""
GROUND = '<geom name="floor" type="plane" size="1 1 .1"/>'


def biped(height, ground=GROUND, option=""):
    """Return a trunk of 0.8 kg on two legs whose soles are 120 mm below it."""
    legs = LEG.format(0, 0.05) + LEG.format(1, -0.05)
    return spec(f'<mujoco><option timestep="0.002" {option}/><worldbody>{ground}<body name="trunk" pos="0 0 {height}">'
                f'<freejoint/><geom type="box" size=".05 .05 .03" mass=".8" contype="0" conaffinity="0"/>{legs}</body>'
                "</worldbody></mujoco>")


@pytest.mark.parametrize(("height", "ground", "option", "said"), [
    (0.12, GROUND, "", ""), (0.16, GROUND, "", ""),  # stands; falls 4 cm and then stands
    (0.103, GROUND, "", "leg0 lies 17 mm in floor where the motion begins (overlap=ignore judges all the same)"),
    (0.12, "", "", "no floor in the model (its scene is a file of its own?)"),
    (0.12, GROUND.replace("<geom", '<geom pos="0 0 -9"'), "", "nothing carries it"),
    (0.12, "", 'gravity="0 0 0"', ""), (0.12, "", 'density="5000" viscosity="20"', "")])  # in space, in honey
def test_what_nothing_carries_is_not_judged(height, ground, option, said):
    run = followed(biped(height, ground, option), "hip0", "hip1")
    assert run.unjudged.endswith(said)
    assert bool(run.unjudged) == bool(said) == (not sizing_of(run)["hip0"].big_enough)
    if "no floor" in said:
        way, time = (float(run.unjudged.split()[k]) for k in (5, 9))
        assert way == pytest.approx(0.5 * 9.81 * time**2, rel=0.03)
        assert time == pytest.approx(0.8, abs=0.06)


def test_an_overlap_is_named_as_the_cause_of_energy():
    """Feet that begin in the floor: plain MuJoCo, its joints held, throws the robot up by nearly the same energy."""
    run = followed(biped(0.103), "hip0", "hip1")
    (note,) = (note for note in run.notes if note.startswith(FROM_NOWHERE))
    assert note.endswith("leg0 lies 17 mm in floor where the motion begins, and is pushed out of it")
    held = biped(0.103)
    for hip in ("hip0", "hip1"):
        held.joint(hip).stiffness[0], held.joint(hip).damping[0] = 50.0, 1.0
    plain = held.compile()
    data, most = mujoco.MjData(plain), []
    for _ in range(100):
        mujoco.mj_step(plain, data)
        mujoco.mj_energyPos(plain, data)
        mujoco.mj_energyVel(plain, data)
        most.append(data.energy.sum())
    assert max(most) - most[0] == pytest.approx(np.nanmax(run.record.energy_from_nowhere), rel=0.3)


def test_a_solver_that_does_not_converge_is_named_only_where_more_iterations_help():
    option = 'timestep="0.004" integrator="implicitfast" cone="elliptic" impratio="100" iterations="1"'
    few = biped(0.16, option=option.replace('timestep="0.004" ', ""))
    few.option.timestep = 0.004
    run = followed(few, "hip0", "hip1", own=st.DigitalServo(SERVO.servo.replace({"gear.backlash": None})))
    notes = [note for note in run.notes if note.startswith(FROM_NOWHERE)]
    assert bool(notes) == (float(np.nanmax(run.record.energy_from_nowhere)) > 0.01 * run.record._largest)
    for note in notes:
        assert "its solver does not converge: with 100 iterations it is 0 J" in note


def test_what_presses_on_a_joint_is_part_of_its_verdict():
    wall = '<geom name="wall" type="box" size=".02 .1 .05" pos=".1 0 .08"/>'
    ball = '<joint name="lift" axis="0 1 0"/><geom size=".06" pos="0 0 .06" mass="0"/>'
    text = MJCF.replace("<worldbody>", f"<worldbody>{wall}").replace('<joint name="lift" axis="0 1 0"/>', ball)
    run = run_motion(mujoco.MjModel.from_xml_string(text), dict.fromkeys(("pan", "lift"), servo(st.DigitalServo)),
                     motion("lift"), settle=0.1)
    for each in sizing_of(run).values():
        assert "held by upper against what is fixed from 0." in each.verdict


def test_contacts_in_which_measured_joints_lie_are_left_out():
    """A finger whose box meets the palm's 10 deg before the real one does: measured, it closes to 0."""
    hand = """<mujoco><compiler angle="degree"/><worldbody><geom type="box" size=".2 .2 .01" pos="0 0 -.1"/>
      <body name="palm"><geom type="box" size=".05 .01 .01" pos=".05 0 0"/><body name="stub" pos="0 0 .03">
      <joint name="lock" axis="0 1 0"/><geom size=".001" mass=".01"/>
      <body name="finger"><joint name="close" axis="0 1 0"/><geom type="box" size=".05 .01 .01" pos=".05 0 0"
      mass=".02"/></body></body></body></worldbody></mujoco>"""
    time = np.linspace(0.0, 0.6, 31)
    goals = np.concatenate([np.linspace(-0.6, 0.25, 15), np.full(16, 0.25)])
    seen = Motion(time=time, angles={"close": goals, "lock": 0.0 * time}, source="hand.csv",
                  measured={"close": np.interp(time - 0.05, time, goals), "lock": 0.0 * time})
    servos = {"close": SERVO, "lock": SERVO}
    found = validate_robot(mujoco.MjModel.from_xml_string(hand), servos, seen, rivals=())
    bare = hand.replace('pos=".05 0 0"\n', 'pos=".05 0 0" contype="0" conaffinity="0"')
    free = validate_robot(mujoco.MjModel.from_xml_string(bare), servos, seen, rivals=())
    assert found.said[0].startswith("where joints were measured finger lies ")
    assert found.said[0].endswith("mm in palm: left out of contact")
    assert found.rms() == free.rms()
    assert free.said == ()


def test_a_thing_that_lies_about_is_no_root_of_a_fixed_robot():
    """An arm whose measured pose dips 5 mm into a table, beside a cube that is free: the last joint of the model."""
    text = """<mujoco><worldbody><geom name="table" type="box" size=".3 .3 .02" pos="0 0 -.05"/>
      <body name="base"><body name="arm"><joint name="lift" axis="0 1 0"/><geom type="capsule" size=".01" mass=".02"
      fromto="0 0 0 .1 0 0"/></body></body><body name="cube" pos="0 .2 .5"><freejoint/><geom size=".01"/></body>
      </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    low = np.full(5, math.asin(0.025 / 0.1))  # the tip's middle 25 mm down, the table's top at -30, the tip's radius 10
    seen = Motion(time=0.1 * np.arange(5), angles={"lift": low}, source="low.csv", measured={"lift": low, "none": low})
    (said,) = leave_out_measured(model, [seen])
    assert said == "where joints were measured arm lies 5 mm in table: left out of contact"
    pose = model.qpos0.copy()
    pose[0] = low[0]
    assert overlaps(model, pose) == []
    assert fall_of(model, np.linspace(0.0, 1.0, 11), np.tile(pose, (11, 1)), ["lift"]) is None


def test_the_depth_is_that_of_the_boxes():
    (deep,) = overlaps(mujoco.MjModel.from_xml_string(arm()), np.zeros(2))
    assert (deep.first, deep.depth) == (0, pytest.approx(0.026))
