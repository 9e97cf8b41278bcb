"""How far along a straight way from 0 to 1 one is, within limits: phases of polynomials.

Biagiotti and Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, chapters 2 and 3.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Phases(NamedTuple):
    """Durations [s], and of each phase the coefficients in the time since its start, the highest power first."""

    durations: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]


def trapezoid_phases(speed: float, acceleration: float) -> Phases:
    """Return constant acceleration, constant speed, constant braking; without the middle where the way is too short.

    Examples
    --------
    >>> trapezoid_phases(2.0, 8.0).durations, trapezoid_phases(9.0, 4.0).durations
    ((0.25, 0.25, 0.25), (0.5, 0.5))
    """
    v = min(speed, math.sqrt(acceleration))
    return _by_jerk([(v / acceleration, acceleration), (1.0 / v - v / acceleration, 0.0),
                     (v / acceleration, -acceleration)], order=2)


def s_curve_phases(speed: float, acceleration: float, jerk: float) -> Phases:
    """Return seven phases of constant jerk, or those of them that last.

    Examples
    --------
    >>> [round(t, 6) for t in s_curve_phases(2.0, 8.0, 80.0).durations]
    [0.1, 0.15, 0.1, 0.15, 0.1, 0.15, 0.1]
    >>> [round(t, 6) for t in s_curve_phases(9.0, 99.0, 32.0).durations]
    [0.25, 0.25, 0.25, 0.25]
    """
    # the largest speed that half the way allows: reached with, or else without, a phase at full acceleration
    with_plateau = 0.5 * acceleration * (math.sqrt((acceleration / jerk)**2 + 4.0 / acceleration) - acceleration / jerk)
    without = (0.5 * math.sqrt(jerk))**(2.0 / 3.0)
    v = min(speed, with_plateau if with_plateau > acceleration**2 / jerk else without)
    a = min(acceleration, math.sqrt(v * jerk))
    rising, full = a / jerk, v / a - a / jerk
    cruise = 1.0 / v - v / a - a / jerk
    return _by_jerk([(rising, jerk), (full, 0.0), (rising, -jerk), (cruise, 0.0),
                     (rising, -jerk), (full, 0.0), (rising, jerk)], order=3)


def quintic_phases(speed: float, acceleration: float, jerk: float) -> Phases:
    """Return 10 τ³ − 15 τ⁴ + 6 τ⁵, τ = t/T, as fast as the limits allow.

    Examples
    --------
    >>> round(quintic_phases(15.0 / 8.0, 99.0, 999.0).durations[0], 9)
    1.000000000
    """
    T = max(15.0 / 8.0 / speed, math.sqrt(10.0 / math.sqrt(3.0) / acceleration), (60.0 / jerk)**(1.0 / 3.0))
    return Phases((T,), ((6.0 / T**5, -15.0 / T**4, 10.0 / T**3, 0.0, 0.0, 0.0),))


def _by_jerk(phases: list[tuple[float, float]], order: int) -> Phases:
    """Return phases of (duration, constant derivative of this order), one after the other from rest at 0."""
    state = [0.0] * order  # s, ṡ, ... at the start of a phase
    durations: list[float] = []
    rows: list[tuple[float, ...]] = []
    for duration, highest in phases:
        if duration <= 1e-12 * (1.0 + sum(durations)):
            continue
        series = [*state, highest]
        rows.append(tuple(x / math.factorial(k) for k, x in enumerate(series))[::-1])
        durations.append(duration)
        state = [sum(x * duration**(m - k) / math.factorial(m - k) for m, x in enumerate(series) if m >= k)
                 for k in range(order)]
    return Phases(tuple(durations), tuple(rows))
