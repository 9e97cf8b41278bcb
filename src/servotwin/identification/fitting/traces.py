"""Logs beside what a servo would have done: traces, and errors by log."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.logs.log import Log

if TYPE_CHECKING:
    from servotwin.signals import Signal

Array = NDArray[np.float64]

@dataclass(frozen=True)
class LogError:
    """How far a model is off one log.

    Parameters
    ----------
    log, motion : str
    conditions : mapping
        Labels of the log; its supply voltage and load included.
    rms, largest : float
        Of simulated less measured [rad], or [V] where the log has no angle.
    samples : int
    spread : float
        Rms of what was measured about its mean, in the same unit; nan where it is not known.
    """

    log: str
    motion: str
    conditions: Mapping[str, float | str]
    rms: float
    largest: float
    samples: int
    spread: float = math.nan

    @property
    def fit_percent(self) -> float:
        """How much of the measured motion is reproduced: 100 all, 0 no more than by its mean."""
        return fit_percent([self])


@dataclass(frozen=True)
class ErrorTable:
    """Errors of several models on the same logs.

    Parameters
    ----------
    models : tuple of str
    errors : mapping of str to tuple of LogError
        Of each model, log by log.

    Examples
    --------
    >>> error = LogError("a", "step", {"gain": 100.0}, 0.03, 0.05, 10)
    >>> table = ErrorTable(("M1",), {"M1": (error,)})
    >>> table.by("motion"), table.by("gain")
    ({'step': {'M1': 0.03}}, {'100': {'M1': 0.03}})
    """

    models: tuple[str, ...]
    errors: Mapping[str, tuple[LogError, ...]]

    def __bool__(self) -> bool:
        return bool(self.models) and bool(self.errors[self.models[0]])

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the logs."""
        return tuple(error.log for error in self.errors[self.models[0]]) if self.models else ()

    def labels(self) -> tuple[str, ...]:
        """Return by what the errors can be sorted: "motion", and every condition of which there are several values."""
        first = self.errors[self.models[0]] if self.models else ()
        names = dict.fromkeys(name for error in first for name in error.conditions)
        return ("motion", *(name for name in names if len({_text(e.conditions.get(name)) for e in first}) > 1))

    def by(self, label: str = "motion",
           measure: Callable[[Iterable[LogError]], float] | None = None) -> dict[str, dict[str, float]]:
        """Return the rms error over all samples of each value of a label, or another measure, for each model."""
        measure, found = measure or pooled, dict[str, dict[str, float]]()
        for model in self.models:
            groups: dict[str, list[LogError]] = {}
            for error in self.errors[model]:
                value = error.motion if label == "motion" else _text(error.conditions.get(label))
                groups.setdefault(value or "other", []).append(error)
            for value, group in groups.items():
                found.setdefault(value, {})[model] = measure(group)
        return found

    def total(self, measure: Callable[[Iterable[LogError]], float] | None = None) -> dict[str, float]:
        """Return the rms error over all samples, or another measure, for each model."""
        return {model: (measure or pooled)(self.errors[model]) for model in self.models}


def pooled(errors: Iterable[LogError]) -> float:
    """Return the rms over all samples of some logs.

    Examples
    --------
    >>> pooled([LogError("a", "", {}, 3.0, 3.0, 1), LogError("b", "", {}, 4.0, 4.0, 1)])
    3.5355339059327378
    """
    items = [e for e in errors if e.samples]
    total = sum(e.samples for e in items)
    return math.sqrt(sum(e.rms**2 * e.samples for e in items) / total) if total else math.nan


def fit_percent(errors: Iterable[LogError]) -> float:
    """Return how much of the measured motion of some logs is reproduced: 100 (1 − |y − ŷ|/|y − ȳ|), ȳ of each log.

    100 is all, 0 no more than by the mean of each log, and less than 0 is worse; nan of a shaft that stands. It is the
    "fit" of the System Identification Toolbox (Ljung).

    Examples
    --------
    >>> fit_percent([LogError("a", "", {}, 1.0, 3.0, 100, 10.0), LogError("b", "", {}, 3.0, 4.0, 100, 10.0)])
    77.63932022500211
    """
    items = [e for e in errors if e.samples]
    spread = math.sqrt(sum(e.spread**2 * e.samples for e in items))
    return 100.0 * (1.0 - math.sqrt(sum(e.rms**2 * e.samples for e in items)) / spread) if spread > 0.0 else math.nan


def log_error(log: Log, difference: NDArray[np.float64], measured: NDArray[np.float64] | None = None) -> LogError:
    """Return the error of one log from the differences at its samples that count, and what was measured there."""
    conditions: dict[str, float | str] = dict(log.conditions)
    voltage = log.parameters.get("supply.open_circuit_voltage")
    if voltage is not None and "voltage" not in conditions:
        conditions["voltage"] = voltage
    if "load" not in conditions:
        conditions["load"] = _load(log)
    return LogError(log.name, log.motion, conditions, float(np.sqrt(np.mean(difference**2))),
                    float(np.abs(difference).max()), len(difference),
                    math.nan if measured is None else float(np.std(measured)))


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
        Differences from the fitted servo in this log (SI): what the log says, and when its program's first tick comes.
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
class ErrorTables:
    """Errors of the fitted servo and of the models beside it, and what delay, slew and lag leave, log by log."""

    training: ErrorTable
    holdout: ErrorTable
    slew: Mapping[int, Array]


def _load(log: Log) -> str:
    load = log.load
    parts = [f"{load.total_inertia:.3g} kg m²"] if load.total_inertia else []
    parts += [f"{p.mass * p.length * p.gravity:.3g} N m pendulum" for p in load.pendulums]
    if load.torque:
        parts.append(f"{load.torque:.3g} N m")
    return ", ".join(parts) or "none"


def _text(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, int | float) else str(value)
