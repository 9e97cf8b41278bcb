"""What ends a motion of first order behind a bridge: its time is told outright, or by a search along two courses."""

from __future__ import annotations

import math

from servotwin.models.engine.dynamics import contacts, currents, guards
from servotwin.models.engine.dynamics.coefficients import Apart
from servotwin.models.engine.motions import first_order
from servotwin.models.engine.motions.relative_motion import Course, both, lead_of, leaves
from servotwin.models.state.modes import FORWARD, Mode, Vector, moving
from servotwin.models.terms.friction import creeping_speed, shared
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.motor import back_emf


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

    How they press changes with the speed in straight lines, with a bend where the motor's torque turns.
    """
    w, w_end = start.w, after.w
    at_end = _pressing(numbers, mode, u, tau, start, w_end)
    bend = u / back_emf(1.0, numbers.motor.K_b)
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
