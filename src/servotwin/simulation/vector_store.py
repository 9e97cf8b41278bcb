"""Where the lanes of a `VectorSimulator` are kept and moved: in tiles side by side, or in records one by one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine import tiles
from servotwin.models.engine.memory import Memories
from servotwin.models.engine.modes import INSIDE, ON_BACKWARD, RIGID
from servotwin.models.engine.records import TILE, columns_of, room
from servotwin.models.engine.ticks import ANGLE, SPEED
from servotwin.models.terms.chip import Chip
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.firmware import NO_FIRMWARE, Firmware
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.play import Play
from servotwin.simulation import lane_recipes, lane_runs
from servotwin.simulation.compile import kernels
from servotwin.simulation.compile.calls import Call, Now, call_of
from servotwin.simulation.lane_kinds import OneByOne, SideBySide, kinds_of
from servotwin.simulation.lane_memory import copied, flat, memories_of, nothing_yet, put, put_back, put_memories, taken
from servotwin.simulation.lane_runs import some_of
from servotwin.simulation.lanes import ALL_FIELDS
from servotwin.simulation.vector_buses import BusSet
from servotwin.simulation.vector_calls import TICKS, asked, calls_in_records, calls_in_tiles
from servotwin.simulation.vector_going import GoingOn
from servotwin.simulation.vector_memory import Common, Piece, piece_of

if TYPE_CHECKING:
    from servotwin.simulation.vector_memory import VectorMemory
    from servotwin.simulation.vector_numbers import LaneNumbers

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
SHAFT = {"output_angle": "q", "output_speed": "w"}  # where tiles and records have them
_WORD = 8  # bytes
_WORTH = 64  # tiles for a thread: fewer cost more in waking it


class Store:
    """The memories of lanes, and how they go on.

    Parameters
    ----------
    numbers : LaneNumbers
    dtype : str
        Of lanes that run side by side.
    threads : int
    pool : Executor
    """

    def __init__(self, numbers: LaneNumbers, dtype: str, threads: int, pool: Any) -> None:
        self._dtype, self._threads, self._pool = dtype, threads, pool
        count = numbers.count
        self.status, self.ended = np.zeros(count, np.int8), np.zeros(count)
        self.work = np.zeros(count)
        self.total = np.zeros(count)  # of torque
        self.now = np.zeros(2)  # what compiled code reads: the duration of a tick, and whether torques are others
        self._build(numbers)

    def _build(self, numbers: LaneNumbers) -> None:
        self.numbers = numbers
        columns = numbers.columns
        self.base = columns.torque.copy()
        self.total[:] = self.base
        self.columns = columns._replace(torque=self.total)
        self._kinds = self._kinds_now()
        self._buses = [BusSet(numbers, self._threads, self._pool)] if numbers.supplies.lanes else []
        self.sets: list[_Tiles | _Records | BusSet] = [
            *(_Tiles(kind, some_of(self.columns, kind.which), self._threads)
              if isinstance(kind, SideBySide) else _Records(kind) for kind in self._kinds), *self._buses]
        self._set_of, self._place = np.empty((2, numbers.count), np.int64)
        for k, some in enumerate(self.sets):
            self._set_of[some.which], self._place[some.which] = k, np.arange(len(some.which))
        self.inputs = (numbers.curve, numbers.torque.rows, numbers.torque.first, numbers.torque.count)
        self.now[1] = 1.0

    def _kinds_now(self) -> list[SideBySide | OneByOne]:
        numbers, lanes = self.numbers, slice(self.numbers.count)
        own = columns_of(Numbers, numbers.columns.numbers, lanes), columns_of(Chip, numbers.columns.chips, lanes)
        programs = numbers.columns.firmware
        kinds = kinds_of(*own, numbers.count, self._dtype, np.zeros(numbers.count, np.bool_),
                         numbers.torque.count > 0, bool(numbers.curve.size),
                         Firmware(*(programs[name] for name in Firmware._fields)) if numbers.digital else NO_FIRMWARE)
        if numbers.supplies.lanes:
            bus_of = numbers.supplies.bus_of
            kinds = [kind._replace(which=kind.which[bus_of[kind.which] < 0]) for kind in kinds]
        return [kind for kind in kinds if len(kind.which)]

    def _parts(self, which: Indices) -> Iterator[tuple[_Tiles | _Records | BusSet, Indices, Indices]]:
        """Return the sets that hold some lanes, where in the set they are, and where in `which`."""
        set_of, place = self._set_of[which], self._place[which]
        for k, some in enumerate(self.sets):
            of = np.flatnonzero(set_of == k)
            if len(of):
                yield some, place[of], of

    def hang(self, torque: Array) -> None:
        """Hang external torques beside the loads [N m]."""
        np.add(self.base, torque, out=self.total)
        self.now[1] = 1.0

    def refit(self, which: Indices, otherwise: bool, torque: Array) -> None:
        """Take what another simulator has imposed on some lanes, which may run `otherwise` then; memories go on."""
        if otherwise and not _same(self._kinds_now(), self._kinds):
            self.renew(self.numbers, which, torque)
            return
        for some, places, of in self._parts(which):
            some.refit(self.columns, which[of], places)

    def renew(self, numbers: LaneNumbers, which: Indices, torque: Array) -> None:
        """Take other numbers of some lanes; memories go on."""
        memories, common = self.memories(), self.common()
        self._build(numbers)
        self.hang(torque)
        self._go_on_from(memories, which, common)

    def restore(self, memory: VectorMemory, torque: Array) -> None:
        """Go back to what was saved."""
        self.status[:], self.ended[:], self.work[:] = memory.status, memory.ended, memory.work
        self.hang(torque)
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
        play, sprung = self.numbers.now(Play).half > 0.0, self.numbers.now(Elastic).k > 0.0
        point = memories.rows["point"]
        point["anchor_time"][others] = math.inf
        mesh = point["mode"]["mesh"]
        point["mode"]["mesh"] = np.where(
            play, np.where((mesh == RIGID) | (mesh > ON_BACKWARD), INSIDE, mesh), np.where(sprung, mesh, RIGID))
        rigid = ~(play | sprung)
        y = point["y"]
        y["q_m"][rigid], y["w_m"][rigid] = y["q"][rigid], y["w"][rigid]
        anchors = point["anchor_time"].copy()
        if common is not None:
            point["anchor_time"][common.joined >= 0] = math.inf  # unless their bus is the same as then
        self._put(np.arange(len(self.status)), memories)
        if common is not None and np.array_equal(common.bus_of, self.numbers.supplies.bus_of):
            touched = common.bus_of[others]
            shared = {k: record for k, record in common.shared.items() if k not in touched}
            for some in self._buses:
                some.set_common(common.joined, shared, anchors)

    def start(self, which: Indices, memories: Memories) -> None:
        """Put lanes where they start; their noise goes on."""
        before = self.memories(which)
        memories.rows["chip"]["draws"], memories.firms["draws"] = before.rows["chip"]["draws"], before.firms["draws"]
        self.status[which], self.ended[which], self.work[which] = 0, 0.0, 0.0
        self._put(which, memories)

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

    # --- going on -----------------------------------------------------------------------------------------------------

    def advance(self, duration: float, command: Array) -> None:
        """Let all lanes go on [s]."""
        self.now[0] = duration
        for some in self.sets:
            if isinstance(some, _Tiles):
                self._advance_tiles(some, command)
            elif isinstance(some, BusSet):
                self.columns.pieces[:, 1] = command
                some.advance(self)
            else:
                self.columns.pieces[:, 1] = command
                own = np.flatnonzero((self.status[some.which] == 0) & ~some.calm(self))
                if len(own) == len(some.which) and min(self._threads, len(own)) == 1:
                    some.go_on(self, duration)
                elif len(own) == len(some.which):
                    self._one_by_one(some.recipe, some.which, duration, some.memories)
                elif len(own):
                    part = taken(some.memories, own)
                    self._one_by_one(some.recipe, some.which[own], duration, part)
                    put_back(some.memories, own, part)
        self.now[1] = 0.0

    def _advance_tiles(self, some: _Tiles, command: Array) -> None:
        calls = some.advancing(self, command)
        if len(calls) == 1:
            lost = calls[0]()
        else:
            lost = sum(run.result() for run in [self._pool.submit(call) for call in calls])
        if lost:
            owed = flat(some.rows, "clock", "owed")[:len(some.which)]
            places = np.flatnonzero(owed > 0.0)
            durations = owed[places].copy()
            some.forget(places)
            alive = self.status[some.which[places]] == 0
            places, durations = places[alive], durations[alive]
            if len(places):
                self.columns.pieces[:, 1] = command
                part = memories_of(some.rows, places)
                self._one_by_one(some.general, some.which[places], durations, part)
                put_memories(some.rows, places, part, self.numbers.frame_period[some.which[places]])

    def _one_by_one(self, recipe: Any, which: Indices, duration: float | Array, memories: Memories) -> None:
        """Let some lanes go on one by one; their memories are changed in place."""
        status, ended = np.zeros(len(which), np.int64), np.zeros(len(which))
        durations = np.full(len(which), duration) if isinstance(duration, float) else duration

        def go(part: slice) -> None:
            some = which[part]
            lane_runs.go_on(recipe, self.columns, *self.inputs, some, durations[part], _NONE,
                            np.zeros(len(some), np.int64), np.zeros((len(some), len(ALL_FIELDS), 0)),
                            taken(memories, part), status[part], ended[part])

        workers = min(self._threads, len(which))
        if workers == 1:
            go(slice(0, len(which)))
        else:
            cuts = [len(which) * k // workers for k in range(workers + 1)]
            for run in [self._pool.submit(go, slice(a, b)) for a, b in itertools.pairwise(cuts)]:
                run.result()
        self.note_failures(which, status, ended, memories)

    def note_failures(self, which: Indices, status: Indices, ended: Array, memories: Memories) -> None:
        """Note which of some lanes have failed, and when [s]."""
        for k in np.flatnonzero(status).tolist():
            self.status[which[k]], self.ended[which[k]] = status[k], ended[k]
            memories.rows["point"]["y"][k] = math.nan

    # --- what shows, and what is imposed ------------------------------------------------------------------------------

    def look(self, command: Array, seen: Array) -> None:
        """Put what shows of all lanes under their commands into `seen`, a row of `observe.Observed` for each."""
        self.columns.pieces[:, 1] = command
        for some in self.sets:
            some.look(self, seen)
        seen[self.status != 0] = math.nan

    def impose(self, which: Indices, angle: Array | None, speed: Array | None) -> None:
        """Set angles [rad] and speeds [rad/s] of the output; book the work of the impulses."""
        has, given = asked({ANGLE: angle, SPEED: speed}, which, len(self.status))
        for some, places, of in self._parts(which):
            some.impose(has, given, self.columns.numbers, which[of], places, self.work)


_NONE = np.zeros(0)


def _same(some: list[SideBySide | OneByOne], others: list[SideBySide | OneByOne]) -> bool:
    """Tell whether lanes run in the same way."""
    return len(some) == len(others) and all(
        type(a) is type(b) and a[1:] == b[1:] and np.array_equal(a.which, b.which)
        for a, b in zip(some, others, strict=True))


class _Tiles:
    """Lanes that run side by side."""

    def __init__(self, kind: SideBySide, lanes: tiles.Lanes, threads: int) -> None:
        self.which, self.form, self.general = kind.which, (kind.form, kind.slack), kind.general
        self.rows = room(-(-len(self.which) // TILE), tiles.tile_type(kind.dtype, kind.form))
        self.workers = max(1, min(threads, len(self.rows) // _WORTH))
        self.plans = [tiles.plan_room(kind.dtype, kind.form) for _ in range(self.workers)]
        self.recipe = kind.recipe
        self._calls: list[Call] = []
        self._look: Call | None = None
        kernels(kind.recipe).start(lanes, kind.form, math.inf, self.rows)
        self.rows["clock"]["piece_end"] = math.inf

    def advancing(self, store: Store, command: Array) -> list[Call]:
        """Return the calls that let the lanes go on, one a thread; they return how many lanes were given up."""
        if not self._calls:
            count, workers = len(self.rows), self.workers
            self._calls = [call_of(
                self.recipe, "advance", self.which, *self.form, count * k // workers, count * (k + 1) // workers,
                Now(store.now, 0), command, store.total, Now(store.now, 1, True), self.rows, self.plans[k],
                returns=True) for k in range(workers)]
        return self._calls

    def put(self, places: Indices, memories: Memories, numbers: LaneNumbers) -> None:
        put_memories(self.rows, places, memories, numbers.frame_period[self.which[places]])

    def refit(self, columns: tiles.Lanes, lanes: Indices, places: Indices) -> None:
        """Take the numbers of lanes anew."""
        kernels(self.recipe).refit(columns, self.form[0], lanes, places, self.rows)

    def impose(self, *imposed: Any) -> None:
        """Set angles and speeds, as `engine.lane_ticks` does."""
        kernels(TICKS).impose_on_tiles(*imposed, self.rows)

    def forget(self, places: Indices) -> None:
        """Let the general way finish the calls of these lanes."""
        put(self.rows, "clock", "owed", places, 0.0)

    def copied(self, places: Indices) -> Memories:
        return memories_of(self.rows, places)

    def pieces(self) -> list[Piece]:
        """Return where the lanes of each tile stand: numbers of one kind side by side."""
        wide = self.rows.dtype.itemsize // TILE // _WORD  # a tile of float32 is kept whole
        first, step = self.rows.ctypes.data, self.rows.itemsize
        if self.rows.dtype != tiles.tile_type("float64", self.form[0]):
            return [piece_of(self.rows)]
        return [Piece(first + step * k, wide, _WORD * TILE, _WORD * min(len(self.which) - TILE * k, TILE))
                for k in range(len(self.rows))]

    def shaft(self, name: str) -> Array:
        return np.asarray(self.rows["servo"][SHAFT[name]].reshape(-1)[:len(self.which)], dtype=np.float64)

    @property
    def time(self) -> Array:
        edge, since = (flat(self.rows, "clock", name)[:len(self.which)] for name in ("edge", "since"))
        return np.asarray(edge + since)

    def look(self, store: Store, seen: Array) -> None:
        self._look = self._look or call_of(lane_recipes.LOOK, "side_by_side", store.columns,
                                           store.inputs[0], self.which, self.rows, seen)
        self._look()

    def calls(self, store: Store, room: Any, command: Array) -> dict[str, list[Any]]:
        """Return what compiled code calls at each stage of a tick."""
        return calls_in_tiles(self, store, room, command)


class _Records:
    """Lanes that run one by one."""

    def __init__(self, kind: OneByOne) -> None:
        self.which, self.recipe = kind.which, kind.recipe
        self.memories = nothing_yet(len(self.which))
        self.rows = self.memories.rows
        self.done = np.zeros(len(self.which), np.int64)  # those that are through this call already
        self.calms = kind.calm
        self._calm: Call | None = None
        self._look: Call | None = None
        self._going: GoingOn | None = None

    def calm(self, store: Store) -> NDArray[np.bool_]:
        """Let those go on that are through a tick without an event; tell which."""
        if self.calms:
            self._calm = self._calm or call_of(lane_recipes.PLAIN_RUNS, "go", store.columns, self.which, store.now,
                                               store.status, self.rows, self.done)
            self._calm()
        return np.asarray(self.done != 0)

    def go_on(self, store: Store, duration: float) -> None:
        """Let all of them go on for a time [s]."""
        self._going = self._going or GoingOn(self.recipe, store.columns, store.inputs, self.which, self.memories)
        store.note_failures(self.which, *self._going(duration), self.memories)

    def put(self, places: Indices, memories: Memories, numbers: LaneNumbers) -> None:
        put_back(self.memories, places, memories)

    def refit(self, columns: tiles.Lanes, lanes: Indices, places: Indices) -> None:
        """Let motions of lanes begin anew: their numbers are read at each step."""
        self.rows["point"]["anchor_time"][places] = math.inf

    def impose(self, *imposed: Any) -> None:
        """Set angles and speeds, as `engine.lane_ticks` does; motor and potentiometer go along as far as their play."""
        kernels(TICKS).impose_on_records(*imposed, self.rows)

    def copied(self, places: Indices) -> Memories:
        return taken(self.memories, places)

    def pieces(self) -> list[Piece]:
        """Return where the lanes stand."""
        return [piece_of(array) for array in self.memories]

    def shaft(self, name: str) -> Array:
        return np.asarray(self.rows["point"]["y"][SHAFT[name]])

    @property
    def time(self) -> Array:
        return np.asarray(self.rows["frames"] * self.rows["beat"] + self.rows["point"]["time"])

    def look(self, store: Store, seen: Array) -> None:
        self._look = self._look or call_of(lane_recipes.LOOK, "one_by_one", store.columns, *store.inputs,
                                           self.which, self.memories, seen)
        self._look()

    def calls(self, store: Store, room: Any, command: Array) -> dict[str, list[Any]]:
        """Return what compiled code calls at each stage of a tick."""
        return calls_in_records(self, store, room, command)
