"""Residuals of a robot's joints in units of noise, and how they change with every number.

Noise of a joint is that of its positions, and that of the clock: a row whose stamp is off by some milliseconds is off
at all joints at once, each by its speed. With s the deviation of stamps, v_j the speeds and σ_j the noise of positions,
a row has the covariance diag(σ²) + s² v vᵀ; it is multiplied by the inverse root of that.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.checks import usual_free
from servotwin.identification.fitting.registers import busiest
from servotwin.identification.fitting.search.case import NORMAL, LogPart, robust_deviation
from servotwin.identification.fitting.search.free import Space
from servotwin.logs.log import Log
from servotwin.models import Model
from servotwin.parameters import Servo, Supply
from servotwin.robots import Motion, Mount, joint_names, joint_ranges, read_motion
from servotwin.robots.motion import episodes_of
from servotwin.robots.servos.servo_groups import differing, of_one_form

# --- Recordings of a robot, made ready for a fit: goals and positions of its joints, side by side ---------------------

_FEWEST = 30  # samples
_SAME = 1e-6  # s
_STILL = 2.5e-3  # rad, between samples: a joint that rests
_WINDOW = 0.25  # s, over which measured positions are smoothed


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of a robot.

    Parameters
    ----------
    motion : Motion
    time : ndarray, shape (n,)
        [s]
    goals, measured : ndarray, shape (n, joints)
        [rad]
    angle, speed, acceleration : ndarray, shape (n, joints)
        As smoothed from the measured positions [rad], [rad/s], [rad/s²]
    """

    motion: Motion
    time: Array
    goals: Array
    measured: Array
    angle: Array
    speed: Array
    acceleration: Array

    @property
    def name(self) -> str:
        """Where it was read."""
        return self.motion.source

    def busiest(self, seconds: float) -> NDArray[np.bool_]:
        """Return which samples the part of so many seconds has in which goals go furthest, from rest on."""
        span = busiest(self.time, self.goals, self.measured, _STILL, seconds)
        return np.ones(len(self.time), np.bool_) if span is None else (self.time >= span[0]) & (self.time <= span[1])

    def part(self, rows: NDArray[np.bool_]) -> Episode:
        """Return some samples of it."""
        return replace(self, **{name: getattr(self, name)[rows] for name in (
            "time", "goals", "measured", "angle", "speed", "acceleration")})


def motions_of(logs: Any, plant: Any) -> list[Motion]:
    """Return recorded motions: those of a dataset's or table's path, of logs of joints, or as they are.

    Raises
    ------
    InputError
        If there are none, or they are nothing that was measured of the robot's joints: one line.
    """
    if isinstance(logs, str | Path):
        path = Path(logs)
        return [read_motion(path, joint_names(plant), ranges=joint_ranges(plant), episode=number)
                for number in episodes_of(path)]
    given = [logs] if isinstance(logs, Motion | Log) else list(logs)
    if of_logs := [one for one in given if isinstance(one, Log)]:
        return _of_logs(of_logs)
    motions = [one for one in given if isinstance(one, Motion)]
    if not motions or len(motions) < len(given):
        raise InputError("logs of a robot", got=logs, allowed="a path, motions with measured positions, or logs that "
                         "say their joint (conditions)")
    return motions


def _of_logs(logs: Sequence[Log]) -> list[Motion]:
    """Return the motions of logs of single joints, of which each says its joint and episode."""
    found: dict[str, list[Log]] = {}
    for log in logs:
        if "joint" not in log.conditions or log.command_kind != "angle" or "output_angle" not in log.measured:
            raise InputError(f"log {log.name!r} of a robot", got="no condition joint, no goals or no angle",
                             allowed="logs of joints, such as read_lerobot_logs(...)")
        found.setdefault(f"{log.source}, episode {log.conditions.get('episode', 0.0):.0f}", []).append(log)
    motions = []
    for name, some in found.items():
        first = some[0]
        if any(len(log) != len(first) or np.abs(log.time - first.time).max() > _SAME for log in some):
            raise InputError(f"logs of {name}", got="joints at different times", allowed="the same times")
        robot = str(first.conditions.get("robot", ""))
        motions.append(Motion(time=first.time - first.time[0], source=name, robot=robot,
                              angles={str(log.conditions["joint"]): log.held for log in some},
                              measured={str(log.conditions["joint"]): log.measured["output_angle"] for log in some}))
    return motions


def episodes_from(motions: Sequence[Motion], joints: Sequence[str], servos: Mapping[str, object]) -> list[Episode]:
    """Return episodes of the joints with servos.

    Raises
    ------
    InputError
        If a joint has no goals or positions, or an episode is too short.
    """
    made = []
    for motion in motions:
        for what, there in (("goals", motion.angles), ("measured positions", motion.measured)):
            lacking = [joint for joint in joints if joint not in there]
            if lacking:
                raise InputError(f"{what} of {motion.source}", got=f"none of {', '.join(lacking)}",
                                 allowed=f"all joints with servos: {', '.join(servos)}")
        if len(motion.time) < _FEWEST:
            raise InputError(f"{motion.source}", got=f"{len(motion.time)} samples", allowed=f"at least {_FEWEST}")
        goals, measured = (np.stack([some[joint] for joint in joints], axis=1)
                           for some in (motion.angles, motion.measured))
        made.append(Episode(motion, motion.time, goals, measured, *_smooth(motion.time, measured)))
    if not made:
        raise InputError("logs of a robot", got="none", allowed="at least one episode")
    if all(float(np.ptp(one.measured, axis=0).max()) < 1e-2 for one in made):
        raise InputError("logs of a robot", got="joints that never move", allowed="an episode in which they do")
    return made


def _smooth(time: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Return positions, speeds and accelerations, by parabolas over a window that moves along (Savitzky, Golay)."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(round((time[-1] - time[0]) / step) + 1)
    size = max(2 * round(0.5 * _WINDOW / step) + 1, 5)
    table = np.stack([np.interp(even, time, column) for column in measured.T], axis=1)
    found = []
    for order in range(3):
        smooth = savgol_filter(table, min(size, 2 * ((len(even) - 1) // 2) + 1), 3, deriv=order, delta=step, axis=0)
        found.append(np.stack([np.interp(time, even, column) for column in smooth.T], axis=1))
    return found[0], found[1], found[2]


# --- Numbers ----------------------------------------------------------------------------------------------------------

VOLTAGE, RESISTANCE, LATENCY, CLOCK = (
    "supply.open_circuit_voltage", "supply.internal_resistance", "latency", "clock")
GAIN = "firmware.proportional_gain"
QUANTUM, FINER = "firmware.angle_quantum", 64.0
ZERO_SCALE, LATENCY_SCALE, OHM_SCALE, CLOCK_SCALE = 0.02, 0.01, 0.1, 0.01  # rad, s, ohm, share
_ZERO_STD = 0.05  # rad: how far a horn may sit off
_VOLTAGE_STD = 0.03
_LEAST_STD, _ANY_STD = 0.1, 0.7  # of logarithms: of what a file says how far it may be off, and of all else
_MOTOR, _MOTOR_STD = ("motor.armature_resistance", "output_torque_constant"), 0.15  # that sheets tell fairly
_LATENCIES = (-0.03, 0.2)  # s
_CLOCKS = (-0.03, 0.15)  # share by which turns take longer than stamps say; believed to be within its scale
_GAINS, GAIN_STD = math.log(10.0), 1.5  # how far a gain may be off its register's, either way, and is believed to be
_NUMBERS_MOST_ZERO, _MOST_OHMS, _USUAL_OHMS = 0.35, 2.0, 0.1  # rad, ohm: at most, and of wires that nobody has measured


class Number(NamedTuple):
    """One number of the fit.

    Parameters
    ----------
    name : str
    unit : str
    start, lower, upper : float
        On its scale.
    belief : float
        Standard deviation about the start, on its scale; inf: none.
    scale : float
        Value of 1 on its scale, or of exp(0) where it is logarithmic (SI).
    logarithmic : bool
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    belief: float
    scale: float
    logarithmic: bool

    def value(self, x: float) -> float:
        """Return the value (SI)."""
        return self.scale * math.exp(x) if self.logarithmic else self.scale * x


@dataclass(frozen=True, eq=False)
class Group:
    """Joints whose servos are equal but for registers."""

    name: str
    joints: tuple[int, ...]
    space: Space


class Numbers:
    """All numbers of the fit of a robot.

    Parameters
    ----------
    mounts : mapping of str to Mount
        By joint.
    links : sequence of str
        Names of the links whose masses are searched; none where they are known.
    bus : Supply, optional
        That all servos share.
    each : bool
        Whether every joint's servo is searched by itself; else one for all that are equal.
    masses : float
        How far the masses of the file may be off, as a share: standard deviation; bounds are three times as far.
    free : sequence of str, optional
        Of the servos; what angles can tell unless given.
    zeros : bool
        Whether the joints' zeros are searched.
    gains : sequence of str
        Joints whose servos' proportional gain may be other than their registers say.
    counted : bool
        Whether stamps count turns of a loop, and so do not say how long these took.
    """

    def __init__(self, mounts: Mapping[str, Mount], links: Sequence[str], bus: Supply | None, *, each: bool = False,
                 masses: float = 0.1, free: Sequence[str] | None = None, zeros: bool = True,
                 gains: Sequence[str] = (), counted: bool = False) -> None:
        alike = of_one_form([mount.model for mount in mounts.values()])
        self.mounts = {joint: Mount(model, mount.zero, mount.direction, mount.ratio)
                       for (joint, mount), model in zip(mounts.items(), alike, strict=True)}
        self.joints, self.bus = tuple(mounts), bus
        self.links = tuple(links)
        self.groups = self._groups(each, free)
        numbers: list[Number] = []
        self._at: dict[str, slice] = {}
        for group in self.groups:
            self._at[group.name] = slice(len(numbers), len(numbers) + len(group.space))
            numbers += self._of_servo(group)
        if bus is not None and bus.open_circuit_voltage is not None:
            volts = float(bus.open_circuit_voltage)
            numbers.append(Number(VOLTAGE, "V", 0.0, -0.4, 0.4, _VOLTAGE_STD, volts, True))
            ohms, most = (bus.internal_resistance or _USUAL_OHMS) / OHM_SCALE, _MOST_OHMS / OHM_SCALE
            numbers.append(Number(RESISTANCE, "ohm", ohms, 0.0, most, max(ohms, 1.0), OHM_SCALE, False))
        if masses > 0.0:
            numbers += [Number(f"mass.{link}", "1", 0.0, -3.0 * masses, 3.0 * masses, masses, 1.0, True)
                        for link in self.links]
        if zeros:
            most = _NUMBERS_MOST_ZERO / ZERO_SCALE
            numbers += [Number(f"zero.{joint}", "rad", 0.0, -most, most,
                               _ZERO_STD / ZERO_SCALE, ZERO_SCALE, False) for joint in self.joints]
        numbers += [Number(f"gain.{joint}", "1", 0.0, -_GAINS, _GAINS, GAIN_STD, 1.0, True) for joint in gains]
        numbers.append(Number(LATENCY, "s", 1.0, _LATENCIES[0] / LATENCY_SCALE, _LATENCIES[1] / LATENCY_SCALE, math.inf,
                              LATENCY_SCALE, False))
        if counted:
            numbers.append(Number(CLOCK, "1", 0.0, _CLOCKS[0] / CLOCK_SCALE, _CLOCKS[1] / CLOCK_SCALE, 1.0,
                                  CLOCK_SCALE, False))
        self.all = tuple(numbers)
        self.names = tuple(one.name for one in numbers)
        self.start = np.array([one.start for one in numbers])
        self.lower, self.upper = (np.array([getattr(one, side) for one in numbers]) for side in ("lower", "upper"))
        self.weight = np.array([1.0 / one.belief for one in numbers])

    def __len__(self) -> int:
        return len(self.all)

    def _groups(self, each: bool, free: Sequence[str] | None) -> tuple[Group, ...]:
        found: dict[str, list[int]] = {}
        for k, (joint, mount) in enumerate(self.mounts.items()):
            found.setdefault(joint if each else mount.model.servo.name, []).append(k)
        made = []
        for name, joints in found.items():
            model = self.mounts[self.joints[joints[0]]].model
            names = list(free) if free is not None else arm_free(model)
            made.append(Group(name, tuple(joints), Space(model, names, priors="servo")))
        return tuple(made)

    def _of_servo(self, group: Group) -> list[Number]:
        prefix = f"{group.name}: " if len(self.groups) > 1 else ""
        found = []
        for p in group.space.parameters:
            said = p.scaled_prior
            usual = _MOTOR_STD if p.name in _MOTOR else _ANY_STD
            std = max(said[1], _LEAST_STD) if said is not None and p.logarithmic else usual
            found.append(Number(prefix + p.name, p.unit, p.scaled(p.start), p.scaled(p.lower) if p.lower > 0.0
                                or not p.logarithmic else -20.0, p.scaled(p.upper),
                                std if p.logarithmic else 2.0, p.scale, p.logarithmic))
        return found

    # --- what a point means -------------------------------------------------------------------------------------------

    def _value(self, x: Array, name: str, otherwise: float) -> float:
        return self.all[self.names.index(name)].value(float(x[self.names.index(name)])) if name in self.names \
            else otherwise

    def latency(self, x: Array) -> float:
        """Return how much later goals act than positions of their row are read [s]."""
        return self._value(x, LATENCY, 0.0)

    def turn(self, x: Array) -> float:
        """Return how many times as long as stamped a turn of the loop takes."""
        return 1.0 + self._value(x, CLOCK, 0.0)

    def zeros(self, x: Array) -> Array:
        """Return by how much the joints of the robot are ahead of what is measured, shape (joints,) [rad]."""
        return np.array([self._value(x, f"zero.{joint}", 0.0) for joint in self.joints])

    def masses(self, x: Array) -> Array:
        """Return how many times as heavy as in the file the links are, shape (links,)."""
        return np.array([self._value(x, f"mass.{link}", 1.0) for link in self.links])

    def supply(self, x: Array) -> Supply | None:
        """Return the shared supply."""
        if self.bus is None:
            return None
        return Supply(open_circuit_voltage=self._value(x, VOLTAGE, 0.0) or self.bus.open_circuit_voltage,
                      internal_resistance=self._value(x, RESISTANCE, 0.0) or None,
                      current_limit=self.bus.current_limit)

    def servo(self, x: Array, joint: int) -> Servo:
        """Return the servo of a joint at a point."""
        group = next(one for one in self.groups if joint in one.joints)
        servo = self.mounts[self.joints[joint]].model.servo
        columns = group.space.columns(x[None, self._at[group.name]])
        values = {name: float(column[0]) for name, column in columns.items()}
        share = self._value(x, f"gain.{self.joints[joint]}", 1.0)
        if share != 1.0:
            values[GAIN] = share * float(servo.get(GAIN))  # type: ignore[arg-type]
        return servo.replace(values, source="where a search of a fit stands")

    def mounts_at(self, x: Array, *, fine: bool = False) -> dict[str, Mount]:
        """Return all servos at a point, as they sit at their joints; zeros are in the mounts, for servos count.

        Parameters
        ----------
        x : ndarray
        fine : bool
            With counts so fine that derivatives do not show them.
        """
        found = {}
        for k, (name, mount) in enumerate(self.mounts.items()):
            servo = self.servo(x, k)
            quantum = servo.get(QUANTUM)
            if fine and isinstance(quantum, float) and quantum > 0.0:
                servo = servo.replace({QUANTUM: quantum / FINER})
            found[name] = Mount(type(mount.model)(servo), mount.zero + float(self.zeros(x)[k]), mount.direction,
                                mount.ratio)
        return found

    def columns(self, x: Array) -> list[dict[str, Array]]:
        """Return the searched parameters of each joint's servo at points x, shape (copies, numbers)."""
        found: list[dict[str, Array]] = [{} for _ in self.joints]
        for group in self.groups:
            own = group.space.columns(x[:, self._at[group.name]])
            for joint in group.joints:
                found[joint] = dict(own)
        if VOLTAGE in self.names:
            volts = np.array([self._value(one, VOLTAGE, 0.0) for one in x])
            ohms = np.array([self._value(one, RESISTANCE, 0.0) for one in x])
            for one in found:
                one |= {VOLTAGE: volts, RESISTANCE: ohms}
        if any(name.startswith("gain.") for name in self.names):
            for name, mount, own in zip(self.joints, self.mounts.values(), found, strict=True):
                said = float(mount.model.servo.get(GAIN))  # type: ignore[arg-type]
                own[GAIN] = said * np.array([self._value(at, f"gain.{name}", 1.0) for at in x])
        return found

    def value(self, k: int, x: float) -> float:
        """Return the value of a number (SI)."""
        return self.all[k].value(x)


def arm_free(model: Model) -> list[str]:
    """Return what is searched of a servo in an arm: what angles tell of its plant, play and friction under load too."""
    more = [name for name in ("gear.backlash", "friction.load_friction", "friction.load_friction_motor",
                              "friction.load_friction_external") if model.servo.get(name)]
    return [*(name for name in usual_free(model) if not name.startswith("firmware.")), *more]


def model_columns(models: Sequence[Model], columns: Sequence[Mapping[str, Array]], copies: int, *,
                  fine: bool = False) -> dict[str, Any]:
    """Return parameters of lanes, copies by joints: what is searched, and what differs among the joints' servos.

    Parameters
    ----------
    models : sequence of Model
        Of the joints.
    columns : sequence of mapping
        Searched parameters of each joint, arrays (copies,).
    copies : int
    fine : bool
        With counts so fine that derivatives do not show them.
    """
    joints = [f"{k + 1}" for k in range(len(models))]
    searched = list(dict.fromkeys(name for one in columns for name in one))
    unlike = differing(models, joints)
    made: dict[str, Any] = {name: np.tile(np.array(unlike[name]), copies) for name in unlike if name not in searched}
    for name in searched:
        said = [np.full(copies, model.value_or(name, 0.0)) for model in models]
        made[name] = np.stack([one.get(name, said[k]) for k, one in enumerate(columns)], axis=1).ravel()
    counts = [model.value_or(QUANTUM, 0.0) for model in models]
    if fine and all(count > 0.0 for count in counts):
        made[QUANTUM] = np.tile(np.array(counts) / FINER, copies)
    return made


# --- Copies of a robot, at points of the numbers that are searched ----------------------------------------------------

class Copies(ABC):
    """Simulators of the joints of an episode at several points.

    Parameters
    ----------
    plant : MjModel
    numbers : Numbers
    links : sequence of int
        Bodies whose masses are searched.
    look : callable
        Called while it simulates; may raise.
    """

    def __init__(self, plant: Any, numbers: Numbers, links: Sequence[int],
                 look: Callable[[], object] = lambda: None) -> None:
        self.plant, self.numbers, self.links, self.look = plant, numbers, list(links), look

    @abstractmethod
    def angles(self, episode: Episode, points: Array, *, fine: bool = False) -> Array:
        """Return where the joints are at the stamps of an episode, shape (copies, n, joints) [rad].

        nan where a simulation failed; `fine` without the counts of the servos.
        """


# --- Residuals of a robot's joints in units of noise, and how they change with every number ---------------------------

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_MOST, _MOST_ZERO, _LEAST_STEP = 0.1, 0.03, 1e-3  # of a number on its scale, of a zero [rad]; of either
_SEEN = 1.0  # times the noise: what a step for a derivative is to change
_BEGIN = 0.6  # s: until then an episode still shows how it began
_LEAST = 2.0e-4  # rad
_FAST = 0.3  # rad/s
_SURE = 2.0  # times its noise, of a derivative's power: nothing below
_MOST_OFF = 0.02  # s
_COARSE, _COUNTED = 0.01, 0.05  # rad, of a count


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of positions of each joint [rad], and of stamps [s]."""

    positions: Array
    stamps: float


def quantum_of(positions: Sequence[Array]) -> float:
    """Return the step in which positions were counted [rad]; 0 where they do not look counted.

    Examples
    --------
    >>> round(quantum_of([np.round(np.sin(np.linspace(0.0, 3.0, 99)) / 0.002) * 0.002]), 4)
    0.002
    """
    steps = np.concatenate([np.abs(np.diff(one)) for one in positions])
    some = steps[steps > 1e-6]
    least = float(some.min(initial=math.inf))
    if not some.size or least > _COARSE:
        return 0.0
    return least if float(np.abs(some / least - np.round(some / least)).max()) < _COUNTED else 0.0


def used_rows(episode: Episode) -> Mask:
    """Return which samples of an episode count before anything is known of it, shape (n, joints)."""
    return np.repeat((episode.time >= episode.time[0] + _BEGIN)[:, None], episode.measured.shape[1], axis=1)


def noise_of(episodes: Sequence[Episode], residuals: Sequence[Array], used: Sequence[Mask]) -> Noise:
    """Return the noise that residuals show, robust: at rest that of positions, in motion that of stamps too."""
    joints, positions, off = episodes[0].measured.shape[1], [], []
    for j in range(joints):
        r = np.concatenate([one[mask[:, j], j] for one, mask in zip(residuals, used, strict=True)])
        v = np.concatenate([e.speed[mask[:, j], j] for e, mask in zip(episodes, used, strict=True)])
        still = np.abs(v) < _FAST
        sigma = max(robust_deviation(r[still] if still.sum() > 20 else r), _LEAST,
                    quantum_of([e.measured[:, j] for e in episodes]) / math.sqrt(12.0))
        positions.append(sigma)
        if (~still).sum() > 20:
            more = np.maximum(r[~still]**2 - sigma**2, 0.0) / v[~still]**2
            off.append(np.sqrt(float(np.median(more))) * NORMAL)
    return Noise(np.array(positions), min(float(np.median(off)) if off else 0.0, _MOST_OFF))


def spread_of(residuals: Sequence[Array], used: Sequence[Mask]) -> float:
    """Return how far residuals spread: the mean logarithm of the joints' rms, of noise that is not known yet."""
    r, mask = np.concatenate(list(residuals)), np.concatenate(list(used))
    squares = (np.where(mask, r, 0.0)**2).sum(axis=0) / np.maximum(mask.sum(axis=0), 1)
    return float(np.mean(0.5 * np.log(squares + _LEAST**2)))


def whitened(values: Array, episode: Episode, noise: Noise, used: Mask) -> Array:
    """Return residuals or derivatives, shape (n, joints, …), in units of noise; 0 where a sample does not count."""
    sigma = noise.positions
    u = used * (noise.stamps * episode.speed / sigma)
    s = (u**2).sum(axis=1)
    share = np.where(s > 1e-12, (1.0 - 1.0 / np.sqrt(1.0 + s)) / np.maximum(s, 1e-12), 0.0)
    flat = (values.reshape(*values.shape[:2], -1) / sigma[:, None]) * used[..., None]
    along = np.einsum("nj,njp->np", u, flat)
    return np.asarray((flat - share[:, None, None] * u[..., None] * along[:, None, :]).reshape(values.shape))


def residuals(simulated: Copies, episode: Episode, points: Array) -> Array:
    """Return simulated less measured angles at several points, shape (copies, n, joints)."""
    return simulated.angles(episode, points) - episode.measured


class Linear(NamedTuple):
    """An episode about a point.

    Parameters
    ----------
    residual : ndarray, shape (n, joints)
        [rad]
    slopes : ndarray, shape (n, joints, numbers)
        Derivatives.
    scatter : ndarray, shape (n, joints, numbers)
        Half of what steps either way differ by: what their noise is; 0 of steps one way.
    """

    residual: Array
    slopes: Array
    scatter: Array


def usual_steps(numbers: Numbers) -> Array:
    """Return the longest steps for derivatives, on the scales of numbers: servos stick and slip over short ones."""
    return np.array([_MOST_ZERO / one.scale if one.unit == "rad" and not one.logarithmic else _MOST
                     for one in numbers.all])


def steps_by(usual: Array, slopes: Array) -> Array:
    """Return steps for derivatives that change an episode by about its noise, or the usual ones if these change less.

    An arm near what its servos can carry answers a tenth less resistance by a fall. That is no derivative, and no sum
    of such says that resistance, masses and friction together are only the scale of all torques.

    Parameters
    ----------
    usual : ndarray, shape (numbers,)
    slopes : ndarray, shape (m, numbers)
        In units of noise.

    Examples
    --------
    >>> steps_by(np.array([0.1, 0.1]), np.array([[50.0, 1.0], [-50.0, 0.0]])).tolist()
    [0.02, 0.1]
    """
    size = np.sqrt(np.mean(slopes**2, axis=0))
    return np.asarray(np.clip(_SEEN / np.maximum(size, 1e-300), _LEAST_STEP / _MOST * usual, usual))


def linear_at(simulated: Copies, episode: Episode, x: Array, held: Mask, steps: Array, *,
              central: bool = False) -> Linear:
    """Return residuals at a point and their derivatives by differences of such steps, one way or central."""
    numbers = simulated.numbers
    moved = [k for k in range(len(x)) if not held[k] and numbers.names[k] != LATENCY]
    ways = [np.where(x + side * steps > numbers.upper, -0.5 * side, np.where(
        x + side * steps < numbers.lower, -0.5 * side, side)) * steps for side in ((1.0, -1.0) if central else (1.0,))]
    points = np.repeat(x[None], 1 + len(ways) * len(moved), axis=0)
    for k, way in enumerate(ways):
        points[1 + k * len(moved) + np.arange(len(moved)), moved] += way[moved]
    smooth = simulated.angles(episode, points, fine=True)
    sides = [np.moveaxis((smooth[1 + k * len(moved):1 + (k + 1) * len(moved)] - smooth[0]) / way[moved][:, None, None],
                         0, -1) for k, way in enumerate(ways)]
    slopes, scatter = np.zeros((2, *smooth.shape[1:], len(x)))
    slopes[..., moved] = np.mean(sides, axis=0)
    if central:
        scatter[..., moved] = 0.5 * (sides[0] - sides[1])
    late = numbers.names.index(LATENCY)
    if not held[late]:
        slopes[..., late] = -np.gradient(smooth[0], episode.time, axis=0) * numbers.all[late].scale
    return Linear(residuals(simulated, episode, x[None])[0], slopes, scatter)


def beyond_scatter(slopes: Array, scatter: Array) -> Array:
    """Return what makes derivatives of directions that are no more than their noise nothing, shape (numbers, numbers).

    Simulated servos stick and slip, and count: differences have a noise, which would look like knowledge. With A the
    product sum of the derivatives and N that of their noise, a direction v counts by 1 − vᵀNv/vᵀAv of what it has.

    Parameters
    ----------
    slopes, scatter : ndarray, shape (m, numbers)
        In units of noise.
    """
    from scipy.linalg import eigh

    A, N = slopes.T @ slopes, scatter.T @ scatter
    scale = 1.0 / np.sqrt(np.maximum(np.diag(A), 1e-12 * max(float(np.diag(A).max(initial=0.0)), 1e-300)))
    A, N = A * np.outer(scale, scale), N * np.outer(scale, scale)
    values, vectors = eigh(A, N + 1e-6 * np.eye(len(A)))
    left = np.sqrt(np.clip(1.0 - _SURE / np.maximum(values, 1e-300), 0.0, 1.0))
    return np.asarray((scale[:, None] * vectors) @ (left[:, None] * np.linalg.inv(scale[:, None] * vectors)))


def parts_of(episode: Episode, residual: Array, slopes: Array | None, noise: Noise, used: Mask) -> list[LogPart]:
    """Return what an episode says, joint by joint, in units of noise."""
    r = whitened(residual, episode, noise, used)
    s = np.zeros((*residual.shape, 0)) if slopes is None else whitened(slopes, episode, noise, used)
    return [LogPart(r[mask, j], s[mask, j], np.zeros((int(mask.sum()), 0))) for j, mask in enumerate(used.T)
            if mask.any()]


# --- Windows of an episode that no numbers explain: contact, a hand, an object between the fingers --------------------

_OVER = 0.2  # s, whose mean residual counts
_BESIDE = 0.2  # s, left out before and after
_FAR, _WINDOWS_LEAST = 12.0, math.radians(1.0)  # times the noise, and at least
_USUAL = 6.0  # times what residuals usually are
_WINDOWS_MOST = 0.25  # of all samples


class LeftOut(NamedTuple):
    """A window that does not count: number and name of the episode, start and stop [s], and whose joint shows it."""

    number: int
    episode: str
    start: float
    stop: float
    joint: str

    def __str__(self) -> str:
        """Return a line."""
        return (f"left out: {self.start:.2f} to {self.stop:.2f} s of {self.episode}: {self.joint} does what neither "
                "servo nor arm explains, as where it touches something or a hand leads it")


def strange_windows(episodes: Sequence[Episode], residuals: Sequence[Array], used: Sequence[Mask], noise: Noise,
                    joints: Sequence[str]) -> tuple[LeftOut, ...]:
    """Return windows in which residuals are far beyond noise and what they are elsewhere; none where these are many."""
    found: list[LeftOut] = []
    size = 0.0
    for number, (episode, residual, mask) in enumerate(zip(episodes, residuals, used, strict=True)):
        few = max(round(_OVER / float(np.median(np.diff(episode.time)))), 1)
        kernel = np.ones(few) / few
        for j, joint in enumerate(joints):
            mean = np.abs(np.convolve(np.where(mask[:, j], residual[:, j], 0.0), kernel, mode="same"))
            usual = float(np.median(mean[mask[:, j]])) if mask[:, j].any() else 0.0
            strange = mean > max(_FAR * float(noise.positions[j]), _WINDOWS_LEAST, _USUAL * usual)
            ends = np.flatnonzero(np.diff(np.concatenate(([False], strange, [False]))))
            stretches = list(zip(ends[::2].tolist(), (ends[1::2] - 1).tolist(), strict=True))
            for a, b in stretches:
                start, stop = episode.time[a] - _BESIDE, episode.time[b] + _BESIDE
                found.append(LeftOut(number, episode.name, max(float(start), 0.0), float(stop), joint))
                size += float(stop - start)
    whole = sum(episode.motion.duration for episode in episodes)
    return tuple(found) if size < _WINDOWS_MOST * whole * len(joints) else ()


def without(used: Sequence[Mask], episodes: Sequence[Episode], windows: Sequence[LeftOut],
            joints: Sequence[str]) -> list[Mask]:
    """Return which samples count where windows are left out: of the joint that shows it, and of those before it."""
    found = [mask.copy() for mask in used]
    for window in windows:
        time = episodes[window.number].time
        found[window.number][(time >= window.start) & (time <= window.stop), :joints.index(window.joint) + 1] = False
    return found
