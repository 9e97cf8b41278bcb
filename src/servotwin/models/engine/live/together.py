"""Servos on one supply go on for a stretch of time, and are looked at on the way."""

from __future__ import annotations

from typing import Any

from servotwin.models.engine.bus import bus_unit, event_log, event_queue
from servotwin.models.engine.bus.bus_inputs import inputs_at
from servotwin.models.engine.bus.bus_records import drive_of, mode_of, numbers_of, piece_of, vector_of
from servotwin.models.engine.bus.event_log import Tape
from servotwin.models.engine.events import kinds
from servotwin.models.engine.live.posts import lines_of, put_said, said_of
from servotwin.models.engine.live.screen import (
    NEXT,
    TOO_LONG,
    USED,
    Looks,
    Said,
    Screen,
    is_late,
    note,
    switch_of,
    write,
)
from servotwin.models.engine.memory import instant, since
from servotwin.models.engine.observe import on_bus
from servotwin.models.engine.step import CHATTER, COMPLETED, MOST_IDLE, at_pulses, status_of
from servotwin.models.state.modes import Mode
from servotwin.models.terms import duty
from servotwin.models.terms.numbers import warm
from servotwin.physics.pieces import piece_value

PLAIN = True  # the compiler takes it for False
_LATE = 1e-12  # of an instant: so much before a tick it is the tick


def go_on(told: Any, posts: Any, firms: Any, shared: Any, seats: Any, mates: Any, looks: Looks, written: Tape,
          rows: Any, events: Any, used: Any) -> int:
    """Go on to `looks.until`; return a status.

    Servos have their seats and remember where they stand; what they are `told` is found by `inputs_at`. The tape has
    room for what servos do at once.
    """
    count = len(posts)
    for j in range(count):
        seat = seats[j]
        seat.until = instant(True, inputs_at(told, seat), bus_unit.memory_in(seat, firms), looks.until - seat.origin)
    if seats[0].point.time >= seats[0].until:
        return COMPLETED
    for j in range(count):
        event_queue.be_ready(inputs_at(told, seats[j]), seats[j], firms, shared, j == 0)
    first = seats[0].point.time
    for j in range(count):
        bus_unit.begin(seats[j], first, seats[j].until)
    status = _run(told, posts, firms, shared, seats, mates, looks, written, rows, events, used)
    for j in range(count):
        bus_unit.finish(seats[j])
    return status


def _run(told: Any, posts: Any, firms: Any, shared: Any, seats: Any, mates: Any, looks: Looks, written: Tape,
         rows: Any, events: Any, used: Any) -> int:
    """Go on to the end of the run, as `event_queue.run` does, and look on the way."""
    count, idle, status = len(posts), 0, COMPLETED
    time, until, origin = seats[0].clock, seats[0].end, seats[0].origin
    event_queue.take_up(count, shared, seats, mates)
    for j in range(count):
        bus_unit.plan_ahead(seats[j], bus_unit.edge_of(seats[j], inputs_at(told, seats[j]), firms), until)
    late = 1.0
    for j in range(count):
        late = 1.0 + _LATE if duty.present(seats[j].numbers.bridge) else late
    k = used[NEXT]
    while time < until:
        busy = False
        for j in range(count):
            busy = busy or seats[j].due <= time
        before = event_queue.bus_voltage(count, shared, seats, mates, time) if busy and looks.switches == 1 else 0.0
        for j in range(count):
            put_modes(posts[j], seats[j], mates)
        written.used[:] = 0
        status = event_queue.act(told, firms, count, shared, seats, mates, written, time, until)
        if status == COMPLETED:
            status = event_queue.carry_on(count, shared, seats, mates, written, time, until)
        if status != COMPLETED:
            return status
        if looks.switches == 1 and _switched(posts, seats):
            _see_all(told, posts, shared, seats, mates, time, origin + time, True, before, rows, events, used)
            V_bus = event_queue.bus_voltage(count, shared, seats, mates, time)
            _see_all(told, posts, shared, seats, mates, time, origin + time, False, V_bus, rows, events, used)
            k = k + 1 if k / looks.rate == origin + time else k
        for j in range(count):
            put_said(posts[j].said, said_by(seats[j]))
        following = event_queue.next_time(count, shared, seats, until)
        idle = idle + 1 if following == time else 0
        if idle > MOST_IDLE * count:
            return CHATTER
        if is_late(used, 0):
            return TOO_LONG
        at = k / looks.rate
        while at * late < origin + following and at < looks.until:
            _look(told, posts, shared, seats, mates, at - origin, at, rows, events, used)
            k += 1
            at = k / looks.rate
        time = following
        status = event_queue.come(count, shared, seats, mates, written, time, until)
        if PLAIN:
            rows[0].tell(origin + time)
        _note_all(written, events, rows, used)
        if status != COMPLETED:
            return status
    at = k / looks.rate
    while at < looks.until and (looks.at_end == 1 or late == 1.0):  # next to the end
        _look(told, posts, shared, seats, mates, until, at, rows, events, used)
        k += 1
        at = k / looks.rate
    if looks.at_end == 1:
        _look(told, posts, shared, seats, mates, until, looks.until, rows, events, used)
    for j in range(count):
        used[USED * j + NEXT] = k
    written.used[:] = 0
    for j in range(count):
        bus_unit.bring(seats[j], j, shared, mates, time, written)
        if status == COMPLETED:
            status = status_of(vector_of(seats[j].point.y))
    return status


def put_modes(post: Any, seat: Any, mates: Any) -> None:
    """Keep the mode in which a servo moves, before its bridge may switch."""
    mode = _mode_in(seat, mates)
    post.zone, post.contact, post.mesh, post.motor, post.share = mode


def _mode_in(seat: Any, mates: Any) -> Mode:
    return mode_of(mates[seat.joined].mode) if seat.joined >= 0 else mode_of(seat.point.mode)


def said_by(seat: Any) -> Said:
    """Return what shows of a chip or a program now."""
    now, shown = seat.decided, seat.shown
    if not duty.present(seat.numbers.bridge):
        return Said(now.drive, now.error, now.silent, 0.0, 0.0, 0.0, 0)
    return Said(drive_of(seat), now.error, now.silent, shown.duty, shown.goal, shown.reference, shown.trip)


def _switched(posts: Any, seats: Any) -> bool:
    """Tell whether a bridge drives in another way than at the latest look."""
    for j in range(len(posts)):
        said = said_of(posts[j].said)
        if said.silent >= 0 and switch_of(said) != switch_of(said_by(seats[j])):
            return True
    return False


def _look(told: Any, posts: Any, shared: Any, seats: Any, mates: Any, time: float, shown_at: float, rows: Any,
          events: Any, used: Any) -> None:
    """Look at all servos at a time of the bus [s], on their present motions."""
    for j in range(len(posts)):
        seat = seats[j]
        seat.before, seat.clock = seat.clock, min(time + seat.late, seat.end)
    V_bus = event_queue.bus_voltage(len(posts), shared, seats, mates, time)
    _see_all(told, posts, shared, seats, mates, time, shown_at, False, V_bus, rows, events, used)
    for j in range(len(posts)):
        seats[j].clock = seats[j].before


def _see_all(told: Any, posts: Any, shared: Any, seats: Any, mates: Any, time: float, shown_at: float, earlier: bool,
             V_bus: float, rows: Any, events: Any, used: Any) -> None:
    """Write a row of each servo where it stands, under a voltage of the bus [V]; `earlier`: before bridges switch."""
    for j in range(len(posts)):
        seat, post = seats[j], posts[j]
        screen = Screen(rows[j], events[j], used[USED * j:USED * j + USED])
        if screen.used[0] >= len(screen.rows):
            continue
        point = bus_unit.point_now(seat, shared, mates, time)
        y, said, mode = point.y, said_by(seat), _mode_in(seat, mates)
        if earlier and post.said.silent >= 0:
            said, mode = said_of(post.said), Mode(post.zone, post.contact, post.mesh, post.motor, post.share)
        plain = numbers_of(seat.numbers)
        own = duty.at_duty(plain, said.duty) if duty.present(plain.bridge) else at_pulses(plain, said.silent)
        own = warm(own, y)
        own = on_bus(own, V_bus * (duty.share_of(own.bridge, said.duty) if duty.present(plain.bridge) else 1.0))
        tau = piece_value(since(piece_of(seat.tau), seat.origin), seat.clock)
        write(screen, lines_of(post.lines), inputs_at(told, seat), said, own, mode, said.drive * own.source.V, tau, y,
              point.wiper, shown_at)


def _note_all(written: Tape, events: Any, rows: Any, used: Any) -> None:
    """Note what has happened that people are told of."""
    for n in range(written.used[1]):
        j, time, kind = int(written.events[n, 0]), written.events[n, 1], int(written.events[n, 2])
        code = kinds.NO_EVENT
        if kind >= 0:
            code = kinds.kind_of(kind, Mode(int(written.events[n, 3]), int(written.events[n, 4]), 0, 0, 0))
        elif event_log.SILENCE <= kind <= event_log.SILENCE + 1:
            code = kinds.SILENCE_ENDS + kind - event_log.SILENCE
        elif kind == event_log.REFUSED:
            code = kinds.REFUSED
        elif event_log.TRIPS <= kind < event_log.TRIPS + 5:
            code = kinds.TRIP_ENDS + kind - event_log.TRIPS
        if code != kinds.NO_EVENT:
            note(Screen(rows[j], events[j], used[USED * j:USED * j + USED]), time, code)
