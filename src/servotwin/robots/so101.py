"""An arm of the class of the SO-101 as a MuJoCo model: six joints, each of them turned by a servo.

Joints, limits, masses, centres of mass and inertias are those that its makers publish: TheRobotStudio/SO-ARM100
(Apache-2.0), Simulation/SO101/so101_new_calib.xml, commit 07be617dd9501a6bd6d25299a67422a9abac035a. Zero and limits of
`wrist_roll` are those of so101_new_calib.urdf beside it, commit 0aee1d0f885a9643b91f544be1ef86d1200432c2: there zero is
in the middle of the limits, as LeRobot has it and as with the rest of the arm; the former has it 2.8 degrees beside.
Servos stand where the publication has them; printed parts are boxes that only resemble its own, so contacts of the arm
are rough.

Joints have neither damping nor friction nor armature: the servos bring these. Their masses are in those of the links.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from xml.etree import ElementTree as Xml

import numpy as np

from servotwin.robots import mjcf
from servotwin.robots.mjcf import Shape, Vector, beam, box, disc, words

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
    root, assets, world = mjcf.new_robot("so101")
    if scene:
        mjcf.add_scene(root, assets, world, *_SIDE)
    body = Xml.SubElement(world, "body", name="base", childclass="so101")
    mjcf.add_mass(body, *_BASE_MASS)
    mjcf.add_shapes(body, _BASE)
    for link in _LINKS:
        body = Xml.SubElement(body, "body", name=link.name, pos=words(link.place), quat=words(link.turn))
        Xml.SubElement(body, "joint", name=link.joint, type="hinge", axis="0 0 1", range=words(link.limits))
        mjcf.add_mass(body, link.mass, link.centre, link.inertia)
        mjcf.add_shapes(body, link.shapes)
        if link.name == "gripper":
            Xml.SubElement(body, "site", name="tool", pos=words(_TOOL[0]), quat=words(_TOOL[1]), size="0.004",
                           rgba="0.9 0.2 0.2 0.6", group="3")
    if motors:
        actuators = Xml.SubElement(root, "actuator")
        for joint in JOINTS:
            Xml.SubElement(actuators, "motor", name=joint, joint=joint)
    return mjcf.text(root)
