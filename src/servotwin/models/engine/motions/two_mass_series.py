"""Two bodies with a spring between them whose law is linear: power series in time, exact to rounding.

With y the numbers of the state and A what each of them adds to the rates, ẏ = A y + b, and with r = A y(0) + b

    y(s) = y(0) + s r + s²/2! A r + s³/3! A² r + …

Within a time in which the fastest part of it hardly turns, two dozen terms are all that numbers can hold.
"""

from __future__ import annotations

import math

from servotwin.models.engine.dynamics.coefficients import rates_of
from servotwin.models.engine.motions.elementary import fma
from servotwin.models.state.modes import NOWHERE, Mode, Vector, sign_of
from servotwin.models.terms import elastic, source
from servotwin.models.terms.dependence import BY_SHARE, ON_I, ON_Q, TWO_BODIES
from servotwin.models.terms.numbers import Numbers
from servotwin.physics.pieces import Piece

_LINEAR = TWO_BODIES | ON_Q | ON_I | BY_SHARE
_LONGEST = 2.0  # of a series, in times of the fastest rate
_TERMS = 40
_INVERSES = (0.0, *(1.0 / n for n in range(1, _TERMS + 1)))
_ROUNDING = 1e-18  # of the state: what a term may be
IN_FLOATS = {"_ROUNDING": 1e-9}


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
    return (_less(rates_of(numbers, mode, driven, 0.0, Vector(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, Vector(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, Vector(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)), b),
            rates_of(numbers, mode, u, tau, NOWHERE), NOWHERE,
            _less(rates_of(numbers, mode, driven, 0.0, Vector(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)), b),
            _less(rates_of(numbers, mode, driven, 0.0, Vector(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)), b))


def longest(A: tuple[Vector, ...]) -> float:
    """Return how long a series holds [s]."""
    by_q, by_w, by_i, _, _, by_q_m, by_w_m = A
    damping = abs(by_w.w) + abs(by_w_m.w_m) + abs(by_i.i)
    ringing = math.sqrt(abs(by_q.w) + abs(by_q_m.w_m)) + math.sqrt(abs(by_i.w * by_w.i) + abs(by_i.w_m * by_w_m.i))
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
        q, w, i, q_m, w_m = (q + part * r.q, w + part * r.w, i + part * r.i, q_m + part * r.q_m,
                             w_m + part * r.w_m)
        if abs(part) * (abs(r.q) + abs(r.w) + abs(r.i) + abs(r.q_m) + abs(r.w_m)) < _ROUNDING * size:
            break
        r = _along(A, r)
        n += 1
        part *= s / n
    return Vector(q, w, i, T_w, T_h, q_m, w_m)


def _without_current(A: tuple[Vector, ...], start: Vector, s: float) -> Vector:
    """Return the same where no current has inertia: of two angles, whose rates are the speeds, and two speeds."""
    q, w, i, T_w, T_h, q_m, w_m = start
    by_q, by_w, _, b, _, by_q_m, by_w_m = A
    a, c, a_m, c_m = by_q.w, by_w.w, by_q_m.w, by_w_m.w
    d, e, d_m, e_m = by_q.w_m, by_w.w_m, by_q_m.w_m, by_w_m.w_m
    least = _ROUNDING * (1.0 + abs(w) + abs(w_m))
    v, v_m = w, w_m
    x, x_m = (q * a + q_m * a_m) + (w * c + w_m * c_m) + b.w, (q * d + q_m * d_m) + (w * e + w_m * e_m) + b.w_m
    n, part = 1, s
    while n < _TERMS:
        q, w, q_m, w_m = fma(part, v, q), fma(part, x, w), fma(part, v_m, q_m), fma(part, x_m, w_m)
        if part * (abs(v) + abs(x) + abs(v_m) + abs(x_m)) < least:
            break
        x, x_m, v, v_m = (fma(x, c, fma(x_m, c_m, fma(v, a, v_m * a_m))),
                          fma(x_m, e_m, fma(x, e, fma(v_m, d_m, v * d))), x, x_m)
        n += 1
        part *= s * _INVERSES[n]
    return Vector(q, w, i, T_w, T_h, q_m, w_m)


def rates(A: tuple[Vector, ...], y: Vector) -> Vector:
    """Return the rates at a state."""
    r, b = _along(A, y), A[3]
    return Vector(r.q + b.q, r.w + b.w, r.i + b.i, 0.0, 0.0, r.q_m + b.q_m, r.w_m + b.w_m)


def _along(A: tuple[Vector, ...], y: Vector) -> Vector:
    """Return A y."""
    by_q, by_w, by_i, _, _, by_q_m, by_w_m = A
    q, w, i, _, _, q_m, w_m = y
    return Vector(w * by_w.q + w_m * by_w_m.q + q * by_q.q,
            q * by_q.w + w * by_w.w + i * by_i.w + q_m * by_q_m.w + w_m * by_w_m.w,
            q * by_q.i + w * by_w.i + i * by_i.i + q_m * by_q_m.i + w_m * by_w_m.i,
            0.0, 0.0,
            w * by_w.q_m + w_m * by_w_m.q_m + q_m * by_q_m.q_m,
            q * by_q.w_m + w * by_w.w_m + i * by_i.w_m + q_m * by_q_m.w_m + w_m * by_w_m.w_m)


def _less(one: Vector, other: Vector) -> Vector:
    return Vector(one.q - other.q, one.w - other.w, one.i - other.i, 0.0, 0.0, one.q_m - other.q_m, one.w_m - other.w_m)
