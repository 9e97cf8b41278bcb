"""A robot with two driven wheels and a ball caster as a MuJoCo model: each wheel on a servo that turns endlessly.

A robot of the kind of Fig. 30 of Urrea & Kern (2011), of which the paper gives no numbers: all dimensions and masses
here are assumed, those of a hobbyist's robot of two plates, but for the servos' mass, which is that of Hitec's list.

Wheels touch the ground in one point each, as thin ellipsoids do, so that their distance is that of these points.
Friction is that of rubber on a dry floor (assumed); the ball of the caster rolls any way, and is without friction
instead. Cone and `impratio` are such that the wheels creep by less than 3e-4 of their way at steps of 1 ms, and
contacts are damped critically within 5 ms, so that the robot does not bounce. Its wheels are small and its caster is
far behind: a servo of this size would otherwise spin its wheels at every burst, or tip it over. Rolling costs nothing.

Joints have neither damping nor friction nor armature: the servos bring these.
"""

from __future__ import annotations

from xml.etree import ElementTree as Xml

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
