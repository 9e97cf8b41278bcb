"""Priors that yield: where logs and servo file disagree too far, the logs are believed; short of it, widths grow.

A prior is a normal law whose cost does not rise any further beyond 3.5 standard deviations: what is outside is wrong by
any amount. So a prior stays where the fit with it is the better one by far, and goes where the fit without it is better
or lies within the interval. That is judged by the cost, from searches without the prior that begin at the end of the
fit and at values far from it: the logs need not be a parabola, and see nothing wrong from near the prior.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Outcome, Prior, Search, together
from servotwin.identification.fitting.doubts import Doubts
from servotwin.identification.fitting.intervals import begins
from servotwin.identification.fitting.point import Point
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of, uncertainty

Array = NDArray[np.float64]

APART = 3.5
"""Standard errors between logs and prior from which on the prior is not believed: 1 of 2000 that are right."""
_REACH = 1.92  # rise of the cost at the ends of a 95 % interval
_OPEN = 0.5 * APART**2 - _REACH  # gain from which on the fit without a prior lies within the interval
PUSHED = 2.5
"""Standard errors, and widths, from which on a prior counts as wide as it is off: 1 of 80 that are right."""
_PUSH = 0.5 * PUSHED**2
_FACTORS = (0.25, 0.4, 0.63, 0.8, 1.25, 1.6, 2.5, 4.0)  # of the value: where the logs are asked once more
_STEPS = 8  # of a search that only has to show whether it goes down
_HINT = 0.5  # of the gain that counts: the noise is not known yet
_HINTS = 0.1  # of that: what a parabola has to promise, for the cost need not be one

Told = Callable[[float, str], None]


@dataclass(frozen=True)
class Yielded:
    """A prior that was dropped because the logs contradict it.

    Parameters
    ----------
    name : str
    file, file_std : float
        What the prior says (SI).
    logs, logs_std : float
        What the fit finds without it, and its standard error (SI); the latter is nan where the logs do not determine
        the number, or it has no interval.
    apart : float
        Standard errors between the two, by how much better the logs are fitted without the prior.
    logs_lower, logs_upper : float
        Its interval (SI); nan where it has none.
    unit : str
        SI.
    of_file : bool
        Whether the servo file said so, or else the caller.
    others : tuple of str
        Numbers with which together alone the logs determine this one: then all that is certain is that the priors of
        all of them cannot be right, and this is the one that is easiest to give up.
    """

    name: str
    file: float
    file_std: float
    logs: float
    logs_std: float
    apart: float
    logs_lower: float = math.nan
    logs_upper: float = math.nan
    unit: str = ""
    of_file: bool = True
    others: tuple[str, ...] = ()

    def __str__(self) -> str:
        said = f"{self.file:.4g} ± {self.file_std:.2g} {self.unit}".rstrip()
        far = f"{self.apart:.2g} standard errors apart"
        if self.others:
            who, say = ("the servo file", "it says") if self.of_file else ("the priors that were given", "they say")
            return (f"the logs contradict {who}: {', '.join(self.others)} and {self.name} cannot all be as {say} "
                    f"({far}); {self.name} is fitted without its prior, {said}")
        who = "the servo file" if self.of_file else "the prior that was given"
        if math.isnan(self.logs_std):
            return (f"the logs contradict {who}: {self.name} is not {said} ({far}); it is fitted without that prior, "
                    "and the logs alone do not determine it")
        return (f"the logs contradict {who}: {self.name} is {self.logs:.4g} {self.unit} ({self.logs_lower:.4g} to "
                f"{self.logs_upper:.4g}), it says {said} ({far}); it is fitted without that prior")


@dataclass(frozen=True)
class Widened:
    """A prior that the logs push so far that it counts as wide as it is off.

    Parameters
    ----------
    name : str
    file, file_std : float
        What the prior says (SI).
    logs : float
        What the fit finds (SI).
    apart : float
        Standard errors between the two, by how much better the logs are fitted without the prior.
    std : float
        The standard deviation that the prior counts with (SI).
    unit : str
        SI.
    of_file : bool
        Whether the servo file said so, or else the caller.
    """

    name: str
    file: float
    file_std: float
    logs: float
    apart: float
    std: float
    unit: str = ""
    of_file: bool = True

    def __str__(self) -> str:
        who = "the servo file" if self.of_file else "the prior that was given"
        return (f"the logs push {self.name} to {self.logs:.4g} {self.unit}".rstrip() + f", {self.apart:.2g} standard "
                f"errors from what {who} says, {self.file:.4g} ± {self.file_std:.2g} {self.unit}".rstrip()
                + f": that counts as ± {self.std:.2g} {self.unit}".rstrip() + " here")


@dataclass(frozen=True)
class Dropped:
    """A shared number whose prior was dropped or widened: which one, the prior as it is searched, and how far off.

    `wide` is its new standard deviation on that scale; inf where it was dropped.
    """

    which: int
    mean: float
    std: float
    apart: float
    wide: float = math.inf


@dataclass(frozen=True)
class _Trial:
    """A fit without the prior of one number: where it ends, how far it is from the prior, in which units."""

    dropped: Dropped
    end: Outcome
    gain: float
    moved: float


def settle(task: Task, found: Outcome, tell: Told) -> tuple[Outcome, tuple[Dropped, ...]]:
    """Drop the priors that the logs contradict; return where the fit ends then, and which.

    All that are contradicted one by one go at once, and come back one at a time where the logs do not contradict them
    beside those that are still there. Those that the logs push, if less far, are widened one after the other. The task
    goes on so.

    Parameters
    ----------
    task : Task
    found : Outcome
        The end of its search.
    tell : callable
        Is told the share that is done, and what goes on.
    """
    left: list[Dropped] = []
    count = 0 if task.doubted else int((task.prior.weight > 0.0).sum())
    for k in range(count):
        tell(k / count, "priors")
        with task.nearly(found.point):
            trials = [trial for trial in _trials(task, found)
                      if trial.dropped.which not in [one.which for one in left]]
            if not trials:
                break
            best = max(trial.gain for trial in trials)
            # What fits as well is told apart by how far its own prior has to be left
            chosen = min((t for t in trials if t.gain > best - _REACH), key=lambda t: t.moved)
            gone, point = [chosen.dropped], chosen.end.point
            if len(going := [trial for trial in trials if math.isinf(trial.dropped.wide)]) > 1:
                gone, point = _contradicted(task, going)
        for one in gone:
            task.prior = _widened(task.prior, one)
        found = task.again(point, _part_of(tell, k, count))
        left += gone
    return found, tuple(left)


def _contradicted(task: Task, trials: Sequence[_Trial]) -> tuple[list[Dropped], Point]:
    """Return which of several priors have to go together, and where the fit without them ends.

    Each is contradicted alone. Without all of them, those come back beside which the fit is as good, until each that
    is left out would cost more than a prior does that is not believed.
    """
    out = {trial.dropped.which: trial for trial in trials}

    def ends(several: Sequence[Sequence[int]], starts: Sequence[Point]) -> list[Outcome]:
        searches = [_search(task, _without(task.prior, some)).steps(start, most=_STEPS)
                    for some in several for start in starts]
        reached = together(task.forecast, task.fitted, searches)
        return [min(reached[i:i + len(starts)], key=lambda end: end.cost)
                for i in range(0, len(reached), len(starts))]

    best = max(trials, key=lambda trial: trial.gain).end.point
    (now,) = ends([tuple(out)], [best])
    while len(out) > 1:
        back = dict(zip(out, ends([[k for k in out if k != one] for one in out], [now.point, best]), strict=True))
        rise = {k: end.cost - now.cost for k, end in back.items()}
        least = min(rise.values())
        if least >= _OPEN:
            break
        # Of those that cost as little, the one comes back that would have to be left by most of its own widths
        one = max((k for k in out if rise[k] < max(least, 0.0) + _REACH), key=lambda k: out[k].moved)
        del out[one]
        now = back[one]
    return [trial.dropped for trial in out.values()], now.point


def yielded(task: Task, found: Outcome, left: Sequence[Dropped], doubts: Doubts) -> tuple[Yielded, ...]:
    """Return the dropped priors with what the fit says instead.

    Parameters
    ----------
    task : Task
        As it goes on without them.
    found : Outcome
    left : sequence of Dropped
    doubts : Doubts
        Of the fit without them.
    """
    result = []
    for one in left:
        if math.isfinite(one.wide):
            continue
        p, x = task.forecast.space.parameters[one.which], float(found.point.shared[one.which])
        group = [name for item in doubts.unidentifiable if p.name in item.parameters for name in item.parameters]
        mates = tuple(dict.fromkeys(name for name in group if name != p.name and _believed(task, name)))
        std, interval = math.nan, (math.nan, math.nan)
        if doubts.doubt is not None and one.which in doubts.ends:
            ends = doubts.ends[one.which]
            std = float(doubts.doubt.std[one.which])
            a, b = (float(np.clip(p.value(x + end * std), p.lower, p.upper)) for end in (ends.lower, ends.upper))
            std, interval = abs(p.slope(x)) * std, (min(a, b), max(a, b))
        said = p.prior if p.prior is not None else (math.nan, math.nan)
        result.append(Yielded(p.name, *said, float(p.value(x)), std, one.apart, *interval, p.unit, p.of_file, mates))
    return tuple(result)


def widened(task: Task, found: Outcome, left: Sequence[Dropped]) -> tuple[Widened, ...]:
    """Return the widened priors with what the fit says."""
    result = []
    for one in left:
        p, x = task.forecast.space.parameters[one.which], float(found.point.shared[one.which])
        if p.prior is not None and math.isfinite(one.wide):
            result.append(Widened(p.name, *p.prior, float(p.value(x)), one.apart, p.prior[1] * one.wide / one.std,
                                  p.unit, p.of_file))
    return tuple(result)


def _believed(task: Task, name: str) -> bool:
    names = task.forecast.space.names
    return name in names and bool(task.prior.weight[names.index(name)] > 0.0)


def _part_of(tell: Told, k: int, count: int) -> Told:
    return lambda share, text: tell((k + share) / count, text)


def _without(prior: Prior, which: Sequence[int]) -> Prior:
    weight = prior.weight.copy()
    weight[list(which)] = 0.0
    return Prior(prior.mean, weight)


def _widened(prior: Prior, one: Dropped) -> Prior:
    weight = prior.weight.copy()
    weight[one.which] = 1.0 / one.wide  # 0 of one that is dropped
    return Prior(prior.mean, weight)


def _search(task: Task, prior: Prior) -> Search:
    return Search(task.forecast, task.loss, prior, task.lower, task.upper, task.fitted, task.held)


def _trials(task: Task, found: Outcome) -> list[_Trial]:
    """Return the fits without one prior each that are better by so much that the prior is not believed.

    Searched are those without a prior that pulls at the fit, or far from which the logs are fitted as well.
    """
    stuck = task.at_bound(found) | task.held
    believed = [k for k in range(len(task.forecast.space)) if task.prior.weight[k] > 0.0]
    free = [k for k in believed if not stuck[k]]
    base = _search(task, task.prior).costs([found.point])[0]
    if not believed or not math.isfinite(base):
        return []
    doubt, rows = _doubt(task, found.point, task.prior)
    far = _far(task, found, free, base, doubt, rows)
    without = _search(task, _without(task.prior, believed)).run(found.point, most=_STEPS)
    if not far and base - without.cost < _HINT * _PUSH:
        return []
    asked = [(k, start) for k in believed if k in far or stuck[k] or _promises(task, found, k, doubt)
             for start in (found.point, *far.get(k, ()))]
    ends = together(task.forecast, task.fitted, [
        _search(task, _without(task.prior, [k])).steps(start, most=_STEPS) for k, start in asked])
    judged: dict[int, list[_Trial]] = {}
    for (k, _), end in zip(asked, ends, strict=True):
        if (trial := _judged(task, found, k, end, base)) is not None:
            judged.setdefault(k, []).append(trial)
    return [max(some, key=lambda trial: trial.gain) for some in judged.values()]


def _promises(task: Task, found: Outcome, k: int, doubt: Uncertainty) -> bool:
    """Tell whether the fit without a prior gains so much on a parabola that a search for it may: half of u²/(1 - h).

    u is by how many of its widths the fit leaves it, and h the variance of the number over that of the prior.
    """
    u = float((found.point.shared[k] - task.prior.mean[k]) * task.prior.weight[k])
    share = float(doubt.curvature[k, k]) * float(task.prior.weight[k]) ** 2
    return 0.5 * u**2 > _HINTS * max(1.0 - share, 0.0) * _HINT * _PUSH


def _far(task: Task, found: Outcome, which: Sequence[int], base: float, doubt: Uncertainty,
         rows: Sequence[Rows]) -> Mapping[int, tuple[Point, ...]]:
    """Return points far from the prior of one number that fit as well, all else following: the best one of each."""
    search = _search(task, task.prior)
    asked = [(k, point) for k in which for x in _values(task, k) for point in begins(
        search, found, doubt, k, (x - found.point.shared[k]) / max(float(doubt.std[k]), 1e-12), rows)]
    best: dict[int, tuple[float, Point]] = {}
    for (k, point), cost in zip(asked, search.costs([point for _, point in asked]) if asked else [], strict=True):
        u = (point.shared[k] - task.prior.mean[k]) * task.prior.weight[k]
        alone = cost - 0.5 * u**2
        if alone < base and (k not in best or alone < best[k][0]):
            best[k] = (alone, point)
    return {k: (point,) for k, (_, point) in best.items()}


def _values(task: Task, k: int) -> list[float]:
    """Return values of a number at which it is asked whether the logs fit there as well (scaled)."""
    p, mean, weight = task.forecast.space.parameters[k], task.prior.mean[k], task.prior.weight[k]
    middle = float(p.value(mean))
    values = [p.scaled(factor * middle) for factor in _FACTORS] if middle else \
        [side * factor for side in (-1.0, 1.0) for factor in (0.1, 0.3, 1.0, 3.0)]
    return [x for x in values if task.lower[k] < x < task.upper[k] and abs(x - mean) * weight > APART]


def _doubt(task: Task, point: Point, prior: Prior) -> tuple[Uncertainty, list[Rows]]:
    forecast = task.forecast
    parts = forecast.at(point, cases=task.fitted)
    rows = [rows_of(part, task.loss, Prior(*forecast.own_belief(forecast.cases[k])), point.own[k])
            for k, part in zip(task.fitted, parts, strict=True)]
    stuck = task.at_bound(Outcome(point, math.inf, False, 0)) | task.held
    return uncertainty(rows, prior, stuck), rows


def _judged(task: Task, found: Outcome, k: int, end: Outcome, base: float) -> _Trial | None:
    """Return a fit without the prior of a number, if that is not believed; in the noise that is left without it."""
    mean, weight = float(task.prior.mean[k]), float(task.prior.weight[k])
    off, std = abs(float(end.point.shared[k]) - mean), 1.0 / weight
    if base - end.cost < _HINT * _PUSH or off < PUSHED * std:
        return None
    alone, before = _without(task.prior, [k]), task.forecast.noise
    task.measure(end.point)
    try:
        gain = _search(task, task.prior).costs([found.point])[0] - _search(task, alone).costs([end.point])[0]
        widening = _doubt(task, end.point, alone)[0].inflation
    finally:
        task.forecast.noise = before
    if gain <= 0.0:
        return None
    # Twice the gain is off² / (std² + that of the logs²); the latter is wider where residuals are correlated
    of_logs = max(off**2 / (2.0 * gain) - std**2, 0.0)
    apart = off / math.hypot(std, widening * math.sqrt(of_logs))
    if apart < PUSHED:
        return None
    goes = off >= APART * std and 0.5 * apart**2 >= _OPEN
    return _Trial(Dropped(k, mean, std, apart, math.inf if goes else off), replace(end), gain, off / std)
