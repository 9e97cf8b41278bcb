"""From servos side by side to servos one by one, and back: the same memory, told in two ways."""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.engine.memory import BEAT, NOTHING, SAME, Memory, Point
from servotwin.models.engine.modes import INSIDE, ON_BACKWARD, ON_FORWARD, RIGID, Mode, Vector
from servotwin.models.engine.records import reader, writer
from servotwin.models.terms.control import Programs
from servotwin.models.terms.frame import Decision, Frame


class Held(NamedTuple):
    """What a servo remembers in a tile, by the names that it has there; times count from now [s]."""

    q: float
    w: float
    drive: float
    left: float
    silence: float
    error: float
    due: float
    sign: float
    duration: float
    decided: float
    later_due: float
    later_sign: float
    later_duration: float
    later_decided: float
    wiper: float
    i: float
    T_w: float
    T_h: float
    q_m: float
    w_m: float
    mesh: float
    step: float


class Hour(NamedTuple):
    """Where it is in time [s]."""

    period: float
    edge: float
    since: float
    length: float


class Counted(NamedTuple):
    """Which frame is next, and which draw of noise belonged to frame 0."""

    number: int
    first_draw: int


class Side(NamedTuple):
    """All of it."""

    held: Held
    hour: Hour
    counted: Counted


held_at = reader("held_at", Held)
hour_at = reader("hour_at", Hour)
counted_at = reader("counted_at", Counted)
put_held = writer("put_held", Held)
put_hour = writer("put_hour", Hour)
put_counted = writer("put_counted", Counted)


def remembered(side: Side, regular: bool, half_slack: float, firm: Programs) -> Memory:
    """Return the memory of a servo that ran side by side.

    `regular` is whether its frames come regularly; without slack the potentiometer goes with the shaft. `firm` is what
    stands in the place of a program's memory.
    """
    held, hour, number = side.held, side.hour, side.counted.number
    now = hour.since - hour.length if regular else hour.edge + hour.since
    q, w = 1.0 * held.q, 1.0 * held.w  # float64, whatever tiles hold
    pushed = ON_FORWARD if held.mesh == ON_FORWARD else ON_BACKWARD if held.mesh == ON_BACKWARD else RIGID
    mesh = INSIDE if held.mesh == INSIDE else pushed
    y = Vector(q, w, 1.0 * held.i, 1.0 * held.T_w, 1.0 * held.T_h, q if held.mesh == RIGID else 1.0 * held.q_m,
         w if held.mesh == RIGID else 1.0 * held.w_m)
    chip = Frame(
        number, side.counted.first_draw + number, 1.0 * held.drive,
        now + held.left if held.drive != 0.0 else math.inf, now + held.silence, 0, 1.0 * held.error,
        Decision(now + held.due, 1.0 * held.sign, 1.0 * held.duration, 1.0 * held.decided),
        Decision(now + held.later_due, 1.0 * held.later_sign, 1.0 * held.later_duration, 1.0 * held.later_decided))
    wiper = 1.0 * held.wiper if half_slack > 0.0 else q
    point = Point(now, y, Mode(0, 0, mesh, 0, 0), math.inf, y, 1.0 * held.step, wiper)
    return Memory(number if regular else 0, hour.period if regular else BEAT, point, chip, NOTHING, math.inf, NOTHING,
                  math.inf, firm)


def side_of(memory: Memory, period: float) -> Side:
    """Return what a servo remembers side by side, whose frames are regular, of a period [s], from now on."""
    now, beat, chip, y = memory.point.time, memory.beat, memory.chip, memory.point.y
    time = memory.frames * beat + now
    same = beat == period
    number = chip.number if same else math.ceil(time / period - SAME)
    to_next = (chip.number - memory.frames) * beat - now if same else number * period - time
    to_next = max(to_next, 0.0)
    pending, later = chip.pending, chip.later
    held = Held(
        y.q, y.w, chip.drive, chip.drive_end - now if chip.drive != 0.0 else 0.0,
        chip.clock - now, chip.error, pending.time - now, pending.sign, pending.duration, pending.error,
        later.time - now, later.sign, later.duration, later.error, memory.point.wiper, y.i, y.T_w, y.T_h, y.q_m, y.w_m,
        1.0 * memory.point.mode.mesh, memory.point.step)
    return Side(held, Hour(period, (number - 1) * period, period - to_next, period),
                Counted(number, chip.draws - number))
