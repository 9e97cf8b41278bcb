"""Guards that look at places and speeds alone, along a coupled leg: power series like these, and their roots.

A guard is written in parts of the leg, Σ c_n xⁿ with x from 0 to 1, so that its value, its slope and a bound of how
much it bends are sums of coefficients.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.models.engine.dynamics import guards
from servotwin.models.engine.legs.coupled_units import unit_numbers
from servotwin.models.state.modes import FORWARD, INSIDE
from servotwin.models.terms.friction import core_speed

BY_PLACE = 1 << guards.SPEED | 1 << guards.MOTOR_SPEED | guards.MEETINGS | guards.STOPS
_STEPS = 100  # of a search, which takes four
_INSTANT, _ROUNDING = 1e-16, 1e-16  # s and units of a guard, within which a root is found
_NEAR = 1e-4  # of a leg: how well the time of a least value is found, whose square counts
_RISES = 50  # halvings of a leg, to see a guard that starts at zero rise


def first_below(unit: Any, kind: int, terms: int, length: float) -> float:
    """Return when a guard of a servo falls below zero along a leg [s]; inf: it does not."""
    bend, last = _put_course(unit, kind, terms, length)
    first = unit.course[0]
    if first < guards.BELOW:  # what another one did has ended this mode too
        return 0.0
    if last < guards.BELOW:
        return length * _crossing(unit.course, terms, 1.0, last, _INSTANT / length)
    if min(first, last) >= 0.125 * bend or abs(unit.course[1]) >= bend:  # the chord bounds it, or it is monotone
        return math.inf
    lowest = _lowest(unit.course, terms)
    least = _value(unit.course, terms, lowest)
    if least >= guards.BELOW:
        return math.inf
    return length * _crossing(unit.course, terms, lowest, least, _INSTANT / length)


def _put_course(unit: Any, kind: int, terms: int, length: float) -> tuple[float, float]:
    """Write a guard of a servo as a series in parts of a leg; return a bound of its second derivative, and its end."""
    y, law, mode, start = unit.y, unit.law, unit.mode, 0.0
    motor = output = 0.0  # what counts of the speed of what the motor turns, and of the output's alone
    angle = True
    if kind == guards.SPEED:
        way, angle = 1.0 if mode.contact == FORWARD else -1.0, False
        start = -core_speed(unit_numbers(unit.numbers).friction)
        if mode.mesh == INSIDE:
            output = way * law.apart
        else:
            motor = way * law.moves
    elif kind == guards.MOTOR_SPEED:
        motor, angle = law.moves if mode.motor == FORWARD else -law.moves, False
    elif kind == guards.MEET_FORWARD or kind == guards.MEET_BACKWARD:
        way = 1.0 if kind == guards.MEET_FORWARD else -1.0
        start = unit.numbers.play.half - way * (y.q_m - y.q)
        motor, output = -way * law.moves, way * law.apart
    else:
        way = 1.0 if kind == guards.UPPER else -1.0
        start = way * ((unit.numbers.stops.upper if kind == guards.UPPER else unit.numbers.stops.lower) - y.q)
        if mode.mesh == INSIDE:
            output = -way * law.apart
        else:
            motor = -way * law.moves
    return _in_parts(unit, angle, start, motor, output, terms, length)


def _in_parts(unit: Any, angle: bool, start: float, motor: float, output: float, terms: int,
              length: float) -> tuple[float, float]:
    """Write what begins so and turns with these parts of both speeds, or is them."""
    bend, power, lag = 0.0, 1.0, 1 if angle else 0
    unit.course[0] = start
    if not angle:
        unit.course[0] += _of_both(unit, motor, output, 0)
    end = unit.course[0]
    for n in range(1, terms + 1 + lag):
        power *= length
        c = _of_both(unit, motor, output, n - lag) * power
        if angle:
            c /= n
        unit.course[n] = c
        end += c
        bend += n * (n - 1) * abs(c)
    if not angle:
        unit.course[terms + 1] = 0.0
    return bend, end


def _of_both(unit: Any, motor: float, output: float, n: int) -> float:
    """Return a coefficient of so much of both speeds; of one that does not count it may be anything."""
    c = 0.0
    if motor != 0.0:
        c = motor * unit.speed[n]
    if output != 0.0:
        c += output * unit.output[n]
    return c


def _value(course: Any, terms: int, x: float) -> float:
    f = 0.0
    for n in range(terms + 1, -1, -1):
        f = f * x + course[n]
    return f


def _value_and_slope(course: Any, terms: int, x: float) -> tuple[float, float]:
    f = slope = 0.0
    for n in range(terms + 1, 0, -1):
        f = f * x + course[n]
        slope = slope * x + f
    return f * x + course[0], slope


def _slope_and_bend(course: Any, terms: int, x: float) -> tuple[float, float]:
    slope = bend = 0.0
    for n in range(terms + 1, 1, -1):
        slope = slope * x + n * course[n]
        bend = bend * x + slope
    return slope * x + course[1], bend


def _lowest(course: Any, terms: int) -> float:
    """Return where a guard is least that turns once at most, 0 or 1 where that is at an end: where its slope rises."""
    a, slope = 0.0, float(course[1])
    b, end = 1.0, _slope_and_bend(course, terms, 1.0)[0]
    if slope >= 0.0 or end <= 0.0:
        return 0.5 if slope > 0.0 and end > 0.0 else 0.0
    x = slope / (slope - end)
    for _ in range(_STEPS):
        slope, bend = _slope_and_bend(course, terms, x)
        if slope < 0.0:
            a = x
        else:
            b = x
        new = x - slope / bend if bend > 0.0 else 0.5 * (a + b)
        if not a < new < b:
            new = 0.5 * (a + b)
        if abs(new - x) <= _NEAR or b - a <= _NEAR:
            return new
        x = new
    return x


def _crossing(course: Any, terms: int, b: float, f_b: float, instant: float) -> float:
    """Return where a guard falls below zero, between the beginning and where it is below, by Newton's method.

    Both in parts of a leg. Where a step would lead out of what is known to hold the root, half of that is taken.
    """
    a, f_a = 0.0, float(course[0])
    if f_a <= -guards.BELOW:  # it starts at zero, to rounding: look whether it rises before it falls
        for _ in range(_RISES):
            a = 0.5 * b
            f_a = _value(course, terms, a)
            if f_a > -guards.BELOW:
                break
            b, f_b = a, f_a
        if f_a <= -guards.BELOW or f_b > 0.0:
            return 0.0
    x = a + (b - a) * f_a / (f_a - f_b)
    for _ in range(_STEPS):
        f, slope = _value_and_slope(course, terms, x)
        if abs(f) <= _ROUNDING:
            return x
        if f > 0.0:
            a = x
        else:
            b = x
        new = x - f / slope if slope < 0.0 else 0.5 * (a + b)
        if abs(new - x) <= instant:
            return min(max(new, a), b)
        if not a < new < b:
            new = 0.5 * (a + b)
        x = new
    return b
