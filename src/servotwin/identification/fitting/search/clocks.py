"""The clocks of logger and generator: when pulses come, how far apart, and whether stamps tell when samples were.

A log tells when its pulses take effect: the phase of its pulses and the delay together. Its commands tell between which
bounds the phase lies (`frames.gap_of`). Where logger and generator are in step these are a whole frame apart, and so is
what is known of the delay; where they run apart, a little of a frame.

Ticks that take wrong commands bend what all logs share, so that the right ones would not fit better with that, and
where those of several logs are wrong, one log alone cannot be right either. So each log says to first order what each
of its choices costs as the shared numbers move, a parabola, and the cheapest choices of all logs are sought together.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.residual_noise import SensorSeries, noise_of
from servotwin.identification.fitting.search.case import (
    DELAY_SCALE,
    PERIOD_SCALE,
    Case,
    LogPart,
    Point,
    gap_of,
    near_edges,
)
from servotwin.identification.fitting.search.forecast import Forecast
from servotwin.identification.fitting.search.least_squares import Loss, NormalEquations, Prior, block, by_sensor, safe
from servotwin.identification.fitting.search.phases import (
    PulseChoice,
    Scan,
    drifts,
    likely_periods,
    settled,
    with_period,
)
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty
from servotwin.logs.log import ANGLES, Log
from servotwin.logs.regular import made_regular, regular_times
from servotwin.models import DigitalServo, Model

if TYPE_CHECKING:
    from servotwin.identification.fitting.search.task import Task


# --- Other commands for the ticks of all logs at once, judged by where all numbers would go with them -----------------

_RANDOM, _ALIKE = 24, 8  # choices that descents begin with: random ones, and ticks alike in all logs
_TRIED = 3  # ends that are looked at closely
_GAINS = 0.5  # of the cost: less is not worth a look


class Parabolas(NamedTuple):
    """Costs of choices, along the first axis, as the shared numbers move; a log's own go to where they fit best.

    Parameters
    ----------
    level : ndarray, shape (n,)
    slope : ndarray, shape (n, p)
    curvature : ndarray, shape (n, p, p)
    """

    level: Array
    slope: Array
    curvature: Array

    def least(self) -> Array:
        """Return the least cost of each [shape (n,)]."""
        p = self.slope.shape[1]
        hair = 1e-10 * np.trace(self.curvature, axis1=1, axis2=2)[:, None, None] * np.eye(p)
        steps = np.linalg.solve(self.curvature + hair, self.slope[..., None])[..., 0]
        return np.asarray(self.level - 0.5 * np.sum(self.slope * steps, axis=1))

    def plus(self, other: Parabolas) -> Parabolas:
        """Return the sums."""
        return Parabolas(*(a + b for a, b in zip(self, other, strict=True)))

    def less(self, other: Parabolas) -> Parabolas:
        """Return the differences."""
        return Parabolas(*(a - b for a, b in zip(self, other, strict=True)))

    def at(self, k: int) -> Parabolas:
        """Return one of them alone."""
        return Parabolas(*(a[k:k + 1] for a in self))


def giving_way(scan: Scan, prior: Prior, held: NDArray[np.bool_], cases: Sequence[int]) -> list[Point]:
    """Return points with other ticks that would fit better, to first order, the best first.

    Parameters
    ----------
    scan : Scan
        Where a search stands.
    prior : Prior
        About the shared numbers.
    held : ndarray of bool, shape (p,)
        Shared numbers that stay.
    cases : sequence of int
        Logs that count.
    """
    choices = {k: [scan.now(k), *scan.ticking(k)] for k in cases}
    if all(len(some) == 1 for some in choices.values()):
        return []
    parabolas = _parabolas(scan, choices, ~held)
    off = ((scan.point.shared - prior.mean) * prior.weight**2)[~held]
    about = Parabolas(np.zeros(1), off[None], np.diag(prior.weight[~held]**2)[None])
    now = dict.fromkeys(cases, 0)
    stands = _cost(parabolas, about, now)
    ends = {tuple(end.values()): cost for end, cost in (
        _descent(parabolas, about, start) for start in [now, *_starts(scan, choices)])}
    best = sorted((cost, end) for end, cost in ends.items() if cost < stands - _GAINS)[:_TRIED]
    return [scan.moved({k: choices[k][which] for k, which in zip(cases, end, strict=True)}) for _, end in best]


def _parabolas(scan: Scan, choices: Mapping[int, Sequence[PulseChoice]],
               moves: NDArray[np.bool_]) -> dict[int, Parabolas]:
    """Return what each choice of each log costs, with slopes and weights of residuals as where the search stands."""
    now = scan.forecast.at(scan.point, cases=list(choices))
    parts = scan.parts(choices)
    found = {}
    for j, (k, some) in enumerate(choices.items()):
        own = Prior(*scan.forecast.own_belief(scan.forecast.cases[k]))
        weight = scan.loss.weight(now[j].residual)
        each = [_parabola(now[j]._replace(residual=part.residual), weight, own, scan.moved({k: one}).own[k], moves)
                for one, part in zip(some, parts[k], strict=True)]
        found[k] = Parabolas(*map(np.stack, zip(*each, strict=True)))
    return found


def _parabola(part: LogPart, weight: Array, own: Prior, at: Array, moves: NDArray[np.bool_]) -> Parabolas:
    """Return what one choice costs."""
    shared = part.shared[:, moves]
    if not (np.isfinite(part.residual).all() and np.isfinite(shared).all() and np.isfinite(part.own).all()):
        return Parabolas(np.array(1e12), np.zeros(shared.shape[1]), np.eye(shared.shape[1]))
    root = np.sqrt(weight)
    weighed = LogPart(part.residual * root, shared * root[:, None], part.own * root[:, None])
    b = block(weighed, Loss(), own, at)
    g, H = NormalEquations((b,), b.g_s, b.H_ss).reduced()
    level = Loss().cost(weighed.residual) + own.cost(at)
    if b.g_o.size:
        level -= 0.5 * float(b.g_o @ np.linalg.solve(safe(b.H_oo), b.g_o))
    return Parabolas(np.asarray(level), g, H)


def _starts(scan: Scan, choices: Mapping[int, Sequence[PulseChoice]]) -> list[dict[int, int]]:
    """Return where descents begin."""
    rng = np.random.default_rng(0)
    random = [{k: int(rng.integers(len(some))) for k, some in choices.items()} for _ in range(_RANDOM)]
    alike = []
    for share in (np.arange(_ALIKE) + 0.5) / _ALIKE:
        alike.append({k: int(np.argmin([abs(np.mod(one.frames.tick / scan.ticks[k].period - share + 0.5, 1.0) - 0.5)
                                        for one in some])) for k, some in choices.items()})
    return [*random, *alike]


def _cost(parabolas: Mapping[int, Parabolas], about: Parabolas, chosen: Mapping[int, int]) -> float:
    return float(_sum(parabolas, about, chosen).least()[0])


def _sum(parabolas: Mapping[int, Parabolas], about: Parabolas, chosen: Mapping[int, int]) -> Parabolas:
    several = [about, *(parabolas[k].at(which) for k, which in chosen.items())]
    return Parabolas(*(np.sum(parts, axis=0) for parts in zip(*several, strict=True)))


def _descent(parabolas: Mapping[int, Parabolas], about: Parabolas,
             start: Mapping[int, int]) -> tuple[dict[int, int], float]:
    """Return the choices to which changes of one log at a time lead, and what they cost."""
    chosen, cost = dict(start), _cost(parabolas, about, start)
    while True:
        before, total = cost, _sum(parabolas, about, chosen)  # anew each time: rounding does not add up
        for k, mine in parabolas.items():
            others = total.less(mine.at(chosen[k]))
            costs = mine.plus(others).least()
            best = int(np.argmin(costs))
            if costs[best] < cost:
                chosen[k], cost, total = best, float(costs[best]), others.plus(mine.at(best))
        if not cost < before - 1e-9 * abs(before):
            return chosen, cost


# --- The clocks of logger and generator -------------------------------------------------------------------------------
Told = Callable[[float, str], None]
_ROUNDS = 2  # of assignment and search
_MOST_ROUNDS, _FALLS = 6, 0.95  # of pulses of another period, while the cost falls to less than that share
_PERIOD_LOGS = 4  # that a far period is sought on
_EXPLAINS = 0.75  # of the cost: a period that is nearly right leaves less
_FIRST_STEPS = 5  # of searches of which the best continues
_TICKS_PAY = 1.0  # of the cost
_HELD_PAYS = 3.0  # of the cost: an odds ratio of 20
_NEAR_PAYS = 4.0  # of the cost, for each independent residual: what one more number has to gain, a chance of 0.5 %
_MORE = 2.0  # times the noise: what a period that is off by more than quartz clocks are leaves
_SCATTER = 2e-5  # s, of stamps: less is a tenth of a milliradian at 5 rad/s


def with_clocks(task: Task, starts: Sequence[Point], tell: Told, began: float) -> Point:
    """Search with pulses that come alike for all logs, and then for what the clocks of these logs do.

    Parameters
    ----------
    task : Task
        Continues with another forecast where the logs want another clock, and says so in its remarks.
    starts : sequence of Point
        One for each valley: which is the deepest is seen where pulses come when they do.
    tell : callable
    began : float
        Share of the search that is done.
    """
    ends = [_with_phases(task, start, tell, began) for start in starts]
    point = min(ends, key=lambda one: one[1])[0]
    task.measure(point)
    point = _held(task, point, tell, began)
    return _with_period(task, _with_regular_times(task, point, tell, began), tell, began)


def _with_phases(task: Task, start: Point, tell: Told, began: float) -> tuple[Point, float]:
    """Return where a search ends that finds the pulses of each log, and the logarithm of the noise there."""
    few = task.some_of_many()
    task.forecast.own_phases = False
    point = few.ran(start, tell, began).point
    task.measure(point)
    task.forecast.own_phases = True
    for k in range(_ROUNDS):
        before = [task.forecast.frames_of(point, k) for k in task.fitted]
        tell(began, "pulses")
        there = settled(task.scan(point), task.fitted)
        point = (task if k else few).ran(there, tell, began).point
        task.measure(point)
        if [task.forecast.frames_of(point, k) for k in task.fitted] == before:
            break
    if task.forecast.ticked:
        point = _with_ticks(task, point, tell, began)
    return point, math.fsum(math.log(value) for value in task.forecast.noise.values())


def _with_ticks(task: Task, point: Point, tell: Told, began: float) -> Point:
    """Return where a search ends that finds which commands ticks take, the better of two.

    Ticks that take wrong commands bend all parameters, so that the right ones would not fit better with these. So they
    are sought from where the search stands and, with parameters held near them, from where it began.
    """
    near = task.like(task.forecast, task.near_start())
    again = near.ran(settled(near.scan(_from_start(task, point)), task.fitted), tell, began).point
    ends = [ticking(task, point, tell, began),
            ticking(task, task.ran(ticking(near, again, tell, began), tell, began).point, tell, began)]
    best = min(ends, key=task.cost)
    task.measure(best)
    return best


def ticking(task: Task, point: Point, tell: Told, began: float) -> Point:
    """Return where a search ends in which ticks take other commands, as long as that pays.

    The point to which all parameters would go with these counts.
    """
    if not task.forecast.ticked:
        return point
    cost = task.cost(point)
    for _ in range(_MOST_ROUNDS):
        tell(began, "ticks")
        better = giving_way(task.scan(point), task.prior, task.held, task.fitted)
        found = task.ran_all(better, tell, began, _FIRST_STEPS)
        best = min(found, key=lambda outcome: outcome.cost, default=None)
        best = best if best is None or best.converged else task.ran(best.point, tell, began)
        if best is None or not best.cost < cost - _TICKS_PAY:
            break
        point = best.point
        task.measure(point)
        cost = task.cost(point)
    return point


def _held(task: Task, point: Point, tell: Told, began: float) -> Point:
    """Let servos that cannot rest under their load hold their first command from before the log on, if they did."""
    forecast = task.forecast
    if not any(forecast.hunts(forecast.cases[k]) for k in task.fitted):
        return point
    before = task.ran(point, tell, began)
    forecast.held = True
    after = task.ran(before.point, tell, began)
    if not after.cost < before.cost - _HELD_PAYS:
        forecast.held = False
        return before.point
    task.measure(after.point)
    return after.point


def _with_regular_times(task: Task, point: Point, tell: Told, began: float) -> Point:
    """Take samples as regular where stamps scatter about regular times and the motion does not."""
    several = [regular_times(case.log.time) for case in task.forecast.cases]
    scatter = max((one.scatter for one in several if one is not None), default=0.0)
    if scatter < _SCATTER:
        return point
    tell(began, "stamps")
    old = task.forecast
    even = Forecast([made_regular(case.log) for case in old.cases], old.model, old.space, old.nuisance, old.sensors)
    other = task.like(even)
    found = other.ran(point._replace(frames=even.frames), tell, began)
    found = other.ran(settled(other.scan(found.point), task.fitted), tell, began)
    if not task.pays(point, other, found.point):
        return point
    task.become(other, f"stamps scatter by {1e3 * scatter:.2g} ms about regular times, the motion does not: samples "
                       "count as taken at those")
    task.stamps_off = {k: 2.0 * one.scatter / math.sqrt(len(one.times))
                       for k, one in enumerate(several) if one is not None}
    task.measure(found.point)
    return found.point


def _with_period(task: Task, point: Point, tell: Told, began: float) -> Point:
    """Search for the period of the pulses too where it is asked for, or where they drift.

    A period that is off by as little as quartz clocks are is found from where the fit stands.
    """
    old = task.forecast
    if "frame_period" in old.extra:
        return _at_likely_period(task, task, point, tell, began)
    if len({case.period for case in old.cases}) > 1:
        return point
    far_off = _is_more_than_noise(task, point) and drifts(old, task.loss, point, task.fitted, remember=False)
    if not far_off and not drifts(old, task.loss, point, task.fitted):
        return point
    tell(began, "period of the pulses")
    wider = task.like(Forecast(
        [case.log for case in old.cases], old.model, old.space, (*old.nuisance, "frame_period"), old.sensors))
    few = task.some_of_many()
    both = [(few, few.like(wider.forecast, wider.prior)), (task, wider)][few is task:]
    found = None
    for search, other in both:  # on all of many logs only where some want it
        found = _period(search, other, point, tell, began, far_off=far_off)
        if found is None:
            break
    if found is None:
        return point  # what lacks something takes any further number: whether this one explains it, trials tell
    there = wider.forecast.nuisance_of(found.shared, "frame_period")
    task.become(wider, f"pulses come every {1e3 * there:.6g} ms by the logs, not every {1e3 * task.period:.6g} ms: "
                       "their period was fitted too")
    task.measure(found)
    return found


def _period(task: Task, wider: Task, point: Point, tell: Told, began: float, *, far_off: bool) -> Point | None:
    """Return where a search ends that has the period too; None where that does not pay, or explains too little."""
    near = wider.ran(_with_its_period(point, task.period), tell, began).point
    found = None
    if task.pays(point, wider, near, _NEAR_PAYS):
        found = near = _assigned_anew(wider, near, tell, began, rounds=1)
    if far_off and _is_more_than_noise(wider, near):
        far = _at_likely_period(task, wider, point, tell, began)
        if wider.cost(far) < wider.cost(near) and task.pays(point, wider, far):
            found = far
    return None if found is None or _is_more_than_noise(wider, found) else found


def _at_likely_period(task: Task, wider: Task, point: Point, tell: Told, began: float) -> Point:
    """Return where a search ends that begins at the periods which explain most.

    A period that is wrong by some per cent bends all parameters, so that no other would fit better with these. So they
    are held near where they began until it is found.
    """
    asked, few = wider is task, task.few(_PERIOD_LOGS)
    tell(began, "period of the pulses")
    near = task.like(task.forecast, task.near_start(), few)
    here = near.ran(settled(near.scan(_from_start(task, point)), few), tell, began)
    scan = near.scan(here.point)
    likely = likely_periods(scan, few)
    near, free = wider.like(wider.forecast, wider.near_start(), few), wider.like(wider.forecast, wider.prior, few)
    tried = near.ran_all([_moved(scan, few, period, asked=asked) for period in likely], tell, began)
    best = min(tried, key=lambda outcome: outcome.cost)
    if not asked and best.cost > _EXPLAINS * here.cost:
        return _with_its_period(point, task.period)
    found = best.point
    # A period that is nearly right tells far more of when pulses come: once more from the start with it
    again = _at_its_period(wider.forecast, _from_start(task, found))
    again = near.ran(settled(near.scan(again), few), tell, began).point
    found = min((_assigned_anew(free, one, tell, began) for one in (found, again)), key=free.cost)
    if few != task.fitted:
        found = _assigned_anew(wider, found, tell, began, rounds=1)
    if asked:
        task.measure(found)
    return found


def _is_more_than_noise(task: Task, point: Point) -> bool:
    """Tell whether residuals are so much larger than the sensor's own noise that another period may be the reason."""
    forecast, series = task.forecast, []
    for k, part in zip(task.fitted, forecast.at(point, derivatives=False, cases=task.fitted), strict=True):
        case, residuals = forecast.cases[k], by_sensor(forecast, k, part)
        name = next(name for name in ANGLES if name in case.places)
        measured = case.values[name]
        series.append(SensorSeries(case.log, case.log.start + case.times[case.places[name]], measured,
                                   measured + residuals[name]))
    left = float(np.sqrt(np.mean(np.concatenate([one.residual for one in series]) ** 2)))
    return left > _MORE * noise_of(series).size


def _from_start(task: Task, point: Point) -> Point:
    """Return a point with the parameters that the search began with; clocks and offsets stay."""
    size = len(task.forecast.space)
    return point._replace(shared=np.concatenate([task.nominal().shared[:size], point.shared[size:]]))


def _moved(scan: Scan, cases: Sequence[int], period: float, *, asked: bool) -> Point:
    """Return the point with pulses of another period, the last of its shared numbers."""
    moved = with_period(scan, cases, period)
    return _with_its_period(moved._replace(shared=moved.shared[:-1]) if asked else moved, period)


def _with_its_period(point: Point, period: float) -> Point:
    """Return a point with the period of its pulses as the last of its shared numbers."""
    return point._replace(shared=np.append(point.shared, period / PERIOD_SCALE))


def _at_its_period(forecast: Forecast, point: Point) -> Point:
    """Return a point whose commands go to pulses of the period that it found."""
    period = forecast.nuisance_of(point.shared, "frame_period")
    frames = [forecast.frames_of(point, k) for k in range(len(forecast.cases))]
    return point._replace(frames=tuple(f._replace(period=period) for f in frames))


def _assigned_anew(wider: Task, point: Point, tell: Told, began: float, rounds: int = _MOST_ROUNDS) -> Point:
    """Search on from a point with its commands assigned to pulses of the period that it found, while that pays."""
    cost = math.inf
    for _ in range(rounds):
        exact = _at_its_period(wider.forecast, point)
        found = wider.ran(settled(wider.scan(exact), wider.fitted), tell, began)
        if found.cost > _FALLS * cost:
            break
        point, cost = found.point, found.cost
    return point


# --- Where the searches for an offset and a delay begin ---------------------------------------------------------------
_OF_GOALS = (0.001, 0.002, 0.005, 0.01)  # s: a bus carries a goal sooner than pulses do
DELAYS = (0.02, 0.0, 0.04, 0.06, 0.09)  # s, where the search for it begins, and some others
_NEAR = 0.3  # rad, an offset that the search finds by itself
_LOOKS = 25  # of each log


def first_offset(forecast: Forecast, fitted: Sequence[int]) -> float:
    """Return how far the measured angles lie from the commanded ones in the middle; 0 where that is near [rad]."""
    if "angle_offset" not in forecast.extra:
        return 0.0
    gaps: list[float] = []
    for case in (forecast.cases[k] for k in fitted):
        place = case.places.get("output_angle", np.zeros(0, np.int64))
        model = _model_of(forecast, case)
        drive = model.command(case.signal)
        some = np.arange(0, len(place), max(1, len(place) // _LOOKS))
        asked = np.asarray(model.start_angle(cast("Any", drive(case.times[place[some]]))))
        gaps += (case.values["output_angle"][some] - asked).tolist() if len(some) else []
    middle = float(np.median(gaps)) if gaps else 0.0
    return middle if abs(middle) > _NEAR else 0.0


def at_likely_delay(task: Task, point: Point) -> Point:
    """Return the point with the delay of which the residuals are smallest, of some usual ones, if none is known."""
    forecast = task.forecast
    if "delay" not in forecast.extra or "delay" in task.begin.shared:
        return point
    place, tried = len(forecast.space) + forecast.extra.index("delay"), []
    goals = isinstance(forecast.model, DigitalServo) and forecast.model.takes_goals
    for delay in (*DELAYS, *(_OF_GOALS if goals else ())):
        shared = point.shared.copy()
        shared[place] = delay / DELAY_SCALE
        tried.append(point._replace(shared=shared))
    found = forecast.at_all(tried, cases=task.few())
    sizes = [sum(float(np.abs(part.residual).sum()) for part in parts) for parts in found]
    return tried[int(np.argmin([size if math.isfinite(size) else math.inf for size in sizes]))]


def _model_of(forecast: Forecast, case: Case) -> Model:
    """Return the model with what a log says of its servo."""
    model = forecast.model
    own = {name: value for name, value in case.log.parameters.items() if name in (*model.requires, *model.optional)}
    if not own:
        return model
    with warnings.catch_warnings():  # of two calibrations that differ: it was said of the servo itself
        warnings.simplefilter("ignore")
        return type(model)(model.servo.replace(own))


# --- The delay that all logs share, as far as commands and pulses tell it ---------------------------------------------
Array = NDArray[np.float64]
_SHOWN = 3  # times of a log that are named


def delay_range(scan: Scan, credible: Mapping[int, Sequence[PulseChoice]],
                errors: Sequence[float]) -> tuple[float, float]:
    """Return between which values the delay lies [s]: what all logs allow, and where they do not agree what they say.

    Parameters
    ----------
    scan : Scan
        Where the search ended.
    credible : mapping of int to sequence of Choice
        Pulses that each fitted log allows.
    errors : sequence of float
        By how much the time at which each log's pulses take effect may be wrong, either way [s].
    """
    forecast, delay = scan.forecast, scan.forecast.nuisance_of(scan.point.shared, "delay")
    lows, highs = [], []
    for (k, choices), error in zip(credible.items(), errors, strict=True):
        log = forecast.cases[k].log
        ends = []
        for choice in choices:
            gap, takes_effect = gap_of(log, choice.frames), delay + choice.first * DELAY_SCALE
            sooner, later = _of_ticks(scan, k, choice)
            ends.append((takes_effect - sooner - gap.high, takes_effect + later - gap.low))
        unsure = error + _scatter(log)
        lows.append(min(low for low, _ in ends) - unsure)
        highs.append(max(high for _, high in ends) + unsure)
    low, high = max(lows), min(highs)
    return max(min(low, high), 0.0), max(low, high, 0.0)


def unsure_commands(scan: Scan, credible: Mapping[int, Sequence[PulseChoice]]) -> tuple[str, ...]:
    """Return the commands of which it is not sure which pulse carries them, a line a log."""
    lines = []
    for k, choices in credible.items():
        log, now = scan.forecast.cases[k].log, scan.now(k).frames
        others = [near_edges(log, now, choice.frames) for choice in choices if choice.frames != now]
        times = np.unique(np.concatenate(others)) if others else np.zeros(0)
        if len(times):
            shown = ", ".join(f"{t:.3f}" for t in times[:_SHOWN]) + (", ..." if len(times) > _SHOWN else "")
            lines.append(f"log {log.name!r}: the commands at {shown} s change near the edge of a pulse; which pulse "
                         "carries them is not sure")
    return tuple(lines)


def _of_ticks(scan: Scan, k: int, choice: PulseChoice) -> tuple[float, float]:
    """Return by how much sooner and later pulses could come if ticks were as much later and sooner after them [s]."""
    ticks = scan.ticks.get(k)
    if ticks is None:
        return 0.0, 0.0
    gap = ticks.gap_of(choice.frames.tick)
    return gap.high - choice.frames.tick, choice.frames.tick - gap.low


def _scatter(log: Log) -> float:
    """Return how far off their beat the stamps of commands lie at most [s]; where they have none, they are believed."""
    found = regular_times(log.time)
    if found is None:
        return 0.0
    off = np.abs(log.time - found.times)
    return float(np.quantile(off, 0.95))


def phase_errors(forecast: Forecast, cases: Sequence[int], parts: Sequence[LogPart], rows: Sequence[Rows],
                 loss: Loss, doubt: Uncertainty) -> list[float]:
    """Return the standard error of when each log's pulses take effect, at any time in the log [s].

    Parameters
    ----------
    forecast : Forecast
    cases : sequence of int
    parts : sequence of LogPart
        Of these logs, with derivatives.
    rows : sequence of Rows
        Of the same: how their own numbers follow the shared ones.
    loss : Loss
    doubt : Uncertainty
        Of the shared numbers.
    """
    drift = _drift(forecast, cases, parts, loss, doubt.inflation)
    errors = []
    for k, part, row in zip(cases, parts, rows, strict=True):
        case = forecast.cases[k]
        place = forecast.names_of_own(case).index("frame_phase")
        inside = np.abs(part.residual) <= loss.limit
        belief = forecast.own_belief(case)[1]
        H = (part.own * inside[:, None]).T @ part.own + np.diag(belief**2)
        own = doubt.inflation**2 * float(np.linalg.pinv(H)[place, place])
        follow = row.follow[place] if row.follow is not None else np.zeros(len(doubt.covariance))
        middle = DELAY_SCALE * math.sqrt(own + float(follow @ doubt.covariance @ follow))
        errors.append(math.hypot(middle, 0.5 * case.log.duration * drift))
    return errors


def _drift(forecast: Forecast, cases: Sequence[int], parts: Sequence[LogPart], loss: Loss, inflation: float) -> float:
    """Return how fast pulses may run away from the period that is used [s/s], as far as the residuals can say."""
    along, power = 0.0, 0.0
    for k, part in zip(cases, parts, strict=True):
        case = forecast.cases[k]
        time = np.concatenate([case.times[place] for place in case.places.values()]) - 0.5 * case.log.duration
        moved = part.later * time
        along -= float(moved @ np.clip(part.residual, -loss.limit, loss.limit))
        power += float(moved @ moved)
    return DELAY_SCALE * math.hypot(along / power, inflation / math.sqrt(power)) if power > 0.0 else 0.0
