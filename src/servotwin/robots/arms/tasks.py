"""Tasks of an arm's tool: paths of the tool over time, which begin and end at rest.

Along each stretch of a path the tool gets up to speed and comes to rest by smooth steps, so that its acceleration never
jumps:

    v(t) = v (3x² − 2x³),    s(t) = v t_r (x³ − x⁴/2),    x = t/t_r
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.robots.arms.arm import TOOL, Arm
from servotwin.robots.model_file import joint_names, joint_ranges
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.units import is_finite

# --- Tasks of an arm's tool: paths of the tool over time, which begin and end at rest ---------------------------------

Place = tuple[float, float, float]
SPEED = 0.08
"""Of the tool along its path, unless another is given [m/s]."""

_RAMP = 0.4  # s, over which it gets up to speed
_PAUSE = 0.3  # s, of a tool that takes or leaves something
_STEP = 0.01  # s, between samples
_POINTS = 4000  # of the line that a closed path is
_LIFT = 0.035  # m, by which a thing is lifted
_TURN = math.radians(30.0)  # by which it is turned on its way
_UPRIGHT = 0.5  # of the speed: up and down


@dataclass(frozen=True, kw_only=True, eq=False)
class ToolPath:
    """Where the tool is to be over time.

    Parameters
    ----------
    name : str
    time : ndarray, shape (n,)
        From 0 on, evenly spaced [s]
    places : ndarray, shape (n, 3)
        [m]
    turns : ndarray, shape (n,)
        Of the tool about the vertical [rad]
    line : ndarray, shape (m, 3)
        The path itself as a line from point to point, whatever the time [m]
    """

    name: str
    time: Array
    places: Array
    turns: Array
    line: Array

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])


class Stretch(NamedTuple):
    """A part of a path from rest to rest.

    Parameters
    ----------
    at : callable
        Returns the places, shape (n, 3), at shares of the way, shape (n,).
    length : float
        [m]; 0 where the tool waits.
    turn : float
        Of the tool at its end [rad]
    points : int
        By which its line is drawn.
    wait : float
        How long it takes at least [s]
    pace : float
        Its speed, as a share of that of the path.
    """

    at: Callable[[Array], Array]
    length: float
    turn: float = 0.0
    points: int = 2
    wait: float = 0.0
    pace: float = 1.0


def circle(centre: Place, radius: float, *, speed: float = SPEED, plane: tuple[int, int] = (0, 1)) -> ToolPath:
    """Return a circle of the tool, once round.

    Parameters
    ----------
    centre : tuple of float
        [m]
    radius : float
        [m]
    speed : float
        [m/s]
    plane : tuple of int
        The two coordinates in which it lies.

    Raises
    ------
    InputError
        If radius or speed is not positive.

    Examples
    --------
    >>> path = circle((0.2, 0.0, 0.1), 0.05)
    >>> np.hypot(path.places[:, 0] - 0.2, path.places[:, 1]).round(9).tolist()[:2], round(path.duration, 2)
    ([0.05, 0.05], 4.33)
    """
    _check(radius=radius, speed=speed)

    def at(share: Array) -> Array:
        found = np.tile(np.array(centre), (len(share), 1))
        found[:, plane[0]] += radius * np.cos(2.0 * np.pi * share)
        found[:, plane[1]] += radius * np.sin(2.0 * np.pi * share)
        return found

    return _path(f"circle of {2e3 * radius:g} mm", [Stretch(at, 2.0 * math.pi * radius, points=_POINTS)], speed)


def square(centre: Place, half: float, *, speed: float = SPEED, plane: tuple[int, int] = (0, 1)) -> ToolPath:
    """Return a square of the tool, along whose sides it goes from rest to rest.

    Parameters
    ----------
    centre : tuple of float
        [m]
    half : float
        Of its side [m]
    speed : float
        [m/s]
    plane : tuple of int
        The two coordinates in which it lies.

    Raises
    ------
    InputError
        If half the side or the speed is not positive.

    Examples
    --------
    >>> path = square((0.2, 0.0, 0.1), 0.04, speed=0.1)
    >>> path.places[0].round(3).tolist(), round(path.duration, 2)
    ([0.24, 0.04, 0.1], 4.8)
    """
    _check(half=half, speed=speed)
    corners = []
    for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)):
        corner = list(centre)
        corner[plane[0]] += a * half
        corner[plane[1]] += b * half
        corners.append(corner)
    return _path(f"square of {2e3 * half:g} mm",
                 [_straight(a, b) for a, b in pairwise(corners)], speed)


def pick_and_place(first: Place, second: Place, *, lift: float = _LIFT, turn: float = _TURN,
                   speed: float = SPEED) -> ToolPath:
    """Return a tool that goes down to a place, waits, lifts, goes over to another, goes down, waits and lifts again.

    Up and down it is half as fast: the servo of a rack turns through half its travel then.

    The payload is no part of the path: an arm has its payload all the time.

    Parameters
    ----------
    first, second : tuple of float
        Where a thing is taken and left; the tool begins above the first [m]
    lift : float
        [m]
    turn : float
        Of the tool on its way over, about the vertical [rad]
    speed : float
        [m/s]

    Raises
    ------
    InputError
        If a number is not possible.
    """
    _check(lift=lift, speed=speed)
    up = np.array([0.0, 0.0, lift])
    a, b = np.array(first), np.array(second)
    return _path("pick and place", [
        _straight(a + up, a, pace=_UPRIGHT), _waiting(a, 0.0), _straight(a, a + up, pace=_UPRIGHT),
        _straight(a + up, b + up, turn), _straight(b + up, b, turn, _UPRIGHT), _waiting(b, turn),
        _straight(b, b + up, turn, _UPRIGHT)], speed)


def _pick_and_place(arm: Arm, size: float, speed: float) -> ToolPath:
    across = 1 if arm.places[1] else 0
    low = np.array(arm.centre) - [0.0, 0.0, 0.5 * _LIFT]
    ends = []
    for sign in (-1.0, 1.0):
        end = low.copy()
        end[across] += sign * size
        ends.append((float(end[0]), float(end[1]), float(end[2])))
    return pick_and_place(ends[0], ends[1], turn=_TURN if arm.turns else 0.0, speed=speed)


TASKS: Mapping[str, Callable[[Arm, float, float], ToolPath]] = MappingProxyType({
    "circle": lambda arm, size, speed: circle(arm.centre, size, speed=speed, plane=arm.plane),
    "square": lambda arm, size, speed: square(arm.centre, size, speed=speed, plane=arm.plane),
    "pick-and-place": _pick_and_place,
})
"""Tasks by name: functions of an arm, a size [m] and a speed [m/s]."""


def task_path(arm: Arm, task: str, *, size: float | None = None, speed: float = SPEED) -> ToolPath:
    """Return what a tool does in a task, where its arm reaches well.

    Parameters
    ----------
    arm : Arm
    task : str
        circle, square or pick-and-place.
    size : float, optional
        Radius, half of the side, half of the way over; that of the arm unless given [m]
    speed : float
        Of the tool [m/s]

    Raises
    ------
    UnknownNameError
        If there is no such task.
    InputError
        If size or speed is not positive.
    """
    if task not in TASKS:
        raise UnknownNameError("task", task, TASKS)
    size = arm.size if size is None else size
    _check(size=size, speed=speed)
    return TASKS[task](arm, size, speed)


def _check(**numbers: float) -> None:
    for name, value in numbers.items():
        if not (is_finite(value) and value > 0.0):
            raise InputError(f"{name} of a tool's path", got=value, allowed="a positive number, in m and m/s")


def _straight(start: Sequence[float] | Array, end: Sequence[float] | Array, turn: float = 0.0,
              pace: float = 1.0) -> Stretch:
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    return Stretch(lambda share: a + share[:, None] * (b - a), float(np.linalg.norm(b - a)), turn, pace=pace)


def _waiting(place: Array, turn: float) -> Stretch:
    return Stretch(lambda share: np.tile(place, (len(share), 1)), 0.0, turn, wait=_PAUSE)


def _path(name: str, stretches: Sequence[Stretch], speed: float) -> ToolPath:
    """Return stretches one after the other, at the speed in the middle of each that is long enough."""
    cruises = [stretch.length / (speed * stretch.pace) for stretch in stretches]
    times = [max(cruise + min(_RAMP, cruise), stretch.wait) for cruise, stretch in zip(cruises, stretches, strict=True)]
    starts = np.concatenate([[0.0], np.cumsum(times)])
    count = math.ceil(starts[-1] / _STEP - 1e-9) + 1
    time = np.linspace(0.0, starts[-1], count)
    which = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(stretches) - 1)
    places, turns, before = np.empty((count, 3)), np.empty(count), 0.0
    for k, stretch in enumerate(stretches):
        own = which == k
        share = _glide(time[own] - starts[k], times[k])
        places[own] = stretch.at(share)
        turns[own] = before + share * (stretch.turn - before)
        before = stretch.turn
    line = np.concatenate([stretch.at(np.linspace(0.0, 1.0, stretch.points)) for stretch in stretches])
    return ToolPath(name=name, time=time, places=places, turns=turns, line=line)


def _glide(time: Array, duration: float) -> Array:
    """Return the share of the way at times since the beginning [s]."""
    ramp = min(_RAMP, 0.5 * duration)

    def begun(t: Array) -> Array:
        x = np.clip(t / ramp, 0.0, 1.0)
        return np.asarray(ramp * (x**3 - 0.5 * x**4) + np.maximum(t - ramp, 0.0))

    whole = duration - ramp
    first = time <= 0.5 * duration
    return np.where(first, begun(time), whole - begun(duration - time)) / whole


# --- Inverse kinematics: from the path of a tool to those of the joints, with mink on MuJoCo --------------------------

# mink solves a quadratic programme for a small step of the joints within their limits; here it is asked again until the
# tool is where it has to be, to 1e-10 m. Between these times joints follow cubic splines.

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
    >>> from servotwin.robots.arms.tasks import circle
    >>> from servotwin.robots.arms.arm import two_link
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

    def _least_distance(self, path: ToolPath, k: int) -> float:
        """Return how near the tool gets to a place without limits, however it is turned [m]."""
        mink, configuration, found = self._mink, self._configuration, math.inf
        task = mink.FrameTask(TOOL, "site", position_cost=self._tool.cost[:3], orientation_cost=0.0)
        for _ in range(_NEAREST):
            turn = configuration.get_transform_frame_to_world(TOOL, "site").rotation()
            task.set_target(mink.SE3.from_rotation_and_translation(turn, path.places[k]))
            step = mink.solve_ik(configuration, [task], 1.0, _SOLVER, damping=_STIFF, limits=[])
            configuration.integrate_inplace(step, 1.0)
            tool = self._configuration.get_transform_frame_to_world(TOOL, "site").translation()
            off = np.asarray((path.places[k] - tool)[list(self._arm.places)])
            found = min(found, float(np.linalg.norm(off)))
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


# --- The spare joint of a redundant arm: criteria, each an object -----------------------------------------------------

# An arm of three links has for each place and turn of its tool a line of postures to choose from. A criterion says
# which of them is best:
#
# - `LeastMotion`: joints move as little as they can from where they are, in the sense of least squares.
# - `AwayFromLimits`: at each instant the least Σ u⁶, where u is an angle from the middle of its range in halves of it.
#   That is Liégeois's criterion (IEEE Trans. Systems, Man, and Cybernetics 7(12), 1977), with the sixth power instead
#   of the square: the joint that is nearest to its limit counts most.
# - `LeastTorque`: the least mean square of the torques of all hinges over the whole path; looked for among postures at
#   the beginning that differ by the third link, with joints that then move as little as they can. To choose at each
#   instant by itself is known to run away (Hollerbach and Suh, IEEE J. Robotics and Automation 3(4), 1987).

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
        Its angle at the beginning is tried.
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
