"""When a mode ends: the first time at which one of its guards falls below zero.

Within an interval in which the speed is monotone a guard has at most one turning point. So the ends of the
interval and that point show every crossing, and a bracketed search finds its time to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from servotwin.models.kernels import hybrid
from servotwin.models.kernels.hybrid import Mode, Plant
from servotwin.physics.pieces import piece_rate, piece_value
from servotwin.simulation.motion import Inputs, Motion

_BELOW = -1e-13  # a guard counts as crossed below this (V, rad, rad/s, N m): rounding is not an event


def first_event(plant: Plant, mode: Mode, motion: Motion, inputs: Inputs, kinds: tuple[int, ...], t0: float,
                s0: float, s1: float) -> tuple[float, int]:
    """Return the time since the anchor t0 and the kind of the first event in (s0, s1]; (inf, -1) where none is."""
    u, tau = inputs.u, inputs.tau

    def values(s: float, kinds: tuple[int, ...]) -> list[tuple[float, float]]:
        t = t0 + s
        y = motion.state(s)
        dw, di = motion.acceleration(s, y)
        inputs_now = (piece_value(u, t), piece_rate(u, t), piece_value(tau, t), piece_rate(tau, t))
        return [hybrid.guard(plant, mode, kind, *inputs_now, *y, dw, di) for kind in kinds]

    def guard_of(kind: int) -> Callable[[float], tuple[float, float]]:
        return lambda s: values(s, (kind,))[0]

    if not kinds:
        return math.inf, -1
    left, at_left = s0, values(s0, kinds)
    for right in motion.intervals(s0, s1):
        if right <= left:
            continue
        at_right = values(right, kinds)
        first, found = math.inf, -1
        for k, kind in enumerate(kinds):
            s = _crossing(guard_of(kind), left, at_left[k], right, at_right[k])
            if s < first:
                first, found = s, kind
        if found >= 0:
            return first, found
        left, at_left = right, at_right
    return math.inf, -1


def _crossing(guard: Callable[[float], tuple[float, float]], a: float, at_a: tuple[float, float],
              b: float, at_b: tuple[float, float]) -> float:
    """Return where a guard with at most one turning point in [a, b] falls below zero; inf where it does not."""
    if at_b[0] >= _BELOW and at_a[1] < 0.0 < at_b[1]:
        # It may dip below zero and come back: look at the lowest point.
        turn = _root(lambda s: (guard(s)[1], math.nan), a, b, at_a[1], at_b[1])
        if guard(turn)[0] >= _BELOW:
            return math.inf
        b, at_b = turn, guard(turn)
    if at_b[0] >= _BELOW:
        return math.inf
    if at_a[0] <= 0.0:
        # It starts at zero, to rounding, and so may its rate: look whether it rises before it falls.
        for k in range(1, 50):
            s = a + (b - a) * 0.5**k
            value = guard(s)[0]
            if value > 0.0:
                return _root(guard, s, b, value, at_b[0])
        return a
    return _root(guard, a, b, at_a[0], at_b[0])


def _root(function: Callable[[float], tuple[float, float]], a: float, b: float, f_a: float, f_b: float) -> float:
    """Return a root between a and b, where the function has opposite signs, to rounding.

    Newton steps where the function gives a derivative, else the secant through the bracket; a bisection whenever
    neither the bracket nor the value went down by half.
    """
    if f_a == 0.0:
        return a
    if f_b == 0.0:
        return b
    rising = f_b > 0.0
    x = 0.5 * (a + b)
    last = math.inf
    for _ in range(200):
        f, slope = function(x)
        if f == 0.0:
            return x
        width = b - a
        if (f > 0.0) == rising:
            b, f_b = x, f
        else:
            a, f_a = x, f
        if b - a <= 2e-16 * max(abs(a), abs(b)) or b - a < 1e-18:
            break
        guess = x - f / slope if slope == slope and slope != 0.0 else (a * f_b - b * f_a) / (f_b - f_a)
        if abs(guess - x) <= 1e-16 * abs(x):
            return guess if a <= guess <= b else x
        better = b - a <= 0.6 * width or (slope == slope and abs(f) < 0.5 * last)
        last = abs(f)
        x = guess if a < guess < b and better else 0.5 * (a + b)
        if not a < x < b:
            break
    return 0.5 * (a + b)
