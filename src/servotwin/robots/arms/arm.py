"""Arms made from code: their MJCF, where their servos sit, and what of the tool they can place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models import Model, mid_travel
from servotwin.robots import mjcf_models as mjcf
from servotwin.robots.mjcf_models import Block, Shape, Vector, beam, box, disc, words
from servotwin.robots.model_file import robot_model
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import Mount
from servotwin.units import is_finite

# --- Arms made from code: their MJCF, where their servos sit, and what of the tool they can place ---------------------

Array = NDArray[np.float64]
TOOL = "tool"
"""Name of the site at the tool."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint of an arm and how a servo sits at it.

    Parameters
    ----------
    middle : float
        Of the joint where the servo is in the middle of its travel: of a hinge [rad], of a slide [m]
    ratio : float
        Turns of a hinge per turn of the servo; of a slide the radius of the pinion [m/rad]
    start : float
        From where inverse kinematics begins [rad or m]
    """

    middle: float
    ratio: float = 1.0
    start: float


@dataclass(frozen=True, kw_only=True)
class Arm:
    """An arm whose joints are servos.

    Parameters
    ----------
    name : str
    mjcf : str
        With a site `tool`.
    joints : mapping of str to Joint
        From the base on.
    places : tuple of bool
        Which of x, y and z of the tool it can place.
    turns : bool
        Whether it can turn the tool about the vertical as well.
    centre : tuple of float
        Of the tasks: a place of the tool that it reaches well [m]
    size : float
        Of the tasks: radius of a circle, half of the side of a square [m]
    plane : tuple of int
        The two coordinates in which circle and square lie, such as (0, 1).
    """

    name: str
    mjcf: str
    joints: Mapping[str, Joint]
    places: tuple[bool, bool, bool] = (True, True, True)
    turns: bool = True
    centre: tuple[float, float, float]
    size: float
    plane: tuple[int, int] = (0, 1)

    @property
    def redundant(self) -> bool:
        """Whether it has more joints than its tool has coordinates."""
        return len(self.joints) > sum(self.places) + self.turns

    @property
    def start(self) -> Array:
        """Posture from which inverse kinematics begins [rad or m]."""
        return np.array([joint.start for joint in self.joints.values()])

    def model(self) -> Any:
        """Return its MjModel, without servos."""
        return robot_model(load_mujoco().MjModel.from_xml_string(self.mjcf))

    def mounts(self, servos: Model | Mapping[str, Model]) -> dict[str, Mount]:
        """Return how servos sit at its joints: the middle of their travel at that of the joint's.

        Parameters
        ----------
        servos : Model, or mapping of str to Model
            One kind of all joints, or of each.

        Raises
        ------
        InputError
            If a joint is left without a servo.
        """
        given = servos if isinstance(servos, Mapping) else dict.fromkeys(self.joints, servos)
        if set(given) != set(self.joints):
            raise InputError(f"servos of {self.name}", got=", ".join(given), allowed=", ".join(self.joints))
        return {name: Mount(given[name], zero=joint.middle - joint.ratio * mid_travel(given[name]), ratio=joint.ratio)
                for name, joint in self.joints.items()}


# --- The paper's SCARA robots, with and without link redundancy (section VII, Fig. 28 and 29), as MuJoCo --------------

# The paper shows photographs and gives no dimension: all numbers here are `assumed`, such that a servo of its kind, an
# HS-755HB at each joint, can move the arm. Its case and mass are those of the maker's list, which the catalog names.
#
# Two or three links turn about vertical axes, so that gravity is nothing to their servos; a rack carries the wrist up
# and down, and the wrist turns the tool about the vertical. Three links have one joint more than the four coordinates
# of the tool need: place and turn.

LENGTHS: tuple[float, float, float] = (0.14, 0.12, 0.08)
"""Of the links from axis to axis, `assumed` [m]."""
PINION = 0.016
"""Radius of the pinion of the rack, `assumed`: half a turn lifts 50 mm [m]."""
SERVO_MASS = 0.11
"""Of an HS-755HB, from the maker's list in the catalog [kg]."""

_CASE: Vector = (0.0295, 0.0145, 0.025)  # half of 59 by 29 by 50 mm, assumed: a servo of large scale [m]
_PER_LENGTH = 0.3  # kg/m, of a printed link 30 mm wide, assumed
_HEIGHT, _STEP = 0.13, 0.014  # of the first link above the ground, and of each further one above it, assumed [m]
_CARRIAGE, _TOOL_MASS = 0.05, 0.06  # kg, of the rack with its guide, and of the tool, assumed
_REACH_DOWN = 0.125  # m, from the last link to the tip of the tool where the rack is lowest, assumed
_LIFT = 0.05  # m, travel of the rack
_QUARTER = 0.5 * math.pi
_MIDDLES = {name: math.radians(angle) for name, angle in (
    ("shoulder", -30.0), ("elbow", 60.0), ("third", 0.0), ("wrist", -45.0))}
# Where the servos are in the middle of their travel, assumed: the elbow bends to one side
_SIDE = ((0.62, -0.66, 0.5), (0.13, 0.0, 0.1))  # place of the camera, and what it looks at [m]


def scara(*, third_link: bool = True, payload: float = 0.0, scene: bool = True) -> Arm:
    """Return the SCARA robot, redundant with its third link and not so without.

    Its joints are shoulder, elbow, third (of the third link), lift and wrist; angle 0 is the arm stretched along x, and
    the tool's site `tool` keeps its frame parallel to the world's where shoulder, elbow, third and wrist add up to 0.

    Parameters
    ----------
    third_link : bool
    payload : float
        Mass that the tool carries [kg]
    scene : bool
        With ground, light, sky and a camera.

    Raises
    ------
    InputError
        If the payload is negative or no number.

    Examples
    --------
    >>> scara().redundant, scara(third_link=False).redundant
    (True, False)
    """
    check_payload(payload)
    name = "scara" if third_link else "scara-4"
    root, assets, world = mjcf.new_robot(name)
    Xml.SubElement(root, "option", timestep="0.001", integrator="implicitfast")
    if scene:
        mjcf.add_scene(root, assets, world, *_SIDE)
    base = Xml.SubElement(world, "body", name="base", childclass=name)
    mjcf.add_shapes(base, _base())
    hinges = ["shoulder", "elbow", "third"] if third_link else ["shoulder", "elbow"]
    body, place = base, (0.0, 0.0, _HEIGHT)
    for k, joint in enumerate(hinges):
        body = _link(body, joint, place, LENGTHS[k], last=k == len(hinges) - 1)
        place = (LENGTHS[k], 0.0, _STEP)
    body = _carriage(body, (place[0], 0.0, 0.0))
    _wrist(body, payload)
    joints = {"shoulder": Joint(middle=_MIDDLES["shoulder"], start=-0.6 if third_link else -0.8),
              "elbow": Joint(middle=_MIDDLES["elbow"], start=1.3 if third_link else 1.5),
              **({"third": Joint(middle=_MIDDLES["third"], start=0.3)} if third_link else {}),
              "lift": Joint(middle=0.5 * _LIFT, ratio=PINION, start=0.5 * _LIFT),
              "wrist": Joint(middle=_MIDDLES["wrist"], start=-1.0 if third_link else -0.7)}
    top = _HEIGHT + (len(hinges) - 1) * _STEP
    return Arm(name=name, mjcf=mjcf.text(root), joints=joints, centre=(0.19, 0.0, top - _REACH_DOWN + 0.5 * _LIFT),
               size=0.04)


def check_payload(payload: float) -> None:
    """Raise InputError unless a payload is a mass."""
    if not (is_finite(payload) and payload >= 0.0):
        raise InputError("payload", got=payload, allowed="a mass that is not negative [kg]")


def servo(centre: Vector, *, up: bool) -> tuple[Shape, ...]:
    """Return a servo whose axis is vertical: its horn is on it, above or below the case."""
    horn = _CASE[2] + 0.003 if up else -_CASE[2] - 0.003
    return (box("servo", centre, _CASE),
            disc("horn", (centre[0] + 0.013, centre[1], centre[2] + horn), 0.012, 0.003))


def _base() -> tuple[Shape, ...]:
    return (box("printed", (0.0, 0.0, 0.004), (0.075, 0.065, 0.004)),
            box("printed", (0.022, 0.0, 0.0355), (0.005, 0.03, 0.0275)),
            box("printed", (-0.047, 0.0, 0.0355), (0.005, 0.03, 0.0275)),
            box("printed", (-0.0125, 0.0, 0.0665), (0.04, 0.03, 0.0035)),
            *servo((-0.013, 0.0, _HEIGHT - _CASE[2] - 0.01), up=True))


def _link(parent: Xml.Element, joint: str, place: Vector, length: float, *, last: bool) -> Xml.Element:
    """Return a link that turns about a vertical axis; at its end hangs the servo of the next one."""
    body = Xml.SubElement(parent, "body", name=f"{joint}_link", pos=words(place))
    _hinge(body, joint)
    blocks = [Block(_PER_LENGTH * length, (0.5 * length, 0.0, 0.0), (0.5 * length, 0.015, 0.003))]
    shapes = [disc("printed", (0.0, 0.0, 0.0), 0.019, 0.004), disc("horn", (0.0, 0.0, 0.0), 0.009, 0.0048),
              beam("printed", (0.0, 0.0, 0.0), (length, 0.0, 0.0), 0.007, 0.03),
              disc("printed", (length, 0.0, 0.0), 0.019, 0.0035)]
    if not last:
        middle = (length - 0.013, 0.0, -_CASE[2] - 0.0035)
        blocks.append(Block(SERVO_MASS, middle, _CASE))
        shapes += servo(middle, up=True)
    else:  # the servo of the rack lies on its side on the link
        middle = (length - 0.045, 0.0, 0.019)
        blocks.append(Block(SERVO_MASS, middle, (_CASE[2], _CASE[0], _CASE[1])))
        shapes += [box("servo", middle, (_CASE[2], _CASE[0], _CASE[1])),
                   {"type": "cylinder", "material": "horn", "pos": words((length - 0.016, 0.0, 0.019)),
                    "zaxis": "1 0 0", "size": words((PINION, 0.004))},
                   box("printed", (length + 0.002, -PINION - 0.001, 0.02), (0.01, 0.003, 0.02))]
    mjcf.add_blocks(body, blocks)
    mjcf.add_shapes(body, shapes)
    return body


def _hinge(body: Xml.Element, joint: str) -> None:
    """Let a body turn about the vertical, by the half turn of its servo."""
    middle = _MIDDLES[joint]
    Xml.SubElement(body, "joint", name=joint, type="hinge", axis="0 0 1",
                   range=words((middle - _QUARTER, middle + _QUARTER)))


def _carriage(parent: Xml.Element, place: Vector) -> Xml.Element:
    """Return what goes up and down: a rack with the servo of the wrist at its lower end."""
    body = Xml.SubElement(parent, "body", name="carriage", pos=words(place))
    Xml.SubElement(body, "joint", name="lift", type="slide", axis="0 0 1", range=words((0.0, _LIFT)))
    case: Vector = (0.013, 0.0, -0.06)
    mjcf.add_blocks(body, [Block(_CARRIAGE, (0.0, -0.01, 0.0), (0.006, 0.006, 0.05)), Block(SERVO_MASS, case, _CASE)])
    mjcf.add_shapes(body, (
        box("pad", (0.0, -PINION + 0.004, 0.005), (0.007, 0.004, 0.05)),
        *(box("horn", (0.0, -PINION + 0.009, -0.038 + 0.01 * k), (0.006, 0.0015, 0.0025)) for k in range(9)),
        box("printed", (0.0, -0.002, -0.034), (0.02, 0.0145, 0.002)),
        box("servo", case, _CASE)))
    return body


def _wrist(parent: Xml.Element, payload: float) -> None:
    """Add what turns about the vertical at last: the tool, a pen, and what it carries."""
    body = Xml.SubElement(parent, "body", name="wrist_link")
    _hinge(body, "wrist")
    blocks = [Block(_TOOL_MASS, (0.0, 0.0, -0.1), (0.012, 0.012, 0.015))]
    shapes = [disc("horn", (0.0, 0.0, -0.088), 0.012, 0.003), box("printed", (0.0, 0.0, -0.095), (0.02, 0.008, 0.004)),
              disc("pad", (0.0, 0.0, -0.108), 0.006, 0.01),
              {"type": "capsule", "material": "board", "size": "0.0018",
               "fromto": words((0.0, 0.0, -0.115, 0.0, 0.0, -_REACH_DOWN + 0.0018))}]
    if payload > 0.0:
        half = min(0.5 * (payload / 7850.0) ** (1.0 / 3.0), 0.03)  # a cube of steel
        blocks.append(Block(payload, (0.0, 0.0, -0.108), (half, half, half)))
        shapes.append(box("horn", (0.0, 0.0, -0.108), (half, half, half)))
    mjcf.add_blocks(body, blocks)
    mjcf.add_shapes(body, shapes)
    Xml.SubElement(body, "site", name=TOOL, pos=words((0.0, 0.0, -_REACH_DOWN)), size="0.002",
                   rgba="0.9 0.2 0.2 1")


# --- An arm of two links in a vertical plane --------------------------------------------------------------------------

# All numbers are `assumed`, such that an HS-755HB at each joint can hold the arm stretched out. Its tool is where the
# closed form has it, which inverse kinematics is checked against:
#
#     x = l₁ cos q₁ + l₂ cos(q₁ + q₂),    z = h + l₁ sin q₁ + l₂ sin(q₁ + q₂)

TWO_LENGTHS: tuple[float, float] = (0.15, 0.12)
"""Of the links, `assumed` [m]."""
HEIGHT = 0.22
"""Of the shoulder above the ground, `assumed` [m]."""

_FLAT_CASE: Vector = (0.0295, 0.025, 0.0145)  # half of the case of a servo that lies on its side, assumed [m]
_TWO_PER_LENGTH, _TWO_TOOL_MASS = 0.25, 0.03  # kg/m of the links, kg of the tool, assumed
_SHOULDER, _ELBOW = math.radians(30.0), math.radians(-60.0)  # where the servos are in the middle of their travel
_TWO_SIDE = ((0.25, -0.95, 0.42), (0.1, 0.0, 0.22))  # place of the camera, and what it looks at [m]


def two_link(*, payload: float = 0.0, scene: bool = True) -> Arm:
    """Return the arm; its joints are shoulder and elbow, and both at 0 stretch it along x.

    Parameters
    ----------
    payload : float
        Mass at the tool [kg]
    scene : bool
        With ground, light, sky and a camera.

    Raises
    ------
    InputError
        If the payload is negative or no number.

    Examples
    --------
    >>> two_link().redundant, list(two_link().joints)
    (False, ['shoulder', 'elbow'])
    """
    check_payload(payload)
    root, assets, world = mjcf.new_robot("two-link")
    Xml.SubElement(root, "option", timestep="0.001", integrator="implicitfast")
    if scene:
        mjcf.add_scene(root, assets, world, *_TWO_SIDE)
    base = Xml.SubElement(world, "body", name="base", childclass="two-link")
    mjcf.add_shapes(base, (
        box("printed", (0.0, 0.03, 0.004), (0.07, 0.08, 0.004)),
        box("printed", (-0.013, 0.04, 0.5 * (HEIGHT - 0.015)), (0.02, 0.014, 0.5 * (HEIGHT - 0.015))),
        box("servo", (-0.013, 0.04, HEIGHT), _FLAT_CASE)))
    upper = _hinged(base, "shoulder", (0.0, 0.0, HEIGHT), _SHOULDER)
    mjcf.add_blocks(upper, [_bar(TWO_LENGTHS[0]), Block(SERVO_MASS, (TWO_LENGTHS[0] - 0.013, 0.03, 0.0), _FLAT_CASE)])
    mjcf.add_shapes(upper, (*_bars(TWO_LENGTHS[0]), box("servo", (TWO_LENGTHS[0] - 0.013, 0.03, 0.0), _FLAT_CASE)))
    lower = _hinged(upper, "elbow", (TWO_LENGTHS[0], -0.012, 0.0), _ELBOW)
    tip, half = (TWO_LENGTHS[1], 0.0, 0.0), min(0.5 * (payload / 7850.0) ** (1.0 / 3.0), 0.03)  # a cube of steel
    own = [_bar(TWO_LENGTHS[1]), Block(_TWO_TOOL_MASS, tip, (0.01, 0.01, 0.01))]
    shapes = [*_bars(TWO_LENGTHS[1]), {"type": "sphere", "material": "board", "pos": words(tip), "size": "0.011"}]
    if payload > 0.0:
        own.append(Block(payload, tip, (half, half, half)))
        shapes.append(box("horn", tip, (half, half, half)))
    mjcf.add_blocks(lower, own)
    mjcf.add_shapes(lower, shapes)
    Xml.SubElement(lower, "site", name=TOOL, pos=words((TWO_LENGTHS[1], 0.012, 0.0)), size="0.003",
                   rgba="0.9 0.2 0.2 1")
    return Arm(name="two-link", mjcf=mjcf.text(root),
               joints={"shoulder": Joint(middle=_SHOULDER, start=0.8), "elbow": Joint(middle=_ELBOW, start=-1.3)},
               places=(True, False, True), turns=False, centre=(0.17, 0.0, HEIGHT + 0.03), size=0.04, plane=(0, 2))


def _hinged(parent: Xml.Element, joint: str, place: Vector, middle: float) -> Xml.Element:
    body = Xml.SubElement(parent, "body", name="upper_arm" if joint == "shoulder" else "forearm", pos=words(place))
    Xml.SubElement(body, "joint", name=joint, type="hinge", axis="0 -1 0",
                   range=words((middle - _QUARTER, middle + _QUARTER)))
    return body


def _bar(length: float) -> Block:
    return Block(_TWO_PER_LENGTH * length, (0.5 * length, 0.0, 0.0), (0.5 * length, 0.003, 0.0125))


def _bars(length: float) -> tuple[Shape, ...]:
    return (box("printed", (0.5 * length, 0.0, 0.0), (0.5 * length, 0.003, 0.0125)),
            *({"type": "cylinder", "material": colour, "pos": words((x, 0.0, 0.0)), "zaxis": "0 1 0",
               "size": words((radius, half))}
              for x in (0.0, length) for colour, radius, half in (("printed", 0.018, 0.004), ("horn", 0.009, 0.005))))
