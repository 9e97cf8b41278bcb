"""Taylor series of one smooth piece of the shaft's motion, and the first zero of a polynomial.

Between two events the shaft obeys J dw/dt = c − drag w − k (q − q_r) − g sin(q − q_h) − slope x, x the time since the
start: its Taylor coefficients follow one from the other, so a step of order 26 is exact to rounding, the state between
is a polynomial, and an event is a zero of one. No step of an integrator ever straddles an event.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.optimize import brentq

ORDER = 26
SPLIT = 8  # samples of a guard over a step
TINY = 1e-17  # last term of a step, beside the state


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Coefficients of the smooth right side, all divided by the inertia."""

    constant: float  # everything at the start that depends neither on q nor on w
    slope: float  # of the external torque over time
    drag: float
    stiffness: float
    rest: float
    gravity: float
    hanging: float


def series(m: Motion, q: float, w: float, order: int = ORDER) -> tuple[list[float], list[float]]:
    """Coefficients of q(x) and w(x), `order` + 1 of each."""
    Q, W = [q], [w]
    pull, swings = m.stiffness, m.gravity != 0.0
    s, c = ([math.sin(q - m.hanging)], [math.cos(q - m.hanging)]) if swings else ([0.0], [0.0])
    turns: list[float] = [0.0]  # n Q[n]
    for n in range(order):
        rate = -m.drag * W[n] - pull * (Q[n] - m.rest if n == 0 else Q[n])
        if swings:
            rate -= m.gravity * s[n]
        rate += m.constant if n == 0 else (-m.slope if n == 1 else 0.0)
        Q.append(W[n] / (n + 1))
        W.append(rate / (n + 1))
        if swings:
            turns.append(W[n])
            s.append(sum(turns[j] * c[n + 1 - j] for j in range(1, n + 2)) / (n + 1))
            c.append(-sum(turns[j] * s[n + 1 - j] for j in range(1, n + 2)) / (n + 1))
    return Q, W


def reach(Q: Sequence[float], W: Sequence[float], drag: float) -> float:
    """Step on which the last two terms stay below rounding, and no term is much larger than the sum."""
    n = len(W) - 1
    h = 1.0 / drag if drag > 0.0 else math.inf
    for a, scale in ((W, 1.0), (Q, 1.0)):
        for k in (n, n - 1):
            if a[k] != 0.0:
                h = min(h, 0.9 * (TINY * scale / abs(a[k])) ** (1.0 / k))
    return h


def value(a: Sequence[float], x: float) -> float:
    """Polynomial by Horner's rule."""
    y = 0.0
    for coefficient in reversed(a):
        y = y * x + coefficient
    return y


def _derivative(a: Sequence[float]) -> list[float]:
    return [n * a[n] for n in range(1, len(a))]


def first_zero(a: Sequence[float], h: float) -> float:
    """First x in (0, h] where a polynomial that is positive just after 0 turns negative; inf if it does not.

    A guard that starts at exactly 0 has just been an event; its zero there is divided out.
    """
    start = 0
    while start < 3 and a[start] <= 0.0:
        if a[start] < -1e-9:
            raise RuntimeError(f"a guard starts at {a[start]} (coefficient {start})")
        start += 1
    a = a[start:]
    power = bound = 0.0
    power = 1.0
    for coefficient in a[1:]:
        power *= h
        bound += abs(coefficient) * power
    if bound < a[0]:
        return math.inf
    lo, p_lo = 0.0, a[0]
    slope = _derivative(a)
    for n in range(1, SPLIT + 1):
        hi = h * n / SPLIT
        p_hi = value(a, hi)
        if p_hi >= 0.0 and value(slope, lo) < 0.0 < value(slope, hi):  # a dip between two samples
            low = float(brentq(lambda x: value(slope, x), lo, hi, xtol=1e-18, rtol=8.9e-16))
            if value(a, low) < 0.0:
                hi, p_hi = low, value(a, low)
        if p_hi < 0.0:
            if p_lo <= 0.0:
                return lo
            return float(brentq(lambda x: value(a, x), lo, hi, xtol=1e-18, rtol=8.9e-16))
        lo, p_lo = hi, p_hi
    return math.inf
