"""What a fit found: values with intervals, what the logs cannot say, and the errors on logs that it has not seen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.checks import checked_level
from servotwin.identification.fitting.free import Space
from servotwin.identification.fitting.holdout import ErrorTable, LogError, log_error
from servotwin.identification.fitting.uncertainty import Unidentifiable
from servotwin.logs.log import Log
from servotwin.models import Model
from servotwin.parameters import Servo

if TYPE_CHECKING:
    from servotwin.identification.fitting.assumptions import Assumption, Ends
    from servotwin.identification.fitting.draws import Allowed
    from servotwin.identification.fitting.ladder import Ladder
    from servotwin.identification.fitting.registers import RegisterSearch, RegisterValue
    from servotwin.identification.fitting.uncertainty import Uncertainty
    from servotwin.identification.fitting.verdict import Verdict
    from servotwin.identification.fitting.yielding import Foreseen, Widened, Yielded
    from servotwin.signals import Signal

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
