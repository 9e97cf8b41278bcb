"""Lanes of a `VectorSimulator` that share supplies: where they are kept and moved, bus by bus."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.buses import Buses
from servotwin.models.engine.memory import Memories
from servotwin.models.engine.records import columns_of
from servotwin.models.engine.step import COMPLETED
from servotwin.models.engine.tiles import Lanes
from servotwin.models.engine.together import APART
from servotwin.models.engine.told import Tables
from servotwin.models.terms.numbers import Numbers
from servotwin.simulation.bus_run import recipe_of, room_of, shared_of, way_of
from servotwin.simulation.bus_supply import Supplies, source_of
from servotwin.simulation.compile import kernels
from servotwin.simulation.compile.calls import Call, Now, call_of
from servotwin.simulation.lane_memory import copied, nothing_yet, put_back
from servotwin.simulation.vector_calls import NO_TAPE, TICKS, calls_on_buses
from servotwin.simulation.vector_memory import Piece, piece_of

if TYPE_CHECKING:
    from servotwin.simulation.vector_numbers import LaneNumbers
    from servotwin.simulation.vector_store import Store

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_PLACES = 4  # among what is imposed
_WORTH = 4  # buses for a thread: fewer cost more in waking it


def sets_of(numbers: LaneNumbers, threads: int, pool: Any) -> list[BusSet]:
    """Return the sets of all buses: those of plain servos, and others."""
    supplies = numbers.supplies
    own = way_of(columns_of(Numbers, numbers.columns.numbers, slice(numbers.count)), numbers.digital)
    ways = [recipe_of(numbers.digital, np.broadcast_to(own, numbers.count)[lanes].max()) for lanes in supplies.lanes]
    parts = ((recipe, [k for k, own in enumerate(ways) if own == recipe]) for recipe in dict.fromkeys(ways))
    return [BusSet(numbers, recipe, which, threads, pool) for recipe, which in parts]


class BusSet:
    """Lanes on buses, in the order of the buses.

    Attributes
    ----------
    which : ndarray of int64
        The lanes.
    memories : Memories
        What each remembers.
    buses : Buses
        What those on a bus remember together; `recipe`, `tables` and `rooms` are what its kernels need besides.
    """

    def __init__(self, numbers: LaneNumbers, recipe: Any, buses: list[int], threads: int, pool: Any) -> None:
        supplies: Supplies = numbers.supplies
        lanes = [supplies.lanes[k] for k in buses]
        self.numbers_of_buses, self.recipe, self._pool = np.array(buses), recipe, pool
        self.which = np.concatenate(lanes)
        sizes = np.array([len(some) for some in lanes])
        count = len(self.which)
        self.memories = nothing_yet(count)
        self.rows = self.memories.rows
        self._bus_at = np.repeat(np.arange(len(buses)), sizes)
        self.buses = Buses(self.which, np.concatenate([[0], np.cumsum(sizes)]), self.memories, np.full(count, -1),
                            shared_of([source_of(supplies.supplies[k]) for k in buses]), np.zeros(count, np.int64),
                            np.zeros(count))
        none = np.zeros(numbers.count, np.int64)
        curve = numbers.curve
        self.tables = Tables(numbers.torque.rows, numbers.torque.first, numbers.torque.count, curve, none,
                              none + len(curve))
        self._calls: list[Call] = []
        self._look: Call | None = None
        self.rooms = [room_of(int(sizes.max())) for _ in range(max(1, min(threads, len(buses) // _WORTH)))]

    def advance(self, store: Store) -> None:
        """Let all buses go on by a tick; status and end of all lanes are kept up to date."""
        buses, status, ended = self.buses, store.status, store.ended
        buses.status[:] = status[self.which]
        before = buses.status.copy()
        if not self._calls:
            count, workers = len(self.numbers_of_buses), len(self.rooms)
            self._calls = [call_of(self.recipe, "go_on", store.columns, self.tables, buses, count * k // workers,
                                   count * (k + 1) // workers, Now(store.now, 0), math.inf, *room, NO_TAPE)
                           for k, room in enumerate(self.rooms)]
        if len(self._calls) == 1:
            self._calls[0]()
        else:
            for run in [self._pool.submit(call) for call in self._calls]:
                run.result()
        failed = np.flatnonzero((buses.status != COMPLETED) & (before == COMPLETED))
        if len(failed):
            status[self.which[failed]], ended[self.which[failed]] = buses.status[failed], self.time[failed]
            self.rows["point"]["y"][failed] = math.nan

    def _break_up(self, places: Indices) -> None:
        """Let nobody on the buses of these lanes move together, until time goes on."""
        touched = np.unique(self._bus_at[places])
        mates = np.flatnonzero(np.isin(self._bus_at, touched) & (self.buses.joined >= 0))
        self.rows["point"]["anchor_time"][mates] = math.inf
        self.buses.joined[mates] = -1
        self.buses.shared["phase"][touched] = APART
        self.buses.shared["jumped"][touched] = 1

    def put(self, places: Indices, memories: Memories, numbers: LaneNumbers) -> None:
        """Put what lanes remember into their places."""
        self._break_up(places)
        put_back(self.memories, places, memories)

    def refit(self, columns: Lanes, lanes: Indices, places: Indices) -> None:
        """Let motions of lanes begin anew: their numbers are read at each step."""
        self._break_up(places)
        self.rows["point"]["anchor_time"][places] = math.inf

    def impose(self, *imposed: Any) -> None:
        """Set angles and speeds, as `engine.lane_ticks` does; motor and potentiometer go along as far as their play."""
        self._break_up(imposed[_PLACES])
        kernels(TICKS).impose_on_records(*imposed, self.rows)

    def calls(self, store: Any, room: Any, command: Array) -> dict[str, list[Any]]:
        """Return what compiled code calls at each stage of a tick."""
        return calls_on_buses(self, store, room)

    def copied(self) -> Memories:
        """Return what the lanes remember."""
        return copied(self.memories)

    def pieces(self) -> list[Piece]:
        """Return where the lanes stand, and what those on a bus remember together."""
        return [piece_of(array) for array in (*self.memories, self.buses.joined, self.buses.shared)]

    def common(self, joined: Indices, shared: dict[int, Any]) -> None:
        """Put into `joined` (lanes,) and `shared` what the lanes of each bus remember together."""
        joined[self.which] = self.buses.joined
        shared |= {int(k): self.buses.shared[n].copy() for n, k in enumerate(self.numbers_of_buses)}

    def set_common(self, joined: Indices, shared: dict[int, Any], anchors: Array) -> None:
        """Let those lanes move together again whose buses are in `shared`, from motions that began at `anchors` [s]."""
        for n, k in enumerate(self.numbers_of_buses.tolist()):
            if k in shared:
                places = np.flatnonzero(self._bus_at == n)
                source = self.buses.shared[n]["source"].copy()
                self.buses.shared[n] = shared[k]
                self.buses.shared["source"][n] = source
                self.buses.joined[places] = joined[self.which[places]]
                self.rows["point"]["anchor_time"][places] = anchors[self.which[places]]

    def shaft(self, name: str) -> Array:
        """Return angle [rad] or speed [rad/s] of each shaft."""
        return np.asarray(self.rows["point"]["y"]["q" if name == "output_angle" else "w"])

    @property
    def time(self) -> Array:
        """Time of each lane since its start [s]."""
        return np.asarray(self.rows["frames"] * self.rows["beat"] + self.rows["point"]["time"])

    def look(self, store: Store, seen: Array) -> None:
        """Put what shows of the lanes into their rows of `seen`."""
        self.buses.status[:] = store.status[self.which]
        self._look = self._look or call_of(self.recipe, "look", store.columns, self.tables, self.buses, *self.rooms[0],
                                           seen)
        self._look()
