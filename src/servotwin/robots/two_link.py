"""An arm of two links in a vertical plane: the least robot on which gravity, inertia and coupling can be seen.

All numbers are `assumed`, such that an HS-755HB at each joint can hold the arm stretched out. Its tool is where the
closed form has it, which inverse kinematics is checked against:

    x = l₁ cos q₁ + l₂ cos(q₁ + q₂),    z = h + l₁ sin q₁ + l₂ sin(q₁ + q₂)
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from servotwin.robots import mjcf
from servotwin.robots.arm import TOOL, Arm, Joint
from servotwin.robots.mjcf import Block, Shape, Vector, box, words
from servotwin.robots.scara import SERVO_MASS, check_payload

LENGTHS: tuple[float, float] = (0.15, 0.12)
"""Of the links, `assumed` [m]."""
HEIGHT = 0.22
"""Of the shoulder above the ground, `assumed` [m]."""

_CASE: Vector = (0.0295, 0.025, 0.0145)  # half of the case of a servo that lies on its side, assumed [m]
_PER_LENGTH, _TOOL_MASS = 0.25, 0.03  # kg/m of the links, kg of the tool, assumed
_QUARTER = 0.5 * math.pi
_SHOULDER, _ELBOW = math.radians(30.0), math.radians(-60.0)  # where the servos are in the middle of their travel
_SIDE = ((0.25, -0.95, 0.42), (0.1, 0.0, 0.22))  # place of the camera, and what it looks at [m]


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
        mjcf.add_scene(root, assets, world, *_SIDE)
    base = Xml.SubElement(world, "body", name="base", childclass="two-link")
    mjcf.add_shapes(base, (
        box("printed", (0.0, 0.03, 0.004), (0.07, 0.08, 0.004)),
        box("printed", (-0.013, 0.04, 0.5 * (HEIGHT - 0.015)), (0.02, 0.014, 0.5 * (HEIGHT - 0.015))),
        box("servo", (-0.013, 0.04, HEIGHT), _CASE)))
    upper = _link(base, "shoulder", (0.0, 0.0, HEIGHT), _SHOULDER)
    mjcf.add_blocks(upper, [_bar(LENGTHS[0]), Block(SERVO_MASS, (LENGTHS[0] - 0.013, 0.03, 0.0), _CASE)])
    mjcf.add_shapes(upper, (*_bars(LENGTHS[0]), box("servo", (LENGTHS[0] - 0.013, 0.03, 0.0), _CASE)))
    lower = _link(upper, "elbow", (LENGTHS[0], -0.012, 0.0), _ELBOW)
    tip, half = (LENGTHS[1], 0.0, 0.0), min(0.5 * (payload / 7850.0) ** (1.0 / 3.0), 0.03)  # a cube of steel
    own = [_bar(LENGTHS[1]), Block(_TOOL_MASS, tip, (0.01, 0.01, 0.01))]
    shapes = [*_bars(LENGTHS[1]), {"type": "sphere", "material": "board", "pos": words(tip), "size": "0.011"}]
    if payload > 0.0:
        own.append(Block(payload, tip, (half, half, half)))
        shapes.append(box("horn", tip, (half, half, half)))
    mjcf.add_blocks(lower, own)
    mjcf.add_shapes(lower, shapes)
    Xml.SubElement(lower, "site", name=TOOL, pos=words((LENGTHS[1], 0.012, 0.0)), size="0.003", rgba="0.9 0.2 0.2 1")
    return Arm(name="two-link", mjcf=mjcf.text(root),
               joints={"shoulder": Joint(middle=_SHOULDER, start=0.8), "elbow": Joint(middle=_ELBOW, start=-1.3)},
               places=(True, False, True), turns=False, centre=(0.17, 0.0, HEIGHT + 0.03), size=0.04, plane=(0, 2))


def _link(parent: Xml.Element, joint: str, place: Vector, middle: float) -> Xml.Element:
    body = Xml.SubElement(parent, "body", name="upper_arm" if joint == "shoulder" else "forearm", pos=words(place))
    Xml.SubElement(body, "joint", name=joint, type="hinge", axis="0 -1 0",
                   range=words((middle - _QUARTER, middle + _QUARTER)))
    return body


def _bar(length: float) -> Block:
    return Block(_PER_LENGTH * length, (0.5 * length, 0.0, 0.0), (0.5 * length, 0.003, 0.0125))


def _bars(length: float) -> tuple[Shape, ...]:
    return (box("printed", (0.5 * length, 0.0, 0.0), (0.5 * length, 0.003, 0.0125)),
            *({"type": "cylinder", "material": colour, "pos": words((x, 0.0, 0.0)), "zaxis": "0 1 0",
               "size": words((radius, half))}
              for x in (0.0, length) for colour, radius, half in (("printed", 0.018, 0.004), ("horn", 0.009, 0.005))))
