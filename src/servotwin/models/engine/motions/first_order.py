"""Exact solution of ẇ = f − λ w, the speed of a shaft under constant torque, and of the angle that it turns through.

Right for λ from 0 on and for short and long times: what would cancel is computed by expm1, log1p or a series.
"""

from __future__ import annotations

import math

from servotwin.physics.elementary import expm1, log1p

_SMALL = 1e-8  # its square is below rounding
IN_FLOATS = {"_SMALL": 1e-4}


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
