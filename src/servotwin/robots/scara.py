"""The paper's SCARA robots, with and without link redundancy (section VII, Fig. 28 and 29), as MuJoCo models.

The paper shows photographs and gives no dimension: all numbers here are `assumed`, such that a servo of its kind, an
HS-755HB at each joint, can move the arm. Its case and mass are those of the maker's list, which the catalog names.

Two or three links turn about vertical axes, so that gravity is nothing to their servos; a rack carries the wrist up and
down, and the wrist turns the tool about the vertical. Three links have one joint more than the four coordinates of the
tool need: place and turn.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from servotwin.errors import InputError
from servotwin.robots import mjcf
from servotwin.robots.arm import TOOL, Arm, Joint
from servotwin.robots.mjcf import Block, Shape, Vector, beam, box, disc, words
from servotwin.units import is_finite

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
