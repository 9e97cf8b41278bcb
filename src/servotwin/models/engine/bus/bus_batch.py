"""Kernels that advance buses of servos, and look at them as they stand: their memories are records and arrays."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from servotwin.models.engine import controller, step
from servotwin.models.engine.batch.observe_batch import put
from servotwin.models.engine.bus import bus_unit, coupled_step, event_queue
from servotwin.models.engine.bus.bus_records import (
    Tape,
    drive_of,
    lowest_of,
    numbers_of,
    put_numbers,
    put_point,
    runs,
    source_of,
)
from servotwin.models.engine.bus.coupled_motion import APART
from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.lanes import Tables, Told, chip_of, inputs_at
from servotwin.models.engine.lanes import numbers_of as numbers_at
from servotwin.models.engine.legs import coupled_ticks
from servotwin.models.engine.legs.coupled_units import put_unit_numbers, unit_state
from servotwin.models.engine.memory import (
    FRAMES,
    Memories,
    Memory,
    Point,
    counted_anew,
    due,
    in_force,
    instant,
    memory_at,
    origin_of,
    put_memory,
    put_vector,
    resumed,
    silent_now,
    since,
    time_of,
)
from servotwin.models.engine.observe import observed, on_bus, told_by
from servotwin.models.engine.run.lowest import asked
from servotwin.models.engine.step import COMPLETED
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms import duty, firmware
from servotwin.models.terms.numbers import warm
from servotwin.physics.pieces import Piece, piece_value

if TYPE_CHECKING:
    from servotwin.models.engine.lanes import Floats, Indices, Lanes


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
          mates: Any, units: Any, common: Any, written: Tape) -> int:
    """Advance the buses from `begin` to before `end` by a duration, or to a time since their start [s].

    `until` is inf where the duration counts. A lane with a status is not on its bus. Seats there have to be for every
    servo of a bus, as many units, and twice as many mates. Return the status of the last bus: where it is `bus.PAUSED`
    the tape is full.
    """
    told, status = Told(lanes, tables), COMPLETED
    for k in range(begin, end):
        count = _seated(told, buses, k, seats)
        if count > 0:
            status = _go_on(told, buses, k, count, duration, until, seats, mates, units, common[0], written)
    return status


def _go_on(told: Told, buses: Buses, k: int, count: int, duration: float, until: float, seats: Any, mates: Any,
           units: Any, common: Any, written: Tape) -> int:
    """Advance the servos of a bus that have their seats; return a status."""
    firms, paused = buses.memories.firms, firmware.present(told.lanes.firmware[0]) and until == math.inf
    for n in range(count):
        seat = seats[n]
        if paused:
            controller.resume(inputs_at(told, seat), bus_unit.memory_in(seat, firms))
        seat.until = seat.point.time + duration if until == math.inf else until - seat.origin
    if not runs(written) and not asked(lowest_of(buses.shared[k].lowest)):
        _from_tick_to_tick(told, firms, count, buses.shared[k], seats, units, common)
    status, when = event_queue.through(told, firms, count, buses.shared[k], seats, mates, written)
    for n in range(count):
        seat = seats[n]
        memory, j = bus_unit.memory_in(seat, firms), seat.place
        if paused:
            controller.pause(inputs_at(told, seat), controller.of(memory), time_of(memory))
        put_memory(buses.memories.rows[j], memory)
        buses.joined[j], buses.ended[j] = seat.joined, when
        if status != COMPLETED and status != event_queue.PAUSED:
            buses.status[j] = status
    return status


def _from_tick_to_tick(told: Told, firms: Any, count: int, shared: Any, seats: Any, units: Any, common: Any) -> None:
    """Advance servos with programs from tick to tick as far as that leads."""
    for n in range(count):
        if not coupled_ticks.possible(numbers_of(seats[n].numbers), inputs_at(told, seats[n])):
            return
    for n in range(count):
        seat, unit = seats[n], units[n]
        memory = resumed(True, inputs_at(told, seat), bus_unit.memory_in(seat, firms), False)
        seat.until = instant(True, inputs_at(told, seat), memory, seat.until)
        unit.place, unit.lane = seat.place, seat.lane
        put_unit_numbers(unit.given, numbers_of(seat.numbers))
        bus_unit.remember(seat, memory)
    coupled_ticks.put_source(common, source_of(shared.source))
    going = True
    while going:
        for n in range(count):
            _sit(inputs_at(told, seats[n]), bus_unit.memory_in(seats[n], firms), seats[n], units[n])
        coupled_ticks.go(told, firms, count, units, common)
        going = False
        for n in range(count):
            going = _got_up(seats[n], units[n]) or going
    shared.phase, shared.jumped = APART, 1


def _sit(inputs: Any, memory: Memory, seat: Any, unit: Any) -> None:
    """Put a servo where it advances from tick to tick."""
    if due(memory):
        seat.until -= FRAMES * memory.beat
        memory = counted_anew(memory)
        seat.until = instant(True, inputs, memory, seat.until)
        bus_unit.remember(seat, memory)
    coupled_ticks.sit(unit, inputs, memory, seat.until)


def _got_up(seat: Any, unit: Any) -> bool:
    """Put a servo's record where it has gone from tick to tick; return whether it only has to count anew to continue.

    Its motion begins anew, also where no time has gone by: its program may have worked.
    """
    y, went = unit_state(unit.y), unit.time > seat.point.time
    put_point(seat.point, Point(unit.time, y, Mode(0, 0, unit.mesh, 0, 0), math.inf, y, seat.point.step, y.q))
    seat.joined = -1
    return bool(went and FRAMES * seat.beat <= unit.time < seat.until)


def _seated(told: Told, buses: Buses, k: int, seats: Any) -> int:
    """Give the lanes of a bus that have no status yet their seats, where they remember; return how many there are."""
    count = 0
    for j in range(buses.first[k], buses.first[k + 1]):
        if buses.status[j] == COMPLETED:
            seat, lane = seats[count], buses.which[j]
            seat.place, seat.lane, seat.joined = j, lane, buses.joined[j]
            bus_unit.sit(seat, numbers_at(told.lanes, lane), chip_of(told.lanes, lane), inputs_at(told, seat))
            bus_unit.remember(seat, memory_at(buses.memories, j))
            count += 1
    return count


def look(lanes: Lanes, tables: Tables, buses: Buses, seats: Any, mates: Any, seen: Floats) -> None:
    """Look at all lanes as they stand; `seen` has a row of signals for each lane there is."""
    told = Told(lanes, tables)
    for k in range(len(buses.shared)):
        count = _seated(told, buses, k, seats)
        if count > 0:
            _look(told, buses, k, count, seats, mates, seen)


def _look(told: Told, buses: Buses, k: int, count: int, seats: Any, mates: Any, seen: Floats) -> None:
    firms = buses.memories.firms
    for n in range(count):
        seat = seats[n]
        seat.decided.silent, seat.joined = silent_now(bus_unit.memory_in(seat, firms)), -1
        bus_unit.begin(seat, seat.point.time, seat.point.time)
    V = event_queue.bus_voltage(count, buses.shared[k], seats, mates, 0.0)
    for n in range(count):
        seat = seats[n]
        memory, inputs, path, share = bus_unit.memory_in(seat, firms), inputs_at(told, seat), seat.numbers.bridge, 1.0
        point, time, origin = memory.point, memory.point.time, origin_of(memory)
        if duty.present(path):
            share = duty.share_of(path, seat.shown.duty)
        numbers = on_bus(bus_unit.numbers_now(seat), share * V)
        u = drive_of(seat) * numbers.source.V
        piece, _ = in_force(inputs.torque, origin, time, inputs.constant_torque)
        tau, mode = since(piece, origin), point.mode
        if point.anchor_time == math.inf or piece != memory.tau:
            mode = step.anchored(numbers, Piece(0.0, u, 0.0, 0.0, 0.0, 0.0, 0.0), tau, time, point).mode
        shown = observed(warm(numbers, point.y), inputs.curve, mode, u, piece_value(tau, time), point.y, point.wiper,
                         memory.chip.drive, memory.chip.error)
        if firmware.present(told.lanes.firmware[0]):
            shown = told_by(numbers.bridge, memory.firm[0], shown)
        put(seen, seat.lane, shown)


def voltages(lanes: Lanes, shared: Any, mates: Any, states: Floats, found: Floats) -> None:
    """Put in `found` the voltage of one bus at each of some instants, from where its servos stand there [V].

    `states` has a row for each servo at each instant: state, drive, duty, and 1 while pulses stay away from it. There
    have to be twice as many mates as servos.
    """
    source, count = source_of(shared[0].source), len(states) // len(found)
    for k in range(count):
        put_numbers(mates[count + k].numbers, numbers_at(lanes, k))
    for n in range(len(found)):
        connected = 0
        for k in range(count):
            r = n * count + k
            y = Vector(states[r, 0], states[r, 1], states[r, 2], states[r, 3], states[r, 4], states[r, 5], states[r, 6])
            drive, now = states[r, 7], states[r, 8]
            numbers = numbers_of(mates[count + k].numbers)
            if duty.present(numbers.bridge):
                numbers = duty.at_duty(numbers, now)
            else:
                numbers = step.at_pulses(numbers, int(states[r, 9]))
            if currents.is_connected(numbers, drive, y):
                mate = mates[connected]
                put_numbers(mate.numbers, currents.on_stiff_source(numbers, drive == 0.0))
                put_vector(mate.y, y)
                mate.sign = currents.part_on_bus(drive, numbers.bridge, now, y)
                mate.returns = 1 if drive == 0.0 else 0
                connected += 1
        found[n] = coupled_step.put_in_zones(source, mates, connected, source.V)[1]
