"""The search of a fit: random starts, rough searches on some logs, and the last one on all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    MOST_DELAY,
    OFFSET_SCALE,
    PERIOD_SCALE,
    SAG_SCALE,
    SHARED,
    STEP,
    TIME,
    LogPart,
    Point,
)
from servotwin.identification.fitting.search.clocks import DELAYS, at_likely_delay, first_offset, ticking, with_clocks
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.least_squares import (
    Begin,
    Loss,
    Outcome,
    Prior,
    Search,
    scatter_of,
    together,
)
from servotwin.identification.fitting.search.phases import Scan, widening
from servotwin.identification.fitting.uncertainty import Counts, Rows, rows_of
from servotwin.logs.log import ANGLES

Array = NDArray[np.float64]

_TRIED = 8  # random points for each search that is begun
_FIRST_LOGS = 8  # of the first, rough searches
_ALIKE, _NEARLY = 1.03, 1.3  # times the least cost of the rough searches, in which pulses do not come when they do
_APART = 0.3  # the logarithm of a factor, between ends that are in different valleys
_CLOSELY = 1e-4  # of the cost, for each residual: what a step has to gain between the rough searches and the last one
_AMONG_KINKS = 1e-3  # the same of a servo with a program
_ROUGH = 0.003  # of the cost: what a step of a rough search has to gain
_BLIND = 1e3  # times the noise: a sensor that does not count yet
_MOST_OFFSET = 12.0  # rad, nearly two turns: an encoder's zero may be anywhere
_MOST_SAG = 3.0  # rad/V
_STARTS = 0.6  # of the way: rough searches from several starts
_MOST = {"rough": 12, "all": 25, "few": 10}  # steps
_FEW_ROUNDS = 2  # of search and noise among kinks, where a search wanders on for ever
_BLOCKS, _BLOCK_PAYS = 6, 1.0  # of steps, after the first ones; independent residuals whose share each has to gain
_MANY_LOGS = 16  # from which on half as many lead near
_ABOUT = 0.3  # of a searched number: how far off a servo file may be, while clocks are sought
_NOTHING = 0.35  # of what a search began with
_PAYS = 10.0  # of the cost, for each independent residual: what another clock has to gain

Told = Callable[[float, str], None]


@dataclass
class Task:
    """The search over one forecast: where it stands, and its stages."""

    forecast: Forecast
    loss: Loss
    fitted: list[int]
    seed: int
    begin: Begin
    noise: Mapping[str, float] | None

    def __post_init__(self) -> None:
        space, extra = self.forecast.space, self.forecast.extra
        period = self.period / PERIOD_SCALE
        reach = {"delay": (0.0, MOST_DELAY / DELAY_SCALE), "frame_period": (0.9 * period, 1.1 * period),
                 "angle_offset": (-_MOST_OFFSET / OFFSET_SCALE, _MOST_OFFSET / OFFSET_SCALE),
                 "angle_sag": (-_MOST_SAG / SAG_SCALE, _MOST_SAG / SAG_SCALE)}
        self.lower = np.concatenate([space.lower, [reach[name][0] for name in extra]])
        self.upper = np.concatenate([space.upper, [reach[name][1] for name in extra]])
        beliefs = [p.scaled_prior for p in space.parameters] + [None] * len(extra)
        self.prior = Prior(np.array([b[0] if b else 0.0 for b in beliefs]),
                           np.array([1.0 / b[1] if b else 0.0 for b in beliefs]))
        if self.noise is not None and TIME in self.noise:
            self.forecast.noise[TIME] = self.noise[TIME]
        self.remarks: list[str] = []  # on what the search found out about clocks
        self.doubted = False  # whether registers are likely not what the caller says: what is bent then is no motor
        self.unsure: tuple[str, ...] = ()  # of which commands it is not sure which pulse carries them
        self.stamps_off: dict[int, float] = {}  # by how much the beat that replaced a log's stamps may lie off [s]
        self._best: Outcome | None = None  # of the search in progress
        self._ended: list[Outcome] = []  # where rough searches ended, each in its own noise

    @property
    def period(self) -> float:
        """T_f that the logs or the servo say [s]."""
        return self.forecast.cases[0].period

    @property
    def held(self) -> NDArray[np.bool_]:
        """Which shared numbers stay: the delay, where each log's own pulses say when they take effect."""
        own = self.forecast.phased and self.forecast.own_phases
        return np.array([False] * len(self.forecast.space) + [own and name == "delay" for name in self.forecast.extra])

    def nominal(self) -> Point:
        """Return where the servo's values stand."""
        offset = first_offset(self.forecast, self.fitted) / OFFSET_SCALE
        first = {"delay": DELAYS[0] / DELAY_SCALE, "angle_offset": offset, "angle_sag": 0.0,
                 "frame_period": self.period / PERIOD_SCALE,
                 **{name: value / SHARED[name][0] for name, value in self.begin.shared.items()}}
        shared = np.concatenate([self.forecast.space.start, [first[name] for name in self.forecast.extra]])
        return Point(np.clip(shared, self.lower, self.upper),
                     self.begin.own or tuple(self.forecast.own_start(case) for case in self.forecast.cases))

    def search(self, tell: Told) -> tuple[Outcome, list[Outcome]]:
        """Return the best point, and where the search from each start ended; the way is reported after each step."""
        self.forecast.nearly = self.forecast.bent
        nominal = at_likely_delay(self, self.nominal())
        self._set_noise(self.forecast.at(nominal, derivatives=False, cases=self.fitted), self.fitted)
        self.forecast.strict = False  # from here on, what no servo is counts as failed
        ended: list[Outcome] = []
        began = _STARTS if self.begin.searches > 1 else 0.0
        if self.begin.searches > 1:
            ended = self._rough(nominal, tell)
            nominal = ended[0].point
        tell(began, "all logs")
        if len(self.forecast.sensors) > 1 and self.noise is None:
            self._set_noise(self.forecast.at(nominal, derivatives=False, cases=self.fitted), self.fitted, rough=True)
            nominal = self._search(self.fitted).run(
                nominal, most=_MOST["all"], tell=self._kept(tell, began, began, "all", "all logs")).point
            self._set_noise(self.forecast.at(nominal, derivatives=False, cases=self.fitted), self.fitted)
        if self.forecast.phased:
            nominal = with_clocks(self, [nominal, *self._elsewhere(ended)], tell, began)
        nominal = self._out_of_nothing(nominal, tell, began)
        if self.forecast.nearly:
            near = self._refined(nominal, self.fitted, rounds=3, tell=tell, began=began)
            if not self.begin.exactly:
                near = self._as_long_as_it_pays(near, tell)
                self.forecast.nearly = False
                return near, ended or [near]
            nominal = near.point
            self.exactly(nominal)
        best = self._refined(nominal, self.fitted, rounds=6, tell=tell, began=began)
        return best, ended or [best]

    def _elsewhere(self, ended: Sequence[Outcome]) -> list[Point]:
        """Return the best end that is nearly as good as the best of all and lies far from it, if there is one.

        One that is just as good lies along what the logs do not determine.
        """
        if not ended:
            return []
        best, factors = ended[0], np.array([p.logarithmic for p in self.forecast.space.parameters])
        size = len(factors)
        far = [one.point for one in ended[1:] if _ALIKE < one.cost / best.cost < _NEARLY
               and (np.abs(one.point.shared - best.point.shared)[:size][factors] > _APART).any()]
        return far[:1]

    def _out_of_nothing(self, point: Point, tell: Told, began: float) -> Point:
        """Return the point, or a better one with more of what went to nothing: friction, deadband, and their like.

        A shaft without friction is a valley of its own, beside a low ridge. So once more with as much as at the start
        until all else has followed.
        """
        space, x = self.forecast.space, point.shared
        gone = np.zeros(len(x), np.bool_)
        gone[:len(space)] = [not p.logarithmic and p.lower == 0.0 and x[k] < _NOTHING * space.start[k]
                             for k, p in enumerate(space.parameters)]
        if not gone.any():
            return point
        there = np.where(gone, self.nominal().shared, x)
        begun = self._search(self.fitted, gone).run(point._replace(shared=there), most=_MOST["all"])
        here, other = self.ran_all([point, begun.point], tell, began)
        return ticking(self, other.point, tell, began) if other.cost < here.cost else here.point

    def some_of_many(self) -> Task:
        """Return the search on some logs of every kind of motion, which lead near; itself unless there are many."""
        if len(self.fitted) <= _MANY_LOGS:
            return self
        return self.like(self.forecast, cases=self.few(_MANY_LOGS // 2))

    def ran(self, start: Point, tell: Told, began: float) -> Outcome:
        """Search from a point on all logs that are fitted, as closely as is needed to choose between points."""
        return self.ran_all([start], tell, began)[0]

    def ran_all(self, starts: Sequence[Point], tell: Told, began: float, most: int = _MOST["all"]) -> list[Outcome]:
        """Search from several points, side by side, with so many steps at most."""
        keep = self._kept(tell, began, began, "all", "all logs")
        closely = _CLOSELY if self.forecast.step <= STEP else _AMONG_KINKS
        least = closely * sum(self.forecast.cases[k].count for k in self.fitted)
        search = self._search(self.fitted)
        return together(self.forecast, self.fitted, [
            search.steps(start, most=most, tell=keep, least_gain=least) for start in starts])

    def exactly(self, point: Point) -> None:
        """Continue by the engine itself from a point, in the noise that it leaves there."""
        self.forecast.nearly = False
        self.measure(point)

    @contextmanager
    def nearly(self, point: Point) -> Generator[None]:
        """Let searches go fast for a while, in the noise that is left at a point then."""
        if not self.forecast.bent:
            yield
            return
        noise = self.forecast.noise
        try:
            self.forecast.nearly = True
            self.measure(point)
            yield
        finally:
            self.forecast.nearly, self.forecast.noise = False, noise

    def measure(self, point: Point) -> None:
        """Take the noise of each sensor from its residuals at a point."""
        if self.noise is None or not set(self.forecast.sensors) <= set(self.noise):
            self._set_noise(self.forecast.at(point, derivatives=False, cases=self.fitted), self.fitted)

    def scan(self, point: Point) -> Scan:
        """Return what tries pulses at a point."""
        parts = self.forecast.at(point, derivatives=False, cases=self.fitted)
        return Scan(self.forecast, self.loss, point, widening(parts, self.loss))

    def like(self, forecast: Forecast, prior: Prior | None = None, cases: Sequence[int] | None = None) -> Task:
        """Return the same search over another forecast in the same noise, perhaps with another prior or fewer logs."""
        forecast.goes_on_from(self.forecast)
        fitted = self.fitted if cases is None else list(cases)
        made = Task(forecast, self.loss, fitted, self.seed, self.begin, self.noise)
        made.prior = self.prior if prior is None and len(self.prior.mean) == forecast.size else prior or made.prior
        return made

    def near_start(self) -> Prior:
        """Return the belief that parameters are about where the search begins."""
        rest = len(self.forecast.extra)
        return Prior(np.append(self.forecast.space.start, np.zeros(rest)),
                     np.append(np.full(len(self.forecast.space), 1.0 / _ABOUT), np.zeros(rest)))

    def become(self, other: Task, remark: str) -> None:
        """Continue with the forecast of another search, and say why."""
        other.forecast.work += self.forecast.work
        self.forecast, self.lower, self.upper, self.prior = other.forecast, other.lower, other.upper, other.prior
        self.remarks.append(remark)

    def cost(self, point: Point) -> float:
        """Return the cost of a point."""
        return self._search(self.fitted).costs([point])[0]

    def pays(self, point: Point, other: Task, found: Point, least: float = _PAYS) -> bool:
        """Tell whether what another search found gains at least so much, for each independent residual."""
        parts = other.forecast.at(found, derivatives=False, cases=other.fitted)
        return other.cost(found) < self.cost(point) - least * widening(parts, self.loss)

    def _rough(self, nominal: Point, tell: Told) -> list[Outcome]:
        """Search from several starts on some logs; return where that ended, the best first."""
        few = self.few()
        starts = self._candidates(nominal, few)
        text, search, steps = f"{len(starts)} starts", self._search(few), [0] * len(starts)
        tell(0.0, text)
        noises = [self._noise_of(parts, few, rough=True) for parts in self.forecast.at_all(starts, cases=few)]
        self._ended = [Outcome(start, math.inf, False, 0) for start in starts]

        def keep(k: int, step: int, outcome: Outcome) -> None:
            self._ended[k], steps[k] = outcome, step
            tell(_STARTS * sum(steps) / (len(starts) * _MOST["rough"]), text)

        self._ended = together(self.forecast, few, [
            search.steps(start, most=_MOST["rough"], least_share=_ROUGH, tell=partial(keep, k))
            for k, start in enumerate(starts)], noises)
        ended, self._ended = self._on_one_scale(self._ended, few), []
        self._best = ended[0]
        return ended

    def _search(self, cases: Sequence[int], also_held: NDArray[np.bool_] | None = None) -> Search:
        held = self.held if also_held is None else self.held | also_held
        return Search(self.forecast, self.loss, self.prior, self.lower, self.upper, cases, held)

    def _refined(self, start: Point, cases: Sequence[int], *, rounds: int, tell: Told, began: float) -> Outcome:
        """Search, estimate the noise anew, and search on until it stays."""
        best, kinked = Outcome(start, math.inf, False, 0), self.forecast.step > STEP
        rounds = min(rounds, _FEW_ROUNDS) if kinked else rounds
        share = (1.0 - began) / rounds
        for k in range(rounds):
            search = self._search(cases)
            best = search.run(best.point, most=_MOST["few" if kinked else "all"], tell=self._kept(
                tell, began + k * share, began + (k + 1) * share, "all", "all logs"))
            if not math.isfinite(best.cost):
                return best
            tell(began + (k + 1) * share, "all logs")
            change = self._set_noise(self.forecast.at(best.point, derivatives=False, cases=cases), cases)
            if change < 0.02 and (best.converged or kinked):
                break
        search = self._search(cases)
        return replace(best, cost=search.costs([best.point])[0])

    def _as_long_as_it_pays(self, found: Outcome, tell: Told) -> Outcome:
        """Return where a search ends that continues by some steps at a time, until these gain no more than chance does.

        Among kinks no step tells whether the next one gains.
        """
        for _ in range(_BLOCKS):
            parts = self.forecast.at(found.point, derivatives=False, cases=self.fitted)
            count = sum(len(part.residual) for part in parts) / widening(parts, self.loss)
            before = found
            found = self._refined(found.point, self.fitted, rounds=_FEW_ROUNDS, tell=tell, began=0.0)
            if not found.cost < (1.0 - _BLOCK_PAYS / max(count, 1.0)) * self.cost(before.point):
                break
        return found

    def nearby(self, start: Point, tell: Told) -> Point:
        """Return where a search on all logs ends that begins near, with clocks that are known; to be compared, no more.

        It never goes by the engine itself where lanes go nearly.
        """
        self.measure(start)
        self.forecast.strict, self.forecast.nearly = False, self.forecast.bent
        found = self._refined(start, self.fitted, rounds=3, tell=tell, began=0.0).point
        found = self._out_of_nothing(found, tell, 0.0)
        self.forecast.nearly = False
        return found

    def again(self, start: Point, tell: Told) -> Outcome:
        """Return where a search on all logs ends that begins at the end of another one."""
        return self._refined(start, self.fitted, rounds=6, tell=tell, began=0.0)

    def _kept(self, tell: Told, begin: float, end: float, stage: str, text: str) -> Callable[[int, Outcome], None]:
        """Return what keeps the best so far after each step, and tells how far the search is."""
        def keep(step: int, outcome: Outcome) -> None:
            self._best = outcome
            tell(begin + (end - begin) * step / _MOST[stage], text)
        return keep

    def best_so_far(self) -> Outcome:
        """Return where an interrupted search stood, or where an earlier start ended, if that is better."""
        self.forecast.nearly = False
        known = [*self._ended, *([self._best] if self._best is not None else [])]
        if any(math.isfinite(outcome.cost) for outcome in known[1:]):
            return self._on_one_scale(known, self.few())[0]
        return known[0] if known else Outcome(self.nominal(), math.inf, False, 0)

    def few(self, most: int = _FIRST_LOGS) -> list[int]:
        """Return some logs of every kind of motion, about as many as asked for, for the rough searches."""
        kinds: dict[str, list[int]] = {}
        for k in self.fitted:
            kinds.setdefault(self.forecast.cases[k].log.motion, []).append(k)
        share = min(1.0, most / len(self.fitted))
        found = []
        for members in kinds.values():
            count = max(1, math.ceil(share * len(members)))
            found += [members[i * len(members) // count] for i in range(count)]
        return sorted(found)

    def _candidates(self, nominal: Point, few: Sequence[int]) -> list[Point]:
        """Return the nominal point and those of other values that were given, or the best of many random ones."""
        if self.begin.others:
            return [nominal, *(self._with(nominal, values) for values in self.begin.others)]
        rng = np.random.default_rng(self.seed)
        tried, offset = [], first_offset(self.forecast, self.fitted) / OFFSET_SCALE
        for _ in range(_TRIED * (self.begin.searches - 1)):
            extra = {"delay": rng.choice(DELAYS) / DELAY_SCALE, "angle_offset": offset, "angle_sag": 0.0,
                     "frame_period": self.period / PERIOD_SCALE}
            shared = np.concatenate([self.forecast.space.random(rng), [extra[n] for n in self.forecast.extra]])
            tried.append(Point(np.clip(shared, self.lower, self.upper), nominal.own))
        costs = self._search(few).costs(tried)
        order = np.argsort(costs, kind="stable")
        return [nominal, *(tried[k] for k in order[:self.begin.searches - 1] if math.isfinite(costs[k]))]

    def _with(self, point: Point, values: Mapping[str, float]) -> Point:
        """Return a point with values of some searched numbers (SI)."""
        shared = point.shared.copy()
        for k, p in enumerate(self.forecast.space.parameters):
            if p.name in values:
                shared[k] = p.scaled(values[p.name])
        return point._replace(shared=np.clip(shared, self.lower, self.upper))

    def _on_one_scale(self, ended: list[Outcome], few: Sequence[int]) -> list[Outcome]:
        """Return the outcomes with their costs in the noise of the best of them, the best first."""
        good = [outcome for outcome in ended if math.isfinite(outcome.cost)]
        if not good:
            raise InputError("simulation of the logs", got="no start that could be simulated to its end",
                             allowed="a servo whose parameters can follow the logs; see its values and bounds")
        spread = []
        for outcome in good:
            parts = self.forecast.at(outcome.point, derivatives=False, cases=few)
            spread.append(math.fsum(math.log(v) for v in scatter_of(self.forecast, parts, few).values()))
        best = good[int(np.argmin(spread))]
        self._set_noise(self.forecast.at(best.point, derivatives=False, cases=few), few)
        costs = self._search(few).costs([outcome.point for outcome in good])
        scaled = [replace(outcome, cost=cost) for outcome, cost in zip(good, costs, strict=True)]
        return sorted(scaled, key=lambda outcome: outcome.cost)

    def _set_noise(self, parts: Sequence[LogPart], cases: Sequence[int], *, rough: bool = False) -> float:
        """Take the noise of each sensor from its residuals; return by which share it changed."""
        new = self._noise_of(parts, cases, rough=rough)
        change = max(abs(math.log(new[name] / self.forecast.noise[name])) for name in new)
        self.forecast.noise = new
        return change

    def _noise_of(self, parts: Sequence[LogPart], cases: Sequence[int], *, rough: bool = False) -> dict[str, float]:
        """Return the noise of each sensor by its residuals, which are in units of the noise that it has."""
        if self.noise is not None:
            new = {name: self.noise.get(name, self.forecast.noise[name]) for name in self.forecast.sensors}
        else:
            new = scatter_of(self.forecast, parts, cases)
        if rough and len(new) > 1:
            # Sampled between pulses a current is jagged over the delay: the angle alone leads near first
            new = {name: value if name in ANGLES else _BLIND * value for name, value in new.items()}
        return self.forecast.noise | new

    @property
    def beliefs(self) -> list[Prior]:
        """Beliefs about the own numbers of each fitted log."""
        return [Prior(*self.forecast.own_belief(self.forecast.cases[k])) for k in self.fitted]

    def rows(self, point: Point, parts: Sequence[LogPart], *, loss: Loss | None = None,
             counts: Callable[[int], Counts | None] = lambda k: None) -> list[Rows]:
        """Return what each fitted log says of the shared numbers.

        Parameters
        ----------
        point : Point
        parts : sequence of LogPart
            Of the fitted logs there, with derivatives.
        loss : Loss, optional
            That of the search unless given.
        counts : callable
            Returns where the instruments of a log count.
        """
        return [rows_of(part, loss or self.loss, own, point.own[k], counts(k))
                for k, part, own in zip(self.fitted, parts, self.beliefs, strict=True)]

    def at_bound(self, outcome: Outcome) -> NDArray[np.bool_]:
        """Tell which shared numbers stand at a bound."""
        x = outcome.point.shared
        return np.asarray((x <= self.lower + 1e-9) | (x >= self.upper - 1e-9))
