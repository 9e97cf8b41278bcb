"""Words of MJCF that robots made from code share: shapes, masses, a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

# --- A robot with two driven wheels and a ball caster as a MuJoCo model: each wheel on a servo that turns -------------

# A robot of the kind of Fig. 30 of Urrea & Kern (2011), of which the paper gives no numbers: all dimensions and masses
# here are assumed, those of a hobbyist's robot of two plates, but for the servos' mass, which is that of Hitec's list.
#
# Wheels touch the ground in one point each, as thin ellipsoids do, so that their distance is that of these points.
# Friction is that of rubber on a dry floor (assumed); the ball of the caster rolls any way, and is without friction
# instead. Cone and `impratio` are such that the wheels creep by less than 3e-4 of their way at steps of 1 ms, and
# contacts are damped critically within 5 ms, so that the robot does not bounce. Its wheels are small and its caster is
# far behind: a servo of this size would otherwise spin its wheels at every burst, or tip it over. Rolling costs
# nothing.
#
# Joints have neither damping nor friction nor armature: the servos bring these.

WHEELS = ("left_wheel", "right_wheel")
"""Names of the joints; both turn forward with positive angles."""
WHEEL_RADIUS = 0.025  # m, assumed; a larger one would spin under the bursts of a strong servo
TRACK = 0.16  # m between the points of contact, assumed
WHEEL_MASS = 0.03  # kg each, assumed
SERVO_MASS = 0.110  # kg each: Hitec's list of the HS-755HB, as in its file of the catalog
CHASSIS_MASS = 1.72  # kg of plates, battery and electronics, assumed
MASS = CHASSIS_MASS + 2.0 * (SERVO_MASS + WHEEL_MASS)
FRICTION = 1.0  # of rubber on a dry floor, assumed
_WHEEL_WIDTH, _CASTER_RADIUS, _CASTER_AT = 0.018, 0.008, -0.12  # m
_PLATE = (0.1, 0.06, 0.002)  # half of a plate [m]
_BATTERY = (0.035, 0.012, 0.012)  # half of it [m]
_CASE = (0.0295, 0.025, 0.0145)  # half of a servo's case [m]
_SCENE = """
<mujoco>
  <visual><headlight ambient="0.32 0.32 0.34" diffuse="0.3 0.3 0.3" specular="0.1 0.1 0.1"/>
    <global offwidth="1280" offheight="960"/><quality shadowsize="4096"/><map zfar="30"/><rgba haze="0.93 0.95 0.97 1"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.66 0.75 0.86" rgb2="0.93 0.95 0.97" width="256"
      height="1536"/>
    <texture name="ground" type="2d" builtin="checker" rgb1="0.86 0.88 0.9" rgb2="0.79 0.82 0.85" width="256"
      height="256"/>
    <material name="ground" texture="ground" texrepeat="5 5" texuniform="true" specular="0" shininess="0"/>
  </asset>
  <worldbody>
    <light name="lamp" pos="0.7 -1 2.4" dir="-0.25 0.38 -0.9" cutoff="80" exponent="0" diffuse="0.4 0.4 0.39"
      specular="0.2 0.2 0.2"/>
    <light name="sky" pos="0 0 3" dir="0.2 0.3 -0.9" directional="true" castshadow="false" diffuse="0.3 0.3 0.3"
      specular="0 0 0"/>
    <camera name="side" pos="0.5 -1.1 1.1" fovy="50" xyaxes="1 0 0 0 0.63 0.77"/>
  </worldbody>
</mujoco>
"""


def mobile_robot(*, scene: bool = True) -> str:
    """Return the MJCF of a robot that stands at the origin and looks along x, its left wheel towards +y.

    Its body is `chassis`, whose origin lies in the middle between the wheels' axles; the joint `floating` frees it, and
    `left_wheel` and `right_wheel` are the joints of the servos. The site `axle` is at its origin.

    Parameters
    ----------
    scene : bool
        With light, sky and the camera `side`; the ground is there in any case.

    Returns
    -------
    str
        XML, for `mujoco.MjModel.from_xml_string`.

    Examples
    --------
    >>> mobile_robot().count("<joint "), round(MASS, 2)
    (2, 2.0)
    """
    root = Xml.Element("mujoco", model="mobile robot")
    Xml.SubElement(root, "compiler", angle="radian", autolimits="true")
    Xml.SubElement(root, "option", timestep="0.001", cone="elliptic", impratio="100")
    default = Xml.SubElement(Xml.SubElement(root, "default"), "default", attrib={"class": "robot"})
    # It has conaffinity alone: what has both bits, as the ground has, touches it, and it never itself.
    Xml.SubElement(default, "geom", contype="0", conaffinity="1", solref="0.005 1", solimp="0.99 0.999 0.0001")
    assets = Xml.SubElement(root, "asset")
    for name, colour in (("plate", "0.98 0.78 0.16 1"), ("servo", "0.13 0.14 0.16 1"), ("tyre", "0.2 0.21 0.24 1"),
                         ("rim", "0.72 0.74 0.78 1")):
        Xml.SubElement(assets, "material", name=name, rgba=colour, specular="0.15", shininess="0.3")
    world = Xml.SubElement(root, "worldbody")
    ground = Xml.SubElement(world, "geom", name="ground", type="plane", size="0 0 0.05", friction="1 0 0")
    if scene:
        ground.set("material", "ground")
        more = Xml.fromstring(_SCENE)
        root.extend(more.findall("visual"))
        assets.extend(more.findall("asset/*"))
        world.extend(more.findall("worldbody/*"))
    body = Xml.SubElement(world, "body", name="chassis", childclass="robot", pos=_words(0.0, 0.0, WHEEL_RADIUS))
    Xml.SubElement(body, "freejoint", name="floating")
    _add_chassis(body)
    for name, side in zip(WHEELS, (1.0, -1.0), strict=True):
        _add_wheel(body, name, 0.5 * side * TRACK)
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode") + "\n"


def _words(*numbers: float) -> str:
    return " ".join(f"{x:.9g}" for x in numbers)


def _add_chassis(body: Xml.Element) -> None:
    """Add plates, battery, servos and caster; the battery lies behind the axle, so that the caster carries."""
    back, half = -0.045, 0.25 * CHASSIS_MASS
    for height in (-0.014, 0.02):
        Xml.SubElement(body, "geom", type="box", material="plate", pos=_words(back, 0.0, height), size=_words(*_PLATE),
                       mass=_words(half))
    Xml.SubElement(body, "geom", type="box", material="rim", pos=_words(-0.02, 0.0, 0.002), size=_words(*_BATTERY),
                   mass=_words(2.0 * half))
    for side in (1.0, -1.0):
        Xml.SubElement(body, "geom", type="box", material="servo", pos=_words(0.01, 0.04 * side, 0.002),
                       size=_words(*_CASE), mass=_words(SERVO_MASS))
    # Its own law of contact counts (priority), and that has no friction (condim).
    Xml.SubElement(body, "geom", name="caster", type="sphere", material="rim", size=_words(_CASTER_RADIUS), mass="0",
                   pos=_words(_CASTER_AT, 0.0, _CASTER_RADIUS - WHEEL_RADIUS), condim="1", priority="1")
    Xml.SubElement(body, "site", name="axle", size="0.004", rgba="0.9 0.2 0.2 0.6", group="3")


def _add_wheel(body: Xml.Element, name: str, place: float) -> None:
    """Add a wheel [m to the left of the middle], which weighs as a disc and touches as an ellipsoid."""
    wheel = Xml.SubElement(body, "body", name=name, pos=_words(0.0, place, 0.0))
    Xml.SubElement(wheel, "joint", name=name, type="hinge", axis="0 1 0")
    about_y = {"zaxis": "0 1 0"}
    Xml.SubElement(wheel, "geom", {
        "type": "cylinder", "material": "tyre", "size": _words(0.98 * WHEEL_RADIUS, 0.5 * _WHEEL_WIDTH),
        "mass": _words(WHEEL_MASS), "conaffinity": "0", **about_y})
    Xml.SubElement(wheel, "geom", {
        "type": "cylinder", "material": "rim", "size": _words(0.5 * WHEEL_RADIUS, 0.55 * _WHEEL_WIDTH), "mass": "0",
        "conaffinity": "0", **about_y})
    for angle in ("0.013 0 0", "-0.013 0 0"):  # by which one sees it turn
        Xml.SubElement(wheel, "geom", type="sphere", material="plate", pos=angle, size="0.0105", mass="0",
                       conaffinity="0")
    Xml.SubElement(wheel, "geom", {
        "name": name, "type": "ellipsoid", "material": "tyre", "size": _words(WHEEL_RADIUS, WHEEL_RADIUS,
                                                                             0.5 * _WHEEL_WIDTH),
        "mass": "0", "condim": "3", "priority": "1", "friction": _words(FRICTION, 0.0, 0.0), "group": "3", **about_y})


# --- Words of MJCF that robots made from code share: shapes, masses, a scene ------------------------------------------

Vector = tuple[float, float, float]
Shape = Mapping[str, str]

COLOURS: Mapping[str, str] = {"printed": "0.98 0.78 0.16 1", "servo": "0.13 0.14 0.16 1", "horn": "0.72 0.74 0.78 1",
                              "pad": "0.26 0.28 0.33 1", "board": "0.16 0.44 0.36 1"}
"""Of materials: red, green, blue, opacity."""
_HAZE = "0.93 0.95 0.97 1"


def words(numbers: Sequence[float]) -> str:
    """Return numbers as MJCF has them.

    Examples
    --------
    >>> words((0.1, -2.0))
    '0.1 -2'
    """
    return " ".join(f"{float(x):.9g}" for x in numbers)


def box(colour: str, centre: Vector, half: Vector) -> Shape:
    """Return a box along the axes; all in m."""
    return {"type": "box", "material": colour, "pos": words(centre), "size": words(half)}


def disc(colour: str, centre: Vector, radius: float, half: float) -> Shape:
    """Return a disc about the z axis."""
    return {"type": "cylinder", "material": colour, "pos": words(centre), "size": words((radius, half))}


def beam(colour: str, start: Vector, end: Vector, width: float, thickness: float, *, across: int = 2) -> Shape:
    """Return a box from one point to another, as wide as said along the axis `across` of the link."""
    a, b = np.array(start), np.array(end)
    along, side = (b - a) / np.linalg.norm(b - a), np.eye(3)[across]
    return {"type": "box", "material": colour, "pos": words((a + b) / 2.0), "xyaxes": words((*along, *side)),
            "size": words((float(np.linalg.norm(b - a)) / 2.0, width / 2.0, thickness / 2.0))}


def add_mass(body: Xml.Element, mass: float, centre: Sequence[float], inertia: Sequence[float]) -> None:
    """Give a body its mass [kg], centre [m] and inertia about it, xx, yy, zz, xy, xz, yz [kg m²]."""
    Xml.SubElement(body, "inertial", pos=words(centre), mass=words((mass,)), fullinertia=words(inertia))


class Block(NamedTuple):
    """A box of even density along the axes of its body: mass [kg], centre [m], half of its sides [m]."""

    mass: float
    centre: Vector
    half: Vector


def add_blocks(body: Xml.Element, blocks: Sequence[Block]) -> None:
    """Give a body the mass, centre and inertia of the boxes that it is made of."""
    masses = np.array([block.mass for block in blocks])
    centres = np.array([block.centre for block in blocks])
    centre = masses @ centres / masses.sum()
    total = np.zeros((3, 3))
    for block, at in zip(blocks, centres - centre, strict=True):
        h = np.square(block.half)
        total += block.mass * (np.diag((h.sum() - h) / 3.0) + (at @ at) * np.eye(3) - np.outer(at, at))
    add_mass(body, float(masses.sum()), centre.tolist(),
             (total[0, 0], total[1, 1], total[2, 2], total[0, 1], total[0, 2], total[1, 2]))


def add_shapes(body: Xml.Element, shapes: Iterable[Shape]) -> None:
    """Give a body its shapes."""
    for shape in shapes:
        Xml.SubElement(body, "geom", attrib=dict(shape))


def new_robot(name: str) -> tuple[Xml.Element, Xml.Element, Xml.Element]:
    """Return an MJCF file that is empty but for materials, its assets and its world.

    Geoms of the class of the robot's name touch what is not of it, and never each other.
    """
    root = Xml.Element("mujoco", model=name)
    Xml.SubElement(root, "compiler", angle="radian", autolimits="true")
    # The robot has conaffinity alone: what has both bits, as geoms have by default, touches it, and it never itself.
    default = Xml.SubElement(Xml.SubElement(root, "default"), "default", attrib={"class": name})
    Xml.SubElement(default, "geom", contype="0", conaffinity="1")
    assets = Xml.SubElement(root, "asset")
    for colour, rgba in COLOURS.items():
        Xml.SubElement(assets, "material", name=colour, rgba=rgba, specular="0.15", shininess="0.3")
    return root, assets, Xml.SubElement(root, "worldbody")


def text(root: Xml.Element) -> str:
    """Return an MJCF file."""
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode") + "\n"


def add_scene(root: Xml.Element, assets: Xml.Element, world: Xml.Element, place: Vector, target: Vector) -> None:
    """Add ground, sky, light and the camera `side` at a place that looks at a target [m]."""
    visual = Xml.SubElement(root, "visual")
    Xml.SubElement(visual, "headlight", ambient="0.32 0.32 0.34", diffuse="0.3 0.3 0.3", specular="0.1 0.1 0.1")
    Xml.SubElement(visual, "global", offwidth="1280", offheight="960")
    Xml.SubElement(visual, "quality", shadowsize="4096")
    Xml.SubElement(visual, "map", zfar="30")
    Xml.SubElement(visual, "rgba", haze=_HAZE)
    Xml.SubElement(assets, "texture", name="sky", type="skybox", builtin="gradient", rgb1="0.66 0.75 0.86",
                   rgb2="0.93 0.95 0.97", width="256", height="1536")
    Xml.SubElement(assets, "texture", name="ground", type="2d", builtin="checker", rgb1="0.86 0.88 0.9",
                   rgb2="0.79 0.82 0.85", width="256", height="256")
    Xml.SubElement(assets, "material", name="ground", texture="ground", texrepeat="20 20", texuniform="true",
                   specular="0", shininess="0")
    Xml.SubElement(world, "geom", name="ground", type="plane", size="0 0 0.05", material="ground")
    # A spot light casts the shadow: that of a directional one is noisy at the edge of its map.
    Xml.SubElement(world, "light", name="lamp", pos="0.7 -1 2.4", dir="-0.25 0.38 -0.9", cutoff="80", exponent="0",
                   diffuse="0.4 0.4 0.39", specular="0.2 0.2 0.2")
    Xml.SubElement(world, "light", name="sky", pos="0 0 3", dir="0.2 0.3 -0.9", directional="true",
                   castshadow="false", diffuse="0.3 0.3 0.3", specular="0 0 0")
    ahead = np.array(target) - np.array(place)
    forward = ahead / np.linalg.norm(ahead)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    Xml.SubElement(world, "camera", name="side", pos=words(place), fovy="32",
                   xyaxes=words((*right, *np.cross(right, forward))))


# --- An arm of the class of the SO-101 as a MuJoCo model: six joints, each of them turned by a servo ------------------

# Joints, limits, masses, centres of mass and inertias are those that its makers publish: TheRobotStudio/SO-ARM100
# (Apache-2.0), Simulation/SO101/so101_new_calib.xml, commit 07be617dd9501a6bd6d25299a67422a9abac035a. Zero and limits
# of `wrist_roll` are those of so101_new_calib.urdf beside it, commit 0aee1d0f885a9643b91f544be1ef86d1200432c2: there
# zero is in the middle of the limits, as LeRobot has it and as with the rest of the arm; the former has it 2.8 degrees
# beside. Servos stand where the publication has them; printed parts are boxes that only resemble its own, so contacts
# of the arm are rough.
#
# Joints have neither damping nor friction nor armature: the servos bring these. Their masses are in those of the links.

_Quaternion = tuple[float, float, float, float]

_SERVO = (0.0226, 0.01235, 0.0175)  # half of the case of an STS3215 [m]
_HORN = (0.0125, 0.0, 0.0181)  # middle of its horn, from the middle of its case [m]
_SIDE = ((0.3, -1.4, 0.42), (0.06, 0.0, 0.22))  # place of the camera, and what it looks at [m]


@dataclass(frozen=True, kw_only=True)
class _Link:
    """A link: how it hangs on the one before, what it weighs, how it looks.

    Parameters
    ----------
    name, joint : str
    place, turn : tuple of float
        Of its frame in that of the link before [m], quaternion; its joint turns about z.
    limits : (float, float)
        [rad]
    mass : float
        [kg]
    centre : tuple of float
        Of mass [m]
    inertia : tuple of float
        About it: xx, yy, zz, xy, xz, yz [kg m2]
    shapes : tuple of mapping
    """

    name: str
    joint: str
    place: Vector = (0.0, 0.0, 0.0)
    turn: _Quaternion = (1.0, 0.0, 0.0, 0.0)
    limits: tuple[float, float]
    mass: float
    centre: Vector
    inertia: tuple[float, float, float, float, float, float]
    shapes: tuple[Shape, ...]


def _servo(place: Vector, turn: _Quaternion, *, horn: bool = True) -> tuple[Shape, ...]:
    """Return a servo, whose horn turns about its own z axis."""
    w, *v = np.array(turn) / np.linalg.norm(turn)
    offset = np.array(_HORN)
    at = np.array(place) + offset + 2.0 * np.cross(v, np.cross(v, offset) + w * offset)
    case = {"type": "box", "material": "servo", "pos": words(place), "quat": words(turn), "size": words(_SERVO)}
    disc = {"type": "cylinder", "material": "horn", "pos": words(tuple(at)), "quat": words(turn),
            "size": words((0.0105, 0.0012))}
    return (case, disc) if horn else (case,)


def _fork(reach: float, *, low: float, high: float, to: tuple[float, float], hub: float = 0.0125) -> tuple[Shape, ...]:
    """Return two cheeks with round ends about the joint, and what joins them.

    Parameters
    ----------
    reach : float
        How far the cheeks go towards `to`, as a share.
    low, high : float
        Middle of each along the axis [m]
    to : (float, float)
        Where the link goes, in its plane [m]
    """
    end = (reach * to[0], reach * to[1])
    cheeks = tuple(shape for z in (low, high) for shape in (
        disc("printed", (0.0, 0.0, z), hub, 0.0026), disc("horn", (0.0, 0.0, z), 0.55 * hub, 0.0032),
        beam("printed", (0.0, 0.0, z), (*end, z), 0.0044, 1.8 * hub)))
    middle = 0.5 * (low + high)
    return (*cheeks, beam("printed", (*end, middle), (*to, middle), high - low + 0.0044, 1.9 * hub))


_BASE = (
    box("printed", (0.008, 0.0, 0.003), (0.05, 0.04, 0.003)),
    box("printed", (0.0263, 0.0, 0.024), (0.0275, 0.0185, 0.02)),
    box("printed", (-0.024, 0.0, 0.03), (0.003, 0.027, 0.028)),
    box("board", (-0.0285, 0.0, 0.034), (0.0015, 0.024, 0.02)),
    *_servo((0.0263353, 0.0, 0.0437), (1.0, 0.0, 0.0, 0.0)),
)
_BASE_MASS = (0.147, (0.0137179, -5.19711e-05, 0.0334843),
              (0.000114686, 0.000136117, 0.000130364, -4.59787e-07, 4.97151e-06, 9.75275e-08))
_LINKS = (
    _Link(name="shoulder", joint="shoulder_pan", place=(0.0388353, -8.97657e-09, 0.0624), turn=(0.0, 0.0, -1.0, 0.0),
          limits=(-1.91986, 1.91986), mass=0.100006, centre=(-0.0307604, -1.66727e-05, -0.0252713),
          inertia=(8.3759e-05, 8.10403e-05, 2.39783e-05, 7.55525e-08, -1.16342e-06, 1.54663e-07),
          shapes=(disc("printed", (0.0, 0.0, -0.003), 0.019, 0.002),
                  box("printed", (-0.018, 0.0, -0.0055), (0.03, 0.0175, 0.0035)),
                  box("printed", (-0.0304, 0.0025, -0.024), (0.0165, 0.0165, 0.017)),
                  *_servo((-0.0303992, 0.000422241, -0.0417), (0.5, 0.5, 0.5, -0.5)))),
    _Link(name="upper_arm", joint="shoulder_lift", place=(-0.0303992, -0.0182778, -0.0542),
          turn=(0.5, -0.5, -0.5, -0.5), limits=(-1.74533, 1.74533), mass=0.103,
          centre=(-0.0898471, -0.00838224, 0.0184089),
          inertia=(4.08002e-05, 0.000147318, 0.000142487, -1.97819e-05, -4.03016e-08, 8.97326e-09),
          shapes=(*_fork(0.5, low=-0.0025, high=0.0399, to=(-0.088, -0.004)),
                  box("printed", (-0.1, -0.0125, 0.0205), (0.014, 0.0185, 0.0165)),
                  *_servo((-0.11257, -0.0155, 0.0187), (0.0, -1.0, 1.0, 0.0)))),
    _Link(name="lower_arm", joint="elbow_flex", place=(-0.11257, -0.028, 0.0), turn=(1.0, 0.0, 0.0, 1.0),
          limits=(-1.69, 1.69), mass=0.104, centre=(-0.0980701, 0.00324376, 0.0182831),
          inertia=(2.87438e-05, 0.000159844, 0.00014529, 7.41152e-06, 1.26409e-06, -4.90188e-08),
          shapes=(*_fork(0.5, low=-0.0025, high=0.0399, to=(-0.1, 0.004)),
                  box("printed", (-0.1115, 0.0045, 0.0205), (0.017, 0.0145, 0.0165)),
                  *_servo((-0.1224, 0.0052, 0.0187), (0.0, 0.0, 1.0, 0.0)))),
    _Link(name="wrist", joint="wrist_flex", place=(-0.1349, 0.0052, 0.0), turn=(1.0, 0.0, 0.0, -1.0),
          limits=(-1.65806, 1.65806), mass=0.079, centre=(-0.000103312, -0.0386143, 0.0281156),
          inertia=(3.68263e-05, 2.5391e-05, 2.1e-05, 1.7893e-08, -5.28128e-08, 3.6412e-06),
          shapes=(*_fork(0.8, low=-0.0025, high=0.0399, to=(0.0, -0.03), hub=0.011),
                  box("printed", (0.0, -0.036, 0.0262), (0.0145, 0.0125, 0.0215)),
                  *_servo((0.0, -0.0424, 0.0306), (0.5, 0.5, 0.5, -0.5)))),
    _Link(name="gripper", joint="wrist_roll", place=(0.0, -0.0611, 0.0181), turn=(0.0, 0.0, 1.0, 1.0),
          limits=(-2.79253, 2.79253), mass=0.087, centre=(0.000213627, 0.000245138, -0.025187),
          inertia=(2.75087e-05, 4.33657e-05, 3.45059e-05, -3.35241e-07, -5.7352e-06, -5.17847e-08),
          shapes=(disc("printed", (0.0, 0.0, -0.0025), 0.017, 0.0025),
                  box("printed", (0.003, 0.0, -0.007), (0.0245, 0.0165, 0.0025)),
                  beam("printed", (-0.0185, 0.0, -0.005), (-0.0185, 0.0, -0.046), 0.033, 0.005, across=1),
                  beam("printed", (-0.0185, 0.0, -0.043), (-0.0135, 0.0, -0.1), 0.022, 0.005, across=1),
                  beam("pad", (-0.0142, 0.0, -0.062), (-0.0094, 0.0, -0.1), 0.02, 0.003, across=1),
                  *_servo((0.0077, 0.0001, -0.0234), (1.0, -1.0, 0.0, 0.0)))),
    _Link(name="moving_jaw", joint="gripper", place=(0.0202, 0.0188, -0.0234), turn=(1.0, 1.0, 0.0, 0.0),
          limits=(-0.174533, 1.74533), mass=0.012, centre=(-0.00157495, -0.0300244, 0.0192755),
          inertia=(6.61427e-06, 1.89032e-06, 5.28738e-06, -3.19807e-07, -5.90717e-09, -1.09945e-07),
          shapes=(*_fork(0.7, low=-0.0005, high=0.0385, to=(0.0, -0.03), hub=0.0105),
                  beam("printed", (0.001, -0.028, 0.019), (-0.0105, -0.077, 0.019), 0.022, 0.006),
                  beam("pad", (-0.0045, -0.045, 0.019), (-0.0138, -0.077, 0.019), 0.02, 0.003))),
)
_TOOL = ((-0.0079, -0.000218121, -0.0981274), (1.0, 0.0, 1.0, 0.0))  # `gripperframe` of the publication, in `gripper`

JOINTS: tuple[str, ...] = tuple(link.joint for link in _LINKS)
"""Names of the joints from the base on, as LeRobot has them."""
LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType({link.joint: link.limits for link in _LINKS})
"""Limits of the joints [rad]; `ranges=` of `read_motion`."""


def so101(*, scene: bool = True, motors: bool = False) -> str:
    """Return the MJCF of an arm that stands on the ground at the origin and looks along x.

    Its bodies are base, shoulder, upper_arm, lower_arm, wrist, gripper and moving_jaw; the site `tool` is between the
    tips of its fingers, and its x axis points out of them. At angle 0 the upper arm is upright and the rest level;
    `gripper` opens with positive angles. Its parts touch the ground and other things, but not each other.

    Parameters
    ----------
    scene : bool
        With ground, light, sky and the camera `side`, which sees all that the arm can reach.
    motors : bool
        With a `motor` on each joint, named as the joint, whose control is the torque [N m].

    Returns
    -------
    str
        XML, for `mujoco.MjModel.from_xml_string`.

    Examples
    --------
    >>> so101().count("<joint "), so101(scene=False, motors=True).count("<motor ")
    (6, 6)
    """
    root, assets, world = new_robot("so101")
    if scene:
        add_scene(root, assets, world, *_SIDE)
    body = Xml.SubElement(world, "body", name="base", childclass="so101")
    add_mass(body, *_BASE_MASS)
    add_shapes(body, _BASE)
    for link in _LINKS:
        body = Xml.SubElement(body, "body", name=link.name, pos=words(link.place), quat=words(link.turn))
        Xml.SubElement(body, "joint", name=link.joint, type="hinge", axis="0 0 1", range=words(link.limits))
        add_mass(body, link.mass, link.centre, link.inertia)
        add_shapes(body, link.shapes)
        if link.name == "gripper":
            Xml.SubElement(body, "site", name="tool", pos=words(_TOOL[0]), quat=words(_TOOL[1]), size="0.004",
                           rgba="0.9 0.2 0.2 0.6", group="3")
    if motors:
        actuators = Xml.SubElement(root, "actuator")
        for joint in JOINTS:
            Xml.SubElement(actuators, "motor", name=joint, joint=joint)
    return text(root)


# --- A biped of the size of a hobbyist's robot as a MuJoCo model: ten joints, each of them turned by a servo ----------

# No robot that somebody sells: all sizes and masses are assumed, but for the servos' mass, which is that of Feetech's
# list of the STS3215, as in its file of the catalog. Legs have a hand's length, so that servos of 3 N m carry its
# weight on one bent leg with a seventh of their torque. A link has the servo that turns the next one. Feet have rubber
# (friction 1, assumed), and contacts are damped critically within 10 ms; legs do not touch each other. Joints have
# neither damping nor friction nor armature: the servos bring these.

BIPED_JOINTS: tuple[str, ...] = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in (
    "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll"))
"""Names of the biped's joints, from the hip on."""
BIPED_LIMITS: Mapping[str, tuple[float, float]] = MappingProxyType({
    joint: limits for joint in BIPED_JOINTS for part, limits in (
        ("hip_roll", (-0.6, 0.6)), ("hip_pitch", (-1.5, 0.9)), ("knee", (-0.1, 2.2)), ("ankle_pitch", (-1.2, 1.2)),
        ("ankle_roll", (-0.6, 0.6))) if joint.endswith(part)})
"""Limits of the biped's joints [rad], assumed: those of brackets that do not hit each other."""
_BEND = 0.35  # rad: of hip and ankle, and half of the knee, as it stands
BIPED_STANCE: Mapping[str, float] = MappingProxyType({
    joint: {"hip_pitch": -_BEND, "knee": 2.0 * _BEND, "ankle_pitch": -_BEND}.get(joint.partition("_")[2], 0.0)
    for joint in BIPED_JOINTS})
"""Angles of the biped's joints as it stands, knees bent, its middle above its feet [rad]."""
_STS3215, _BRACKET, _FOOT, _BODY = 0.055, 0.02, 0.03, 0.55  # kg: a servo; bracket of a link, foot, body
_HIP_AT, _HIP_LINK, _BONE, _ANKLE_LINK, _SOLE = 0.042, 0.03, 0.085, 0.03, 0.012  # m: beside the middle; between axes
_SOLE_HALF = (0.055, 0.032, 0.004)  # half of a foot [m]
_BODY_HALF = (0.04, 0.065, 0.055)  # half of the body [m]
BIPED_HEIGHT = _BODY_HALF[2] + _HIP_LINK + 2.0 * _BONE * float(np.cos(_BEND)) + _ANKLE_LINK + _SOLE
"""Height of the middle of the biped's body as it stands [m]."""


def biped(*, scene: bool = True) -> str:
    """Return the MJCF of a biped of 1.3 kg that stands at the origin and looks along x.

    Its body is `body`, which the joint `floating` frees; each of its joints has a `motor` of its name, whose control is
    that of the servo there. Both legs are straight at angle 0, and positive angles of hip, knee and ankle turn what is
    below backwards; it stands as `BIPED_STANCE` says. Feet are the geoms `left_foot` and `right_foot`.

    Parameters
    ----------
    scene : bool
        With light and sky, and the camera `follow` that keeps beside it; the ground is there in any case.

    Returns
    -------
    str
        XML, for `mujoco.MjModel.from_xml_string`.

    Examples
    --------
    >>> biped().count("<joint "), biped().count("<motor "), round(BIPED_HEIGHT, 3)
    (10, 10, 0.287)
    """
    root, assets, world = new_robot("biped")
    if scene:
        add_scene(root, assets, world, (0.9, -1.1, 0.55), (0.0, 0.0, 0.16))
    else:
        Xml.SubElement(world, "geom", name="ground", type="plane", size="0 0 0.05")
    body = Xml.SubElement(world, "body", name="body", childclass="biped", pos=words((0.0, 0.0, BIPED_HEIGHT)))
    Xml.SubElement(body, "freejoint", name="floating")
    if scene:
        Xml.SubElement(body, "camera", name="follow", mode="track", pos="0.55 -0.85 0.2", fovy="40",
                       xyaxes="0.84 0.543 0 -0.12 0.186 0.975")
    low = -_BODY_HALF[2]
    servos = [Block(_STS3215, (0.0, side * _HIP_AT, low + _SERVO[2]), _SERVO) for side in (1.0, -1.0)]
    add_blocks(body, [Block(_BODY, (0.0, 0.0, 0.0), _BODY_HALF), *servos])
    add_shapes(body, (box("printed", (0.0, 0.0, 0.0), _BODY_HALF),
                      box("board", (0.0, 0.0, 0.01), (0.042, 0.045, 0.03)),
                      box("servo", (0.03, 0.0, 0.035), (0.014, 0.03, 0.008))))
    for name, side in (("left", 1.0), ("right", -1.0)):
        _add_leg(body, name, side * _HIP_AT, low)
    actuators = Xml.SubElement(root, "actuator")
    for joint in BIPED_JOINTS:
        Xml.SubElement(actuators, "motor", name=joint, joint=joint)
    return text(root)


def _add_leg(body: Xml.Element, name: str, aside: float, low: float) -> None:
    """Add a leg at a place of the body [m]: hip link, thigh, shank, ankle link, foot."""
    at, drop = (0.0, aside, low), 0.0
    for joint, axis, length in (
            ("hip_roll", "1 0 0", _HIP_LINK), ("hip_pitch", "0 1 0", _BONE), ("knee", "0 1 0", _BONE),
            ("ankle_pitch", "0 1 0", _ANKLE_LINK), ("ankle_roll", "1 0 0", _SOLE)):
        full = f"{name}_{joint}"
        body = Xml.SubElement(body, "body", name=full, pos=words(at if not drop else (0.0, 0.0, -drop)))
        Xml.SubElement(body, "joint", name=full, type="hinge", axis=axis, range=words(BIPED_LIMITS[full]))
        drop = length
        if joint == "ankle_roll":
            sole = (0.008, 0.0, -_SOLE + _SOLE_HALF[2])
            add_blocks(body, [Block(_FOOT, sole, _SOLE_HALF)])
            add_shapes(body, ({**box("pad", sole, _SOLE_HALF), "name": f"{name}_foot", "friction": "1 0.005 0.0001",
                               "solref": "0.01 1"},))
            return
        upright = (_SERVO[1], _SERVO[0], _SERVO[2])
        servo = (0.0, 0.0, -length + (0.0 if length == _BONE else 0.5 * length))
        add_blocks(body, [Block(_STS3215, servo, upright),
                          Block(_BRACKET, (0.0, 0.0, -0.5 * length), (0.012, 0.018, 0.5 * length))])
        no_touch = {"contype": "0", "conaffinity": "0"}
        add_shapes(body, ({**box("servo", servo, upright), **no_touch},
                          {**box("printed", (0.0, 0.0, -0.5 * length), (0.009, 0.02, 0.5 * length)), **no_touch}))
