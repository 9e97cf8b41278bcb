"""A servo at the bench: its model, where it stands, its commands, what shows of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.errors import InputError
from servotwin.models import DigitalServo
from servotwin.models.base import KINDS
from servotwin.models.engine import log
from servotwin.models.engine.live import stretch
from servotwin.models.engine.live.posts import NONE_BEFORE
from servotwin.models.engine.live.screen import (
    COLUMNS,
    NO_LOW,
    SHOWN,
    USED,
    Lines,
    Looks,
    Screen,
    Switch,
    first_look,
    told_of,
)
from servotwin.models.state.records import record_of
from servotwin.models.switched import SwitchedServo
from servotwin.physics.pieces import Piece, Pieces, piece_value
from servotwin.signals import Signal
from servotwin.simulation import Simulator
from servotwin.simulation.bus_run import Endless, Shown
from servotwin.simulation.engine import Part, Plan, RunLog, State, kernels_of_one, run
from servotwin.web.live.actions import ControlCircuit, command_signal

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models import Model


# --- The command of a servo; a servo of pulses follows it once a frame ------------------------------------------------

_NEVER = 1e9  # s


class Taken(NamedTuple):
    """A command that a model takes: as it was given, and as the model follows it."""

    shape: Signal
    drive: Pieces

    def at(self, time: float) -> float:
        """Return what the model follows at a time [s], of plain numbers: it is asked for at each frame."""
        return piece_value(self.drive.at(time)[0], time)


class Told:
    """The command of a servo; a servo of pulses follows it once a frame, and others as it goes.

    Parameters
    ----------
    model : Model
    command : mapping
        The first, as `checked_command` returns it; it begins at t = 0.
    control : mapping, optional
        Of the control circuit that makes the pulses; they are those that the model makes of the command unless given.

    Raises
    ------
    CommandError
        If the model does not take it.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.web.live.live_bench import Transmitter
    >>> hold = {"shape": "hold", "unit": "us", "value": 1500.0}
    >>> told = Told(st.PulseServo(st.load_servo("hitec-hs-755hb")), hold)
    >>> told.hear(Transmitter(50.0, 0).until(0.03)), told.signal.edges
    ([(0.0, 0.0015), (0.02, 0.0015)], (0.0, 0.02))
    """

    def __init__(self, model: Model, command: Mapping[str, Any], control: Mapping[str, float] | None = None) -> None:
        self.pulsed = isinstance(model, SwitchedServo) and not (isinstance(model, DigitalServo) and model.takes_goals)
        if control and not self.pulsed:
            raise InputError("model at a control circuit", got=type(model).__name__, allowed="one of pulses")
        self.control: ControlCircuit | None = None
        """The source of its pulses; None: they are as the command says."""
        self._taken = _taken(model, command, 0.0, controlled=bool(control))
        if control:
            self.control = ControlCircuit(control, float(self._taken.shape(0.0)))
        self.signal = self._silence() if self.pulsed else self._taken.shape
        """The signal that the model follows now."""

    @property
    def widest(self) -> float:
        """The longest pulse that the command may ask for, and what has to follow it [s]; 0 where there are none."""
        if self.control is not None:
            return self.control.longest
        return self._taken.drive.extremes[1] if self.pulsed else 0.0

    def takes(self, model: Model, command: Mapping[str, Any], time: float) -> Taken:
        """Return a command from a time on [s] as a model follows it.

        Raises
        ------
        CommandError, InputError
            If the model, or the control circuit, does not take it.
        """
        return _taken(model, command, time, controlled=self.control is not None)

    def put(self, command: Taken) -> None:
        """Follow another command from its start on, or from the next frame on."""
        self._taken = command
        if not self.pulsed:
            self.signal = command.shape

    @property
    def shape(self) -> Signal:
        """The present command, as it was given."""
        return self._taken.shape

    def fits(self, model: Model) -> Taken:
        """Return the present command for a model with other numbers, for which it may stand for other pulses.

        Raises
        ------
        CommandError
            If that model does not take it.
        """
        return Taken(self._taken.shape, model.command(self._taken.shape))

    def look(self, time: float, bus_voltage: float, full: float) -> None:
        """Let its control circuit read the command at a time [s], off a supply that has a voltage of a full one [V].

        Raises
        ------
        InputError
            If nothing is left of its reference.
        """
        if self.control is not None:
            self.control.look(float(self._taken.shape(time)), 1.0 - bus_voltage / full)

    def hear(self, edges: Sequence[FrameEdge]) -> list[tuple[float, float]]:
        """Take the frames of the time that comes; return edges and widths of their pulses [s], width 0 if lost."""
        if not self.pulsed:
            return []
        made = [(edge, self._width(edge.time)) for edge in edges]
        pulses = [(edge.time, width if edge.sent else 0.0) for edge, width in made]
        sent = [pulse for pulse in pulses if pulse[1] > 0.0]
        if sent:
            rows = self.signal.pieces.table
            before = [(rows[-1].start, rows[-1].value)] if rows[-1].start < sent[0][0] else []
            self.signal = _train([*before, *sent])
        return pulses

    def _width(self, edge: float) -> float:
        return self._taken.at(edge) if self.control is None else self.control.send(edge)

    def _silence(self) -> Signal:
        """Return a train before its first pulse: the servo stands where the command asks for just before t = 0."""
        first = self._taken.at(0.0) if self.control is None else self.control.width
        return _train([(_NEVER, first)])


def _taken(model: Model, command: Mapping[str, Any], time: float, *, controlled: bool) -> Taken:
    shape = command_signal(command, time)
    if controlled and shape.unit != "V":
        raise InputError("unit of a command to a control circuit", got=command["unit"], allowed="V")
    return Taken(shape, model.command(shape))


def _train(pulses: Sequence[tuple[float, float]]) -> Signal:
    return Signal(pieces=Pieces(tuple(Piece(edge, width) for edge, width in pulses)), unit="s", initial=pulses[0][1],
                  edges=tuple(edge for edge, _ in pulses))


# --- Columns of a bench by model, and how what it follows stands for commands -----------------------------------------

def names_of(model: Model, load: Load) -> tuple[str, ...]:
    """Return the names of all signals that rows show of a model under a load.

    Examples
    --------
    >>> import servotwin as st
    >>> names_of(st.DCMotor(st.load_servo("hitec-hs-755hb")), st.loads.Load())[:2]
    ('armature_voltage', 'armature_current')
    """
    return tuple(name for name in model.signals_with(load) if name in COLUMNS)


def lines_of(model: Model) -> Lines:
    """Return how what a model follows stands for commands.

    Examples
    --------
    >>> import servotwin as st
    >>> lines = lines_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> lines.per_width, lines.width, lines.reduction
    (1.0, 0.0, 280.0)
    """
    volts, angles, widths = (_line(model, name) for name in KINDS)
    reduction = model.value("gear.gear_reduction") if "gear.gear_reduction" in model.requires else 1.0
    return Lines(*volts, *angles, *widths, reduction)


def _line(model: Model, name: str) -> tuple[float, float]:
    """Return slope and value at 0 of a command over what the model follows; 0 where it has none."""
    if name not in model.available:
        return 0.0, 0.0
    at = model.command_signal(name, np.array([0.0, 1.0]))
    return float(at[1] - at[0]), float(at[0])


# --- A servo at the bench: its model, where it stands, its commands, what shows of it ---------------------------------

Row = tuple[float, ...]
_SHOWN = frozenset(SHOWN.values())


class Seen(NamedTuple):
    """Signals of a stretch of time: rows of (time, signals), and (time, kind) of events."""

    rows: list[Row]
    events: list[tuple[float, str]]


class Station:
    """A servo that advances by itself.

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
        self._was = NONE_BEFORE  # how its bridge drove at the end of the latest stretch
        self._look_with(model, load)
        self.push = 0.0  # N m, by hand
        self.tell: Callable[[float], object] | None = None
        """Called with the time [s] now and then within a motion."""

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
        """Continue with other numbers."""
        self.state = change.state
        self.told.put(change.command)
        self._look_with(change.model, self._simulator.of(change.state).load)

    def _look_with(self, model: Model, load: Load) -> None:
        self.lines, self._names = lines_of(model), names_of(model, load)
        self._picks = [COLUMNS.index(name) for name in self.columns]

    def advance(self, until: float, rate: float, *, switches: bool = True) -> Seen:
        """Advance to a time [s]; return what shows at a rate [Hz], and, if asked for, where the bridge switches.

        Raises
        ------
        SimulationError
            If it cannot continue.
        """
        plan, before, record = self.plan, self.state, RunLog(self.tell)
        self.state = run(plan, before, until, record)
        looks = Looks(first_look(before.time, rate), rate, until, 1, int(switches))
        rows = self._rows(plan, before, record.parts, looks)
        return Seen([tuple(row[k] for k in self._picks) for row in rows],
                    [(event.time, event.kind) for event in record.events if event.kind in _SHOWN])

    def _rows(self, plan: Plan, before: State, parts: list[Part], looks: Looks) -> list[list[float]]:
        """Return what shows of motions, and note how the bridge drives at their end."""
        own = kernels_of_one()
        if not parts:
            return []
        if own is None:
            seen, motions = Endless(), [row for part in parts for row in part.rows]
            stood = stretch.Stood(before.memory, told_of(before.memory, plan.digital))
            used = np.zeros(USED, np.int64)
            _, self._was, _ = stretch.show(plan.numbers, plan.inputs, motions, len(motions), np.zeros(0), stood,
                                          looks.next, self._was, NO_LOW, looks, self.lines,
                                          Screen(seen, Endless(), used), True)
            return seen.rows[:used[0]]
        rows = np.concatenate([np.asarray(part.rows, record_of(log.Row)) for part in parts])
        room = 2 * int(looks.rate * (looks.until - before.time)) + 3 * len(rows) + 4
        found, used = np.empty((room, len(COLUMNS))), np.zeros(USED, np.int64)
        own.shown(plan.plant, plan.compiled.inputs, plan.compiled.stood(before), rows, np.zeros(0), self._was, looks,
                  self.lines, found, used)
        last = rows[rows["end"] > rows["start"]][-1:]
        if last.size:
            duty = float(last["duty"][0])
            self._was = Switch(float(last["drive"][0]), duty if abs(duty) > 1.0 else 0.0, int(last["silent"][0]))
        shown: list[list[float]] = found[:used[0]].tolist()
        return shown

    def seen(self, shown: Shown) -> Seen:
        """Return the signals of what shows of it on a shared supply."""
        picks = self._picks
        return Seen([tuple(row[k] for k in picks) for row in shown.rows],
                    [(time, SHOWN[int(code)]) for time, code in shown.events if int(code) in SHOWN])

    @property
    def plan(self) -> Plan:
        """The engine's inputs for the present command."""
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


class FrameEdge(NamedTuple):
    """The beginning of a frame: when [s], and whether its pulse is sent."""

    time: float
    sent: bool
