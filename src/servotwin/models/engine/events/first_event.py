"""When a mode ends: the first time at which one of its guards falls below zero.

Within an interval in which the speed is monotone a guard has at most one turning point. So the ends of the
interval and that point show every crossing, and a bracketed search finds its time to rounding. A motion of first
order tells the times outright.
"""

from __future__ import annotations

import math

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.dynamics.coefficients import Apart
from servotwin.models.engine.motions import first_order
from servotwin.models.engine.motions.first_order import Course, both, lead_of, leaves
from servotwin.models.engine.motions.motion import (
    APART,
    FIRST_ORDER,
    REST,
    Motion,
    is_step,
    monotone_until,
    prepared,
    rates,
    state,
    state_and_rates,
)
from servotwin.models.engine.motions.rodas import not_constant
from servotwin.models.state.modes import FORWARD, INSIDE, LOOSE, RIGID, UNIT, Mode, Vector, moving
from servotwin.models.terms import source
from servotwin.models.terms.friction import creeping_speed, fades, shared
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.motor import back_emf
from servotwin.physics.pieces import piece_rate, piece_value

# --- Ends of a motion of first order behind a bridge ------------------------------------------------------------------

def first_end(numbers: Numbers, mode: Mode, kinds: int, u: float, tau: float, laws: Apart, start: Vector,
              after: Vector, s0: float, s1: float) -> tuple[float, int]:
    """Return the time and the kind of the first event in (s0, s1], inf and −1 where none is.

    `laws` are those of output and motor, which together have the same; `after` is the state at s1.
    """
    first, found = _by_speed(numbers, mode, kinds, u, tau, laws, start, after, s0, s1)
    end = min(first, s1)
    output = Course(laws.output_rate, laws.output_pull, start.q, start.w)
    at_end = after if end == s1 else both(output, output, start, end)
    stops = numbers.stops
    if kinds & guards.STOPS and not (start.w * at_end.w >= 0.0 and stops.lower <= at_end.q <= stops.upper):
        wall = Course(0.0, 0.0, 0.0, 0.0)
        s, side = leaves(
            output, wall, stops.lower if kinds & 1 << guards.LOWER else -math.inf,
            stops.upper if kinds & 1 << guards.UPPER else math.inf, s0, end,
            lead_of(output, wall, at_end.q, at_end.w, 0.0, 0.0))
        if s < first:
            first, found, end = s, guards.UPPER if side > 0 else guards.LOWER, s
    if kinds & guards.MEETINGS:
        own, half = Course(laws.motor_rate, laws.motor_pull, start.q_m, start.w_m), numbers.play.half
        at_end = after if end == s1 else both(output, own, start, end)
        s, side = leaves(own, output, -half, half, s0, end,
                         lead_of(own, output, at_end.q_m, at_end.w_m, at_end.q, at_end.w))
        if s < first:
            first, found = s, guards.MEET_FORWARD if side > 0 else guards.MEET_BACKWARD
    return first, found


def _by_speed(numbers: Numbers, mode: Mode, kinds: int, u: float, tau: float, laws: Apart, start: Vector,
              after: Vector, s0: float, s1: float) -> tuple[float, int]:
    """Return the same of all events that come at a speed, of which each body's is monotone."""
    low, high = currents.zone_limits(numbers, mode.zone, u)
    w, w_m = after.w, after.w_m
    x, per_speed = u - back_emf(w_m, numbers.motor.K_b), back_emf(1.0, numbers.motor.K_b)
    way, way_m = 1.0 if mode.contact == FORWARD else -1.0, 1.0 if mode.motor == FORWARD else -1.0
    slow = creeping_speed(numbers.friction)
    share, turn = guards.share_along(numbers, mode, u, tau, after)
    first, found = math.inf, -1
    for kind, left, there in ((guards.SPEED, way * w, 0.0),
                              (guards.ZONE_UP, high - x, (u - high) / per_speed),
                              (guards.ZONE_DOWN, x - low, (u - low) / per_speed),
                              (guards.MOTOR_SPEED, way_m * w_m, 0.0),
                              (guards.SHARE, share, turn), (guards.CREEPS, way * w - slow, way * slow)):
        if not kinds >> kind & 1 or left >= guards.BELOW:  # monotone: what holds at the end has held
            continue
        of_motor = kind != guards.SPEED and kind != guards.CREEPS
        rate, pull = (laws.motor_rate, laws.motor_pull) if of_motor else (laws.output_rate, laws.output_pull)
        s = first_order.time_to(rate, pull, start.w_m if of_motor else start.w, there)
        s = s0 if s == math.inf else min(max(s, s0), s1)  # never: it began below
        if s < first:
            first, found = s, kind
    if kinds >> guards.PART & 1:
        s = _parts(numbers, mode, u, tau, laws, start, after, s0, s1)
        if s < first:
            return s, guards.PART
    return first, found


def _parts(numbers: Numbers, mode: Mode, u: float, tau: float, laws: Apart, start: Vector, after: Vector, s0: float,
           s1: float) -> float:
    """Return when motor and output, in contact and sliding one way, would draw apart; inf where they do not.

    How they press changes with the speed in straight lines, with a bend where the motor's torque turns, as far as the
    zone of its current goes.
    """
    per_speed = back_emf(1.0, numbers.motor.K_b)
    low, high = currents.zone_limits(numbers, mode.zone, u)
    w, w_end = start.w, min(max(after.w, (u - high) / per_speed), (u - low) / per_speed)
    at_end = _pressing(numbers, mode, u, tau, start, w_end)
    bend = u / per_speed
    bends = shared(numbers.friction) and min(w, w_end) < bend < max(w, w_end)
    if at_end >= guards.BELOW and not bends:
        return math.inf
    first = _pressing(numbers, mode, u, tau, start, w)
    if first <= 0.0 and at_end < guards.BELOW:
        return s0
    at_bend = _pressing(numbers, mode, u, tau, start, bend) if bends else first
    if at_bend >= guards.BELOW:
        if at_end >= guards.BELOW:
            return math.inf
        w, first = (bend, at_bend) if bends else (w, first)
        bend, at_bend = w_end, at_end
    there = w + (bend - w) * max(first, 0.0) / (max(first, 0.0) - at_bend)
    s = first_order.time_to(laws.output_rate, laws.output_pull, start.w, there)
    return min(max(s, s0), s1)


def _pressing(numbers: Numbers, mode: Mode, u: float, tau: float, y: Vector, w: float) -> float:
    """Return how motor and output in contact would close in [rad/s²] at a speed."""
    return contacts.pressing_along(numbers, mode, u, tau, moving(y, y.q, w, w))


# --- When a mode ends: the first time at which one of its guards falls below zero -------------------------------------

_INSTANT = 1e-18  # s: between two times
_HALVINGS = 20  # of an interval, to where a lead bends the other way
_ALIKE = 1e-12  # relative, or rad/s²: accelerations so near to each other are alike from the beginning
IN_FLOATS = {"_INSTANT": 1e-9}


def first_event(motion: Motion, kinds: int, s0: float, s1: float) -> tuple[float, int, Vector]:
    """Return the time since the anchor and the kind of the first event in (s0, s1], inf and −1 where none is.

    The third is the state at s1, where there is no event.
    """
    if kinds == 0 or (motion.kind == REST and not not_constant(motion.u) and not not_constant(motion.tau)):
        return math.inf, -1, state(motion, s1)
    straight = motion.kind == FIRST_ORDER and source.present(motion.numbers.source) and (
        motion.mode.mesh == RIGID or not fades(motion.numbers.friction))
    if straight or motion.kind == APART:
        return _outright(motion, kinds, s0, s1)
    left, at_left = s0, state(motion, s0)
    while left < s1:
        right = monotone_until(motion, left, s1)
        if right <= left:
            right = s1
        if is_step(motion) and (motion.mode.mesh == INSIDE or motion.mode.mesh == LOOSE):
            right = _alike(motion, left, at_left, right)
            motion = prepared(motion) if right < s1 else motion
        at_right = state(motion, right)
        first, found = _first_of(motion, kinds, left, at_left, right, at_right)
        if found >= 0:
            return first, found, at_right
        left, at_left = right, at_right
    return math.inf, -1, at_left


def _alike(motion: Motion, a: float, at_a: Vector, b: float) -> float:
    """Return where in (a, b) both are accelerated alike, so that their lead bends the other way; b: nowhere."""
    begin, end = rates(motion, a, at_a), rates(motion, b, state(motion, b))
    first = begin.w_m - begin.w
    if not first * (end.w_m - end.w) < 0.0 or abs(first) <= _ALIKE * max(abs(begin.w), 1.0):
        return b
    motion = prepared(motion)
    for _ in range(_HALVINGS):
        s = 0.5 * (a + b)
        dy = state_and_rates(motion, s)[1]
        if (dy.w_m - dy.w) * first > 0.0:
            a = s
        else:
            b = s
    return b


def _outright(motion: Motion, kinds: int, s0: float, s1: float) -> tuple[float, int, Vector]:
    """Return the same of a motion of first order behind a bridge."""
    c, after = motion.coefficients, state(motion, s1)
    laws = Apart(c[0], c[1], c[2], c[3]) if motion.kind == APART else Apart(2.0 * c[0], c[2], 2.0 * c[0], c[2])
    s, kind = first_end(motion.numbers, motion.mode, kinds, motion.u.value, piece_value(motion.tau, motion.t0), laws,
                        motion.start, after, s0, s1)
    return s, kind, after


def _first_of(motion: Motion, kinds: int, a: float, at_a: Vector, b: float, at_b: Vector) -> tuple[float, int]:
    """Return when the first of several guards falls below zero in [a, b], and which; (inf, -1) where none does."""
    first, found = math.inf, -1
    rates_a, rates_b = rates(motion, a, at_a), rates(motion, b, at_b)
    t = motion.t0 + b
    u, du, tau, dtau = piece_value(motion.u, t), piece_rate(motion.u, t), piece_value(motion.tau, t), piece_rate(
        motion.tau, t)
    for kind in range(guards.KINDS):
        if kinds >> kind == 0:
            break
        if not kinds >> kind & 1:
            continue
        end = guards.guard(motion.numbers, motion.mode, kind, u, du, tau, dtau, at_b, rates_b)
        if end[0] >= guards.BELOW and not end[1] > 0.0:
            continue  # it does not fall below zero, nor rises from there
        begin = _guard(motion, kind, a, at_a, rates_a)
        if end[0] >= guards.BELOW and not begin[1] < 0.0:
            continue  # nor dips
        motion = prepared(motion)
        s = _crossing(motion, kind, a, begin, b, end)
        if s < first:
            first, found = s, kind
    return first, found


def _guard(motion: Motion, kind: int, s: float, y: Vector, dy: Vector) -> tuple[float, float]:
    """Return a guard and its rate at s, where the state is y and its rates are dy."""
    t = motion.t0 + s
    u, tau = motion.u, motion.tau
    return guards.guard(motion.numbers, motion.mode, kind, piece_value(u, t), piece_rate(u, t), piece_value(tau, t),
                        piece_rate(tau, t), y, dy)


def _at(motion: Motion, kind: int, s: float, rate: bool) -> tuple[float, float]:
    """Return a guard and its rate at s; with `rate` the rate alone, and nan for its own."""
    y, dy = state_and_rates(motion, s)
    value, slope = _guard(motion, kind, s, y, dy)
    return (slope, math.nan) if rate else (value, slope)


def _crossing(motion: Motion, kind: int, a: float, at_a: tuple[float, float], b: float,
              at_b: tuple[float, float]) -> float:
    """Return where a guard with at most one turning point in [a, b] falls below zero; inf where it does not.

    The motion is `prepared`; the guard ends below zero, or falls at a and rises at b.
    """
    if at_b[0] >= guards.BELOW:
        # It may dip below zero and come back: look at the lowest point.
        b = _root(motion, kind, a, b, at_a[1], at_b[1], True)
        at_b = _at(motion, kind, b, False)
        if at_b[0] >= guards.BELOW:
            return math.inf
    if at_a[0] <= 0.0:
        # It starts at zero, to rounding, and so may its rate: look whether it rises before it falls.
        part = 1.0
        for _ in range(1, 50):
            part *= 0.5
            s = a + (b - a) * part
            value = _at(motion, kind, s, False)[0]
            if value > 0.0:
                return _root(motion, kind, s, b, value, at_b[0], False)
        return a
    return _root(motion, kind, a, b, at_a[0], at_b[0], False)


def _root(motion: Motion, kind: int, a: float, b: float, f_a: float, f_b: float, rate: bool) -> float:
    """Return a root of a guard, or of its rate, between a and b, where it has opposite signs, to rounding.

    Newton steps where there is a derivative, else the secant through the bracket; a bisection whenever neither the
    bracket nor the value went down by half.
    """
    if f_a == 0.0:
        return a
    if f_b == 0.0:
        return b
    rising = f_b > 0.0
    x = 0.5 * (a + b)
    last = math.inf
    for _ in range(200):
        f, slope = _at(motion, kind, x, rate)
        if f == 0.0:
            return x
        width = b - a
        if (f > 0.0) == rising:
            b, f_b = x, f
        else:
            a, f_a = x, f
        if b - a <= UNIT * max(abs(a), abs(b)) or b - a < _INSTANT:
            break
        newton = slope == slope and slope != 0.0
        guess = x - f / slope if newton else (a * f_b - b * f_a) / (f_b - f_a)
        if abs(guess - x) <= 0.5 * UNIT * abs(x):
            return guess if a <= guess <= b else x
        better = b - a <= 0.6 * width or (slope == slope and abs(f) < 0.5 * last)
        last = abs(f)
        x = guess if a < guess < b and better else 0.5 * (a + b)
        if not a < x < b:
            break
    return 0.5 * (a + b)
