"""References of a shaft over time: angle, speed, acceleration and jerk, as piecewise polynomials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from servotwin.errors import InputError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray
    Array = NDArray[np.float64]


# --- How far along a straight way from 0 to 1 one is, within limits: phases of polynomials ----------------------------

# Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, chapters 2 and 3.

class Phases(NamedTuple):
    """Durations [s], and of each phase the coefficients in the time since its start, the highest power first."""

    durations: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]


def trapezoid_phases(speed: float, acceleration: float) -> Phases:
    """Return constant acceleration, constant speed, constant braking; without the middle where the way is too short.

    Examples
    --------
    >>> trapezoid_phases(2.0, 8.0).durations, trapezoid_phases(9.0, 4.0).durations
    ((0.25, 0.25, 0.25), (0.5, 0.5))
    """
    v = min(speed, math.sqrt(acceleration))
    return _by_jerk([(v / acceleration, acceleration), (1.0 / v - v / acceleration, 0.0),
                     (v / acceleration, -acceleration)], order=2)


def s_curve_phases(speed: float, acceleration: float, jerk: float) -> Phases:
    """Return seven phases of constant jerk, or those of them that last.

    Examples
    --------
    >>> [round(t, 6) for t in s_curve_phases(2.0, 8.0, 80.0).durations]
    [0.1, 0.15, 0.1, 0.15, 0.1, 0.15, 0.1]
    >>> [round(t, 6) for t in s_curve_phases(9.0, 99.0, 32.0).durations]
    [0.25, 0.25, 0.25, 0.25]
    """
    # the largest speed that half the way allows: reached with, or else without, a phase at full acceleration
    with_plateau = 0.5 * acceleration * (math.sqrt((acceleration / jerk)**2 + 4.0 / acceleration) - acceleration / jerk)
    without = (0.5 * math.sqrt(jerk))**(2.0 / 3.0)
    v = min(speed, with_plateau if with_plateau > acceleration**2 / jerk else without)
    a = min(acceleration, math.sqrt(v * jerk))
    rising, full = a / jerk, v / a - a / jerk
    cruise = 1.0 / v - v / a - a / jerk
    return _by_jerk([(rising, jerk), (full, 0.0), (rising, -jerk), (cruise, 0.0),
                     (rising, -jerk), (full, 0.0), (rising, jerk)], order=3)


def quintic_phases(speed: float, acceleration: float, jerk: float) -> Phases:
    """Return 10 τ³ − 15 τ⁴ + 6 τ⁵, τ = t/T, as fast as the limits allow.

    Examples
    --------
    >>> round(quintic_phases(15.0 / 8.0, 99.0, 999.0).durations[0], 9)
    1.000000000
    """
    T = max(15.0 / 8.0 / speed, math.sqrt(10.0 / math.sqrt(3.0) / acceleration), (60.0 / jerk)**(1.0 / 3.0))
    return Phases((T,), ((6.0 / T**5, -15.0 / T**4, 10.0 / T**3, 0.0, 0.0, 0.0),))


def _by_jerk(phases: list[tuple[float, float]], order: int) -> Phases:
    """Return phases of (duration, constant derivative of this order), one after the other from rest at 0."""
    state = [0.0] * order  # s, ṡ, ... at the start of a phase
    durations: list[float] = []
    rows: list[tuple[float, ...]] = []
    for duration, highest in phases:
        if duration <= 1e-12 * (1.0 + sum(durations)):
            continue
        series = [*state, highest]
        rows.append(tuple(x / math.factorial(k) for k, x in enumerate(series))[::-1])
        durations.append(duration)
        state = [sum(x * duration**(m - k) / math.factorial(m - k) for m, x in enumerate(series) if m >= k)
                 for k in range(order)]
    return Phases(tuple(durations), tuple(rows))


# --- References of a shaft over time: angle, speed, acceleration and jerk, as piecewise polynomials -------------------

_ORDERS = 4  # angle, speed, acceleration, jerk


class Reference(NamedTuple):
    """Where a shaft should be: numbers of one servo, or arrays (n,) of joints.

    Parameters
    ----------
    angle, speed, acceleration, jerk : float or ndarray
        [rad], [rad/s], [rad/s²], [rad/s³]

    Examples
    --------
    >>> Reference(0.5)
    Reference(angle=0.5, speed=0.0, acceleration=0.0, jerk=0.0)
    """

    angle: Any
    speed: Any = 0.0
    acceleration: Any = 0.0
    jerk: Any = 0.0


class Path(Protocol):
    """A reference of a controller: a `Trajectory`, or one that went through a shaper."""

    @property
    def duration(self) -> float:
        """When it ends [s]."""

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s], any shape; of joints the arrays have one axis more, the last."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A piecewise polynomial from 0 to its end, which rests before and after.

    Parameters
    ----------
    breaks : array_like, shape (m + 1,)
        Increasing, from 0 [s].
    coefficients : array_like, shape (k, m) or (k, m, n)
        Of each piece, the highest power of (t − start) first, of one servo or of n joints [rad/s^power].

    Examples
    --------
    >>> ramp = Trajectory([0.0, 2.0], [[0.5], [1.0]])
    >>> ramp.duration, ramp.at(1.0).angle, ramp.at(3.0)
    (2.0, 1.5, Reference(angle=2.0, speed=0.0, acceleration=0.0, jerk=0.0))
    """

    breaks: ArrayLike
    coefficients: ArrayLike

    def __post_init__(self) -> None:
        breaks, c = np.asarray(self.breaks, dtype=np.float64), np.asarray(self.coefficients, dtype=np.float64)
        if breaks.ndim != 1 or c.ndim not in (2, 3) or c.shape[1] != len(breaks) - 1 or not c.shape[1]:
            raise InputError("trajectory", got=f"{breaks.shape} breaks and coefficients of shape {c.shape}",
                             allowed="(m + 1,) and (k, m) or (k, m, n)")
        increasing = breaks[0] == 0.0 and (np.diff(breaks) > 0.0).all() and np.isfinite(breaks).all()
        if not (increasing and np.isfinite(c).all()):
            raise InputError("trajectory", got="times or numbers that it cannot follow",
                             allowed="finite numbers, and times that increase from 0 [s]")
        object.__setattr__(self, "breaks", breaks)
        object.__setattr__(self, "coefficients", c)
        object.__setattr__(self, "_derivatives", _derivatives(c))

    @property
    def duration(self) -> float:
        """When it ends [s]."""
        return float(np.asarray(self.breaks)[-1])

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s], any shape; of joints the arrays have one axis more, the last."""
        breaks, t = np.asarray(self.breaks), np.asarray(time, dtype=np.float64)
        inside = np.clip(t, 0.0, breaks[-1])
        k = np.clip(np.searchsorted(breaks, inside, side="right") - 1, 0, len(breaks) - 2)
        s, moves = inside - breaks[k], (t >= 0.0) & (t <= breaks[-1])
        tables: tuple[NDArray[np.float64], ...] = self._derivatives  # type: ignore[attr-defined]
        if tables[0].ndim == 3:
            s, moves = s[..., None], moves[..., None]
        values = [_horner(table[:, k], s) for table in tables]
        rates = [np.where(moves, rate, 0.0) for rate in values[1:]]
        return Reference(*(x if x.ndim else float(x) for x in (values[0], *rates)))


def _derivatives(c: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return the coefficients of angle, speed, acceleration and jerk."""
    tables = [c]
    for _ in range(_ORDERS - 1):
        c = tables[-1]
        powers = np.arange(len(c) - 1, 0, -1.0).reshape(-1, *[1] * (c.ndim - 1))
        tables.append(c[:-1] * powers if len(c) > 1 else np.zeros_like(c))
    return tuple(tables)


def _horner(table: NDArray[np.float64], s: NDArray[np.float64]) -> NDArray[np.float64]:
    value: NDArray[np.float64] = table[0] + 0.0 * s
    for row in table[1:]:
        value = value * s + row
    return value


# --- Trajectories through waypoints, within limits or at stated times -------------------------------------------------

# All joints move along the straight line between two waypoints, angle = from + (to − from) s(t), so that one profile s
# from 0 to 1 serves them all, and the joint that has the most to do sets its limits.

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


# --- Input shaping ----------------------------------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class InputShaper:
    """Impulses whose sum is 1, with which a motion is convolved: `shaper.of(trajectory)`.

    Parameters
    ----------
    times : tuple of float
        From 0 on [s].
    amplitudes : tuple of float
        Sum 1.

    Examples
    --------
    >>> from servotwin.control import quintic
    >>> shaper = zero_vibration(frequency=10.0)
    >>> move = quintic([0.0, 1.0], times=[0.0, 0.4])
    >>> shaper.amplitudes, round(shaper.of(move).duration, 3)
    ((0.5, 0.5), 0.714)
    """

    times: tuple[float, ...]
    amplitudes: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (len(self.times) == len(self.amplitudes) > 0 and all(map(is_finite, self.times + self.amplitudes))
                and min(self.times) >= 0.0 and math.isclose(sum(self.amplitudes), 1.0, abs_tol=1e-9)):
            raise InputError("InputShaper", got=(self.times, self.amplitudes),
                             allowed="as many amplitudes, of sum 1, as times from 0 s on")

    def of(self, path: Path) -> Shaped:
        """Return a motion through the shaper."""
        return Shaped(path=path, shaper=self)


@dataclass(frozen=True, kw_only=True)
class Shaped:
    """A motion that went through a shaper: Σ A_i r(t − t_i).

    Parameters
    ----------
    path : Path
        Rests before and after.
    shaper : InputShaper
    """

    path: Path
    shaper: InputShaper

    @property
    def duration(self) -> float:
        """When the last part ends [s]."""
        return self.path.duration + max(self.shaper.times)

    def at(self, time: ArrayLike) -> Reference:
        """Return what is asked for at `time` [s]."""
        t = np.asarray(time, dtype=np.float64)
        parts = [[A * x for x in self.path.at(t - t_i)]
                 for t_i, A in zip(self.shaper.times, self.shaper.amplitudes, strict=True)]
        return Reference(*map(sum, zip(*parts, strict=True)))


def zero_vibration(*, frequency: float, damping_ratio: float = 0.0) -> InputShaper:
    """Return the two impulses after which a mode does not ring (ZV).

    Parameters
    ----------
    frequency : float
        Undamped, ω_n [rad/s].
    damping_ratio : float
        ζ, from 0 to less than 1.

    Notes
    -----
    Singer and Seering, Preshaping command inputs to reduce system vibration, J. Dyn. Sys. Meas. Control 112 (1990).

    Examples
    --------
    >>> zero_vibration(frequency=math.pi).times
    (0.0, 1.0)
    """
    return _binomial(frequency, damping_ratio, 1)


def zero_vibration_derivative(*, frequency: float, damping_ratio: float = 0.0) -> InputShaper:
    """Return the three impulses that also forgive a wrong frequency, to first order (ZVD).

    Parameters
    ----------
    frequency : float
        Undamped, ω_n [rad/s].
    damping_ratio : float
        ζ, from 0 to less than 1.

    Notes
    -----
    Singer and Seering 1990, as `zero_vibration`.

    Examples
    --------
    >>> zero_vibration_derivative(frequency=math.pi).amplitudes
    (0.25, 0.5, 0.25)
    """
    return _binomial(frequency, damping_ratio, 2)


def _binomial(frequency: float, damping_ratio: float, order: int) -> InputShaper:
    if not (is_finite(frequency) and frequency > 0.0):
        raise InputError("frequency of a shaper", got=frequency, allowed="a positive number [rad/s]")
    if not (is_finite(damping_ratio) and 0.0 <= damping_ratio < 1.0):
        raise InputError("damping_ratio of a shaper", got=damping_ratio, allowed="from 0 to less than 1")
    root = math.sqrt(1.0 - damping_ratio**2)
    half, K = math.pi / (frequency * root), math.exp(-damping_ratio * math.pi / root)
    shares = [math.comb(order, i) * K**i for i in range(order + 1)]
    return InputShaper(times=tuple(i * half for i in range(order + 1)),
                       amplitudes=tuple(share / sum(shares) for share in shares))
