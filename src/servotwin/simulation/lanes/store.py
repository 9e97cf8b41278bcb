"""Where the lanes of a `VectorSimulator` are kept and moved: in tiles side by side, or in records one by one.

A set calls kernels, of whose words the arrays stay where they are: from Python and from compiled code
the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.cosim import ANGLE, SPEED
from servotwin.models.engine.lanes import Lanes
from servotwin.models.engine.memory import NONE_YET, NOT_ASKED, Lowest, Memories
from servotwin.models.state.modes import INSIDE, ON_BACKWARD, RIGID
from servotwin.models.state.records import TILE, record_of
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.play import Play
from servotwin.simulation.compile import Recipe, kernels
from servotwin.simulation.compile.calls import Call, Now, Some, call_of
from servotwin.simulation.compile.layout import STAGES
from servotwin.simulation.lanes import forms
from servotwin.simulation.lanes.forms import TICKS, OneByOne, SideBySide, kinds_of
from servotwin.simulation.lanes.tick_room import Room, asked, clock_of
from servotwin.simulation.lanes.whole_runs import (
    Common,
    Going,
    Piece,
    VectorMemory,
    copied,
    flat,
    memories_of,
    nothing_yet,
    piece_of,
    put_back,
    taken,
    tiles_of,
)
from servotwin.simulation.vector_buses import BusSet

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers


# --- Lanes that stop and continue, in sets of one form: in tiles side by side, or in records one by one ---------------

SHAFT = {"output_angle": "q", "output_speed": "w"}  # where tiles and records have them
_WORD = 8  # bytes
_WORTH = 64  # tiles for a thread: fewer cost more in waking it
_WORTH_QUICK, _WORTH_SLOW = 64, 4  # lanes for a thread that advance one by one, by kernels that take so long


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
        """Return what advances the lanes, a chain a thread."""
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
            return [gather, *_one_by_one(forms.RUNS, store, lost, number), put]

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
        self._look = self._look or call_of(forms.LOOK, "side_by_side", store.columns, store.inputs[0],
                                           self.which, self.rows, store.room.seen)
        return self._look

    def calls(self, store: Store) -> dict[str, list[Call]]:
        """Return what compiled code calls at each stage of a tick but advancing and looking."""
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
        kernels(forms.last_of(kind.recipe)).start(columns, self.which, self.memories)
        quick = kind.calm or kind.quick
        self._workers = min(threads, len(self.which) // (_WORTH_QUICK if quick else _WORTH_SLOW))
        self._chains: list[Chain] = []
        self._look: Call | None = None

    def chains(self, store: Store) -> list[Chain]:
        """Return what advances the lanes, a chain a thread."""
        if not self._chains:
            self._chains = [self._chain(store, part) for part in _cuts(len(self.which), self._workers)]
        return self._chains

    def _chain(self, store: Store, part: slice) -> Chain:
        """Return what advances some lanes: those without an event at once, if some may advance calmly."""
        going = Going.of(self.which[part], taken(self.memories, part))
        done = np.zeros(len(going.which), np.int64)
        calm = [call_of(forms.CALM, "go", store.columns, going.which, store.now, store.status,
                        going.memories.rows, done, returns=True)] if self._calms else []
        ready = call_of(forms.last_of(self._recipe), "ready", going.which, store.status, store.now, done,
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
        self._look = self._look or call_of(forms.LOOK, "one_by_one", store.columns, *store.inputs, self.which,
                                           self.memories, store.room.seen)
        return self._look

    def calls(self, store: Store) -> dict[str, list[Call]]:
        """Return what compiled code calls at each stage of a tick but advancing and looking."""
        room, which = store.room, self.which
        return clock_of(self, store, room) | {
            "refit": [call_of(TICKS, "forget_motions", self.rows)],
            "impose": [call_of(TICKS, "impose_on_records", room.has, room.given, store.columns.numbers, which,
                               np.arange(len(which)), store.work, self.rows)],
            "show": [call_of(TICKS, "show_records", which, self.rows, room.shaft)]}


def _one_by_one(recipe: Recipe, store: Store, going: Going, number: Indices | None = None) -> list[Call]:
    """Return the calls that advance lanes one by one, the first so many if that is said, and note which have failed."""
    ended: Any = np.zeros(len(going.first_output))
    if number is not None:
        ended = Some(ended, number)
    steps = [call_of(one, entry, store.columns, *store.inputs, *going, *more)
             for one, entry, more in forms.steps_of(recipe, ended)]
    return [*steps, call_of(forms.last_of(recipe), "note_failures", going.which, going.status, ended,
                            going.memories.rows, store.status, store.ended)]


def _cuts(count: int, parts: int) -> list[slice]:
    """Return so many parts of things in a row, one at the least."""
    ends = [count * k // max(parts, 1) for k in range(max(parts, 1) + 1)]
    return [slice(a, b) for a, b in pairwise(ends)]


# --- Where the lanes of a `VectorSimulator` are kept and moved --------------------------------------------------------

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Store:
    """The memories of lanes, and how they advance.

    Parameters
    ----------
    numbers : LaneNumbers
    dtype : str
        Of lanes that run side by side.
    threads : int
    pool : Executor
    watched : bool
        Whether the least voltage of each lane's supply is kept.
    """

    def __init__(self, numbers: LaneNumbers, dtype: str, threads: int, pool: Any, watched: bool = False) -> None:
        self._dtype, self._threads, self._pool, self.watched = dtype, threads, pool, watched
        count = numbers.count
        self.status, self.ended = np.zeros(count, np.int8), np.zeros(count)
        self.work = np.zeros(count)
        self.command = numbers.neutral.copy()  # as the engine follows it: pulse width [s], control voltage [V]
        self.torque, self.total = np.zeros(count), np.zeros(count)  # beside the loads, and of both
        self.room = Room.of(count)
        self.fresh = np.zeros(1, np.int64)  # 1 while what was seen still shows; compiled code ends that too
        self.now = np.zeros(2)  # what compiled code reads: the duration of a tick, and whether torques are others
        self._build(numbers)
        for some in self._buses:
            some.put(np.arange(len(some.which)), numbers.start(some.which, self.command, None), numbers)
        self.watch(np.arange(count))

    def _build(self, numbers: LaneNumbers) -> None:
        self.numbers = numbers
        columns = numbers.columns
        self.base = columns.torque.copy()
        self.total[:] = self.base
        self.columns = columns._replace(torque=self.total)
        self._kinds = self._kinds_now()
        self._buses = [BusSet(numbers, self._threads, self._pool)] if numbers.supplies.lanes else []
        self.sets: list[Tiles | Records | BusSet] = [
            *(Tiles(kind, self.columns, self._threads) if isinstance(kind, SideBySide) else
              Records(kind, self.columns, self._threads) for kind in self._kinds), *self._buses]
        self._reads_pieces = not all(isinstance(some, Tiles) for some in self.sets)
        self._set_of, self._place = np.empty((2, numbers.count), np.int64)
        for k, some in enumerate(self.sets):
            self._set_of[some.which], self._place[some.which] = k, np.arange(len(some.which))
        self.inputs = (numbers.curve, numbers.torque.rows, numbers.torque.first, numbers.torque.count)
        self.now[1] = 1.0

    def _kinds_now(self) -> list[SideBySide | OneByOne]:
        numbers = self.numbers
        kinds = kinds_of(numbers.packed(), self._dtype, watched=self.watched)
        if numbers.supplies.lanes:
            bus_of = numbers.supplies.bus_of
            kinds = [kind._replace(which=kind.which[bus_of[kind.which] < 0]) for kind in kinds]
        return [kind for kind in kinds if len(kind.which)]

    def _parts(self, which: Indices) -> Iterator[tuple[Tiles | Records | BusSet, Indices, Indices]]:
        """Return the sets that hold some lanes, where in the set they are, and where in `which`."""
        set_of, place = self._set_of[which], self._place[which]
        for k, some in enumerate(self.sets):
            of = np.flatnonzero(set_of == k)
            if len(of):
                yield some, place[of], of

    def hang(self, torque: Any) -> None:
        """Hang external torques beside the loads [N m]."""
        self.torque[:] = torque
        np.add(self.base, self.torque, out=self.total)
        self.now[1] = 1.0

    def refit(self, which: Indices, otherwise: bool) -> None:
        """Take what another simulator has imposed on some lanes, which may run `otherwise` then; memories continue."""
        if otherwise and not _same(self._kinds_now(), self._kinds):
            self.renew(self.numbers, which)
            return
        for some, places, of in self._parts(which):
            some.refit(self.columns, which[of], places)

    def renew(self, numbers: LaneNumbers, which: Indices) -> None:
        """Take other numbers of some lanes; memories continue."""
        memories, common = self.memories(), self.common()
        self._build(numbers)
        self.hang(self.torque)
        self._go_on_from(memories, which, common)

    def takes(self, part: LaneNumbers, which: Indices, names: Iterable[str]) -> bool:
        """Take other numbers of some lanes in place, if they run in the same way as before; memories continue."""
        for kind in kinds_of(part.packed(), self._dtype, watched=self.watched):
            for k in np.unique(self._set_of[which[kind.which]]).tolist():
                if not self.sets[k].runs(kind):
                    return False
        self.numbers.take(which, part, names)
        self.base[which] = self.numbers.columns.torque[which]
        self.hang(self.torque)
        for some, places, of in self._parts(which):
            if isinstance(some, Records):
                some.rows["point"][places] = self._meshed(some.rows["point"][places], which[of])
            some.refit(self.columns, which[of], places)
        return True

    def save(self) -> VectorMemory:
        """Return all that the lanes remember, as it is now."""
        return VectorMemory(type(self.numbers.model).__name__, *self.memories(), self.command.copy(),
                            self.torque.copy(), self.status.copy(), self.ended.copy(), self.work.copy(),
                            self.numbers.columns.numbers.copy(), self.common())

    def restore(self, memory: VectorMemory) -> None:
        """Go back to what was saved."""
        self.status[:], self.ended[:], self.work[:] = memory.status, memory.ended, memory.work
        self.command[:] = memory.command
        self.hang(memory.torque)
        count = len(self.status)
        before, now = (x.view(np.float64).reshape(len(x), -1, TILE)
                       for x in (memory.numbers, self.numbers.columns.numbers))
        others = np.flatnonzero((before != now).any(axis=1).ravel()[:count])
        self._go_on_from(copied(Memories(memory.records, memory.firms)), others, memory.common)

    def common(self) -> Common | None:
        """Return what lanes on shared supplies remember together."""
        if not self._buses:
            return None
        joined, shared = np.full(len(self.status), -1), dict[int, Any]()
        for some in self._buses:
            some.common(joined, shared)
        return Common(self.numbers.supplies.bus_of, joined, shared)

    def _go_on_from(self, memories: Memories, others: Indices, common: Common | None) -> None:
        """Take the memories of all lanes, of which some have other numbers than when they were made."""
        point = memories.rows["point"]
        point["anchor_time"][others] = math.inf
        point[:] = self._meshed(point, np.arange(len(point)))
        anchors = point["anchor_time"].copy()
        if common is not None:
            point["anchor_time"][common.joined >= 0] = math.inf  # unless their bus is the same as then
        self._put(np.arange(len(self.status)), memories)
        if common is not None and np.array_equal(common.bus_of, self.numbers.supplies.bus_of):
            for some in self._buses:
                some.set_lowest(common.shared)
            touched = common.bus_of[others]
            shared = {k: record for k, record in common.shared.items() if k not in touched}
            for some in self._buses:
                some.set_common(common.joined, shared, anchors)

    def _meshed(self, point: Any, which: Indices) -> Any:
        """Return where lanes are, with their gears as these are now: with play, a spring, or neither."""
        play, sprung = self.numbers.now(Play, which).half > 0.0, self.numbers.now(Elastic, which).k > 0.0
        mesh = point["mode"]["mesh"]
        point["mode"]["mesh"] = np.where(
            play, np.where((mesh == RIGID) | (mesh > ON_BACKWARD), INSIDE, mesh), np.where(sprung, mesh, RIGID))
        rigid, y = ~(play | sprung), point["y"]
        y["q_m"][rigid], y["w_m"][rigid] = y["q"][rigid], y["w"][rigid]
        return point

    def start(self, which: Indices, memories: Memories) -> None:
        """Put lanes where they start; their noise continues."""
        before = self.memories(which)
        memories.rows["chip"]["draws"], memories.firms["draws"] = before.rows["chip"]["draws"], before.firms["draws"]
        self.status[which], self.ended[which], self.work[which] = 0, 0.0, 0.0
        self._put(which, memories)
        self.watch(which)

    def watch(self, which: Indices) -> None:
        """Look for the least voltages of lanes' supplies from now on, where they are watched."""
        for some, places, _ in self._parts(which):
            if self.watched and not isinstance(some, Tiles):
                some.watch(places)

    @property
    def lowest(self) -> NDArray[Any]:
        """The least voltage of each lane's supply, a record of `models.engine.memory.Lowest` for each."""
        found = np.zeros(len(self.status), record_of(Lowest))
        found[:] = NOT_ASKED
        for some in self.sets:
            if not isinstance(some, Tiles):
                found[some.which] = some.lowest
        return found

    def enable(self, which: Indices, torque: Array) -> None:
        """Let torque of some lanes be on (1) or off (0)."""
        memories = self.memories(which)
        memories.firms["torque"] = torque
        self._put(which, memories)

    def _put(self, which: Indices, memories: Memories) -> None:
        for some, places, of in self._parts(which):
            some.put(places, taken(memories, of), self.numbers)

    def memories(self, which: Indices | None = None) -> Memories:
        """Return the memories of some lanes, or of all."""
        which = np.arange(len(self.status)) if which is None else which
        found = nothing_yet(len(which))
        for some, places, of in self._parts(which):
            put_back(found, of, some.copied(places))
        return found

    def shaft(self, name: str) -> Array:
        """Return angle [rad] or speed [rad/s] of each shaft."""
        found = np.empty(len(self.status))
        for some in self.sets:
            found[some.which] = some.shaft(name)
        return found

    @property
    def time(self) -> Array:
        """Time of each lane since its start [s]."""
        found = np.empty(len(self.status))
        for some in self.sets:
            found[some.which] = some.time
        failed = self.status != 0
        found[failed] = self.ended[failed]
        return found

    # --- advancing ----------------------------------------------------------------------------------------------------

    def advance(self, duration: float) -> None:
        """Advance all lanes [s]."""
        self.now[0] = duration
        if self._reads_pieces:
            self.columns.pieces[:, 1] = self.command
        for some in self.sets:
            if isinstance(some, BusSet):
                some.advance(self)
                continue
            chains = some.chains(self)
            if len(chains) == 1:
                chains[0]()
            else:
                for run in [self._pool.submit(chain) for chain in chains]:
                    run.result()
        self.now[1] = 0.0

    # --- what shows, and what is imposed ------------------------------------------------------------------------------

    def look(self) -> Array:
        """Return what shows of all lanes, a row of `observe.Observed` for each."""
        if not self.fresh[0]:
            self.columns.pieces[:, 1] = self.command
            for some in self.sets:
                if isinstance(some, BusSet):
                    some.look(self, self.room.seen)
                else:
                    some.look(self)()
            self.room.seen[self.status != 0] = math.nan
            self.fresh[0] = 1
        return self.room.seen

    def impose(self, which: Indices, angle: Array | None, speed: Array | None) -> None:
        """Set angles [rad] and speeds [rad/s] of the output; book the work of the impulses."""
        has, given = asked({ANGLE: angle, SPEED: speed}, which, len(self.status))
        for some, places, of in self._parts(which):
            some.impose(has, given, self.columns.numbers, which[of], places, self.work)

    # --- from C -------------------------------------------------------------------------------------------------------

    def programs(self) -> dict[str, list[list[Call]]]:
        """Return what compiled code calls at each stage of a tick: chains of calls."""
        numbers, columns, room = self.numbers, self.columns, self.room
        accept = call_of(TICKS, "accept", self.now, room.has, room.given, numbers.translate.table(), columns.numbers,
                         room.clock, numbers.record_ends(), numbers.supplies.bus_of, room.wanted, returns=True)
        change = call_of(TICKS, "change", room.has, room.given, np.arange(numbers.count), numbers.given,
                         numbers.load_total, numbers.V_oc, numbers.pulsed, *numbers.imposed, columns.numbers,
                         returns=True)
        follow = call_of(TICKS, "follow", room.has, room.given, room.wanted, self.base, self.command, self.torque,
                         self.total, columns.pieces, self.now)
        found: dict[str, list[list[Call]]] = {stage: [] for stage in STAGES}
        found |= {"accept": [[accept]], "change": [[change]], "follow": [[follow]]}
        for some in self.sets:
            if isinstance(some, BusSet):
                own = some.calls(self, room, self.command)
            else:
                own = some.calls(self) | {"look": [some.look(self)]}
                found["advance"] += [chain.calls for chain in some.chains(self)]
            for stage, calls in own.items():
                found[stage].append(calls)
        return found


def _same(some: list[SideBySide | OneByOne], others: list[SideBySide | OneByOne]) -> bool:
    """Tell whether lanes run in the same way."""
    return len(some) == len(others) and all(
        type(a) is type(b) and a[1:] == b[1:] and np.array_equal(a.which, b.which)
        for a, b in zip(some, others, strict=True))
