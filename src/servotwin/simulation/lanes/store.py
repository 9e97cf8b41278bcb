"""Where the lanes of a `VectorSimulator` are kept and moved: in tiles side by side, or in records one by one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.cosim.cosim_calls import ANGLE, SPEED
from servotwin.models.engine.memory import NOT_ASKED, Lowest, Memories
from servotwin.models.state.modes import INSIDE, ON_BACKWARD, RIGID
from servotwin.models.state.records import TILE, record_of
from servotwin.models.terms.elastic import Elastic
from servotwin.models.terms.play import Play
from servotwin.simulation.compile.calls import Call, call_of
from servotwin.simulation.compile.layout import STAGES
from servotwin.simulation.lanes.form_recipes import TICKS
from servotwin.simulation.lanes.forms import OneByOne, SideBySide, kinds_of
from servotwin.simulation.lanes.lane_sets import Records, Tiles
from servotwin.simulation.lanes.memories import copied, nothing_yet, put_back, taken
from servotwin.simulation.lanes.saved import Common, VectorMemory
from servotwin.simulation.lanes.tick_room import Room, asked
from servotwin.simulation.vector_buses import BusSet

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Store:
    """The memories of lanes, and how they go on.

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
        """Take what another simulator has imposed on some lanes, which may run `otherwise` then; memories go on."""
        if otherwise and not _same(self._kinds_now(), self._kinds):
            self.renew(self.numbers, which)
            return
        for some, places, of in self._parts(which):
            some.refit(self.columns, which[of], places)

    def renew(self, numbers: LaneNumbers, which: Indices) -> None:
        """Take other numbers of some lanes; memories go on."""
        memories, common = self.memories(), self.common()
        self._build(numbers)
        self.hang(self.torque)
        self._go_on_from(memories, which, common)

    def takes(self, part: LaneNumbers, which: Indices, names: Iterable[str]) -> bool:
        """Take other numbers of some lanes in place, if they run in the same way as before; memories go on."""
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
        """Put lanes where they start; their noise goes on."""
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

    # --- going on -----------------------------------------------------------------------------------------------------

    def advance(self, duration: float) -> None:
        """Let all lanes go on [s]."""
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
