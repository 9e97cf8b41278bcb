"""Run several servos on one supply, at once or step by step, and keep the rows that they leave behind."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.models.columns import Samples
from servotwin.models.engine import controller
from servotwin.models.engine.bus import bus_batch, bus_records, bus_unit, event_queue
from servotwin.models.engine.bus.bus_batch import Buses
from servotwin.models.engine.bus.bus_records import (
    DRIVES,
    REFUSED,
    ROOM,
    SILENCE,
    TRIPS,
    Mate,
    Seat,
    Shared,
    Tape,
    put_shared,
)
from servotwin.models.engine.bus.coupled_motion import at_start
from servotwin.models.engine.demands import demanded
from servotwin.models.engine.dynamics import guards
from servotwin.models.engine.lanes import Lanes, Tables
from servotwin.models.engine.legs.coupled_units import Coupling, Unit
from servotwin.models.engine.live import together
from servotwin.models.engine.live.posts import NOTHING_SAID, Post, put_low, put_said
from servotwin.models.engine.live.screen import COLUMNS, NEXT, NO_LOW, USED, Lines, Looks
from servotwin.models.engine.log import Row
from servotwin.models.engine.memory import Memories, Memory, forgotten, resumed, time_of
from servotwin.models.engine.step import COMPLETED, DIVERGED
from servotwin.models.state.modes import Mode
from servotwin.models.state.records import TILE, numbers_in, object_of, put_fields, record_of, room, rows_of
from servotwin.models.terms import control
from servotwin.models.terms.control import Firm
from servotwin.models.terms.dependence import SPRING
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.frame import NO_CHIP, Chip
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import Piece
from servotwin.simulation.compile import Recipe, is_compiled, is_plain, kernels
from servotwin.simulation.engine import TRIPS as TRIP_NAMES
from servotwin.simulation.engine import Event, Part, Plan, State, event_name, failure, kernels_beside
from servotwin.simulation.lanes.forms import PLAIN
from servotwin.simulation.lanes.packed import programs_of
from servotwin.simulation.lanes.whole_runs import nothing_yet
from servotwin.simulation.start import Status
from servotwin.simulation.trajectory import Motions

# --- Run several servos on one supply and keep what they leave behind; compiled where that is worth while -------------

Array = NDArray[np.float64]
_ENTRIES = tuple(f"servotwin.models.engine.bus.bus_batch:{name}" for name in ("go_on", "look", "voltages"))
BUSES = Recipe("buses", _ENTRIES, knows=~SPRING)
"""All servos but those with a spring between two bodies; they take hardly longer for what others lack."""
TOGETHER = Recipe("together", ("servotwin.models.engine.live.together:advance",), never=("READINGS",))
"""The same that stop and continue, and are looked at on the way."""
SHARED, SEAT, MATE, ROW = record_of(Shared), record_of(Seat), record_of(Mate), record_of(Row)
UNIT, COUPLING = record_of(Unit), record_of(Coupling)
LOADS_FROM, COMPILES_FROM = 1e2, 1.5e4  # frames of servos in one process: what it takes, and more, in plain Python
_AS_FRAMES = 0.05  # of its frames a servo's share in finding the voltage at an instant takes as long
_INTEGRATED = 8  # a servo that does not move by plain laws takes so many times as long
_ROWS, _NUMBERS = 4096, 1 << 17  # of a tape
_frames_run: dict[str, float] = {}  # in plain Python, of what a recipe would do


class Rows(NamedTuple):
    """The log of a run: rows of motions, of events, and numbers of common motions; status and end [s]."""

    motions: NDArray[Any]
    events: Array
    numbers: Array
    status: int
    ended: float


def run(plans: Sequence[Plan], states: Sequence[State], source: Source, duration: float) -> Rows:
    """Run servos on one source from t = 0 to `duration` [s]."""
    frames = duration * sum(
        _weight(plan) / (plan.firmware.T_c if plan.digital else plan.chip.frame_period) for plan in plans)
    compiled = _worth_it(plans, frames)
    way = (_Compiled if compiled else Plainly)(plans, states, source)
    return taped(way, duration, tape_of(len(plans), not compiled))


def voltages(plans: Sequence[Plan], source: Source, samples: Sequence[Samples]) -> Array:
    """Return the voltage of a source at some instants, from the states of all its servos there [V]; nan after a run."""
    states = np.array([np.broadcast_arrays(
        s.angle, s.speed, s.current, s.winding, s.housing, s.motor_angle, s.motor_speed, s.drive,
        0.0 if s.duty is None else s.duty, s.silent) for s in samples], np.float64).transpose(2, 0, 1)
    found = np.full(len(states), math.nan)
    runs = np.isfinite(states[:, :, 0]).all(axis=1)
    known, rows = np.zeros(int(runs.sum())), states[runs].reshape(-1, 10)
    if known.size:
        if _worth_it(plans, _AS_FRAMES * len(rows)):
            kernels(BUSES).voltages(_lanes_of(plans), shared_of([source]), room_of(len(plans))[1], rows, known)
        else:
            shared = object_of(Shared)
            put_shared(shared, at_start(source))
            mates = [object_of(Mate) for _ in range(2 * len(plans))]
            bus_batch.voltages(_lanes_of(plans), [shared], mates, rows, known)
    found[runs] = known
    return found


def taped(way: _Compiled | Plainly, until: float, written: Tape,
          tell: Callable[[float], object] | None = None) -> Rows:
    """Advance servos to a time [s], by a tape that is read whenever it is full; return what that leaves behind.

    Whenever it is, `tell` is called with the time [s].
    """
    found: list[list[Array]] = []
    count, status, when = 0, event_queue.PAUSED, 0.0
    while status == event_queue.PAUSED:
        written.used[:] = 0
        try:
            status, when = way.go_on(until, written)
        except (ArithmeticError, ValueError):  # numbers beyond what a float holds
            status = DIVERGED
            when = float(np.array(written.motions[:written.used[0]], ROW)["end"].max(initial=when))
        kinds: tuple[Any, ...] = (ROW, np.float64, np.float64)
        part = [np.array(rows[:used], kind) for rows, used, kind in zip(
            written[:3], written.used.tolist(), kinds, strict=True)]
        part[0]["first"] += count
        count += len(part[2])
        found.append(part)
        if tell is not None:
            tell(float(when))
    motions, events, numbers = (np.concatenate(column) for column in zip(*found, strict=True))
    return Rows(motions, events, numbers, int(status), float(when))


def tape_of(servos: int, plain: bool) -> Tape:
    """Return a tape with room for what so many servos do, compiled or in plain Python."""
    rows = max(_ROWS, 64 * servos)
    return Tape([None] * rows if plain else np.empty(rows, ROW), np.empty((rows, bus_records.EVENT)),
                np.empty(max(_NUMBERS, 64 * servos * ROOM)), np.zeros(3, np.int64))


def _weight(plan: Plan) -> float:
    """Return how many times as long as one that moves by plain laws a servo takes in plain Python."""
    plainly = plan.digital or demanded(plan.numbers, NO_CHIP, NO_FIRMWARE, Piece()) & ~PLAIN == 0
    return 1.0 if plainly else _INTEGRATED


def _worth_it(plans: Sequence[Plan], frames: float) -> bool:
    """Tell whether so many frames of servos, with those before, are worth compiled kernels.

    Servos with a program have no room of one shape with others.
    """
    if is_plain() or len({plan.digital for plan in plans}) > 1:
        return False
    done = _frames_run.get(BUSES.name, 0.0) + frames
    if done >= COMPILES_FROM or (done >= LOADS_FROM and is_compiled(BUSES)):
        done = math.inf
    _frames_run[BUSES.name] = done
    return done == math.inf


def begun(plan: Plan, state: State) -> Memory:
    """Return what a servo remembers that is about to continue; its program has its next tick."""
    if not plan.digital:
        return state.memory
    memory = resumed(True, plan.inputs, state.memory, False)._replace(firm=(control.thawed(state.memory.firm[0]),))
    controller.resume(plan.inputs, memory)
    return memory


class Plainly:
    """Servos on one source that run in plain Python.

    Parameters
    ----------
    plans, states : sequence of Plan, of State
        Of the servos, in the same order.
    source : Source
        That they share.
    """

    def __init__(self, plans: Sequence[Plan], states: Sequence[State], source: Source) -> None:
        self.shared = object_of(Shared)
        put_shared(self.shared, at_start(source))
        self.seats, self.mates = ([object_of(kind) for _ in range(n * len(plans))] for kind, n in (
            (Seat, 1), (Mate, 2)))
        for k, seat in enumerate(self.seats):
            seat.place, seat.joined = k, -1
        self.begin(plans, states)

    def begin(self, plans: Sequence[Plan], states: Sequence[State]) -> None:
        """Take up what servos are sent and remember; what they are in together continues."""
        self.inputs = [plan.inputs for plan in plans]
        self.memories = [begun(plan, state) for plan, state in zip(plans, states, strict=True)]
        for seat, plan in zip(self.seats, plans, strict=True):
            bus_unit.sit(seat, plan.numbers, plan.chip, plan.inputs)

    def break_up(self, source: Source) -> None:
        """Let nobody move together, and every motion begin anew: numbers of a servo, or the source, are others now."""
        self.memories = [forgotten(memory) for memory in self.memories]
        for seat in self.seats:
            seat.joined = -1
        put_shared(self.shared, at_start(source))

    def go_on(self, until: float, written: Tape) -> tuple[int, float]:
        """Advance to a time [s]; return a status and when."""
        firms = self.seated()
        for seat in self.seats:
            seat.until = until - seat.origin
        status, when = event_queue.through(self.inputs, firms, len(firms), self.shared, self.seats, self.mates,
                                           written)
        self.risen(firms)
        return status, when

    def seated(self) -> list[Any]:
        """Let all servos take their seats; return what their programs remember."""
        for seat, memory in zip(self.seats, self.memories, strict=True):
            bus_unit.remember(seat, memory)
        return [memory.firm[0] for memory in self.memories]

    def risen(self, firms: list[Any]) -> None:
        """Take note of what all servos remember by now."""
        self.memories = [bus_unit.memory_in(seat, firms)._replace(firm=memory.firm)
                         for seat, memory in zip(self.seats, self.memories, strict=True)]


class _Compiled:
    """Servos on one source that run in compiled code."""

    def __init__(self, plans: Sequence[Plan], states: Sequence[State], source: Source) -> None:
        count = len(plans)
        self._lanes, self._tables = _lanes_of(plans), _tables_of(plans)
        self._bus = Buses(np.arange(count), np.array([0, count]), _records_of(list(map(begun, plans, states))),
                          np.full(count, -1), shared_of([source]), np.zeros(count, np.int64), np.zeros(count))
        self._room = (*room_of(count), *units_of(count))
        self._kernels: Any = kernels(BUSES)

    def go_on(self, until: float, written: Tape) -> tuple[int, float]:
        """Advance to a time [s]; return a status and when."""
        status = self._kernels.go_on(
            self._lanes, self._tables, self._bus, 0, 1, 0.0, float(until), *self._room, written)
        return status, float(self._bus.ended[0])


def room_of(servos: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return seats for so many servos on one bus, and room for their common motions."""
    return np.zeros(servos, SEAT), np.zeros(2 * servos, MATE)


def units_of(servos: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return room for so many servos on one bus that go from tick to tick."""
    return np.zeros(servos, UNIT), np.zeros(1, COUPLING)


def shared_of(sources: Sequence[Source]) -> NDArray[Any]:
    """Return what servos on each of some sources remember together at their start."""
    records = np.zeros(len(sources), SHARED)
    for record, source in zip(records, sources, strict=True):
        put_fields(record, at_start(source))
    return records


def _lanes_of(plans: Sequence[Plan]) -> Lanes:
    """Return servos as the kernels read them."""
    pieces, edges = [plan.command.rows for plan in plans], [np.array(plan.edges or (), np.float64) for plan in plans]
    regular = np.array([plan.edges is None for plan in plans])
    first, count = _places(pieces)
    edge_first, edge_count = _places(edges)
    seeds = [(plan.seed + 2**63) % 2**64 - 2**63 for plan in plans]  # the noise takes the lowest 64 bits alone
    return Lanes(_tiles_of(Numbers, [plan.numbers for plan in plans]), _tiles_of(Chip, [plan.chip for plan in plans]),
                 np.zeros((7, len(plans))), np.array([plan.external_torque for plan in plans]),
                 np.array(seeds), np.concatenate(pieces), first,
                 count, np.concatenate(edges), edge_first, np.where(regular, -1, edge_count), plans[0].accuracy,
                 _programs_of(plans))


def _tables_of(plans: Sequence[Plan]) -> Tables:
    """Return what servos have besides, as the kernels read it."""
    torques = [plan.torque.rows for plan in plans]
    curves = [np.array(plan.curve, np.float64).reshape(-1, 2) for plan in plans]
    return Tables(np.concatenate(torques), *_places(torques), np.concatenate(curves), *_places(curves))


def _programs_of(plans: Sequence[Plan]) -> NDArray[Any]:
    """Return the records of the programs of servos, of which some have none; or one for all that have none."""
    if not any(plan.digital for plan in plans):
        return programs_of(None, 1)
    columns: Any = (np.array(column) for column in zip(*(plan.firmware for plan in plans), strict=True))
    return programs_of(Firmware(*columns), len(plans))


def _places(tables: Sequence[Array]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where each of some tables begins when they stand one after the other, and how long it is."""
    count = np.array([len(table) for table in tables])
    return np.cumsum(count) - count, count


def _tiles_of(kind: type[Any], values: Sequence[Any]) -> NDArray[Any]:
    """Return tiles that hold named tuples of numbers."""
    tiles = room(-(-len(values) // TILE), rows_of(kind, np.float64))
    columns = np.zeros((len(tiles) * TILE, tiles.dtype.itemsize // 8 // TILE))
    columns[:len(values)] = [tuple(numbers_in(one)) for one in values]
    tiles.view(np.float64).reshape(len(tiles), -1, TILE)[:] = columns.reshape(len(tiles), TILE, -1).transpose(0, 2, 1)
    return tiles


def _records_in(states: Sequence[State]) -> Memories:
    """Return what states remember as records."""
    held = [state.records for state in states]
    size = record_of(Memory).itemsize
    return Memories(*(np.frombuffer(bytearray(b"".join(part)), record_of(kind)) for part, kind in (
        ([one[:size] for one in held], Memory), ([one[size:] for one in held], Firm))))


def _records_of(memories: Sequence[Memory]) -> Memories:
    """Return memories as records."""
    found = nothing_yet(len(memories))
    for record, firm, memory in zip(*found, memories, strict=True):
        put_fields(record, memory)
        own = memory.firm[0]
        put_fields(firm, own if hasattr(own, "_fields") else control.frozen(own))
    return found


# --- The rows that a run of servos on a bus leaves behind, as motions and events of each ------------------------------

_WORDS = {DRIVES + 1: "drive forward", DRIVES - 1: "drive backward", DRIVES: "drive ends",
          SILENCE + 1: "silence begins", SILENCE: "silence ends", REFUSED: "pulse refused",
          **{TRIPS + k: word for k, word in enumerate(TRIP_NAMES)}}


def motions_of(plans: Sequence[Plan], rows: Rows) -> list[Motions]:
    """Return the motions of each servo."""
    units = rows.motions["unit"]
    return [Motions([Part(plan, rows.motions[units == j])], rows.numbers) for j, plan in enumerate(plans)]


def events_of(plans: Sequence[Plan], rows: Rows) -> list[tuple[Event, ...]]:
    """Return the events of each servo."""
    found: list[list[Event]] = [[] for _ in plans]
    for unit, time, kind, zone, contact, angle in rows.events.tolist():
        if kind in guards.KINKS:
            continue
        name = _WORDS.get(kind) or event_name(int(kind), Mode(int(zone), int(contact), 0, 0, 0))
        found[int(unit)].append(Event(time, name, angle))
    return [tuple(events) for events in found]


# --- Servos on one supply that stop and continue, and are looked at on the way ----------------------------------------

_ROOM = 16384  # rows, and events, of a servo
_PART, _REST = 0.1, 1e-9  # s, that servos go at once in compiled code, and that are no part of their own


class Endless:
    """Rows without an end, as kernels fill them in plain Python; `tell` is called with the time [s] now and then."""

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


class Shown(NamedTuple):
    """Rows of a servo, each with all of `screen.COLUMNS`, and its events (time [s], code)."""

    rows: list[list[float]]
    events: list[list[float]]


class BusSteps:
    """Servos on one supply that stop and continue.

    Splitting an interval into several calls changes nothing beyond rounding. They run in compiled code where that is
    there when they begin, else in plain Python throughout.

    Parameters
    ----------
    lines : sequence of Lines
        How the values that are shown of each servo stand for commands.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.simulation.bus import on_supply, source_of
    >>> from servotwin.web.live.station import lines_of
    >>> supply = st.Supply(open_circuit_voltage=6.0, internal_resistance=0.5)
    >>> sim = st.Simulator(on_supply(st.PulseServo(st.load_servo("hitec-hs-755hb")), supply))
    >>> command = st.signals.step(0.0, 60.0, unit="deg")
    >>> steps, states = BusSteps(), [sim.initial(command), sim.initial(command)]
    >>> for until in (0.1, 0.15, 0.2):
    ...     states, shown = steps.go_on(source_of(supply), [sim.plan(command)] * 2, states,
    ...                                 [lines_of(sim.model)] * 2, Looks(1, 1e3, until, 1, 0))
    >>> fleet = st.simulate_bus({"a": (sim.model, command), "b": (sim.model, command)}, supply=supply, duration=0.2)
    >>> abs(states[1]["output_angle"] - float(fleet["b"]["output_angle"][-1])) < 1e-12
    True
    """

    def __init__(self) -> None:
        self._way: _ShownPlainly | _ShownCompiled | None = None
        self._source: Source | None = None

    def go_on(self, source: Source, plans: Sequence[Plan], states: Sequence[State], lines: Sequence[Lines],
              looks: Looks, tell: Callable[[float], object] | None = None) -> tuple[list[State], list[Shown]]:
        """Advance all servos to the end of the looks; return their states there, and what shows of each.

        Parameters
        ----------
        source : Source
            That they share.
        plans, states : sequence of Plan, of State
            Of the servos, always in the same order.
        lines : sequence of Lines
            How the values that are shown of each stand for commands.
        looks : Looks
        tell : callable, optional
            Is given the time [s] that they have come to, now and then.

        Raises
        ------
        SimulationError
            If the run cannot continue.
        """
        if self._way is None:
            own = kernels_beside(TOGETHER)
            self._way = _ShownPlainly(plans, states, source) if own is None else _ShownCompiled(own, len(plans))
        others = source != self._source or any(
            plan.numbers != state.numbers for plan, state in zip(plans, states, strict=True))
        self._source = None  # where `tell` ends it, all begin anew from their states
        found = self._way.go_on(source, plans, states, lines, looks, tell or float, others)
        self._source = source
        return found


class _ShownPlainly:
    """The way in plain Python."""

    def __init__(self, plans: Sequence[Plan], states: Sequence[State], source: Source) -> None:
        self._way, self._tape = Plainly(plans, states, source), tape_of(len(plans), True)
        self._posts = [object_of(Post) for _ in plans]
        for post in self._posts:
            put_said(post.said, NOTHING_SAID)

    def go_on(self, source: Source, plans: Sequence[Plan], states: Sequence[State], lines: Sequence[Lines],
              looks: Looks, tell: Callable[[float], object], others: bool) -> tuple[list[State], list[Shown]]:
        """Advance, as `BusSteps.go_on` does; `others`: numbers of a servo or the source are others."""
        way, used = self._way, np.zeros(USED * len(plans), np.int64)
        way.begin(plans, states)
        if others or any(own.beat != one.memory.beat for own, one in zip(way.memories, states, strict=True)):
            way.break_up(source)
        used[NEXT] = looks.next
        put_low(self._posts[0].low, NO_LOW)
        for post, line in zip(self._posts, lines, strict=True):
            post.lines = line
        rows, events = [Endless(tell) for _ in plans], [Endless(tell) for _ in plans]
        firms = way.seated()
        try:
            status = together.go_on(way.inputs, self._posts, firms, way.shared, way.seats, way.mates, looks, self._tape,
                                    rows, events, used)
        except InputError:
            raise  # of the function that is called with the time
        except (ArithmeticError, ValueError):  # numbers beyond what a float holds
            status = DIVERGED
        way.risen(firms)
        if status != COMPLETED:
            raise failure(Status.of_code(status), max(seat.origin + seat.clock for seat in way.seats))
        shown = [Shown(own.rows[:used[USED * j]], one.rows) for j, (own, one) in enumerate(zip(rows, events,
                                                                                               strict=True))]
        return self._states(plans, states, looks.until), shown

    def _states(self, plans: Sequence[Plan], states: Sequence[State], until: float) -> list[State]:
        found = []
        for plan, state, memory in zip(plans, states, self._way.memories, strict=True):
            if plan.digital:
                controller.pause(plan.inputs, controller.of(memory), time_of(memory))
                memory = memory._replace(firm=(control.frozen(memory.firm[0]),))
            found.append(State(until, state.places, memory, plan.numbers, state.changes))
        return found


class _ShownCompiled:
    """The way in compiled code: what servos are in together stays in seats and mates, the rest in their states."""

    def __init__(self, own: Any, servos: int) -> None:
        self._advance, self._tape = own.advance, tape_of(servos, False)
        self._shared, self._posts = np.zeros(1, SHARED), np.zeros(servos, record_of(Post))
        self._seats, self._mates = room_of(servos)
        self._seats["joined"] = -1
        self._rows = np.empty((servos, _ROOM, len(COLUMNS)))
        self._events = np.empty((servos, _ROOM, 2))
        for post in self._posts:
            put_fields(post["said"], NOTHING_SAID)
        self._put_before: list[dict[str, Any]] = [{} for _ in range(servos)]

    def go_on(self, source: Source, plans: Sequence[Plan], states: Sequence[State], lines: Sequence[Lines],
              looks: Looks, tell: Callable[[float], object], others: bool) -> tuple[list[State], list[Shown]]:
        """Advance, as `BusSteps.go_on` does, a part of the way at a time; `others`: see there."""
        self._put(plans, lines, others)
        memories = _records_in(states)
        lanes, tables = _lanes_of(plans), _tables_of(plans)
        used = np.zeros(USED * len(plans), np.int64)
        used[NEXT], now, whole = looks.next, states[0].time, looks.until
        self._posts["low"]["voltage"], self._posts["low"]["pending"] = NO_LOW
        while now < whole:
            end = min(whole, now + _PART, now + _ROOM / (8.0 * looks.rate))
            end = whole if whole - end <= _REST else end
            status = self._advance(self._posts, memories, lanes, tables, self._shared, self._seats, self._mates,
                                   looks._replace(next=int(used[NEXT]), until=end,
                                                  at_end=looks.at_end if end == whole else 0),
                                   self._tape, self._rows, self._events, used)
            if status != COMPLETED:
                raise failure(Status.of_code(status), float(np.max(self._seats["origin"] + self._seats["clock"])))
            now = end
            self._make_room(int(used.reshape(-1, USED)[:, :2].max()))
            tell(now)
        shown = [Shown(self._rows[k, :rows].tolist(), self._events[k, :events].tolist())
                 for k, (rows, events) in enumerate(used.reshape(-1, USED)[:, :2])]
        held = [row.tobytes() + firm.tobytes() for row, firm in zip(*memories, strict=True)]
        return [State(whole, state.places, own, plan.numbers, state.changes)
                for plan, state, own in zip(plans, states, held, strict=True)], shown

    def _make_room(self, used: int) -> None:
        """Let half of the room, more than a part ever takes, be free; a least voltage that waits behind it stays."""
        whole = self._rows.shape[1]
        if used >= whole - 1:
            raise InputError("servos on a supply", got=f"over {_ROOM // 2} switches of bridges in {_PART:g} s",
                             allowed="fewer")
        if used > whole // 2:
            self._rows, self._events = (np.concatenate([own, np.empty_like(own)], axis=1) for own in (
                self._rows, self._events))

    def _put(self, plans: Sequence[Plan], lines: Sequence[Lines], others: bool) -> None:
        """Put into posts what is other than before."""
        for k, (post, plan, line) in enumerate(zip(self._posts, plans, lines, strict=True)):
            post["changed"] = int(others)
            present = dict(zip(Post._fields, (plan.numbers, plan.chip, line), strict=False))
            for name, values in present.items():
                if values != self._put_before[k].get(name):
                    put_fields(post[name], values)
            self._put_before[k] = present
