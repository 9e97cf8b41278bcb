"""What the tool of an arm is to do: paths of the tool over time, which begin and end at rest.

Along each stretch of a path the tool gets up to speed and comes to rest by smooth steps, so that its acceleration never
jumps:

    v(t) = v (3x² − 2x³),    s(t) = v t_r (x³ − x⁴/2),    x = t/t_r
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.robots.arm import Arm
from servotwin.units import is_finite

Array = NDArray[np.float64]
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

    What it carries is no part of the path: an arm has its payload all the time.

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
