"""Kernels that let buses of servos go on, and look at them as they stand: their memories are records and arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import bus, controller, crew, runs, step
from servotwin.models.engine.memory import (
    Inputs,
    Memories,
    Memory,
    in_force,
    memory_at,
    origin_of,
    put_memory,
    silent_now,
    since,
)
from servotwin.models.engine.observe import observed, on_bus, told_by
from servotwin.models.engine.seats import drive_of
from servotwin.models.engine.sights import put
from servotwin.models.engine.step import COMPLETED
from servotwin.models.engine.tape import Tape
from servotwin.models.engine.tiles import chip_of, numbers_of
from servotwin.models.terms import duty, firmware
from servotwin.models.terms.numbers import warm
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.tiles import Floats, Indices, Lanes


class Tables(NamedTuple):
    """What lanes have besides their columns: rows of torque over time, and tables of their potentiometers."""

    torques: Floats
    torque_first: Indices
    torque_count: Indices
    curves: Floats
    curve_first: Indices
    curve_count: Indices


class Buses(NamedTuple):
    """Which lanes are on which bus, and what they remember together.

    The k-th bus has the lanes `which[first[k]:first[k + 1]]`; their memories and places among those that move together
    (−1: none) stand in the same order.
    """

    which: Indices
    first: Indices
    memories: Memories
    joined: Indices
    shared: Any
    status: Indices
    ended: Floats


def go_on(lanes: Lanes, tables: Tables, buses: Buses, begin: int, end: int, duration: float, until: float, seats: Any,
          mates: Any, written: Tape) -> int:
    """Let the buses from `begin` to before `end` go on for a duration, or to a time since their start [s].

    `until` is inf where the duration counts. A lane with a status is not on its bus. Seats there have to be for every
    servo of a bus, and twice as many mates. Return the status of the last bus: where it is `bus.PAUSED` the tape is
    full.
    """
    status = COMPLETED
    for k in range(begin, end):
        places = [j for j in range(buses.first[k], buses.first[k + 1]) if buses.status[j] == COMPLETED]
        if len(places) == 0:
            continue
        inputs, joined = [inputs_of(lanes, tables, buses.which[j]) for j in places], [buses.joined[j] for j in places]
        memories = _seated(lanes, buses, places, inputs, seats)
        if firmware.present(lanes.firmware[0]) and until == math.inf:
            for n in range(len(places)):
                controller.resume(inputs[n], memories[n])
        ends = [m.point.time + duration if until == math.inf else until - origin_of(m) for m in memories]
        status, when = bus.through(inputs, memories, ends, joined, buses.shared[k], seats, mates, written)
        if firmware.present(lanes.firmware[0]) and until == math.inf:
            for n in range(len(places)):
                controller.pause(inputs[n], memories[n])
        for n in range(len(places)):
            j = places[n]
            put_memory(buses.memories.rows[j], memories[n])
            buses.joined[j], buses.ended[j] = joined[n], when
            if status != COMPLETED and status != bus.PAUSED:
                buses.status[j] = status
    return status


def _seated(lanes: Lanes, buses: Buses, places: list[int], inputs: list[Inputs], seats: Any) -> list[Memory]:
    """Give lanes their seats, and return what they remember."""
    for n in range(len(places)):
        lane = buses.which[places[n]]
        crew.sit(seats[n], numbers_of(lanes, lane), chip_of(lanes, lane), inputs[n])
    return [memory_at(buses.memories, j) for j in places]


def inputs_of(lanes: Lanes, tables: Tables, lane: int) -> Inputs:
    """Return what a lane is told, and what hangs on its shaft."""
    first = tables.torque_first[lane]
    curve = tables.curves[:, tables.curve_first[lane]:tables.curve_first[lane] + tables.curve_count[lane]]
    return runs.inputs_of(lanes, curve, tables.torques[first:first + tables.torque_count[lane]], lane)


def look(lanes: Lanes, tables: Tables, buses: Buses, seats: Any, mates: Any, seen: Floats) -> None:
    """Look at all lanes as they stand; `seen` has a row of signals for each lane there is."""
    for k in range(len(buses.shared)):
        places = [j for j in range(buses.first[k], buses.first[k + 1]) if buses.status[j] == COMPLETED]
        if len(places) > 0:
            _look(lanes, tables, buses, k, places, seats, mates, seen)


def _look(lanes: Lanes, tables: Tables, buses: Buses, k: int, places: list[int], seats: Any, mates: Any,
          seen: Floats) -> None:
    told = [inputs_of(lanes, tables, buses.which[j]) for j in places]
    memories = _seated(lanes, buses, places, told, seats)
    for n in range(len(places)):
        memory = memories[n]
        crew.place(seats[n], memory, memory.point.time, memory.point.time, -1)
        seats[n].decided.silent = silent_now(memory)
    V = bus.bus_voltage(len(places), buses.shared[k], seats, mates, 0.0)
    for n in range(len(places)):
        memory, lane = memories[n], buses.which[places[n]]
        inputs, point, time, origin = told[n], memory.point, memory.point.time, origin_of(memory)
        path, share = seats[n].numbers.bridge, 1.0
        if duty.present(path):
            share = duty.share_of(path, seats[n].shown.duty)
        numbers = on_bus(crew.numbers_now(seats[n]), share * V)
        u = drive_of(seats[n]) * numbers.source.V
        piece, _ = in_force(inputs.torque, origin, time, inputs.constant_torque)
        tau, mode = since(piece, origin), point.mode
        if point.anchor_time == math.inf or piece != memory.tau:
            mode = step.anchored(numbers, Piece(0.0, u, 0.0, 0.0, 0.0, 0.0, 0.0), tau, time, point).mode
        shown = observed(warm(numbers, point.y), inputs.curve, mode, u, piece_value(tau, time), point.y, point.wiper,
                         memory.chip.drive, memory.chip.error)
        if firmware.present(lanes.firmware[0]):
            shown = told_by(numbers.bridge, memory.firm[0], shown)
        put(seen, lane, shown)
