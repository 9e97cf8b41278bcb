"""Exact solution of ẇ = f − λ w, the speed of a shaft under constant torque, and of the angle that it turns through.

Right for λ from 0 on and for short and long times: what would cancel is computed by expm1, log1p or a series.

Motor and output inside the play are two such courses; so are a shaft that slides and a stop, which stands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from servotwin.models.state.modes import UNIT, Vector
from servotwin.physics.elementary import expm1, log, log1p

IN_FLOATS = {"_SMALL": 0.0001, "_BEYOND": 1e-06, "_ROUNDING": 1.3e-07, "_CLOSE": 0.001}


# --- First order ------------------------------------------------------------------------------------------------------

_SMALL = 1e-8  # its square is below rounding


def response(rate: float, s: float) -> tuple[float, float, float]:
    """Return e^(−λ s), g = (1 − e^(−λ s))/λ and its integral (s − g)/λ, for λ ≥ 0 and s ≥ 0."""
    x = rate * s
    if x < 0.5:
        # (1 − φ(x))/x with φ = (1 − e^(−x))/x, as a Taylor series: the first term left out is below 1e-18
        G = 1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720 - x * (1 / 5040 - x * (1 / 40320 - x * (
            1 / 362880 - x * (1 / 3628800 - x * (1 / 39916800 - x * (1 / 479001600 - x * (
                1 / 6227020800 - x / 87178291200)))))))))))
        phi = 1.0 - x * G
        return 1.0 - x * phi, phi * s, G * s * s
    decay = -expm1(-x)
    g = decay / rate
    return 1.0 - decay, g, (s - g) / rate


def propagate(rate: float, f: float, q0: float, w0: float, s: float) -> tuple[float, float]:
    """Return angle and speed at s ≥ 0 after the start at q0, w0."""
    decay, g, G = response(rate, s)
    return q0 + w0 * g + f * G, w0 * decay + f * g


def time_to(rate: float, f: float, w0: float, w1: float) -> float:
    """Return when the speed reaches w1 on its way from w0; inf where it never does."""
    gap = w1 - w0
    there = f - rate * w1  # the acceleration at w1 has to point onwards
    if gap == 0.0:
        return 0.0
    if there == 0.0 or (there > 0.0) != (gap > 0.0):
        return math.inf
    time = gap / there
    y = rate * time
    if y > _SMALL:
        return time * (log1p(y) / y)
    return time * (1.0 - 0.5 * y)


# --- Two courses of first order beside each other: when one has gone so far beyond the other --------------------------

_BEYOND = 1e-13  # rad: so little is rounding
_STEPS, _FEW = 200, 8  # after a few it is rounding that decides
_ROUNDING = 2.5e-16  # of an angle
_CLOSE = 1e-7  # of a time: from so near a step along a parabola ends at rounding


class Course(NamedTuple):
    """Where a body goes from a place and a speed: ẇ = pull − rate w."""

    rate: float  # λ ≥ 0 [1/s]
    pull: float  # f [rad/s²]
    q: float
    w: float


class Lead(NamedTuple):
    """How far one is before the other [rad], and how this changes, once and twice."""

    way: float
    speed: float
    bend: float


class Leaving(NamedTuple):
    """When a lead leaves its bounds [s], and over which: −1, +1; inf and 0 where it does not."""

    time: float
    side: int


STAYS = Leaving(math.inf, 0)


def both(output: Course, own: Course, y: Vector, s: float) -> Vector:
    """Return the state s [s] after y, at which output and motor began their courses."""
    q, w = propagate(output.rate, output.pull, output.q, output.w, s)
    q_m, w_m = propagate(own.rate, own.pull, own.q, own.w, s)
    return Vector(q, w, y.i, y.T_w, y.T_h, q_m, w_m)


def lead_at(one: Course, other: Course, s: float) -> Lead:
    """Return the lead after s [s]."""
    q, w = propagate(one.rate, one.pull, one.q, one.w, s)
    q_other, w_other = propagate(other.rate, other.pull, other.q, other.w, s)
    return lead_of(one, other, q, w, q_other, w_other)


def lead_of(one: Course, other: Course, q: float, w: float, q_other: float, w_other: float) -> Lead:
    """Return the lead where both are at these angles and speeds of their courses."""
    return Lead(q - q_other, w - w_other, one.pull - one.rate * w - other.pull + other.rate * w_other)


def alike(one: Course, other: Course) -> float:
    """Return when two courses have the same acceleration, after which their lead bends the other way; inf: never."""
    dw, dw_other = one.pull - one.rate * one.w, other.pull - other.rate * other.w
    if dw * dw_other <= 0.0 or one.rate == other.rate:
        return math.inf
    return log(dw_other / dw) / (other.rate - one.rate)


def leaves(one: Course, other: Course, low: float, high: float, s0: float, s1: float, last: Lead) -> Leaving:
    """Return when, in [s0, s1], the lead gets below `low` or above `high` [rad]; `last` is the lead at s1."""
    first = lead_at(one, other, s0)
    bends = alike(one, other)
    if s0 < bends < s1:  # its speed is monotone on either side of that
        middle = lead_at(one, other, bends)
        found = _leaves(one, other, low, high, s0, first, bends, middle)
        return found if found.side != 0 else _leaves(one, other, low, high, bends, middle, s1, last)
    return _leaves(one, other, low, high, s0, first, s1, last)


def _leaves(one: Course, other: Course, low: float, high: float, a: float, at_a: Lead, b: float,
            at_b: Lead) -> Leaving:
    """Return the same where the lead turns at most once, so that ends and turning point show every crossing."""
    up = at_a.speed > 0.0 or (at_a.speed == 0.0 and at_b.speed > 0.0)
    near, far, toward, side = (high, low, 1.0, 1) if up else (low, high, -1.0, -1)
    turns = at_a.speed * at_b.speed < 0.0
    if toward * (at_b.way - near) > _BEYOND:
        return Leaving(_reaches(one, other, near, toward, a, at_a, b), side)
    if turns and toward * (_most(at_a, at_b, b - a) - near) > _BEYOND:
        t = _turning(one, other, a, at_a, b)
        if toward * (lead_at(one, other, t).way - near) > _BEYOND:
            return Leaving(_reaches(one, other, near, toward, a, at_a, t), side)
    if toward * (far - at_b.way) > _BEYOND:
        if turns and toward * (at_a.way - far) <= 0.0:  # it began there
            a = _turning(one, other, a, at_a, b)
            at_a = lead_at(one, other, a)
        return Leaving(_reaches(one, other, far, -toward, a, at_a, b), -side)
    return STAYS


def _most(at_a: Lead, at_b: Lead, time: float) -> float:
    """Return where the tangents at both ends of a time [s] meet: a lead that turns between does not get so far."""
    return at_a.way + at_a.speed * (at_b.way - at_a.way - at_b.speed * time) / (at_a.speed - at_b.speed)


def _reaches(one: Course, other: Course, way: float, toward: float, a: float, at_a: Lead, b: float) -> float:
    """Return when in [a, b] the lead crosses `way`, upwards (`toward` is 1) or downwards (−1); it is beyond at b."""
    if toward * (at_a.way - way) >= 0.0:
        return a
    least = _ROUNDING * (abs(one.q) + abs(other.q))  # of a lead: less does not say on which side it is
    x = a + _step(toward * (way - at_a.way), toward * at_a.speed, toward * at_a.bend)
    for tried in range(_STEPS):
        x = x if a < x < b else 0.5 * (a + b)
        at = lead_at(one, other, x)
        left = toward * (way - at.way)
        if tried >= _FEW and abs(left) <= least:
            return x
        if left > 0.0:
            a = x
        else:
            b = x
        step = _step(left, toward * at.speed, toward * at.bend)
        if abs(step) <= _CLOSE * x:
            return min(max(x + step, a), b)
        if b - a <= UNIT * b:
            break
        x += step
    return 0.5 * (a + b)


def _step(left: float, speed: float, bend: float) -> float:
    """Return in what time [s] so much way that is left is gone, on a parabola; inf where it never is."""
    square = speed * speed + 2.0 * bend * left
    below = speed + math.sqrt(square) if square > 0.0 else 0.0
    return 2.0 * left / below if below > 0.0 else math.inf


def _turning(one: Course, other: Course, a: float, at_a: Lead, b: float) -> float:
    """Return when in [a, b] the lead turns; its speed has opposite signs there."""
    rises = at_a.speed < 0.0
    x = a - at_a.speed / at_a.bend if at_a.bend != 0.0 else b
    for _ in range(_STEPS):
        x = x if a < x < b else 0.5 * (a + b)
        at = lead_at(one, other, x)
        if (at.speed > 0.0) == rises:
            b = x
        else:
            a = x
        step = -at.speed / at.bend if at.bend != 0.0 else math.inf
        if abs(step) <= _CLOSE * x:  # more makes no difference to the way
            return min(max(x + step, a), b)
        if b - a <= UNIT * b:
            break
        x += step
    return 0.5 * (a + b)
