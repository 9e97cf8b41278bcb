"""What a redundant arm does with the joint that its tool does not need: criteria, each an object.

An arm of three links has for each place and turn of its tool a line of postures to choose from. A criterion says which
of them is best:

- `LeastMotion`: joints move as little as they can from where they are, in the sense of least squares.
- `AwayFromLimits`: at each instant the least Σ u⁶, where u is an angle from the middle of its range in halves of it.
  That is Liégeois's criterion (IEEE Trans. Systems, Man, and Cybernetics 7(12), 1977), with the sixth power instead of
  the square: the joint that is nearest to its limit counts most.
- `LeastTorque`: the least mean square of the torques of all hinges over the whole path; looked for among postures at
  the beginning that differ by the third link, with joints that then move as little as they can. To choose at each
  instant by itself is known to run away (Hollerbach and Suh, IEEE J. Robotics and Automation 3(4), 1987).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.robots.arm import Arm
from servotwin.robots.kinematics import JointPath, Posture, follow, limits_of
from servotwin.robots.tasks import ToolPath

Array = NDArray[np.float64]
_TRIES = 11
_POWER = 6.0
_CLEAR = 0.02  # of half a range: how far a posture that is tried has to stay from the limits
_SPARSE = 50  # samples of a path by which postures are compared
_TRY_POSTURE = 30.0  # times the weight of a posture that is only pulled at


class Criterion(Protocol):
    """Chooses among the ways in which joints can move for one path of the tool."""

    @property
    def name(self) -> str:
        """As one line of a table calls it."""
        ...

    def solve(self, arm: Arm, path: ToolPath, model: Any | None = None) -> JointPath:
        """Return how the joints move; `model` is that of which torques count."""
        ...

    def measure(self, found: JointPath, model: Any | None = None) -> float:
        """Return what the criterion makes small."""
        ...


@dataclass(frozen=True)
class LeastMotion:
    """Joints move as little as they can: no criterion at all.

    Examples
    --------
    >>> LeastMotion().name
    'none'
    """

    name: str = "none"

    def solve(self, arm: Arm, path: ToolPath, model: Any | None = None) -> JointPath:
        """Return how the joints move."""
        return follow(arm, path)

    def measure(self, found: JointPath, model: Any | None = None) -> float:
        """Return the length of the way of the joints [rad and m]."""
        return float(np.linalg.norm(np.diff(found.angles, axis=0), axis=1).sum())


@dataclass(frozen=True)
class AwayFromLimits:
    """Joints stay as near to the middle of their ranges as they can."""

    name: str = "limits"

    def solve(self, arm: Arm, path: ToolPath, model: Any | None = None) -> JointPath:
        """Return how the joints move."""
        check_redundant(arm, self.name)
        lower, upper = limits_of(arm.model(), arm)
        return follow(arm, path, posture=Posture(0.5 * (lower + upper), 2.0 / (upper - lower), _POWER))

    def measure(self, found: JointPath, model: Any | None = None) -> float:
        """Return the mean over the path of Σ u⁶ [1]."""
        lower, upper = limits_of(found.arm.model(), found.arm)
        u = (found.angles - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
        return float(np.mean(np.sum(np.abs(u)**_POWER, axis=1)))


@dataclass(frozen=True)
class LeastTorque:
    """The posture with which the path takes the least torque.

    Parameters
    ----------
    joint : str
        Whose angle at the beginning is tried.
    """

    joint: str = "third"
    name: str = "torque"

    def solve(self, arm: Arm, path: ToolPath, model: Any | None = None) -> JointPath:
        """Return how the joints move."""
        check_redundant(arm, self.name)
        every, best = max(len(path.time) // _SPARSE, 1), follow(arm, path)
        tried = [(self.measure(best, model), arm.start)]
        for start in _starts(arm, path, self.joint):
            try:
                found = follow(arm, path, start=start, every=every)
            except InputError:  # from there it runs into a limit
                continue
            if found.limit_distance > _CLEAR:
                tried.append((self.measure(found, model), start))
        return follow(arm, path, start=min(tried, key=lambda one: one[0])[1])

    def measure(self, found: JointPath, model: Any | None = None) -> float:
        """Return the root of the mean over the path of Σ τ² of the hinges [N m]."""
        hinges = [k for k, joint in enumerate(found.arm.joints) if joint != "lift"]
        return float(np.sqrt(np.mean(np.sum(found.torque(model)[:, hinges]**2, axis=1))))


CRITERIA: tuple[Criterion, ...] = (LeastMotion(), AwayFromLimits(), LeastTorque())
"""All criteria."""


def check_redundant(arm: Arm, criterion: str) -> None:
    """Raise InputError where there is nothing to choose."""
    if not arm.redundant:
        raise InputError(f"redundancy of {arm.name}", got=criterion,
                         allowed="none: it has no more joints than its tool has coordinates")


def _starts(arm: Arm, path: ToolPath, joint: str) -> list[Array]:
    """Return postures at the beginning of a path that differ by the angle of a joint."""
    at = list(arm.joints).index(joint)
    lower, upper = limits_of(arm.model(), arm)
    weight, target, found = np.zeros(len(arm.joints)), arm.start, []
    weight[at] = _TRY_POSTURE
    first = ToolPath(name=path.name, time=path.time[:1], places=path.places[:1], turns=path.turns[:1], line=path.line)
    for angle in np.linspace(lower[at], upper[at], _TRIES).tolist():
        target = target.copy()
        target[at] = angle
        try:
            found.append(follow(arm, first, posture=Posture(target, weight)).angles[0])
        except InputError:
            continue
    return found
