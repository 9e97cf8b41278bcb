"""The mobile robot on a round of waypoints: where it drives, and where it believes that it does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import InputError, UnknownNameError
from servotwin.models import Model
from servotwin.robots.drive import ServoDrive
from servotwin.robots.mobile_robot import MASS, TRACK, WHEEL_RADIUS, WHEELS
from servotwin.robots.model_file import robot_model
from servotwin.robots.mount import Mount
from servotwin.robots.places import load_mujoco
from servotwin.robots.pursuit import PurePursuit, PursuitState
from servotwin.robots.wheels import (
    Odometry,
    Pose,
    SpeedMap,
    endless,
    inertia_at_wheel,
    wheel_servo,
    wheel_speed_of,
    worn,
)
from servotwin.simulation.progress import Progress, shown
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.parameters.groups import Supply
    from servotwin.robots.record import Record

Array = NDArray[np.float64]
_Two = tuple[float, float]  # of left and right
SQUARE = ((0.0, 0.0), (0.6, 0.0), (0.6, 0.6), (0.0, 0.6), (0.0, 0.0))
"""Corners of a round of 2.4 m [m]."""
ROUNDS = ("square", "circle")
"""Rounds by name: what `round_of` makes."""
_CORNERS = 24  # of a circle
_DIRECTIONS = (1, -1)  # of the servos, which look outwards on both sides
_NEUTRAL_OFF, _WEAKER = 8e-6, 0.9  # of `unequal_servos`: s, and of torque per current; assumed
_SAME = 1e-9


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
        What the controller asks of them in this frame [rad/s].
    pulses : ndarray, shape (n, 2)
        Widths that the servos are told in this frame [s]; nan where wheels are ideal.
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

    Its controller knows wheels, track and the map from pulse to speed of a servo as it should be (`nominal`). Where it
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
        What the robot takes both servos for; `wheel_servo()` unless given.
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
    steps = max(1, math.ceil(frame / own.opt.timestep - _SAME))
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
    """Believe that wheels turn as the map says of the pulses that they are told."""
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
    if max(frames) - min(frames) > _SAME * frames[0]:
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
