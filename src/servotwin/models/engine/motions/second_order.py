"""Exact solution of one linear second-order motion, the form of every sliding mode without inductance.

    q̈ + 2 a q̇ + c q = f0 + f1 s + fs sin(φ + Ω s),    q(0) = q0, q̇(0) = w0

With g the impulse response, G1 and G2 its first and second integrals,

    q(s) = q0 + w0 g + (f0 − c q0) G1 + f1 G2 + sinusoid,    q̇(s) = w0 ġ + (f0 − c q0) g + f1 G1 + sinusoid

which loses no digits for a or c near zero, near critical damping, or for short and long times. Where q stands for
the speed of a motor with inductance, its integral, with G3 the integral of G2, is the angle.
"""

from __future__ import annotations

import math

from servotwin.physics.elementary import atan2, atanh, cos, exp, expm1, sin

_TERM = 1e-18  # of a series: what follows is below rounding
_SMALL = 1e-8  # its square is below rounding
IN_FLOATS = {"_TERM": 1e-9, "_SMALL": 1e-4}
FAR = 0.01  # roots are far apart where their distance is a tenth of their mean


def response(a: float, c: float, s: float) -> tuple[float, float, float, float, float]:
    """Return ġ, g, G1, G2, G3 at s ≥ 0 for g̈ + 2 a ġ + c g = 0, g(0) = 0, ġ(0) = 1, with a ≥ 0."""
    d = a * a - c
    if d > FAR * a * a and not _short(a * s, c * s * s):
        return _distinct(a, c, math.sqrt(d), s)
    return response_of_near_roots(a, c, d, math.sqrt(abs(d)), s)


def response_of_near_roots(a: float, c: float, d: float, root: float,
                           s: float) -> tuple[float, float, float, float, float]:
    """Return the same where roots are complex or close, for d = a² − c and √|d|; for short times in any case."""
    x, y = a * s, c * s * s
    return _series(x, y, s) if _short(x, y) else _close(a, c, d, root, s)


def _short(x: float, y: float) -> bool:
    return x < 0.25 and -0.25 < y < 0.25


def _series(x: float, y: float, s: float) -> tuple[float, float, float, float, float]:
    # Taylor coefficients of g, scaled by s: p[n+2] = -(2x (n+1) p[n+1] + y p[n]) / ((n+2)(n+1))
    before = 0.0
    p = 1.0
    dg = g = 1.0
    G1 = 0.5
    G2 = 1.0 / 6.0
    G3 = 1.0 / 24.0
    n = 1
    while n < 24:
        nxt = -(2.0 * x * n * p + y * before) / (n * (n + 1.0))
        before = p
        p = nxt
        n += 1
        dg += n * p
        g += p
        G1 += p / (n + 1.0)
        G2 += p / ((n + 1.0) * (n + 2.0))
        G3 += p / ((n + 1.0) * (n + 2.0) * (n + 3.0))
        if abs(p) * n < _TERM and abs(before) < 10.0 * _TERM:
            break
    return dg, g * s, G1 * s * s, G2 * s * s * s, G3 * s * s * s * s


def _distinct(a: float, c: float, beta: float, s: float) -> tuple[float, float, float, float, float]:
    # Two real roots well apart; the slow one without cancellation.
    l2 = -(a + beta)
    l1 = c / l2
    k = 0.5 / beta
    x1 = l1 * s
    x2 = l2 * s
    m1 = expm1(x1)
    m2 = expm1(x2)
    dg = (l1 * (m1 + 1.0) - l2 * (m2 + 1.0)) * k
    g = (m1 - m2) * k
    # integrals of exp(l s): s phi1(l s), s² phi2(l s), s³ phi3(l s)
    u1 = m1 / x1 if x1 != 0.0 else 1.0
    u2 = m2 / x2
    G1 = (u1 - u2) * s * k
    v1, t1 = _phi2_phi3(x1, u1)
    v2, t2 = _phi2_phi3(x2, u2)
    G2 = (v1 - v2) * s * s * k
    G3 = (t1 - t2) * s * s * s * k
    return dg, g, G1, G2, G3


def _phi2_phi3(x: float, phi1: float) -> tuple[float, float]:
    # (e^x - 1 - x) / x², (e^x - 1 - x - x²/2) / x³
    if -0.5 < x < 0.5:
        phi3 = 1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720 + x * (1 / 5040 + x * (1 / 40320 + x * (
            1 / 362880 + x * (1 / 3628800 + x * (1 / 39916800 + x * (1 / 479001600 + x / 6227020800)))))))))
        return 0.5 + x * phi3, phi3
    phi2 = (phi1 - 1.0) / x
    return phi2, (phi2 - 0.5) / x


def _close(a: float, c: float, d: float, root: float, s: float) -> tuple[float, float, float, float, float]:
    # Complex roots, or real ones close together; here c s² is not small.
    z = d * s * s
    decay = exp(-a * s)
    if -0.1 < z < 0.1:
        sh = decay * s * (1.0 + z * (1 / 6 + z * (1 / 120 + z * (1 / 5040 + z * (1 / 362880 + z / 39916800)))))
        ch = decay * (1.0 + z * (1 / 2 + z * (1 / 24 + z * (1 / 720 + z * (1 / 40320 + z / 3628800)))))
    elif d > 0.0:
        slow = exp((root - a) * s)
        fast = exp(-(root + a) * s)
        ch = 0.5 * (slow + fast)
        sh = 0.5 * (slow - fast) / root
    else:
        ch = decay * cos(root * s)
        sh = decay * sin(root * s) / root
    g = sh
    dg = ch - a * sh
    G1 = (1.0 - dg - 2.0 * a * g) / c
    G2 = (s - g - 2.0 * a * G1) / c
    G3 = (0.5 * s * s - G1 - 2.0 * a * G2) / c
    return dg, g, G1, G2, G3


def propagate(coefficients: tuple[float, ...], s: float) -> tuple[float, float]:
    """Return q and q̇ at s ≥ 0 after the start, for coefficients (a, c, f0, f1, fs, Ω, φ, q0, w0)."""
    q, w, _ = propagate_with_integral(coefficients, s)
    return q, w


def propagate_with_integral(coefficients: tuple[float, ...], s: float) -> tuple[float, float, float]:
    """Return q, q̇ and the integral of q from 0 to s."""
    a, c, f0, f1, fs, omega, phase, q0, w0 = coefficients
    dg, g, G1, G2, G3 = response(a, c, s)
    r = f0 - c * q0
    q = q0 + w0 * g + r * G1 + f1 * G2
    w = w0 * dg + r * g + f1 * G1
    integral = q0 * s + w0 * G1 + r * G2 + f1 * G3
    if fs != 0.0:
        # The steady sinusoid, less the free motion that starts as it does; by differences, so that a short motion
        # loses no digits. Its start is qp, wp, and 1 - ġ = 2 a g + c G1.
        re = c - omega * omega
        im = 2.0 * a * omega
        scale = fs / (re * re + im * im)
        qp = scale * (re * sin(phase) - im * cos(phase))
        wp = scale * omega * (re * cos(phase) + im * sin(phase))
        half = 0.5 * omega * s
        chord = 2.0 * scale * sin(half)
        ds = chord * cos(phase + half)
        dc = -chord * sin(phase + half)
        q += re * ds - im * dc + qp * c * G1 - wp * g
        w += omega * (re * dc + im * ds) + wp * (2.0 * a * g + c * G1) + c * qp * g
        integral += -(re * dc + im * ds) / omega - qp * (s - c * G2) - wp * G1
    return q, w, integral


def acceleration(coefficients: tuple[float, ...], s: float, q: float, w: float) -> float:
    """Return q̈ at s, where the motion stands at q, q̇ = w."""
    a, c, f0, f1, fs, omega, phase, _, _ = coefficients
    qdd = f0 + f1 * s - c * q - 2.0 * a * w
    if fs != 0.0:
        qdd += fs * sin(phase + omega * s)
    return qdd


def first_zero(a: float, c: float, h0: float, h1: float) -> tuple[float, float]:
    """Return the first s > 0 at which a solution of ḧ + 2 a ḣ + c h = 0 is zero, and the spacing of later zeros.

    h(0) = h0, ḣ(0) = h1. Without a zero, or without a later one, inf is returned. The acceleration q̈ solves this
    equation under polynomial forcing, so that q̇ is monotone between its zeros.
    """
    d = a * a - c
    return first_zero_of(a, d, math.sqrt(abs(d)), h0, h1)


def first_zero_of(a: float, d: float, root: float, h0: float, h1: float) -> tuple[float, float]:
    """Return the same for d = a² − c and √|d|."""
    slope = h1 + a * h0
    if d >= 0.0:
        if slope == 0.0:
            return math.inf, math.inf
        x = -h0 / slope
        if x <= 0.0 or root * x >= 1.0:
            return math.inf, math.inf
        return (atanh(root * x) / root if root * x > _SMALL else x), math.inf
    # h ~ h0 cos(root s) + (slope/root) sin(root s)
    angle = atan2(-h0, slope / root)
    if angle <= 0.0:
        angle += math.pi
    return angle / root, math.pi / root
