"""A servo at the bench: its model, where it stands, what it is told, what shows of it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.models.engine import log
from servotwin.models.engine.live import stretch
from servotwin.models.engine.live.posts import NONE_BEFORE, NOTHING_SAID, Post, put_low, put_said
from servotwin.models.engine.live.screen import COLUMNS, NO_LOW, SHOWN, USED, Looks, Screen, Switch, first_look, told_of
from servotwin.models.state.records import object_of, record_of
from servotwin.simulation import Simulator
from servotwin.simulation.engine import Part, Plan, RunLog, State, kernels_of_one, run
from servotwin.web.live.lines import lines_of, names_of
from servotwin.web.live.told import Taken, Told

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model

Row = tuple[float, ...]
_SHOWN = frozenset(SHOWN.values())


def post_of(model: Model) -> Any:
    """Return what kernels keep of a servo between stretches, in plain Python."""
    post = object_of(Post)
    post.lines, post.was = lines_of(model), NONE_BEFORE
    put_said(post.said, NOTHING_SAID)
    put_low(post.low, NO_LOW)
    return post


class Endless:
    """Rows without an end, as kernels fill them in plain Python; `tell` is told the time [s] now and then."""

    def __init__(self, tell: Callable[[float], object] | None = None) -> None:
        self.rows: list[list[float]] = []
        self.tell = tell or float

    def __len__(self) -> int:
        """Return more than there ever are."""
        return sys.maxsize

    def cut(self, count: int) -> None:
        """Leave out rows behind so many: they were written, and then not taken up."""
        del self.rows[count:]

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
        self.post = post_of(model)
        """What kernels keep of it."""
        self._look_with(model, load)
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
        return ("time", *self._names)

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
        self.post.lines, self._names = lines_of(model), names_of(model, load)
        self._picks = [COLUMNS.index(name) for name in self.columns]

    def advance(self, until: float, rate: float, *, switches: bool = True) -> Seen:
        """Go on to a time [s]; return what shows at a rate [Hz], and, if asked for, where the bridge switches.

        Raises
        ------
        SimulationError
            If it cannot go on.
        """
        plan, before, record = self.plan, self.state, RunLog(self.tell)
        self.state = run(plan, before, until, record)
        looks = Looks(first_look(before.time, rate), rate, until, 1, int(switches))
        rows = self._rows(plan, before, record.parts, looks)
        return Seen([tuple(row[k] for k in self._picks) for row in rows],
                    [(event.time, event.kind) for event in record.events if event.kind in _SHOWN])

    def _rows(self, plan: Plan, before: State, parts: list[Part], looks: Looks) -> list[list[float]]:
        """Return what shows of motions, and note how the bridge drives at their end."""
        post, own = self.post, kernels_of_one()
        if not parts:
            return []
        if own is None:
            seen, motions = Endless(), [row for part in parts for row in part.rows]
            stood = stretch.Stood(before.memory, told_of(before.memory, plan.digital))
            used = np.zeros(USED, np.int64)
            _, post.was, _ = stretch.show(plan.numbers, plan.inputs, motions, len(motions), np.zeros(0), stood,
                                          looks.next, post.was, NO_LOW, looks, post.lines,
                                          Screen(seen, Endless(), used), True)
            return seen.rows[:used[0]]
        rows = np.concatenate([np.asarray(part.rows, record_of(log.Row)) for part in parts])
        room = 2 * int(looks.rate * (looks.until - before.time)) + 3 * len(rows) + 4
        found, used = np.empty((room, len(COLUMNS))), np.zeros(USED, np.int64)
        own.shown(plan.plant, plan.compiled.inputs, plan.compiled.stood(before), rows, np.zeros(0), post.was, looks,
                  post.lines, found, used)
        last = rows[rows["end"] > rows["start"]][-1:]
        if last.size:
            duty = float(last["duty"][0])
            post.was = Switch(float(last["drive"][0]), duty if abs(duty) > 1.0 else 0.0, int(last["silent"][0]))
        shown: list[list[float]] = found[:used[0]].tolist()
        return shown

    def seen(self, rows: Endless, events: Endless) -> Seen:
        """Return what shows of rows and events that kernels have written."""
        picks = self._picks
        return Seen([tuple(row[k] for k in picks) for row in rows.rows],
                    [(time, SHOWN[int(code)]) for time, code in events.rows if int(code) in SHOWN])

    @property
    def plan(self) -> Plan:
        """What the engine needs for what it is told now."""
        return self._simulator.of(self.state).plan(self.told.signal, self.push)

    def now(self) -> Row:
        """Return the row of the present instant."""
        names, value = self._names, self._simulator.observe
        return (self.state.time, *(value(self.state, name, self.told.signal, external_torque=self.push)
                                    for name in names))


class Change(NamedTuple):
    """A servo with other numbers: its state, its command as it follows it then, and its model."""

    state: State
    command: Taken
    model: Model
