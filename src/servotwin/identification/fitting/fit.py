"""What a fit found: values with intervals, what the logs cannot say, and the errors on logs that it has not seen.

None of these checks fits a parameter or runs a simulation, and nothing is mended unless the caller asks for it.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.case import TIME, with_loop_gain
from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.holdout import ErrorTable, LogError, log_error
from servotwin.identification.fitting.suspicions.followed import centred, not_followed, spans, turned, wraps
from servotwin.identification.fitting.suspicions.look import Finding, Look, look, missing_rows, refused, wrong_stamps
from servotwin.identification.fitting.uncertainty import Unidentifiable
from servotwin.logs.log import Log
from servotwin.models import BoundedServo, DigitalServo, Model, PulseServo, PulseServoInductive, default_model
from servotwin.parameters import Servo
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.simulation.progress import duration_left, lines, on_terminal
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.identification.fitting.assumptions import Assumption, Ends
    from servotwin.identification.fitting.comparison import ErrorTables
    from servotwin.identification.fitting.draws import Allowed
    from servotwin.identification.fitting.ladder import Ladder
    from servotwin.identification.fitting.registers import RegisterSearch, RegisterValue
    from servotwin.identification.fitting.uncertainty import Uncertainty
    from servotwin.identification.fitting.verdict import Verdict
    from servotwin.identification.fitting.yielding import Foreseen, Widened, Yielded
    from servotwin.signals import Signal


# --- The arguments of `identify`, checked before anything runs, and what a reader has to know afterwards --------------

_KINDS = (PulseServo, PulseServoInductive, BoundedServo, DigitalServo)
_PLANT = ("motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque")
_LOOP_GAIN = "firmware.proportional_gain"
_FITTED = ("output_angle", "feedback_voltage", "armature_current", "supply_current")
_TOO_FAST = 4.0  # times the speed without load
_PATIENCE = 1.0  # s before time left is told
_OVERFITTED = 1.6  # error of new logs over that of the fitted ones


def checked_logs(logs: Any) -> tuple[Log, ...]:
    """Return logs, at least one of which moves."""
    from servotwin.logs.readers import read_logs

    found = read_logs(logs) if isinstance(logs, str | Path) else [logs] if isinstance(logs, Log) else logs
    if not isinstance(found, Sequence) or not found or not all(isinstance(log, Log) for log in found):
        raise InputError("logs", got=found, allowed="a list of at least one Log, or a path of logs")
    names = [log.name for log in found]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"logs: {twice!r}", got=f"{names.count(twice)} logs of this name", allowed="one")
    if all(log.is_constant for log in found):
        raise InputError(f"log {names[0]!r}" if len(found) == 1 else f"all {len(found)} logs",
                         got="an angle that never changes", allowed="a log in which the servo moves")
    return tuple(found)


def checked_servo(servo: Any, kind: Any) -> Model:
    """Return the model that is fitted: of class `kind`, or where that is None the one that stands for the servo."""
    if not isinstance(servo, Servo):
        raise InputError("servo of a fit", got=servo, allowed="a servo, such as load_servo(...)")
    if kind is None:
        return default_model(servo)
    if kind not in _KINDS:
        raise InputError("model of a fit", got=getattr(kind, "__name__", kind),
                         allowed=", ".join(k.__name__ for k in _KINDS))
    model: Model = kind(servo)
    return model


def usual_free(model: Model, logs: Sequence[Log] = ()) -> tuple[str, ...]:
    """Return what is searched unless the caller says: what an angle under command and load can tell.

    Of a servo on a bus that is the plant, and the gain of its loop where neither registers nor logs say it.
    """
    if isinstance(model, DigitalServo):
        if not model.takes_goals:
            return (*_PLANT, _LOOP_GAIN, "firmware.derivative_gain", "firmware.deadband_angle",
                    "potentiometer.feedback_gain")
        known = _knows_gain(model.servo) or any(_LOOP_GAIN in with_loop_gain(log, model).parameters for log in logs)
        return (*_PLANT, "motor.motor_viscous_friction", *(() if known else (_LOOP_GAIN,)))
    gain, deadband = (("electronics.bridge_gain", "electronics.voltage_deadband") if isinstance(model, BoundedServo)
                      else ("electronics.stretcher_gain", "electronics.deadband"))
    return (*_PLANT, gain, deadband, "potentiometer.feedback_gain")


def _knows_gain(servo: Servo) -> bool:
    """Tell whether a servo's registers say the gain of its loop."""
    said = servo.source(_LOOP_GAIN) if servo.get(_LOOP_GAIN) is not None else None
    return said is not None and said.origin in ("literature", "datasheet", "measured")


def checked_sensors(logs: Sequence[Log], sensors: Sequence[str] | None, model: Model) -> tuple[str, ...]:
    """Return the names of measured signals that are compared."""
    there = dict.fromkeys(name for log in logs for name in log.measured)
    known = model.signals_with(*(log.load for log in logs))
    if sensors is not None:
        if isinstance(sensors, str) or not isinstance(sensors, Sequence):
            raise InputError("sensors", got=sensors, allowed="a list of " + ", ".join(there))
        for name in sensors:
            if name not in there or name not in known:
                got = f"{name}, which {type(model).__name__} does not have" if name in there else name
                raise InputError("sensors", got=got, allowed=", ".join(n for n in there if n in known))
        if not any(name in ("output_angle", "feedback_voltage") for name in sensors):
            raise InputError("sensors", got=", ".join(sensors), allowed="output_angle or feedback_voltage among them")
        return tuple(dict.fromkeys(sensors))
    found = [name for name in _FITTED if name in there and name in known]
    without_angle = any("output_angle" not in log.measured for log in logs)
    return tuple(name for name in found if name != "feedback_voltage" or without_angle or "output_angle" not in found)


def shared_load(logs: Sequence[Log], free: Sequence[str]) -> dict[str, float]:
    """Return what the logs' loads give for the load parameters that are searched; it has to be the same in all."""
    found = {}
    for name in free:
        if name not in LOAD_NAMES:
            continue
        values = {_of_load(log, name) for log in logs}
        if len(values) > 1:
            raise InputError(f"free: {name}", got=f"{len(values)} different values in the logs",
                             allowed="one and the same load in all logs")
        value = values.pop()
        if value is None:
            raise InputError(f"free: {name}", got=f"a load without it in log {logs[0].name!r}",
                             allowed="a load that has it")
        found[name] = value
    return found


def _of_load(log: Log, name: str) -> float | None:
    _, *part, key = name.split(".")
    if not part:
        return float(getattr(log.load, key))
    parts = getattr(log.load, f"{part[0]}s")
    value = getattr(parts[0], key) if len(parts) == 1 else None
    return None if value is None else float(value)


def check_speeds(logs: Sequence[Log], model: Model) -> None:
    """Raise if a log shows the shaft faster than the servo could be by far: another servo, or another unit."""
    gain = model.value("gear.gear_reduction") * model.value("motor.back_emf_constant")
    for log in logs:
        if log.angle_name != "output_angle":
            continue
        voltage = log.parameters.get("supply.open_circuit_voltage", model.value("supply.open_circuit_voltage"))
        used = log.used("output_angle") & log.sent
        time, angle = log.time[used], log.measured["output_angle"][used]
        if len(time) < 5:
            continue
        speed = float(np.quantile(np.abs((angle[4:] - angle[:-4]) / (time[4:] - time[:-4])), 0.98))
        limit = voltage / gain
        if speed > _TOO_FAST * limit:
            raise InputError(
                f"log {log.name!r} contradicts the servo", got=f"a shaft at {speed:.3g} rad/s",
                allowed=f"about {limit:.3g} rad/s, the speed of {model.servo.name} without load at {voltage:g} V; "
                        "check the unit of the angle, and the servo")


def checked_loss(loss: str, huber: float) -> float:
    """Return the limit beyond which residuals count in proportion."""
    if loss not in ("huber", "squares"):
        raise InputError("loss", got=loss, allowed='"huber" or "squares"')
    return huber if loss == "huber" else math.inf


def checked_list(what: str, names: Any) -> tuple[str, ...]:
    """Return a list of names."""
    if isinstance(names, str) or not isinstance(names, Sequence) or not all(isinstance(n, str) for n in names):
        raise InputError(what, got=names, allowed="a list of names")
    return tuple(names)


def checked_words(what: str, words: Any, allowed: Sequence[str]) -> tuple[str, ...]:
    """Return a list of words out of some, none of them twice."""
    if isinstance(words, str) or not isinstance(words, Sequence) or not all(isinstance(w, str) for w in words):
        raise InputError(what, got=words, allowed="a list of " + ", ".join(allowed))
    for word in words:
        if word not in allowed or list(words).count(word) > 1:
            raise InputError(what, got=word if word not in allowed else f"{word} twice", allowed=", ".join(allowed))
    return tuple(words)


def checked_flag(what: str, flag: Any) -> bool:
    """Return whether something is wanted."""
    if not isinstance(flag, bool):
        raise InputError(what, got=flag, allowed="True or False")
    return flag


def checked_level(level: Any) -> float:
    """Return the level of intervals."""
    if isinstance(level, bool) or not isinstance(level, int | float) or not 0.0 < level < 1.0:
        raise InputError("level", got=level, allowed="a number between 0 and 1, such as 0.95")
    return float(level)


def checked_noise(noise: Any, sensors: Sequence[str]) -> dict[str, float] | None:
    """Return the noise of sensors [SI], as far as it is given."""
    if noise is None:
        return None
    if not isinstance(noise, Mapping):
        raise InputError("noise", got=noise, allowed="a mapping of sensors to standard deviations (SI)")
    for name, value in noise.items():
        if name not in (*sensors, TIME):
            raise InputError("noise", got=name, allowed=", ".join((*sensors, TIME)))
        if not (is_finite(value) and value > 0.0):
            raise InputError(f"noise of {name}", got=value, allowed="a positive number (SI)")
    return {name: float(value) for name, value in noise.items()}


def check_fitted(logs: Sequence[Log], fitted: Sequence[int], sensors: Sequence[str], numbers: int) -> None:
    """Raise if the logs that are fitted are too little for what is searched."""
    some = [logs[k] for k in fitted]
    if all(log.is_constant for log in some):
        raise InputError("logs that are fitted", got="an angle that never changes", allowed="a log in which the servo "
                         "moves; hold out others")
    values = sum(int(log.used(name).sum()) for log in some for name in sensors if name in log.measured)
    if values <= numbers:
        raise InputError("logs that are fitted", got=f"{values} samples with a value",
                         allowed=f"more than the {numbers} numbers that are searched")


def checked_count(what: str, number: Any, *, least: int) -> int:
    """Return a whole number."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise InputError(what, got=number, allowed=f"a whole number of at least {least}")
    return int(number)


def warnings_of(yielded: Sequence[Yielded | Widened], tables: ErrorTables) -> tuple[str, ...]:
    """Return what a reader has to know of a fit, a line each."""
    found = [str(one) for one in yielded]
    if tables.holdout and tables.training:
        model = tables.holdout.models[0]
        new, old = tables.holdout.by(), tables.training.by()
        for motion in new:
            if motion in old and new[motion][model] > _OVERFITTED * old[motion][model]:
                ratio = new[motion][model] / old[motion][model]
                found.append(f"{motion}: logs that were held out are off {ratio:.2g} times as far as fitted ones: they "
                             "show what those do not, or those are too few for so many numbers")
    return tuple(found)


@contextmanager
def shown(progress: Any) -> Iterator[Callable[[float, str], None]]:
    """Give a function that is told the share that is done and what goes on."""
    if callable(progress):
        yield lambda share, text: (progress(share, text), None)[1]
        return
    if not isinstance(progress, bool):
        raise InputError("progress", got=progress, allowed="True, False or a function of the share done and a text")
    if not progress:
        yield lambda share, text: None
        return
    if not on_terminal():
        yield lines("fit")
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(),
                   TextColumn("{task.fields[left]}"), console=Console(stderr=True), transient=True)
    task, began = bar.add_task("fit", total=1.0, left=""), time.monotonic()

    def tell(share: float, text: str) -> None:  # rich would tell the time left by the latest steps alone
        gone = time.monotonic() - began
        left = f"about {duration_left(gone, share)} left" if share > 0.0 and gone > _PATIENCE else ""
        bar.update(task, completed=share, description=text, left=left)

    bar.start()
    try:
        yield tell
    finally:
        with contextlib.suppress(OSError):  # a terminal that was closed takes nothing along that was found
            bar.stop()


# --- What a fit found -------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
NOT_YET = "not determined yet"
"""How an interval is told that a fit which was stopped has left open."""
LEAST_SHARE = 0.005
"""Of an interval: less prior than this is not worth a word."""


class Interval(NamedTuple):
    """Where a value lies (SI), and how that was found.

    Parameters
    ----------
    lower, upper : float
        nan where the logs do not determine the value.
    method : str
        "normal", "profile", "linearised" (of a fit that was stopped), "by pulses" (a delay: what
        commands and pulses allow), "at bound", "undetermined", "not determined yet" (at a stop), or "not sought".
    """

    lower: float
    upper: float
    method: str


@dataclass(frozen=True)
class Trace:
    """One log beside the fitted servo.

    Parameters
    ----------
    log : Log
    held_out : bool
    signal : str
        The measured signal that is compared.
    time, measured, simulated : ndarray, shape (n,)
        Where it counts [s], SI.
    judged : ndarray of bool, shape (n,)
        Which of these say how good the fit is: of a log that was held out its second half, where its first half says
        when its pulses come.
    command : Signal
        As the servo got it, pulses and all; its t = 0 is the first sample, or some pulses before.
    delay : float
        The servo at a time t after the first sample is that which this command leads to at t − delay [s]; negative
        where the command begins before the first sample.
    parameters : mapping of str to float
        What differs from the fitted servo in this log (SI): what the log says, and when its program's first tick comes.
    initial : mapping of str to float
        Where the shaft was at the command's t = 0 (SI); empty where the servo stands where its first command says.
    offset : float
        Measured less true angle [rad].

    Examples
    --------
    The fitted servo under the command of a trace is the trace again:

    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = st.Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...              measured={"output_angle": run["output_angle"]})
    >>> fit = st.identify([log], servo, free=["motor.rotor_inertia"], starts=1, compare_with=())
    >>> trace = fit.traces[0]
    >>> times = np.maximum(trace.time - trace.log.start - trace.delay, 0.0)
    >>> again = st.simulate(type(fit.model)(fit.servo.replace(trace.parameters)), trace.command, load=trace.log.load,
    ...                     duration=float(times[-1]), output_times=times, initial=trace.initial)
    >>> bool(np.abs(again["output_angle"] + trace.offset - trace.simulated).max() < 1e-6)
    True
    """

    log: Log
    held_out: bool
    signal: str
    time: Array = field(repr=False)
    measured: Array = field(repr=False)
    simulated: Array = field(repr=False)
    judged: NDArray[np.bool_] = field(repr=False)
    command: Signal = field(repr=False)
    delay: float = 0.0
    parameters: Mapping[str, float] = field(default_factory=dict, repr=False)
    initial: Mapping[str, float] = field(default_factory=dict, repr=False)
    offset: float = 0.0

    @property
    def residual(self) -> Array:
        """Simulated less measured."""
        return self.simulated - self.measured

    @property
    def error(self) -> LogError:
        """How far the servo is off the samples that judge it."""
        return log_error(self.log, self.residual[self.judged], self.measured[self.judged])


@dataclass(frozen=True)
class Start:
    """Where one of the searches from random starts ended: its cost, half a sum of squares in units of noise."""

    cost: float
    converged: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The outcome of `identify`.

    Parameters
    ----------
    servo : Servo
        With the fitted values, their origin "identified", their spread, and the record of the fit.
    model : Model
        Over that servo.
    names : tuple of str
        Searched parameters, then the nuisances that all logs share; the order of `covariance`.
    estimates : mapping of str to float
        Values of all names (SI).
    units : mapping of str to str
    covariance : ndarray, shape (p, p)
        Of the estimates (SI); rows of what is undetermined or at a bound are nan.
    unidentifiable : tuple of Unidentifiable
        What the logs cannot say, in words.
    at_bound : tuple of str
        Parameters that ended at a bound of the search.
    holdout, training : ErrorTable
        Errors by log of the fitted servo, of the simpler models beside it.
    traces : tuple of Trace
        Every log beside the fitted servo.
    starts : tuple of Start
        Where the searches from all starts ended, the best first.
    noise : mapping of str to float
        Standard deviation of the residuals of each sensor, robust (SI).
    warnings : tuple of str
        What a reader has to know, a line each.
    doubt : Uncertainty
    spans : mapping of str to tuple of float
        Ranges (SI) of what is told by pulses: the delay.
    phased : bool
        Whether the pulses of each log came when the log wanted.
    ticked : bool
        Whether each log's ticks took the commands that the log wanted.
    yielded : tuple of Yielded
        Priors that were dropped because the logs contradict them, in the order in which they went.
    widened : tuple of Widened
        Priors that the logs push by more than 2.5 of their widths: they count as wide as they are off.
    prior_share : mapping of str to float
        How much of what is known of each number is prior, from 0 to 1: 1 less its variance over that which the logs
        alone would leave; nan of a number at a bound. Empty without intervals.
    allowed : Allowed
        The law that `draw` draws from.
    own : tuple of ndarray
        Each log's own numbers at the end of the search (scaled): its start, its delay or phases.
    assumptions : tuple of Assumption
        Numbers that the servo file leaves out or assumes, for which intervals and covariance allow by their ranges.
    interrupted : bool
        Whether it was stopped before its end: then this is the best so far.
    unknown : tuple of str
        What is not known because it was stopped.
    verdict : Verdict, optional
        Whether what is left is noise; None of a fit that was stopped in its search.
    registers : RegisterSearch, optional
        Of a bus servo: what stands in registers that logs did not record.
    foreseen : tuple of Foreseen
        Searched numbers that the logs can hardly tell, as it was seen before the search.
    """

    servo: Servo
    model: Model
    names: tuple[str, ...]
    estimates: Mapping[str, float]
    units: Mapping[str, str]
    covariance: Array = field(repr=False)
    unidentifiable: tuple[Unidentifiable, ...]
    at_bound: tuple[str, ...]
    holdout: ErrorTable = field(repr=False)
    training: ErrorTable = field(repr=False)
    traces: tuple[Trace, ...] = field(repr=False)
    starts: tuple[Start, ...] = field(repr=False)
    noise: Mapping[str, float]
    cost: float
    warnings: tuple[str, ...]
    space: Space = field(repr=False)
    best: Array = field(repr=False)
    doubt: Uncertainty | None = field(repr=False)
    ends: Mapping[int, Ends] = field(repr=False)
    scales: Mapping[str, float] = field(repr=False)
    level: float = 0.95
    seconds: float = 0.0
    interrupted: bool = False
    unknown: tuple[str, ...] = ()
    verdict: Verdict | None = None
    foreseen: tuple[Foreseen, ...] = ()
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    phased: bool = False
    ticked: bool = False
    yielded: tuple[Yielded, ...] = ()
    widened: tuple[Widened, ...] = ()
    prior_share: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed | None = field(default=None, repr=False)
    own: tuple[Array, ...] = field(default=(), repr=False)
    registers: RegisterSearch | None = field(default=None, repr=False)
    assumptions: tuple[Assumption, ...] = ()

    def intervals(self, level: float | None = None) -> dict[str, Interval]:
        """Return the interval of every name (SI).

        Parameters
        ----------
        level : float, optional
            Such as 0.95; that of the fit unless given. Of a profile, other levels are in proportion.

        Raises
        ------
        InputError
            If the level is not between 0 and 1.
        """
        wanted = self.level if level is None else checked_level(level)
        return {name: self._interval(k, name, wanted) for k, name in enumerate(self.names)}

    def __str__(self) -> str:
        """Return the verdict, a line for each estimate with how much of it is prior, and what the logs cannot say."""
        lines = []
        for name, (lower, upper, method) in self.intervals().items():
            spread = f"{lower:z.4g} to {upper:z.4g} ({method})" if lower == lower else method
            share = self.prior_share.get(name, 0.0)
            prior = f", {100 * share:.0f} % of it prior" if share >= LEAST_SHARE and lower == lower else ""
            lines.append(f"{name} = {self.estimates[name]:z.4g} {self.units[name]}, {100 * self.level:g} %: "
                         f"{spread}{prior}")
        first = () if self.verdict is None else (str(self.verdict),)
        said = [text for text in self.warnings if text not in "\n".join(first).split("\n")]
        lines += [f"{one.name} = {one.value:.3g} ({one.interval})" for one in self.register_values]
        return "\n".join((*first, *lines, *map(str, self.unidentifiable), *self.allowing, *said))

    @property
    def allowing(self) -> tuple[str, ...]:
        """A line on what intervals allow for beside noise: what the servo file assumes; empty where that is nothing."""
        found = "; ".join(map(str, self.assumptions))
        return (f"intervals allow for what the servo file assumes: {found}",) if found else ()

    def _interval(self, k: int, name: str, level: float) -> Interval:
        nowhere = float("nan")
        if name in self.spans:
            return Interval(*self.spans[name], "by pulses")
        if name in self.undetermined:
            return Interval(nowhere, nowhere, "undetermined")
        if name in self.at_bound:
            return Interval(nowhere, nowhere, "at bound")
        if self.doubt is None or k not in self.ends:
            return Interval(nowhere, nowhere, "not sought" if self.doubt is None or not self.interrupted else NOT_YET)
        ends, std = self.ends[k], float(self.doubt.std[k])
        factor = self.doubt.quantile(level, k) / self.doubt.quantile(self.level, k)
        values = [self._value(k, self.best[k] + factor * end * std) for end in (ends.lower, ends.upper)]
        return Interval(min(values), max(values), ends.method)

    def _value(self, k: int, x: float) -> float:
        if k < len(self.space):
            p = self.space.parameters[k]
            return float(np.clip(p.value(x), p.lower, p.upper))
        return float(x * self.scales[self.names[k]])

    @property
    def register_values(self) -> tuple[RegisterValue, ...]:
        """Registers that nobody recorded: raw values of those whose numbers were searched, with their intervals."""
        from servotwin.identification.fitting.registers import register_values

        if self.registers is None:
            return ()
        spans = {name: (one.lower, one.upper) for name, one in self.intervals().items()}
        return register_values(self.model.servo, self.registers.moves, self.estimates, spans)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names that the logs do not determine."""
        return tuple(dict.fromkeys(name for item in self.unidentifiable for name in item.parameters))

    @property
    def searches(self) -> tuple[int, str]:
        """How many searches from different starts ended within 1 % of the best cost, and whether that is bad."""
        least = min((start.cost for start in self.starts), default=math.nan)
        same = sum(start.cost <= 1.01 * least + 1e-9 for start in self.starts)
        words = "searches from different starts ended within 1 % of the best cost"
        if same > 1:
            return same, f"{words}: they agree"
        if self.verdict is not None and self.verdict.holds and not self.verdict.undecided:
            return same, f"{words}: no harm, for what is left is noise, and no other could leave less"
        if not any(start.converged for start in self.starts if start.cost > 1.01 * least + 1e-9):
            return same, f"{words}: no harm, for the others were given up as worse before their end"
        return same, f"{words}: perhaps bad, for the others ended elsewhere, and there may be a better end; try more"

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, shape (p, p); nan where there is no covariance."""
        std = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.covariance / np.outer(std, std))

    def draw(self, number: int, seed: int = 0) -> dict[str, Array]:
        """Return servos that the logs allow, as arrays for `parameters=` of `simulate_many`.

        Drawn on the scale of the search, within its bounds, from the normal approximation of what logs and priors say
        together. Along what the logs leave open the priors count; where there is none, any point within the bounds is
        as likely as any other. Combinations that the logs do determine are as certain as ever, and a number at a bound
        is drawn from this side of it. Without intervals all keep their values.

        Parameters
        ----------
        number : int
            How many.
        seed : int

        Returns
        -------
        dict
            Arrays (number,) by dotted name (SI); lumped names as their members.
        """
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1:
            raise InputError("draw", got=number, allowed="a whole number of at least 1")
        p = len(self.space)
        x = np.repeat(self.best[None, :p], int(number), axis=0)
        if self.allowed is not None:
            x = self.allowed.draw(int(number), np.random.default_rng(seed))[:, :p]
        return self.space.columns(np.clip(x, self.space.lower, self.space.upper))

    def report(self, path: str | Path, *, ladder: Ladder | None = None, overwrite: bool = False) -> Path:
        """Write an HTML page: estimates, what is undetermined, errors, measured over simulated, residuals.

        A ladder of friction laws or structures, of which this fit is one, adds a table of all of them.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.identification.report.page import write_report

        return write_report(self, Path(path), ladder=ladder, overwrite=overwrite)


# --- What is wrong with logs before any fit ---------------------------------------------------------------------------

__all__ = ["BY_ITSELF", "KINDS", "MENDED", "Finding", "Mended", "explained", "findings", "first_looks", "mended"]
_CHECKS: Mapping[str, Callable[[Sequence[Look]], list[Finding]]] = {
    "wrap": wraps, "stamps": wrong_stamps, "sign": turned, "span": spans, "rows": missing_rows,
    "not followed": not_followed, "pulses": refused,
}  # each looks at logs that the ones before have put right
KINDS = tuple(_CHECKS)
_STEADIED = ("wrap", "stamps")  # what makes a shaft look faster than any servo
MENDED = tuple(kind for kind in KINDS if kind != "pulses")
"""Kinds of findings that can be mended."""
BY_ITSELF = ("wrap", "sign")
"""Kinds that a fit mends unasked, as no servo does so and nothing is lost: a search would be in vain."""


def findings(logs: Sequence[Log], model: Model) -> tuple[Finding, ...]:
    """Return what is probably wrong with logs, without fitting anything.

    Parameters
    ----------
    logs : sequence of Log
    model : Model
        Over the servo that the logs are of; its calibration, speed and stops count, by a wide margin.

    Returns
    -------
    tuple of Finding
        In the order of `KINDS`. The mended log of a finding has the kinds before it mended too.

    Examples
    --------
    >>> import numpy as np, servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb")
    >>> run = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0,
    ...                   output_step=0.02)
    >>> log = Log(name="step", time=run.time, command=run["pulse_width"], command_kind="pulse_width",
    ...           measured={"output_angle": -run["output_angle"]})
    >>> [one.kind for one in findings([log], st.PulseServo(servo))]
    ['sign']
    """
    return _checked(logs, model, KINDS).findings


class Mended(NamedTuple):
    """Logs with some kinds of findings mended, and the findings that were."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]


class _Checked(NamedTuple):
    """Logs with all that is found mended, what is found, and the logs with jumps and stamps mended only."""

    logs: tuple[Log, ...]
    findings: tuple[Finding, ...]
    steadied: tuple[Log, ...]


def mended(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> Mended:
    """Return logs with these kinds of findings mended, in the order of `KINDS`."""
    done = _checked(logs, model, [kind for kind in KINDS if kind in kinds])
    return Mended(done.logs, tuple(one for one in done.findings if one.mended is not None))


def _checked(logs: Sequence[Log], model: Model, kinds: Sequence[str]) -> _Checked:
    """Check logs for some kinds of findings, one kind after the other."""
    found: list[Finding] = []
    looks = {log.name: look(log, model) for log in logs} if kinds else {}
    now = {log.name: log for log in logs}
    steadied = tuple(logs)
    for kind in kinds:
        for one in (seen := _CHECKS[kind]([one for one in looks.values() if one is not None and one.counts.any()])):
            if one.mended is not None:
                now[one.log] = one.mended
                looks[one.log] = look(one.mended, model)
        found += seen
        if kind in _STEADIED:
            steadied = tuple(now.values())
    return _Checked(tuple(now.values()), tuple(found), steadied)


def first_looks(logs: Sequence[Log], model: Model, mend: Sequence[str],
                unasked: Sequence[str] = ()) -> tuple[tuple[Log, ...], tuple[str, ...]]:
    """Return logs with some kinds of findings mended, asked for or not, and what has to be said of all findings.

    Raises
    ------
    InputError
        If a kind is unknown, a command lies beyond the travel, whatever its zero, or a shaft turns faster than the
        servo could by far and no finding says why.
    """
    kinds = checked_words("mend", mend, MENDED)
    about = centred(logs, model)
    done = mended(about.logs, model, (*kinds, *unasked))
    left = _checked(done.logs, model, KINDS)
    check_speeds(left.steadied, model)
    return done.logs, (*about.sentences, *(f"mended: {one.sentence}" for one in done.findings),
                       *(one.sentence for one in left.findings))


@contextmanager
def explained(noticed: Sequence[str]) -> Iterator[None]:
    """Add what was noticed first to an error that it may be the cause of."""
    try:
        yield
    except InputError as error:
        if not noticed:
            raise
        raise InputError(f"{error}; {noticed[0]}") from None
