"""Robot files of strangers: which joints their robots drive, meshes of ROS packages, macros, other formats."""

import itertools
import struct
import sys

import numpy as np
import pytest

from servotwin.errors import InputError
from servotwin.robots.model_file import driven_joints, joint_names, plant_of, robot_model

mujoco = pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
MASS = '<inertial><mass value="0.05"/><inertia ixx="1e-5" iyy="4e-5" izz="4e-5" ixy="0" ixz="0" iyz="0"/></inertial>'
SHAPE = '<geom size=".01" contype="0" conaffinity="0"/>'


def chain(*joints, more="", tail=""):
    """Return a chain of hinges, each with what its name is followed by after a blank."""
    inner = tail
    for joint in reversed(joints):
        name, _, words = joint.partition(" ")
        inner = f'<body name="{name}_link"><joint name="{name}" axis="0 1 0" {words}/>{SHAPE}{inner}</body>'
    return f"<mujoco><worldbody>{inner}</worldbody>{more}</mujoco>"


def urdf(*links, more=""):
    """Return a URDF whose links hang on each other by revolute joints j1, j2, ...; each link is its inner text."""
    text = "".join(f'<link name="l{k}">{inner}</link>' for k, inner in enumerate(links))
    limit = '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="5"/>'
    text += "".join(f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>{limit}</joint>'
                    for k in range(1, len(links)))
    return f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}{more}</robot>'


MOTORS = "<actuator>" + "".join(f'<position joint="{name}"/>' for name in ("hip", "knee")) + "</actuator>"
TENDON = ('<tendon><fixed name="t"><joint joint="toe" coef="1"/></fixed></tendon><actuator><motor joint="hip"/>'
          '<motor name="pull" tendon="t"/></actuator>')
LOOP = '<equality><connect body1="knee_link" body2="toe_link" anchor="0 0 0"/></equality>'
MIMIC = '<equality><joint joint1="toe" joint2="knee"/></equality>'
TRANSMISSION = '<transmission name="t"><type>x</type><joint name="j2"/><actuator name="m"/></transmission>'
CONTROL = ('<ros2_control name="c" type="system"><joint name="j1"><command_interface name="position"/></joint>'
           '<joint name="j2"><state_interface name="position"/></joint></ros2_control>')
LEG = ("hip", "knee", "toe")
DRIVEN = [  # file, joints of the motion, what `*` stands for, what is said
    (chain(*LEG, more=MOTORS), ("hip",), ("hip", "knee"), ("no servo at toe: no actuator of the file drives it",)),
    (chain(*LEG, more=TENDON), ("hip",), ("hip",), ("no servo at knee, toe: no actuator of the file drives it",
                                                    "actuator pull is at a tendon, and gets no servo")),
    (chain(*LEG), ("hip", "knee"), ("hip", "knee"), ("no servo at toe: the motion says nothing of it",)),
    (chain(*LEG), None, LEG, ()),
    (chain("hip", "knee", 'toe stiffness="2"'), None, ("hip", "knee"),
     ("no servo at toe: a spring moves it, or it is part of a closed loop",)),
    (chain(*LEG, more=LOOP), None, ("hip", "knee"),
     ("no servo at toe: a spring moves it, or it is part of a closed loop",)),
    (chain(*LEG, more=MIMIC), LEG, ("hip", "knee"), ()),  # what follows is said elsewhere
    (urdf("", MASS, MASS, more=TRANSMISSION), ("j1",), ("j2",),
     ("no servo at j1: the file does not name it as driven",)),
    (urdf("", MASS, MASS, more=CONTROL), ("j2",), ("j1",), ("no servo at j2: the file does not name it as driven",)),
    (urdf("", MASS, MASS), ("j1",), ("j1",), ("no servo at j2: the motion says nothing of it",))]


@pytest.mark.parametrize("case", range(len(DRIVEN)))
def test_the_joints_that_a_robot_drives(case, tmp_path):
    text, moved, joints, said = DRIVEN[case]
    path = tmp_path / "robot.xml"
    path.write_text(text)
    plant = plant_of(path)
    assert driven_joints(plant, moved) == (joints, said)
    left = set(joint_names(plant.model)) - set(joints)
    assert not any("no servo at" in words for words in driven_joints(plant, moved, left).said)


def stl(path, half=0.01):
    """Write a cube as STL; half of its side in m."""
    corners = half * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
             (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + b"".join(
        struct.pack("<12fH", 0.0, 0.0, 0.0, *corners[list(face)].ravel(), 0) for face in faces))


def mesh(name, kind="collision"):
    return f'<{kind}><geometry><mesh filename="{name}"/></geometry></{kind}>'


ARM = "package://arm_description/meshes/arm.STL"


@pytest.mark.parametrize(("where", "named"), [
    ("arm_description/meshes/arm.STL", "package.xml"),  # a folder of that name above the file
    ("src/meshes/arm.STL", "package.xml"), ("elsewhere/meshes/arm.STL", "option"),
    ("src/urdf/meshes/arm.STL", "relative")])
def test_meshes_of_packages_are_found_and_used(tmp_path, where, named):
    path = tmp_path / "src" / "urdf" / "arm.urdf"
    path.parent.mkdir(parents=True)
    stl(tmp_path / where, half=0.02)
    (tmp_path / "src" / "package.xml").write_text("<package><name>arm_description</name></package>")
    path.write_text(urdf("", MASS + mesh("meshes/arm.STL" if named == "relative" else ARM)))
    packages = {"arm_description": tmp_path / "elsewhere"} if named == "option" else {}
    plant = plant_of(path, packages)
    assert plant.said == ()
    assert plant.model.geom_rbound[0] == pytest.approx(0.02 * np.sqrt(3.0))


@pytest.mark.parametrize(("links", "shapes", "said"), [
    (("", MASS + mesh(ARM)), 0,
     ("collision shapes of l1 are not found (package://arm_description): left out, they touch nothing",)),
    (("", MASS + mesh(ARM, "visual")), 0, ()),  # of a URDF they are never shown
    (("", MASS + mesh("a.dae")), 0,
     ("collision shapes of l1 are in a.dae, which MuJoCo does not read (STL and OBJ it does): left out, they touch "
      "nothing",)),
    (("", MASS + mesh("a.stl") + mesh(ARM)), 1,
     ("collision shapes of l1 are not found (package://arm_description): left out, they touch nothing",)),
    ((mesh(ARM), MASS), 0,  # a base that is fixed needs no mass
     ("collision shapes of l0 are not found (package://arm_description): left out, they touch nothing",))])
def test_meshes_that_are_not_there_are_left_out_and_said(tmp_path, links, shapes, said):
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    stl(tmp_path / "a.stl")
    (tmp_path / "arm.urdf").write_text(urdf(*links))
    plant = plant_of(tmp_path / "arm.urdf")
    assert (plant.model.ngeom, plant.said) == (shapes, said)
    assert plant.model.body_mass[1:].tolist() == [0.05]


def test_meshes_of_an_mjcf_that_only_show_are_left_out(tmp_path):
    meshes = "".join(f'<mesh name="m{k}" file="part{k}.stl"/>' for k in range(5))
    geoms = "".join(f'<geom type="mesh" mesh="m{k}" contype="0" conaffinity="0"/>' for k in range(5))
    text = (f"<mujoco><asset>{meshes}</asset><worldbody><body><joint name='a'/><inertial pos='0 0 0' mass='1' "
            f"diaginertia='1 1 1'/>{geoms}</body></worldbody></mujoco>")
    (tmp_path / "arm.xml").write_text(text)
    plant = plant_of(tmp_path / "arm.xml")
    assert plant.said == ("meshes that only show are left out: part0.stl, part1.stl, part2.stl and 2 more",)
    stl(tmp_path / "part0.stl")
    assert plant_of(tmp_path / "arm.xml").model.ngeom == 1


MACROS = ('<xacro:macro name="leg" params="n"><link name="leg${n}">' + MASS + '</link><joint name="hip${n}" '
          'type="revolute"><parent link="l0"/><child link="leg${n}"/><limit lower="-1" upper="1" effort="1" '
          'velocity="5"/></joint></xacro:macro>' + '<xacro:leg n="1"/><xacro:leg n="2"/>')


def test_macros_are_expanded(tmp_path):
    path = tmp_path / "legs.urdf.xacro"
    path.write_text(urdf("", more=MACROS))
    assert list(joint_names(robot_model(path))) == ["hip1", "hip2"]
    path.write_text(urdf("", MASS))  # whatever its ending, a URDF is one
    assert list(joint_names(robot_model(path))) == ["j1"]


def test_where_nothing_expands_macros_the_command_is_said(tmp_path, monkeypatch):
    path = tmp_path / "legs.urdf.xacro"
    path.write_text(urdf("", more=MACROS))
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(InputError, match=r"holds macros: allowed: what this makes of it: xacro .*legs.urdf.xacro > "
                       r"legs.urdf "):
        robot_model(path)


@pytest.mark.parametrize(("name", "text", "said"), [
    ("arm.sdf", "<sdf version='1.9'><model name='a'/></sdf>", "arm.sdf is SDF: allowed: an MJCF file"),
    ("legs.xacro", urdf("", more=MACROS.replace('mass value="0.05"', 'mass value="${heavy}"')),
     "legs.xacro: xacro cannot expand it (error: name 'heavy' is not defined)"),
    ("arm.urdf", urdf("", mesh(ARM)), f"mesh of l1: got '{ARM}', allowed: a file that is there (--package NAME=FOLDER "
     "says where), or <inertial> in that link"),
    ("arm.urdf", urdf("", mesh("a.dae")), "mesh of l1: got 'a.dae', allowed: STL or OBJ, which MuJoCo reads, not .dae; "
     "or <inertial> in that link"),
    ("arm.urdf", "<robot><link name='a'>", "is no model that MuJoCo reads"),
    ("arm.urdf", "", "is no model that MuJoCo reads"),
    ("arm.stl", "solid", "is no model that MuJoCo reads")])
def test_files_that_cannot_be_opened_are_one_line(tmp_path, name, text, said):
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as caught:
        robot_model(tmp_path / name)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)

