"""Arms made from code: their MJCF, where their servos sit, and what of the tool they can place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models import Model, mid_travel
from servotwin.robots.model_file import robot_model
from servotwin.robots.mount import Mount
from servotwin.robots.places import load_mujoco

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
