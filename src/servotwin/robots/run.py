"""`run_motion`: a robot whose servos follow a motion, and how well they do."""

from __future__ import annotations

import contextlib
import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, SimulationError, UnknownNameError
from servotwin.models import Model
from servotwin.parameters.groups import Supply
from servotwin.parameters.registers.held import as_robot_has_it, said_of, set_of_robot
from servotwin.robots.drive import ServoDrive
from servotwin.robots.model_file import joint_names, joint_ranges, plant_of
from servotwin.robots.motion import Motion
from servotwin.robots.overlaps import fall_of, leave_out, links_of, overlap_words, overlaps, robot_bodies
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.command_map import unused_ranges
from servotwin.robots.servos.coupling import couple, couplings_of, led
from servotwin.robots.servos.mount import Mount, supplied, warm_mounts
from servotwin.robots.servos.record import FROM_NOWHERE, Record
from servotwin.robots.tracking import IdealRun, Tracking, blend_window, ideal_run, tracking_of
from servotwin.simulation.progress import Progress, shown
from servotwin.simulation.remarks import NOT_AT_REST, Sag, floor_of, held_back, may_fall, sag_in, watches_its_supply
from servotwin.units import is_finite

# --- Oddities of a motion ---------------------------------------------------------------------------------------------

_SLACK = math.radians(0.5)  # rad, of ends that goals are rounded to


def notes_of(run: RobotRun) -> tuple[str, ...]:
    """Return sentences on what was assumed of servos, goals out of reach, collisions, energies, and joints that swing.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots import Motion, run_motion
    >>> high = Motion(time=[0.0, 0.5], angles={"gripper": [1.5, 2.0]}, source="too far")
    >>> run = run_motion("so101", {"gripper": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, high, settle=0.0)
    >>> notes_of(run)
    ('goals of joint gripper go from 85.9 to 115 deg, beyond its range in the model, -10 to 100 deg',)
    """
    said = list(run.said)
    ranges = joint_ranges(run.model)
    for joint in run.motion.joints:
        goals, mount, servo = run.motion.angles[joint], run.mounts[joint], run.mounts[joint].model.servo
        if mount.model.endless:  # such as a bridge without its chip, whose goals are duties
            continue
        lows = [x for x in (servo.stops.lower_angle, servo.firmware.lower_goal) if x is not None]
        highs = [x for x in (servo.stops.upper_angle, servo.firmware.upper_goal) if x is not None]
        angles, ends = (goals - mount.zero) / mount.gain, (max(lows, default=-math.inf), min(highs, default=math.inf))
        if _beyond(angles, ends, _SLACK):
            said.append(f"goals of joint {joint} go {_between(angles, slides=False)} at the servo, beyond "
                        f"what it takes, {_ends(*ends, slides=False)}")
        slides = run.slides(joint)
        if joint in ranges and _beyond(goals, ranges[joint], _SLACK * (mount.ratio if slides else 1.0)):
            said.append(f"goals of joint {joint} go {_between(goals, slides=slides)}, beyond its range in the model, "
                        f"{_ends(*ranges[joint], slides=slides)}")
    said += [words for joints, supply, sag in run.sags for words in _sag_words(run, joints, supply, sag)]
    swings = (f"joint {joint} {remark.words}" for joint in run.mounts for remark in run.tracking[joint].remarks
              if remark.kind == NOT_AT_REST)
    return (*said, *(touch.words for touch in run.ideal.touches), *run.record.notes, *swings)


def _sag_words(run: RobotRun, joints: tuple[str, ...], supply: Supply, sag: Sag) -> list[str]:
    """Return that a supply holds servos back, and that it falls below what is known of them."""
    who = "the supply" if len(joints) == len(run.mounts) else f"the supply of {', '.join(joints)}"
    said = [f"{who} holds back: {held_back(sag).words.partition(': ')[2]}, at {sag.time:.2f} s, of "
            f"{supply.open_circuit_voltage:g} V"] if sag.holds_back else []
    below = {joint: floor_of(run.mounts[joint].model.servo).voltage for joint in joints
             if not watches_its_supply(run.mounts[joint].model)}
    low = [joint for joint, floor in below.items() if sag.voltage < floor]
    if low:
        said.append(f"{who} falls to {sag.voltage:.2f} V: below {below[low[0]]:g} V nobody knows what the servo of "
                    f"{low[0]} does" + (f", and {len(low) - 1} more" if len(low) > 1 else ""))
    return said


def _beyond(values: np.ndarray[tuple[int], np.dtype[np.float64]], ends: tuple[float, float], slack: float) -> bool:
    return bool(values.min() < ends[0] - slack or values.max() > ends[1] + slack)


def _between(values: np.ndarray[tuple[int], np.dtype[np.float64]], *, slides: bool) -> str:
    return f"from {_ends(float(values.min()), float(values.max()), slides=slides)}"


def _ends(low: float, high: float, *, slides: bool) -> str:
    factor, unit = (1e3, "mm") if slides else (math.degrees(1.0), "deg")
    return f"{factor * low:.3g} to {factor * high:.3g} {unit}"


# --- Registers of servos that follow an episode of LeRobot ------------------------------------------------------------

def as_motion_says(mounts: Mapping[str, Mount], motion: Motion) -> tuple[dict[str, Mount], tuple[str, ...]]:
    """Return mounts with the servos as the robot of a motion has them, and a line on what was assumed; none if nothing.

    Parameters
    ----------
    mounts : mapping of str to Mount
    motion : Motion
        Its `robot` says which; empty: nothing is assumed.
    """
    found, changed = dict(mounts), dict[str, str]()
    for joint, mount in mounts.items():
        servo = as_robot_has_it(mount.model.servo, motion.robot, joint)
        if servo is not mount.model.servo:
            found[joint] = replace(mount, model=type(mount.model)(servo))
            changed[joint] = set_of_robot(motion.robot, joint)
    return found, (said_of(motion.robot, *changed.values()),) if changed else ()


# --- `run_motion`: a robot whose servos follow a motion, and how well they do -----------------------------------------

Array = NDArray[np.float64]
SETTLE = 0.5  # s, before the motion and after it
_HOLDS = ("linear", "previous")
_OVERLAPS = ("keep", "ignore")
_LIMIT_SLACK = 1e-6  # rad or m, of limits at which a joint begins
_AFTER = 0.1  # s, for which a robot is followed again beyond the first energy from nowhere, to find its cause
_NO_ENERGY = 1e-6  # J
_MANY = 100  # iterations of a solver
_MOST_TICKS = 2_000_000
_SAME, _SAME_TICKS = 1e-9, 1e-3  # s; of a tick, beside which datasets round their times
_TELL = 50  # ticks between two words on the progress


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotRun:
    """A robot whose servos have followed a motion; its times count from the beginning of the motion.

    Parameters
    ----------
    model : MjModel
        With rotors and gears of the servos.
    motion : Motion
    mounts : mapping of str to Mount
        Of the joints with servos.
    bus : Supply or sequence of tuple (Supply, joints), optional
        That they share.
    record : Record
        Record of the servos, from the settling before the motion to the rest after it.
    poses : ndarray, shape (n, nq)
        Of the robot at the times of the record, MuJoCo's `qpos`.
    ideal : IdealRun
        The same with ideal actuators, at the same times.
    tracking : mapping of str to Tracking
        How well each joint has followed.
    said : tuple of str
        Assumptions about its servos, and changes of the motion and the model, that nobody has asked for; one sentence
        each.
    unjudged : str
        Why nothing can be said about its servos, such as links that lie in each other where the motion begins, or a
        robot that nothing carries; empty if it can.
    lowest : mapping of str to tuple (float, float)
        By joint: the least voltage [V] of the servo's supply from the beginning of the motion on, of all instants, and
        when it came [s].
    """

    model: Any
    motion: Motion
    mounts: Mapping[str, Mount]
    bus: Any
    record: Record
    poses: Array
    ideal: IdealRun
    tracking: Mapping[str, Tracking]
    said: tuple[str, ...] = ()
    unjudged: str = ""
    lowest: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """Times of record and poses [s]."""
        return self.record.time

    def goal(self, joint: str) -> Array:
        """Return where a joint is to be at these times: angle of a hinge [rad], place of a slide [m]."""
        return goal_of(self.motion, joint, self.time, self.ideal)

    def measured(self, joint: str) -> Array | None:
        """Return where the real joint was at these times, nan before and after its episode; None if nobody measured."""
        if joint not in self.motion.measured:
            return None
        return np.interp(self.time, self.motion.time, self.motion.measured[joint], left=math.nan, right=math.nan)

    def measured_error(self, joint: str) -> float:
        """Return how far the simulated joint is from the measured one, rms; nan if nobody measured [rad or m]."""
        measured = self.measured(joint)
        return math.nan if measured is None else math.sqrt(float(np.nanmean(
            (self.record[joint]["joint_angle"] - measured)**2)))

    def slides(self, joint: str) -> bool:
        """Tell whether a joint is a slide."""
        return joint_names(self.model)[joint] == "length"

    @property
    def notes(self) -> tuple[str, ...]:
        """Oddities of the motion, one sentence each."""
        return notes_of(self)

    @property
    def sags(self) -> tuple[tuple[tuple[str, ...], Supply, Sag], ...]:
        """How far supplies fell from the beginning of the motion on: joints, supply, sag.

        For how long they were low is counted among the ends of ticks.
        """
        found: dict[int, list[str]] = {}
        for k, joint in enumerate(self.mounts):
            shared = self.supply_of(joint)
            found.setdefault(k if shared is None else -1 - id(shared), []).append(joint)
        made = []
        for joints in found.values():
            record, model = self.record[joints[0]], self.mounts[joints[0]].model
            supply = self.supply_of(joints[0]) or model.servo.supply
            if "bus_voltage" in record:
                sag = sag_in(self.time[self.time >= 0.0], record["bus_voltage"][self.time >= 0.0], supply,
                             self.lowest.get(joints[0]))
                made += [(tuple(joints), supply, sag)] if sag is not None else []
        return tuple(made)

    def supply_of(self, joint: str) -> Supply | None:
        """Return the supply that a servo shares with others, None where it has its own."""
        return supply_of(self.bus, joint)


def goal_of(motion: Motion, joint: str, time: Array, ideal: IdealRun) -> Array:
    """Return where a joint is to be: on its motion, or where it stands if there is none."""
    return np.asarray(motion.at(joint, time) if joint in motion.angles else ideal.courses[joint].angle)


def supply_of(bus: Any, joint: str) -> Supply | None:
    """Return the supply among those of `bus` that a joint is on."""
    if bus is None or isinstance(bus, Supply):
        return bus
    return next((supply for supply, joints in bus if joint in joints), None)


def run_motion(model: Any, servos: Mapping[str, Model | Mount], motion: Motion, *, bus: Any = None,
               joint_friction: str = "refuse", timestep: float | None = None, settle: float = SETTLE,
               hold: str = "linear", window: float | None = None, assume_heat: bool = True, overlap: str = "keep",
               progress: Progress = False) -> RobotRun:
    """Let the servos of a robot follow a motion, and the same robot with ideal actuators beside.

    The robot begins at the first goals, at rest. A servo without an error gives no torque, so it sinks at first: it is
    given the time `settle` before the motion begins, and the same time after it to come to rest.

    Parameters
    ----------
    model : MjModel, MjSpec, Plant, str or Path
        Of the robot: a copy is changed. A path is of an MJCF or URDF file; "so101" is an arm that comes with the
        package. Links that a joint joins do not touch each other, as `robot_model` says.
    servos : mapping of str to Model or Mount
        By the name of the joint.
    motion : Motion
        Of these joints; those of which it says nothing hold still. Goals of joints that follow others by an equality of
        the model are left out, and the others have to move them too. One that was recorded with an SO-100 or SO-101
        says what LeRobot wrote into the registers of servos that have the factory's here: it is assumed, and a note
        says so.
    bus, joint_friction
        As of `ServoDrive`.
    timestep : float, optional
        Of MuJoCo; unless given the model's own, or as much shorter as lets samples that are held begin with a tick [s]
    settle : float
        [s]
    hold : str
        The command of a servo between samples of the motion: "linear", or "previous", as LeRobot sends goals.
    window : float, optional
        Over which the motion of the ideal actuators is blended; `blend_window` of it unless given [s]
    assume_heat : bool
        Whether servos whose files have no thermal numbers get warm by ones that their mass lets assume.
    overlap : str
        Treatment of other shapes that lie over 1 mm in each other in the first pose or where the motion begins:
        "keep", their contact counts, and the servos are not judged; "ignore", it is left out. The ground is never.
    progress : bool or callable
        Whether to show how far it is; a callable is called with the steps done, and all.

    Raises
    ------
    InputError
        Or one of its kinds: if a joint of the motion has no servo, a goal is beyond where its servo can start, or
        what `ServoDrive` refuses.
    SimulationError
        If a servo or MuJoCo cannot continue.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.robots import Motion, run_motion
    >>> nod = Motion(time=[0.0, 0.2, 0.4], angles={"wrist_flex": [0.0, 0.2, 0.0]}, source="a nod")
    >>> run = run_motion("so101", {"wrist_flex": st.DigitalServo(st.load_servo("feetech-sts3215-12v"))}, nod)
    >>> 0.01 < run.tracking["wrist_flex"].rms < 0.1
    True
    """
    _check(motion, settle, hold, timestep, overlap)
    own, read, _ = plant_of(model)
    own.opt.timestep = timestep or _fitting(own.opt.timestep, motion, hold)
    settle = own.opt.timestep * math.ceil(settle / own.opt.timestep - _SAME_TICKS)  # the motion begins with a tick
    mounts = warm_mounts(servos, assume_heat=assume_heat, shared=bus is not None)
    mounts, assumed = as_motion_says(mounts, motion)
    for joint, mount in mounts.items():
        supplied(mount.model, supply_of(bus, joint))  # raises before anything is run
    motion, said = _led_motion(own, motion, mounts)
    _check_joints(motion, mounts, joint_names(own))
    lying = _lying(own, motion, mounts, overlap)
    controls, ranges = unused_ranges(own, mounts)

    def follow(plant: Any, until: float, tell: Callable[[int], object]) -> tuple[ServoDrive, Any, Array]:
        drive = ServoDrive(plant, mounts, bus=bus, joint_friction=joint_friction, controls=controls,
                           assume_heat=False, watch_supply=falls)  # heat is in the mounts
        return (drive, *_followed(drive, motion, mounts, settle=settle, hold=hold, until=until, tell=tell))

    falls = any(may_fall(supply_of(bus, joint) or mount.model.servo.supply) for joint, mount in mounts.items())
    first = copy.copy(own)
    ticks = len(_times(own.opt.timestep, motion.duration, settle))
    with shown(progress, 2 * ticks, "following the motion") as tell:
        drive, data, poses = follow(own, math.inf, tell)
        done = finished(drive, data, motion, mounts, bus, poses, window=window, tell=lambda k: tell(ticks + k))
    done.record.cause = _cause(done, first, lying.deepest, follow)
    fall = fall_of(own, done.time, done.poses, mounts)
    return replace(done, said=(*read, *lying.said, *([fall.words] if fall else []), *assumed, *said, *ranges),
                   unjudged=lying.unjudged or (fall.words if fall else ""))


class _Lying(NamedTuple):
    """Overlaps of a robot: sentences, the deepest pair where its motion begins, and why nothing is judged."""

    said: tuple[str, ...] = ()
    deepest: str = ""
    unjudged: str = ""


def _lying(model: Any, motion: Motion, mounts: Mapping[str, Mount], overlap: str) -> _Lying:
    """Return what of a robot lies in what, and what begins beyond its limits; leave contacts out if so asked."""
    if not joint_names(model).keys() >= mounts.keys():
        return _Lying()  # the drive says what is wrong with them
    bodies, start, ignored = robot_bodies(model, mounts), model.qpos0.copy(), overlap == "ignore"
    _put(model, start, motion, mounts)
    there = overlaps(model, start, bodies)
    met = {(one.first, one.second) for one in there}
    before = [one for one in overlaps(model, model.qpos0, bodies) if (one.first, one.second) not in met]
    said = []
    for found, when in ((there, "where the motion begins"), (before, "in the first pose")):
        said += [f"{overlap_words(model, one)} {when}" + (
            ": left out of contact" if ignored and links_of(model, [one]) else "") for one in found]
    deepest = said[0] if there else ""
    way = "leaves such contacts out" if links_of(model, there[:1]) else "judges all the same"
    if overlap == "ignore":
        leave_out(model, links_of(model, (*there, *before)))
    for joint, (low, high) in joint_ranges(model).items():
        at = float(start[model.jnt_qposadr[model.joint(joint).id]])
        if joint not in motion.angles and not low - _LIMIT_SLACK <= at <= high + _LIMIT_SLACK:
            said.append(f"joint {joint} begins at {at:.4g}, beyond its range in the model, {low:.4g} to {high:.4g} "
                        "(rad or m)")
    return _Lying(tuple(said), deepest, f"{deepest} (overlap=ignore {way})" if deepest and not ignored else "")


def _followed(drive: ServoDrive, motion: Motion, mounts: Mapping[str, Mount], *, settle: float, hold: str, until: float,
              tell: Callable[[int], object]) -> tuple[Any, Array]:
    """Let a drive follow a motion up to some time [s]; return its data, and the poses at the ends of ticks."""
    step, data = float(drive.model.opt.timestep), load_mujoco().MjData(drive.model)
    time = _times(step, motion.duration, settle)
    time = time[:int(np.searchsorted(time, until))]
    poses = np.zeros((len(time), drive.model.nq))
    begin(drive, data, motion, mounts, -settle)
    first = int(np.searchsorted(time, 0.5 * step))  # tick of the motion
    for k, goals in enumerate(_goals(motion, time - step, hold, 0.5 * step)):
        if drive.watches and k == first:
            drive.watch(data)
        if goals:
            drive.command(data, goals)
        drive.step(data)
        poses[k] = data.qpos
        if k % _TELL == 0:
            tell(k)
    return data, poses


def _cause(done: RobotRun, first: Any, lying: str,
           follow: Callable[[Any, float, Callable[[int], object]], tuple[ServoDrive, Any, Array]]) -> str:
    """Return why energy came from nowhere, found by going there again with more iterations and with shorter steps."""
    times = [remark.time for remark in done.record.remarks if remark.kind == FROM_NOWHERE]
    if not times:
        return ""
    if lying and times[0] < done.time[0] + _AFTER:
        return f"{lying}, and is pushed out of it"
    until = times[0] + _AFTER
    most = float(np.nanmax(done.record.energy_from_nowhere[done.time < until]))
    many = max(_MANY, 4 * int(first.opt.iterations))
    for words, changes in ((f"its solver does not converge: with {many} iterations", {
            "iterations": many, "ls_iterations": max(_MANY, int(first.opt.ls_iterations))}), (
            f"its step is too long: with {500.0 * first.opt.timestep:.3g} ms", {"timestep": 0.5 * first.opt.timestep})):
        plant = copy.copy(first)
        for name, value in changes.items():
            setattr(plant.opt, name, value)
        with contextlib.suppress(SimulationError):
            drive, data, _ = follow(plant, until, lambda k: None)
            left = float(np.nanmax(drive.result(data).energy_from_nowhere))
            if left < 0.5 * most:
                return f"{words} it is {left if left > _NO_ENERGY else 0.0:.2g} J up to {until:.3g} s, not {most:.2g} J"
    return "neither more iterations of its solver nor half the step change that"


def finished(drive: ServoDrive, data: Any, motion: Motion, mounts: Mapping[str, Mount], bus: Any, poses: Array, *,
             window: float | None = None, tell: Callable[[int], object] | None = None) -> RobotRun:
    """Return what servos have done that were recorded in some data, beside the same robot with ideal actuators.

    Parameters
    ----------
    drive : ServoDrive
    data : MjData
        Its record has begun before the motion, which begins at time 0.
    motion, mounts, bus, window
        As of `run_motion`.
    poses : ndarray, shape (n, nq)
        At the times of the record.
    tell : callable, optional
        Called with how many times are done.
    """
    record, lowest = drive.result(data), drive.lowest_voltage(data)
    known = {joint: tuple(lowest[:, k].tolist()) for k, joint in enumerate(drive.joints) if np.isfinite(lowest[0, k])}
    ideal = ideal_run(drive.model, drive.joints, motion, record.time, progress=tell,
                      window=blend_window(motion) if window is None else window)
    return RobotRun(model=drive.model, motion=motion, mounts=mounts, bus=bus, record=record, poses=poses, ideal=ideal,
                    tracking={joint: tracking_of(record[joint], goal_of(motion, joint, record.time, ideal),
                                                 motion.duration, known.get(joint)) for joint in drive.joints},
                    lowest=known)


def _check(motion: Motion, settle: float, hold: str, timestep: float | None, overlap: str) -> None:
    if not isinstance(motion, Motion):
        raise InputError("motion", got=motion, allowed="a Motion, such as read_motion(...)")
    if not (is_finite(settle) and settle >= 0.0):
        raise InputError("settle", got=settle, allowed="a number of seconds that is not negative")
    if hold not in _HOLDS:
        raise InputError("hold", got=hold, allowed=" or ".join(map(repr, _HOLDS)))
    if overlap not in _OVERLAPS:
        raise InputError("overlap", got=overlap, allowed=" or ".join(map(repr, _OVERLAPS)))
    if timestep is not None and not (is_finite(timestep) and timestep > 0.0):
        raise InputError("timestep", got=timestep, allowed="a positive number of seconds")


def _led_motion(model: Any, motion: Motion, mounts: Mapping[str, Mount]) -> tuple[Motion, tuple[str, ...]]:
    """Return a motion without joints that follow others, whose actuators are silenced, and sentences on them."""
    said = []
    for joint, coupling in couplings_of(model).items():
        if joint in mounts:
            continue  # the drive refuses it
        said.append(coupling.words)
        said += [f"actuator {name} at {joint} has no force: the joint follows" for name in led(model, joint)]
        if joint in motion.angles:
            said.append(f"goals of joint {joint} are left out: it follows")
    angles = {joint: goals for joint, goals in motion.angles.items()
              if joint in mounts or joint not in couplings_of(model)}
    if not angles:
        raise InputError(f"joints of {motion.source}", got=", ".join(motion.joints),
                         allowed="one that does not follow others by an equality of the model")
    return replace(motion, angles=angles), tuple(said)


def _check_joints(motion: Motion, mounts: Mapping[str, Mount], joints: Mapping[str, str]) -> None:
    if not joints.keys() >= mounts.keys():
        return  # the drive says what is wrong with them
    for joint, mount in mounts.items():
        if mount.model.endless:
            raise InputError(f"servo of joint {joint}", got="one that turns endlessly",
                             allowed="one that follows a motion: with potentiometer.fixed_angle it is told speeds")
    for joint in motion.joints:
        if joint not in joints:
            raise UnknownNameError(f"joint of {motion.source}", joint, joints)
        if joint not in mounts:
            raise InputError(f"joint {joint} of {motion.source}", got="no servo at it",
                             allowed=f"joints with servos, {', '.join(mounts)}")


def ticks_in(interval: float, timestep: float) -> int:
    """Return in how many ticks, none longer than a timestep, MuJoCo goes over an interval.

    Examples
    --------
    >>> ticks_in(1.0 / 30.0, 2e-3), ticks_in(0.02, 2e-3)
    (17, 10)
    """
    return max(1, math.ceil(interval / timestep - _SAME_TICKS))


def _fitting(timestep: float, motion: Motion, hold: str) -> float:
    """Return a timestep up to another one with which goals that are held act when they are given, not a tick later."""
    if hold != "previous" or len(motion.time) < 2:
        return timestep
    interval = float(np.median(np.diff(motion.time)))
    return interval / ticks_in(interval, timestep)


def _times(timestep: float, duration: float, settle: float) -> Array:
    """Return the ends of all ticks [s]."""
    ticks = math.ceil((duration + 2.0 * settle) / timestep - _SAME)
    if ticks > _MOST_TICKS:
        raise InputError("motion", got=f"{ticks} steps of {timestep:g} s", allowed=f"up to {_MOST_TICKS}")
    return -settle + timestep * np.arange(1.0, ticks + 1.0)


def begin(drive: ServoDrive, data: Any, motion: Motion, mounts: Mapping[str, Mount], time: float) -> None:
    """Put the robot at the first goals at some time [s], let the servos begin there, and record them.

    Raises
    ------
    InputError
        If a servo would have to begin beyond its stops.
    """
    model, goals = drive.model, {}
    _put(model, data.qpos, motion, mounts)
    for joint, mount in mounts.items():
        if not mount.model.endless:  # such as a bridge without its chip, which takes no angle
            goals[joint] = float(data.qpos[model.jnt_qposadr[model.joint(joint).id]])
            _check_travel(joint, mount, goals[joint])
    data.time = time
    load_mujoco().mj_forward(model, data)
    drive.record(data)
    drive.command(data, goals)


def _put(model: Any, qpos: Array, motion: Motion, mounts: Mapping[str, Mount]) -> None:
    """Put joints at the first row of a motion, in place, and those that follow them."""
    for joint in mounts:
        if joint in motion.angles:
            qpos[model.jnt_qposadr[model.joint(joint).id]] = motion.at(joint, 0.0)
    couple(model, qpos)


def _check_travel(joint: str, mount: Mount, start: float) -> None:
    """Raise InputError where a servo would have to begin beyond its stops."""
    stops = mount.model.servo.stops
    low = -math.inf if stops.lower_angle is None else stops.lower_angle
    high = math.inf if stops.upper_angle is None else stops.upper_angle
    angle = (start - mount.zero) / mount.gain
    if not low <= angle <= high:
        raise InputError(
            f"first goal of joint {joint}", got=f"{math.degrees(angle):.4g} deg at the servo",
            allowed=f"{math.degrees(low):.4g} to {math.degrees(high):.4g} deg, the travel of {mount.model.servo.name}: "
            "mount it with another zero or direction")


def _goals(motion: Motion, time: Array, hold: str, near: float) -> Iterator[dict[str, float]]:
    """Give the goals of the servos at each time [s], samples that are so near too; nothing where it stays."""
    if hold == "previous":
        samples = np.clip(np.searchsorted(motion.time, time + near, side="right") - 1, 0, None)
        table = np.array([values[samples] for values in motion.angles.values()])
    else:
        table = np.array([motion.at(joint, time) for joint in motion.joints])
    before = table[:, 0] + math.nan
    for goals in table.T:
        yield {} if (goals == before).all() else dict(zip(motion.joints, goals.tolist(), strict=True))
        before = goals
