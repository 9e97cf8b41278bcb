"""How lanes with play in the gear go through a phase: lane by lane, for hardly two of them have the same legs.

Of a servo that warms up, how a leg would end if nothing warmed is given outright; how it does, from there by a search
next to it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from servotwin.models.engine.batch import tiles
from servotwin.models.engine.batch.rk_steps import cooled
from servotwin.models.engine.batch.segments.warm_segments import LONGEST, MARGIN, NEAR
from servotwin.models.engine.dynamics import coefficients, guards
from servotwin.models.engine.dynamics.coefficients import Apart
from servotwin.models.engine.events import crossings
from servotwin.models.engine.legs import legs
from servotwin.models.engine.legs.legs import MOST_LEGS, MOST_SHORT, SHORT, Gone, stands
from servotwin.models.engine.motions import first_order, warm_exponential
from servotwin.models.engine.motions.warm_exponential import Law
from servotwin.models.state.modes import INSIDE, Mode, Vector, at_rest
from servotwin.models.terms import heat, play
from servotwin.models.terms.numbers import Numbers, warm
from servotwin.models.terms.sensor import wiper_at

CALLED = ("go", "_crossing", "gone")  # one lane: with copies it takes four times as long to compile


# --- Legs of a servo that warms up and has play in its gear -----------------------------------------------------------

_ROUNDS = 40
_SAME = 1e-14  # of a time


class Trail(NamedTuple):
    """A leg as it has been followed for a time [s]: how it continues from there is known nearby."""

    time: float
    start: Vector
    laws: Apart
    to: warm_exponential.Gone


class End(NamedTuple):
    """When a leg ends [s], after the time that it has been followed for, and by which guard; 0: not known there."""

    on: float
    kind: int  # −1: with its time
    good: float


def go(numbers: Numbers, torque: float, u: float, y: Vector, mesh: int, wiper: float, time: float,
       tolerance: float) -> Gone:
    """Return where a servo goes within a time [s], under a voltage behind the bridge and an external torque [N m]."""
    mode = legs.mode_from(warm(numbers, y), torque, u, y, mesh)
    most, short = math.inf, 0
    for _ in range(MOST_LEGS):
        if not time > 0.0:
            return Gone(y, mode, wiper, 1.0)
        if stands(mode):
            y, done = rested(numbers, mode, torque, u, y, time, tolerance)
            return Gone(y, mode, wiper, done)
        trail, kind = followed(numbers, mode, torque, u, y, min(time, most))
        end = End(0.0, -1, 0.0)
        if MARGIN * trail.to.error <= tolerance * (1.0 + abs(y.w_m)):
            end = ended(numbers, mode, torque, u, trail, kind, time)
        if end.good <= 0.0:
            most = 0.5 * trail.time
            if not most > _SAME * time:
                return Gone(y, mode, wiper, 0.0)
            continue
        most, took = math.inf, trail.time + end.on
        y = state(numbers, mode, trail, end.on)
        if not math.isfinite(y.q + y.q_m):
            return Gone(y, mode, wiper, 0.0)
        wiper = wiper_at(numbers.sensor, wiper, y.q)
        if end.kind >= 0:
            mode, y = crossings.cross(numbers, mode, end.kind, u, torque, y)
            short = short + 1 if took <= SHORT * time else 0
            if short >= MOST_SHORT:
                _, mode, y = legs.together(warm(numbers, y), mode, u, torque, y)
        time = max(time - took, 0.0)
    return Gone(y, mode, wiper, 0.0)


def followed(numbers: Numbers, mode: Mode, torque: float, u: float, y: Vector, most: float) -> tuple[Trail, int]:
    """Follow a leg for `most` [s] at most, to where it would end without warming; return also the guard of that end."""
    now = warm(numbers, y)
    laws = legs.laws_of(now, mode, u, torque)
    aim = min(most, LONGEST / laws.motor_rate) if laws.motor_rate > 0.0 else most
    end = legs.ending(now, mode, laws, u, torque, y, aim)
    aim = min(aim, end.time)
    return Trail(aim, y, laws, warm_exponential.going(law_of(numbers, now, mode, u, laws, y), numbers.heat,
                                                      aim)), end.kind


def law_of(numbers: Numbers, now: Numbers, mode: Mode, u: float, laws: Apart, y: Vector) -> Law:
    """Return the law of what the motor turns; of a motor at rest inside the play that of its temperatures."""
    if mode.mesh == INSIDE and at_rest(mode.motor):
        return warm_exponential.law_of(numbers, now, mode.zone, u, y.T_w, y.T_h, 0.0, 0.0, 0.0, 0.0)
    pull = laws.motor_pull - laws.motor_rate * y.w_m
    return warm_exponential.law_of(numbers, now, mode.zone, u, y.T_w, y.T_h, laws.motor_rate, pull, y.w_m,
                                   coefficients.per_ampere(now, mode))


def state(numbers: Numbers, mode: Mode, trail: Trail, on: float) -> Vector:
    """Return the state so much time [s] after that for which a leg has been followed, before or after it."""
    y, to = trail.start, trail.to
    bend = -trail.laws.motor_rate * to.dw
    way = to.way + on * (to.w + on * (0.5 * to.dw + on * bend / 6.0))
    w_m = to.w + on * (to.dw + 0.5 * on * bend)
    T_w, T_h = y.T_w + to.warmer + on * to.warms, y.T_h + to.housing + on * to.housing_warms
    if mode.mesh != INSIDE:
        return play.with_motor(numbers.play, mode.mesh, Vector(y.q + way, w_m, y.i, T_w, T_h, y.q_m, y.w_m))
    q, w = first_order.propagate(trail.laws.output_rate, trail.laws.output_pull, y.q, y.w, trail.time + on)
    return Vector(q, w, y.i, T_w, T_h, y.q_m + way, w_m)


def ended(numbers: Numbers, mode: Mode, torque: float, u: float, trail: Trail, kind: int, left: float) -> End:
    """Return how a leg ends that would end by a guard if nothing warmed, −1: by none, with so much time left [s]."""
    near = NEAR * min(trail.time, 1.0 / trail.laws.motor_rate) if trail.laws.motor_rate > 0.0 else NEAR * trail.time
    last, on, found = left - trail.time, 0.0, -1
    if kind >= 0:
        on = _crossing(numbers, mode, kind, torque, u, trail, 0.0, near)
        if not abs(on) <= near:
            return End(0.0, -1, 0.0)
        found = kind
        if on > last:
            on, found = last, -1
    kinds = guards.guards(warm(numbers, trail.start), mode, u, False)
    for other in range(guards.KINDS):
        if kinds >> other & 1 and other != found:
            y = state(numbers, mode, trail, on)
            if guards.guard(numbers, mode, other, u, 0.0, torque, 0.0, y, y)[0] < guards.BELOW:
                on, found = _crossing(numbers, mode, other, torque, u, trail, on, near), other
                if not abs(on) <= near:
                    return End(0.0, -1, 0.0)
    return End(on, found, 1.0)


def _crossing(numbers: Numbers, mode: Mode, kind: int, torque: float, u: float, trail: Trail, begin: float,
              near: float) -> float:
    """Return when, about a time at which it is nearly zero, a guard is zero: by secants; inf where it is not near."""
    a, f_a = begin, _value(numbers, mode, kind, torque, u, trail, begin)
    if abs(f_a) <= -guards.BELOW:
        return a
    b = begin - 0.01 * near if f_a < 0.0 else begin + 0.01 * near
    for _ in range(_ROUNDS):
        f_b = _value(numbers, mode, kind, torque, u, trail, b)
        if f_b == f_a:
            return b if abs(f_b) <= -guards.BELOW else math.inf
        c = b - f_b * (b - a) / (f_b - f_a)
        if f_b == 0.0 or abs(c - b) <= 1e-16 * trail.time:
            return c
        if not abs(c) <= 2.0 * near:
            return math.inf
        a, f_a, b = b, f_b, c
    return b


def _value(numbers: Numbers, mode: Mode, kind: int, torque: float, u: float, trail: Trail, on: float) -> float:
    y = state(numbers, mode, trail, on)
    return guards.guard(numbers, mode, kind, u, 0.0, torque, 0.0, y, y)[0]


def rested(numbers: Numbers, mode: Mode, torque: float, u: float, y: Vector, time: float,
           tolerance: float) -> tuple[Vector, float]:
    """Return the state of bodies at rest after a time [s], and 1, or 0 where it is not known, as if one may start."""
    now = warm(numbers, y)
    if u == 0.0:
        T_w, T_h = cooled(numbers, y.T_w, y.T_h, time)
        return Vector(y.q, y.w, y.i, T_w, T_h, y.q_m, y.w_m), 1.0
    to = warm_exponential.going(warm_exponential.law_of(numbers, now, mode.zone, u, y.T_w, y.T_h, 0.0, 0.0, 0.0, 0.0),
                                numbers.heat, time)
    y = Vector(y.q, y.w, y.i, y.T_w + to.warmer, y.T_h + to.housing, y.q_m, y.w_m)
    after = legs.mode_from(warm(numbers, y), torque, u, y, mode.mesh)
    return y, 1.0 if MARGIN * to.error <= tolerance and stands(after) else 0.0


# --- How lanes with play in the gear go through a phase ---------------------------------------------------------------

def phase(size: int, tile: Any, plan: Any) -> None:
    """Move all lanes through a time with or without drive."""
    for j in range(size):
        if plan.time[j] > 0.0:
            alone(tile, plan, j)


def alone(tile: Any, plan: Any, j: int) -> None:
    """Move one lane through a time with or without drive."""
    servo = tile.servo
    y = Vector(servo.q[j], servo.w[j], servo.i[j], servo.T_w[j], servo.T_h[j], servo.q_m[j], servo.w_m[j])
    moved = gone(tiles.numbers_at(tile.own, j), tile.hung.torque[j], plan.power[j], y, int(servo.mesh[j]),
                 servo.wiper[j], plan.time[j], tile.hung.tolerance[j])
    servo.q[j], servo.w[j], servo.wiper[j] = moved.y.q, moved.y.w, moved.wiper
    servo.q_m[j], servo.w_m[j], servo.mesh[j] = moved.y.q_m, moved.y.w_m, moved.mode.mesh
    servo.T_w[j], servo.T_h[j] = moved.y.T_w, moved.y.T_h
    plan.lost[j] = plan.lost[j] if moved.done > 0.0 else 1.0


def gone(numbers: Numbers, torque: float, drive: float, y: Vector, mesh: int, wiper: float, time: float,
         tolerance: float) -> Gone:
    """Return where a servo goes within a time [s] under one drive (−1, 0, +1) and an external torque [N m]."""
    u = drive * numbers.source.V
    if heat.present(numbers.heat):
        return go(numbers, torque, u, y, mesh, wiper, time, tolerance)
    return legs.go(numbers, torque, u, y, legs.mode_from(numbers, torque, u, y, mesh), wiper, time)
