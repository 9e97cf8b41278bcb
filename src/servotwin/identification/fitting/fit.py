"""The result of a fit: values with intervals, what the logs cannot say, and the errors on logs that it has not seen."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.checks import checked_level
from servotwin.identification.fitting.registers import RegisterSearch, register_values
from servotwin.identification.fitting.search.free import LUMPED, FreeParameter, Space
from servotwin.identification.fitting.search.least_squares import Begin
from servotwin.identification.fitting.traces import ErrorTable, Interval, Trace
from servotwin.identification.fitting.uncertainty import Unidentifiable
from servotwin.logs.log import Log
from servotwin.models import Model
from servotwin.parameters import Servo
from servotwin.parameters.servo import N, Quantity
from servotwin.simulation.lanes.inputs import LOAD_NAMES

if TYPE_CHECKING:
    from servotwin.identification.fitting.assumptions import Allowed, Assumption, Ends
    from servotwin.identification.fitting.registers import RegisterSearch, RegisterValue
    from servotwin.identification.fitting.uncertainty import Uncertainty
    from servotwin.identification.fitting.verdict import Verdict
    from servotwin.identification.fitting.yielding import Doubts, Foreseen, Widened, Yielded


# --- Which logs are held out ------------------------------------------------------------------------------------------

_FEW = 4  # logs of one kind, below which none of it is held out


def split(logs: Sequence[Log], holdout: Any, seed: int) -> tuple[list[int], list[int]]:
    """Return which logs are fitted and which held out.

    Parameters
    ----------
    logs : sequence of Log
    holdout : None, float or sequence of str
        None holds out a fourth of the logs of each kind of motion of which there are at least four; a fraction as many
        of each kind; names exactly these; 0 none.
    seed : int

    Raises
    ------
    InputError
        If there is no such log, or none would be left.
    """
    rng = np.random.default_rng(seed)
    if isinstance(holdout, Sequence) and not isinstance(holdout, str):
        names = [log.name for log in logs]
        for name in holdout:
            if name not in names:
                raise InputError("holdout", got=name, allowed=", ".join(names))
        out = [k for k, name in enumerate(names) if name in set(holdout)]
    else:
        share = 0.25 if holdout is None else holdout
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0.0 <= share < 1.0:
            raise InputError("holdout", got=holdout, allowed="a share of the logs below 1, or names of logs")
        kinds: dict[str, list[int]] = {}
        for k, log in enumerate(logs):
            kinds.setdefault(log.motion, []).append(k)
        out = []
        for members in kinds.values():
            if holdout is None and len(members) < _FEW:
                continue
            count = min(math.floor(share * len(members) + 0.5), len(members) - 1)
            out += rng.permutation(members)[:count].tolist() if count > 0 else []
    if len(out) == len(logs):
        raise InputError("holdout", got="all logs", allowed="some of them; the rest is fitted")
    return sorted(set(range(len(logs))) - set(out)), sorted(out)


# --- The result of a fit ----------------------------------------------------------------------------------------------

LINEARISED_TIMES = 3.0
"""Times as wide as where the problem is straight, assumed: among kinks those of a finished fit are up to so wide."""
NOT_YET = "not determined yet"
"""How an interval is shown that a fit which was stopped has left open."""
LEAST_SHARE = 0.005
"""Of an interval: less prior than this is not worth a word."""


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
        Numbers that the logs cannot tell, in words.
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
        Remarks for a reader, a line each.
    doubt : Uncertainty
    spans : mapping of str to tuple of float
        Ranges (SI) of what pulses determine: the delay.
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
        Results that are not known because it was stopped.
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


# --- A fitted servo: its numbers with origin and spread, and the record of the fit in its file ------------------------

Array = NDArray[np.float64]

_MOVED = "this value goes with the others of a fit, whose logs do not determine it, see [fit]"


def identified_servo(servo: Servo, space: Space, shared: Array, doubts: Doubts, level: float,
                     yielded: Sequence[str] = ()) -> Servo:
    """Return a servo with the values of a point.

    Numbers that the logs determine are "identified", and their range is the interval. Those that they leave open keep
    origin, source and spread; their values are those that go with the others.

    Parameters
    ----------
    servo : Servo
        Before the fit.
    space : Space
    shared : ndarray, shape (p,)
    doubts : Doubts
    level : float
        Of the intervals.
    yielded : sequence of str
        Names whose prior was dropped: what the file said of them does not hold, and is not kept.
    """
    found = space.servo_at(shared[:len(space)])
    quantities = dict(found.quantities)
    open_ = {name for item in doubts.unidentifiable for name in item.parameters}
    for k, p in enumerate(space.parameters):
        if p.name in LOAD_NAMES:
            continue
        members, power, _ = LUMPED.get(p.name, ((p.name,), 0, ""))
        factor = float(found.get(N) or 1.0) ** power  # type: ignore[arg-type]
        spread = _spread(p, k, shared, doubts, factor)
        for member in members:
            value, unit = float(found.get(member)), found.quantities[member].unit  # type: ignore[arg-type]
            if p.name in open_ and p.name not in yielded:
                quantities[member] = _kept(servo.quantities.get(member), value, unit)
                continue
            given = {"lower": min(spread[0], value), "upper": max(spread[1], value)} if spread else {}
            said = f"{100 * level:g} % interval" if given else _unsure(doubts, p.name in open_)
            if p.name in LUMPED:
                said = f"as {p.name}; {said}"
            quantities[member] = Quantity(value=value, unit=unit, origin="identified",
                                          source=f"fit to logs, see [fit]; {said}", **given)
    return replace(found, quantities=quantities)


def _unsure(doubts: Doubts, left_open: bool) -> str:
    """Return why a value that a fit found has no range."""
    if left_open:
        return "the logs alone do not determine it, and contradict what the file said of it"
    if any(each.method == "linearised" for each in doubts.ends.values()):
        return "the fit was stopped before it was determined"
    return "no interval was sought" if doubts.doubt is None else "ended at a bound of the search"


def _spread(p: FreeParameter, k: int, shared: Array, doubts: Doubts, factor: float) -> tuple[float, float] | None:
    """Return the interval of a number's members; None where it has none."""
    if doubts.doubt is None or k not in doubts.ends:
        return None
    ends, std = doubts.ends[k], float(doubts.doubt.std[k])
    a, b = (float(np.clip(p.value(shared[k] + end * std), p.lower, p.upper)) / factor
            for end in (ends.lower, ends.upper))
    return (min(a, b), max(a, b)) if math.isfinite(a + b) else None


def _kept(before: Quantity | None, value: float, unit: str) -> Quantity:
    """Return what was known of a number that a fit did not determine, with the value that goes with the others."""
    if before is None:
        return Quantity(value=value, unit=unit, origin="assumed", source=f"no source; {_MOVED}")
    if not isinstance(before.value, float) or before.value == value:
        return before
    said = (before.source or "no source").removesuffix(f"; {_MOVED}")
    lower = None if before.lower is None else min(before.lower, value)
    upper = None if before.upper is None else max(before.upper, value)
    return replace(before, value=value, source=f"{said}; {_MOVED}", lower=lower, upper=upper)


def with_what_logs_say(servo: Servo, logs: Sequence[Log], searched: Sequence[str]) -> Servo:
    """Return a servo with the parameters that all logs give alike, such as their supply voltage.

    Parameters
    ----------
    servo : Servo
    logs : sequence of Log
        Those that were fitted.
    searched : sequence of str
        Parameters that the fit found, which stay.
    """
    first, *others = logs
    stays = {member for name in searched for member in (LUMPED[name][0] if name in LUMPED else (name,))}
    alike = {name: value for name, value in first.parameters.items() if name not in stays
             and value != servo.get(name) and all(log.parameters.get(name) == value for log in others)}
    if not alike:
        return servo
    said = servo.replace(alike)
    quantities = {name: Quantity(value=float(value), unit=said.quantities[name].unit, origin="measured",
                                 source="said of all logs that were fitted, in their sidecars")
                  for name, value in alike.items()}
    return replace(said, quantities={**said.quantities, **quantities})


def data_hash(logs: Sequence[Log]) -> str:
    """Return a hash of all that logs say.

    Examples
    --------
    >>> log = Log(name="a", time=[0.0, 1.0, 2.0], command=[0.0, 1.0, 1.0], command_kind="angle",
    ...           measured={"output_angle": [0.0, 0.5, 1.0]})
    >>> data_hash([log]) == data_hash([log]), len(data_hash([log]))
    (True, 64)
    """
    digest = hashlib.sha256()
    for log in logs:
        digest.update(repr((log.name, log.command_kind, log.command_hold, sorted(log.parameters.items()), log.left_out,
                            log.load)).encode())
        digest.update(np.ascontiguousarray(log.time).tobytes())
        digest.update(np.ascontiguousarray(log.command).tobytes())
        for name in sorted(log.measured):
            digest.update(name.encode() + np.ascontiguousarray(log.measured[name]).tobytes())
        if log.torque_on is not None:
            digest.update(np.packbits(log.torque_on).tobytes())
    return digest.hexdigest()


def with_record(fit: Fit, logs: Sequence[Log], fitted: Sequence[int], mend: Sequence[str] = ()) -> Fit:
    """Return a fit whose servo holds the record: data, model, version, bounds, errors, conditions.

    Parameters
    ----------
    fit : Fit
    logs : sequence of Log
        As they were given.
    fitted : sequence of int
        Which of them were fitted.
    mend : sequence of str
        Kinds of findings that were mended in them.
    """
    import servotwin

    motions = Counter(log.motion or "other" for log in logs)
    record: dict[str, Any] = {
        "data": f"sha256:{data_hash(logs)}", "logs": len(logs), "fitted_logs": len(fitted),
        "model": type(fit.model).__name__, "version": servotwin.__version__, "level": fit.level,
        "free": list(fit.space.names),
        "bounds": {p.name: [p.lower, p.upper] for p in fit.space.parameters},
        "at_bound": list(fit.at_bound), "undetermined": [str(item) for item in fit.unidentifiable],
        "yielded": [str(one) for one in fit.yielded], "widened": [str(one) for one in fit.widened],
        "prior_share": {name: round(share, 3) for name, share in fit.prior_share.items() if share >= LEAST_SHARE},
        "nuisance": {name: fit.estimates[name] for name in fit.names if name not in fit.space.names},
        "load": {p.name: fit.estimates[p.name] for p in fit.space.parameters if p.name in LOAD_NAMES},
        "noise": dict(fit.noise),
        "mended": list(mend),
        "conditions": {"motions": dict(motions), **_conditions(logs)},
        "training_error": fit.training.by().copy() if fit.training else {},
        "holdout_error": fit.holdout.by().copy() if fit.holdout else {},
    }
    if fit.phased:
        record["frame_phase"] = "of each log"
    if fit.ticked:
        record["control_phase"] = "of each log"
    if fit.verdict is not None:
        record["verdict"] = {"sentence": fit.verdict.sentence, "holds": fit.verdict.holds, "ratio": fit.verdict.ratio,
                             "causes": [cause.name for cause in fit.verdict.causes]}
    if fit.interrupted:
        record |= {"interrupted": True, "unknown": list(fit.unknown)}
    servo = replace(fit.servo, fit={key: value for key, value in record.items() if value not in ({}, [])})
    return replace(fit, servo=servo, model=type(fit.model)(servo))


def stopped(fit: Fit, missing: Sequence[str]) -> Fit:
    """Return a fit that a stop has left without something, and that says so."""
    if not missing:
        return fit
    said = f"stopped: the best so far; not known are {', '.join(missing)}"
    return replace(fit, interrupted=True, unknown=tuple(missing), warnings=(said, *fit.warnings))


def _conditions(logs: Sequence[Log]) -> dict[str, Any]:
    """Return labels and parameters of the logs: one value, or all that there are."""
    gathered: dict[str, dict[Any, None]] = {}
    for log in logs:
        for name, value in (*log.conditions.items(), *log.parameters.items()):
            gathered.setdefault(name, {})[value] = None
    return {name: next(iter(values)) if len(values) == 1 else list(values)
            for name, values in gathered.items() if len(values) <= 8}


def begin_after(fit: Fit, *, exactly: bool = True) -> Begin:
    """Return the beginning of a search at the end of a fit: its rig, while its servo is given apart.

    When pulses come is found anew: a law that lacks something takes other commands for the right ones.
    """
    if fit.phased:
        return Begin(exactly=exactly)
    return Begin(1, {name: fit.estimates[name] for name in fit.scales}, fit.own, exactly)


@dataclass(frozen=True)
class Rung:
    """One friction law, or one structure.

    Parameters
    ----------
    name : str
        "M1" to "M6", or such as "digital, diode, M1".
    fit : Fit
    training, holdout : float
        Rms error over all samples [rad]; nan without logs that were held out.
    criterion : float
        Bayesian information criterion of the fitted logs, with their residuals counted as often as those of the rung
        that leaves least are independent; smaller is better.
    """

    name: str
    fit: Fit
    training: float
    holdout: float
    criterion: float

    @property
    def overfits(self) -> bool:
        """Whether it is much better on the logs that it was fitted to than on others."""
        return self.holdout > 1.3 * self.training


@dataclass(frozen=True)
class Ladder:
    """All rungs, and the one that is chosen.

    Parameters
    ----------
    rungs : tuple of Rung
    chosen : str
    reason : str
    error : float
        Rms error on logs that had no say in the choice [rad], smaller ones being luck: the logs that were held out are
        halved, each half chooses a rung, and the other half tells its error. Where the criterion chose, that of all
        logs that were held out; nan with fewer than two.
    choices : tuple of str
        The rungs that the halves chose: two that differ are a close call.
    """

    rungs: tuple[Rung, ...]
    chosen: str
    reason: str
    error: float = math.nan
    choices: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """That of the chosen rung."""
        return self[self.chosen].fit

    def __getitem__(self, name: str) -> Rung:
        for rung in self.rungs:
            if rung.name == name:
                return rung
        raise InputError("rung", got=name, allowed=", ".join(rung.name for rung in self.rungs))


@dataclass(frozen=True, kw_only=True, eq=False)
class Validation:
    """How far a servo is off some logs.

    Parameters
    ----------
    servo : Servo
    model : Model
    errors : ErrorTable
        By log, of this one model.
    traces : tuple of Trace
        Every log beside the simulation.
    nuisance : mapping of str to float
        Delay [s], angle offset [rad] and sag [rad/V] that were used.
    fitted : tuple of str
        Which nuisances were fitted to these logs; the others come from the servo file's record of its fit, or are 0.
    noise : mapping of str to float
        How far the residuals of each sensor scatter, robust (SI).
    warnings : tuple of str
        Probable errors of the logs, a line each.
    registers : RegisterSearch, optional
        Of a bus servo: what stands in registers that logs did not record.
    """

    servo: Servo
    model: Model
    errors: ErrorTable = field(repr=False)
    traces: tuple[Trace, ...] = field(repr=False)
    nuisance: Mapping[str, float]
    fitted: tuple[str, ...]
    noise: Mapping[str, float]
    warnings: tuple[str, ...] = ()
    registers: RegisterSearch | None = field(default=None, repr=False)

    @property
    def total(self) -> float:
        """Rms error over all samples of all logs [rad, or V where feedback voltages were measured]."""
        return self.errors.total()[type(self.model).__name__]

    def report(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write an HTML page: errors, measured over simulated, residuals.

        Raises
        ------
        OutputExistsError, OutputError
            If the file exists and `overwrite` is false, or it cannot be written.
        """
        from servotwin.identification.report.page import write_validation

        return write_validation(self, Path(path), overwrite=overwrite)
