"""A signal without its noise, and with its rates: two equal poles, solved exactly from tick to tick."""

from __future__ import annotations

import math
from typing import Any, NamedTuple


class Smoothed(NamedTuple):
    """A filtered value, its rate, and the value that went in last, of one servo or of joints."""

    value: Any
    rate: Any
    last: Any


def resting(value: Any) -> Smoothed:
    """Return the filter at rest at a value."""
    return Smoothed(value, 0.0 * value, value)


def smoothed(before: Smoothed, value: Any, rate: float, period: float) -> Smoothed:
    """Return the filter g²/(s + g)² one tick later, of a signal that is straight from sample to sample.

    Parameters
    ----------
    before : Smoothed
    value : float or ndarray
        That was measured now.
    rate : float
        g, of both poles; a steady motion is seen 2/g late [rad/s].
    period : float
        T [s].

    Examples
    --------
    >>> state = resting(0.0)
    >>> for k in range(1, 1001):
    ...     state = smoothed(state, 3.0 * 1e-3 * k, 100.0, 1e-3)
    >>> round(state.value, 6), round(state.rate, 6)
    (2.94, 3.0)
    """
    return _later(before, value, (value - before.last) / period, rate, period)


def held(before: Smoothed, value: Any, rate: float, period: float) -> Smoothed:
    """Return the same filter of a signal that was held at a value since the tick before, such as a command.

    Examples
    --------
    >>> round(held(resting(0.0), 1.0, 100.0, 0.01).value, 6)  # 1 - 2/e
    0.264241
    """
    return _later(before, value, 0.0, rate, period)


def second_rate(state: Smoothed, rate: float) -> Any:
    """Return the second derivative of a filtered value, ẍ = g² (u − x) − 2 g ẋ.

    Examples
    --------
    >>> second_rate(Smoothed(0.0, 0.0, 1.0), 10.0)
    100.0
    """
    return rate * rate * (state.last - state.value) - 2.0 * rate * state.rate


def _later(before: Smoothed, value: Any, slope: Any, g: float, T: float) -> Smoothed:
    """Return the filter a tick later; a ramp is followed 2/g late, and what differs from that fades.

    [d, f] ← e^(−gT) [[1 + gT, T], [−g² T, 1 − gT]] [d, f] with d = x − (u − 2 m/g), f = ẋ − m.
    """
    fading, late = math.exp(-g * T), 2.0 * slope / g
    d, f = before.value - (value - slope * T - late), before.rate - slope
    return Smoothed(value - late + fading * ((1.0 + g * T) * d + T * f),
                    slope + fading * ((1.0 - g * T) * f - g * g * T * d), value)
