"""One log, made ready to be compared with a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.free import LUMPED, Space
from servotwin.identification.fitting.loop_gain import with_loop_gain
from servotwin.loads import Load
from servotwin.logs.log import Log
from servotwin.models import DigitalServo, Model
from servotwin.parameters.output_side import N

if TYPE_CHECKING:
    from servotwin.signals import Signal

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
        What that sensor measured there (SI).
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

    Its command is to be told by pulses; else it is that of the log.
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
    """Return the command as a model takes it; only one with pulses knows missing ones."""
    period = _period(log, model)
    which = (log.time.tobytes(), log.command.tobytes(), log.command_kind, log.command_hold, log.sent.tobytes(), period)
    if which not in known:
        made = log.signal(period or None)
        known[which] = replace(made, edges=None) if made.edges is not None and not has_pulses(model) else made
    return known[which]
