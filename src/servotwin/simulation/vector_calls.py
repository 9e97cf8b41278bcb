"""What a tick is, as programs of compiled calls: on the arrays of a store, set by set."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tape
from servotwin.models.engine.memory import Memories
from servotwin.models.engine.observe import Observed
from servotwin.models.engine.tape import Tape
from servotwin.simulation import lane_recipes
from servotwin.simulation.bus_run import BUSES
from servotwin.simulation.compile import Recipe
from servotwin.simulation.compile.calls import Call, Now, Some, call_of
from servotwin.simulation.compile.layout import GIVEN, STAGES
from servotwin.simulation.lane_memory import nothing_yet
from servotwin.simulation.lanes import ALL_FIELDS

if TYPE_CHECKING:
    from servotwin.simulation.vector_numbers import LaneNumbers
    from servotwin.simulation.vector_store import Store

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Programs = dict[str, list[list[Call]]]

TICKS = Recipe("ticks", (
    *(f"servotwin.models.engine.ticks:{name}" for name in ("accept", "change", "follow")),
    *(f"servotwin.models.engine.lane_ticks:{name}" for name in (
        "gather_lost", "put_lost", "gather", "put", "note_failures", "forget_motions", "impose_on_tiles",
        "impose_on_records", "show_tiles", "show_records", "read_clocks", "take_status", "note_lost_buses",
        "break_up"))))
NO_TAPE = Tape(np.zeros((0, tape.ROW)), np.zeros((0, tape.EVENT)), np.zeros(0), np.zeros(0, np.int64))
"""Of buses whose motions nobody keeps."""
_NONE = np.zeros(0)


class Room(NamedTuple):
    """Where the programs of a simulator find what is given, and leave what is seen; arrays of all lanes."""

    given: Array
    has: Indices
    wanted: Array
    clock: Array
    shaft: Array
    seen: Array

    @classmethod
    def of(cls, lanes: int) -> Room:
        """Return room for so many lanes."""
        return cls(np.zeros((len(GIVEN), lanes)), np.zeros(len(GIVEN), np.int64), np.zeros(lanes), np.zeros(lanes),
                   np.zeros((2, lanes)), np.zeros((lanes, len(Observed._fields))))


def asked(rows: Mapping[int, Array | None], which: Indices, lanes: int) -> tuple[Indices, Array]:
    """Return which rows are given of those of `engine.ticks`, and all of them with numbers of some lanes."""
    has, given = np.zeros(len(GIVEN), np.int64), np.empty((len(GIVEN), lanes))
    for row, values in rows.items():
        if values is not None:
            has[row], given[row, which] = 1, values
    return has, given


def programs_of(numbers: LaneNumbers, store: Store, room: Room, scales: Array, command: Array,
                torque: Array) -> Programs:
    """Return the programs of all stages; `scales` are those of `Translator.table`."""
    columns = store.columns
    accept = call_of(TICKS, "accept", store.now, room.has, room.given, scales, columns.numbers, room.clock,
                     numbers.record_ends(), numbers.supplies.bus_of, room.wanted, returns=True)
    every = np.arange(numbers.count)
    change = call_of(TICKS, "change", room.has, room.given, every, numbers.given, numbers.load_total, numbers.V_oc,
                     numbers.pulsed, *numbers.imposed, columns.numbers, returns=True)
    follow = call_of(TICKS, "follow", room.has, room.given, room.wanted, store.base, command, torque, store.total,
                     columns.pieces, store.now)
    found: Programs = {stage: [] for stage in STAGES}
    found |= {"accept": [[accept]], "change": [[change]], "follow": [[follow]]}
    for some in store.sets:
        for stage, chain in some.calls(store, room, command).items():
            found[stage].append(chain)
    return found


def calls_in_tiles(some: Any, store: Store, room: Room, command: Array) -> dict[str, list[Call]]:
    """Return what is called for lanes in tiles at each stage; those that are given up go on one by one."""
    kernels, rows, which = some.recipe, some.rows, some.which
    places = np.arange(len(which))
    advance = call_of(kernels, "advance", which, *some.form, 0, len(rows), Now(store.now, 0), command, store.total,
                      Now(store.now, 1, True), rows, some.plans[0], returns=True)
    alone = _Alone(len(which))
    lost = [call_of(TICKS, "gather_lost", which, store.status, rows, *alone.room, returns=True),
            *alone.go_on(some.general, store),
            call_of(TICKS, "put_lost", *alone.some("places", "lanes"), alone.memories, store.numbers.frame_period,
                    rows)]
    return {
        "refit": [call_of(kernels, "refit", store.columns, some.form[0], which, places, rows)],
        "impose": [call_of(TICKS, "impose_on_tiles", room.has, room.given, store.columns.numbers, which, places,
                           store.work, rows)],
        "advance": [advance, *lost], "show": [call_of(TICKS, "show_tiles", which, rows, room.shaft)],
        "look": [call_of(lane_recipes.LOOK, "side_by_side", store.columns, store.inputs[0], which, rows,
                         room.seen)]}


def calls_in_records(some: Any, store: Store, room: Room, command: Array) -> dict[str, list[Call]]:
    """Return what is called for lanes that run one by one at each stage."""
    rows, which, alone = some.rows, some.which, _Alone(len(some.which))
    calm = list[Call]()
    if some.calms:
        calm = [call_of(lane_recipes.PLAIN_RUNS, "go", store.columns, which, store.now, store.status, rows, some.done,
                        returns=True)]
    gather = call_of(TICKS, "gather", which, store.status, store.now, some.done, some.memories, *alone.room,
                     returns=True)
    advance = [*calm, gather,
               *alone.go_on(some.recipe, store),
               call_of(TICKS, "put", *alone.some("places"), alone.memories, some.memories)]
    found = {
        "refit": [call_of(TICKS, "forget_motions", rows)],
        "impose": [call_of(TICKS, "impose_on_records", room.has, room.given, store.columns.numbers, which,
                           np.arange(len(which)), store.work, rows)],
        "advance": advance, "show": [call_of(TICKS, "show_records", which, rows, room.shaft)],
        "look": [call_of(lane_recipes.LOOK, "one_by_one", store.columns, *store.inputs, which, some.memories,
                         room.seen)]}
    return found | _clock(some, store, room)


def calls_on_buses(some: Any, store: Store, room: Room) -> dict[str, list[Call]]:
    """Return what is called for lanes on buses at each stage."""
    rows, which, buses, own = some.rows, some.which, some.buses, (store.columns, some.tables)
    apart = call_of(TICKS, "break_up", buses.joined, buses.shared, rows)
    alive = call_of(TICKS, "take_status", which, store.status, buses.status)
    found = {
        "refit": [apart],
        "impose": [apart, call_of(TICKS, "impose_on_records", room.has, room.given, store.columns.numbers, which,
                                  np.arange(len(which)), store.work, rows)],
        "advance": [alive, call_of(BUSES, "go_on", *own, buses, 0, len(buses.shared), Now(store.now, 0), math.inf,
                                   *some.rooms[0], NO_TAPE),
                    call_of(TICKS, "note_lost_buses", which, buses.status, rows, store.status, store.ended)],
        "show": [call_of(TICKS, "show_records", which, rows, room.shaft)],
        "look": [alive, call_of(BUSES, "look", *own, buses, *some.rooms[0][:2], room.seen)]}
    return found | _clock(some, store, room)


def _clock(some: Any, store: Store, room: Room) -> dict[str, list[Call]]:
    """Return what reads the times of lanes, if a record of torque could end for one of them."""
    if not store.numbers.torque.count[some.which].any():
        return {}
    return {"clock": [call_of(TICKS, "read_clocks", some.which, store.status, store.ended, some.rows, room.clock)]}


class _Gathered(NamedTuple):
    """Lanes that have been put together: where they are in their set, who, how far they go, and their memories."""

    number: Indices  # of them
    places: Indices
    lanes: Indices
    durations: Array
    memories: Memories


class _Alone:
    """Room for up to so many lanes of a set that go on one by one, and the calls for it."""

    def __init__(self, most: int) -> None:
        self.room = _Gathered(np.zeros(1, np.int64), np.zeros(most, np.int64), np.zeros(most, np.int64), np.zeros(most),
                              nothing_yet(most))
        self.memories = Memories(*(Some(array, self.room.number) for array in self.room.memories))
        self._how, self._at = np.zeros(most, np.int64), np.zeros(most)
        self._first, self._outputs = np.zeros(most, np.int64), np.zeros((most, len(ALL_FIELDS), 0))

    def some(self, *names: str) -> list[Some]:
        """Return of the room what is gathered now."""
        return [Some(getattr(self.room, name), self.room.number) for name in names]

    def go_on(self, recipe: Recipe, store: Store) -> list[Call]:
        """Return the calls that let the lanes go on and note who has failed."""
        lanes, durations = self.some("lanes", "durations")
        how, at = Some(self._how, self.room.number), Some(self._at, self.room.number)
        shared = (store.columns, *store.inputs, lanes, durations, _NONE, self._first, self._outputs, self.memories, how)
        *ahead, last = lane_recipes.chain_of(recipe)
        calls = [call_of(last, "go_on", *shared, at),
                 call_of(TICKS, "note_failures", lanes, how, at, self.memories.rows, store.status, store.ended)]
        return [*(call_of(one, "go_on", *shared, *lane_recipes.room_of(one)) for one in ahead), *calls]
