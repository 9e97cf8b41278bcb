"""Single events in logs, pulses that never came and rows that were not written, kept where they pay.

Every place after which enough is left is simulated once at the present numbers. A servo in its loop soon forgets an
event, so the effects of several add up: the events of a log are chosen by matching pursuit (Mallat & Zhang 1993), any
number of them, simulated together, and left out again where the log is as well off without one. Then the numbers are
searched again. Every second sample chooses, those between judge on the quarters that do not teach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.diagnosis.bench import Spent, TrialBench
from servotwin.identification.fitting.diagnosis.gain import Gain, Told, gain, teaching
from servotwin.identification.fitting.frames import has_pulses
from servotwin.identification.fitting.point import Point
from servotwin.logs.log import Log
from servotwin.models import DigitalServo

Array = NDArray[np.float64]

_MOST = 0.5  # of the places of a log: more events tell nothing apart
_SOON = 10  # samples after an event, by which it is judged
_ROUNDS, _TIMES = 3, 2  # of choosing and searching, and of choosing in each
_FORETOLD = 0.25  # of what an event has to gain: what it is tried for, where its effect is foretold
_PAYS = 8.0  # in units of noise: what one of some hundred places has to gain (their logarithm, twice)
_LEFT = 0.25  # of what is left in a log, where that is more than noise: a model that lacks something takes any event
MOST_LEFT = 0.5  # of the error
_FIRST_LEFT = math.sqrt(MOST_LEFT)  # of the error, before any number has moved: half of the way
_NORMAL = 1.4826  # standard deviation over median magnitude of a normal law


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
        for number in range(_ROUNDS):
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
    scale = max(bench.noise, _LEFT * _NORMAL * float(np.median(np.abs(here))))
    known = {abs(one) for one in already}
    places = [place for place in kind.places(log) if abs(place) not in known]
    most = _most(bench, scale, here, here + log.measured[log.angle_name][used] if kind.delays else None)
    first = np.searchsorted(used, np.abs(np.array(places, np.int64)))
    likely = np.flatnonzero(most[first] > _PAYS)
    alone = _with(bench, point, k, kind, [[*already, places[i]] for i in likely])
    good = [n for n, part in enumerate(alone) if _like(part, used)]
    further = _pursued(bench, scale, here, np.array([alone[n] - here for n in good]).reshape(-1, len(here)),
                       first[likely[good]], round(_MOST * len(places)))
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
