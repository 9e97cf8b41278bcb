"""Numbers of a calibration in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise


def plus_minus(value: float, error: float) -> str:
    """Return a value with its standard error in units of the last place, two digits of it.

    Examples
    --------
    >>> plus_minus(432.648, 0.841), plus_minus(0.0073244, 0.0000394), plus_minus(-44.13, 1.14), plus_minus(1234.5, 56.0)
    ('432.65(84)', '0.007324(39)', '-44.1(1.1)', '1234(56)')
    """
    if not (math.isfinite(error) and error > 0.0):
        return f"{value:.6g}"
    places = max(1 - math.floor(math.log10(error)), 0)
    shown = f"{error:.{places}f}"
    return f"{value:.{places}f}({shown if float(shown) >= 1.0 else shown.partition('.')[2].lstrip('0')})"


def residual_pattern(x: Sequence[float], residuals: Sequence[float]) -> str:
    """Return what the signs of residuals do along x.

    Examples
    --------
    >>> residual_pattern([0.0, 1.0, 2.0, 3.0, 4.0], [-0.98, 0.64, 0.64, 0.65, -0.95])
    'the ends lie below the line and the middle above it'
    >>> residual_pattern([0.0, 1.0, 2.0, 3.0], [0.1, -0.1, 0.1, -0.1])
    'above and below the line in turn'
    """
    ordered = [r for _, r in sorted(zip(x, residuals, strict=True))]
    least = 1e-9 * max(abs(r) for r in ordered)
    signs = [math.copysign(1.0, r) for r in ordered if abs(r) > least]
    if not signs:
        return "all on the line"
    runs = 1 + sum(a != b for a, b in pairwise(signs))
    if runs == 3:
        ends, middle = ("below", "above") if signs[0] < 0.0 else ("above", "below")
        return f"the ends lie {ends} the line and the middle {middle} it"
    if runs == len(signs):
        return "above and below the line in turn"
    return f"{runs} runs of one sign among {len(signs)} points: no pattern"
