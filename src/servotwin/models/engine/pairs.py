"""Two bodies with a spring between them whose law is linear: power series in time, exact to rounding.

With y the numbers of the state and A what each of them adds to the rates, ẏ = A y + b, and with r = A y(0) + b

    y(s) = y(0) + s r + s²/2! A r + s³/3! A² r + …

Within a time in which the fastest part of it hardly turns, two dozen terms are all that numbers can hold.
"""

from __future__ import annotations

import math

from servotwin.models.engine.elementary import fma
from servotwin.models.engine.modes import NOWHERE, Mode, Vector, sign_of
from servotwin.models.engine.rates import rates_of
from servotwin.models.terms import elastic, source
from servotwin.models.terms.dependence import BY_SHARE, ON_I, ON_Q, TWO_BODIES
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece

_LINEAR = TWO_BODIES | ON_Q | ON_I | BY_SHARE
_LONGEST = 2.0  # of a series, in times of the fastest rate
_TERMS = 40
_INVERSES = (0.0, *(1.0 / n for n in range(1, _TERMS + 1)))
_ROUNDING = 1e-18  # of the state: what a term may be


def linear(numbers: Numbers, on: int, u: Piece, tau: Piece) -> bool:
    """Tell whether two bodies move by one linear law, for what their accelerations depend on."""
    if not elastic.present(numbers.elastic) or on & ~_LINEAR or source.regulated(numbers.source):
        return False
    calm = u.slope == 0.0 and u.amplitude == 0.0 and tau.slope == 0.0 and tau.amplitude == 0.0
    return calm and numbers.elastic.gravity == 0.0


def law(numbers: Numbers, mode: Mode, u: float, tau: float) -> tuple[Vector, ...]:
    """Return what each number of the state adds to the rates; in the place of the temperatures b, and nothing.

    Voltage and torque are in b alone, so that the rest is the same to the last digit at any duty.
    """
    only_drops = sign_of(mode.zone) * numbers.bridge.D_drive  # leave nothing to drive the current
    driven = 0.0 if u == 0.0 else only_drops if only_drops != 0.0 else 1.0
    b = rates_of(numbers, mode, driven, 0.0, NOWHERE)
    return (_less(rates_of(numbers, mode, driven, 0.0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)), b),
            rates_of(numbers, mode, u, tau, NOWHERE), NOWHERE,
            _less(rates_of(numbers, mode, driven, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)), b))


def longest(A: tuple[Vector, ...]) -> float:
    """Return how long a series holds [s]."""
    by_q, by_w, by_i, _, _, by_q_m, by_w_m = A
    damping = abs(by_w[1]) + abs(by_w_m[6]) + abs(by_i[2])
    ringing = math.sqrt(abs(by_q[1]) + abs(by_q_m[6])) + math.sqrt(abs(by_i[1] * by_w[2]) + abs(by_i[6] * by_w_m[2]))
    return _LONGEST / max(damping + ringing, 1e-9)


def propagate(A: tuple[Vector, ...], start: Vector, s: float) -> Vector:
    """Return the state at s after the start [s], at most as long after as a series holds."""
    if A[2] == NOWHERE:
        return _without_current(A, start, s)
    q, w, i, T_w, T_h, q_m, w_m = start
    r = rates(A, start)
    size = 1.0 + abs(w) + abs(w_m) + abs(i)
    n, part = 1, s
    while n < _TERMS:
        q, w, i, q_m, w_m = (q + part * r[0], w + part * r[1], i + part * r[2], q_m + part * r[5],
                             w_m + part * r[6])
        if abs(part) * (abs(r[0]) + abs(r[1]) + abs(r[2]) + abs(r[5]) + abs(r[6])) < _ROUNDING * size:
            break
        r = _along(A, r)
        n += 1
        part *= s / n
    return q, w, i, T_w, T_h, q_m, w_m


def _without_current(A: tuple[Vector, ...], start: Vector, s: float) -> Vector:
    """Return the same where no current has inertia: of two angles, whose rates are the speeds, and two speeds."""
    q, w, i, T_w, T_h, q_m, w_m = start
    by_q, by_w, _, b, _, by_q_m, by_w_m = A
    a, c, a_m, c_m = by_q[1], by_w[1], by_q_m[1], by_w_m[1]
    d, e, d_m, e_m = by_q[6], by_w[6], by_q_m[6], by_w_m[6]
    least = _ROUNDING * (1.0 + abs(w) + abs(w_m))
    v, v_m = w, w_m
    x, x_m = (q * a + q_m * a_m) + (w * c + w_m * c_m) + b[1], (q * d + q_m * d_m) + (w * e + w_m * e_m) + b[6]
    n, part = 1, s
    while n < _TERMS:
        q, w, q_m, w_m = fma(part, v, q), fma(part, x, w), fma(part, v_m, q_m), fma(part, x_m, w_m)
        if part * (abs(v) + abs(x) + abs(v_m) + abs(x_m)) < least:
            break
        x, x_m, v, v_m = (fma(x, c, fma(x_m, c_m, fma(v, a, v_m * a_m))),
                          fma(x_m, e_m, fma(x, e, fma(v_m, d_m, v * d))), x, x_m)
        n += 1
        part *= s * _INVERSES[n]
    return q, w, i, T_w, T_h, q_m, w_m


def rates(A: tuple[Vector, ...], y: Vector) -> Vector:
    """Return the rates at a state."""
    r, b = _along(A, y), A[3]
    return (r[0] + b[0], r[1] + b[1], r[2] + b[2], 0.0, 0.0, r[5] + b[5], r[6] + b[6])


def _along(A: tuple[Vector, ...], y: Vector) -> Vector:
    """Return A y."""
    by_q, by_w, by_i, _, _, by_q_m, by_w_m = A
    q, w, i, _, _, q_m, w_m = y
    return (w * by_w[0] + w_m * by_w_m[0] + q * by_q[0],
            q * by_q[1] + w * by_w[1] + i * by_i[1] + q_m * by_q_m[1] + w_m * by_w_m[1],
            q * by_q[2] + w * by_w[2] + i * by_i[2] + q_m * by_q_m[2] + w_m * by_w_m[2],
            0.0, 0.0,
            w * by_w[5] + w_m * by_w_m[5] + q_m * by_q_m[5],
            q * by_q[6] + w * by_w[6] + i * by_i[6] + q_m * by_q_m[6] + w_m * by_w_m[6])


def _less(one: Vector, other: Vector) -> Vector:
    return (one[0] - other[0], one[1] - other[1], one[2] - other[2], 0.0, 0.0, one[5] - other[5], one[6] - other[6])
