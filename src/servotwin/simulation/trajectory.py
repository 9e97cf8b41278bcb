"""The continuous solution of a run: its motions, evaluated at any time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.models.columns import Samples
from servotwin.models.engine.dynamics.currents import on_stiff_source
from servotwin.models.engine.log import ALONE, DENSE, SERIES, Row
from servotwin.models.engine.motions import motion
from servotwin.models.engine.motions.motion import CREEP, Motion
from servotwin.models.engine.run import at as engine_at
from servotwin.models.engine.run.at import SHOWN
from servotwin.models.engine.run.run import Plant
from servotwin.models.state.records import record_of
from servotwin.simulation.engine import Part, Plan, kernels_of_one, named

if TYPE_CHECKING:
    from servotwin.simulation.remarks import Sag

Array = NDArray[np.float64]
_ROW = record_of(Row)
_NODES = 12  # Gauss-Legendre nodes per interval
_LATE = 1e-12  # of an instant
_AT_ONCE = 1000  # motions
_GRADES = 0.25 ** np.arange(1.0, 4.0)  # of an interval that ends at rest
_STEPS = (motion.STEP, motion.LONG_STEP, motion.CREEP, motion.PAIR, motion.WARMING)


class Segment(NamedTuple):
    """A stretch of one motion between two times [s], and what holds with it.

    `error` is the latest that the chip has decided on [s], `wiper` the angle of the potentiometer at the start [rad],
    `drive` how a bridge drives: −1, 0 or +1, `silent` whether pulses stay away from it, 1 or 0, `origin` the instant
    from which the times of the motion count [s]. Of a digital servo `duty` is
    that of its bridge, or `terms.duty.OPEN`, `BRAKED`; `goal` and `reference` are angles [rad], `trip` tells which.
    """

    start: float
    end: float
    motion: Motion
    error: float
    wiper: float
    drive: float
    silent: int = 0
    origin: float = 0.0
    duty: float = 0.0
    goal: float = 0.0
    reference: float = 0.0
    trip: int = 0

    @property
    def anchor(self) -> float:
        """When the motion began [s]; it may be before the segment's start."""
        return self.origin + self.motion.t0


class Motions(Sequence[Segment]):
    """The motions of a run in order, as rows; each is made an object when it is asked for.

    Parameters
    ----------
    parts : sequence of Part
        Rows by the plans that they are of.
    shared : ndarray, optional
        Numbers of common motions, of servos on one supply.
    since, until : float
        Only motions that are underway between these times [s].
    """

    def __init__(self, parts: Sequence[Part], shared: Array | None = None, since: float = -math.inf,
                 until: float = math.inf) -> None:
        self._parts, self._shared = tuple(parts), np.zeros(0) if shared is None else shared
        self._since, self._until = since, until
        self._of = np.repeat(np.arange(len(parts)), [len(part.rows) for part in parts])
        self._rows: Any = [row for part in parts for row in part.rows]
        if parts and not all(isinstance(part.rows, list) for part in parts):
            self._rows = np.concatenate([np.asarray(part.rows, _ROW) for part in parts])
        times = self._times
        there = slice(int(np.count_nonzero(times[1] <= since)), int(np.count_nonzero(times[0] < until)))
        self._rows, self._of = self._rows[there], self._of[there]
        self.starts, self.ends, self.anchors = times[:, there]
        self.starts = np.maximum(self.starts, since)

    @property
    def _times(self) -> Array:
        """Start, end and beginning of all motions, shape (3, n) [s]."""
        if isinstance(self._rows, list):
            times = np.array([(row.origin, row.start, row.end, row.t0) for row in self._rows]).reshape(-1, 4).T
        else:
            times = np.array([self._rows[name] for name in ("origin", "start", "end", "t0")])
        found: Array = times[0] + times[1:]
        return found

    @cached_property
    def rows(self) -> NDArray[Any]:
        """Records of `Row`."""
        return np.asarray(self._rows, _ROW)

    def __len__(self) -> int:
        """Return how many motions there are."""
        return len(self._rows)

    def __getitem__(self, index: Any) -> Any:
        """Return a motion, or some of them."""
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._made(index % len(self))

    def __iter__(self) -> Iterator[Segment]:
        return map(self._made, range(len(self)))

    def between(self, since: float = -math.inf, until: float = math.inf) -> Motions:
        """Return those that are underway between two times [s]."""
        return Motions(self._parts, self._shared, max(since, self._since), min(until, self._until))

    @property
    def integrated(self) -> NDArray[np.bool_]:
        """Which are steps of an integrator, or end as these do."""
        how = self.rows["how"]
        found: NDArray[np.bool_] = (how == DENSE) | ((how == ALONE) & np.isin(self.rows["kind"], _STEPS))
        return found

    @property
    def has_program(self) -> bool:
        """Whether a program drives."""
        return bool(self._parts) and self._parts[0].plan.digital

    @cached_property
    def resolution(self) -> Array:
        """The result of `engine.run.at.resolution` for each, shape (3, n) [s]."""
        found = np.empty((3, len(self)))
        for plan, places in self._by_plan():
            own = np.empty((3, len(places)))
            self._kernels.resolution(*self._given(plan, places), self._shared, own)
            found[:, places] = own
        return found

    def shown(self, index: NDArray[np.intp], ages: Array, *, ends: bool = False) -> Array:
        """Return what holds at times after the beginnings of motions [s], shape (20, n): what `engine.run.at.at` shows.

        `ends` says that motions end there: what is only interpolated is followed anew.
        """
        shown = np.empty((SHOWN, len(index)))
        several = len(self._parts) > 1
        for plan, places in self._by_plan():
            which = np.flatnonzero(np.isin(index, places)) if several else slice(None)
            own = np.empty((SHOWN, len(index[which])))
            asked = np.searchsorted(places, index[which]) if several else index
            plants, accuracy, rows = self._given(plan, places)
            self._kernels.at(plants, accuracy, rows, self._shared, np.ascontiguousarray(asked, np.int64),
                             np.ascontiguousarray(ages[which]), ends, own)
            shown[:, which] = own
        return shown

    def _by_plan(self) -> Iterator[tuple[Plan, NDArray[np.intp]]]:
        for k, part in enumerate(self._parts):
            places = np.flatnonzero(self._of == k)
            if places.size:
                yield part.plan, places

    @property
    def _kernels(self) -> Any:
        return kernels_of_one() or engine_at

    def _given(self, plan: Plan, places: NDArray[np.intp]) -> tuple[Any, float, Any]:
        """Return a servo and its rows as kernels take them."""
        whole = len(places) == len(self)
        if kernels_of_one() is not None:
            return plan.plant, plan.accuracy, self.rows if whole else self.rows[places]
        rows = self._rows if isinstance(self._rows, list) else _Rows(self._rows)
        return [Plant(plan.numbers, plan.chip)], plan.accuracy, rows if whole else [rows[k] for k in places.tolist()]

    def _made(self, k: int) -> Segment:
        row = self._rows[k] if isinstance(self._rows, list) else named(Row, self._rows[k].item())
        plan = self._parts[self._of[k]].plan
        m = engine_at.motion_of(plan.numbers, row, self._shared, plan.accuracy)
        if row.how != ALONE:
            m = m._replace(numbers=on_stiff_source(m.numbers, row.returns > 0))
        if row.how == SERIES:
            both = self._shared[row.first:row.first + 2 * row.kind].tolist()
            m = motion.by_series(m.numbers, row.mode, row.u, row.tau, row.t0, row.y, row.length,
                                 tuple(both[:row.kind]), tuple(both[row.kind:]))
        return Segment(float(self.starts[k]), float(self.ends[k]), m, row.error, row.wiper, row.drive, row.silent,
                       row.origin, row.duty, row.goal, row.reference, row.trip)


class _Rows:
    """Rows of numpy's records as plain Python reads them: named tuples, the latest kept."""

    def __init__(self, rows: NDArray[Any]) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, k: int) -> Row:
        row: Row = named(Row, self._rows[k].item())
        return row


class Bus(Protocol):
    """The voltage of a shared bus [V] at any times [s], shape (n,), and how far it fell."""

    def __call__(self, time: Array) -> Array:
        """Return the voltage."""

    @property
    def sag(self) -> Sag | None:
        """As of `Result.sag`."""


@dataclass(frozen=True)
class Trajectory:
    """Motions without gaps, in order; after the last one the state is not known (nan)."""

    segments: Motions
    bus: Bus | None = None

    def at(self, time: Array) -> Samples:
        """Return the state at `time` [s], any order; at an event, just after it."""
        t = np.asarray(time, dtype=np.float64)
        if not len(self.segments):
            nothing = np.full(t.size, math.nan)
            return Samples.make(t, np.tile(nothing, (7, 1)), nothing, np.zeros((5, t.size)), *np.zeros((3, t.size)))
        now, end = self._since_ticks(t), self.segments.ends[-1]
        now = np.where((now > end) & (now <= end * (1.0 + _LATE)), end, now)  # sums of ticks may end a rounding early
        index = np.maximum(np.searchsorted(self.segments.starts, now, side="right") - 1, 0)
        return replace(self._states(now, index), time=t)

    def _since_ticks(self, t: Array) -> Array:
        """Return times [s] of which those next to a tick are not before it: sums of ticks may end a rounding late."""
        if not self.segments.has_program:
            return t
        starts = self.segments.starts
        begun = starts[np.minimum(np.searchsorted(starts, t * (1.0 + _LATE)), len(starts)) - 1]
        return np.where(abs(begun - t) <= _LATE * t, np.maximum(begun, t), t)

    def since(self, start: float) -> Trajectory:
        """Return what is left of it from a time [s] on."""
        return replace(self, segments=self.segments.between(since=start))

    def inside(self, index: int, time: Array) -> Samples:
        """Return the state at `time` [s] by the motion of one segment, its end included."""
        own = self.segments  # by rounding, a time may lie just outside
        return self._states(np.clip(time, own.starts[index], own.ends[index]), np.full(time.size, index))

    def inside_each(self, times: Sequence[Array]) -> Samples:
        """Return the states at times [s] of all segments, one array for each, one after the other."""
        index = np.repeat(np.arange(len(times)), [t.size for t in times])
        own = self.segments
        return self._states(np.clip(np.concatenate(times), own.starts[index], own.ends[index]), index)

    def _states(self, t: Array, index: NDArray[np.intp], ages: Array | None = None) -> Samples:
        """Return the states at times by the motions of segments; `ages` are t − anchor without what t rounds away."""
        own = self.segments
        there = (t <= own.ends[index]) & (t >= own.starts[index])
        since = t - own.anchors[index] if ages is None else ages
        shown = np.zeros((SHOWN, t.size))
        shown[:8] = math.nan
        if there.all():
            shown = own.shown(index, since)
        elif there.any():
            shown[:, there] = own.shown(index[there], since[there])
        return Samples.make(t, shown[:7], shown[7], shown[8:13], shown[13], shown[14], shown[15],
                            None if self.bus is None else self.bus(t), shown[16:])

    def intervals(self, index: int) -> Array:
        """Return the ends of short intervals of one segment, in each of which all signals are smooth and gentle.

        They count from the segment's anchor [s]: a motion may settle in less than its time of day can tell.
        """
        own = self.segments
        age, end = (float(times[index] - own.anchors[index]) for times in (own.starts, own.ends))
        fine, settled, width = own.resolution[:, index].tolist()
        edges = [age]
        while age < end:
            age = min(end, age + min(width, fine if age < settled else max(age, fine)))
            edges.append(age)
        return self._graded(index, np.array(edges))

    def _graded(self, index: int, edges: Array) -> Array:
        """Return intervals that are short beside a rest from or to which a shaft creeps: there it is not smooth."""
        own, row = self.segments, self.segments.rows[index]
        if row["how"] != ALONE or row["kind"] != CREEP or edges.size < 2:
            return edges
        more = [edges]
        if row["y"]["w"] == 0.0 and own.starts[index] == own.anchors[index]:
            more.append(edges[0] + (edges[1] - edges[0]) * _GRADES)
        if row["last"]["w"] == 0.0 and edges[-1] >= row["length"] * (1.0 - _LATE):
            more.append(edges[-1] + (edges[-2] - edges[-1]) * _GRADES)
        return np.unique(np.concatenate(more))

    def integral(self, integrand: Callable[[Samples], Array]) -> Array:
        """Return the integral over the whole run of a vector of signals; `integrand` returns shape (m, n)."""
        x, weight = np.polynomial.legendre.leggauss(_NODES)
        total: Array | float = 0.0
        own = self.segments
        times, ages, weights, index = [], [], [], []
        for k in range(len(own)):
            edges = self.intervals(k)
            half = 0.5 * np.diff(edges)[:, None]
            nodes = (edges[:-1, None] + half + half * x).ravel()
            ages.append(nodes)
            times.append(np.clip(own.anchors[k] + nodes, own.starts[k], own.ends[k]))
            weights.append((half * weight).ravel())
            index.append(np.full(nodes.size, k))
            if len(times) == _AT_ONCE or k == len(own) - 1:
                values = integrand(self._states(np.concatenate(times), np.concatenate(index), np.concatenate(ages)))
                total = total + (values * np.concatenate(weights)).sum(axis=1)
                times, ages, weights, index = [], [], [], []
        return np.asarray(total)

    def dense_times(self, index: int, per_interval: int = 8) -> Array:
        """Return times that resolve one segment as far as times can, both its ends included."""
        own, edges = self.segments, self.intervals(index)
        fractions = np.linspace(0.0, 1.0, per_interval, endpoint=False)
        inner = own.anchors[index] + (edges[:-1, None] + np.diff(edges)[:, None] * fractions).ravel()
        return np.unique(np.clip(np.append(inner, own.ends[index]), own.starts[index], own.ends[index]))
