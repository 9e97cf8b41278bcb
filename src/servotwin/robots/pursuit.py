"""Pure pursuit: a robot steers along the arc that leads to a point of its path some way ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError
from servotwin.robots.wheels import Pose
from servotwin.units import is_finite

Array = NDArray[np.float64]
_SAME = 1e-12


class PursuitState(NamedTuple):
    """What a pursuit remembers: how far along its path it has come [m], and whether it has arrived."""

    along: float = 0.0
    arrived: bool = False


class PursuitDecision(NamedTuple):
    """What a pursuit asks of the robot.

    Parameters
    ----------
    speed, turn_rate : float
        [m/s], [rad/s]
    goal : tuple of float
        The point that it steers to [m].
    state : PursuitState
    """

    speed: float
    turn_rate: float
    goal: tuple[float, float]
    state: PursuitState


@dataclass(frozen=True, kw_only=True, eq=False)
class PurePursuit:
    """The controller of Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm", CMU-RI-TR-92-01 (1992).

    The goal is the point of the path that lies a look-ahead distance L away; with y its place to the left of the robot,
    the arc that leads there has the curvature 2 y/L². Beside that the robot, which can turn on the spot, does so while
    its goal is behind it, and goes no faster than both of its wheels can.

    It is a plain function of the pose that the robot believes in, with the state that it hands back.

    Parameters
    ----------
    waypoints : array_like, shape (n, 2)
        Corners of the path, of which the first is where it begins [m].
    lookahead : float
        L [m]
    speed : float
        On a straight line [m/s]
    tolerance : float
        It has arrived where the end of the path is no further away than this [m].
    track : float
        Between its wheels [m]
    most : float
        Speed of a wheel over ground that is not exceeded; that of the straight line unless given [m/s].

    Raises
    ------
    InputError
        If a number is not positive, or the waypoints are no path.

    Examples
    --------
    >>> along = PurePursuit(waypoints=[(0.0, 0.0), (1.0, 0.0)], lookahead=0.1, speed=0.1, tolerance=0.01, track=0.16)
    >>> decision = along.step(PursuitState(), Pose(0.2, -0.06, 0.0))
    >>> round(decision.turn_rate / decision.speed, 9)  # 2 · 0.06/0.1²
    12.0
    """

    waypoints: ArrayLike
    lookahead: float
    speed: float
    tolerance: float
    track: float
    most: float | None = None

    def __post_init__(self) -> None:
        """Check."""
        for name in ("lookahead", "speed", "tolerance", "track", "most"):
            value = getattr(self, name)
            if not (value is None and name == "most") and not (is_finite(value) and value > 0.0):
                raise InputError(f"{name} of a pursuit", got=value, allowed="a positive number (SI)")
        try:
            points = np.array(self.waypoints, np.float64)
        except (TypeError, ValueError):
            raise InputError("waypoints", got=self.waypoints, allowed="pairs of numbers [m]") from None
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2 or not np.isfinite(points).all():
            raise InputError("waypoints", got=f"an array of shape {points.shape}",
                             allowed="at least two pairs of finite numbers [m]")
        if np.any(np.hypot(*np.diff(points, axis=0).T) < _SAME):
            raise InputError("waypoints", got="the same point twice on end", allowed="points that differ")
        object.__setattr__(self, "waypoints", points)

    @cached_property
    def _corners(self) -> Array:
        return np.asarray(self.waypoints)

    @cached_property
    def _lengths(self) -> Array:
        """How far along the path each corner is [m]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self._corners, axis=0).T))])

    @property
    def length(self) -> float:
        """Of the path [m]."""
        return float(self._lengths[-1])

    def at(self, along: float) -> tuple[float, float]:
        """Return the point so far along the path [m]."""
        return (float(np.interp(along, self._lengths, self._corners[:, 0])),
                float(np.interp(along, self._lengths, self._corners[:, 1])))

    def apart(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return how far points are from the path [m]."""
        p = np.stack(np.broadcast_arrays(x, y), axis=-1)[..., np.newaxis, :].astype(np.float64)
        a, d = self._corners[:-1], np.diff(self._corners, axis=0)
        share = np.clip(np.sum((p - a) * d, axis=-1) / np.sum(d * d, axis=-1), 0.0, 1.0)
        return np.asarray(np.hypot(*np.moveaxis(p - a - share[..., np.newaxis] * d, -1, 0)).min(axis=-1))

    def step(self, state: PursuitState, pose: Pose) -> PursuitDecision:
        """Decide from where the robot believes to be.

        Returns
        -------
        PursuitDecision
            With the state for the next time; no speed once it has arrived.
        """
        near = self._nearest(state.along, pose)
        end = self.at(self.length)
        left = math.hypot(end[0] - pose.x, end[1] - pose.y)
        # a path that closes passes its end at the beginning too: only who has most of it behind has arrived
        arrived = state.arrived or (left <= self.tolerance and self.length - near <= self.lookahead)
        if arrived:
            return PursuitDecision(0.0, 0.0, end, PursuitState(near, True))
        goal = self.at(self._ahead(near, pose))
        dx, dy = goal[0] - pose.x, goal[1] - pose.y
        ahead = math.cos(pose.heading) * dx + math.sin(pose.heading) * dy
        aside = math.cos(pose.heading) * dy - math.sin(pose.heading) * dx
        most = self.speed if self.most is None else self.most
        if ahead <= 0.0:
            return PursuitDecision(0.0, math.copysign(2.0 * self.speed / self.track, aside), goal,
                                   PursuitState(near, False))
        curvature = 2.0 * aside / max(dx * dx + dy * dy, _SAME)
        speed = min(self.speed, most / (1.0 + 0.5 * self.track * abs(curvature)))
        return PursuitDecision(speed, speed * curvature, goal, PursuitState(near, False))

    def _nearest(self, along: float, pose: Pose) -> float:
        """Return how far along the path its nearest point is, from `along` on and no further than the look-ahead."""
        low, high = along, min(along + self.lookahead, self.length)
        best, least = along, math.inf
        for k in range(len(self._lengths) - 1):
            a, b = max(low, self._lengths[k]), min(high, self._lengths[k + 1])
            if a > b:
                continue
            corner, way = self._corners[k], (self._corners[k + 1] - self._corners[k])
            way = way / math.hypot(*way)
            s = self._lengths[k] + (pose.x - corner[0]) * way[0] + (pose.y - corner[1]) * way[1]
            s = float(min(max(s, a), b))
            x, y = self.at(s)
            apart = math.hypot(x - pose.x, y - pose.y)
            if apart < least - _SAME:
                best, least = s, apart
        return best

    def _ahead(self, near: float, pose: Pose) -> float:
        """Return how far along the first point beyond `near` is that lies the look-ahead away; the end if none does."""
        for k in range(len(self._lengths) - 1):
            if self._lengths[k + 1] <= near:
                continue
            corner, way = self._corners[k], self._corners[k + 1] - self._corners[k]
            long = math.hypot(*way)
            ux, uy = way / long
            px, py = corner[0] - pose.x, corner[1] - pose.y
            middle, rest = -(px * ux + py * uy), self.lookahead**2 - (px * uy - py * ux) ** 2
            if rest < 0.0:  # the whole straight is further away: to its nearest point
                s = float(min(max(self._lengths[k] + middle, near, self._lengths[k]), self._lengths[k + 1]))
                return s
            s = self._lengths[k] + middle + math.sqrt(rest)
            if s <= self._lengths[k + 1]:
                return float(max(s, near))
        return self.length
