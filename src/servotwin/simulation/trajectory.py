"""The continuous solution of a run: its segments, evaluated at any time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.motions import motion
from servotwin.models.samples import Samples
from servotwin.physics import play
from servotwin.simulation.engine import Segment

if TYPE_CHECKING:
    from servotwin.simulation.sag import Sag

Array = NDArray[np.float64]
_NODES = 12  # Gauss-Legendre nodes per interval
_LATE = 1e-12  # of an instant
_AT_ONCE = 1000  # segments
_GRADES = 0.25 ** np.arange(1.0, 4.0)  # of an interval that ends at rest
_SETTLING, _FADING = 4.0, 3.0  # times in which a creep settles, or friction fades, that an interval may last
_NOTHING, _TIMES = 1e-15, 3.0  # A, what is left of a current; of 1/rate: an interval in which it fades
_SHORTEST = 1e-307  # s: what is over in less has no time of its own


class Bus(Protocol):
    """The voltage of a shared bus [V] at any times [s], shape (n,), and how far it fell."""

    def __call__(self, time: Array) -> Array:
        """Return the voltage."""

    @property
    def sag(self) -> Sag | None:
        """As of `Result.sag`."""


@dataclass(frozen=True)
class Trajectory:
    """Segments without gaps, in order; after the last one the state is not known (nan)."""

    segments: Sequence[Segment]
    bus: Bus | None = None

    @cached_property
    def _starts(self) -> Array:
        return np.array([segment.start for segment in self.segments])

    def at(self, time: Array) -> Samples:
        """Return the state at `time` [s], any order; at an event, just after it."""
        t = np.asarray(time, dtype=np.float64)
        if not self.segments:
            nothing = np.full(t.size, math.nan)
            return Samples.make(t, np.tile(nothing, (7, 1)), nothing, np.zeros((5, t.size)), *np.zeros((3, t.size)))
        now, end = self._since_ticks(t), self.segments[-1].end
        now = np.where((now > end) & (now <= end * (1.0 + _LATE)), end, now)  # sums of ticks may end a rounding early
        index = np.maximum(np.searchsorted(self._starts, now, side="right") - 1, 0)
        return replace(self._states(now, index), time=t)

    def _since_ticks(self, t: Array) -> Array:
        """Return times [s] of which those next to a tick are not before it: sums of ticks may end a rounding late."""
        if not self.segments[0].motion.numbers.bridge.pwm > 0.0:
            return t
        begun = self._starts[np.minimum(np.searchsorted(self._starts, t * (1.0 + _LATE)), len(self._starts)) - 1]
        return np.where(abs(begun - t) <= _LATE * t, np.maximum(begun, t), t)

    def since(self, start: float) -> Trajectory:
        """Return what is left of it from a time [s] on."""
        return replace(self, segments=tuple(segment._replace(start=max(segment.start, start))
                                            for segment in self.segments if segment.end > start))

    def inside(self, index: int, time: Array) -> Samples:
        """Return the state at `time` [s] by the motion of one segment, its end included."""
        segment = self.segments[index]  # by rounding, a time may lie just outside
        return self._states(np.clip(time, segment.start, segment.end), np.full(time.size, index))

    def inside_each(self, times: Sequence[Array]) -> Samples:
        """Return the states at times [s] of all segments, one array for each, one after the other."""
        clipped = [np.clip(t, segment.start, segment.end) for t, segment in zip(times, self.segments, strict=True)]
        return self._states(np.concatenate(clipped), np.repeat(np.arange(len(times)), [t.size for t in times]))

    def _states(self, t: Array, index: NDArray[np.intp], ages: Array | None = None) -> Samples:
        """Return the states at times by the motions of segments; `ages` are t − anchor without what t rounds away."""
        y = np.full((7, t.size), math.nan)
        mode, wiper, drive, error, silent = np.zeros((5, t.size)), *np.zeros((4, t.size))
        told = np.zeros((4, t.size))
        order = np.argsort(index, kind="stable")
        used, first = np.unique(index[order], return_index=True)
        groups = np.split(order, first[1:]) if t.size else []
        for k, those in zip(used.tolist(), groups, strict=True):
            segment = self.segments[k]
            where = those[(t[those] <= segment.end) & (t[those] >= segment.start)]
            if where.size == 0:
                continue
            s = t[where] - segment.anchor if ages is None else ages[where]
            y[:, where] = _states(segment.motion, s)
            mode[:, where] = np.array(segment.motion.mode)[:, None]
            drive[where], error[where], silent[where] = segment.drive, segment.error, segment.silent
            told[:, where] = np.array([segment.duty, segment.goal, segment.reference, segment.trip])[:, None]
            wiper[where] = play(segment.wiper, y[0, where], 2.0 * segment.motion.numbers.sensor.half_slack)
        return Samples.make(t, y, wiper, mode, drive, error, silent, None if self.bus is None else self.bus(t),
                            told)

    def intervals(self, index: int) -> Array:
        """Return the ends of short intervals of one segment, in each of which all signals are smooth and gentle.

        They count from the segment's anchor [s]: a motion may settle in less than its time of day can tell.
        """
        segment = self.segments[index]
        age, end = segment.start - segment.anchor, segment.end - segment.anchor
        width = motion.period(segment.motion.u, segment.motion.tau, segment.start - segment.origin,
                              segment.end - segment.origin) / 4.0
        fine, settled = _scales(segment.motion)
        fine = max(fine, _SHORTEST)
        edges = [age]
        while age < end:
            age = min(end, age + min(width, fine if age < settled else max(age, fine)))
            edges.append(age)
        return _graded(segment, np.array(edges))

    def integral(self, integrand: Callable[[Samples], Array]) -> Array:
        """Return the integral over the whole run of a vector of signals; `integrand` returns shape (m, n)."""
        x, weight = np.polynomial.legendre.leggauss(_NODES)
        total: Array | float = 0.0
        times, ages, weights, index = [], [], [], []
        for k, segment in enumerate(self.segments):
            edges = self.intervals(k)
            half = 0.5 * np.diff(edges)[:, None]
            nodes = (edges[:-1, None] + half + half * x).ravel()
            ages.append(nodes)
            times.append(np.clip(segment.anchor + nodes, segment.start, segment.end))
            weights.append((half * weight).ravel())
            index.append(np.full(nodes.size, k))
            if len(times) == _AT_ONCE or k == len(self.segments) - 1:
                values = integrand(self._states(np.concatenate(times), np.concatenate(index), np.concatenate(ages)))
                total = total + (values * np.concatenate(weights)).sum(axis=1)
                times, ages, weights, index = [], [], [], []
        return np.asarray(total)

    def dense_times(self, index: int, per_interval: int = 8) -> Array:
        """Return times that resolve one segment as far as times can, both its ends included."""
        segment, edges = self.segments[index], self.intervals(index)
        fractions = np.linspace(0.0, 1.0, per_interval, endpoint=False)
        inner = segment.anchor + (edges[:-1, None] + np.diff(edges)[:, None] * fractions).ravel()
        return np.unique(np.clip(np.append(inner, segment.end), segment.start, segment.end))


def _scales(m: motion.Motion) -> tuple[float, float]:
    """Return `motion.scales`; of a creep, which may be long, the time in which its speed would change at most.

    Of a step of a servo that warms up, those of the current that fades, as long as anything is left of it.
    """
    fine, settled = motion.scales(m)
    if m.kind == motion.WARMING:
        *_, of, by = motion.prepared(m).long_dense
        fast, left = of.w, abs(by.q_m) / _NOTHING
        return (_TIMES / fast, math.log(left) / fast) if fast > 0.0 and left > 1.0 else (fine, settled)
    if m.kind != motion.CREEP:
        return fine, settled
    most = max(abs(motion.rates(m, 0.0, m.start).w), abs(motion.rates(m, m.length, m.end).w))
    change = abs(m.end.w - m.start.w)
    change = min(_SETTLING * change, _FADING * m.numbers.friction.w_s)
    fine = min(fine, change / most) if change > 0.0 else fine
    return fine, 10.0 * fine


def _graded(segment: Segment, edges: Array) -> Array:
    """Return intervals that are short beside a rest from which or to which a shaft creeps: there it is not smooth."""
    m = segment.motion
    if m.kind != motion.CREEP or edges.size < 2:
        return edges
    more = [edges]
    if m.start.w == 0.0 and segment.start == segment.anchor:
        more.append(edges[0] + (edges[1] - edges[0]) * _GRADES)
    if m.end.w == 0.0 and edges[-1] >= m.length * (1.0 - _LATE):
        more.append(edges[-1] + (edges[-2] - edges[-1]) * _GRADES)
    return np.unique(np.concatenate(more))


def _states(m: motion.Motion, s: Array) -> Array:
    """Return the states of a motion at times s after its anchor, shape (7, n)."""
    m = motion.prepared(m)
    return np.array([motion.state(m, x) for x in s.tolist()]).T
