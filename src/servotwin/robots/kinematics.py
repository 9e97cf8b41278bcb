"""Inverse kinematics: from the path of a tool to those of the joints, with mink on MuJoCo.

mink solves a quadratic programme for a small step of the joints within their limits; here it is asked again until the
tool is where it has to be, to 1e-10 m. Between these times joints go on cubic splines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from servotwin.errors import InputError, MissingExtraError
from servotwin.robots.arm import TOOL, Arm
from servotwin.robots.model_file import joint_names, joint_ranges
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.robots.tasks import ToolPath

Array = NDArray[np.float64]
_WELL = 1e-10  # m and rad: what the tool may be off by
_FIRST, _EACH = 200, 30  # steps to the first place, and to each further one
_NEAREST, _STIFF = 200, 1e-2  # steps to the nearest place, of one that is out of reach, and their damping
_PULLS = 3  # of them with the posture
_PULL = 1e-3  # weight of the posture beside the tool
_LEAST = 0.1  # of u, by which a power of it is weighed
_DAMPING, _MARQUARDT = 1e-9, 0.1
_SOLVER = "daqp"
_SAMPLE = 0.002  # s, of a motion


class Posture(NamedTuple):
    """Where joints would be if the tool did not mind: the least sum of powers of u = (q − target) · weight.

    Parameters
    ----------
    target : ndarray, shape (joints,)
        [rad or m]
    weight : ndarray, shape (joints,)
        [1/rad or 1/m]
    power : float
        Of the magnitude of u; the larger, the more the joint that is furthest off counts.
    """

    target: Array
    weight: Array
    power: float = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class JointPath:
    """How the joints of an arm move for its tool to follow a path.

    Parameters
    ----------
    arm : Arm
    path : ToolPath
    angles : ndarray, shape (n, joints)
        At the times of the path [rad or m]
    """

    arm: Arm
    path: ToolPath
    angles: Array

    @cached_property
    def spline(self) -> CubicSpline[np.float64]:
        """Of the angles over time, at rest at both ends."""
        return CubicSpline(self.path.time, self.angles, bc_type="clamped")

    def motion(self, step: float = _SAMPLE) -> Motion:
        """Return the motion of the joints, sampled every `step` [s]."""
        count = max(math.ceil(self.path.duration / step - 1e-9), 1) + 1
        time = np.linspace(0.0, self.path.duration, count)
        columns = self.spline(time).T
        return Motion(time=time, angles=dict(zip(self.arm.joints, columns, strict=True)), source=self.path.name)

    @property
    def limit_distance(self) -> float:
        """Distance of the hinges to their limits where it is least: 1 in the middle of a range, 0 at its end."""
        model = self.arm.model()
        lower, upper = limits_of(model, self.arm)
        hinges = [kind == "angle" for kind in joint_names(model).values()]
        return float((1.0 - np.abs(self.angles - 0.5 * (lower + upper)) / (0.5 * (upper - lower)))[:, hinges].min())

    def torque(self, model: Any | None = None) -> Array:
        """Return what the motion takes of the joints, shape (n, joints) [N m or N]; rigid bodies alone.

        Parameters
        ----------
        model : MjModel, optional
            Such as that of a `ServoDrive`, whose joints carry rotors and gears.
        """
        mujoco = load_mujoco()
        model = self.arm.model() if model is None else model
        data = mujoco.MjData(model)
        time, found = self.path.time, np.empty(self.angles.shape)
        for k, values in enumerate(zip(self.spline(time), self.spline(time, 1), self.spline(time, 2), strict=True)):
            data.qpos[:], data.qvel[:], data.qacc[:] = values
            mujoco.mj_inverse(model, data)
            found[k] = data.qfrc_inverse
        return found


def limits_of(model: Any, arm: Arm) -> tuple[Array, Array]:
    """Return lower and upper limits of all joints [rad or m]."""
    ranges = joint_ranges(model)
    return np.array([ranges[name][0] for name in arm.joints]), np.array([ranges[name][1] for name in arm.joints])


def load_mink() -> Any:
    """Return the package.

    Raises
    ------
    MissingExtraError
        If it is not installed, or what it solves its programmes with is not.
    """
    load_mujoco()
    try:
        import daqp  # noqa: F401 - mink needs it, and says so too late
        import mink
    except ImportError as error:
        raise MissingExtraError("daqp" if error.name == "daqp" else "mink", "robots") from None
    return mink


def follow(arm: Arm, path: ToolPath, *, start: Array | None = None, posture: Posture | None = None,
           every: int = 1) -> JointPath:
    """Return how the joints move for the tool to follow a path, within their limits.

    Where there are more joints than coordinates of the tool they move as little as they can, or towards a posture.

    Parameters
    ----------
    arm : Arm
    path : ToolPath
    start : ndarray, shape (joints,), optional
        From where the first place is looked for; the arm's own unless given [rad or m]
    posture : Posture, optional
    every : int
        Which of the samples of the path are solved for; those between lie on splines.

    Raises
    ------
    InputError
        If the tool cannot get to a place: how far it is out of reach, or which joint its limit stops, and when.
    MissingExtraError
        If mink is not installed.

    Examples
    --------
    >>> from servotwin.robots.tasks import circle
    >>> from servotwin.robots.two_link import two_link
    >>> arm = two_link()
    >>> found = follow(arm, circle(arm.centre, 0.03, plane=(0, 2)))
    >>> found.angles[0].round(3).tolist()
    [0.78, -1.459]
    """
    solver = _Solver(arm, posture)
    solver.begin(arm.start if start is None else start)
    chosen = np.unique([*range(0, len(path.time), every), len(path.time) - 1])
    angles = np.array([solver.reach(path, int(k), _FIRST if k == 0 else _EACH) for k in chosen])
    if len(chosen) < len(path.time):
        angles = CubicSpline(path.time[chosen], angles, bc_type="clamped")(path.time)
    return JointPath(arm=arm, path=path, angles=angles)


class _Solver:
    """Asks mink for steps until the tool is in its place."""

    def __init__(self, arm: Arm, posture: Posture | None) -> None:
        self._mink, self._arm, self._model = load_mink(), arm, arm.model()
        self._configuration = self._mink.Configuration(self._model)
        self._tool = self._mink.FrameTask(
            TOOL, "site", position_cost=[float(can) for can in arm.places],
            orientation_cost=[0.0, 0.0, float(arm.turns)], lm_damping=_MARQUARDT)
        self._posture = posture
        self._limits = [self._mink.ConfigurationLimit(self._model, gain=1.0)]

    def begin(self, angles: Array) -> None:
        """Put the arm into a posture."""
        self._configuration.update(np.array(angles, dtype=np.float64))

    def reach(self, path: ToolPath, k: int, most: int) -> Array:
        """Return the angles of the joints with which the tool is at a sample of its path."""
        before = np.array(self._configuration.q)
        if self._go(path, k, most, self._limits):
            return np.array(self._configuration.q)
        self.begin(before)
        if self._go(path, k, most, []):
            raise self._stopped(path, k)
        distance = self._least_distance(path, k)
        reach = np.linalg.norm(path.places[k])
        raise InputError(
            f"{path.name} at {path.time[k]:.2f} s", allowed=f"places that {self._arm.name} reaches",
            got=f"a place {1e3 * distance:.3g} mm out of its reach, {1e3 * reach:.0f} mm from the middle of its foot")

    def _off(self, path: ToolPath, k: int) -> Array:
        """Return by how much the tool is off, of the coordinates that it can place [m]."""
        tool = self._configuration.get_transform_frame_to_world(TOOL, "site").translation()
        return np.asarray((path.places[k] - tool)[list(self._arm.places)])

    def _least_distance(self, path: ToolPath, k: int) -> float:
        """Return how near the tool gets to a place without limits, however it is turned [m]."""
        mink, configuration, found = self._mink, self._configuration, math.inf
        task = mink.FrameTask(TOOL, "site", position_cost=self._tool.cost[:3], orientation_cost=0.0)
        for _ in range(_NEAREST):
            turn = configuration.get_transform_frame_to_world(TOOL, "site").rotation()
            task.set_target(mink.SE3.from_rotation_and_translation(turn, path.places[k]))
            step = mink.solve_ik(configuration, [task], 1.0, _SOLVER, damping=_STIFF, limits=[])
            configuration.integrate_inplace(step, 1.0)
            found = min(found, float(np.linalg.norm(self._off(path, k))))
        return found

    def _go(self, path: ToolPath, k: int, most: int, limits: list[Any]) -> bool:
        """Take steps; return whether the tool has got there."""
        mink, configuration = self._mink, self._configuration
        turn = mink.SO3.from_z_radians(float(path.turns[k]))
        pulls = 0 if self._posture is None else (_PULLS if k else most // 2)
        for n in range(most + pulls):
            if not self._arm.turns:  # its turn is as it comes: the way of the tool is that of its place then
                turn = configuration.get_transform_frame_to_world(TOOL, "site").rotation()
            self._tool.set_target(mink.SE3.from_rotation_and_translation(turn, path.places[k]))
            tasks = [self._tool, *self._pulled(n < pulls)]
            step = mink.solve_ik(configuration, tasks, 1.0, _SOLVER, damping=_DAMPING, limits=limits)
            configuration.integrate_inplace(step, 1.0)
            if n >= pulls and np.abs(self._weighed()).max() < _WELL:
                return True
        return False

    def _pulled(self, wanted: bool) -> list[Any]:
        """Return the task of the posture: squares, weighed so that a step is one of Newton's for the power."""
        if self._posture is None or not wanted:
            return []
        target, weight, power = self._posture
        u = np.maximum(np.abs(weight * (np.array(self._configuration.q) - target)), _LEAST)
        task = self._mink.PostureTask(self._model, cost=_PULL * weight * u**(0.5 * power - 1.0),
                                      gain=1.0 / (power - 1.0))
        task.set_target(target)
        return [task]

    def _weighed(self) -> Array:
        return np.asarray(self._tool.cost * self._tool.compute_error(self._configuration))

    def _stopped(self, path: ToolPath, k: int) -> InputError:
        """Say which joint would have to go beyond its limit."""
        lower, upper = limits_of(self._model, self._arm)
        wanted = np.array(self._configuration.q)
        beyond = np.maximum(lower - wanted, wanted - upper) / (upper - lower)
        at = int(np.argmax(beyond))
        name = list(self._arm.joints)[at]
        factor, unit = (1e3, "mm") if joint_names(self._model)[name] == "length" else (math.degrees(1.0), "deg")
        return InputError(f"{path.name} at {path.time[k]:.2f} s: joint {name}", got=f"{factor * wanted[at]:.4g} {unit}",
                          allowed=f"{factor * lower[at]:.4g} to {factor * upper[at]:.4g} {unit}, its limits")
