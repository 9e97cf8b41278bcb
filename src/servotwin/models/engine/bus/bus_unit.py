"""A servo on a bus while it runs: where it stands, and what it does when left alone.

Each has a clock of its own, by which its frames come; the bus has that of the first. The end of a run, or of a
servo's present inputs, is the same instant by both clocks, however their difference is rounded. The functions take
records of `bus_records.Seat`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from servotwin.models.engine import controller, step
from servotwin.models.engine.bus import bus_records, coupled_motion
from servotwin.models.engine.bus.bus_records import (
    Track,
    decided_of,
    drive_of,
    mode_of,
    numbers_of,
    piece_of,
    point_of,
    put_chip,
    put_decided,
    put_mode,
    put_numbers,
    put_piece,
    put_point,
    put_track,
    vector_of,
)
from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.memory import NOT_ASKED, Inputs, Memory, Point, put_vector, since
from servotwin.models.engine.motions import choice, motion
from servotwin.models.engine.motions.motion import Motion
from servotwin.models.state.modes import Mode
from servotwin.models.terms import duty, firmware, frame
from servotwin.models.terms.control import told_by
from servotwin.models.terms.frame import Chip, Frame
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.sensor import wiper_at
from servotwin.physics.pieces import Piece

if TYPE_CHECKING:
    from servotwin.models.engine.bus.bus_records import Tape

_UNKNOWN = math.nan


def sit(seat: Any, numbers: Numbers, chip: Chip, inputs: Inputs) -> None:
    """Give a servo a seat."""
    put_numbers(seat.numbers, numbers)
    put_chip(seat.chip, chip)
    seat.period, seat.accuracy = inputs.period, inputs.accuracy


def remember(seat: Any, memory: Memory) -> None:
    """Put a servo where its memory says."""
    put_point(seat.point, memory.point)
    put_decided(seat.decided, memory.chip)
    if duty.present(seat.numbers.bridge):
        show(seat, memory.firm[0])
    put_piece(seat.u, memory.u)
    put_piece(seat.tau, memory.tau)
    seat.u_end, seat.tau_end, seat.frames, seat.beat = memory.u_end, memory.tau_end, memory.frames, memory.beat
    seat.origin = memory.frames * memory.beat


def memory_in(seat: Any, firms: Any) -> Memory:
    """Return what a servo remembers, with what its program does, of those of all, by reference."""
    return Memory(seat.frames, seat.beat, point_of(seat.point), decided_of(seat.decided), piece_of(seat.u), seat.u_end,
                  piece_of(seat.tau), seat.tau_end, NOT_ASKED, firms[seat.place:seat.place + 1])


def begin(seat: Any, first: float, end: float) -> None:
    """Begin a run to `end` by a servo's clock [s] where it stands, which is `first` by the bus's."""
    seat.clock, seat.late, seat.end = seat.point.time, seat.point.time - first, end
    seat.arrival = _UNKNOWN


def finish(seat: Any) -> None:
    """Note what a servo follows at the end of a run."""
    put_piece(seat.u, source(seat, numbers_now(seat)))
    seat.u_end = math.inf


def show(seat: Any, firm: Any) -> None:
    """Take over what shows of a program."""
    seat.shown.duty, seat.shown.goal, seat.shown.reference, seat.shown.trip = told_by(firm)


def source(seat: Any, numbers: Numbers) -> Piece:
    """Return the voltage behind the bridge of a servo that has these numbers now."""
    return Piece(0.0, drive_of(seat) * numbers.source.V, 0.0, 0.0, 0.0, 0.0, 0.0)


def is_known(arrival: float) -> bool:
    """Tell whether it is known when a servo has its next point."""
    return arrival == arrival


def heeds_silence(seat: Any) -> bool:
    """Tell whether the bridge is off in another way while no pulses come."""
    path = seat.numbers.bridge
    return bool(not duty.present(seat.numbers.bridge) and path.silence.coast != path.off.coast)


def numbers_now(seat: Any) -> Numbers:
    """Return the numbers of a servo with its bridge as it is now."""
    if duty.present(seat.numbers.bridge):
        return duty.at_duty(numbers_of(seat.numbers), seat.shown.duty)
    return step.at_pulses(numbers_of(seat.numbers), seat.decided.silent if heeds_silence(seat) else 0)


def is_connected(seat: Any) -> bool:
    """Tell whether a motor is connected to the bus, or may become so by itself."""
    if drive_of(seat) != 0.0:
        return True
    path = seat.numbers.bridge
    coast = path.silence.coast if seat.decided.silent > 0 else path.off.coast
    if duty.present(seat.numbers.bridge):
        coast = numbers_now(seat).bridge.off.coast
    return bool(coast > 0.0 and (seat.point.y.i != 0.0 or seat.point.y.w_m != 0.0))


def tau_by(seat: Any, origin: float) -> Piece:
    """Return the torque of a servo's load that depends on time alone, by the time since `origin` [s]."""
    return since(piece_of(seat.tau), origin)


def set_clock(seat: Any, time: float, until: float) -> None:
    """Set a servo's clock to a time of the bus [s], on which the run ends at `until`."""
    if time >= until:
        seat.clock = seat.end
    elif seat.due <= time:
        seat.clock = max(seat.clock, seat.limit)
    else:
        seat.clock = time + seat.late


def by_bus(seat: Any, time: float, until: float) -> float:
    """Return when it is this time by a servo's clock, by that of the bus, the end of the run at the latest [s]."""
    return until if time >= seat.end else float(min(time - seat.late, until))


def plan_ahead(seat: Any, edge: float, until: float) -> None:
    """Find out when chip and load do something next, where the next frame begins at `edge`."""
    switch = math.inf
    if not duty.present(seat.numbers.bridge):
        switch = frame.next_switch(decided_of(seat.decided), heeds_silence(seat))
    seat.edge, seat.switch = edge, min(switch, seat.tau_end)
    seat.limit = min(seat.switch, edge)
    seat.due = by_bus(seat, seat.limit, until)


def edge_of(seat: Any, inputs: Inputs, firms: Any) -> float:
    """Return when the next frame begins, or the next tick or duty comes, by the servo's clock [s]."""
    if firmware.present(inputs.firmware[0]):
        return controller.next_due(inputs.firmware[0], firms[seat.place], seat.frames)
    if seat.period > 0.0:
        return frame.edge_time(seat.period, inputs.edges, seat.decided.number - seat.frames)
    edge: float = frame.edge_time(0.0, inputs.edges, seat.decided.number) - seat.origin
    return edge


def forget(seat: Any) -> None:
    """Let the motion of a servo begin anew."""
    seat.point.anchor_time = math.inf
    seat.arrival = _UNKNOWN


def alone(seat: Any, until: float) -> int:
    """Find out what a servo does next when no other motor is connected to the bus; return a status."""
    numbers, tau, point = numbers_now(seat), tau_by(seat, seat.origin), point_of(seat.point)
    u = source(seat, numbers)
    if point.anchor_time == math.inf:
        point = step.anchored(numbers, u, tau, point.time, point)
        put_point(seat.point, point)
    after, m, event, status = step.onward(
        numbers, point, u, tau, motion.nothing(numbers, u, tau), True, seat.limit, seat.end,
        seat.accuracy)
    put_point(seat.ahead, after)
    put_track(seat.track, Track(m.kind, m.length, m.end, m.next_step))
    seat.event, seat.arrival = event, by_bus(seat, after.time, until)
    return status


def point_now(seat: Any, shared: Any, mates: Any, time: float) -> Point:
    """Return where a servo stands now, which is `time` by the clock of the bus [s]."""
    p, t = point_of(seat.point), seat.clock
    if t <= p.time:
        return p
    if seat.joined >= 0:
        y = coupled_motion.state_at(shared, mates[seat.joined], time - shared.begin)
    else:
        m = motion.prepared(motion_of(seat))
        y = motion.ended(m, t - m.t0)
    return Point(t, y, p.mode, p.anchor_time, p.anchor, p.step, wiper_of(seat, y.q))


def motion_of(seat: Any) -> Motion:
    """Return the motion of a servo that moves on its own."""
    p, numbers = point_of(seat.point), numbers_now(seat)
    return choice.begin(numbers, p.mode, source(seat, numbers), tau_by(seat, seat.origin), p.anchor_time, p.anchor,
                        p.step, seat.limit - p.anchor_time, seat.accuracy)


def wiper_of(seat: Any, q: float) -> float:
    """Return the angle of the potentiometer [rad] where the shaft has turned to q."""
    return wiper_at(numbers_of(seat.numbers).sensor, seat.point.wiper, q)


def move(seat: Any, unit: int, shared: Any, mates: Any, point: Point, event: int, written: Tape) -> None:
    """Advance a servo on its present motion to a point, where an event may be."""
    if bus_records.runs(written) and point.time > seat.point.time:
        if seat.joined >= 0:
            bus_records.write_together(written, unit, seat, point.time, shared, mates[seat.joined])
        else:
            bus_records.write_alone(written, unit, seat, point.time)
    if event >= 0:
        bus_records.write_event(written, unit, seat.origin + point.time, event, point.mode, point.y.q)
    put_point(seat.point, point)
    seat.arrival = _UNKNOWN


def bring(seat: Any, unit: int, shared: Any, mates: Any, time: float, written: Tape) -> None:
    """Advance a servo on its present motion to where it stands now."""
    if seat.clock > seat.point.time:
        move(seat, unit, shared, mates, point_now(seat, shared, mates, time), -1, written)


def hear(seat: Any, unit: int, now: Frame, written: Tape) -> None:
    """Take another state of a servo's chip from now on."""
    before, angle, time, heeds = decided_of(seat.decided), seat.point.y.q, seat.origin + seat.clock, (
        heeds_silence(seat))
    put_decided(seat.decided, now)
    nothing = Mode(0, 0, 0, 0, 0)
    if now.drive != before.drive:
        bus_records.write_event(written, unit, time, bus_records.DRIVES + int(now.drive), nothing, angle)
    if heeds and now.silent != before.silent:
        bus_records.write_event(written, unit, time, bus_records.SILENCE + now.silent, nothing, angle)
    if now.drive != before.drive or (heeds and now.silent != before.silent):
        forget(seat)


def obey(seat: Any, unit: int, firm: Any, written: Tape) -> None:
    """Take what a program has decided, from now on."""
    duty_before, trip_before = seat.shown.duty, seat.shown.trip
    show(seat, firm)
    if seat.shown.trip != trip_before:
        kind, still = bus_records.TRIPS + seat.shown.trip, Mode(0, 0, 0, 0, 0)
        bus_records.write_event(written, unit, seat.origin + seat.clock, kind, still, seat.point.y.q)
    if seat.shown.duty != duty_before:
        forget(seat)


def take_part(seat: Any, unit: int, mate: Any, start: Any, y: Any) -> None:
    """Let a servo that is connected to the bus take part in a common motion from a start, where it stands at y."""
    drive, now, numbers = drive_of(seat), vector_of(y), numbers_now(seat)
    returns = drive == 0.0
    put_numbers(mate.numbers, currents.on_stiff_source(numbers, returns))
    put_mode(mate.mode, mode_of(seat.point.mode))
    put_piece(mate.tau, tau_by(seat, seat.origin + seat.late))
    mate.unit, mate.returns = unit, 1 if returns else 0
    mate.sign = currents.part_on_bus(drive, numbers.bridge, seat.shown.duty, vector_of(start))
    put_vector(mate.start, vector_of(start))
    put_vector(mate.y, now)
