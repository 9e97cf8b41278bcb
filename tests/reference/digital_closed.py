"""A sliding shaft of constant numbers, w' = a − λ w + c t: closed form, turning point and first times."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

from scipy.optimize import brentq

ORDERS = (1, 2, 3)


def phi(z: float) -> tuple[float, float, float]:
    """φ_k(z) = Σ z^j / (j + k)! for k = 1, 2, 3."""
    if abs(z) < 1.0:
        return tuple(math.fsum(z**j / math.factorial(j + k) for j in range(20)) for k in ORDERS)  # type: ignore[return-value]
    one = math.expm1(z) / z
    two = (one - 1.0) / z
    return one, two, (two - 0.5) / z


class Slide(NamedTuple):
    """Start (q, w) at local time 0 and the law's numbers."""

    q: float
    w: float
    a: float
    rate: float
    c: float

    def at(self, t: float) -> tuple[float, float]:
        """Angle and speed."""
        one, two, three = phi(-self.rate * t)
        push = self.a - self.rate * self.w
        return (self.q + t * (self.w + t * (push * two + t * self.c * three)),
                self.w + t * (push * one + t * self.c * two))

    def turning(self) -> float:
        """Time at which the acceleration is 0; inf: never."""
        push = self.a - self.rate * self.w
        if self.c == 0.0 or push == 0.0 or self.c * push > 0.0:
            return math.inf  # w' = push e^{−λt} + c t φ_1(−λt), both of one sign
        if self.rate == 0.0:
            return -push / self.c
        return math.log1p(-self.rate * push / self.c) / self.rate

    def first(self, low: float, high: float, end: float) -> float | None:
        """First time up to `end` at which the speed leaves [low, high] by passing a bound; inside at the start."""
        turn = self.turning()
        parts = [0.0, turn, end] if turn < end else [0.0, end]
        for begin, stop in pairwise(parts):
            w = self.at(stop)[1]
            for bound, left in ((low, w < low), (high, w > high)):
                if left:
                    return self._crossing(begin, stop, bound)
        return None

    def _crossing(self, begin: float, stop: float, bound: float) -> float:
        def off(t: float) -> float:
            return self.at(t)[1] - bound

        if off(begin) * off(stop) >= 0.0:
            return begin  # it starts on the bound and leaves at once
        return float(brentq(off, begin, stop, xtol=1e-18, rtol=1e-15))

    def reaches(self, angle: float, end: float) -> float:
        """Time at which a shaft that slides one way reaches an angle beyond which it is at `end`."""
        if (self.at(0.0)[0] - angle) * (self.at(end)[0] - angle) >= 0.0:
            return 0.0
        return float(brentq(lambda t: self.at(t)[0] - angle, 0.0, end, xtol=1e-18, rtol=1e-15))
