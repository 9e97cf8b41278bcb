"""Lanes of a `VectorSimulator` that share supplies: where they are kept and moved, bus by bus."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.bus.bus_batch import Buses
from servotwin.models.engine.bus.coupled_motion import APART
from servotwin.models.engine.lanes import Lanes, Tables
from servotwin.models.engine.memory import NONE_YET, Memories
from servotwin.models.engine.step import COMPLETED
from servotwin.simulation.bus import Supplies, source_of
from servotwin.simulation.bus_run import BUSES, room_of, shared_of, units_of
from servotwin.simulation.compile import kernels
from servotwin.simulation.compile.calls import Call, Now, call_of
from servotwin.simulation.lanes.forms import TICKS
from servotwin.simulation.lanes.tick_room import NO_TAPE, calls_on_buses
from servotwin.simulation.lanes.whole_runs import Piece, nothing_yet, piece_of, put_back, taken

if TYPE_CHECKING:
    from servotwin.simulation.lanes.lane_numbers import LaneNumbers
    from servotwin.simulation.lanes.store import Store

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_PLACES = 4  # among what is imposed
_WORTH = 4  # buses for a thread: fewer cost more in waking it


class BusSet:
    """Lanes on buses, in the order of the buses.

    Attributes
    ----------
    which : ndarray of int64
        The lanes.
    memories : Memories
        Memory of each lane.
    buses : Buses
        Common memory of those on a bus; `tables` and `rooms` are what its kernels need besides.
    """

    kernel = BUSES.name
    """Of its kernels."""

    def __init__(self, numbers: LaneNumbers, threads: int, pool: Any) -> None:
        supplies: Supplies = numbers.supplies
        self._pool = pool
        self.which = np.concatenate(supplies.lanes)
        sizes = np.array([len(some) for some in supplies.lanes])
        count = len(self.which)
        self.memories = nothing_yet(count)
        self.rows = self.memories.rows
        self._bus_at = np.repeat(np.arange(len(sizes)), sizes)
        self.buses = Buses(self.which, np.concatenate([[0], np.cumsum(sizes)]), self.memories, np.full(count, -1),
                            shared_of([source_of(supply) for supply in supplies.supplies]), np.zeros(count, np.int64),
                            np.zeros(count))
        none = np.zeros(numbers.count, np.int64)
        curve = numbers.curve
        self.tables = Tables(numbers.torque.rows, numbers.torque.first, numbers.torque.count, curve, none,
                              none + len(curve))
        self._calls: list[Call] = []
        self._look: Call | None = None
        most, workers = int(sizes.max()), max(1, min(threads, len(sizes) // _WORTH))
        self.rooms = [(*room_of(most), *units_of(most)) for _ in range(workers)]

    def advance(self, store: Store) -> None:
        """Advance all buses by a tick; status and end of all lanes are kept up to date."""
        buses, status, ended = self.buses, store.status, store.ended
        buses.status[:] = status[self.which]
        before = buses.status.copy()
        if not self._calls:
            count, workers = len(self.buses.shared), len(self.rooms)
            self._calls = [call_of(BUSES, "go_on", store.columns, self.tables, buses, count * k // workers,
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
        """Let no servos on the buses of these lanes move together, until time advances."""
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

    def copied(self, places: Indices) -> Memories:
        """Return what lanes remember that stand at some places."""
        return taken(self.memories, places)

    def pieces(self) -> list[Piece]:
        """Return where the lanes stand, and what those on a bus remember together."""
        return [piece_of(array) for array in (*self.memories, self.buses.joined, self.buses.shared)]

    def watch(self, places: Indices) -> None:
        """Look for the least voltages of the supplies that lanes are on from now on."""
        self.buses.shared["lowest"][self._bus_at[places]] = NONE_YET

    @property
    def lowest(self) -> NDArray[Any]:
        """The least voltage of each lane's supply."""
        return np.asarray(self.buses.shared["lowest"][self._bus_at])

    def set_lowest(self, shared: Mapping[int, Any]) -> None:
        """Take the least voltages of supplies so far from what lanes on them remember together."""
        for k, record in shared.items():
            self.buses.shared["lowest"][k] = record["lowest"]

    def common(self, joined: Indices, shared: dict[int, Any]) -> None:
        """Put into `joined` (lanes,) and `shared` what the lanes of each bus remember together."""
        joined[self.which] = self.buses.joined
        shared |= {k: self.buses.shared[k].copy() for k in range(len(self.buses.shared))}

    def set_common(self, joined: Indices, shared: dict[int, Any], anchors: Array) -> None:
        """Let those lanes move together again whose buses are in `shared`, from motions that began at `anchors` [s]."""
        for k, record in shared.items():
            places = np.flatnonzero(self._bus_at == k)
            source = self.buses.shared[k]["source"].copy()
            self.buses.shared[k] = record
            self.buses.shared["source"][k] = source
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
        self._look = self._look or call_of(BUSES, "look", store.columns, self.tables, self.buses, *self.rooms[0][:2],
                                           seen)
        self._look()
