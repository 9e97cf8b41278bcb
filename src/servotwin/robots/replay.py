"""`validate_robot`: how far a simulated robot is from the real one, whose goals and positions were recorded.

The goals of an episode are sent through the robot with its servos; what its joints do stands beside what was measured,
and beside the same robot with ideal actuators and with MuJoCo's `<position>`. A loop that records reads positions at
another time than it sends goals: each robot is compared later or earlier by the one time, of all joints and episodes,
at which it fits best.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.datasheet.full_drive import FullDrive
from servotwin.errors import InputError
from servotwin.models import Model
from servotwin.robots.model_file import plant_of
from servotwin.robots.motion import Motion
from servotwin.robots.overlaps import leave_out_measured
from servotwin.robots.places import load_mujoco
from servotwin.robots.run import RobotRun, run_motion
from servotwin.robots.servos.coupling import couple, silence
from servotwin.robots.servos.mount import Mount, joints_of, supplied
from servotwin.simulation.progress import Progress, shown

# --- The same robot with MuJoCo's `<position>` actuators, with numbers that people use for arms of bus servos ---------

#     torque = clip(kp (goal - q) - kv q', force) - damping q',    with friction loss and armature of the joint
#
# Numbers are those of files for the SO-100 and SO-101: `so101_new_calib.xml` of TheRobotStudio/SO-ARM100, which MuJoCo
# Menagerie has too (`robotstudio_so101`), its defaults for joints of no class, and `joints_properties.xml` beside it.

Array = NDArray[np.float64]
_SAME = 1e-9  # s


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Numbers of a `<position>` actuator and of its joint.

    Parameters
    ----------
    name : str
    stiffness, velocity_gain : float
        kp [N m/rad], kv [N m s/rad]
    damping, friction, armature : float
        Of the joint [N m s/rad], [N m], [kg m²]
    force : float
        Range of the force, either way [N m]
    """

    name: str
    stiffness: float
    velocity_gain: float = 0.0
    damping: float
    friction: float
    armature: float
    force: float = np.inf


COMMON = (
    Gains(name="<position> kp 998", stiffness=998.22, velocity_gain=2.731, damping=0.60, friction=0.052,
          armature=0.028, force=2.94),
    Gains(name="<position> kp 50", stiffness=50.0, damping=1.0, friction=0.1, armature=0.005),
    Gains(name="<position> kp 17.8", stiffness=17.8, damping=0.60, friction=0.052, armature=0.028, force=3.35),
)
"""Words for an SO-100 or SO-101."""


def position_run(run: RobotRun, gains: Gains) -> dict[str, Array]:
    """Return where the joints of a robot that has followed a motion are with such actuators, at the same times.

    Parameters
    ----------
    run : RobotRun
    gains : Gains
    """
    mujoco, model = load_mujoco(), copy.copy(run.model)
    joints = joints_of(model, run.mounts)
    at, dofs = ([getattr(joint, name) for joint in joints] for name in ("angle_at", "speed_at"))
    for values, value in ((model.dof_damping, gains.damping), (model.dof_frictionloss, gains.friction),
                          (model.dof_armature, gains.armature)):
        values[dofs] = value
    for joint in joints:
        if joint.actuator >= 0:
            silence(model, joint.actuator)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    names = [joint.name for joint in joints]
    data.qpos[:], data.time = _start(run, names, at), run.time[0] - model.opt.timestep
    couple(model, data.qpos)
    angles = np.zeros((len(run.time), len(joints)))
    for k, goals in enumerate(_goals(run, names)):
        force = gains.stiffness * (goals - data.qpos[at]) - gains.velocity_gain * data.qvel[dofs]
        data.qfrc_applied[dofs] = np.clip(force, -gains.force, gains.force)
        mujoco.mj_step(model, data)
        angles[k] = data.qpos[at]
    return dict(zip(names, angles.T, strict=True))


def _start(run: RobotRun, names: Sequence[str], at: Sequence[int]) -> Array:
    found = np.array(run.model.qpos0)
    for name, place in zip(names, at, strict=True):
        found[place] = run.goal(name)[0]
    return found


def _goals(run: RobotRun, names: Sequence[str]) -> Iterator[Array]:
    """Give the goals of all joints, held between samples as LeRobot sends them."""
    time = run.time - (run.time[1] - run.time[0])
    which = np.clip(np.searchsorted(run.motion.time, time + _SAME, side="right") - 1, 0, None)
    table = np.stack([run.motion.angles[name][which] if name in run.motion.angles else run.goal(name)
                      for name in names], axis=1)
    yield from table


# --- `validate_robot`: how far a simulated robot is from the real one, whose goals and positions were -----------------

Mask = NDArray[np.bool_]
SERVOS, IDEAL = "servos", "ideal actuators"
ALL, MOVING, RESTING, LOADED = "all", "moving", "resting", "under load"
KINDS = (ALL, MOVING, RESTING, LOADED)
WINDOW = 1.0  # s, over which the worst of an episode is sought
_MOVES = math.radians(4.0)  # rad/s: faster than a count of 12 bits in a sample of 30 Hz would be
_LOADED = 0.1  # of the torque at standstill
_LATENCIES = (-0.06, 0.25, 0.001)  # s: from, to, step
_SETTLE = 0.5  # s


class JointError(NamedTuple):
    """Simulated less measured angle of a joint: root mean square, largest magnitude, mean [rad]; number of samples."""

    rms: float
    largest: float
    mean: float
    samples: int


class Window(NamedTuple):
    """A second in which a joint is furthest off: number of its replay, joint, times [s], error [rad], what it does."""

    replay: int
    joint: str
    start: float
    stop: float
    rms: float
    kind: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Replay:
    """An episode that was sent through a robot.

    Parameters
    ----------
    run : RobotRun
    time : ndarray, shape (n,)
        Of the measured positions, from the beginning of the motion [s]
    measured : mapping of str to ndarray, shape (n,)
        By joint [rad]
    simulated : mapping of str to mapping
        The same of servos and of each rival, by its name, as late as fits it best [rad]
    kinds : mapping of str to mapping
        Masks of the samples of each kind, such as those in which a joint moves, by joint and kind.
    """

    run: RobotRun
    time: Array
    measured: Mapping[str, Array]
    simulated: Mapping[str, Mapping[str, Array]]
    kinds: Mapping[str, Mapping[str, Mask]]


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotValidation:
    """How far a simulated robot is from the real one.

    Parameters
    ----------
    replays : tuple of Replay
        One an episode.
    latency : mapping of str to float
        Of servos and rivals, by name: by how much their joints are compared later [s]
    errors : mapping of str to mapping
        Of servos and rivals, by name, joint and kind of motion.
    windows : tuple of Window
        The worst second of each joint, the worst first.
    said : tuple of str
        Assumptions, and shapes that the robot's model runs into.
    """

    replays: tuple[Replay, ...]
    latency: Mapping[str, float]
    errors: Mapping[str, Mapping[str, Mapping[str, JointError]]]
    windows: tuple[Window, ...]
    said: tuple[str, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that were measured."""
        return tuple(self.replays[0].measured)

    def rms(self, name: str = SERVOS) -> float:
        """Return the error of servos or a rival, all joints together [rad]."""
        found = [self.errors[name][joint][ALL] for joint in self.joints]
        return math.sqrt(sum(one.samples * one.rms**2 for one in found) / sum(one.samples for one in found))


def validate_robot(model: Any, servos: Mapping[str, Model | Mount], motions: Motion | Sequence[Motion], *,
                   bus: Any = None, joint_friction: str = "refuse", timestep: float | None = None,
                   latency: float | None = None, rivals: Sequence[Gains] = COMMON, assume_heat: bool = True,
                   progress: Progress = False) -> RobotValidation:
    """Return how far a robot with servos is from the measured positions of motions, joint by joint.

    Parameters
    ----------
    model, servos, bus, joint_friction, timestep, assume_heat
        As of `run_motion`.
    motions : Motion or sequence of Motion
        With measured positions, such as `read_motion` reads from a dataset of LeRobot.
    latency : float, optional
        By how much later than a goal is written down it acts, less the same of positions; sought unless given [s]
    rivals : sequence of Gains
        Of `<position>` actuators that stand beside, with ideal ones.
    progress : bool or callable
        Whether to show how far it is.

    Raises
    ------
    InputError
        Or one of its kinds: if nothing was measured, or what `run_motion` refuses.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = {"wrist_flex": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}
    >>> nod = st.robots.Motion(time=[0.0, 0.4, 0.8], angles={"wrist_flex": [0.0, 0.3, 0.0]}, source="a nod",
    ...                        measured={"wrist_flex": [0.0, 0.2, 0.1]})
    >>> found = st.robots.validate_robot("so101", servo, nod, rivals=())
    >>> list(found.errors), found.joints, found.rms() > 0.01
    (['servos', 'ideal actuators'], ('wrist_flex',), True)
    """
    given = [motions] if isinstance(motions, Motion) else list(motions)
    _check(given, servos, latency)
    plant, runs = plant_of(model), []
    left_out = leave_out_measured(plant.model, given)
    with shown(progress, len(given), "replaying") as tell:
        for k, motion in enumerate(given):
            runs.append(run_motion(plant, servos, motion, bus=bus, joint_friction=joint_friction, timestep=timestep,
                                   settle=_SETTLE, hold="previous", assume_heat=assume_heat))
            tell(k + 1)
    joints = measured_joints(runs[0].mounts, given)
    courses = [_courses(run, joints, rivals) for run in runs]
    names = list(courses[0])
    late = {name: _latency(runs, courses, joints, name) if latency is None else latency for name in names}
    replays = tuple(_replay(run, own, late, joints) for run, own in zip(runs, courses, strict=True))
    errors = {name: {joint: {kind: _error(replays, name, joint, kind) for kind in KINDS} for joint in joints}
              for name in names}
    said = tuple(dict.fromkeys((*left_out, *(text for run in runs for text in (
        *run.said, *(f"{run.motion.source}: {touch.words}" for touch in run.ideal.touches))))))
    return RobotValidation(replays=replays, latency=late, errors=errors, windows=_windows(replays, joints), said=said)


def measured_joints(servos: Mapping[str, object], motions: Sequence[Motion]) -> list[str]:
    """Return the joints with servos that were measured in all motions: those that `validate_robot` compares."""
    return [joint for joint in servos if all(joint in motion.measured for motion in motions)]


def _check(motions: Sequence[Motion], servos: Mapping[str, object], latency: float | None) -> None:
    if not motions:
        raise InputError("motions", got="none", allowed="at least one")
    for motion in motions:
        if not isinstance(motion, Motion):
            raise InputError("motions", got=motion, allowed="a Motion with measured positions, or several")
        if not motion.measured:
            raise InputError(f"{motion.source}: measured positions", got="none", allowed="observation.state of a "
                             "dataset, or columns state.JOINT_deg beside action.JOINT_deg")
        if not set(motion.measured) & set(servos):
            raise InputError(f"joints of {motion.source}", got=", ".join(motion.measured),
                             allowed=f"one with a servo: {', '.join(servos)}")
    if latency is not None and not _LATENCIES[0] <= latency <= _LATENCIES[1]:
        raise InputError("latency", got=latency, allowed=f"{_LATENCIES[0]:g} to {_LATENCIES[1]:g} s")


def _courses(run: RobotRun, joints: Sequence[str], rivals: Sequence[Gains]) -> dict[str, dict[str, Array]]:
    """Return where joints are at the times of a run, of servos and rivals."""
    found = {SERVOS: {joint: run.record[joint]["joint_angle"] for joint in joints},
             IDEAL: {joint: run.ideal.courses[joint].angle for joint in joints}}
    return found | {gains.name: position_run(run, gains) for gains in rivals}


def _latency(runs: Sequence[RobotRun], courses: Sequence[Mapping[str, Mapping[str, Array]]], joints: Sequence[str],
             name: str) -> float:
    """Return by how much later all joints fit best [s]."""
    tried = np.arange(*_LATENCIES)

    def left(late: float) -> float:
        return sum(float(np.abs(np.interp(run.motion.time - late, run.time, own[name][joint])
                                - run.motion.measured[joint]).sum())
                   for run, own in zip(runs, courses, strict=True) for joint in joints)

    return float(tried[int(np.argmin([left(late) for late in tried.tolist()]))])


def _replay(run: RobotRun, courses: Mapping[str, Mapping[str, Array]], late: Mapping[str, float],
            joints: Sequence[str]) -> Replay:
    time = run.motion.time
    simulated = {name: {joint: np.interp(time - late[name], run.time, own[joint]) for joint in joints}
                 for name, own in courses.items()}
    return Replay(run=run, time=time, measured={joint: run.motion.measured[joint] for joint in joints},
                  simulated=simulated, kinds={joint: _kinds(run, joint) for joint in joints})


def _kinds(run: RobotRun, joint: str) -> dict[str, Mask]:
    """Return when a joint moves, rests, and has a load."""
    time, measured, mount = run.motion.time, run.motion.measured[joint], run.mounts[joint]
    few = min(2, (len(time) - 1) // 2)  # samples to either side
    ends = np.clip(np.arange(len(time))[:, None] + np.array([-few, few]), 0, len(time) - 1).T
    way = np.maximum(np.abs(measured[ends[1]] - measured[ends[0]]), np.abs(np.diff(run.goal(joint)[
        np.searchsorted(run.time, time[ends]).clip(0, len(run.time) - 1)], axis=0)[0]))
    moves = way > _MOVES * (time[ends[1]] - time[ends[0]])
    stall = FullDrive(supplied(mount.model, run.supply_of(joint))).torque(0.0) / abs(mount.gain)
    loaded = np.abs(np.interp(time, run.time, run.ideal.torque[joint])) > _LOADED * stall
    return {ALL: np.ones(len(time), np.bool_), MOVING: moves, RESTING: ~moves, LOADED: loaded}


def _error(replays: Sequence[Replay], name: str, joint: str, kind: str) -> JointError:
    found = np.concatenate([(one.simulated[name][joint] - one.measured[joint])[one.kinds[joint][kind]]
                            for one in replays])
    if not found.size:
        return JointError(math.nan, math.nan, math.nan, 0)
    return JointError(math.sqrt(float(np.mean(found**2))), float(np.abs(found).max()), float(found.mean()), found.size)


def _windows(replays: Sequence[Replay], joints: Sequence[str]) -> tuple[Window, ...]:
    """Return the worst second of each joint, the worst first."""
    return tuple(sorted((max((_worst(k, one, joint) for k, one in enumerate(replays)), key=lambda w: w.rms)
                         for joint in joints), key=lambda w: -w.rms))


def _worst(number: int, replay: Replay, joint: str) -> Window:
    time, squares = replay.time, (replay.simulated[SERVOS][joint] - replay.measured[joint])**2
    ends = np.searchsorted(time, time + WINDOW)
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    starts = np.arange(len(time))
    whole = (ends - starts) >= min(0.9 * WINDOW / float(np.median(np.diff(time))), len(time))
    means = np.where(whole, (sums[ends] - sums[starts]) / np.maximum(ends - starts, 1), -1.0)
    a = int(np.argmax(means))
    inside = slice(a, int(ends[a]))
    kinds = replay.kinds[joint]
    kind = MOVING if kinds[MOVING][inside].mean() > 0.5 else RESTING
    more = f", {LOADED}" if kinds[LOADED][inside].mean() > 0.5 else ""
    return Window(number, joint, float(time[a]), float(time[ends[a] - 1]), math.sqrt(max(float(means[a]), 0.0)),
                  kind + more)
