"""Trajectories through waypoints, within limits or at stated times: trapezoid, S-curve, quintic; and given tables.

All joints move along the straight line between two waypoints, angle = from + (to − from) s(t), so that one profile s
from 0 to 1 serves them all, and the joint that has the most to do sets its limits.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from servotwin.control.profile import quintic_phases, s_curve_phases, trapezoid_phases
from servotwin.control.reference import Trajectory
from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from servotwin.control.profile import Phases

    Array = NDArray[np.float64]


def trapezoid(waypoints: ArrayLike, *, speed: ArrayLike, acceleration: ArrayLike) -> Trajectory:
    """Return the fastest motion from rest to rest, waypoint after waypoint, within speed and acceleration.

    Parameters
    ----------
    waypoints : array_like, shape (m,) or (m, n)
        Angles of one servo, or of n joints [rad].
    speed, acceleration : float or array_like, shape (n,)
        Limits, positive [rad/s], [rad/s²].

    Raises
    ------
    InputError
        If a number makes no sense.

    Notes
    -----
    Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, chapter 3.

    Examples
    --------
    >>> move = trapezoid([0.0, 1.0], speed=2.0, acceleration=8.0)
    >>> move.duration, move.at(0.375).speed
    (0.75, 2.0)
    """
    limits = (_limit("speed", speed), _limit("acceleration", acceleration))
    return _rest_to_rest(waypoints, lambda distance: trapezoid_phases(*_shares(distance, limits)))


def s_curve(waypoints: ArrayLike, *, speed: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike) -> Trajectory:
    """Return the fastest motion from rest to rest, waypoint after waypoint, within speed, acceleration and jerk.

    Parameters
    ----------
    waypoints : array_like, shape (m,) or (m, n)
        Angles of one servo, or of n joints [rad].
    speed, acceleration, jerk : float or array_like, shape (n,)
        Limits, positive [rad/s], [rad/s²], [rad/s³].

    Raises
    ------
    InputError
        If a number makes no sense.

    Notes
    -----
    Seven phases of constant jerk; Biagiotti and Melchiorri 2008, chapter 3.

    Examples
    --------
    >>> move = s_curve([0.0, 1.0], speed=2.0, acceleration=8.0, jerk=80.0)
    >>> round(move.duration, 6), round(move.at(0.1).acceleration, 6)
    (0.85, 8.0)
    """
    limits = (_limit("speed", speed), _limit("acceleration", acceleration), _limit("jerk", jerk))
    return _rest_to_rest(waypoints, lambda distance: s_curve_phases(*_shares(distance, limits)))


def quintic(waypoints: ArrayLike, *, times: ArrayLike | None = None, speed: ArrayLike = math.inf,
            acceleration: ArrayLike = math.inf, jerk: ArrayLike = math.inf) -> Trajectory:
    """Return polynomials of degree five: through waypoints at stated times, or from rest to rest within limits.

    With times it goes through the waypoints without stopping, all derivatives up to the fourth continuous, and rests
    at both ends. With limits it stops at each.

    Parameters
    ----------
    waypoints : array_like, shape (m,) or (m, n)
        Angles of one servo, or of n joints [rad].
    times : array_like, shape (m,), optional
        Increasing from 0 [s].
    speed, acceleration, jerk : float or array_like, shape (n,)
        Limits, positive; those that are not given do not count [rad/s], [rad/s²], [rad/s³].

    Raises
    ------
    InputError
        If a number makes no sense, or neither or both of times and limits are given.

    Notes
    -----
    q = q_0 + Δ (10 τ³ − 15 τ⁴ + 6 τ⁵), τ = t/T: fastest 15 Δ/8T, 10 Δ/√3 T², 60 Δ/T³; Biagiotti and Melchiorri 2008,
    chapter 2.

    Examples
    --------
    >>> move = quintic([0.0, 1.0], speed=1.875)
    >>> round(move.duration, 9), round(move.at(0.5).speed, 9)
    (1.0, 1.875)
    >>> quintic([0.0, 1.0, 0.0], times=[0.0, 1.0, 2.0]).at(1.0).angle
    1.0
    """
    limits = (_limit("speed", speed), _limit("acceleration", acceleration), _limit("jerk", jerk))
    limited = any(np.isfinite(limit).any() for limit in limits)
    if limited == (times is not None):
        raise InputError("quintic", got="times and limits" if limited else "neither times nor limits",
                         allowed="times=, or limits of speed, acceleration or jerk")
    if times is None:
        return _rest_to_rest(waypoints, lambda distance: quintic_phases(*_shares(distance, limits)))
    q = _waypoints(waypoints)
    rest = [(1, np.zeros(q.shape[1:])), (2, np.zeros(q.shape[1:]))]
    return _spline(times, q, (rest, rest))


def sampled(time: ArrayLike, angle: ArrayLike) -> Trajectory:
    """Return a spline of degree five through a table of angles, whose derivatives up to the fourth are continuous.

    Parameters
    ----------
    time : array_like, shape (m,)
        Increasing from 0, m ≥ 6 [s].
    angle : array_like, shape (m,) or (m, n)
        [rad]

    Raises
    ------
    InputError
        If the table cannot be followed.

    Examples
    --------
    >>> t = np.linspace(0.0, 2.0, 201)
    >>> round(sampled(t, np.sin(3.0 * t)).at(1.0).speed / (3.0 * math.cos(3.0)), 6)
    1.000000
    """
    q = _waypoints(angle)
    if len(q) < 6:
        raise InputError("sampled(time)", got=f"{len(q)} angles", allowed="at least 6")
    return _spline(time, q, None)


def hold(angle: ArrayLike, duration: float) -> Trajectory:
    """Return a rest at an angle [rad], or at angles (n,), for `duration` [s].

    Examples
    --------
    >>> hold(0.5, 1.0).at(0.3).angle
    0.5
    """
    return step(angle, angle, at=0.5 * _positive("hold(duration)", duration), duration=duration)


def step(before: ArrayLike, after: ArrayLike, *, at: float, duration: float) -> Trajectory:
    """Return a jump from one angle to another [rad], or from angles (n,) to others, at a time [s].

    No servo follows it; it is what a plain command asks for.

    Examples
    --------
    >>> jump = step(0.0, 1.0, at=0.1, duration=1.0)
    >>> jump.at(0.0999).angle, jump.at(0.1).angle
    (0.0, 1.0)
    """
    ends = [_waypoints(np.asarray(x)[None])[0] for x in (before, after)]
    if not 0.0 < _positive("step(at)", at) < _positive("step(duration)", duration):
        raise InputError("step(at)", got=at, allowed=f"a time between 0 and the duration of {duration:g} s")
    return Trajectory([0.0, at, duration], np.array(ends)[None])


def _rest_to_rest(waypoints: ArrayLike, phases: Callable[[Array], Phases]) -> Trajectory:
    """Return one profile after the other; `phases` is asked with the distances of all joints."""
    q = _waypoints(waypoints)
    times, rows = [0.0], []
    for start, end in pairwise(q):
        if np.all(start == end):
            continue
        profile = phases(np.abs(end - start))
        for duration, c in zip(profile.durations, profile.coefficients, strict=True):
            times.append(times[-1] + duration)
            row = np.multiply.outer(np.array(c), end - start)
            row[-1] += start
            rows.append(row)
    if not rows:
        raise InputError("waypoints", got="all the same", allowed="at least two that differ; hold() rests")
    return Trajectory(times, np.stack(rows, axis=1))


def _shares(distance: Array, limits: tuple[Array, ...]) -> list[float]:
    """Return the limits of the profile s: of the joint that has the most to do."""
    with np.errstate(divide="ignore"):
        return [float(np.min(np.where(distance > 0.0, limit / distance, np.inf))) for limit in limits]


def _spline(time: ArrayLike, q: Array, ends: Any) -> Trajectory:
    from scipy.interpolate import make_interp_spline  # slow to load

    t = np.asarray(time, dtype=np.float64)
    if t.shape != q.shape[:1] or not np.isfinite(t).all() or t[0] != 0.0 or not (np.diff(t) > 0.0).all():
        raise InputError("times", got=f"{t.shape} for {len(q)} angles" if t.shape != q.shape[:1] else t.tolist(),
                         allowed="a time for each angle, increasing from 0 [s]")
    spline = make_interp_spline(t, q, k=5, bc_type=ends)
    return Trajectory(t, np.array([spline(t[:-1], nu=order) / math.factorial(order) for order in range(5, -1, -1)]))


def _waypoints(angles: ArrayLike) -> Array:
    try:
        q = np.asarray(angles, dtype=np.float64)
    except (TypeError, ValueError):
        q = np.full((), np.nan)
    if q.ndim not in (1, 2) or not q.size or not np.isfinite(q).all():
        raise InputError("angles of a trajectory", got=angles, allowed="finite numbers [rad], of shape (m,) or (m, n)")
    return q


def _limit(name: str, limit: ArrayLike) -> Array:
    try:
        value = np.asarray(limit, dtype=np.float64)
    except (TypeError, ValueError):
        value = np.full((), np.nan)
    if not (value.ndim < 2 and (value > 0.0).all()):
        raise InputError(f"{name} of a trajectory", got=limit, allowed="a positive number, or one for each joint (SI)")
    return value


def _positive(name: str, value: float) -> float:
    if not (is_finite(value) and value > 0.0):
        raise InputError(name, got=value, allowed="a positive number of seconds")
    return float(value)
