"""Kernels that let buses of servos go on, and look at them as they stand: their memories are records and arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import bus, runs, step, together
from servotwin.models.engine import crew as hands
from servotwin.models.engine.memory import (
    Inputs,
    Memory,
    in_force,
    memory_of,
    origin_of,
    put_memory,
    silent_now,
    since,
)
from servotwin.models.engine.observe import observed, on_bus
from servotwin.models.engine.sights import put
from servotwin.models.engine.step import COMPLETED
from servotwin.models.engine.tape import Tape
from servotwin.models.engine.tiles import chip_of, numbers_of
from servotwin.models.terms import frame
from servotwin.models.terms.numbers import warm
from servotwin.models.terms.source import Source
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
    V: Floats
    R_b: Floats
    I_max: Floats
    records: Any
    joined: Indices
    shared: Any
    status: Indices
    ended: Floats


def start(buses: Buses, of: Indices) -> None:
    """Let the buses `of` begin anew: nobody moves together."""
    for n in range(of.size):
        k = of[n]
        together.put_shared(buses.shared[k], together.at_start(_source(buses, k)))
        for j in range(buses.first[k], buses.first[k + 1]):
            buses.joined[j] = -1


def go_on(lanes: Lanes, tables: Tables, buses: Buses, begin: int, end: int, duration: float, until: float,
          written: Tape) -> int:
    """Let the buses from `begin` to before `end` go on for a duration, or to a time since their start [s].

    `until` is inf where the duration counts. A lane with a status is not on its bus. Return the status of the last bus:
    where it is `bus.PAUSED` the tape is full.
    """
    status = COMPLETED
    for k in range(begin, end):
        places = _alive(buses, k)
        if len(places) == 0:
            continue
        memories = [memory_of(buses.records[j]) for j in places]
        ends = [m.point.time + duration if until == math.inf else until - origin_of(m) for m in memories]
        status = _go_on(lanes, tables, buses, k, places, memories, ends, written)
    return status


def _go_on(lanes: Lanes, tables: Tables, buses: Buses, k: int, places: list[int], memories: list[Memory],
           ends: list[float], written: Tape) -> int:
    """Let a bus go on to the ends of its servos by their clocks [s]; return a status."""
    which = [buses.which[j] for j in places]
    inputs, joined = [inputs_of(lanes, tables, lane) for lane in which], [buses.joined[j] for j in places]
    numbers, chips = [numbers_of(lanes, lane) for lane in which], [chip_of(lanes, lane) for lane in which]
    status, when = bus.through(_source(buses, k), numbers, chips, inputs, memories, ends, joined, buses.shared[k],
                               written)
    for n in range(len(places)):
        j = places[n]
        put_memory(buses.records[j], memories[n])
        buses.joined[j] = joined[n]
        if status != COMPLETED and status != bus.PAUSED:
            buses.status[j], buses.ended[j] = status, when
    return status


def inputs_of(lanes: Lanes, tables: Tables, lane: int) -> Inputs:
    """Return what a lane is told, and what hangs on its shaft."""
    first = tables.torque_first[lane]
    curve = tables.curves[:, tables.curve_first[lane]:tables.curve_first[lane] + tables.curve_count[lane]]
    return runs.inputs_of(lanes, curve, tables.torques[first:first + tables.torque_count[lane]], lane)


def look(lanes: Lanes, tables: Tables, buses: Buses, seen: Floats) -> None:
    """Look at all lanes as they stand; `seen` has a row of signals for each lane there is."""
    for k in range(len(buses.shared)):
        places = _alive(buses, k)
        if len(places) > 0:
            _look(lanes, tables, buses, k, places, seen)


def _look(lanes: Lanes, tables: Tables, buses: Buses, k: int, places: list[int], seen: Floats) -> None:
    which = [buses.which[j] for j in places]
    memories = [memory_of(buses.records[j]) for j in places]
    inputs = [inputs_of(lanes, tables, lane) for lane in which]
    crew = hands.crew_of(_source(buses, k), [numbers_of(lanes, lane) for lane in which],
                         [chip_of(lanes, lane) for lane in which], inputs, memories, [m.point.time for m in memories])
    for n in range(len(which)):
        crew.decided[n] = frame.numbered(memories[n].chip, memories[n].chip.number, silent_now(memories[n]))
    V = hands.bus_voltage(crew)
    for n in range(len(which)):
        memory, now = memories[n], crew.decided[n]
        point, time = memory.point, memory.point.time
        numbers = on_bus(hands.numbers_now(crew, n), V)
        u = now.drive * numbers.source.V
        piece, _ = in_force(inputs[n].torque, origin_of(memory), time, inputs[n].constant_torque)
        tau = since(piece, origin_of(memory))
        mode = point.mode
        if point.anchor_time == math.inf or piece != memory.tau:
            mode = step.anchored(numbers, Piece(0.0, u, 0.0, 0.0, 0.0, 0.0, 0.0), tau, time, point).mode
        put(seen, which[n], observed(warm(numbers, point.y), inputs[n].curve, mode, u, piece_value(tau, time), point.y,
                                     point.wiper, now.drive, now.error))


def _alive(buses: Buses, k: int) -> list[int]:
    return [j for j in range(buses.first[k], buses.first[k + 1]) if buses.status[j] == COMPLETED]


def _source(buses: Buses, k: int) -> Source:
    return Source(buses.V[k], buses.R_b[k], buses.I_max[k])
