"""Several servos on one source, from event to event of all of them in one queue.

As long as at most one motor is connected to the bus every servo moves on its own, by the laws of one alone. Where
several are, they move together until one of them, its chip or the source does something else.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine import controller, step
from servotwin.models.engine.bus import bus_records, bus_unit, coupled_motion, coupled_step
from servotwin.models.engine.bus.bus_records import (
    Tape,
    chip_of,
    decided_of,
    drive_of,
    lowest_of,
    mode_of,
    numbers_of,
    piece_of,
    point_of,
    put_lowest,
    put_mode,
    put_piece,
    source_of,
    vector_of,
)
from servotwin.models.engine.bus.coupled_motion import APART, ENDED, TOGETHER
from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.lanes import inputs_at
from servotwin.models.engine.memory import (
    FRAMES,
    SAME,
    Inputs,
    Lowest,
    Point,
    counted_anew,
    due,
    in_force,
    instant,
    put_vector,
    resumed,
    since,
)
from servotwin.models.engine.motions.motion import LONG_STEP
from servotwin.models.engine.run.lowest import asked, followed, lower
from servotwin.models.engine.step import CHATTER, COMPLETED, CROWDED, MOST_IDLE, STEP_TOO_SMALL, TOO_FAST
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms import control, duty, firmware, frame
from servotwin.models.terms.bridge import terminal_voltage
from servotwin.models.terms.control import NOTHING_SENSED, Sensed
from servotwin.models.terms.motor import inductive
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import sensed_voltage
from servotwin.physics.pieces import piece_value

PAUSED = -1  # as a status: the tape is full
_SPAN = 16.0  # s: then times count anew
_LONGEST = 1.0  # s, of a common motion: it may be one of constant speed without an end


def through(told: Any, firms: Any, count: int, shared: Any, seats: Any, mates: Any, written: Tape) -> tuple[int, float]:
    """Advance until servos have gone as far as their seats say; return a status, and when since the start.

    The first `count` seats are taken, by servos that remember where they stand; seats and `shared` are kept up to date.
    Their inputs in `told` are found by `told.inputs_at`, the states of their programs in `firms`, which have the next
    tick.
    """
    for j in range(count):
        seat = seats[j]
        seat.until = instant(True, inputs_at(told, seat), bus_unit.memory_in(seat, firms), seat.until)
    status, when = COMPLETED, seats[0].origin + seats[0].point.time
    while status == COMPLETED and seats[0].point.time < seats[0].until:
        for j in range(count):
            be_ready(inputs_at(told, seats[j]), seats[j], firms, shared, j == 0)
        first = seats[0].point.time
        last = seats[0].until <= first + _SPAN
        for j in range(count):
            seat = seats[j]
            bus_unit.begin(seat, first, seat.until if last else seat.point.time + _SPAN)
        status, time = run(told, firms, count, shared, seats, mates, written)
        when = seats[0].origin + time
        for j in range(count):
            bus_unit.finish(seats[j])
    return status, when


def be_ready(inputs: Inputs, seat: Any, firms: Any, shared: Any, first: bool) -> None:
    """Make a servo ready to continue, and its clock count from later on where that is due; the bus has the first's."""
    memory = resumed(True, inputs, bus_unit.memory_in(seat, firms), False)
    while due(memory):
        shift = FRAMES * memory.beat
        memory = counted_anew(memory)
        seat.until = instant(True, inputs, memory, seat.until - shift)  # or a tick next to it comes twice
        if first:
            shared.begin, shared.end = shared.begin - shift, shared.end - shift
    bus_unit.remember(seat, memory)


def run(told: Any, firms: Any, count: int, shared: Any, seats: Any, mates: Any, written: Tape) -> tuple[int, float]:
    """Advance to the end of the run, or until the tape is full; return a status and when, by the bus's clock [s]."""
    idle, status = 0, COMPLETED
    time, until = seats[0].clock, seats[0].end
    take_up(count, shared, seats, mates)
    for j in range(count):
        bus_unit.plan_ahead(seats[j], bus_unit.edge_of(seats[j], inputs_at(told, seats[j]), firms), until)
    while time < until:
        if bus_records.is_full(written, count):
            status = PAUSED
            break
        status = act(told, firms, count, shared, seats, mates, written, time, until)
        if status == COMPLETED:
            status = carry_on(count, shared, seats, mates, written, time, until)
        if status != COMPLETED:
            return status, time
        following = next_time(count, shared, seats, until)
        if asked(lowest_of(shared.lowest)) and following > time:
            put_lowest(shared.lowest, lowest_until(count, shared, seats, mates, time, following))
        idle = idle + 1 if following == time else 0
        if idle > MOST_IDLE * count:
            return CHATTER, time
        time = following
        status = come(count, shared, seats, mates, written, time, until)
        if status != COMPLETED:
            return status, time
    for j in range(count):
        bus_unit.bring(seats[j], j, shared, mates, time, written)
        if status == COMPLETED:
            status = step.status_of(vector_of(seats[j].point.y))
    return status, time


def take_up(count: int, shared: Any, seats: Any, mates: Any) -> None:
    """Take up the common motion that those who have joined are in, if their inputs are the same as then."""
    for j in range(count):
        if seats[j].joined >= 0 and seats[j].point.anchor_time == math.inf:
            shared.phase = APART
    if shared.phase == TOGETHER:
        for j in range(count):
            seat = seats[j]
            if seat.joined >= 0:
                bus_unit.take_part(seat, j, mates[seat.joined], seat.point.anchor, seat.point.anchor)
        coupled_motion.resume(shared, mates)


def next_time(count: int, shared: Any, seats: Any, until: float) -> float:
    """Return when anything happens next, by the clock of the bus [s]."""
    following = min(shared.end, until) if shared.phase == TOGETHER else until
    for j in range(count):
        arrival = seats[j].arrival
        following = min(following, arrival if bus_unit.is_known(arrival) else seats[j].due)
    return float(following)


def lowest_until(count: int, shared: Any, seats: Any, mates: Any, time: float, following: float) -> Lowest:
    """Return the least voltage of the bus after it has advanced from a time to the following, by its clock [s]."""
    lowest, origin, connected = lowest_of(shared.lowest), seats[0].origin, -1
    if shared.phase == TOGETHER:
        return coupled_motion.lowest_between(lowest, shared, mates, origin + shared.begin, time - shared.begin,
                                             following - shared.begin)
    for j in range(count):
        connected = j if bus_unit.is_connected(seats[j]) else connected
    if connected < 0:
        return lower(lowest, source_of(shared.source).V, origin + time)
    seat = seats[connected]
    share = duty.share_of(seat.numbers.bridge, seat.shown.duty) if duty.present(seat.numbers.bridge) else 1.0
    m = bus_unit.motion_of(seat)
    return followed(lowest, m, share, origin + time - seat.clock, seat.clock, seat.clock + (following - time))


def come(count: int, shared: Any, seats: Any, mates: Any, written: Tape, time: float, until: float) -> int:
    """Let all clocks show a time of the bus [s], and those arrive that have got somewhere; return a status."""
    for j in range(count):
        seat = seats[j]
        if bus_unit.is_known(seat.arrival) and seat.arrival <= time:
            seat.clock = seat.ahead.time
            bus_unit.move(seat, j, shared, mates, point_of(seat.ahead), seat.event, written)
        else:
            bus_unit.set_clock(seat, time, until)
    if shared.phase != TOGETHER or shared.end > time:
        return COMPLETED
    mode = coupled_motion.arrive(shared, mates)
    for k in range(shared.members):
        mate, own = mates[k], k == shared.whose
        seat, y = seats[mate.unit], vector_of(mate.y)
        if step.status_of(y) != COMPLETED:
            return step.status_of(y)
        t = seat.clock
        point = Point(t, y, mode if own else mode_of(mate.mode), t, y, seat.point.step, bus_unit.wiper_of(seat, y.q))
        bus_unit.move(seat, mate.unit, shared, mates, point, shared.kind if own else -1, written)
    return COMPLETED


# --- what chips and loads do ------------------------------------------------------------------------------------------


def act(told: Any, firms: Any, count: int, shared: Any, seats: Any, mates: Any, written: Tape, time: float,
         until: float) -> int:
    """Do what is due at a time of the bus [s]: first switch, then measure, then put new duties on; return a status."""
    busy = False
    for j in range(count):
        seat = seats[j]
        if seat.due <= time:
            busy, inputs = True, inputs_at(told, seat)
            if seat.switch <= seat.clock:
                bus_unit.bring(seat, j, shared, mates, time, written)
                _switch(inputs, seat, j, written)
                bus_unit.plan_ahead(seat, seat.edge, until)
            if firmware.present(inputs.firmware[0]) and seat.due <= time:
                _apply(inputs, firms[seat.place], j, shared, seats, mates, written, time)
    if not busy:
        return COMPLETED
    for j in range(count):
        seat = seats[j]
        if seat.due <= time and seat.edge <= seat.clock:
            inputs = inputs_at(told, seat)
            if firmware.present(inputs.firmware[0]):
                _tick(inputs, firms[seat.place], j, count, shared, seats, mates, time)
                continue
            _measure(inputs, j, count, shared, seats, mates, written, time)
            if seat.decided.number == frame.CROWDED:
                return CROWDED
            bus_unit.plan_ahead(seat, bus_unit.edge_of(seat, inputs, firms), until)
    for j in range(count):
        seat = seats[j]
        if seat.due <= time and seat.edge <= seat.clock:
            inputs = inputs_at(told, seat)
            if firmware.present(inputs.firmware[0]):
                _apply(inputs, firms[seat.place], j, shared, seats, mates, written, time)
                bus_unit.plan_ahead(seat, bus_unit.edge_of(seat, inputs, firms), until)
    return COMPLETED


def _switch(inputs: Inputs, seat: Any, unit: int, written: Tape) -> None:
    """Let a servo's bridge and load do what they do now."""
    now = seat.clock
    if not duty.present(seat.numbers.bridge):
        bus_unit.hear(seat, unit, frame.switched(decided_of(seat.decided), now), written)
    if seat.tau_end <= now:
        before = piece_of(seat.tau)
        tau, seat.tau_end = in_force(inputs.torque, seat.origin, now, inputs.constant_torque)
        put_piece(seat.tau, tau)
        if tau != before:
            bus_unit.forget(seat)


def _measure(inputs: Inputs, j: int, count: int, shared: Any, seats: Any, mates: Any, written: Tape,
             time: float) -> None:
    """Let a servo's chip measure at the edge of a pulse."""
    seat = seats[j]
    chip, now, origin = chip_of(seat.chip), seat.clock, seat.origin
    piece, _ = in_force(inputs.command, origin, now + SAME * seat.beat, 0.0)
    t_in = piece_value(since(piece, origin), now)
    here = bus_unit.point_now(seat, shared, mates, time)
    if not frame.accepted(chip, t_in):
        bus_records.write_event(written, j, origin + now, bus_records.REFUSED, Mode(0, 0, 0, 0, 0), here.y.q)
    v_m, V_bus = 0.0, chip.V_oc
    if chip.beta != 0.0 or chip.c_s != 0.0:
        _, v_m, V_bus = _currents(j, count, shared, seats, mates, here.y, time)
    v_o = sensed_voltage(numbers_of(seat.numbers).sensor, inputs.curve, here.wiper)
    after = frame.edge(chip, decided_of(seat.decided), now, t_in, v_o, v_m, V_bus, inputs.seed)
    if after.silent != seat.decided.silent and bus_unit.heeds_silence(seat):
        bus_unit.bring(seat, j, shared, mates, time, written)
    bus_unit.hear(seat, j, after, written)


def _apply(inputs: Inputs, firm: Any, j: int, shared: Any, seats: Any, mates: Any, written: Tape,
           time: float) -> None:
    """Put the duties of a servo's program on its bridge whose time has come."""
    seat, program = seats[j], inputs.firmware[0]
    bus_unit.bring(seat, j, shared, mates, time, written)
    controller.apply(program, firm, seat.frames, seat.clock + SAME * program.T_c)
    bus_unit.obey(seat, j, firm, written)


def _tick(inputs: Inputs, firm: Any, j: int, count: int, shared: Any, seats: Any, mates: Any, time: float) -> None:
    """Let a servo's program decide where a tick is due."""
    seat, program = seats[j], inputs.firmware[0]
    if not controller.is_due(program, firm, seat.frames, seat.clock + SAME * program.T_c):
        return
    sensed = NOTHING_SENSED
    if control.senses(program):
        sensed = _sensed(j, count, shared, seats, mates, vector_of(seat.point.y), time)
    point = point_of(seat.point)
    controller.work(inputs, numbers_of(seat.numbers).sensor, firm, point.y.q, point.wiper, sensed,
                    seat.origin + seat.clock)


def _sensed(j: int, count: int, shared: Any, seats: Any, mates: Any, y: Vector, time: float) -> Sensed:
    """Return what a program measures besides its angle."""
    now, seat = seats[j].shown.duty, seats[j]
    i, _, V_bus = _currents(j, count, shared, seats, mates, y, time)
    numbers = warm(numbers_of(seat.numbers), y)
    return controller.sensed_of(numbers, i / duty.on_share_of(numbers.bridge, now), V_bus, y)


def _currents(j: int, count: int, shared: Any, seats: Any, mates: Any, y: Vector,
              time: float) -> tuple[float, float, float]:
    """Return the current of a servo [A], and the voltages at its motor and of the bus [V]."""
    seat = seats[j]
    own, drive, others, last = bus_unit.numbers_now(seat), drive_of(seat), 0, -1
    for k in range(count):
        if k != j and bus_unit.is_connected(seats[k]):
            others, last = others + 1, k
    if others == 0:
        return _alone_on_bus(seat, own, y)
    if others == 1 and not bus_unit.is_connected(seat):
        there = bus_unit.point_now(seats[last], shared, mates, time)
        V_bus = _alone_on_bus(seats[last], bus_unit.numbers_now(seats[last]), there.y)[2]
    else:
        V_bus = bus_voltage(count, shared, seats, mates, time)
    stiff = warm(currents.on_stiff_source(own, False), y)
    u = currents.part_on_bus(drive, own.bridge, seat.shown.duty, y) * V_bus if drive != 0.0 else 0.0
    zone = currents.zone_of(stiff, u, 0.0, y.q, y.w_m, y.i)
    i = y.i if inductive(stiff.motor) else currents.current(stiff, zone, u, y.q, y.w_m)
    return i, terminal_voltage(stiff.bridge, stiff.source, stiff.motor, u, y.w_m, i, V_bus), V_bus


def _alone_on_bus(seat: Any, numbers: Numbers, y: Vector) -> tuple[float, float, float]:
    """Return the same where no other motor is connected to the bus."""
    i, v, V_bus = step.circuit(numbers, drive_of(seat) * numbers.source.V, y)
    return i, v, V_bus / duty.share_of(numbers.bridge, seat.shown.duty) if duty.present(seat.numbers.bridge) else V_bus


def bus_voltage(count: int, shared: Any, seats: Any, mates: Any, time: float) -> float:
    """Return V_bus [V] under the currents of all servos as they stand now; mates after the first `count` are used."""
    source, connected = source_of(shared.source), 0
    others = mates[count:]  # those that move together stay as they are
    for k in range(count):
        seat = seats[k]
        if bus_unit.is_connected(seat):
            y = bus_unit.point_now(seat, shared, mates, time).y
            bus_unit.take_part(seat, k, others[connected], y, y)
            connected += 1
    return coupled_step.put_in_zones(source, others, connected, source.V)[1]


# --- motions ----------------------------------------------------------------------------------------------------------


def carry_on(count: int, shared: Any, seats: Any, mates: Any, written: Tape, time: float, until: float) -> int:
    """Take up motions where there are none, or no longer the right ones; return a status."""
    status, kept, before, connected = COMPLETED, True, False, 0
    for j in range(count):
        connected += 1 if bus_unit.is_connected(seats[j]) else 0
    for j in range(count):
        seat = seats[j]
        member = connected > 1 and bus_unit.is_connected(seat)
        kept = kept and member == (seat.joined >= 0) and not (member and seat.point.anchor_time == math.inf)
        before = before or seat.joined >= 0
    if (connected > 1 or before) and not (kept and shared.phase == TOGETHER):
        same = kept and shared.phase == ENDED
        _leave(count, shared, seats, mates, same, written, time)
        if connected > 1:
            _join(count, shared, seats, mates, same, written, time)
            if shared.length < 0.0:
                return STEP_TOO_SMALL if shared.how == LONG_STEP else TOO_FAST
    for j in range(count):
        if seats[j].joined < 0 and not bus_unit.is_known(seats[j].arrival):
            how = bus_unit.alone(seats[j], until)
            status = how if how != COMPLETED else status
    return status


def _leave(count: int, shared: Any, seats: Any, mates: Any, same: bool, written: Tape, time: float) -> None:
    """Let those who have joined leave; the `same` are about to join again."""
    for j in range(count):
        seat = seats[j]
        if seat.joined >= 0:
            bus_unit.bring(seat, j, shared, mates, time, written)
            seat.joined = -1
            if not same:
                bus_unit.forget(seat)
    shared.phase = APART


def _join(count: int, shared: Any, seats: Any, mates: Any, same: bool, written: Tape, time: float) -> None:
    """Let all who are connected move together from now on."""
    limit, members = time + _LONGEST, 0
    for j in range(count):
        seat = seats[j]
        if bus_unit.is_connected(seat):
            bus_unit.bring(seat, j, shared, mates, time, written)
            limit = min(limit, seat.switch - seat.late)
            bus_unit.take_part(seat, j, mates[members], seat.point.y, seat.point.y)
            members += 1
    shared.members = members
    coupled_motion.begin(shared, mates, time, max(limit, time), same)
    for k in range(members):
        mate = mates[k]
        seat = seats[mate.unit]
        point = seat.point
        point.time = point.anchor_time = seat.clock
        put_mode(point.mode, mode_of(mate.mode))
        put_vector(point.anchor, vector_of(point.y))
        seat.joined, seat.arrival = k, math.nan
