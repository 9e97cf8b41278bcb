"""Lanes that stop and go on, in sets of one form: in tiles side by side, or in records one by one.

What a set does is calls of kernels, of whose words the arrays stay where they are: from Python and from compiled code
the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.lanes import Lanes
from servotwin.models.engine.memory import NONE_YET, Memories
from servotwin.models.state.records import TILE
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.compile.calls import Call, Now, Some, call_of
from servotwin.simulation.lanes import form_recipes
from servotwin.simulation.lanes.form_recipes import TICKS
from servotwin.simulation.lanes.forms import OneByOne, SideBySide
from servotwin.simulation.lanes.memories import flat, memories_of, nothing_yet, put_back, taken
from servotwin.simulation.lanes.saved import Piece, piece_of
from servotwin.simulation.lanes.tick_room import clock_of
from servotwin.simulation.lanes.whole_runs import Going, tiles_of

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers
    from servotwin.simulation.lanes.store import Store

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
SHAFT = {"output_angle": "q", "output_speed": "w"}  # where tiles and records have them
_WORD = 8  # bytes
_WORTH = 64  # tiles for a thread: fewer cost more in waking it
_WORTH_QUICK, _WORTH_SLOW = 64, 4  # lanes for a thread that go on one by one, by kernels that take so long


class Chain:
    """Calls one after the other, until one returns 0; those after the first ones are made when that is not so."""

    def __init__(self, first: list[Call], rest: Callable[[], list[Call]] = list) -> None:
        self._first, self._make = first, rest

    @cached_property
    def _rest(self) -> list[Call]:
        return self._make()

    def __call__(self) -> None:
        """Make the calls."""
        for call in self._first:
            if call() == 0:
                return
        for call in self._rest:
            if call() == 0:
                return

    @property
    def calls(self) -> list[Call]:
        """All of them."""
        return [*self._first, *self._rest]


class Tiles:
    """Lanes that run side by side, as they start."""

    def __init__(self, kind: SideBySide, columns: Lanes, threads: int) -> None:
        self.which, self._kind, self.kernel = kind.which, kind, kind.recipe.name
        self.rows = tiles_of(kind, columns, math.inf)
        self.rows["clock"]["piece_end"] = math.inf
        self._workers = min(threads, len(self.rows) // _WORTH)
        self._chains: list[Chain] = []
        self._look: Call | None = None

    def chains(self, store: Store) -> list[Chain]:
        """Return what lets the lanes go on, a chain a thread."""
        if not self._chains:
            self._chains = [self._chain(store, part) for part in _cuts(len(self.rows), self._workers)]
        return self._chains

    def _chain(self, store: Store, part: slice) -> Chain:
        kind, rows, which = self._kind, self.rows[part], self.which[part.start * TILE:part.stop * TILE]
        advance = call_of(kind.recipe, "advance", which, kind.form, kind.slack, 0, len(rows), Now(store.now, 0),
                          store.command, store.total, Now(store.now, 1, True), rows,
                          tiles.plan_room(kind.dtype, kind.form), returns=True)

        def given_up() -> list[Call]:
            number, places = np.zeros(1, np.int64), np.zeros(len(which), np.int64)
            room = Going.of(np.zeros(len(which), np.int64), nothing_yet(len(which)))
            gather = call_of(TICKS, "gather_lost", which, store.status, store.command, store.columns.pieces, rows,
                             number, places, room.which, room.durations, room.memories, returns=True)
            first: dict[str, Any] = {name: Some(getattr(room, name), number)
                                     for name in ("which", "durations", "status")}
            lost = room._replace(memories=Memories(*(Some(array, number) for array in room.memories)), **first)
            put = call_of(TICKS, "to_tiles", Some(places, number), lost.which, lost.memories,
                          store.numbers.frame_period, rows)
            return [gather, *_one_by_one(form_recipes.ALL_RUNS, store, lost, number), put]

        return Chain([advance], given_up)

    def runs(self, kind: SideBySide | OneByOne) -> bool:
        """Tell whether lanes of a kind may stand here."""
        own = self._kind
        return (isinstance(kind, SideBySide) and (kind.form, kind.dtype) == (own.form, own.dtype)
                and (own.slack or not kind.slack))

    def put(self, places: Indices, memories: Memories, numbers: LaneNumbers) -> None:
        """Put what lanes remember into their places."""
        kernels(TICKS).to_tiles(places, self.which[places], memories, numbers.frame_period, self.rows)

    def refit(self, columns: Lanes, lanes: Indices, places: Indices) -> None:
        """Take the numbers of lanes anew."""
        kernels(self._kind.recipe).refit(columns, self._kind.form, lanes, places, self.rows)

    def impose(self, *imposed: Any) -> None:
        """Set angles and speeds, as `engine.lane_ticks` does."""
        kernels(TICKS).impose_on_tiles(*imposed, self.rows)

    def copied(self, places: Indices) -> Memories:
        """Return what lanes remember that stand at some places."""
        return memories_of(self.rows, places)

    def pieces(self) -> list[Piece]:
        """Return where the lanes of each tile stand: numbers of one kind side by side."""
        wide = self.rows.dtype.itemsize // TILE // _WORD  # a tile of float32 is kept whole
        first, step = self.rows.ctypes.data, self.rows.itemsize
        if self.rows.dtype != tiles.tile_type("float64", self._kind.form):
            return [piece_of(self.rows)]
        return [Piece(first + step * k, wide, _WORD * TILE, _WORD * min(len(self.which) - TILE * k, TILE))
                for k in range(len(self.rows))]

    def shaft(self, name: str) -> Array:
        """Return angle [rad] or speed [rad/s] of each shaft."""
        return np.asarray(self.rows["servo"][SHAFT[name]].reshape(-1)[:len(self.which)], dtype=np.float64)

    @property
    def time(self) -> Array:
        """Time of each lane since its start [s]."""
        edge, since = (flat(self.rows, "clock", name)[:len(self.which)] for name in ("edge", "since"))
        return np.asarray(edge + since)

    def look(self, store: Store) -> Call:
        """Return the call that puts what shows of the lanes into their rows of what is seen."""
        self._look = self._look or call_of(form_recipes.LOOK, "side_by_side", store.columns, store.inputs[0],
                                           self.which, self.rows, store.room.seen)
        return self._look

    def calls(self, store: Store) -> dict[str, list[Call]]:
        """Return what compiled code calls at each stage of a tick but going on and looking."""
        room, which, rows = store.room, self.which, self.rows
        places = np.arange(len(which))
        return {
            "refit": [call_of(self._kind.recipe, "refit", store.columns, self._kind.form, which, places, rows)],
            "impose": [call_of(TICKS, "impose_on_tiles", room.has, room.given, store.columns.numbers, which, places,
                               store.work, rows)],
            "show": [call_of(TICKS, "show_tiles", which, rows, room.shaft)]}


class Records:
    """Lanes that run one by one, as they start."""

    def __init__(self, kind: OneByOne, columns: Lanes, threads: int) -> None:
        self.which, self._recipe, self._calms, self.kernel = kind.which, kind.recipe, kind.calm, kind.recipe.name
        self._way = kind[1:]
        self.memories = nothing_yet(len(self.which))
        self.rows = self.memories.rows
        kernels(form_recipes.last_of(kind.recipe)).start(columns, self.which, self.memories)
        quick = kind.calm or kind.quick
        self._workers = min(threads, len(self.which) // (_WORTH_QUICK if quick else _WORTH_SLOW))
        self._chains: list[Chain] = []
        self._look: Call | None = None

    def chains(self, store: Store) -> list[Chain]:
        """Return what lets the lanes go on, a chain a thread."""
        if not self._chains:
            self._chains = [self._chain(store, part) for part in _cuts(len(self.which), self._workers)]
        return self._chains

    def _chain(self, store: Store, part: slice) -> Chain:
        """Return what lets some lanes go on: those without an event at once, if some may go on calmly."""
        going = Going.of(self.which[part], taken(self.memories, part))
        done = np.zeros(len(going.which), np.int64)
        calm = [call_of(form_recipes.CALM, "go", store.columns, going.which, store.now, store.status,
                        going.memories.rows, done, returns=True)] if self._calms else []
        ready = call_of(form_recipes.last_of(self._recipe), "ready", going.which, store.status, store.now, done,
                        going.durations, going.status, returns=True)
        return Chain([*calm, ready, *_one_by_one(self._recipe, store, going)])

    def runs(self, kind: SideBySide | OneByOne) -> bool:
        """Tell whether lanes of a kind may stand here."""
        return isinstance(kind, OneByOne) and kind[1:] == self._way

    def put(self, places: Indices, memories: Memories, numbers: LaneNumbers) -> None:
        """Put what lanes remember into their places."""
        put_back(self.memories, places, memories)

    def refit(self, columns: Lanes, lanes: Indices, places: Indices) -> None:
        """Let motions of lanes begin anew: their numbers are read at each step."""
        self.rows["point"]["anchor_time"][places] = math.inf

    def impose(self, *imposed: Any) -> None:
        """Set angles and speeds, as `engine.lane_ticks` does; motor and potentiometer go along as far as their play."""
        kernels(TICKS).impose_on_records(*imposed, self.rows)

    def copied(self, places: Indices) -> Memories:
        """Return what lanes remember that stand at some places."""
        return taken(self.memories, places)

    def watch(self, places: Indices) -> None:
        """Look for the least voltages of lanes' supplies from now on."""
        self.rows["lowest"][places] = NONE_YET

    @property
    def lowest(self) -> NDArray[Any]:
        """The least voltage of each lane's supply."""
        return np.asarray(self.rows["lowest"])

    def pieces(self) -> list[Piece]:
        """Return where the lanes stand."""
        return [piece_of(array) for array in self.memories]

    def shaft(self, name: str) -> Array:
        """Return angle [rad] or speed [rad/s] of each shaft."""
        return np.asarray(self.rows["point"]["y"][SHAFT[name]])

    @property
    def time(self) -> Array:
        """Time of each lane since its start [s]."""
        return np.asarray(self.rows["frames"] * self.rows["beat"] + self.rows["point"]["time"])

    def look(self, store: Store) -> Call:
        """Return the call that puts what shows of the lanes into their rows of what is seen."""
        self._look = self._look or call_of(form_recipes.LOOK, "one_by_one", store.columns, *store.inputs, self.which,
                                           self.memories, store.room.seen)
        return self._look

    def calls(self, store: Store) -> dict[str, list[Call]]:
        """Return what compiled code calls at each stage of a tick but going on and looking."""
        room, which = store.room, self.which
        return clock_of(self, store, room) | {
            "refit": [call_of(TICKS, "forget_motions", self.rows)],
            "impose": [call_of(TICKS, "impose_on_records", room.has, room.given, store.columns.numbers, which,
                               np.arange(len(which)), store.work, self.rows)],
            "show": [call_of(TICKS, "show_records", which, self.rows, room.shaft)]}


def _one_by_one(recipe: Recipe, store: Store, going: Going, number: Indices | None = None) -> list[Call]:
    """Return the calls that let lanes go on one by one, the first so many if that is said, and note who has failed."""
    ended: Any = np.zeros(len(going.first_output))
    if number is not None:
        ended = Some(ended, number)
    steps = [call_of(one, entry, store.columns, *store.inputs, *going, *more)
             for one, entry, more in form_recipes.steps_of(recipe, ended)]
    return [*steps, call_of(form_recipes.last_of(recipe), "note_failures", going.which, going.status, ended,
                            going.memories.rows, store.status, store.ended)]


def _cuts(count: int, parts: int) -> list[slice]:
    """Return so many parts of things in a row, one at the least."""
    ends = [count * k // max(parts, 1) for k in range(max(parts, 1) + 1)]
    return [slice(a, b) for a, b in pairwise(ends)]
