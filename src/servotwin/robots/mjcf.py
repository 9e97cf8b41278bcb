"""Words of MJCF that robots made from code share: shapes, masses, a scene."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

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
