"""From servos side by side to servos one by one, and back: the same memory, told in two ways."""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.memory import BEAT, NOT_ASKED, NOTHING, SAME, Memory, Point
from servotwin.models.state.modes import INSIDE, ON_BACKWARD, ON_FORWARD, RIGID, Mode, Vector
from servotwin.models.terms.control import Programs
from servotwin.models.terms.frame import Decision, Frame


def remembered(tile: Any, j: int, firm: Programs) -> Memory:
    """Return the memory of a servo that runs side by side, where times count from now [s].

    Without slack the potentiometer goes with the shaft. `firm` is what stands in the place of a program's memory.
    """
    servo, clock, regular, number = tile.servo, tile.clock, tile.count.edges[j] < 0, tile.count.number[j]
    now = clock.since[j] - clock.length[j] if regular else clock.edge[j] + clock.since[j]
    q, w, drive, gear = 1.0 * servo.q[j], 1.0 * servo.w[j], 1.0 * servo.drive[j], servo.mesh[j]  # float64 as records
    pushed = ON_FORWARD if gear == ON_FORWARD else ON_BACKWARD if gear == ON_BACKWARD else RIGID
    mesh = INSIDE if gear == INSIDE else pushed
    y = Vector(q, w, 1.0 * servo.i[j], 1.0 * servo.T_w[j], 1.0 * servo.T_h[j],
               q if gear == RIGID else 1.0 * servo.q_m[j], w if gear == RIGID else 1.0 * servo.w_m[j])
    chip = Frame(
        number, tile.count.first_draw[j] + number, drive, now + servo.left[j] if drive != 0.0 else math.inf,
        now + servo.silence[j], 0, 1.0 * servo.error[j],
        Decision(now + servo.due[j], 1.0 * servo.sign[j], 1.0 * servo.duration[j], 1.0 * servo.decided[j]),
        Decision(now + servo.later_due[j], 1.0 * servo.later_sign[j], 1.0 * servo.later_duration[j],
                 1.0 * servo.later_decided[j]))
    wiper = 1.0 * servo.wiper[j] if tile.hung.half_slack[j] > 0.0 else q
    point = Point(now, y, Mode(0, 0, mesh, 0, 0), math.inf, y, 1.0 * servo.step[j], wiper)
    return Memory(number if regular else 0, clock.period[j] if regular else BEAT, point, chip, NOTHING, math.inf,
                  NOTHING, math.inf, NOT_ASKED, firm)


def put_beside(memory: Memory, period: float, tile: Any, j: int) -> None:
    """Put what a servo remembers beside others, whose frames are regular, of a period [s], from now on."""
    now, beat, chip, y = memory.point.time, memory.beat, memory.chip, memory.point.y
    servo, clock, pending, later = tile.servo, tile.clock, chip.pending, chip.later
    servo.q[j], servo.w[j], servo.i[j], servo.T_w[j], servo.T_h[j] = y.q, y.w, y.i, y.T_w, y.T_h
    servo.q_m[j], servo.w_m[j], servo.mesh[j] = y.q_m, y.w_m, 1.0 * memory.point.mode.mesh
    servo.wiper[j], servo.step[j] = memory.point.wiper, memory.point.step
    servo.drive[j], servo.left[j] = chip.drive, chip.drive_end - now if chip.drive != 0.0 else 0.0
    servo.silence[j], servo.error[j] = chip.clock - now, chip.error
    servo.due[j], servo.sign[j] = pending.time - now, pending.sign
    servo.duration[j], servo.decided[j] = pending.duration, pending.error
    servo.later_due[j], servo.later_sign[j] = later.time - now, later.sign
    servo.later_duration[j], servo.later_decided[j] = later.duration, later.error
    time, same = memory.frames * beat + now, beat == period
    number = chip.number if same else math.ceil(time / period - SAME)
    to_next = max((chip.number - memory.frames) * beat - now if same else number * period - time, 0.0)
    clock.period[j], clock.edge[j], clock.since[j], clock.length[j] = (
        period, (number - 1) * period, period - to_next, period)
    tile.count.number[j], tile.count.first_draw[j] = number, chip.draws - number
