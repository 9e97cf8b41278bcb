"""Exponentials and logarithms as polynomials, so that a compiler can run them on many servos side by side.

Everything is made of +, ·, /, comparisons and the primitives at the top, which the compiler replaces by single
instructions. The result is right to one or two units in the last place, and the same in every lane.
"""

from __future__ import annotations

import math
from typing import Any

from servotwin.physics.elementary import binary_exponent

SINGLE = False  # the compiler derives the float32 form with True

_PER_LN2 = 1.4426950408889634
_SPLIT = 0.34657359027997264  # ln 2 / 2
_LARGEST = 700.0  # e^-x is 1e-304
_LARGEST_SINGLE = 80.0


def fma(a: float, b: float, c: float) -> float:
    """Return a b + c; compiled, it is rounded once."""
    return a * b + c


def two_power(k: float) -> float:
    """Return 2^k for a whole k with |k| < 1022 (126 in float32); compiled, anything beyond.

    Examples
    --------
    >>> two_power(-2.0)
    0.25
    """
    return math.ldexp(1.0, int(k)) if abs(k) < 1022.0 else math.inf


def anew(tile: Any) -> Any:
    """Return a tile; compiled, what is read of it is read here, and not kept in registers from before."""
    return tile


def nearest(x: float) -> float:
    """Return the nearest whole number, for |x| < 2^51 (2^22 in float32)."""
    magic = 12582912.0 if SINGLE else 6755399441055744.0
    return (x + magic) - magic


def floor(x: float) -> float:
    """Return the next whole number below; compiled, for any number.

    Examples
    --------
    >>> floor(-1.5), floor(2.0)
    (-2.0, 2.0)
    """
    return float(math.floor(x))


def _reduced(x: float) -> tuple[float, float]:
    """Return k and r with x = k ln 2 + r, |r| ≤ ln 2 / 2."""
    k = nearest(x * _PER_LN2)
    if SINGLE:
        return k, fma(-k, 3.1946184945309415e-05, fma(-k, 0.693115234375, x))
    return k, fma(-k, 1.9082149292705877e-10, fma(-k, 0.6931471803691238, x))


def _remainder(r: float) -> float:
    """Return (e^-r − 1 + r) / r² for |r| ≤ ln 2 / 2."""
    if SINGLE:
        r2 = r * r
        a = fma(r, -0.16666666681725, 0.5000000013557447)
        b = fma(r, -0.008333310823923211, 0.04166646401078555)
        c = fma(r, -0.00019891103420544327, 0.0013933751387987224)
        return fma(r2, fma(r2, c, b), a)
    r2 = r * r
    r4 = r2 * r2
    a = fma(r2, fma(r, -0.00833333333332607, 0.04166666666666667), fma(r, -0.1666666666666667, 0.5))
    b = fma(r2, fma(r, -2.755725511097889e-06, 2.480158732571076e-05),
            fma(r, -0.00019841269875048905, 0.0013888888888883703))
    c = fma(r2, 2.091477283224809e-09, fma(r, -2.510533724466521e-08, 2.755727343657049e-07))
    return fma(r4, fma(r4, c, b), a)


def exp(x: float) -> float:
    """Return e^x; beyond what the type holds, its largest or smallest power about.

    Examples
    --------
    >>> exp(0.0), round(exp(1.0), 12)
    (1.0, 2.718281828459)
    """
    most = _LARGEST_SINGLE if SINGLE else _LARGEST
    k, r = _reduced(min(max(x, -most), most))
    return two_power(k) * fma(r * r, _remainder(-r), 1.0 + r)


def decay(rate: float, inverse: float, t: float) -> tuple[float, float]:
    """Return ∫ e^-λs ds and ∫∫ e^-λs ds² from 0 to t, without cancellation for λ t near zero.

    Parameters
    ----------
    rate, inverse : float
        λ ≥ 0 [1/s] and 1/λ [s] (0 for λ = 0).
    t : float
        ≥ 0 [s]

    Examples
    --------
    >>> decay(0.0, 0.0, 2.0)
    (2.0, 2.0)
    """
    x = min(rate * t, _LARGEST_SINGLE if SINGLE else _LARGEST)
    k, r = _reduced(x)
    p = _remainder(r)
    fall = two_power(-k) * fma(r * r, p, 1.0 - r)
    if x < _SPLIT:
        return t * fma(-x, p, 1.0), t * t * p
    once = (1.0 - fall) * inverse
    return once, (t - once) * inverse


def fading(rate: float, inverse: float, t: float) -> tuple[float, float]:
    """Return the same for λ > 0, with fewer operations.

    Examples
    --------
    >>> once, twice = fading(2.0, 0.5, 0.5)
    >>> round(once, 12), round(twice, 12)
    (0.316060279414, 0.091969860293)
    """
    x = rate * t
    k, r = _reduced(min(x, _LARGEST_SINGLE if SINGLE else _LARGEST))
    bend = r * r * _remainder(r)  # e^-r − 1 + r
    power = two_power(-k)
    once = fma(power, r - bend, 1.0 - power)  # 1 − e^-x, without cancellation where k = 0
    twice = bend if k == 0.0 else x - once
    return once * inverse, twice * (inverse * inverse)


def _log_tail(e: float, f: float, rest: float) -> float:
    """Return f − (e ln 2 + ln(1 + f) + rest) for √½ ≤ 1 + f ≤ √2, but for the leading part of ln 2."""
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    if SINGLE:
        R = z * fma(z, fma(z, 0.295856807745129, 0.39988653938211444), 0.6666668534980387)
        return half - fma(s, half + R, fma(e, 3.1946184945309415e-05, rest))
    z2 = z * z
    even = fma(z2, fma(z2, fma(z2, 0.1462395660821188, 0.1818290749767122), 0.28571428627528794), 0.666666666666667)
    odd = fma(z2, fma(z2, 0.1533111258796017, 0.22222210881932927), 0.3999999999989607)
    R = z * fma(z, odd, even)
    return half - fma(s, half + R, fma(e, 1.9082149292705877e-10, rest))


def _ln2_parts(e: float, f: float, tail: float) -> float:
    return fma(e, 0.693115234375 if SINGLE else 0.6931471803691238, f - tail)


def log(x: float) -> float:
    """Return ln x for x > 0.

    Examples
    --------
    >>> log(1.0), log(8.0) / log(2.0)
    (0.0, 3.0)
    """
    e = binary_exponent(x)
    f = x * two_power(-e) - 1.0
    return _ln2_parts(e, f, _log_tail(e, f, 0.0))


def log1p(x: float) -> float:
    """Return ln(1 + x) for x ≥ 0, right for small x too.

    Examples
    --------
    >>> log1p(1e-20)
    1e-20
    """
    return log1p_and_rest(x)[0]


def log1p_and_rest(x: float) -> tuple[float, float]:
    """Return ln(1 + x) and x − ln(1 + x) for x ≥ 0, both right for small x too."""
    u = 1.0 + x
    e = binary_exponent(u)
    scale = two_power(-e)
    small = e == 0.0
    f = x if small else u * scale - 1.0
    lost = 0.0 if small else (x - (u - 1.0)) * scale  # what u has rounded away counts 1/(1 + f) times, about
    tail = _log_tail(e, f, lost * fma(f, f - 1.0, 1.0))
    y = _ln2_parts(e, f, tail)
    return y, (tail if small else x - y)


def sin(x: float) -> float:
    """Return sin x for |x| < 1e5, in float64 alone.

    Examples
    --------
    >>> sin(0.0), round(sin(100.0), 12)
    (0.0, -0.506365641110)
    """
    k = nearest(x * 0.6366197723675814)  # quarter turns
    r = fma(-k, 2.0222662487959506e-21, fma(-k, 6.077100506303966e-11, fma(-k, 1.5707963267341256, x)))
    r2 = r * r
    sine = fma(r * r2, fma(r2, fma(r2, fma(r2, fma(r2, fma(r2, 1.58969099521155010221e-10, -2.50507602534068634195e-08),
                                                   2.75573137070700676789e-06), -1.98412698298579493134e-04),
                                   8.33333333332248946124e-03), -1.66666666666666324348e-01), r)
    cosine = fma(r2 * r2, fma(r2, fma(r2, fma(r2, fma(r2, fma(r2, -1.13596475577881948265e-11,
                                                              2.08757232129817482790e-09),
                                                      -2.75573143513906633035e-07), 2.48015872894767294178e-05),
                                      -1.38888888888741095749e-03), 4.16666666666666019037e-02), 1.0 - 0.5 * r2)
    turn = k - 4.0 * nearest(0.25 * k)  # −2 … 2
    part = cosine if abs(turn) == 1.0 else sine
    return -part if turn == -1.0 or abs(turn) == 2.0 else part
