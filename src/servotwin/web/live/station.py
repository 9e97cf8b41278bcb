"""A servo at the bench: its model, where it stands, what it is told, what shows of it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.models.engine.live import stretch
from servotwin.models.engine.live.posts import NONE_BEFORE
from servotwin.models.engine.live.screen import COLUMNS, SHOWN, USED, Looks, Screen, first_look
from servotwin.models.engine.memory import time_of
from servotwin.models.engine.step import COMPLETED, DIVERGED
from servotwin.models.terms import control
from servotwin.simulation import Simulator
from servotwin.simulation.engine import Event, Plan, Segment, State, failure
from servotwin.simulation.sight import Sight, places_of
from servotwin.simulation.sight import switches as switch_times
from servotwin.simulation.status import Status
from servotwin.web.live.lines import lines_of
from servotwin.web.live.told import Taken, Told

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model
    from servotwin.models.state.modes import Vector

Row = tuple[float, ...]
_DULL = ("drive ", "current ", "zone", "pulse edge")  # how the names of events begin that come many times a second


class Endless:
    """Rows without an end, as kernels fill them in plain Python; `tell` is told the time [s] now and then."""

    def __init__(self, tell: Callable[[float], object] | None = None) -> None:
        self.rows: list[list[float]] = []
        self.tell = tell or float

    def __len__(self) -> int:
        """Return more than there ever are."""
        return sys.maxsize

    def __getitem__(self, place: tuple[int, int]) -> float:
        """Return a number."""
        return self.rows[place[0]][place[1]]

    def __setitem__(self, place: tuple[int, int], value: float) -> None:
        """Put a number where it belongs, or behind those of its row."""
        n, k = place
        if n == len(self.rows):
            self.rows.append([])
        row = self.rows[n]
        if k == len(row):
            row.append(value)
        else:
            row[k] = value


class Seen(NamedTuple):
    """What shows of a stretch of time: rows of (time, signals), and (time, kind) of events."""

    rows: list[Row]
    events: list[tuple[float, str]]


class Station:
    """A servo that goes on by itself.

    Parameters
    ----------
    model : Model
    load : Load
    command : mapping
        The first.
    seed : int
        Of its noise.
    control : mapping, optional
        Of the control circuit that makes its pulses, if there is one.

    Raises
    ------
    CommandError
        If the model does not take the command.
    """

    def __init__(self, model: Model, load: Load, command: Mapping[str, Any], seed: int,
                 control: Mapping[str, float] | None = None) -> None:
        self._simulator = Simulator(model, load, seed)
        self.told = Told(model, command, control)
        self.state = self._simulator.initial(self.told.signal)
        """Everything that it remembers."""
        self._look_with(model, load)
        self._last: Segment | None = None
        self._was = NONE_BEFORE
        self.push = 0.0  # N m, by hand
        self.tell: Callable[[float], object] | None = None
        """Is told the time [s] now and then within a motion."""

    @property
    def model(self) -> Model:
        """The model with its numbers of now."""
        return self._simulator.of(self.state).model

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the signals in rows, `time` first."""
        return ("time", *self._sight.names)

    def changed(self, parameters: Mapping[str, Any] | None, torque_enable: bool | None = None) -> Change:
        """Return what it is with other numbers, or its torque on or off, ready to be `put`.

        Raises
        ------
        InputError
            Or one of its kinds, if that is not possible.
        """
        state = self._simulator.changed(self.state, parameters=parameters, torque_enable=torque_enable)
        model = self._simulator.of(state).model
        return Change(state, self.told.fits(model), model)

    def put(self, change: Change) -> None:
        """Go on with other numbers."""
        self.state = change.state
        self.told.put(change.command)
        self._look_with(change.model, self._simulator.of(change.state).load)

    def _look_with(self, model: Model, load: Load) -> None:
        self._sight, self._lines = Sight(model, load), lines_of(model)
        self._picks = [COLUMNS.index(name) for name in self.columns]

    def advance(self, until: float, rate: float, *, switches: bool = True) -> Seen:
        """Go on to a time [s]; return what shows at a rate [Hz], and, if asked for, where the bridge switches.

        Raises
        ------
        SimulationError
            If it cannot go on.
        """
        plan, now = self.plan, self.state
        screen = Screen(Endless(self.tell), Endless(), np.zeros(USED, np.int64))
        memory = now.memory
        if plan.digital:
            memory = memory._replace(firm=(control.thawed(memory.firm[0]),))
        looks = Looks(first_look(now.time, rate), rate, until, 1, int(switches))
        try:
            memory, self._was, status = stretch.go_on(
                plan.numbers, plan.chip, plan.inputs, memory, plan.numbers != now.numbers, self._was, looks,
                self._lines, screen)
        except (ArithmeticError, ValueError) as error:  # numbers beyond what a float holds
            if isinstance(error, InputError):
                raise
            status = DIVERGED
        if status != COMPLETED:
            raise failure(Status.of_code(status), time_of(memory))
        if plan.digital:
            memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
        self.state = State(until, now.places, memory, plan.numbers, now.changes)
        picks = self._picks
        return Seen([tuple(row[k] for k in picks) for row in screen.rows.rows],
                    [(time, SHOWN[int(code)]) for time, code in screen.events.rows if int(code) in SHOWN])

    @property
    def plan(self) -> Plan:
        """What the engine needs for what it is told now."""
        return self._simulator.of(self.state).plan(self.told.signal, self.push)

    def switched(self, segments: Sequence[Segment]) -> list[float]:
        """Return when its bridge switches in segments that follow those that were seen [s]."""
        return switch_times(segments if self._last is None else [self._last, *segments])

    def states(self, segments: Sequence[Segment], times: Sequence[float]) -> list[tuple[Segment, Vector]]:
        """Return in which segment it is, and where it stands, at some times [s], as `seen` takes them."""
        return [(segments[k], self._sight.state(segments[k], t))
                for t, k in zip(times, places_of(segments, times), strict=True)]

    def seen(self, plan: Plan, segments: Sequence[Segment], events: Sequence[Event], times: Sequence[float],
             bus_voltages: Sequence[float] | None = None) -> Seen:
        """Return what shows of segments at times [s], under the voltages of a shared supply, if it has one [V]."""
        if not segments:
            return Seen([], [])
        self._last = segments[-1]
        return Seen(self._sight.points(plan, segments, times, bus_voltages), lively(events))

    def now(self) -> Row:
        """Return the row of the present instant."""
        names, value = self._sight.names, self._simulator.observe
        return (self.state.time, *(value(self.state, name, self.told.signal, external_torque=self.push)
                                    for name in names))


class Change(NamedTuple):
    """A servo with other numbers: its state, its command as it follows it then, and its model."""

    state: State
    command: Taken
    model: Model


def with_switches(times: Sequence[float], switched: Sequence[float]) -> list[float]:
    """Return times in order, those of switches twice: just before and just after.

    Examples
    --------
    >>> with_switches([0.1, 0.2], [0.15, 0.2])
    [0.1, 0.15, 0.15, 0.2, 0.2]
    """
    twice = set(switched)
    return sorted([*(time for time in times if time not in twice), *switched, *switched])


def lively(events: Sequence[tuple[float, str, float]]) -> list[tuple[float, str]]:
    """Return time [s] and kind of the events that do not come with every pulse."""
    return [(time, kind) for time, kind, _ in events if not kind.startswith(_DULL)]
