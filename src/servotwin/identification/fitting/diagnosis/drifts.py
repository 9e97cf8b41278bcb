"""What changes in the course of logs: a supply that falls, drops or differs from log to log, a winding that warms.

A number has another value in each stretch of a log. A log is simulated once for each of them, with that value
throughout, and each simulation counts in its own stretch: a servo in its loop soon forgets what was before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.diagnosis.bench import TrialBench, Watched
from servotwin.identification.fitting.diagnosis.gain import Told, gain
from servotwin.identification.fitting.free import Space, nominal
from servotwin.identification.fitting.point import Point, joined

Array = NDArray[np.float64]

VOLTAGE, RESISTANCE = "supply.open_circuit_voltage", "motor.armature_resistance"
_STRETCHES = 16  # of a log
_STEP = 0.02  # of the number: its effect is told from
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
        space = old.space
        bounds = {p.name: (p.lower, p.upper) for p in space.parameters if p.bounded and p.name in names}
        load = {p.name: p.start for p in space.parameters if p.name.startswith("load.")}
        self.space = Space(bench.setting.model, names or list(space.names), bounds=bounds, priors=None, load=load)
        self.alone = not names

    def best(self, kinds: Sequence[Sequence[_Shape]]) -> tuple[float, tuple[Array, ...]] | None:
        """Return by which share the number changes, and the residuals with it; None if it is not told.

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
        A, loss = np.column_stack([self.J, column]), self.bench.task.loss
        step = np.zeros(A.shape[1])
        for _ in range(4):
            w = loss.weight(r + A @ step)
            H = (A * w[:, None]).T @ A + np.eye(len(step)) / _REACH**2
            step = -np.linalg.solve(H, (A * w[:, None]).T @ r)
        return loss.cost(r + A @ step), step

    def _on_residuals(self, k: int, x: NDArray[Any]) -> NDArray[Any]:
        """Return what is told at the instants of a log at its residuals: sensor by sensor."""
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
        task = self.bench._task(self.bench.base.forecast)
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

