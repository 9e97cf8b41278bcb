"""The clocks of logger and generator: when pulses come, how far apart, and whether stamps tell when samples were."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.giving_way import giving_way
from servotwin.identification.fitting.noise import SensorSeries, noise_of
from servotwin.identification.fitting.phases import Scan, drifts, likely_periods, settled, with_period
from servotwin.identification.fitting.point import PERIOD_SCALE, Point
from servotwin.identification.fitting.scatter import by_sensor
from servotwin.logs.log import ANGLES
from servotwin.logs.regular import made_regular, regular_times

if TYPE_CHECKING:
    from servotwin.identification.fitting.task import Task

Told = Callable[[float, str], None]

_ROUNDS = 2  # of assignment and search
_MOST_ROUNDS, _FALLS = 6, 0.95  # of pulses of another period, while the cost falls to less than that share
_PERIOD_LOGS = 4  # that a far period is sought on
_EXPLAINS = 0.75  # of the cost: a period that is nearly right leaves less
_FIRST_STEPS = 5  # of searches of which the best goes on
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
        Goes on with another forecast where the logs want another clock, and says so in its remarks.
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

    What counts is where all parameters would go with these.
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
