"""Changes in the course of logs: a supply that falls, drops or differs from log to log, a winding that warms.

A number has another value in each stretch of a log. A log is simulated once for each of them, with that value
throughout, and each simulation counts in its own stretch: a servo in its loop soon forgets what was before.

Every place after which enough is left is simulated once at the present numbers. A servo in its loop soon forgets an
event, so the effects of several add up: the events of a log are chosen by matching pursuit (Mallat & Zhang 1993), any
number of them, simulated together, and left out again where the log is as well off without one. Then the numbers are
searched again. Every second sample chooses, those between judge on the quarters that do not teach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.diagnosis.bench import Gain, Spent, Told, TrialBench, Watched, gain, teaching
from servotwin.identification.fitting.search.case import Point, has_pulses, joined, robust_deviation
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.traces import Trace
from servotwin.identification.fitting.verdict import Cause, shown
from servotwin.logs.log import Log
from servotwin.models import DigitalServo

# --- Changes in the course of logs ------------------------------------------------------------------------------------

Array = NDArray[np.float64]
VOLTAGE, RESISTANCE = "supply.open_circuit_voltage", "motor.armature_resistance"
_STRETCHES = 16  # of a log
_STEP = 0.02  # of the number: the step from which its effect is computed
_DROPS = tuple(k / 16.0 for k in range(1, 16))  # of a log, where it may drop
_MOST = 0.8  # of the number, that it changes by
_ROUNDS = 4
_REACH = 0.5  # of a searched number, in a round
_ALIKE = 1.001  # times the least cost
_BETTER = 0.98  # of the cost: what one more round has to reach


@dataclass(frozen=True)
class _Shape:
    """How a number changes: by which share of its change, at each sample of each log, and in each stretch."""

    samples: tuple[Array, ...]
    stretches: Array


def changing_supply(bench: TrialBench) -> Told | None:
    """Return what a supply gains whose voltage falls over each log or over all, drops at once, or differs in some."""
    count = len(bench.cases)
    groups = [some for size in range(1, count // 2 + 1) for some in combinations(range(count), size)]
    kinds = [[_ramp(bench)], [_ramp(bench, over_all=True)], [_drop(bench, at) for at in _DROPS],
             [_some(bench, group) for group in groups]]
    return _told(bench, VOLTAGE, kinds, "supply that changes", "a supply whose voltage changes in the course of the "
                 "logs, by {change:.0f} %", "measure the voltage beside the angle, or use a stiffer supply")


def warming(bench: TrialBench) -> Told | None:
    """Return what a winding gains whose resistance rises over each log or over all."""
    return _told(bench, RESISTANCE, [[_ramp(bench, over_all=True)], [_ramp(bench)]], "warming",
                 "a winding that warms, its resistance changing by {change:.0f} %", "let it cool between logs, or give "
                 "the servo's thermal masses")


def _told(bench: TrialBench, name: str, kinds: Sequence[Sequence[_Shape]], cause: str, words: str,
          remedy: str) -> Told | None:
    model = bench.setting.model
    if name not in (*model.requires, *model.optional) or not nominal(model.servo, name):
        return None
    if name == VOLTAGE and name in bench.old.space.names:
        return None
    found = _Drift(bench, name).best(kinds)
    if found is None:
        return None
    change, residuals = found
    return Told(cause, words.format(change=100.0 * change), remedy,
                gain(bench.base.residuals, residuals, bench.noise))


def _ramp(bench: TrialBench, *, over_all: bool = False) -> _Shape:
    count = len(bench.cases) if over_all else 1
    samples, stretches = [], []
    for k, case in enumerate(bench.cases):
        first = k / count if over_all else 0.0
        samples.append(first + _way(case.times, case.log.duration) / count)
        stretches.append(first + (np.arange(_STRETCHES) + 0.5) / _STRETCHES / count)
    return _Shape(tuple(samples), np.array(stretches))


def _drop(bench: TrialBench, at: float) -> _Shape:
    samples = tuple((_way(case.times, case.log.duration) >= at).astype(np.float64) for case in bench.cases)
    after = ((np.arange(_STRETCHES) + 0.5) / _STRETCHES >= at).astype(np.float64)
    return _Shape(samples, np.tile(after, (len(bench.cases), 1)))


def _some(bench: TrialBench, group: Sequence[int]) -> _Shape:
    samples = tuple(np.full(len(case.times), float(k in group)) for k, case in enumerate(bench.cases))
    return _Shape(samples, np.array([np.full(_STRETCHES, float(k in group)) for k in range(len(bench.cases))]))


def _way(times: Array, duration: float) -> Array:
    return times / max(duration, 1e-12)


class _Drift:
    """Trials in which one number changes: all logs in stretches, beside the base of a bench."""

    def __init__(self, bench: TrialBench, name: str) -> None:
        self.bench, self.name = bench, name
        old, forecast = bench.old, bench.base.forecast
        self.searched = name in old.space.names
        self.place = old.space.names.index(name) if self.searched else -1
        self.parts = forecast.at(bench.base.point)  # of what teaches
        self.J = joined(self.parts)
        self.r = np.concatenate([part.residual for part in self.parts])
        self.own = [part.own.shape[1] for part in self.parts]
        names = [one for one in old.space.names if one != name]
        self.space = old.space.changed(bench.setting.model, names or list(old.space.names), believed=())
        self.alone = not names

    def best(self, kinds: Sequence[Sequence[_Shape]]) -> tuple[float, tuple[Array, ...]] | None:
        """Return by which share the number changes, and the residuals with it; None if it is not determined.

        Of each kind of shapes the one that promises most is tried.
        """
        if self.alone:
            return None
        slope = self._slope()
        if slope is None:
            return None
        tried = []
        for several in kinds:
            told = [(*self._step(self.r, slope, shape), shape) for shape in several]
            if not told:
                continue
            least = min(cost for cost, *_ in told)
            # Where a drop lies in a quarter that does not teach, nothing tells: the middle
            alike = [(step, shape) for cost, step, shape in told if cost <= _ALIKE * least]
            found = self._searched(slope, *alike[len(alike) // 2])
            tried += [] if found is None else [found]
        best = min(tried, key=lambda one: one[0], default=None)
        return None if best is None else best[1:]

    def _slope(self) -> list[Array] | None:
        """Return what the number does to the residuals of each log, where they teach, for each share of it."""
        parts = self._residuals([(k, _STEP) for k in range(len(self.bench.cases))], self.bench.base.point)
        if parts is None:
            return None
        return [(after * keep - part.residual) / _STEP for after, part, keep in zip(
            parts, self.parts, self.bench.base.forecast.seen or (), strict=True)]

    def _step(self, r: Array, slope: list[Array], shape: _Shape) -> tuple[float, Array]:
        """Return the cost of a shape to first order, and the step of all numbers, its change the last."""
        column = np.concatenate([d * self._on_residuals(k, x) for k, (d, x) in
                                 enumerate(zip(slope, shape.samples, strict=True))])
        A = np.column_stack([self.J, column])
        step, cost = self.bench.task.loss.linear_step(r, A, np.full(A.shape[1], _REACH**-2.0), rounds=4)
        return cost, step

    def _on_residuals(self, k: int, x: NDArray[Any]) -> NDArray[Any]:
        """Return what is given at the instants of a log at its residuals: sensor by sensor."""
        return np.concatenate([x[place] for place in self.bench.cases[k].places.values()])

    def _searched(self, slope: list[Array], step: Array,
                  shape: _Shape) -> tuple[float, float, tuple[Array, ...]] | None:
        """Return cost, change and the residuals of all samples, after some steps of all numbers."""
        loss, point, change = self.bench.task.loss, self.bench.base.point, 0.0
        best: tuple[float, float, list[Array]] | None = None
        for _ in range(_ROUNDS):
            trial, to = self._moved(point, step), float(np.clip(change + step[-1], -_MOST, _MOST))
            parts = self._stretched(trial, shape, to)
            if parts is None:
                break
            seen = self.bench.base.forecast.seen or ()
            r = np.concatenate([part * keep for part, keep in zip(parts, seen, strict=True)])
            cost = loss.cost(r)
            if best is not None and cost > _BETTER * best[0]:
                best = min(best, (cost, to, parts), key=lambda one: one[0])
                break
            best, point, change = (cost, to, parts), trial, to
            step = self._step(r, slope, shape)[1]
        if best is None:
            return None
        return *best[:2], tuple(self._angle(k, part) for k, part in enumerate(best[2]))

    def _moved(self, point: Point, step: Array) -> Point:
        count = self.bench.base.forecast.size
        own, first = [], count
        for values, width in zip(point.own, self.own, strict=True):
            own.append(values + step[first:first + width])
            first += width
        task = self.bench.task_of(self.bench.base.forecast)
        return point._replace(shared=np.clip(point.shared + step[:count], task.lower, task.upper), own=tuple(own))

    def _stretched(self, point: Point, shape: _Shape, change: float) -> list[Array] | None:
        """Return the residuals of each log if the number changes, put together from its stretches."""
        pieces = [(k, i) for k in range(len(self.bench.cases)) for i in range(_STRETCHES) if self._inside(k, i).any()]
        parts = self._residuals([(k, change * float(shape.stretches[k, i])) for k, i in pieces], point)
        if parts is None:
            return None
        found = [np.zeros(len(part.residual)) for part in self.parts]
        for (k, i), part in zip(pieces, parts, strict=True):
            here = self._on_residuals(k, self._inside(k, i))
            found[k][here] = part[here]
        return found

    def _residuals(self, pieces: Sequence[tuple[int, float]], point: Point) -> list[Array] | None:
        """Return the residuals of logs in which the number is larger by some share; None of a failure."""
        forecast = self._forecast(pieces, point)
        parts = forecast.at(self._point(point, [k for k, _ in pieces]), derivatives=False)
        return [part.residual for part in parts] if all(np.isfinite(p.residual).all() for p in parts) else None

    def _inside(self, k: int, i: int) -> NDArray[np.bool_]:
        """Tell which instants of a log lie in a stretch."""
        case = self.bench.cases[k]
        which = np.minimum((_way(case.times, case.log.duration) * _STRETCHES).astype(int), _STRETCHES - 1)
        return np.asarray(which == i)

    def _forecast(self, pieces: Sequence[tuple[int, float]], point: Point) -> Watched:
        """Return a forecast of logs whose number is by some share larger."""
        bench, base = self.bench, self.bench.base.forecast
        logs = []
        for n, (k, share) in enumerate(pieces):
            log = bench.setting.logs[k]
            logs.append(replace(log, name=f"{log.name} {n}", parameters={
                **log.parameters, self.name: (1.0 + share) * self._value(k, point)}))
        bench.purse.check()
        forecast = Watched(bench.purse, 1.0, logs, bench.setting.model, self.space, base.nuisance, bench.old.sensors)
        forecast.goes_on_from(base)
        return forecast

    def _value(self, k: int, point: Point) -> float:
        """Return the number at a point, or what a log says of it."""
        if self.searched:
            p = self.bench.old.space.parameters[self.place]
            return float(p.value(point.shared[self.place]))
        said = self.bench.setting.logs[k].parameters.get(self.name)
        return float(said if said is not None else self.bench.setting.model.value(self.name))

    def _point(self, point: Point, logs: Sequence[int]) -> Point:
        shared = np.delete(point.shared, self.place) if self.searched else point.shared
        frames = point.frames and tuple(point.frames[k] for k in logs)
        return Point(shared, tuple(point.own[k] for k in logs), frames)

    def _angle(self, k: int, residual: Array) -> Array:
        """Return the residuals of the angle (SI)."""
        case, first = self.bench.cases[k], 0
        for name, place in case.places.items():
            if name in ("output_angle", "feedback_voltage"):
                return np.asarray(residual[first:first + len(place)] * case.sigma(name, self.bench.base.forecast.noise))
            first += len(place)
        return np.zeros(0)


# --- Single events in logs, pulses that never came and rows that were not written, kept where they pay ----------------

_EVENTS_MOST = 0.5  # of the places of a log: more events tell nothing apart
_SOON = 10  # samples after an event, by which it is judged
_EVENTS_ROUNDS, _TIMES = 3, 2  # of choosing and searching, and of choosing in each
_FORETOLD = 0.25  # of what an event has to gain: what it is tried for, where its effect is foretold
_PAYS = 8.0  # in units of noise: what one of some hundred places has to gain (their logarithm, twice)
_LEFT = 0.25  # of what is left in a log, where that is more than noise: a model that lacks something takes any event
MOST_LEFT = 0.5  # of the error
_FIRST_LEFT = math.sqrt(MOST_LEFT)  # of the error, before any number has moved: half of the way


@dataclass(frozen=True)
class _Kind:
    """One kind of event: where it may be in a log, the log with some, and whether it only delays what follows."""

    places: Callable[[Log], Sequence[int]]
    put: Callable[[Log, Sequence[int]], Log]
    delays: bool = False


def lost_pulses(bench: TrialBench) -> Told | None:
    """Return what pulses that are left out gain."""
    if not has_pulses(bench.setting.model):
        return None
    period = bench.cases[0].period

    def width(log: Log) -> int:
        return max(1, round(period / float(np.median(np.diff(log.time)))))

    holds = isinstance(bench.setting.model, DigitalServo)  # a pulse that brings nothing new is not missed

    def places(log: Log) -> Sequence[int]:
        size, changes = width(log), log.changes
        return [k for k in range(1, len(log) - 1, size) if not holds or ((changes >= k) & (changes < k + size)).any()]

    def put(log: Log, starts: Sequence[int]) -> Log:
        if not starts:
            return log
        on = log.sent.copy()
        for start in starts:
            on[start:start + width(log)] = False
        return replace(log, torque_on=on)

    count, gained = _tried(bench, _Kind(places, put))
    frames = sum(log.duration for log in bench.setting.logs) / period
    return None if gained is None else Told(
        "lost pulses", f"{count} of {round(frames)} pulses that never reached the servo", "look for a loose contact, "
        "or a generator that skips; leave their commands empty", gained)


def dropped_samples(bench: TrialBench) -> Told | None:
    """Return what gaps of one sample gain, where stamps say that there is none.

    Where the command changes, the row that is missing had the old one, or the new one (its place is then negative).
    """
    def places(log: Log) -> Sequence[int]:
        changed = log.changes
        return [*range(1, len(log) - 1), *(-changed[changed < len(log) - 1]).tolist()]

    def put(log: Log, starts: Sequence[int]) -> Log:
        return _with_rows(log, sorted(starts, key=abs))

    count, gained = _tried(bench, _Kind(places, put, delays=True))
    rows = sum(map(len, bench.setting.logs))
    return None if gained is None else Told(
        "dropped samples", f"{count} rows that are missing among {rows}, though the stamps go on evenly", "have the "
        "logger stamp each row when it is measured", gained)


def _with_rows(log: Log, places: Sequence[int]) -> Log:
    """Return a log with rows put in that say nothing but a command."""
    if not places:
        return log
    step, at = float(np.median(np.diff(log.time))), np.abs(places)
    late = np.sum([np.arange(len(log)) >= place for place in at], axis=0)
    time = log.time + step * late
    return replace(
        log, time=np.insert(time, at, time[at] - step), measured={
            name: np.insert(values, at, math.nan) for name, values in log.measured.items()},
        command=np.insert(log.command, at, [log.command[p - 1] if p > 0 else log.command[-p] for p in places]),
        torque_on=None if log.torque_on is None else np.insert(log.torque_on, at, log.torque_on[at]))


def _tried(bench: TrialBench, kind: _Kind) -> tuple[int, Gain | None]:
    """Return how many events were found, and what they gain on the quarters of the logs that judge; nothing of little.

    Their numbers come from the quarters that teach, as those of all candidates. Where events are is chosen by every
    second sample, everywhere, and the others judge. A hundred events explain some of whatever a model lacks: so these
    have to explain most of it, and some of it before any number has moved.
    """
    base, point = bench.base, bench.base.point
    found: list[list[int]] = [[] for _ in bench.setting.logs]
    residuals = base.residuals
    try:
        for number in range(_EVENTS_ROUNDS):
            before = found
            chosen = [_settled(bench, point, k, kind, already) for k, already in enumerate(found)]
            found = [one.places for one in chosen]
            if found == before:
                break
            residuals = tuple(one.residual for one in chosen)
            if number == 0 and _gain(base.residuals, residuals, bench.noise).after > _FIRST_LEFT * _gain(
                    base.residuals, base.residuals, bench.noise).before:
                return 0, None
            logs = tuple(kind.put(log, starts) for log, starts in zip(bench.setting.logs, found, strict=True))
            trial = bench.searched(replace(bench.setting, logs=logs), point)
            point, residuals = trial.point, trial.residuals
    except Spent:
        pass  # they count as far as they were found
    if not any(found) or not all(np.isfinite(r).all() for r in residuals):
        return 0, None
    gained = _gain(base.residuals, residuals, bench.noise)
    return sum(map(len, found)), gained if gained.after < MOST_LEFT * gained.before else None


def _gain(before: Sequence[Array], after: Sequence[Array], noise: float) -> Gain:
    """Return what is gained on the samples that did not choose."""
    return gain([r[1::2] for r in before], [r[1::2] for r in after], noise)


class _Chosen(NamedTuple):
    """The events of a log, and the residuals of the angle with them (SI)."""

    places: list[int]
    residual: Array


def _settled(bench: TrialBench, point: Point, k: int, kind: _Kind, already: list[int]) -> _Chosen:
    """Return the events of one log, chosen until they stay: only then do numbers move that could make up for some."""
    (here,) = _with(bench, point, k, kind, [already])
    found = _Chosen(already, here)
    for _ in range(_TIMES):
        before = found
        found = _chosen(bench, point, k, kind, before)
        if found.places == before.places:
            break
    return found


def _chosen(bench: TrialBench, point: Point, k: int, kind: _Kind, before: _Chosen) -> _Chosen:
    """Return the events of one log: further ones by matching pursuit, less those without which it is as well off.

    None is tried where the samples after it cost less than an event has to gain.
    """
    log, used, (already, here) = bench.setting.logs[k], bench.counted(k), before
    if not _like(here, used):
        return before
    scale = max(bench.noise, _LEFT * robust_deviation(here))
    known = {abs(one) for one in already}
    places = [place for place in kind.places(log) if abs(place) not in known]
    most = _most(bench, scale, here, here + log.measured[log.angle_name][used] if kind.delays else None)
    first = np.searchsorted(used, np.abs(np.array(places, np.int64)))
    likely = np.flatnonzero(most[first] > _PAYS)
    alone = _with(bench, point, k, kind, [[*already, places[i]] for i in likely])
    good = [n for n, part in enumerate(alone) if _like(part, used)]
    further = _pursued(bench, scale, here, np.array([alone[n] - here for n in good]).reshape(-1, len(here)),
                       first[likely[good]], round(_EVENTS_MOST * len(places)))
    every = sorted([*already, *(places[likely[good[n]]] for n in further)])
    (there,) = _with(bench, point, k, kind, [every])
    if not every or not _like(there, used):
        return before
    less = _with(bench, point, k, kind, [[one for one in every if one != place] for place in every])
    worth = [_worth(bench, scale, part, there, int(np.searchsorted(used, abs(place)))) if _like(part, used) else 0.0
             for place, part in zip(every, less, strict=True)]
    kept = [place for place, gained in zip(every, worth, strict=True) if gained > _PAYS]
    if kept == already:
        return before
    (there,) = _with(bench, point, k, kind, [kept]) if kept != every else (there,)
    return _Chosen(kept, there) if _like(there, used) else before


def _with(bench: TrialBench, point: Point, k: int, kind: _Kind, several: Sequence[Sequence[int]]) -> list[Array]:
    """Return the residuals of a log with some events each (SI)."""
    log = bench.setting.logs[k]
    return bench.copies(k, [kind.put(log, places) for places in several], point) if several else []


def _pursued(bench: TrialBench, scale: float, here: Array, effects: Array, first: NDArray[np.int64],
             most: int) -> list[int]:
    """Return which effects are added to residuals, in turn the one that lowers the cost soon after it by most."""
    chosen: list[int] = []
    at = first[:, None] + np.arange(_SOON)
    teaches = (at < len(here)) & (at % 2 == 0)  # as `teaching`
    at = np.minimum(at, len(here) - 1)
    rows, r = np.arange(len(first))[:, None], here.copy()
    while len(chosen) < most and len(first):
        gains = ((_costs(bench, r[at] / scale) - _costs(bench, (r[at] + effects[rows, at]) / scale)) * teaches).sum(1)
        gains[chosen] = -math.inf
        best = int(np.argmax(gains))
        if not gains[best] > _PAYS:
            break
        chosen.append(best)
        r = r + effects[best]
    return chosen


def _like(residual: Array, used: NDArray[np.int64]) -> bool:
    """Tell whether a copy was simulated, and has as many samples that count: a row put in can move where they begin."""
    return len(residual) == len(used) and bool(np.isfinite(residual).all())


def _most(bench: TrialBench, scale: float, here: Array, simulated: Array | None) -> Array:
    """Return by how much an event at each sample may lower the cost of those soon after it, and none behind the last.

    One that only delays what follows leaves the shaft as far off as it moves from a sample to the next, here or there,
    for long or for a while: the most of these.
    """
    n, soon = len(here), np.arange(_SOON)
    at = np.arange(n)[:, None] + soon
    inside = at < n
    counts = inside & (at % 2 == 0)  # as `teaching`
    r = np.where(inside, here[np.minimum(at, n - 1)], 0.0) / scale
    before = _costs(bench, r)
    if simulated is None:
        most = np.sum(before * counts, axis=1)
    else:
        steps = np.append(np.diff(simulated), 0.0) / scale
        here_by = np.append(0.0, steps[:-1])[:, None]  # as far as it moved until then
        there_by = np.where(inside, steps[np.minimum(at, n - 1)], 0.0)
        shapes = (np.ones(_SOON), 1.0 - soon / _SOON, np.exp(-soon / 2.0))
        most = np.max([np.sum((before - _costs(bench, r + shape * by)) * counts, axis=1)
                       for shape in shapes for by in (here_by, there_by)], axis=0) / _FORETOLD
    return np.append(most, 0.0)


def _costs(bench: TrialBench, r: Array) -> Array:
    """Return the cost of each residual."""
    x, limit = np.abs(r), bench.task.loss.limit
    return np.where(x > limit, limit * (x - 0.5 * min(limit, 1e6)), 0.5 * x**2)


def _worth(bench: TrialBench, scale: float, before: Array, after: Array, first: int) -> float:
    """Return by how much an event lowers the cost of the samples soon after it: later ones may be of others."""
    soon = slice(first, first + _SOON)
    teaches = teaching(np.arange(len(before), dtype=np.float64), alternate=True)[soon]
    costs = [bench.task.loss.cost(r[soon][teaches] / scale) for r in (before, after)]
    return costs[0] - costs[1]


# --- Stamps that count the turns of a loop: k/30 s says nothing of turns that were late -------------------------------

_EVEN = 1e-3  # of a turn: stamps of a clock are not as even
_PARTS = 4  # of a log
_FEWEST, _NEEDED = 20, 4  # samples of a part that moves, and such parts
_MOVES = 0.3  # of the largest speed
_COUNTED_MOST = 0.1  # of a turn, in any part: what a model lacks is more somewhere, in slow motions first
_WITHIN = 2.0  # standard deviations: how late a turn may be


def counts_turns(times: Sequence[Array]) -> bool:
    """Tell whether all stamps [s] count the turns of a loop, as those of datasets do (k/30 s): no clock is as even.

    Examples
    --------
    >>> counts_turns([np.arange(90) / 30.0]), counts_turns([np.array([0.0, 0.0333, 0.0669, 0.1])])
    (True, False)
    """
    return all(float(np.ptp(steps)) <= _EVEN * float(np.median(steps)) for steps in map(np.diff, times))


def counted_stamps(traces: Sequence[Trace], sensor: str, noise: float) -> Cause | None:
    """Return stamps that count turns as a cause, where late turns leave as much, in no motion more.

    Parameters
    ----------
    traces : sequence of Trace
        Of the fitted logs.
    sensor : str
        The angle's name.
    noise : float
        Of the sensor (SI).
    """
    steps = [float(np.median(np.diff(trace.log.time))) for trace in traces]
    if not counts_turns([trace.log.time for trace in traces]):
        return None
    speeds = [np.gradient(trace.simulated, trace.time) for trace in traces]
    late = [value for trace, speed in zip(traces, speeds, strict=True)
            for left, fast in zip(*(np.array_split(one, _PARTS) for one in (trace.residual, speed)), strict=True)
            if (value := _lateness(left, fast, noise)) is not None]
    if len(late) < _NEEDED or max(late) > _COUNTED_MOST * min(steps):
        return None
    sigma = float(np.sqrt(np.mean(np.square(late))))
    every = np.concatenate([trace.residual for trace in traces])
    beyond = np.maximum(np.abs(every) - _WITHIN * sigma * np.abs(np.concatenate(speeds)), 0.0)
    before, after = (float(np.sqrt(np.mean(one**2))) for one in (every, beyond))
    remedy = "have the logger stamp each row when it is measured"
    return Cause("stamps", (
        f"stamps that count turns, one every {1e3 * max(steps):.3g} ms, and say nothing of late ones: turns off by "
        f"{1e3 * sigma:.2g} ms leave as much, in fast and slow motions; beyond twice that the error is "
        f"{shown(after, sensor)} instead of {shown(before, sensor)} ({remedy})"), before, after, remedy)


def _lateness(residual: Array, speed: Array, noise: float) -> float | None:
    """Return by how much times would be off that leave these residuals [s]; None where too little moves."""
    moves = np.abs(speed) > max(_MOVES * float(np.abs(speed).max()), 1e-12)
    if moves.sum() < _FEWEST:
        return None
    off = robust_deviation(residual[moves] / speed[moves])
    return math.sqrt(max(off**2 - (noise / float(np.median(np.abs(speed[moves]))))**2, 0.0))
