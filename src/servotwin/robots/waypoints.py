"""The mobile robot on a round of waypoints: where it drives, and where it believes that it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin import loads
from servotwin.datasheet import SpeedMap, wheel_speed_of
from servotwin.datasheet.turning import endless
from servotwin.errors import InputError, UnknownNameError
from servotwin.loads import Load
from servotwin.models import Model, PulseServo
from servotwin.parameters import Servo, load_servo
from servotwin.robots.drive import ServoDrive
from servotwin.robots.mjcf_models import MASS, TRACK, WHEEL_RADIUS, WHEELS
from servotwin.robots.model_file import robot_model
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import Mount
from servotwin.simulation.progress import Progress, shown
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters.groups import Supply
    from servotwin.robots.servos.record import Record


# --- Wheels on servos that turn endlessly, and where a robot believes that they have taken it -------------------------

NEUTRAL = 1.5  # rad: where the potentiometer of a rebuilt servo stands, near the middle of its range; assumed


def wheel_servo(servo: Servo | str = "hitec-hs-755hb", fixed_angle: float = NEUTRAL) -> PulseServo:
    """Return the model of a servo rebuilt to turn endlessly, as a wheel has it.

    Parameters
    ----------
    servo : Servo or str
        Of the catalog, or a path.
    fixed_angle : float
        Where its potentiometer stands [rad].

    Examples
    --------
    >>> round(1e6 * wheel_servo().neutral_pulse)
    1492
    """
    found = load_servo(servo) if isinstance(servo, str) else servo
    if found.potentiometer.fixed_angle is None:
        found = found.continuous(fixed_angle)
    return PulseServo(found)


def worn(model: PulseServo, *, neutral: float = 0.0, torque: float = 1.0) -> PulseServo:
    """Return a wheel's servo with its neutral off, or weaker than it was, as no two servos are the same.

    Parameters
    ----------
    model : PulseServo
    neutral : float
        By how much its neutral pulse is longer [s].
    torque : float
        Share that its motor has left of its torque per current and back-EMF per speed: a motor whose magnets are weaker
        stalls with less torque and runs faster, until friction tells.

    Raises
    ------
    InputError, ParameterError
        If the servo does not turn endlessly, or a number is not possible.

    Examples
    --------
    >>> new = wheel_servo()
    >>> round(1e6 * (worn(new, neutral=1e-5).neutral_pulse - new.neutral_pulse), 6)
    10.0
    """
    servo = endless(model).servo
    per_angle = model.value("potentiometer.feedback_gain") * model.value("electronics.one_shot_slope")
    return PulseServo(servo.replace({
        "potentiometer.fixed_angle": model.value("potentiometer.fixed_angle") + neutral / per_angle,
        "motor.torque_constant": torque * model.value("motor.torque_constant"),
        "motor.back_emf_constant": torque * model.value("motor.back_emf_constant")}))


class Pose(NamedTuple):
    """Where a robot is on the floor, and where it looks.

    Parameters
    ----------
    x, y : float
        [m]
    heading : float
        From the x axis towards y, unbounded [rad]
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """Where two wheels that do not slip take a robot: along an arc while both turn evenly.

    Parameters
    ----------
    radius : float
        Of the wheels [m]
    track : float
        Between their points of contact [m]

    Raises
    ------
    InputError
        If one of them is not positive.

    Examples
    --------
    >>> turned = Odometry(radius=0.03, track=0.16).step(Pose(), -math.pi * 0.08 / 0.03, math.pi * 0.08 / 0.03)
    >>> round(turned.x, 12), round(turned.y, 12), round(turned.heading, 12) == round(math.pi, 12)
    (0.0, 0.0, True)
    """

    radius: float
    track: float

    def __post_init__(self) -> None:
        """Check."""
        for name in ("radius", "track"):
            value = getattr(self, name)
            if not (is_finite(value) and value > 0.0):
                raise InputError(f"{name} of an odometry", got=value, allowed="a positive number [m]")

    def step(self, pose: Pose, left: float, right: float) -> Pose:
        """Return the pose after both wheels have turned forward by these angles [rad]."""
        way, turn = 0.5 * self.radius * (left + right), self.radius * (right - left) / self.track
        chord = way * float(np.sinc(0.5 * turn / math.pi))
        middle = pose.heading + 0.5 * turn
        return Pose(pose.x + chord * math.cos(middle), pose.y + chord * math.sin(middle), pose.heading + turn)

    def wheel_speeds(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Return the speeds of left and right wheel [rad/s] of a robot that goes [m/s] and turns [rad/s]."""
        return ((speed - 0.5 * self.track * turn_rate) / self.radius,
                (speed + 0.5 * self.track * turn_rate) / self.radius)


def inertia_at_wheel(mass: float, radius: float) -> Load:
    """Return what half of a robot's mass [kg] is to the servo of a wheel [m] while it goes straight.

    Examples
    --------
    >>> round(inertia_at_wheel(2.0, 0.025).total_inertia, 9)
    0.000625
    """
    return loads.as_load(loads.Inertia(0.5 * mass * radius**2))


# --- Pure pursuit: a robot steers along the arc that leads to a point of its path some way ahead ----------------------

Array = NDArray[np.float64]
_SAME = 1e-12


class PursuitState(NamedTuple):
    """State of a pursuit: how far along its path it has come [m], and whether it has arrived."""

    along: float = 0.0
    arrived: bool = False


class PursuitDecision(NamedTuple):
    """The speeds that a pursuit asks for.

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


# --- The mobile robot on a round of waypoints: where it drives, and where it believes that it does --------------------

_Two = tuple[float, float]  # of left and right
SQUARE = ((0.0, 0.0), (0.6, 0.0), (0.6, 0.6), (0.0, 0.6), (0.0, 0.0))
"""Corners of a round of 2.4 m [m]."""
ROUNDS = ("square", "circle")
"""Rounds by name: what `round_of` makes."""
_CORNERS = 24  # of a circle
_DIRECTIONS = (1, -1)  # of the servos, which look outwards on both sides
_NEUTRAL_OFF, _WEAKER = 8e-6, 0.9  # of `unequal_servos`: s, and of torque per current; assumed
_SAME_STEP = 1e-9


def unequal_servos(servo: str = "hitec-hs-755hb") -> tuple[Model, Model]:
    """Return two servos of one type as one buys them: the left one's neutral is off by 8 us, the right one is weaker.

    The right one's motor has 0.9 of its torque per current and back-EMF per speed. Both numbers are assumed: no list of
    tolerances says them, but the first is the width of the HS-755HB's deadband.

    Examples
    --------
    >>> left, right = unequal_servos()
    >>> round(1e6 * (left.neutral_pulse - right.neutral_pulse), 6)
    8.0
    """
    new = wheel_servo(servo)
    return worn(new, neutral=_NEUTRAL_OFF), worn(new, torque=_WEAKER)


def round_of(name: str, size: float = 0.6) -> Array:
    """Return waypoints of a round that begins at the origin, along x, shape (n, 2) [m].

    Parameters
    ----------
    name : str
        One of `ROUNDS`; the circle is one of 24 corners.
    size : float
        Side of the square, diameter of the circle [m]

    Raises
    ------
    UnknownNameError, InputError
        If there is no such round, or it has no size.

    Examples
    --------
    >>> round_of("square", 0.5)[2].tolist(), len(round_of("circle"))
    ([0.5, 0.5], 25)
    """
    if name not in ROUNDS:
        raise UnknownNameError("round of the mobile robot", name, ROUNDS)
    if not (is_finite(size) and size > 0.0):
        raise InputError("size of a round", got=size, allowed="a positive number of metres")
    if name == "square":
        return size / SQUARE[1][0] * np.array(SQUARE)
    turn = np.linspace(0.0, 2.0 * math.pi, _CORNERS + 1)
    return 0.5 * size * np.column_stack([np.sin(turn), 1.0 - np.cos(turn)])


@dataclass(frozen=True, kw_only=True, eq=False)
class WaypointRun:
    """A round of waypoints, frame by frame.

    Parameters
    ----------
    pursuit : PurePursuit
        Path and controller.
    time : ndarray, shape (n,)
        Beginnings of the frames, and the end [s].
    path, believed : ndarray, shape (n, 3)
        x, y [m] and heading [rad]: where the robot is, and where its odometry has it.
    wheel_speeds : ndarray, shape (n, 2)
        Of left and right wheel, forward [rad/s].
    asked_speeds : ndarray, shape (n, 2)
        Speeds that the controller asks of them in this frame [rad/s].
    pulses : ndarray, shape (n, 2)
        Widths that the servos are sent in this frame [s]; nan where wheels are ideal.
    arrived : float
        When the robot believes to have arrived [s]; nan where it does not.
    record : Record, optional
        Of the servos; none of ideal wheels.
    model : MjModel, optional
    poses : ndarray, shape (n, nq)
        Of the model, for pictures; empty of ideal wheels.
    """

    pursuit: PurePursuit
    time: Array
    path: Array
    believed: Array
    wheel_speeds: Array
    asked_speeds: Array
    pulses: Array
    arrived: float
    record: Record | None
    model: Any
    poses: Array

    @property
    def waypoints(self) -> Array:
        """Corners of the path [m], shape (m, 2)."""
        return np.asarray(self.pursuit.waypoints)

    @cached_property
    def off_path(self) -> Array:
        """How far the robot is from its path [m], shape (n,)."""
        return self.pursuit.apart(self.path[:, 0], self.path[:, 1])

    @cached_property
    def off_belief(self) -> Array:
        """How far the robot is from where it believes to be [m], shape (n,)."""
        return np.asarray(np.hypot(*(self.path - self.believed)[:, :2].T))

    @property
    def missed(self) -> float:
        """How far from the last waypoint the robot ends [m]."""
        return math.hypot(*(self.path[-1, :2] - self.waypoints[-1]))

    @property
    def turned_astray(self) -> float:
        """By how much its heading is more, at the end, than it believes [rad]."""
        return float(self.path[-1, 2] - self.believed[-1, 2])


def run_waypoints(servos: Sequence[Model] | None = None, waypoints: ArrayLike = SQUARE, *, encoders: int | None = None,
                  nominal: Model | None = None, speed: float = 0.08, lookahead: float = 0.1, tolerance: float = 0.02,
                  duration: float = 120.0, bus: Supply | None = None, pulse_resolution: float = 1e-6,
                  progress: Progress = False) -> WaypointRun:
    """Let the mobile robot drive along waypoints by pure pursuit, once a frame, on two servos that turn endlessly.

    Its controller has wheels, track and the map from pulse to speed of a servo as it should be (`nominal`). Where it
    is it takes from odometry alone: of its own pulses, by that map, or of encoders on the wheels. It begins at the
    first waypoint and looks to the second.

    Parameters
    ----------
    servos : sequence of two Models, optional
        Left and right; two that are equal unless given.
    waypoints : array_like, shape (n, 2)
        [m]
    encoders : int, optional
        Counts of a turn of a wheel; without encoders the robot believes in its pulses.
    nominal : Model, optional
        Model that the robot assumes for both servos; `wheel_servo()` unless given.
    speed, lookahead, tolerance : float
        Of `PurePursuit` [m/s, m, m].
    duration : float
        At most [s]; it ends half a second after the robot believes to have arrived.
    bus : Supply, optional
        That both servos share.
    pulse_resolution : float
        Step of the pulses that the controller sends; 0: none [s]
    progress : bool or callable

    Raises
    ------
    InputError
        If a servo does not turn endlessly by pulses, the frames of all are not the same, the speed is more than a wheel
        has, or a number is not possible.
    MissingExtraError
        If MuJoCo is not installed.

    Examples
    --------
    >>> run = run_waypoints(waypoints=[(0.0, 0.0), (0.15, 0.0)], encoders=4096)
    >>> bool(run.off_path.max() < 0.005), bool(run.missed < 0.025)
    (True, True)
    """
    left, right = _two(servos)
    pursuit, nominal = _pursuit(waypoints, speed, lookahead, tolerance), nominal or wheel_servo()
    _check_numbers(duration, pulse_resolution, encoders)
    frame = _frame(left, right, nominal)
    speeds = wheel_speed_of(nominal, inertia_at_wheel(MASS, WHEEL_RADIUS))
    _check_speed(speed, speeds.most * WHEEL_RADIUS)
    own, mujoco = robot_model("mobile"), load_mujoco()
    steps = max(1, math.ceil(frame / own.opt.timestep - _SAME_STEP))
    own.opt.timestep = frame / steps
    mounts = {name: Mount(model, direction=way) for name, model, way in zip(WHEELS, (left, right), _DIRECTIONS,
                                                                            strict=True)}
    drive = ServoDrive(own, mounts, bus=bus, assume_heat=False)
    data = mujoco.MjData(drive.model)
    start = _start_of(pursuit)
    data.qpos[:2], data.qpos[3:7] = start[:2], (math.cos(0.5 * start.heading), 0.0, 0.0, math.sin(0.5 * start.heading))
    drive.record(data)
    believe = _by_encoders(encoders) if encoders else _by_pulses(speeds, frame)
    at = [int(drive.model.jnt_qposadr[drive.model.joint(name).id]) for name in WHEELS]
    turning = [int(drive.model.jnt_dofadr[drive.model.joint(name).id]) for name in WHEELS]

    def go(pulses: _Two) -> _Seen:
        if not math.isnan(pulses[0]):
            drive.command(data, dict(zip(WHEELS, pulses, strict=True)))
            drive.step(data, steps)
        q = data.qpos
        heading = math.atan2(2.0 * (q[3] * q[6] + q[4] * q[5]), 1.0 - 2.0 * (q[5] ** 2 + q[6] ** 2))
        return _Seen((float(q[0]), float(q[1]), heading), q[at].tolist(), data.qvel[turning].tolist(), q.copy())

    def pulses_for(wanted: _Two) -> _Two:
        a, b = (speeds.pulse(way * w) for way, w in zip(_DIRECTIONS, wanted, strict=True))
        return _rounded(a, pulse_resolution), _rounded(b, pulse_resolution)

    return _driven(pursuit, start, frame, duration, go, pulses_for, believe, progress,
                   lambda: (drive.result(data), drive.model))


def ideal_waypoints(waypoints: ArrayLike = SQUARE, *, speed: float = 0.08, lookahead: float = 0.1,
                    tolerance: float = 0.02, duration: float = 120.0, frame: float = 0.02) -> WaypointRun:
    """Return the same round on ideal wheels, which turn as asked at once and do not slip.

    Parameters
    ----------
    waypoints, speed, lookahead, tolerance, duration
        As of `run_waypoints`.
    frame : float
        Time between two decisions [s]

    Examples
    --------
    >>> run = ideal_waypoints()
    >>> bool(run.missed < 0.02), bool(run.off_belief.max() < 1e-12)
    (True, True)
    """
    pursuit = _pursuit(waypoints, speed, lookahead, tolerance)
    _check_numbers(duration, 0.0, None)
    start, wheels, asked = _start_of(pursuit), Odometry(radius=WHEEL_RADIUS, track=TRACK), [(0.0, 0.0)]
    pose, turned = [start], np.zeros(2)

    def pulses_for(wanted: _Two) -> _Two:
        asked[0] = wanted
        return math.inf, math.inf

    def go(pulses: _Two) -> _Seen:
        if not math.isnan(pulses[0]):
            turned[:] += frame * np.array(asked[0])
            pose[0] = wheels.step(pose[0], frame * asked[0][0], frame * asked[0][1])
        return _Seen(tuple(pose[0]), turned.tolist(), list(asked[0]), np.zeros(0))

    def believe(seen: _Seen, before: _Seen, pulses: _Two) -> _Two:
        return seen.turned[0] - before.turned[0], seen.turned[1] - before.turned[1]

    run = _driven(pursuit, start, frame, duration, go, pulses_for, believe, False, lambda: (None, None))
    run.pulses[:] = math.nan
    return run


@dataclass(frozen=True)
class _Seen:
    """Where the robot stands after a frame: pose, angles [rad] and speeds [rad/s] of the wheels, all of MuJoCo's."""

    pose: tuple[float, ...]
    turned: list[float]
    speeds: list[float]
    all: Array


_Belief = Callable[[_Seen, _Seen, _Two], _Two]


def _driven(pursuit: PurePursuit, start: Pose, frame: float, duration: float, go: Callable[[_Two], _Seen],
            pulses_for: Callable[[_Two], _Two], believe: _Belief, progress: Progress,
            end: Callable[[], tuple[Record | None, Any]]) -> WaypointRun:
    """Let a robot go, frame by frame: decide by belief, tell the wheels, drive, and look how far they have turned."""
    odometry, state, belief = Odometry(radius=WHEEL_RADIUS, track=TRACK), PursuitState(), start
    seen, arrived, rows, frames = go((math.nan, math.nan)), math.nan, list[list[float]](), math.ceil(duration / frame)
    poses = [seen.all]
    with shown(progress, frames, "driving along the waypoints") as tell:
        for k in range(frames + 1):
            decision = pursuit.step(state, belief)
            state = decision.state
            if state.arrived and math.isnan(arrived):
                arrived = k * frame
            asked = odometry.wheel_speeds(decision.speed, decision.turn_rate)
            pulses = pulses_for(asked)
            rows.append([k * frame, *seen.pose, *belief, *seen.speeds, *asked, *pulses])
            if k == frames or k * frame >= arrived + 0.5:
                break
            before, seen = seen, go(pulses)
            poses.append(seen.all)
            belief = odometry.step(belief, *believe(seen, before, pulses))
            if k % 50 == 0:
                tell(k)
    table = np.array(rows)
    table[:, 3] = np.unwrap(table[:, 3])
    record, model = end()
    return WaypointRun(pursuit=pursuit, time=table[:, 0], path=table[:, 1:4], believed=table[:, 4:7],
                       wheel_speeds=table[:, 7:9], asked_speeds=table[:, 9:11], pulses=table[:, 11:13], arrived=arrived,
                       record=record, model=model, poses=np.array(poses))


def _by_pulses(speeds: SpeedMap, frame: float) -> _Belief:
    """Believe that wheels turn as the map says of the pulses that they are sent."""
    def believe(seen: _Seen, before: _Seen, pulses: _Two) -> _Two:
        left, right = (way * frame * float(speeds.speed(pulse)) for way, pulse in zip(_DIRECTIONS, pulses, strict=True))
        return left, right
    return believe


def _by_encoders(counts: int) -> _Belief:
    """Believe in whole counts of the wheels' angles."""
    step = math.tau / counts

    def believe(seen: _Seen, before: _Seen, pulses: _Two) -> _Two:
        left, right = (step * (math.floor(now / step) - math.floor(then / step))
                       for now, then in zip(seen.turned, before.turned, strict=True))
        return left, right
    return believe


def _rounded(pulse: float, resolution: float) -> float:
    return round(pulse / resolution) * resolution if resolution > 0.0 else pulse


def _pursuit(waypoints: ArrayLike, speed: float, lookahead: float, tolerance: float) -> PurePursuit:
    return PurePursuit(waypoints=waypoints, lookahead=lookahead, speed=speed, tolerance=tolerance, track=TRACK)


def _start_of(pursuit: PurePursuit) -> Pose:
    (x, y), (to_x, to_y) = np.asarray(pursuit.waypoints)[:2].tolist()
    return Pose(x, y, math.atan2(to_y - y, to_x - x))


def _two(servos: Sequence[Model] | None) -> tuple[Model, Model]:
    if servos is None:
        new = wheel_servo()
        return new, new
    found = tuple(servos) if isinstance(servos, Iterable) else ()
    if len(found) != 2:
        raise InputError("servos of a mobile robot", got=servos, allowed="two models, left and right")
    return found


def _frame(left: Model, right: Model, nominal: Model) -> float:
    """Return the frame of all servos [s], which the maps of speeds check."""
    frames = [endless(model).frame_period for model in (left, right, nominal)]
    if max(frames) - min(frames) > _SAME_STEP * frames[0]:
        raise InputError("frame_period of the wheels' servos", got=", ".join(f"{one:g} s" for one in frames),
                         allowed="one frame for both and for what the robot takes them for")
    return frames[0]


def _check_speed(speed: float, most: float) -> None:
    if speed > most:
        raise InputError("speed of the mobile robot", got=speed, allowed=f"at most {most:.3g} m/s, as its servos have")


def _check_numbers(duration: float, pulse_resolution: float, encoders: int | None) -> None:
    if not (is_finite(duration) and duration > 0.0):
        raise InputError("duration", got=duration, allowed="a positive number of seconds")
    if not (is_finite(pulse_resolution) and pulse_resolution >= 0.0):
        raise InputError("pulse_resolution", got=pulse_resolution, allowed="a number of seconds that is not negative")
    if encoders is not None and (isinstance(encoders, bool) or not isinstance(encoders, int) or encoders < 1):
        raise InputError("encoders", got=encoders, allowed="counts of a turn, a whole number of at least 1")


__all__ = ['Odometry', 'Pose', 'SpeedMap', 'endless', 'inertia_at_wheel', 'wheel_servo', 'wheel_speed_of', 'worn']
