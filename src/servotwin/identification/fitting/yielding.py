"""Priors that yield: where logs and servo file disagree too far, the logs are believed; short of it, widths grow.

A prior is a normal law whose cost does not rise any further beyond 3.5 standard deviations: what is outside is wrong by
any amount. So a prior stays where the fit with it is the better one by far, and goes where the fit without it is better
or lies within the interval. That is judged by the cost, from searches without the prior that begin at the end of the
fit and at values far from it: the logs need not be a parabola, and see nothing wrong from near the prior.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.assumptions import Allowed, Ends, Systematic, begins
from servotwin.identification.fitting.search.case import Case, Point
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.search.least_squares import Loss, Outcome, Prior, Search, together
from servotwin.identification.fitting.search.task import Task
from servotwin.identification.fitting.suspicions.look import rough_noise
from servotwin.identification.fitting.uncertainty import (
    Rows,
    Uncertainty,
    Unidentifiable,
    uncertainty,
    vague_directions,
)
from servotwin.loads import Inertia, Pendulum
from servotwin.logs.log import Log

if TYPE_CHECKING:
    from servotwin.identification.fitting.traces import ErrorTables

# --- How certain each number of a fit is: intervals, what the logs leave open, and how much of it is prior ------------

_RISE = 1.92  # of the cost at the ends of a 95 % interval of one number
_PART = 0.05  # of a direction
_WIDE = 6.0  # e-folds between usual bounds: a prior that is wider says nothing
_DOUBTS_LEAST = 1e-12
_WAY = (0.02, 0.05, 0.1, 0.2, 0.35, 0.55, 0.8, 1.0)  # of the way to the bounds, at which the cost is asked


@dataclass(frozen=True)
class Doubts:
    """The uncertainty of a fit.

    Parameters
    ----------
    doubt : Uncertainty, optional
        None where it was not sought.
    ends : mapping of int to Ends
        Of the intervals.
    unidentifiable : tuple of Unidentifiable
    prior_share : mapping of str to float
        How much of each interval is prior.
    allowed : Allowed, optional
    spans : mapping of str to tuple of float
        Ranges (SI) of what pulses tell.
    systematic : Systematic, optional
        Effect on the numbers of what the servo file leaves out; `ends` hold it.
    deeper : Outcome, optional
        The best that was seen on the way, if that is clearly better than where the search ended.
    """

    doubt: Uncertainty | None = None
    ends: Mapping[int, Ends] = field(default_factory=dict)
    unidentifiable: tuple[Unidentifiable, ...] = ()
    prior_share: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed | None = None
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    deeper: Outcome | None = None
    systematic: Systematic | None = None


def sizes_at(task: Task, found: Outcome) -> Array:
    """Return by how much each shared number counts as changed much: by itself, of a logarithmic one by a factor e."""
    searched = task.forecast.space.parameters
    sizes = np.maximum(np.abs(found.point.shared), 1.0)
    sizes[:len(searched)][[p.logarithmic for p in searched]] = 1.0
    return sizes


def vague(information: Array, inflation: float, sizes: Array, asked: NDArray[np.bool_]) -> tuple[Any, Array]:
    """Return what is not determined of the numbers that are asked about, and the directions."""
    flags, directions = vague_directions(information[np.ix_(asked, asked)], inflation, sizes[asked])
    all_flags, all_directions = np.zeros(len(asked), np.bool_), np.zeros((len(asked), directions.shape[1]))
    all_flags[asked], all_directions[asked] = flags, directions
    return all_flags, all_directions


def prior_share(names: Sequence[str], doubt: Uncertainty, reaching: Mapping[int, Ends], flags: NDArray[np.bool_],
                directions: Array, weight: Array) -> dict[str, float]:
    """Return how much of what is known of each number is prior: 1 less the variance with over that without priors.

    Of a profile it is the part of the priors in the rise of the cost at its ends, which is the same for a parabola. Of
    a number that the logs do not determine it is 1 if a prior does, and else 0; of one that does not vary, nan.
    """
    lengths = np.maximum(np.abs(directions).max(axis=0, initial=0.0), _DOUBTS_LEAST)
    believed = ((weight[:, None] * directions / lengths) ** 2).sum(axis=0) > 1.0 / _WIDE**2
    found = {}
    for k, name in enumerate(names):
        if flags[k]:
            size = np.abs(directions[k])
            found[name] = float(directions.shape[1] > 0 and bool(believed[int(np.argmax(size))]))
        elif k in reaching and not math.isnan(reaching[k].prior):
            found[name] = reaching[k].prior
        elif doubt.alone[k, k] > 0.0:
            found[name] = float(np.clip(1.0 - doubt.covariance[k, k] / doubt.alone[k, k], 0.0, 1.0))
        else:
            found[name] = math.nan
    return found


def allowed(task: Task, found: Outcome, rows: Sequence[Rows], directions: Array, information: Array,
            flags: NDArray[np.bool_], doubt: Uncertainty, reaching: Mapping[int, Ends], level: float) -> Allowed:
    """Return what logs, priors and bounds allow together.

    Parameters
    ----------
    task : Task
    found : Outcome
        The end of its search.
    rows : sequence of Rows
        Of the fitted logs.
    directions : ndarray, shape (p, q)
        That the logs do not determine.
    information : ndarray, shape (p, p)
        Of the logs alone, from fine differences.
    flags : ndarray of bool, shape (p,)
        Numbers that are not determined.
    doubt : Uncertainty
    reaching : mapping of int to Ends
        Of the intervals at `level`: a law that is no parabola is wider on one side.
    """
    inflation = doubt.inflation
    x = found.point.shared
    p, stuck = len(x), task.at_bound(found) | task.held
    whole = uncertainty(rows, task.prior, task.held, directions)
    score = np.sum([r.slope.T @ r.score for r in rows], axis=0) + task.prior.weight**2 * (x - task.prior.mean)
    shift = -whole.curvature @ np.where(stuck, score, 0.0)
    stretch = np.ones((2, p))
    for k, ends in reaching.items():
        reach = doubt.quantile(level, k)
        stretch[:, k] = -ends.lower / reach, ends.upper / reach
    axes, precision = _axes(directions, whole.covariance, task.prior.weight, information / inflation**2)
    grows, adds = _in_proportion(task, x, directions) & flags & ~stuck, _in_sums(task, directions) & flags & ~stuck
    made = Allowed(x, shift, axes, precision, task.lower, task.upper, grows, np.zeros(p, np.bool_), directions,
                   np.zeros((2, directions.shape[1])), stretch)
    tried = [made] if not adds.any() else [made, replace(made, by_logarithm=np.zeros(p, np.bool_), by_value=adds)]
    reached = [_reach(task, found, one, inflation) for one in tried]
    # Directions that the logs leave open are straight where numbers are taken as they stand in it: in products, or in
    # sums
    best = int(np.argmax([way for _, way in reached]))
    return replace(tried[best], reach=reached[best][0])


def _in_proportion(task: Task, x: Array, directions: Array) -> NDArray[np.bool_]:
    """Tell which numbers may be drawn by their logarithm although they are searched as they are.

    Factors of a product keep it by moving in proportion; and of a size that nothing is known of, each
    factor is as likely as any other.
    """
    space = task.forecast.space
    found = np.zeros(len(x), np.bool_)
    for direction in directions.T:
        members = np.abs(direction) > _PART * np.abs(direction).max()
        believed = (task.prior.weight[members] > 0.0).any()
        if members.sum() > 1 or not believed:
            found |= direction != 0.0
    for k, p in enumerate(space.parameters):
        found[k] &= not p.logarithmic and p.lower >= 0.0 and x[k] > _PART
    found[len(space):] = False
    return found


def _in_sums(task: Task, directions: Array) -> NDArray[np.bool_]:
    """Tell which numbers may be drawn as they are although they are searched by their logarithm."""
    several = (np.abs(directions) > _PART * np.abs(directions).max(axis=0, initial=0.0)).sum(axis=0) > 1
    found = (directions[:, several] != 0.0).any(axis=1)
    for k, p in enumerate(task.forecast.space.parameters):
        found[k] &= p.logarithmic
    found[len(task.forecast.space):] = False
    return np.asarray(found)


def _axes(directions: Array, covariance: Array, weight: Array, information: Array) -> tuple[Array, Array]:
    """Return axes along which what is known is independent, and the precision along each.

    Those of what the logs determine first, each going along in the open directions as the priors there want; then those
    of the open directions.
    """
    q = directions.shape[1]
    basis = np.linalg.svd(directions)[0] if q else np.eye(len(weight))
    V, Q = basis[:, :q], basis[:, q:]
    beliefs = np.diag(weight**2)
    variance, known = np.linalg.eigh(Q.T @ covariance @ Q)
    precision, open_axes = np.linalg.eigh(V.T @ (beliefs + information) @ V)
    follow = np.linalg.pinv(V.T @ (beliefs + information) @ V, hermitian=True) @ (V.T @ beliefs @ Q)
    return (np.column_stack([(Q - V @ follow) @ known, V @ open_axes]),
            np.append(1.0 / np.maximum(variance, _DOUBTS_LEAST**2), np.maximum(precision, 0.0)))


def _reach(task: Task, found: Outcome, made: Allowed, inflation: float) -> tuple[Array, float]:
    """Return how far the logs allow to go along each open direction, back and forth, and which part of all that is.

    They may be open one way only.
    """
    farthest = np.zeros((2, made.open.shape[1]))
    for k, direction in enumerate(made.directions.T):
        moves = np.abs(direction) > _DOUBTS_LEAST
        room = made.box[:, moves] / direction[moves]
        farthest[:, k] = room.min(axis=0).max(), room.max(axis=0).min()
    if not farthest.size:
        return farthest, 1.0
    steps = farthest[:, :, None] * np.array(_WAY)
    points = made.points((steps[..., None] * made.directions.T[None, :, None, :]).reshape(-1, len(made.best)))
    points = np.clip(np.vstack([made.best, points]), task.lower, task.upper)
    search = Search(task.forecast, task.loss, task.prior, task.lower, task.upper, task.fitted, task.held)
    with task.forecast.roughly():
        costs = search.costs([found.point._replace(shared=x) for x in points])
    of_logs = np.array([cost - task.prior.cost(x) for cost, x in zip(costs, points, strict=True)])
    rises = ((of_logs[1:] - of_logs[0]) / inflation**2).reshape(steps.shape)
    reach = np.array([[_until(steps[side, k], rises[side, k]) for k in range(steps.shape[1])] for side in (0, 1)])
    way = np.ptp(reach, axis=0) / np.maximum(np.ptp(farthest, axis=0), _DOUBTS_LEAST)
    return reach, float(way.mean())


def _until(steps: Array, rises: Array) -> float:
    """Return the step at which the cost has risen as far as it may; the last one if it never does."""
    over = np.flatnonzero(~(rises <= _RISE))
    if not over.size:
        return float(steps[-1])
    k = int(over[0])
    last, before = (float(steps[k - 1]), max(float(rises[k - 1]), 0.0)) if k else (0.0, 0.0)
    # About a parabola in between; none where a simulation failed
    share = math.sqrt((_RISE - before) / (float(rises[k]) - before)) if math.isfinite(rises[k]) else 0.0
    return last + share * (float(steps[k]) - last)


# --- Remedies where logs tell numbers together only: further sensors and known loads, tried in simulation -------------
_SENSORS = {"output_angle": "an encoder at the output", "feedback_voltage": "a potentiometer tap",
            "armature_current": "a motor current measurement", "supply_current": "a supply current measurement"}
_NOISE = 0.01  # of a sensor's largest value, assumed of a further one
_STEP = 1e-3  # of a searched number
_MOST = 6  # logs that are tried


def with_remedies(forecast: Forecast, point: Point, items: Sequence[Unidentifiable],
                  names: Sequence[str]) -> tuple[Unidentifiable, ...]:
    """Return what is not determined, each with what would determine it."""
    return tuple(replace(item, remedies=_remedies(forecast, point, item, names)) for item in items)


def _remedies(forecast: Forecast, point: Point, item: Unidentifiable, names: Sequence[str]) -> tuple[str, ...]:
    direction = np.zeros(len(names))
    for name, part in zip(item.parameters, item.direction, strict=True):
        direction[list(names).index(name)] = part
    direction /= np.linalg.norm(direction)
    some = range(0, len(forecast.cases), max(1, len(forecast.cases) // _MOST))
    logs = [forecast.cases[k].log for k in some]
    own = tuple(point.own[k] for k in some)
    here = Point(point.shared, own, tuple(point.frames[k] for k in some) if point.frames else ())
    found = [text for sensor, text in _SENSORS.items()
             if sensor not in forecast.sensors and sensor in forecast.model.available
             and _tells(forecast, [_measuring(log, sensor) for log in logs], sensor, here, direction)]
    sensor = forecast.sensors[0]
    reduction = forecast.model.value("gear.gear_reduction")
    inertia = float(reduction**2) * forecast.model.value("motor.rotor_inertia")
    loads: dict[str, Inertia | Pendulum] = {"a known inertia at the horn": Inertia(inertia),
             "a known weight on an arm": Pendulum(mass=inertia / 0.1**2, length=0.1)}
    for text, load in loads.items():
        if not found and _tells(forecast, [replace(log, load=log.load + load) for log in logs], sensor, here,
                                direction):
            found.append(text)
    return tuple(found[:2]) or ((f"a known {item.parameters[0]}",) if len(item.parameters) > 1 else ())


def _measuring(log: Log, sensor: str) -> Log:
    return replace(log, measured={**log.measured, sensor: np.zeros(len(log.time))})


def _tells(forecast: Forecast, logs: Sequence[Log], sensor: str, point: Point, direction: Array) -> bool:
    """Tell whether a signal of some logs would change visibly along a direction."""
    try:
        tried = Forecast(logs, forecast.model, forecast.space, forecast.nuisance, [sensor], forecast.running)
        tried.strict = False
        ends = [point._replace(shared=point.shared + side * _STEP * direction) for side in (1.0, -1.0)]
        ahead, behind = ([part.residual for part in parts] for parts in tried.at_all(ends))
    except InputError:
        return False
    change = np.concatenate([a - b for a, b in zip(ahead, behind, strict=True)]) / (2.0 * _STEP)
    values = np.concatenate(ahead)
    if not (np.isfinite(change).all() and np.isfinite(values).all()):
        return False
    noise = max(_NOISE * float(np.abs(values).max(initial=0.0)), 1e-12)
    return float(np.linalg.norm(change)) / noise > 2.0  # standard errors of half such a step


# --- Priors that yield ------------------------------------------------------------------------------------------------
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
        Mean and standard deviation of the prior (SI).
    logs, logs_std : float
        Value that the fit finds without it, and its standard error (SI); the latter is nan where the logs do not
        determine the number, or it has no interval.
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
        Mean and standard deviation of the prior (SI).
    logs : float
        Value that the fit finds (SI).
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
    continues so.

    Parameters
    ----------
    task : Task
    found : Outcome
        The end of its search.
    tell : callable
        Called with the share that is done, and the work in progress.
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
            # Fits that are as good are distinguished by how far its own prior has to be left
            chosen = min((t for t in trials if t.gain > best - _REACH), key=lambda t: t.moved)
            gone, point = [chosen.dropped], chosen.end.point
            if len(going := [trial for trial in trials if math.isinf(trial.dropped.wide)]) > 1:
                gone, point = _contradicted(task, going)
        for one in gone:
            weight = task.prior.weight.copy()
            weight[one.which] = 1.0 / one.wide  # 0 of one that is dropped
            task.prior = Prior(task.prior.mean, weight)
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
        As it continues without them.
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
    rows = task.rows(point, task.forecast.at(point, cases=task.fitted))
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


# --- Which searched numbers the logs can hardly tell, before any search -----------------------------------------------
_FACTOR = 1.0  # standard error (scaled), a factor of e, beyond which a number without a prior is not determined
_LEAST = 1e-9  # SI
_INERTIAS = ("output_inertia", "motor.rotor_inertia")


@dataclass(frozen=True)
class Foreseen:
    """A searched number of which the logs say less than what is known without them.

    Parameters
    ----------
    name : str
    alone : float
        Its standard error by the logs if all other numbers were known, relative to its value or to a typical one; inf
        where they say nothing.
    prior : float
        The same by its prior; inf where there is none.
    reason : str
        Why, where a simple cause is seen.
    """

    name: str
    alone: float
    prior: float
    reason: str = ""

    def __str__(self) -> str:
        """Return it as one line.

        Examples
        --------
        >>> print(Foreseen("output_inertia", 3.0, 0.2, "samples are 500 ms apart, the motor settles in 20 ms"))
        these logs hardly tell output_inertia (±300 % with all else known; prior ±20 %): samples are 500 ms apart, the \
motor settles in 20 ms
        """
        told = f"±{100.0 * self.alone:.3g} %" if self.alone < 10.0 else "not even"
        prior = f"; prior ±{100.0 * self.prior:.3g} %" if math.isfinite(self.prior) else ""
        why = f": {self.reason}" if self.reason else ""
        return f"these logs hardly tell {self.name} ({told} with all else known{prior}){why}"


def foreseen(task: Task) -> tuple[Foreseen, ...]:
    """Return which searched numbers the fitted logs can hardly tell, by the derivatives where the search begins.

    A number is determined if the logs alone, with all other shared numbers known, leave a standard error below that of
    its prior, or below a factor of e where it has none. That is necessary, not enough: several numbers may still be
    determined together only, which the fit says at its end. Noise is that which neighbouring samples show.
    """
    forecast = task.forecast
    noise, strict = forecast.noise, forecast.strict
    cases = [forecast.cases[k] for k in task.fitted]
    point = task.nominal()
    try:
        forecast.noise = {**noise, **{name: _noise(cases, name) for name in forecast.sensors}}
        forecast.strict = False
        with forecast.roughly():
            parts = forecast.at(point, cases=task.fitted)
        rows = task.rows(point, parts, loss=Loss(math.inf))
    finally:
        forecast.noise, forecast.strict = noise, strict
    if not all(np.isfinite(part.residual).all() and np.isfinite(part.shared).all() for part in parts):
        return ()
    information = sum((row.slope**2).sum(axis=0) for row in rows)
    found = []
    for k, p in enumerate(forecast.space.parameters):
        alone = 1.0 / math.sqrt(information[k]) if information[k] > 0.0 else math.inf
        prior = math.inf if p.scaled_prior is None else p.scaled_prior[1]
        if alone > min(prior, _FACTOR):
            found.append(Foreseen(p.name, alone, prior, _reason(task, cases, p.name)))
    return tuple(found)


def _noise(cases: list[Case], name: str) -> float:
    """Return the noise of a sensor that neighbours show, at least that of its counts (SI)."""
    values = [case.values[name] for case in cases if name in case.values and len(case.values[name])]
    if not values:
        return 1.0
    return max(float(np.median([rough_noise(each) for each in values])), _LEAST)


def _reason(task: Task, cases: list[Case], name: str) -> str:
    """Return a simple cause why a number cannot be determined; nothing where none is seen."""
    if not any(case.log.changes.size for case in cases):
        return "the command never changes"
    servo = task.forecast.model.servo
    step = float(np.median([np.median(np.diff(case.log.time)) for case in cases]))
    J, R, K = (nominal(servo, one) for one in ("output_inertia", "motor.armature_resistance", "output_torque_constant"))
    if name in _INERTIAS and J and R and K and step > (settles := J * R / K**2):
        return f"samples are {1e3 * step:.3g} ms apart, the motor settles in {1e3 * settles:.2g} ms"
    return ""

_OVERFITTED = 1.6  # error of new logs over that of the fitted ones


def warnings_of(yielded: Sequence[Yielded | Widened], tables: ErrorTables) -> tuple[str, ...]:
    """Return the warnings on a fit for a reader, a line each."""
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
