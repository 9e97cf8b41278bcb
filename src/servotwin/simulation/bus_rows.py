"""The rows that a run of servos on a bus leaves behind, as segments of motion and events."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.bus import event_log
from servotwin.models.engine.bus.shared_source import on_stiff_source
from servotwin.models.engine.dynamics.rates import jacobian
from servotwin.models.engine.events import guards
from servotwin.models.engine.motions import choice, motion, rodas
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.engine.step import at_pulses
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms import duty
from servotwin.physics.pieces import Piece, piece_rate, piece_value
from servotwin.simulation.engine import TRIPS, Event, Plan, Segment, event_name
from servotwin.simulation.rest import Driven

if TYPE_CHECKING:
    from servotwin.simulation.bus_run import Rows

Array = NDArray[np.float64]
_STEPS = 7  # vectors of a dense output, of seven numbers each
_WORDS = {event_log.DRIVES + 1: "drive forward", event_log.DRIVES - 1: "drive backward", event_log.DRIVES: "drive ends",
          event_log.SILENCE + 1: "silence begins", event_log.SILENCE: "silence ends",
          event_log.REFUSED: "pulse refused",
          **{event_log.TRIPS + k: word for k, word in enumerate(TRIPS)}}


class Segments(Sequence[Segment]):
    """The segments of a run, made of rows when they are first looked at.

    Parameters
    ----------
    rows : ndarray, shape (n, ROW)
        As `tape` writes them.
    make : callable
        Makes a segment of a row.
    """

    def __init__(self, rows: Array, make: Callable[[list[float]], Segment]) -> None:
        self._rows, self._make = rows, make

    @cached_property
    def _made(self) -> tuple[Segment, ...]:
        return tuple(map(self._make, self._rows.tolist()))

    @overload
    def __getitem__(self, index: int) -> Segment: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Segment]: ...
    def __getitem__(self, index: int | slice) -> Segment | Sequence[Segment]:
        """Return a segment, or some of them."""
        return self._made[index]

    def __iter__(self) -> Iterator[Segment]:
        return iter(self._made)

    def __len__(self) -> int:
        """Return how many segments there are."""
        return len(self._rows)


def segments_of(plans: Sequence[Plan], rows: Rows) -> list[Segments]:
    """Return the segments of each servo."""
    return [Segments(rows.motions[rows.motions[:, 0] == j], _Maker(plan, rows.numbers)) for j, plan in enumerate(plans)]


def events_of(plans: Sequence[Plan], rows: Rows) -> list[tuple[Event, ...]]:
    """Return the events of each servo."""
    found: list[list[Event]] = [[] for _ in plans]
    for unit, time, kind, zone, contact, angle in rows.events.tolist():
        if kind in guards.KINKS:
            continue
        name = _WORDS.get(kind) or event_name(int(kind), Mode(int(zone), int(contact), 0, 0, 0))
        found[int(unit)].append(Event(time, name, angle))
    return [tuple(events) for events in found]


def driven_in(rows: Rows, *, digital: bool) -> Driven:
    """Return how the bridge of a servo alone on its source was driven."""
    origin, start, end = rows.motions[:, 2:5].T
    return Driven(origin + start, origin + end, rows.motions[:, -4 if digital else 7])


class _Maker:
    """Makes segments of the rows of a servo."""

    def __init__(self, plan: Plan, numbers: Array) -> None:
        self._plan, self._given = plan, numbers

    def __call__(self, row: list[float]) -> Segment:
        (_, how, origin, start, end, error, wiper, drive, silent, zone, contact, mesh, motor, share, u, *rest) = row
        (now, goal, reference, trip) = rest[28:]
        tau, (kind, length, next_step, first, returns, anchor, step) = Piece(*rest[:7]), rest[7:14]
        mode = Mode(int(zone), int(contact), int(mesh), int(motor), int(share))
        plain = self._plan.numbers
        numbers = duty.at_duty(plain, now) if self._plan.digital else at_pulses(plain, int(silent))
        base = motion.nothing(numbers, Piece(value=u), tau)._replace(
            kind=int(kind), mode=mode, t0=anchor, length=length, next_step=next_step, end=Vector(*rest[14:21]),
            start=Vector(*rest[21:28]))
        if how == event_log.ALONE:
            m = _alone(base, step, self._plan.accuracy)
        else:
            m = self._together(base._replace(numbers=on_stiff_source(numbers, returns > 0.0)), int(how), int(first))
        return Segment(origin + start, origin + end, m, error, wiper, drive, int(silent), origin, now, goal, reference,
                       int(trip))

    def _together(self, m: Motion, how: int, first: int) -> Motion:
        numbers, mode, u, tau = m.numbers, m.mode, m.u, m.tau
        if how == event_log.SERIES:
            both = self._given[first:first + 2 * m.kind].tolist()
            return motion.by_series(numbers, mode, u, tau, m.t0, m.start, m.length, tuple(both[:m.kind]),
                                    tuple(both[m.kind:]))
        rows = self._given[first:first + _STEPS * _STEPS].reshape(_STEPS, _STEPS).tolist()
        dense = tuple(Vector(*row) for row in rows)
        return motion.by_step(numbers, mode, u, tau, m.t0, m.start, m.length, dense, m.end)


def _alone(m: Motion, step: float, accuracy: float) -> Motion:
    """Return the motion of a servo on its own; of a step, length and end are known."""
    if not motion.is_step(m):
        return choice.begin(m.numbers, m.mode, m.u, m.tau, m.t0, m.start, step, math.inf, accuracy)
    if m.kind != motion.STEP:
        return m
    jac = jacobian(m.numbers, m.mode, piece_value(m.u, m.t0), piece_rate(m.u, m.t0), piece_rate(m.tau, m.t0),
                   m.start.q, m.start.w)
    _, _, stages = rodas.step(m.numbers, m.mode, m.u, m.tau, jac, m.t0, m.start, m.length)
    return m._replace(stages=stages)


