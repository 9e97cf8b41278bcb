"""How well a servo has made its joint follow a motion, and what that took."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from servotwin.errors import InputError, SimulationError
from servotwin.robots.motion import Motion
from servotwin.robots.overlaps import body_name, joints_between
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.coupling import Linkage
from servotwin.robots.servos.record import ServoRecord
from servotwin.simulation.remarks import Remark
from servotwin.units import is_finite

# --- The same robot with ideal actuators: its joints follow their motion exactly, and what that takes -----------------

# A motion is straight lines between samples, which no joint follows: its speed jumps at each sample. An ideal joint
# moves on the mean of the motion over a short window, which makes parabolas of the corners and leaves straight lines as
# they are (Craig, Introduction to Robotics, 3rd ed. 2005, section 7.3, linear function with parabolic blends):
#
#     q(t) = (Q(t + w/2) − Q(t − w/2))/w,    with Q' = the motion
#
# The torque is that of inverse dynamics, with rotors and gears that turn with the joint. Joints without a servo, and
# things that lie about, move as they are pushed: there the joints with servos are given an inertia beside which nothing
# counts, and with it the acceleration that they have to have. A joint that follows those with servos by an equality is
# firm on them, and what it takes counts there (`linkage`).
#
# Where such a robot runs into itself or into what is fixed, nothing yields and no torque makes sense: such contacts are
# reported, and their forces do not count.

Array = NDArray[np.float64]
WINDOWS = (0.05, 0.1)  # s, shortest and longest window of a motion: in the former no servo gets up to speed
_HEAVY = 1e8  # times what a joint carries
_LIGHTEST = 1e-9  # kg m², of a joint that carries nothing


class Course(NamedTuple):
    """How a joint moves: angle [rad], speed [rad/s] and acceleration [rad/s²]; of a slide in m."""

    angle: Array
    speed: Array
    acceleration: Array


class Touch(NamedTuple):
    """Two bodies of which neither yields, that run into each other.

    Their names, first time [s], for how long [s], and the joints between them, which press them together.
    """

    first: str
    second: str
    time: float
    duration: float
    joints: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """One sentence."""
        return (f"with ideal actuators {self.first} runs into {self.second} at {max(self.time, 0.0):.2f} s, for "
                f"{self.duration:.2f} s in all; the torque of that does not count")


@dataclass(frozen=True, eq=False, kw_only=True)
class IdealRun:
    """A robot whose joints follow their motion exactly.

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s]
    window : float
        Over which the motion is blended [s]
    courses : mapping of str to Course
        Of each joint with a servo.
    torque : mapping of str to ndarray, shape (n,)
        That each of them takes, with a rotor and gear that are firm on it [N m], of a slide [N]
    poses : ndarray, shape (n, nq)
        Of the whole robot, MuJoCo's `qpos`.
    touches : tuple of Touch
        Contacts with shapes that do not yield.
    """

    time: Array
    window: float
    courses: Mapping[str, Course]
    torque: Mapping[str, Array]
    poses: Array
    touches: tuple[Touch, ...]


def blend_window(motion: Motion) -> float:
    """Return the window of a motion [s]: two of its samples, but no less than 0.05 and no more than 0.1 s.

    Examples
    --------
    >>> blend_window(Motion(time=[0.0, 1.0], angles={"elbow": [0.0, 1.0]}, source="two points"))
    0.1
    """
    return float(np.clip(2.0 * np.median(np.diff(motion.time)), *WINDOWS))


def course(motion: Motion, joint: str, time: Array, window: float) -> Course:
    """Return how a joint follows a motion whose corners are blended.

    Parameters
    ----------
    motion : Motion
    joint : str
    time : ndarray, shape (n,)
        [s]
    window : float
        w, over which the motion is averaged [s]

    Examples
    --------
    >>> ramp = Motion(time=[0.0, 1.0], angles={"elbow": [0.0, 2.0]}, source="ramp")
    >>> found = course(ramp, "elbow", np.array([-0.05, 0.0, 0.5]), 0.1)
    >>> found.angle.round(4).tolist(), found.speed.tolist(), found.acceleration.tolist()
    ([0.0, 0.025, 1.0], [0.0, 1.0, 2.0], [20.0, 20.0, 0.0])
    """
    times, values = motion.time, motion.angles[joint]
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(times), [0.0]])
    areas = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(times) * (values[1:] + values[:-1]))])

    def at(t: Array) -> Course:
        k = np.searchsorted(times, t, side="right")  # slopes[k] holds from sample k − 1 on
        first = np.maximum(k - 1, 0)
        since = t - times[first]
        return Course(areas[first] + since * (values[first] + 0.5 * since * slopes[k]),
                      values[first] + since * slopes[k], slopes[k])

    after, before = at(time + 0.5 * window), at(time - 0.5 * window)
    return Course(*((late - early) / window for late, early in zip(after, before, strict=True)))


def ideal_run(model: Any, joints: Sequence[str], motion: Motion, time: Array, *, window: float | None = None,
              progress: Callable[[int], object] | None = None) -> IdealRun:
    """Return what the robot does whose joints follow a motion exactly, and the torques that this takes.

    Parameters
    ----------
    model : MjModel
        Of a `ServoDrive`, whose joints carry what turns with them of their servos.
    joints : sequence of str
        With servos; those of which the motion says nothing stay where the model has them.
    motion : Motion
    time : ndarray, shape (n,)
        Evenly spaced, by the timestep of the model [s]
    window : float, optional
        Over which the motion is blended; `blend_window` of it unless given [s]
    progress : callable, optional
        Called with how many times are done.

    Raises
    ------
    InputError
        If the window is not positive.
    SimulationError
        If MuJoCo meets a number that is not finite.
    """
    mujoco = load_mujoco()
    window = blend_window(motion) if window is None else window
    if not (is_finite(window) and window > 0.0):
        raise InputError("window of a blended motion", got=window, allowed="a positive number of seconds")
    exact, heavy, linkage = copy.copy(model), copy.copy(model), Linkage(model, joints)
    driven, numbers = slice(len(joints)), [*(model.joint(name).id for name in joints), *linkage.joints]
    angles_at, dofs = model.jnt_qposadr[numbers], model.jnt_dofadr[numbers]
    for each in (exact, heavy):
        each.jnt_limited[numbers] = 0
        each.eq_active0[linkage.equalities] = 0
        each.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    weights = _HEAVY * np.maximum(model.dof_M0[dofs], _LIGHTEST)
    heavy.dof_armature[dofs] += weights
    data, inverse = mujoco.MjData(heavy), mujoco.MjData(exact)
    others_move = model.nv > len(numbers) or model.nu > 0
    courses = {name: course(motion, name, time, window) if name in motion.angles else
               _standing(float(data.qpos[at]), len(time)) for name, at in zip(joints, angles_at[driven], strict=True)}
    table = np.array([courses[name] for name in joints])  # joints, (angle, speed, acceleration), times
    torque, poses = np.zeros((len(joints), len(time))), np.zeros((len(time), model.nq))
    firm = _Firm(model, set(dofs.tolist()))
    for k in range(len(time)):
        for values, places, given in zip((data.qpos, data.qvel, data.qacc), (angles_at, dofs, dofs), table[:, :, k].T,
                                           strict=True):
            values[places[driven]] = given
        shares = linkage.follow(data.qpos, data.qvel, data.qacc)
        data.time = time[k]
        if others_move:
            data.qfrc_applied[dofs] = weights * data.qacc[dofs]
            mujoco.mj_forward(heavy, data)
        inverse.time = time[k]
        inverse.qpos[:], inverse.qvel[:], inverse.qacc[:] = data.qpos, data.qvel, data.qacc
        mujoco.mj_inverse(exact, inverse)
        forces = inverse.qfrc_inverse[dofs] - data.qfrc_actuator[dofs]
        if inverse.ncon:
            forces += firm.forces(exact, inverse)[dofs]
        torque[:, k] = forces[driven] + shares.T @ forces[len(joints):]
        poses[k] = data.qpos
        if others_move:
            mujoco.mj_step(heavy, data)
        if progress is not None:
            progress(k + 1)
    if not (np.isfinite(torque).all() and np.isfinite(poses).all()):
        bad = int(np.argmax(~np.isfinite(poses).all(axis=1) | ~np.isfinite(torque).all(axis=0)))
        raise SimulationError("MUJOCO", float(time[bad]), "MuJoCo has met a number that is not finite with ideal "
                              "actuators")
    return IdealRun(time=time, window=window, courses=courses, torque=dict(zip(joints, torque, strict=True)),
                    poses=poses, touches=firm.touches(time))


class _Firm:
    """Contacts between bodies that all move as they have to, or not at all."""

    def __init__(self, model: Any, dofs: set[int]) -> None:
        self._mujoco, self._model = load_mujoco(), model
        self._met: dict[tuple[int, int], list[float]] = {}
        bound = [True]
        for body in range(1, model.nbody):
            first = int(model.body_dofadr[body])
            own = range(first, first + int(model.body_dofnum[body]))
            bound.append(bound[int(model.body_parentid[body])] and dofs.issuperset(own))
        self._bound = bound

    def forces(self, model: Any, data: Any) -> Array:
        """Return what such contacts do to the degrees of freedom [N m or N]."""
        forces, met = np.zeros(data.nefc), False
        elliptic = model.opt.cone == self._mujoco.mjtCone.mjCONE_ELLIPTIC
        for contact in data.contact:
            bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom if geom >= 0]
            if contact.efc_address < 0 or len(bodies) < 2 or not all(self._bound[body] for body in bodies):
                continue
            rows = contact.dim if elliptic or contact.dim == 1 else 2 * (contact.dim - 1)
            at = slice(contact.efc_address, contact.efc_address + rows)
            forces[at], met = data.efc_force[at], True
            times = self._met.setdefault((min(bodies), max(bodies)), [])
            if not times or times[-1] != data.time:
                times.append(float(data.time))
        found = np.zeros(model.nv)
        if met:
            self._mujoco.mj_mulJacTVec(model, data, found, forces)
        return found

    def touches(self, time: Array) -> tuple[Touch, ...]:
        """Return all that have met, the first ones first."""
        step = float(time[1] - time[0]) if len(time) > 1 else 0.0
        found = [Touch(body_name(self._model, second), body_name(self._model, first), times[0], step * len(times),
                       joints_between(self._model, first, second)) for (first, second), times in self._met.items()]
        return tuple(sorted(found, key=lambda touch: touch.time))


def _standing(angle: float, count: int) -> Course:
    return Course(np.full(count, angle), np.zeros(count), np.zeros(count))


# --- The contour error: how far a tool is from the line that it was to follow, however late it is ---------------------

_CLOSE = 2e-4  # m, between the points among which the nearest is looked for
_NEAREST = 4  # of them, whose pieces are looked at


class Contour(NamedTuple):
    """Distances from the line [m]: over time, root mean square, largest."""

    error: Array
    rms: float
    largest: float


def contour_error(places: Array, line: Array) -> Contour:
    """Return how far places are from a line.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Of the tool [m]
    line : ndarray, shape (m, 3)
        Points that are joined by straight pieces [m]

    Examples
    --------
    >>> contour_error(np.array([[0.5, 0.2, 0.0], [2.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])).error
    array([0.2, 1. ])
    """
    starts, ways = _pieces(line)
    lengths = np.maximum(np.einsum("ij,ij->i", ways, ways), np.finfo(float).tiny)
    count = min(_NEAREST, len(starts))
    _, near = cKDTree(starts + 0.5 * ways).query(places, k=count)
    best = np.full(len(places), np.inf)
    for which in np.reshape(near, (len(places), count)).T:
        from_start = places - starts[which]
        share = np.clip(np.einsum("ij,ij->i", from_start, ways[which]) / lengths[which], 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(from_start - share[:, None] * ways[which], axis=1))
    return Contour(best, float(np.sqrt(np.mean(best**2))), float(best.max()))


def _pieces(line: Array) -> tuple[Array, Array]:
    """Return beginnings and ways of the pieces of a line, none of them long."""
    ways = np.diff(line, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(ways, axis=1) / _CLOSE).astype(np.int64), 1)
    whole = np.repeat(ways / counts[:, None], counts, axis=0)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(line[:-1], counts, axis=0) + within[:, None] * whole, whole


# --- How well a servo has made its joint follow a motion, and what that took ------------------------------------------

_LONGEST_DELAY = 0.5  # s
_REST = 0.1  # s, over whose mean a servo is said to stand off
_DELAYS = 101


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """The tracking of one servo that followed a motion.

    Errors are goal less joint, of a hinge [rad], of a slide [m]; what a servo lacks is nan.

    Parameters
    ----------
    rms, largest, mean : float
        Error during the motion: root mean square, largest magnitude, mean.
    delay : float
        By which the goal follows the joint best; nan of a joint that has no motion [s]
    rms_delayed : float
        Error that is left with that delay.
    droop_before, droop_after : float
        Error at the end of the settling, and of the rest after the motion.
    peak_current, mean_current : float
        Of the motor among the ends of all ticks, and mean of what the servo took of its supply, from the beginning of
        the motion on [A]
    lowest_voltage : float
        Of its supply [V]
    winding, housing : float
        Highest temperatures [K]
    remarks : tuple of Remark
        Trips of a digital servo, and that it does not come to rest.
    """

    rms: float
    largest: float
    mean: float
    delay: float
    rms_delayed: float
    droop_before: float
    droop_after: float
    peak_current: float
    mean_current: float
    lowest_voltage: float
    winding: float
    housing: float
    remarks: tuple[Remark, ...]


def tracking_of(record: ServoRecord, goal: Array, duration: float,
                lowest: tuple[float, float] | None = None) -> Tracking:
    """Return how a servo has followed goals, at the times of its record.

    Parameters
    ----------
    record : ServoRecord
    goal : ndarray, shape (n,)
        Of the joint: of a hinge [rad], of a slide [m]
    duration : float
        Of the motion, which begins at time 0 [s]
    lowest : tuple (float, float), optional
        Least voltage of its supply from then on, within ticks too [V], and when [s]
    """
    time, angle = record.time, record["joint_angle"]
    error = goal - angle
    moving = (time >= 0.0) & (time <= duration)
    delay, left = best_delay(time, goal, angle, moving)
    from_start = time >= 0.0
    drawn = "supply_current" if "supply_current" in record else "armature_current"
    return Tracking(
        rms=_rms(error[moving]), largest=float(np.abs(error[moving]).max()), mean=float(error[moving].mean()),
        delay=delay, rms_delayed=left, droop_before=_mean(error[(time <= 0.0) & (time > -_REST)]),
        droop_after=_mean(error[time > time[-1] - _REST]),
        peak_current=_highest(record, "armature_current", from_start),
        mean_current=float(record[drawn][from_start].mean()),
        lowest_voltage=_lowest(record, from_start) if lowest is None else lowest[0],
        winding=_highest(record, "winding_temperature", from_start),
        housing=_highest(record, "housing_temperature", from_start), remarks=record.remarks)


def _lowest(record: ServoRecord, some: NDArray[np.bool_]) -> float:
    return float(record["bus_voltage"][some].min()) if "bus_voltage" in record else math.nan


def best_delay(time: Array, goal: Array, angle: Array, moving: NDArray[np.bool_]) -> tuple[float, float]:
    """Return by which delay [s] a goal follows an angle best, up to 0.5 s, and the error that is left, rms.

    Examples
    --------
    >>> time = np.linspace(0.0, 2.0, 2001)
    >>> delay, left = best_delay(time, np.sin(6.0 * time), np.sin(6.0 * (time - 0.08)), time > 0.5)
    >>> round(delay, 4), left < 1e-4
    (0.08, True)
    """
    if np.ptp(goal) == 0.0:
        return math.nan, math.nan

    def left(delay: float) -> float:
        return _rms(np.interp(time[moving] - delay, time, goal) - angle[moving])

    delays = np.linspace(0.0, _LONGEST_DELAY, _DELAYS)
    errors = [left(delay) for delay in delays.tolist()]
    at, step = int(np.argmin(errors)), float(delays[1])
    best = float(delays[at])
    for _ in range(20):  # halves the steps around the best
        step *= 0.5
        near = [max(best - step, 0.0), best, best + step]
        best = min(near, key=left)
    return best, left(best)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else math.nan


def _highest(record: ServoRecord, name: str, inside: NDArray[np.bool_]) -> float:
    return float(np.abs(record[name][inside]).max()) if name in record else math.nan
