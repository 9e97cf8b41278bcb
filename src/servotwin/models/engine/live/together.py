"""Servos on one supply run for a stretch of time, and are looked at on the way: what shows follows from their log."""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine import controller
from servotwin.models.engine.bus import bus_records, bus_unit, coupled_step, event_queue
from servotwin.models.engine.bus.bus_records import Tape, numbers_of, put_numbers, put_shared, source_of
from servotwin.models.engine.bus.coupled_motion import at_start
from servotwin.models.engine.dynamics import currents
from servotwin.models.engine.events import crossings
from servotwin.models.engine.lanes import Lanes, Tables, Told, inputs_at
from servotwin.models.engine.live.posts import chip_of as chip_in
from servotwin.models.engine.live.posts import lines_of, low_of, put_low, put_said, said_of
from servotwin.models.engine.live.posts import numbers_of as numbers_in
from servotwin.models.engine.live.screen import (
    LEFT,
    NEXT,
    NO_LOW,
    TOO_LONG,
    USED,
    Looks,
    Low,
    Said,
    Screen,
    note,
    said_by,
    switch_of,
    taken_up,
    write,
)
from servotwin.models.engine.log import Row
from servotwin.models.engine.memory import FLAT, Memories, memory_at, put_memory, put_vector, resumed, time_of
from servotwin.models.engine.motions import motion
from servotwin.models.engine.observe import on_bus
from servotwin.models.engine.run.at import motion_of, row_at, state_of
from servotwin.models.engine.run.lowest import ROUNDS
from servotwin.models.engine.step import COMPLETED, at_pulses
from servotwin.models.state.modes import Mode, Vector
from servotwin.models.terms import duty, source
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import wiper_at
from servotwin.models.terms.source import Source
from servotwin.physics.pieces import piece_value

PLAIN = True  # the compiler takes it for False
_NEAR = 1e-6  # of the time between two looks: to tell whether the voltage falls
_LATE = 1.0 + 1e-12  # of an instant: so much before a tick it is the tick


def advance(posts: Any, memories: Memories, lanes: Lanes, tables: Tables, shared: Any, seats: Any, mates: Any,
            looks: Looks, written: Tape, rows: Any, events: Any, used: Any) -> int:
    """Advance to `looks.until` from where servos remember; return a status.

    Each is lane and post of the same place; where a post has `changed`, every motion begins anew.
    """
    told, others = Told(lanes, tables), False
    for n in range(len(posts)):
        seats[n].place, seats[n].lane = n, n
        others = others or posts[n].changed == 1
    for n in range(len(posts)):
        post, seat, inputs = posts[n], seats[n], inputs_at(told, seats[n])
        memory = memory_at(memories, n)
        if duty.present(post.numbers.bridge):
            beat = memory.beat
            memory = resumed(True, inputs, memory, False)
            controller.resume(inputs, memory)
            others = others or memory.beat != beat
        bus_unit.sit(seat, numbers_in(post.numbers), chip_in(post.chip), inputs)
        bus_unit.remember(seat, memory)
        post.changed = 0
    if others:
        for n in range(len(posts)):
            bus_unit.forget(seats[n])
            seats[n].joined = -1
        own = posts[0].numbers.source
        put_shared(shared[0], at_start(Source(own.V, own.R_b, own.I_max)))
    status = go_on(told, posts, memories.firms, shared[0], seats, mates, looks, written, rows, events, used)
    for n in range(len(posts)):
        memory = bus_unit.memory_in(seats[n], memories.firms)
        if duty.present(posts[n].numbers.bridge):
            controller.pause(inputs_at(told, seats[n]), controller.of(memory), time_of(memory))
        put_memory(memories.rows[n], memory)
    return status


def go_on(told: Any, posts: Any, firms: Any, shared: Any, seats: Any, mates: Any, looks: Looks, written: Tape,
          rows: Any, events: Any, used: Any) -> int:
    """Advance to `looks.until`; return a status.

    Servos have their seats and remember where they stand; their inputs in `told` are found by `inputs_at`. The tape has
    room for what servos do at once.
    """
    k, status, low = looks.next, event_queue.PAUSED, low_of(posts[0].low)
    for j in range(len(posts)):
        seats[j].until = looks.until - seats[j].origin
    while status == event_queue.PAUSED:
        written.used[0], written.used[1], written.used[2] = 0, 0, 0
        status, when = event_queue.through(told, firms, len(posts), shared, seats, mates, written)
        if used[LEFT] > 0:
            used[LEFT] = max(used[LEFT] - written.used[0], 0)
            if used[LEFT] == 0 and status == event_queue.PAUSED:
                status = TOO_LONG
        if written.used[0] > 0:
            k, low = _show(told, posts, shared, seats, mates, looks, written, k, low, status == COMPLETED, rows, events,
                           used)
        _note_all(written, events, rows, used)
        if PLAIN:
            rows[0].tell(when)
    put_low(posts[0].low, low)
    for j in range(len(posts)):
        used[USED * j + NEXT] = k
    return status


def _show(told: Any, posts: Any, shared: Any, seats: Any, mates: Any, looks: Looks, written: Tape, k: int, low: Low,
          ends: bool, rows: Any, events: Any, used: Any) -> tuple[int, Low]:
    """Write what shows of all motions of a tape; return the number of the next look, and the least voltage since."""
    falls, late, seen = looks.switches == 1 and source.falls(source_of(shared.source)), 1.0, 0.0
    for j in range(len(posts)):
        posts[j].row = -1
        late = _LATE if duty.present(seats[j].numbers.bridge) else late
    last = row_at(written.motions, written.used[0] - 1)
    end, going = last.origin + last.end, True
    while going:
        begins = _next_begin(written, posts)
        time = k / looks.rate
        if posts[0].row >= 0 and time * late < min(begins, end) and time < looks.until:
            if falls:
                low = _lowered(told, posts, shared, seats, mates, written, seen, time, low, rows, events, used)
                low = _taken_up(posts, shared, seats, mates, written, time, False, low, rows, events, used)
                seen = time
            _see_all(told, posts, shared, seats, mates, written, time, time, False, rows, events, used)
            k += 1
        elif begins < math.inf:
            if falls and posts[0].row >= 0:
                low = _lowered(told, posts, shared, seats, mates, written, seen, begins, low, rows, events, used)
            switched = _enter(written, posts, begins)
            if switched and looks.switches == 1:
                if falls:
                    low = _taken_up(posts, shared, seats, mates, written, begins, True, low, rows, events, used)
                _see_all(told, posts, shared, seats, mates, written, begins, begins, True, rows, events, used)
            _take_over(written, posts)
            if switched and looks.switches == 1:
                _see_all(told, posts, shared, seats, mates, written, begins, begins, False, rows, events, used)
                low = NO_LOW
                k = k + 1 if k / looks.rate <= begins * late else k
            if falls and low.voltage == math.inf:
                low = Low(_voltage(posts, shared, seats, mates, written, begins, False), 0)
            seen = begins
        else:
            going = False
    if falls:
        low = _lowered(told, posts, shared, seats, mates, written, seen, end, low, rows, events, used)
    if ends:
        time = k / looks.rate
        if falls and (looks.at_end == 1 or (time < looks.until and late == 1.0)):
            low = _taken_up(posts, shared, seats, mates, written, end, False, low, rows, events, used)
        while time < looks.until and (looks.at_end == 1 or late == 1.0):  # next to the end
            _see_all(told, posts, shared, seats, mates, written, end, time, False, rows, events, used)
            k += 1
            time = k / looks.rate
        if looks.at_end == 1:
            _see_all(told, posts, shared, seats, mates, written, end, looks.until, False, rows, events, used)
    return k, low


def _lowered(told: Any, posts: Any, shared: Any, seats: Any, mates: Any, written: Tape, a: float, b: float, low: Low,
             rows: Any, events: Any, used: Any) -> Low:
    """Return the least voltage after all have advanced between two times [s]; rows of it are written.

    It lies between them where it falls at the first and rises at the other.
    """
    if not b > a:
        return low
    least, at, near = _voltage(posts, shared, seats, mates, written, a, False), a, _NEAR * (b - a)
    last = _voltage(posts, shared, seats, mates, written, b, False)
    after = _voltage(posts, shared, seats, mates, written, a + near, False)
    before = _voltage(posts, shared, seats, mates, written, b - near, False)
    if after < least and before < last:
        first, end = a, b
        for _ in range(ROUNDS):
            third = (end - first) / 3.0
            after = _voltage(posts, shared, seats, mates, written, first + third, False)
            before = _voltage(posts, shared, seats, mates, written, end - third, False)
            if after < before:
                end -= third
            else:
                first += third
        least, at = min(after, before), 0.5 * (first + end)
    elif last < least:
        least, at = last, b
    if not least < low.voltage - FLAT or used[0] >= len(rows[0]) - 1:
        return low
    _see_all(told, posts, shared, seats, mates, written, at, at, False, rows, events, used)
    for j in range(len(posts)):
        used[USED * j] -= 1
    return Low(least, 1)


def _taken_up(posts: Any, shared: Any, seats: Any, mates: Any, written: Tape, time: float, earlier: bool, low: Low,
              rows: Any, events: Any, used: Any) -> Low:
    """Count the rows of the least voltage where it is below that of a look at a time [s]; return how it continues."""
    voltage = _voltage(posts, shared, seats, mates, written, time, earlier)
    for j in range(len(posts)):
        taken_up(Screen(rows[j], events[j], used[USED * j:USED * j + USED]), low, voltage)
    return Low(voltage, 0)


def _following(written: Tape, j: int, n: int) -> int:
    """Return which row of a servo comes next after a row; −1: none."""
    for m in range(n + 1, written.used[0]):
        if row_at(written.motions, m).unit == j:
            return m
    return -1


def _next_begin(written: Tape, posts: Any) -> float:
    """Return when the next motion of any servo begins [s]; inf after the last."""
    found = math.inf
    for j in range(len(posts)):
        n = _following(written, j, posts[j].row)
        if n >= 0:
            row = row_at(written.motions, n)
            found = min(found, row.origin + row.start)
    return found


def _enter(written: Tape, posts: Any, time: float) -> bool:
    """Let the motions be present that begin at a time [s]; tell whether a bridge drives in another way then."""
    switched = False
    for j in range(len(posts)):
        post, n = posts[j], _following(written, j, posts[j].row)
        if n >= 0:
            row = row_at(written.motions, n)
            if row.origin + row.start <= time * _LATE:
                post.row = n
                said = said_of(post.said)
                switched = switched or (said.silent >= 0 and switch_of(said) != switch_of(said_by(row)))
    return switched


def _take_over(written: Tape, posts: Any) -> None:
    """Note what shows of the chips and programs of all servos in their present motions, and their modes."""
    for j in range(len(posts)):
        post = posts[j]
        if post.row >= 0:
            row = row_at(written.motions, post.row)
            put_said(post.said, said_by(row))
            post.zone, post.contact, post.mesh, post.motor, post.share = row.mode


def _said_in(post: Any, row: Row, earlier: bool) -> Said:
    """Return what shows of a servo in a motion; `earlier`: before its bridge switches, as was noted."""
    return said_of(post.said) if earlier and post.said.silent >= 0 else said_by(row)


def _state_in(numbers: Numbers, row: Row, shared: Any, accuracy: float, time: float) -> Vector:
    """Return where a servo stands at a time [s] of its motion."""
    m = motion_of(numbers, row, shared, accuracy)
    age = time - row.origin - m.t0
    if motion.is_step(m) and 0.0 < age < m.length:
        m = motion.prepared(m)
    return state_of(row, m, shared, age)


def _now(numbers: Numbers, said: Said) -> Numbers:
    """Return the numbers of a servo with its bridge as it shows."""
    return duty.at_duty(numbers, said.duty) if duty.present(numbers.bridge) else at_pulses(numbers, said.silent)


def _voltage(posts: Any, shared: Any, seats: Any, mates: Any, written: Tape, time: float, earlier: bool) -> float:
    """Return the voltage of the supply at a time [s], from where all servos stand; mates beyond theirs are used."""
    count, connected, supply = len(posts), 0, source_of(shared.source)
    for j in range(count):
        row, numbers = row_at(written.motions, posts[j].row), numbers_of(seats[j].numbers)
        said, y = _said_in(posts[j], row, earlier), _state_in(numbers, row, written.numbers, seats[j].accuracy, time)
        numbers = _now(numbers, said)
        if currents.is_connected(numbers, said.drive, y):
            mate = mates[count + connected]
            put_numbers(mate.numbers, currents.on_stiff_source(numbers, said.drive == 0.0))
            put_vector(mate.y, y)
            mate.sign = currents.part_on_bus(said.drive, numbers.bridge, said.duty, y)
            mate.returns = 1 if said.drive == 0.0 else 0
            connected += 1
    return coupled_step.put_in_zones(supply, mates[count:], connected, supply.V)[1]


def _see_all(told: Any, posts: Any, shared: Any, seats: Any, mates: Any, written: Tape, time: float, shown_at: float,
             earlier: bool, rows: Any, events: Any, used: Any) -> None:
    """Write a row of each servo where it stands at a time [s]; `earlier`: before bridges switch."""
    V_bus = _voltage(posts, shared, seats, mates, written, time, earlier)
    for j in range(len(posts)):
        seat, post = seats[j], posts[j]
        screen = Screen(rows[j], events[j], used[USED * j:USED * j + USED])
        if screen.used[0] >= len(screen.rows):
            continue
        row, plain = row_at(written.motions, post.row), numbers_of(seat.numbers)
        said, mode = _said_in(post, row, earlier), row.mode
        if earlier and post.said.silent >= 0:
            mode = Mode(post.zone, post.contact, post.mesh, post.motor, post.share)
        y = _state_in(plain, row, written.numbers, seat.accuracy, time)
        own = warm(_now(plain, said), y)
        own = on_bus(own, V_bus * (duty.share_of(own.bridge, said.duty) if duty.present(plain.bridge) else 1.0))
        write(screen, lines_of(post.lines), inputs_at(told, seat), said, own, mode, said.drive * own.source.V,
              piece_value(row.tau, time - row.origin), y, wiper_at(plain.sensor, row.wiper, y.q), shown_at)


def _note_all(written: Tape, events: Any, rows: Any, used: Any) -> None:
    """Note what has happened that is reported."""
    for n in range(written.used[1]):
        j, time, kind = int(written.events[n, 0]), written.events[n, 1], int(written.events[n, 2])
        code = crossings.NO_EVENT
        if kind >= 0:
            code = crossings.kind_of(kind, Mode(int(written.events[n, 3]), int(written.events[n, 4]), 0, 0, 0))
        elif bus_records.SILENCE <= kind <= bus_records.SILENCE + 1:
            code = crossings.SILENCE_ENDS + kind - bus_records.SILENCE
        elif kind == bus_records.REFUSED:
            code = crossings.REFUSED
        elif bus_records.TRIPS <= kind < bus_records.TRIPS + 5:
            code = crossings.TRIP_ENDS + kind - bus_records.TRIPS
        if code != crossings.NO_EVENT:
            note(Screen(rows[j], events[j], used[USED * j:USED * j + USED]), time, code)
