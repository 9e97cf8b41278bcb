"""Where candidates are tried: a few logs, some samples of which teach and others judge, and how much may be spent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.search.case import LogPart, Point, joined, robust_deviation
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.least_squares import Begin, Search, by_sensor
from servotwin.identification.fitting.search.phases import settled
from servotwin.identification.fitting.search.task import Task
from servotwin.logs.log import ANGLES, Log
from servotwin.models import Model

# --- Which samples of a log teach a trial, and what a trial gains on those that judge it ------------------------------

_PARTS = 4  # of a log: every second one teaches, the others judge
_BLOCK = 20  # samples that are judged together
_MOST_OF = 0.98  # of the samples, beyond which a larger error counts no more
_COUNTS = ((3.0, 0.95), (2.3, 0.75), (1.5, 0.5))
"""Standard errors, and the share of the error that may be left: by chance one trial of 700 is so good, of 90 if it also
takes a fourth of the error away, of 15 if it takes half of it away."""


def teaching(time: Array, *, alternate: bool) -> NDArray[np.bool_]:
    """Return which samples teach: those of every second part of a log, or every second sample.

    Examples
    --------
    >>> teaching(np.arange(8.0), alternate=False).tolist()
    [True, True, False, False, True, True, False, False]
    """
    if alternate:
        return np.asarray(np.arange(len(time)) % 2 == 0)
    span = max(float(time[-1] - time[0]), 1e-12) * (1.0 + 1e-9)
    parts = (_PARTS * (time - time[0]) / span).astype(np.int64)
    return np.asarray(parts % 2 == 0)


@dataclass(frozen=True)
class Gain:
    """The gain of a trial on samples that did not teach it: rms error before and after (SI), and how surely."""

    before: float
    after: float
    sure: float

    @property
    def counts(self) -> bool:
        """Whether it is more than chance, and worth a word."""
        return any(self.sure > sure and self.after < worth * self.before for sure, worth in _COUNTS)


@dataclass(frozen=True)
class Told:
    """A candidate that was tried: its name, its words, what to do about it, and what it gains."""

    name: str
    words: str
    remedy: str
    gain: Gain


def gain(before: Sequence[Array], after: Sequence[Array], noise: float, *, alternate: bool = False) -> Gain:
    """Return what a trial gains, from the residuals of all logs at all samples (SI).

    Stretches are compared by the logarithm of their powers, so that no single one decides.
    """
    said, pairs = [], []
    for b, a in zip(before, after, strict=True):
        n = min(len(a), len(b))
        judge = ~teaching(np.arange(max(n, 2), dtype=np.float64), alternate=alternate)[:n]
        b, a = b[:n][judge], a[:n][judge]
        pairs.append((b, a))
        for x, y in zip(*(np.array_split(v, max(1, len(v) // _BLOCK)) for v in (b, a)), strict=True):
            if len(x):
                said.append(math.log((float(np.mean(x**2)) + noise**2) / (float(np.mean(y**2)) + noise**2)))
    every = np.array(said)
    spread = float(every.std(ddof=1)) / math.sqrt(len(every)) if len(every) > 1 else math.inf
    sure = float(every.mean()) / spread if spread > 0.0 else 0.0
    b, a = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    far = float(np.quantile(np.abs(b), _MOST_OF))  # outliers are in both
    errors = [float(np.sqrt(np.mean(np.minimum(np.abs(v), far)**2))) for v in (b, a)]
    return Gain(errors[0], errors[1], sure if math.isfinite(sure) else 0.0)


# --- Where candidates are tried ---------------------------------------------------------------------------------------

Array = NDArray[np.float64]
_STEPS, _FEW_STEPS = 25, 10  # of what is cheap to simulate, and of what is not
DEAR = 3.0  # times a simulation of closed form
_ROUNDS = 4  # of search and noise
_COPY = 4.0  # s of one lane: about what a log takes that is made ready to be simulated once
_LEAST = 2e-3  # of the cost: what a step has to gain
_FINER = 0.7  # of the noise: then a search continues with less
_FELT, _FORETOLD = 0.02, 0.02  # of the root of what is left, and of its cost: what an effect has to reach to be tried
_SOON = 4  # steps of a search that show whether it gains
_REACH = 0.5  # of a searched number: how far the others are moved before a trial is searched


class Spent(Exception):  # noqa: N818 - it ends a trial, and is no error
    """No more simulation is allowed."""


@dataclass
class Purse:
    """How much may be simulated, in seconds of one lane of closed form."""

    left: float

    def check(self, at_least: float = 0.0) -> None:
        """Ask for more simulation, perhaps of so much.

        Raises
        ------
        Spent
            If nothing is left.
        """
        if self.left <= at_least:
            raise Spent


class Watched(Forecast):
    """A forecast whose search sees some samples only, and that pays for what it simulates; to be judged is free."""

    def __init__(self, purse: Purse, price: float, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.purse, self.price = purse, price
        self.strict = False
        self.seen: tuple[NDArray[np.bool_], ...] | None = None

    def at_all(self, points: Sequence[Point], **how: Any) -> list[list[LogPart]]:
        """Return what the logs say at several points; samples that are not seen say nothing."""
        which = range(len(self.cases)) if how.get("cases") is None else how["cases"]
        if self.seen is not None:
            self.purse.check()
        before = self.work
        found = super().at_all(points, **how)
        self.purse.left -= self.price * (self.work - before)
        if self.seen is None:
            return found
        each = how.get("each") or [which] * len(points)
        return [[_hidden(part, self.seen[k]) for k, part in zip(some, parts, strict=True)]
                for some, parts in zip(each, found, strict=True)]


def _hidden(part: LogPart, seen: NDArray[np.bool_]) -> LogPart:
    keep = seen.astype(np.float64)
    later = part.later * keep if len(part.later) else part.later
    return part._replace(residual=part.residual * keep, shared=part.shared * keep[:, None],
                         own=part.own * keep[:, None], later=later)


@dataclass(frozen=True)
class Setting:
    """Changes of a trial: logs, servo, and what is searched from which values.

    Parameters
    ----------
    logs : tuple of Log
        As many as the bench has, in its order.
    model : Model
    values : mapping of str to float
        Where numbers that are searched in addition, or under another name, begin (SI).
    without : tuple of str
        Names that are not searched any more.
    nuisance : tuple of str, optional
    price : float
        Of a simulation, in those of closed form.
    afresh : bool
        Whether it is tried from the servo's values too: what the fit found may be far from what these logs say.
    """

    logs: tuple[Log, ...]
    model: Model
    values: Mapping[str, float] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    nuisance: tuple[str, ...] | None = None
    price: float = 1.0
    afresh: bool = False


@dataclass(frozen=True)
class Trial:
    """A setting that was searched: its forecast, where it ended, and the residuals of the angle log by log (SI)."""

    setting: Setting
    forecast: Watched
    point: Point
    residuals: tuple[Array, ...]


class TrialBench:
    """Some logs of a fit, and where trials begin.

    Parameters
    ----------
    task : Task
        Of the fit.
    point : Point
        Where it ended.
    cases : sequence of int
        Which of its logs are tried.
    purse : Purse
    noise : float
        Of the angle, without a model (SI).
    """

    def __init__(self, task: Task, point: Point, cases: Sequence[int], purse: Purse, noise: float) -> None:
        self.task, self.purse, self.noise, self.whole = task, purse, noise, point
        old = task.forecast
        self.point = Point(point.shared, tuple(point.own[k] for k in cases),
                           tuple(old.frames_of(point, k) for k in cases) if old.phased else ())
        self.setting = Setting(tuple(old.cases[k].log for k in cases), old.model, nuisance=old.nuisance)
        self.old = old
        self.cases = [old.cases[k] for k in cases]
        self.base = self.searched(self.setting, alternate=False)

    def forecast(self, setting: Setting, *, alternate: bool = False) -> Watched:
        """Return the forecast of a setting, which sees what teaches.

        Raises
        ------
        InputError
            If the model cannot follow the logs so.
        """
        names = [name for name in self.old.space.names if name not in setting.without]
        names += [name for name in setting.values if name not in names]
        made = self.old.space.changed(setting.model, names)
        nuisance = self.old.nuisance if setting.nuisance is None else setting.nuisance
        forecast = Watched(self.purse, setting.price, setting.logs, setting.model, made, nuisance, self.old.sensors)
        forecast.goes_on_from(self.old)  # a search of smaller residuals takes less noise
        forecast.nearly = forecast.bent
        forecast.seen = tuple(_teaches(forecast, k, alternate=alternate) for k in range(len(forecast.cases)))
        return forecast

    def start(self, forecast: Watched, setting: Setting, point: Point) -> Point:
        """Return where the numbers of the fit, and those of a setting, stand in its forecast."""
        old = self.old
        known = {p.name: float(p.value(point.shared[k])) for k, p in enumerate(old.space.parameters)}
        known |= setting.values
        x = [p.scaled(min(max(known[p.name], p.lower), p.upper)) for p in forecast.space.parameters]
        nominal = self.task_of(forecast).nominal()
        shared = np.concatenate([x, nominal.shared[len(x):]])
        for name in forecast.extra:
            if name in old.extra:
                shared[len(x) + forecast.extra.index(name)] = point.shared[len(old.space) + old.extra.index(name)]
        own = []
        for case, before, values, first in zip(forecast.cases, self.cases, point.own, nominal.own, strict=True):
            there = dict(zip(old.names_of_own(before), values, strict=True))
            own.append(np.array([there.get(name, value) for name, value in
                                 zip(forecast.names_of_own(case), first, strict=True)]))
        frames = point.frames if forecast.phased and old.phased else ()
        return Point(shared, tuple(own), frames)

    def task_of(self, forecast: Watched) -> Task:
        """Return the search of all logs of a forecast."""
        return Task(forecast, self.task.loss, list(range(len(forecast.cases))), 0, Begin(), dict(forecast.noise))

    def search(self, forecast: Watched, cases: Sequence[int] | None = None) -> Search:
        """Return the search over a forecast, with the bounds and priors of the fit."""
        task = self.task_of(forecast)
        everything = list(range(len(forecast.cases))) if cases is None else list(cases)
        return Search(forecast, task.loss, task.prior, task.lower, task.upper, everything, task.held)

    def searched(self, setting: Setting, point: Point | None = None, *, alternate: bool = False) -> Trial:
        """Return a trial: searched on what teaches, from where the fit stands."""
        forecast = self.forecast(setting, alternate=alternate)
        start = self.start(forecast, setting, self.point if point is None else point)
        found = self._run(forecast, start)
        return Trial(setting, forecast, found, self.judged(forecast, found))

    def afresh(self, setting: Setting) -> Trial:
        """Return a trial that is searched from the servo's values, pulses included."""
        forecast = self.forecast(setting)
        task = self.task_of(forecast)
        found = self._run(forecast, task.nominal())
        if forecast.phased:
            forecast.own_phases = True
            found = self._run(forecast, settled(task.scan(found), task.fitted))
        return Trial(setting, forecast, found, self.judged(forecast, found))

    def apart(self, group: Sequence[int]) -> tuple[Array, ...]:
        """Return the residuals of the angle with numbers for some logs alone, from the base or from the servo's values.

        The one that is better on samples that teach counts.
        """
        forecast = self.forecast(self.setting)
        forecast.noise = dict(self.base.forecast.noise)
        task = self.task_of(forecast)
        search = self.search(forecast, group)
        near = search.run(self.base.point, most=_STEPS).point
        fresh = search.run(task.nominal(), most=_STEPS).point
        if forecast.phased:
            forecast.own_phases = True
            fresh = search.run(settled(task.scan(fresh), list(group)), most=_STEPS).point
        costs = search.costs([near, fresh])
        return self.judged(forecast, near if costs[0] <= costs[1] else fresh)

    def left(self, trial: Trial) -> float:
        """Return the cost that a trial leaves on what taught it, in units of the sensor's noise."""
        kept = [r[teaching(np.arange(len(r), dtype=np.float64), alternate=False)] for r in trial.residuals]
        return self.task.loss.cost(np.concatenate(kept) / self.noise)

    def _run(self, forecast: Watched, start: Point) -> Point:
        """Search, and search on in the noise of what is left; a search that may not continue ends at its best so far.

        Raises
        ------
        Spent
            If it may not even begin.
        """
        cheap, reached = forecast.price <= DEAR, [start]
        try:
            for _ in range(_ROUNDS if cheap else 1):
                search = self.search(forecast)
                least = _LEAST * max(search.costs(reached[-1:])[0], 1.0)
                reached.append(search.run(reached[-1], most=_STEPS if cheap else _FEW_STEPS,
                                          tell=lambda _, best: reached.append(best.point),
                                          least_gain=least if math.isfinite(least) else 1.0).point)
                if not _finer(forecast, reached[-1]):
                    break
        except Spent:
            if len(reached) == 1:
                raise
        return reached[-1]

    def judged(self, forecast: Watched, point: Point) -> tuple[Array, ...]:
        """Return the residuals of the angle at all samples, log by log (SI)."""
        seen, forecast.seen = forecast.seen, None
        parts = forecast.at(point, derivatives=False)
        forecast.seen = seen
        return tuple(_angle(by_sensor(forecast, k, part)) for k, part in enumerate(parts))

    def copies(self, k: int, logs: Sequence[Log], point: Point) -> list[Array]:
        """Return the residuals of the angle of copies of one log with other commands or times, in one batch (SI)."""
        self.purse.check(sum(log.duration + _COPY for log in logs))
        self.purse.left -= _COPY * len(logs)
        old = self.base.forecast
        forecast = Watched(self.purse, 1.0, logs, old.model, old.space, old.nuisance, old.sensors, None, old.cases[k])
        forecast.goes_on_from(old)
        forecast.nearly = forecast.bent
        frames = (old.frames_of(point, k),) * len(logs) if old.phased else ()
        return list(self.judged(forecast, Point(point.shared, (point.own[k],) * len(logs), frames)))

    def counted(self, k: int) -> NDArray[np.int64]:
        """Return which rows of a log have an angle that counts."""
        case = self.base.forecast.cases[k]
        times = case.times[case.places[case.log.angle_name]]
        return np.flatnonzero(np.isin(case.log.time - case.log.time[0], times))

    def promise(self, setting: Setting) -> float:
        """Return the cost of what teaches at the start of a setting, the other numbers moved along to first order."""
        forecast = self.forecast(setting)
        start = self.start(forecast, setting, self.base.point)
        parts = forecast.at(start, derivatives=False)
        r = np.concatenate([part.residual for part in parts])
        (_, J), loss = self._slopes(), self.task.loss
        if not np.isfinite(r).all():
            return math.inf
        if len(J) != len(r):
            return loss.cost(r)
        return loss.linear_step(r, J, np.full(J.shape[1], _REACH**-2.0))[1]

    def may_gain(self, setting: Setting) -> bool:
        """Tell whether a setting can gain enough to count, as far as its effect at its start tells: in proportion.

        Settings searched from the servo's values, or with other numbers, are not foretold.
        """
        if setting.afresh or setting.without or setting.nuisance not in (None, self.setting.nuisance):
            return True
        forecast, base = self.forecast(setting), self.base.forecast
        forecast.noise = dict(base.noise)
        parts = forecast.at(self.start(forecast, setting, self.base.point), derivatives=False)
        (r, J), there = self._slopes(), np.concatenate([part.residual for part in parts])
        if len(there) != len(r) or not np.isfinite(there).all():
            return True
        d = there - r
        if not setting.values:
            return float(d @ d) > _FELT**2 * float(r @ r)
        loss, A = self.task.loss, np.column_stack([J, d])
        ridge = np.append(np.full(J.shape[1], _REACH**-2.0), 1e-9 * float(d @ d) + 1e-300)
        step, cost = loss.linear_step(r, A, ridge)
        return bool(step[-1] > 0.0) and cost < (1.0 - _FORETOLD) * loss.cost(r)

    def gains_soon(self, setting: Setting) -> bool:
        """Tell whether a few steps of its search gain enough: what acts out of proportion is not foretold."""
        forecast, base = self.forecast(setting), self.base
        forecast.noise = dict(base.forecast.noise)
        start = self.start(forecast, setting, base.point)
        reached = self.search(forecast).run(start, most=_SOON).cost
        return reached < (1.0 - _FORETOLD) * self.search(base.forecast).costs([base.point])[0]

    def _slopes(self) -> tuple[Array, Array]:
        """Return residuals and derivatives of what teaches at the base."""
        if not hasattr(self, "_known"):
            parts = self.base.forecast.at(self.base.point)
            self._known = np.concatenate([part.residual for part in parts]), joined(parts)
        return self._known


def _finer(forecast: Watched, point: Point) -> bool:
    """Take the noise of what is left, and tell whether it is so much less that a search would continue."""
    left: dict[str, list[Array]] = {}
    for k, part in enumerate(forecast.at(point, derivatives=False)):
        for name, residual in by_sensor(forecast, k, part).items():
            left.setdefault(name, []).append(residual[residual != 0.0])
    new = {name: robust_deviation(np.concatenate(some)) for name, some in left.items()
           if sum(map(len, some))}
    if not all(math.isfinite(value) and value > 0.0 for value in new.values()):
        return False
    less = any(value < _FINER * forecast.noise[name] for name, value in new.items())
    forecast.noise = forecast.noise | new
    return less


def _angle(residuals: Mapping[str, Array]) -> Array:
    return residuals[next(name for name in ANGLES if name in residuals)]


def _teaches(forecast: Forecast, k: int, *, alternate: bool) -> NDArray[np.bool_]:
    case = forecast.cases[k]
    return np.concatenate([teaching(case.times[place], alternate=alternate) for place in case.places.values()])
