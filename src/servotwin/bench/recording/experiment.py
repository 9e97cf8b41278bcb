"""An experiment: the commands of a servo, piece by piece, before it is known through which wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from servotwin.errors import InputError, UnknownNameError
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.logs import Log


# --- An experiment: the commands of a servo, piece by piece, before it is known through which wire --------------------

KINDS = {"pulse_width": "s", "angle": "rad"}  # kind of command -> its SI unit
_ROUNDING = 1e-9  # of a range


@dataclass(frozen=True)
class Hold:
    """A command that is held for a while.

    Parameters
    ----------
    duration : float
        Positive [s]; a wire that works in frames or ticks rounds it to whole ones, at least one.
    value : float or None
        In SI, by the kind of the experiment; None: the servo gets no command, and goes limp (no pulses, torque off).
    frame_period : float or None
        From pulse to pulse [s]; that of the experiment unless given.
    """

    duration: float
    value: float | None
    frame_period: float | None = None


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A run of one servo, as it is to be commanded.

    Parameters
    ----------
    name : str
        Of the run: a name that a file can have.
    motion : str
        Kind of motion, for tables of errors: "step", "staircase", "prbs", …
    kind : {"pulse_width", "angle"}
    holds : sequence of Hold
        One after the other; at least one with a value, and the first has one.
    frame_period : float
        From pulse to pulse, or from goal to goal [s].
    conditions : mapping of str to float or str
        Labels that the log gets.

    Raises
    ------
    InputError
        If a number is not finite or not positive where it has to be, or nothing is commanded.

    Examples
    --------
    >>> step = Experiment(name="step", motion="step", kind="pulse_width", holds=[Hold(0.5, 1.4e-3), Hold(1.0, 1.6e-3)])
    >>> step.duration, step.lowest, step.highest
    (1.5, 0.0014, 0.0016)
    """

    name: str
    motion: str
    kind: str
    holds: Sequence[Hold]
    frame_period: float = 0.02
    conditions: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"experiment {self.name!r}"
        if not self.name or any(c in self.name for c in "/\\\0") or self.name.startswith("."):
            raise InputError("name of an experiment", got=self.name, allowed="one that a file can have")
        if self.kind not in KINDS:
            raise InputError(f"{where}: kind", got=self.kind, allowed=", ".join(KINDS))
        holds = tuple(self.holds)
        if not holds or holds[0].value is None:
            raise InputError(f"{where}: holds", got="none with a value at the start", allowed="a first command")
        for one in holds:
            for what, number in (("duration", one.duration), ("frame_period", one.frame_period or self.frame_period)):
                if not (is_finite(number) and number > 0.0):
                    raise InputError(f"{where}: {what}", got=number, allowed="a positive number [s]")
            if one.value is not None and not is_finite(one.value):
                raise InputError(f"{where}: value", got=one.value, allowed=f"a finite number [{KINDS[self.kind]}]")
        object.__setattr__(self, "holds", holds)
        object.__setattr__(self, "conditions", MappingProxyType(dict(self.conditions)))

    @property
    def duration(self) -> float:
        """Of all holds [s]."""
        return sum(one.duration for one in self.holds)

    @property
    def lowest(self) -> float:
        """The lowest command (SI)."""
        return min(one.value for one in self.holds if one.value is not None)

    @property
    def highest(self) -> float:
        """The highest command (SI)."""
        return max(one.value for one in self.holds if one.value is not None)


# --- The experiments that a servo is known by, each within a range of commands that its user allows -------------------

_PERIODS = (0.02, 0.014, 0.01, 0.007, 0.005, 1.0 / 333.0)  # s, 50 to 333 Hz
_MISSING = (1, 2, 5, 10, 25)  # frames without a pulse
_STEP = {"pulse_width": 1e-6, "angle": math.radians(0.1)}  # of a staircase; the finest that users can send
_SLOW = 0.2  # s that a stair is held: ten frames of 50 Hz
_DWELL = 0.8  # s that a step is held; the servos of the catalog settle in less
_EDGE = 0.02  # of the range that small motions keep from its middle's ends


def steps(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return steps of all sizes between levels in random order, each held for 0.8 s."""
    rng = np.random.default_rng(seed)
    count = max(math.ceil(duration / _DWELL), 3)
    levels = limits.low + (limits.high - limits.low) * np.concatenate(
        [rng.permutation(np.linspace(0.0, 1.0, 8)) for _ in range(count // 8 + 1)])
    middle = limits.middle
    holds = [Hold(_DWELL, middle), *(Hold(_DWELL, float(level)) for level in levels[:count - 1])]
    return _made("step", limits, holds, frame_period)


def staircase(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return stairs of 1 µs (0.1° on a bus) up and down about the middle: what the deadband swallows shows."""
    del seed
    stair = _STEP[limits.kind]
    most = max(math.floor(0.5 * (limits.high - limits.low) / stair * (1.0 - _EDGE)), 1)
    count = min(max(round(duration / (4.0 * _SLOW)), 2), most)
    up = list(range(count + 1))
    path = [*up, *reversed(up[:-1]), *(-k for k in up[1:]), *(-k for k in reversed(up[:-1]))]
    return _made("staircase", limits, [Hold(_SLOW, limits.middle + k * stair) for k in path], frame_period)


def ramp(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return a slow way from end to end and back, a new command each frame: friction and play show."""
    del seed
    return _curve("ramp", limits, frame_period, duration, lambda x: 1.0 - abs(1.0 - 2.0 * x) * 2.0)


def chirp(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return a sine over half of the range whose frequency goes from 0.3 to 5 Hz, at most a tenth of the frame rate."""
    del seed
    first, last = 0.3, min(5.0, 0.1 / frame_period)
    return _curve("chirp", limits, frame_period, duration,
                  lambda x: 0.5 * math.sin(2.0 * math.pi * duration * x * (first + 0.5 * (last - first) * x)))


def prbs(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return random jumps between two commands half of the range apart, 120 ms or more between them."""
    rng = np.random.default_rng(seed)
    bit = max(0.12, 4.0 * frame_period)
    half = 0.25 * (limits.high - limits.low)
    signs = rng.choice([-1.0, 1.0], max(math.ceil(duration / bit), 2)).tolist()
    holds = [Hold(0.5, limits.middle), *(Hold(bit, limits.middle + half * sign) for sign in signs)]
    return _made("prbs", limits, holds, frame_period)


def missing(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return steps that lose 1, 2, 5, 10 and 25 frames 60 ms after they began: what the servo does unheard."""
    del seed
    _pulses_only("missing", limits)
    early = math.ceil(0.06 / frame_period) * frame_period
    holds, level = [Hold(0.5, limits.at(0.25))], 0.75
    while sum(one.duration for one in holds) < duration or len(holds) < 4:
        for lost in _MISSING:
            value = limits.at(level)
            holds += [Hold(early, value), Hold(lost * frame_period, None), Hold(0.6, value)]
            level = 1.0 - level
    return _made("missing", limits, holds, frame_period)


def torque_off(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return holds and a step that torque leaves for a second each: what is left when nothing drives."""
    del seed
    low, high = limits.at(0.3), limits.at(0.7)
    one = [Hold(0.6, low), Hold(1.0, None), Hold(0.6, low), Hold(0.1, high), Hold(1.0, None), Hold(0.6, high)]
    return _made("torque_off", limits, one * max(round(duration / sum(h.duration for h in one)), 1), frame_period)


def hold(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02, seed: int = 0) -> Experiment:
    """Return one command that stays: noise, the load's droop, heat."""
    del seed
    return _made("hold", limits, [Hold(duration, limits.middle)], frame_period)


def frame_rates(limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02,
                seed: int = 0) -> list[Experiment]:
    """Return the same steps at 50, 71, 100, 143, 200 and 333 Hz; fast rates are not for every analog servo."""
    del frame_period
    _pulses_only("frame_rates", limits)
    widest = limits.high + 200e-6  # the pin is low for as long between two pulses
    periods = [period for period in _PERIODS if period >= widest]
    return [replace(steps(limits, duration=duration / len(periods), frame_period=period, seed=seed),
                    name=f"frame_rate_{1.0 / period:.0f}Hz", motion="frame_rate",
                    conditions={"frame_rate_Hz": round(1.0 / period)}) for period in periods]


EXPERIMENTS: Mapping[str, Callable[..., Experiment | list[Experiment]]] = {
    "steps": steps, "staircase": staircase, "ramp": ramp, "chirp": chirp, "prbs": prbs, "frame_rates": frame_rates,
    "missing": missing, "torque_off": torque_off, "hold": hold,
}
"""Builders by name; each takes limits, and duration, frame_period [s] and seed by keyword."""


def experiments(names: str, limits: Limits, *, duration: float = 10.0, frame_period: float = 0.02,
                seed: int = 0) -> list[Experiment]:
    """Return experiments by their names.

    Parameters
    ----------
    names : str
        Such as "steps,chirp"; "all" is all that the wire can carry.
    limits : Limits
    duration : float
        Of each, about [s].
    frame_period : float
        [s]
    seed : int
        Of what is random.

    Raises
    ------
    UnknownNameError, InputError
        If there is no such experiment, or a number makes no sense.

    Examples
    --------
    >>> from servotwin.bench.recording.experiment import Limits
    >>> limits = Limits(kind="pulse_width", low=1e-3, high=2e-3, voltage=6.0, current=1.0)
    >>> [one.motion for one in experiments("steps,hold", limits, duration=2.0)]
    ['step', 'hold']
    """
    for what, value in (("duration", duration), ("frame period", frame_period)):
        if not (is_finite(value) and value > 0.0):
            raise InputError(f"{what} of an experiment", got=value, allowed="a positive number [s]")
    pulses = ("missing", "frame_rates") if limits.kind != "pulse_width" else ()
    wanted = [name for name in EXPERIMENTS if name not in pulses] if names == "all" else names.split(",")
    made: list[Experiment] = []
    for name in wanted:
        if name not in EXPERIMENTS:
            raise UnknownNameError("experiment", name, EXPERIMENTS)
        one = EXPERIMENTS[name](limits, duration=duration, frame_period=frame_period, seed=seed)
        made += one if isinstance(one, list) else [one]
    return made


def of_log(log: Log, *, name: str | None = None, frame_period: float = 0.02) -> Experiment:
    """Return the experiment that commands what a log was commanded, such as the best one of an advice.

    Raises
    ------
    InputError
        If its command is a voltage, or moves between samples.
    """
    kind = {"pulse_width": "pulse_width", "angle": "angle"}.get(log.command_kind)
    if kind is None:
        raise InputError(f"log {log.name!r}: command", got=log.command_kind, allowed=", ".join(KINDS))
    holds: list[Hold] = []
    ends = np.append(log.time[1:], log.time[-1] + float(np.median(np.diff(log.time))))
    for start, end, value, sent in zip(log.time.tolist(), ends.tolist(), log.held.tolist(), log.sent.tolist(),
                                       strict=True):
        value = value if sent else None
        if holds and holds[-1].value == value:
            holds[-1] = Hold(holds[-1].duration + end - start, value)
        else:
            holds.append(Hold(end - start, value))
    return Experiment(name=name or log.name.replace(" ", "_"), motion=log.motion or "log", kind=kind, holds=holds,
                      frame_period=frame_period)


def _made(motion: str, limits: Limits, holds: list[Hold], frame_period: float) -> Experiment:
    return Experiment(name=motion, motion=motion, kind=limits.kind, holds=holds, frame_period=frame_period)


def _curve(motion: str, limits: Limits, frame_period: float, duration: float,
           shape: Callable[[float], float]) -> Experiment:
    """Return a command that is new in each frame: `shape` of the time's share, from −1 to 1."""
    count = max(math.ceil(duration / frame_period), 2)
    values = [limits.at(0.5 + 0.5 * shape(k / count)) for k in range(count)]
    return _made(motion, limits, [Hold(0.5, values[0]), *(Hold(frame_period, value) for value in values)],
                 frame_period)


def _pulses_only(name: str, limits: Limits) -> None:
    if limits.kind != "pulse_width":
        raise InputError(f"experiment {name!r}", got="a servo on a bus", allowed="one that takes pulses")


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Range, voltage and current of a run.

    Parameters
    ----------
    kind : {"pulse_width", "angle"}
        Commanded quantity.
    low, high : float
        Commands that are allowed (SI), low below high.
    voltage : float
        Of the supply, as it is set [V].
    current : float
        Mean supply current over 0.25 s that ends the run [A].

    Raises
    ------
    InputError
        If a number makes no sense.

    Examples
    --------
    >>> Limits(kind="pulse_width", low=1e-3, high=2e-3, voltage=6.0, current=1.0).middle
    0.0015
    """

    kind: str
    low: float
    high: float
    voltage: float
    current: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("kind of limits", got=self.kind, allowed=", ".join(KINDS))
        for name in ("low", "high", "voltage", "current"):
            if not is_finite(getattr(self, name)):
                raise InputError(f"limits: {name}", got=getattr(self, name), allowed="a finite number (SI)")
        if not self.low < self.high:
            raise InputError("limits: range", got=f"{self.low:g} to {self.high:g}", allowed="low below high")
        if self.kind == "pulse_width" and not 0.0 < self.low:
            raise InputError("limits: low", got=self.low, allowed="a positive pulse width [s]")
        for name in ("voltage", "current"):
            if getattr(self, name) <= 0.0:
                raise InputError(f"limits: {name}", got=getattr(self, name), allowed="a positive number")

    @property
    def middle(self) -> float:
        """Of the range (SI)."""
        return 0.5 * (self.low + self.high)

    def at(self, share: float) -> float:
        """Return the command at a share of the range, 0 to 1 (SI)."""
        return self.low + share * (self.high - self.low)

    def check(self, experiment: Experiment) -> None:
        """Refuse an experiment that goes beyond the range.

        Raises
        ------
        InputError
        """
        if experiment.kind != self.kind:
            raise InputError(f"experiment {experiment.name!r}", got=f"commands of {experiment.kind}", allowed=self.kind)
        slack = _ROUNDING * (self.high - self.low)
        if experiment.lowest < self.low - slack or experiment.highest > self.high + slack:
            raise InputError(f"experiment {experiment.name!r}: range",
                             got=f"{experiment.lowest:g} to {experiment.highest:g} {KINDS[self.kind]}",
                             allowed=f"{self.low:g} to {self.high:g} {KINDS[self.kind]}")
