"""One log, made ready to be compared with a simulation.

A generator sends a pulse every frame; a command acts from the next pulse on. A log tells when commands were given, on a
clock of its own, and nothing of the pulses. Their phase is therefore two things: a time, in which the motion is smooth,
and an assignment of commands to pulses, which jumps wherever a command and the edge of a pulse pass each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.free import LUMPED, Space
from servotwin.loads import Load
from servotwin.logs.bam_logs import writes_gain
from servotwin.logs.log import KINDS, Log
from servotwin.models import BoundedServo, DigitalServo, Model
from servotwin.parameters import Servo
from servotwin.parameters.registers import REGISTER_FAMILIES
from servotwin.parameters.servo import N
from servotwin.signals.shapes import held_pulses, sampled
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.signals import Signal


# --- Where a search stands, what a log says there, and the numbers that all logs share beside the parameters ----------

NUISANCES = ("delay", "log_delay", "frame_phase", "frame_period", "control_phase", "angle_offset", "angle_sag",
             "initial_state")
SHARED = {"delay": (0.01, "s"), "angle_offset": (0.01, "rad"), "angle_sag": (0.1, "rad/V"), "frame_period": (1e-3, "s")}
"""Nuisances that all logs share: the step that matters, and the unit."""
DELAY_SCALE, OFFSET_SCALE, SAG_SCALE, PERIOD_SCALE = (SHARED[name][0] for name in SHARED)
SPEED_SCALE = 0.1  # rad/s
MOST_DELAY = 0.5  # s
STEP = 1e-4  # of a searched number: over the kinks that sticking makes
FINE = 1e-6  # so little that hardly a kink lies within
WIDE = 0.03  # over many steps of counts and duties, and ticks at which a shaft just sticks, of a program that samples
HUBER = 1.345  # of the noise: as good as least squares to 5 % where the noise is normal (Huber 1964)
NORMAL = 1.4826  # standard deviation over median magnitude of a normal law
LATER = 1e-5  # s, for the time derivative of signals that are no angles


def robust_deviation(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of the normal law whose magnitudes have the median of these, in their unit.

    That is 1.4826 times it (Hampel, JASA 69, 1974); `values` have any shape.
    """
    return NORMAL * float(np.median(np.abs(values)))


class Frames(NamedTuple):
    """Which command each pulse of a log carries, and each tick of a program takes.

    Pulse k carries that of `phase` + k · `period`, from the first sample; ticks come by `tick` later after the first
    pulse than the servo says [s]. When pulses and ticks themselves come is another matter, and continuous; here every
    command changes at a jump.
    """

    phase: float
    period: float
    tick: float = 0.0


class Point(NamedTuple):
    """Where a search stands.

    Parameters
    ----------
    shared : ndarray, shape (p,)
        The searched numbers of `Space`, then those of `SHARED` that are nuisances (scaled).
    own : tuple of ndarray
        Of each log: angle and speed at its start, its own delay, when its first pulse comes (scaled), and when a
        program without pulses looks at the shaft first (in ticks), as far as they are nuisances.
    frames : tuple of Frames
        Of each log, where pulses have a phase; those that a forecast begins with unless given.
    """

    shared: Array
    own: tuple[Array, ...]
    frames: tuple[Frames, ...] = ()


class LogPart(NamedTuple):
    """One log at a point: simulated less measured, and the derivatives of that.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        In units of each sensor's noise.
    shared : ndarray, shape (m, p) or (m, 0)
    own : ndarray, shape (m, l) or (m, 0)
    later : ndarray, shape (m,)
        Effect of a delay: derivative by a scaled delay. Of signals that are no angles only where derivatives or
        rates were asked for.
    """

    residual: Array
    shared: Array
    own: Array
    later: Array = np.zeros(0)


def joined(parts: Sequence[LogPart]) -> Array:
    """Return the derivatives of some logs in one matrix, by shared numbers and those of each log."""
    from scipy.linalg import block_diag

    return np.column_stack([np.concatenate([part.shared for part in parts]), block_diag(*(part.own for part in parts))])


# --- The pulses of a log: when they come, and which command each of them carries --------------------------------------

_EDGE = 1e-9  # of a frame: a command so close to an edge is at it
_NARROW = 1e-6  # s: stamps do not tell commands apart that are nearer


class Gap(NamedTuple):
    """Phases from `low` to `high` [s] for which every pulse carries the same command; high − low is at most a frame."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """The phase that is farthest from both ends [s]."""
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> float:
        """How far apart its ends are [s]."""
        return self.high - self.low


def has_pulses(model: Model) -> bool:
    """Tell whether commands reach a model as pulses: not the mean voltage of the bounded servo, nor goals on a bus."""
    return not isinstance(model, BoundedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)


def changes(log: Log) -> Array:
    """Return when the command changes by a jump, or pulses begin or end, from the first sample [s].

    Examples
    --------
    >>> log = Log(name="a", time=[1.0, 1.1, 1.2], command=[0.0, 0.5, 0.5], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.1, 0.5]})
    >>> [round(float(t), 3) for t in changes(log)]
    [0.1]
    """
    if log.command_hold != "previous":
        return np.zeros(0)
    return np.asarray(log.time[log.changes] - log.time[0])


def gaps(log: Log, period: float) -> tuple[Gap, ...]:
    """Return the phases between which the assignment of commands to pulses jumps, in the order of their low ends.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 0.1, 0.205, 0.3], command=[0.0, 0.5, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.1, 0.5, 1.0]})
    >>> [(round(gap.low, 4), round(gap.high, 4)) for gap in gaps(log, 0.02)]
    [(0.0, 0.005), (0.005, 0.02)]
    """
    return between(changes(log), period)


def between(times: Array, period: float) -> tuple[Gap, ...]:
    """Return the phases of a beat at which none of some times lies, in the order of their low ends."""
    residues = np.sort(np.mod(times, period))
    residues[residues > period * (1.0 - _EDGE)] = 0.0
    residues = np.unique(residues)
    if not len(residues):
        return (Gap(0.0, period),)
    ends = np.append(residues[1:], residues[0] + period)
    wide = ends - residues > min(_NARROW, 0.5 * float((ends - residues).max()))
    return tuple(Gap(float(low), float(high)) for low, high in zip(residues[wide], ends[wide], strict=True))


def widest(log: Log, period: float) -> Frames:
    """Return the frames in which commands are farthest from the edges of pulses."""
    return Frames(max(gaps(log, period), key=lambda gap: gap.width).middle, period)


def gap_of(log: Log, frames: Frames) -> Gap:
    """Return how far the phase of some frames could go with the same assignment [s].

    The low end is in it; the high end is the first phase at which a command comes a pulse earlier.
    """
    residues = np.mod(changes(log), frames.period)
    if not len(residues):
        return Gap(frames.phase - 0.5 * frames.period, frames.phase + 0.5 * frames.period)
    back = np.mod(frames.phase - residues + _EDGE * frames.period, frames.period)
    ahead = np.mod(residues - frames.phase - _EDGE * frames.period, frames.period)
    return Gap(frames.phase - float(back.min()), frames.phase + float(ahead.min()))


def latency(log: Log, frames: Frames) -> float:
    """Return how long a command waits in the mean for its pulse, if pulses come at phase + k · period [s]."""
    times = changes(log)
    if not len(times):
        return 0.0
    k = np.ceil((times - frames.phase) / frames.period - _EDGE)
    return float(np.mean(frames.phase + k * frames.period - times))


def near_edges(log: Log, one: Frames, other: Frames) -> Array:
    """Return when the commands were given that two assignments put into different pulses [s, on the log's clock]."""
    times = changes(log)
    which, also = (np.ceil((times - frames.phase) / frames.period - _EDGE) for frames in (one, other))
    shift = np.median(also - which) if len(times) else 0.0
    return np.asarray(times[also - which != shift] + log.time[0])


def signal(log: Log, frames: Frames, first: float, period: float, lead: float = 0.0) -> Signal:
    """Return the command of a log as pulses: the edges at first + k · period, k from −∞ on, carry those of `frames`.

    Its t = 0 is the first sample, or by `lead` earlier [s], later where that is negative, from when on it is the first
    command. A command that is
    linear between samples is read at the edges themselves.
    """
    least = math.ceil(-(first + lead) / period - _EDGE)
    k = np.arange(least, least + max(math.ceil((log.duration + lead) / period), 0) + 2)
    edges = np.maximum(first + lead + k * period, 0.0)
    time = log.time - log.time[0]
    asked = frames.phase + k * frames.period
    latest = np.maximum(np.searchsorted(time, asked + _EDGE * frames.period, side="right") - 1, 0)
    unit = KINDS[log.command_kind]
    if log.command_hold == "previous":
        # Half a frame early, so that an edge that moves a little carries the same
        return held_pulses(edges - 0.5 * period, log.held[latest], edges[log.sent[latest]], unit=unit,
                           initial=float(log.held[0]))
    made = sampled(time + lead, log.held, unit=unit, hold=log.command_hold)
    return replace(made, initial=float(log.held[0]), edges=tuple(edges[log.sent[latest]].tolist()))


# --- The gain that a log says its servo's loop had, as the firmware has it --------------------------------------------

GAIN = "firmware.proportional_gain"
_REGISTERS = {"feetech-sts": "P_Coefficient", "dynamixel-x": "Position_P_Gain", "dynamixel-mx": "P_Gain",
              "dynamixel-xl320": "P_Gain"}
_LOOP = ("electronics.stretcher_gain", "electronics.one_shot_slope", "electronics.frame_period")
_OF_PULSES = ("electronics.", "potentiometer.")


def with_loop_gain(log: Log, model: Model) -> Log:
    """Return a log of a servo on a bus with the gain of its loop as a number of the firmware.

    A log's condition `gain` is the register for P: of a servo whose sheet names its registers it makes the duty per
    angle as they do, and of others as the log's convention of pulses does, times the error_gain_ratio of a file of
    BAM. Pulses of such a log are left out: a bus servo has none.

    Parameters
    ----------
    log : Log
    model : Model
        Other models, and logs that say their gain themselves or none at all, are left as they are.

    Raises
    ------
    ParameterError
        If the register cannot have this value.
    """
    if not isinstance(model, DigitalServo) or not model.takes_goals:
        return log
    own = {name: value for name, value in log.parameters.items() if not name.startswith(_OF_PULSES)}
    if GAIN not in own:
        gain = _of_registers(model.servo, log)
        gain = _of_pulses(log, model.servo) if gain is None else gain
        own |= {} if gain is None else {GAIN: gain}
    return log if len(own) == len(log.parameters) and GAIN in log.parameters else replace(log, parameters=own)


def _of_registers(servo: Servo, log: Log) -> float | None:
    written, family = log.conditions.get("gain"), str(servo.sheet.get("registers", ""))
    if not is_finite(written) or family not in _REGISTERS or not writes_gain(log.conditions.get("motor")):
        return None
    value = REGISTER_FAMILIES[family]({_REGISTERS[family]: written}, servo=servo).get(GAIN)  # type: ignore[dict-item]
    return float(value) if isinstance(value, int | float) else None


def _of_pulses(log: Log, servo: Servo) -> float | None:
    """Return the duty per angle of a chip that stretches K s_µ per angle in each frame [1/rad]."""
    K, s_mu, T_f = (log.parameters.get(name) for name in _LOOP)
    p = log.parameters.get("potentiometer.feedback_gain")
    rig = servo.sheet.get("bam")
    ratio = rig.get("error_gain_ratio", 1.0) if isinstance(rig, Mapping) else 1.0
    return None if K is None or s_mu is None or T_f is None or p is None else K * s_mu * p / T_f * ratio


# --- One log, made ready to be compared with a simulation -------------------------------------------------------------

Array = NDArray[np.float64]
_FRAME_PERIOD, _TICK = "electronics.frame_period", "firmware.control_period"
_JUMPS = ("armature_current", "supply_current", "bus_voltage")
_UNKNOWN = 0.1  # s, more than the delay of a servo and its bus
_UNSURE = 3.0  # times what five samples scatter, which is known no better
TIME = "time"  # of the noise: how far off the times of pulses, ticks and samples are, one by one [s]
_RATE_OVER = 0.02  # s, at least: differences of neighbours would be those of their noise
_LASTS = 0.1  # s: what came early or late leaves an error, until the loop has taken it away
_STANDS = 0.1  # s, at least, without a new goal
_FROM_REST = 0.5  # of its slope over five samples: what a shaft that begins from rest has over three


@dataclass(frozen=True)
class Case:
    """One log, ready to be compared.

    Parameters
    ----------
    log : Log
    signal : Signal
        Its command.
    times : ndarray, shape (k,)
        Instants that count for any sensor, from the first sample of the log [s].
    places : mapping of str to ndarray of int
        Which of them count for a sensor.
    values : mapping of str to ndarray
        Values that the sensor measured there (SI).
    start : tuple of float
        Angle [rad] and speed [rad/s] at the first sample as measured.
    scatter : float
        How far that angle may be off [rad].
    moving : bool
        Whether the start speed differs from 0 visibly.
    key : tuple
        Cases of one key may be simulated together.
    period : float
        T_f that log or servo say [s]; 0 of a model without pulses.
    leans : float
        To which side of the gear's play the motor lies at first: -1 or 1; 0 in the middle, where the log does not tell.
    tick : float
        T_c of a program that works on goals [s]; 0 of other servos.
    """

    log: Log
    signal: Signal
    times: Array
    places: dict[str, NDArray[np.int64]]
    values: dict[str, Array]
    start: tuple[float, float]
    scatter: float
    moving: bool
    key: tuple[Any, ...] = field(repr=False)
    period: float = 0.0
    leans: float = 0.0
    tick: float = 0.0

    @property
    def count(self) -> int:
        """Number of measured values that count."""
        return sum(len(place) for place in self.places.values())

    def sigma(self, name: str, noise: Mapping[str, float]) -> Array | float:
        """Return the noise of a sensor's values (SI); that of times counts as far as the signal goes meanwhile.

        A current jumps where a program ticks, and when it does is known to a tick only.
        """
        late = math.hypot(noise.get(TIME, 0.0), self.tick if name in _JUMPS else 0.0)
        return np.hypot(noise[name], late * self._rates[name]) if late else noise[name]

    @cached_property
    def _rates(self) -> dict[str, Array]:
        """How fast each sensor's signal changes about each of its values, at most [SI/s]."""
        return {name: _rates(self.times[place], self.values[name]) for name, place in self.places.items()}


def make_case(log: Log, model: Model, space: Space, sensors: Sequence[str], *, delayed: bool = False,
              signals: dict[tuple[Any, ...], Signal] | None = None) -> Case:
    """Return a log ready to be compared; `signals` keeps the commands of others like it.

    Raises
    ------
    InputError
        If the model cannot follow it, or it sets a parameter that is searched.
    """
    log = with_loop_gain(log, model)
    searched = {*space.columns(space.start[None, :]), *([N] if any(name in LUMPED for name in space.names) else [])}
    for name in log.parameters:
        if name in searched:
            raise InputError(f"free: {name}", got=f"searched, but log {log.name!r} says what it is",
                             allowed="one of both")
    time = log.time - log.time[0]
    used = {name: _usable(log, model, name) for name in sensors if name in log.measured and log.used(name).any()}
    angle, speed, scatter, moving = _start(log, model)
    if moving and delayed:  # until the first command acts the servo follows earlier ones, which no log tells
        used = {name: mask & (time >= _UNKNOWN) for name, mask in used.items()}
    used = {name: mask for name, mask in used.items() if mask.any()}
    if not used:
        raise InputError(f"log {log.name!r}", got="no value of " + ", ".join(sensors) + " that counts",
                         allowed="measured values outside the windows that are left out")
    overridden = tuple(sorted(name for name in log.parameters))
    key = (log.command_kind, overridden, tuple(sorted(used)), bool(log.sent.all()))
    signal = command_of(log, model, {} if signals is None else signals)
    return Case(log=log, signal=signal, **_counted(log, used), start=(angle, speed),
                scatter=scatter, moving=moving, key=key, period=_period(log, model),
                leans=_leans(log, model, angle, scatter),
                tick=0.0 if has_pulses(model) else model.value_or(_TICK, 0.0))


def case_like(case: Case, log: Log, model: Model) -> Case:
    """Return a log with other commands or times than that of a case, and the same samples: it starts as that does.

    Its command is to be given by pulses; else it is that of the log.
    """
    used = {name: _usable(log, model, name) for name in case.places}
    if case.times[0] > 0.0:
        used = {name: mask & (log.time - log.time[0] >= case.times[0] - 1e-9) for name, mask in used.items()}
    signal = case.signal if has_pulses(model) and case.period else command_of(log, model, {})
    return replace(case, log=log, signal=signal, **_counted(log, used), key=(*case.key[:-1], bool(log.sent.all())))


def _counted(log: Log, used: Mapping[str, NDArray[np.bool_]]) -> dict[str, Any]:
    """Return instants, places and values of the samples that count."""
    any_used = np.logical_or.reduce(list(used.values()))
    index = np.cumsum(any_used) - 1
    return {"times": (log.time - log.time[0])[any_used], "places": {name: index[mask] for name, mask in used.items()},
            "values": {name: log.measured[name][mask] for name, mask in used.items()}}


def _usable(log: Log, model: Model, name: str) -> NDArray[np.bool_]:
    """Return where a sensor counts; a model without pulses says nothing once none were sent, or torque was off."""
    used, there = log.used(name), log.sent
    if isinstance(model, DigitalServo) and model.takes_goals:  # which stay over a silence
        there = np.ones(len(log.time), np.bool_) if log.torque_on is None else log.torque_on
    if not has_pulses(model) and not there.all():
        used = used & (np.arange(len(log.time)) < int(np.argmin(there)))
    return used


def _start(log: Log, model: Model) -> tuple[float, float, float, bool]:
    """Return angle and speed at the first sample, how far the angle may be off, and whether it moves visibly."""
    name = log.angle_name
    used = np.flatnonzero(log.used(name))
    time, values = log.time[used] - log.time[0], log.measured[name][used]
    if name == "feedback_voltage":
        gain, offset = (model.value_or(f"potentiometer.{key}", default) for key, default in
                        (("feedback_gain", 1.0), ("feedback_offset", 0.0)))
        values = (values - offset) / gain
    few = min(5, len(values))
    slope = float(np.polyfit(time[:few], values[:few], 1)[0]) if few > 2 else 0.0
    steps = np.abs(np.diff(values))
    resolution = float(steps[steps > 0.0].min(initial=math.inf)) if len(steps) else 0.0
    noise = float(np.median(np.abs(np.diff(values, n=2)))) if len(values) > 4 else 0.0
    quiet = min(noise, _UNSURE * _rough(time[:few], values[:few]))
    scatter = max(quiet, 0.5 * resolution if math.isfinite(resolution) else 0.0, 1e-6)
    moving = abs(slope) * float(time[few - 1] - time[0]) > 6.0 * quiet + 2e-3
    if moving and not _begins(time, values, slope, scatter):
        return float(values[0] - slope * time[0]), slope, 3.0 * scatter, True
    return float(values[0]), 0.0, scatter, False


def _leans(log: Log, model: Model, angle: float, scatter: float) -> float:
    """Return to which side of its play the motor lies of a bus servo without a load that stands off its goal.

    It stopped short of the goal, and pushes there still.
    """
    if not (isinstance(model, DigitalServo) and model.takes_goals and log.command_kind == "angle"
            and log.load == Load() and "output_angle" in log.measured):
        return 0.0
    time = log.time - log.time[0]
    first = log.used("output_angle") & (time < (time[log.changes[0]] if len(log.changes) else math.inf))
    off = float(log.held[0]) - angle
    if not first.any() or time[first][-1] < _STANDS or abs(off) <= 2.0 * scatter:
        return 0.0
    still = bool(np.abs(log.measured["output_angle"][first] - angle).max() <= 2.0 * scatter)
    return math.copysign(1.0, off) if still else 0.0


def _rough(time: Array, values: Array) -> float:
    """Return how far samples scatter about a motion of even acceleration; inf of three or less, which tell nothing."""
    if len(values) < 4:
        return math.inf
    residual = values - np.polyval(np.polyfit(time - time[0], values, 2), time - time[0])
    return math.sqrt(float(residual @ residual) / (len(values) - 3))


def _begins(time: Array, values: Array, slope: float, scatter: float) -> bool:
    """Tell whether a shaft that has a slope over five samples was at rest at the first of them.

    One that speeds up evenly from rest has half of that slope over the first three; with a dead time it has less.
    """
    if len(values) < 3:
        return False
    way = float(time[2] - time[0]) * math.copysign(1.0, slope)
    return float(np.polyfit(time[:3], values[:3], 1)[0]) * way <= _FROM_REST * slope * way + scatter


def _rates(time: Array, values: Array) -> Array:
    """Return the largest rate of a signal within some time before and after each of its values [SI/s]."""
    after = np.minimum(np.searchsorted(time, time + _RATE_OVER - 1e-9), len(time) - 1)
    apart = time[after] - time
    rate = np.abs(values[after] - values) / np.where(apart > 0.0, apart, np.inf)
    near = zip(np.searchsorted(time, time - _LASTS - _RATE_OVER), np.searchsorted(time, time + _LASTS), strict=True)
    return np.array([rate[first:max(stop, first + 1)].max() for first, stop in near])


def _period(log: Log, model: Model) -> float:
    """Return T_f that log or servo say [s]; 0 of a model without pulses."""
    if not has_pulses(model):
        return 0.0
    return float(log.parameters.get(_FRAME_PERIOD, getattr(model, "frame_period", 0.0)))


def command_of(log: Log, model: Model, known: dict[tuple[Any, ...], Signal]) -> Signal:
    """Return the command as a model takes it; only one with pulses has missing ones."""
    period = _period(log, model)
    which = (log.time.tobytes(), log.command.tobytes(), log.command_kind, log.command_hold, log.sent.tobytes(), period)
    if which not in known:
        made = log.signal(period or None)
        known[which] = replace(made, edges=None) if made.edges is not None and not has_pulses(model) else made
    return known[which]
