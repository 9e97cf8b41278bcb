"""Calls of compiled code at a tick, and the places of their arguments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.models.engine.bus import bus_records
from servotwin.models.engine.bus.bus_records import Tape
from servotwin.models.engine.observe import Observed
from servotwin.simulation.bus_run import BUSES, ROW
from servotwin.simulation.compile.calls import Call, Now, call_of
from servotwin.simulation.compile.layout import GIVEN
from servotwin.simulation.lanes.forms import TICKS

if TYPE_CHECKING:
    from servotwin.simulation.lanes.store import Store

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NO_TAPE = Tape(np.zeros(0, ROW), np.zeros((0, bus_records.EVENT)), np.zeros(0), np.zeros(0, np.int64))
"""Of buses whose motions nobody keeps."""


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
    return found | clock_of(some, store, room)


def clock_of(some: Any, store: Store, room: Room) -> dict[str, list[Call]]:
    """Return what reads the times of lanes, if a record of torque could end for one of them."""
    if not store.numbers.torque.count[some.which].any():
        return {}
    return {"clock": [call_of(TICKS, "read_clocks", some.which, store.status, store.ended, some.rows, room.clock)]}
