"""Exponentials, logarithms and angles that have the same digits everywhere: of +, ·, /, comparisons, powers of 2.

C libraries and processors differ in the last digits of theirs. Methods and coefficients are those of fdlibm (Sun
Microsystems, 1993, "Freely distributable LIBM"); `power` sums a logarithm of 64 bits as there. Errors are at most two
units in the last place (`tests/physics/test_elementary.py`, against 60 digits). A result beyond the range of numbers is
inf or 0, one without a value nan. C of floats has the same text with the constants of `IN_FLOATS`, by which π and the
logarithm of 2 come in parts that floats hold exactly. Lanes in float32 have C's library instead, arrays have NumPy's.
"""

from __future__ import annotations

import math

_PER_LN2, _LN2_HIGH, _LN2_LOW = 1.4426950408889634, 0.6931471803691238, 1.9082149292705877e-10
_HALF_LN2 = 0.34657359027997264
_MOST, _LEAST = 709.782712893384, -745.1332191019412  # beyond, exp is inf or 0
_NOTHING = 5.6e-17  # less than half a unit of 1
_ROOT_HALF = 0.7071067811865476
_SUBNORMAL = 2.2250738585072014e-308  # the smallest number with all digits
_NORMAL, _LIFTED = 18014398509481984.0, 54.0  # 2^54
_EASY, _TOO_FAR = 1.6e6, 1.7e12  # rad: quarter turns have 20 bits; of more than 40 bits no digit of the sine is known
_QUARTERS, _PIO4 = 0.6366197723675814, 0.7853981633974483
_PIO2_1, _PIO2_1T = 1.5707963267341256, 6.077100506506192e-11  # the first 33 bits of π/2, and the rest
_PIO2_2, _PIO2_2T = 6.077100506303966e-11, 2.0222662487959506e-21
_PIO2_3, _PIO2_3T = 2.0222662487111665e-21, 8.4784276603689e-32
_PI, _PI_LOW, _PIO2 = 3.141592653589793, 1.2246467991473532e-16, 1.5707963267948966
_NEAR, _NEARER = 65536.0, 562949953421312.0  # so many times beyond what is left of an angle more digits of π/2 count
_PART = 1048576.0  # 2^20: by which a number of quarters of up to 40 bits comes in halves
_ROUNDING = 6755399441055744.0  # 1.5 · 2^52: added and taken away, it leaves the nearest whole number
_SPLITTER = 134217729.0  # 2^27 + 1
_LN15, _LN15_LOW = 0.4054651079932228, 1.1494160890290935e-10  # ln 1.5 in two parts
IN_FLOATS = {
    "_LN2_HIGH": 0.693145751953125, "_LN2_LOW": 1.4286068203094e-06, "_MOST": 88.72283172607422,
    "_LEAST": -103.97207641601562, "_NOTHING": 2.9e-08, "_SUBNORMAL": 1.1754943508222875e-38, "_NORMAL": 33554432.0,
    "_LIFTED": 25.0, "_EASY": 200.0, "_TOO_FAR": 2.5e4,
    "_PIO2_1": 1.5707855224609375, "_PIO2_1T": 1.0804333959119e-05,
    "_PIO2_2": 1.0804273188114e-05, "_PIO2_2T": 6.0771005065062e-11, "_PIO2_3": 6.0770943832722e-11,
    "_PIO2_3T": 6.1232339957368e-17, "_PI_LOW": -8.7422780003725e-08, "_NEAR": 256.0, "_NEARER": 33554432.0,
    "_PART": 128.0, "_ROUNDING": 12582912.0, "_SPLITTER": 4097.0,
    "_LN15": 0.4054718017578125, "_LN15_LOW": -6.6936496481e-06}


def scaled(x: float, k: float) -> float:
    """Return x · 2^k for a whole k, of at most 2000; compiled, by products.

    Examples
    --------
    >>> scaled(1.5, -1.0)
    0.75
    """
    return math.ldexp(x, int(k))


def binary_exponent(x: float) -> float:
    """Return the whole e for which x / 2^e lies in [√½, √2), for a normal x > 0.

    Examples
    --------
    >>> binary_exponent(1.0), binary_exponent(1.5), binary_exponent(6.0)
    (0.0, 1.0, 3.0)
    """
    mantissa, exponent = math.frexp(x)
    return exponent - 1.0 if mantissa < _ROOT_HALF else float(exponent)


def exp(x: float) -> float:
    """Return e^x.

    Examples
    --------
    >>> exp(0.0), exp(1.0), exp(-800.0), exp(800.0)
    (1.0, 2.718281828459045, 0.0, inf)
    """
    if not _LEAST <= x <= _MOST:
        return x if x != x else 0.0 if x < 0.0 else math.inf
    if -_HALF_LN2 < x < _HALF_LN2:
        k, high, low, r = 0.0, x, 0.0, x
    else:
        k = (x * _PER_LN2 + _ROUNDING) - _ROUNDING  # the nearest whole number
        high, low = x - k * _LN2_HIGH, k * _LN2_LOW
        r = high - low
    t = r * r
    c = r - t * (1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + t * (
        6.61375632143793436117e-05 + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))))
    y = 1.0 - ((low - r * c / (2.0 - c)) - high)
    return y if k == 0.0 else scaled(y, k)


def expm1(x: float) -> float:
    """Return e^x − 1, right for small x too.

    Examples
    --------
    >>> expm1(1e-20), expm1(1.0), expm1(-50.0)
    (1e-20, 1.718281828459045, -1.0)
    """
    if not -40.0 < x <= _MOST:
        return x if x != x else -1.0 if x < 0.0 else math.inf
    if -_NOTHING < x < _NOTHING:
        return x
    if -_HALF_LN2 < x < _HALF_LN2:
        k, c, r = 0.0, 0.0, x
    else:
        k = (x * _PER_LN2 + _ROUNDING) - _ROUNDING
        high, low = x - k * _LN2_HIGH, k * _LN2_LOW
        r = high - low
        c = (high - r) - low
    half = 0.5 * r
    hxs = r * half
    r1 = 1.0 + hxs * (-3.33333333333331316428e-02 + hxs * (1.58730158725481460165e-03 + hxs * (
        -7.93650757867487942473e-05 + hxs * (4.00821782732936239552e-06 + hxs * -2.01099218183624371326e-07))))
    t = 3.0 - r1 * half
    e = hxs * ((r1 - t) / (6.0 - r * t))
    if k == 0.0:
        return r - (r * e - hxs)
    e = (r * (e - c) - c) - hxs
    if k == -1.0:
        return 0.5 * (r - e) - 0.5
    if k == 1.0:
        return -2.0 * (e - (r + 0.5)) if r < -0.25 else 1.0 + 2.0 * (r - e)
    if k < 0.0 or k > 56.0:
        return scaled(1.0 - (e - r), k) - 1.0
    part = scaled(1.0, -k)
    if k < 20.0:
        return scaled((1.0 - part) - (e - r), k)
    return scaled((r - (e + part)) + 1.0, k)


def log(x: float) -> float:
    """Return ln x.

    Examples
    --------
    >>> log(1.0), log(10.0), log(0.0), log(-1.0)
    (0.0, 2.302585092994046, -inf, nan)
    """
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else x if x > 0.0 else math.nan
    lifted = 0.0
    if x < _SUBNORMAL:
        x, lifted = x * _NORMAL, _LIFTED
    k = binary_exponent(x)
    return _log_of(k - lifted, scaled(x, -k) - 1.0, 0.0)


def log1p(x: float) -> float:
    """Return ln(1 + x), right for small x too.

    Examples
    --------
    >>> log1p(1e-20), log1p(1.0), log1p(-1.0)
    (1e-20, 0.6931471805599453, -inf)
    """
    if not -1.0 < x < math.inf:
        return -math.inf if x == -1.0 else x if x > 0.0 else math.nan
    if -_NOTHING < x < _NOTHING:
        return x
    if -0.2928 < x < 0.4142:
        return _log_of(0.0, x, 0.0)
    u = 1.0 + x
    k = binary_exponent(u)
    lost = (1.0 - (u - x) if k > 0.0 else x - (u - 1.0)) / u
    return _log_of(k, scaled(u, -k) - 1.0, lost)


def _log_of(k: float, f: float, lost: float) -> float:
    """Return k ln 2 + ln(1 + f) + lost for √½ ≤ 1 + f ≤ √2."""
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    R = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * (
        1.818357216161805012e-01 + w * 1.479819860511658591e-01))) + w * (
            3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    half = 0.5 * f * f
    return k * _LN2_HIGH - ((half - (s * (half + R) + (k * _LN2_LOW + lost))) - f)


def sin(x: float) -> float:
    """Return sin x; nan from 1.7e12 rad on.

    Examples
    --------
    >>> sin(0.5), sin(-100.0)
    (0.479425538604203, 0.5063656411097588)
    """
    if -_PIO4 <= x <= _PIO4:
        return _sine(x, 0.0)
    turn, r, low = _quarter(x)
    part = _cosine(r, low) if turn == 1.0 or turn == 3.0 else _sine(r, low)
    return -part if turn >= 2.0 else part


def cos(x: float) -> float:
    """Return cos x; nan from 1.7e12 rad on.

    Examples
    --------
    >>> cos(0.5), cos(-100.0)
    (0.8775825618903728, 0.8623188722876839)
    """
    if -_PIO4 <= x <= _PIO4:
        return _cosine(x, 0.0)
    turn, r, low = _quarter(x)
    part = _sine(r, low) if turn == 1.0 or turn == 3.0 else _cosine(r, low)
    return -part if turn == 1.0 or turn == 2.0 else part


def _sine(x: float, low: float) -> float:
    """Return sin(x + low) for |x| ≤ π/4."""
    z = x * x
    v = z * x
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))
    return x - ((z * (0.5 * low - v * r) - low) - v * -1.66666666666666324348e-01)


def _cosine(x: float, low: float) -> float:
    """Return cos(x + low) for |x| ≤ π/4."""
    z = x * x
    r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * (
        -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))))
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * low))


def _quarter(x: float) -> tuple[float, float, float]:
    """Return the quarter turn (0 to 3) that is next to x, and what is left of x in two parts."""
    if not abs(x) < _TOO_FAR:
        return 0.0, math.nan, 0.0
    n = (x * _QUARTERS + _ROUNDING) - _ROUNDING
    turn = n - 4.0 * math.floor(0.25 * n)
    if not abs(x) < _EASY:
        r, low = _far(x, n)
        return turn, r, low
    rest, lost = x - n * _PIO2_1, n * _PIO2_1T
    r = rest - lost
    if abs(r) * _NEAR < abs(x):  # next to a quarter: more digits of π/2 count
        before, lost = rest, n * _PIO2_2
        rest = before - lost
        lost = n * _PIO2_2T - ((before - rest) - lost)
        r = rest - lost
        if abs(r) * _NEARER < abs(x):
            before, lost = rest, n * _PIO2_3
            rest = before - lost
            lost = n * _PIO2_3T - ((before - rest) - lost)
            r = rest - lost
    return turn, r, (rest - r) - lost


def _far(x: float, n: float) -> tuple[float, float]:
    """Return x − n π/2 in two parts, for an n of up to 40 bits: each half of it by each part of π/2 is exact."""
    above = math.floor(n / _PART) * _PART
    below = n - above
    a = (x - above * _PIO2_1) - below * _PIO2_1
    b = a - above * _PIO2_2
    lost = (a - b) - above * _PIO2_2
    c = b - below * _PIO2_2
    lost += (b - c) - below * _PIO2_2
    lost -= above * _PIO2_3 + below * _PIO2_3 + n * _PIO2_3T
    r = c + lost
    return r, (c - r) + lost


def tanh(x: float) -> float:
    """Return tanh x.

    Examples
    --------
    >>> tanh(0.5), tanh(-30.0)
    (0.46211715726000973, -1.0)
    """
    size = abs(x)
    if not size < 22.0:
        return x if x != x else math.copysign(1.0, x)
    if size < 1.0:
        t = expm1(-2.0 * size)
        return math.copysign(-t / (t + 2.0), x)
    return math.copysign(1.0 - 2.0 / (expm1(2.0 * size) + 2.0), x)


def atanh(x: float) -> float:
    """Return artanh x.

    Examples
    --------
    >>> atanh(0.5), atanh(-1.0), atanh(2.0)
    (0.5493061443340548, -inf, nan)
    """
    size = abs(x)
    if not size < 1.0:
        return math.copysign(math.inf, x) if size == 1.0 else math.nan
    twice = size + size
    y = 0.5 * log1p(twice + twice * size / (1.0 - size) if size < 0.5 else twice / (1.0 - size))
    return math.copysign(y, x)


def atan2(y: float, x: float) -> float:
    """Return the angle of the point (x, y), from −π to π.

    Examples
    --------
    >>> atan2(1.0, -1.0), atan2(-0.0, -1.0), atan2(0.0, 0.0)
    (2.356194490192345, -3.141592653589793, 0.0)
    """
    if x != x or y != y:
        return math.nan
    size, base = abs(y), abs(x)
    back = math.copysign(1.0, x) < 0.0
    if size == 0.0:
        z = 0.0
    elif base == 0.0 or (size == math.inf and base < math.inf):
        return math.copysign(_PIO2, y)
    else:
        z = _PIO4 if size == base else _arc(size / base)
    return math.copysign(_PI - (z - _PI_LOW) if back else z, y)


def _arc(x: float) -> float:
    """Return arctan x for x ≥ 0."""
    if x > 7.3e19:
        return _PIO2
    if x < 0.4375:
        high, low, r = 0.0, 0.0, x
    elif x < 0.6875:
        high, low, r = 4.63647609000806093515e-01, 2.26987774529616870924e-17, (2.0 * x - 1.0) / (2.0 + x)
    elif x < 1.1875:
        high, low, r = 7.85398163397448278999e-01, 3.06161699786838301793e-17, (x - 1.0) / (x + 1.0)
    elif x < 2.4375:
        high, low, r = 9.82793723247329054082e-01, 1.39033110312309984516e-17, (x - 1.5) / (1.0 + 1.5 * x)
    else:
        high, low, r = 1.57079632679489655800e+00, 6.12323399573676603587e-17, -1.0 / x
    z = r * r
    w = z * z
    even = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * (9.09088713343650656196e-02 + w * (
        6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))))
    odd = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * (-7.69187620504482999495e-02 + w * (
        -5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))))
    return high - ((r * (even + odd) - low) - r)


def power(x: float, y: float) -> float:
    """Return x^y for x ≥ 0.

    Examples
    --------
    >>> power(2.0, 0.5), power(0.0, 0.25), power(10.0, -3.0)
    (1.414213562373095, 0.0, 0.001)
    """
    if y == 0.0 or x == 1.0:
        return 1.0
    if not 0.0 < x < math.inf:
        return math.nan if not x >= 0.0 or y != y else 0.0 if (x == 0.0) == (y > 0.0) else math.inf
    lifted = 0.0
    if x < _SUBNORMAL:
        x, lifted = x * _NORMAL, _LIFTED
    k = binary_exponent(x)
    m = scaled(x, -k)
    if m < 0.8660254037844386:
        m, k = 2.0 * m, k - 1.0
    near = 1.5 if m > 1.224744871391589 else 1.0  # s = (m − near)/(m + near) is at most 0.1, and has 80 bits
    f, below = m - near, m + near
    s = f / below
    s_high, below_high = _high(s), _high(below)
    below_low = m - (below_high - near)
    s_low = ((f - s_high * below_high) - s_high * below_low) / below
    z = s * s
    cubes = s * z * (6.666666666666666e-01 + z * (4.0e-01 + z * (2.857142857142857e-01 + z * (
        2.222222222222222e-01 + z * (1.818181818181818e-01 + z * (1.538461538461538e-01 + z * (
            1.333333333333333e-01 + z * 1.176470588235294e-01)))))))
    k -= lifted
    table_high, table_low = (_LN15, _LN15_LOW) if near == 1.5 else (0.0, 0.0)
    parts = (k * _LN2_LOW + table_low) + (2.0 * s_low + cubes)
    leading = k * _LN2_HIGH + table_high
    high = leading + 2.0 * s_high
    low = (2.0 * s_high - (high - leading)) + parts
    sum_ = high + low
    high, low = sum_, (high - sum_) + low
    y_high, ln_high = _high(y), _high(high)
    first = y_high * ln_high
    rest = (y - y_high) * ln_high + y * ((high - ln_high) + low)
    found = exp(first + rest)
    left = (first - (first + rest)) + rest
    return found + found * left if 0.0 < found < math.inf else found


def _high(x: float) -> float:
    """Return the leading half of the digits of a number."""
    part = _SPLITTER * x
    return part - (part - x)
