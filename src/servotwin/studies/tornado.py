"""Which parameter matters: the reach of each one alone, and its share of the variance of all."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError

_MOST_CLASSES = 32
_LEAST_LANES = 8  # fewer have no share
_LEAST_REACH = 0.01  # of the farthest bar


class Bar(NamedTuple):
    """What one parameter does to a metric.

    Parameters
    ----------
    name : str
        Dotted.
    low, high : float or str
        Its values at the ends of the bar (SI): the 5 % and the 95 % value, or of a choice the two options that
        move the metric farthest.
    at_low, at_high : float
        The metric there, while all other parameters are nominal (SI).
    reach : float
        How far the metric moves between these two and the nominal servo (SI); nan where it has no value there.
    share : float
        Share of the variance of the metric over all lanes that this parameter explains alone: 0 to 1, or nan where
        the metric does not vary or too few lanes have it.
    """

    name: str
    low: float | str
    high: float | str
    at_low: float
    at_high: float
    reach: float
    share: float


@dataclass(frozen=True)
class Tornado:
    """The parameters of a study that move a metric, those that move it farthest first.

    Parameters
    ----------
    metric : str
    nominal : float
        The metric while all parameters are nominal (SI).
    bars : tuple of Bar
    still : tuple of str
        Names of what is drawn and does not move it: alone less than a hundredth of what the first bar does, and its
        share of the variance no more than chance makes.
    """

    metric: str
    nominal: float
    bars: tuple[Bar, ...]
    still: tuple[str, ...] = ()


def bar_of(name: str, values: tuple[Any, ...], metric: NDArray[np.float64], nominal: float, share: float) -> Bar:
    """Return the bar of a parameter from the metric at each of its values, and at the nominal servo.

    Examples
    --------
    >>> bar_of("motor.torque_constant", (1.0, 2.0), np.array([0.3, 0.1]), 0.15, 0.5).reach
    0.2
    """
    ends = [0, len(values) - 1]
    if len(values) > 2 and np.isfinite(metric).any():
        ends = sorted([int(np.nanargmin(metric)), int(np.nanargmax(metric))])
    low, high = ends
    reach = float(np.ptp([metric[low], metric[high], nominal]))
    return Bar(name, values[low], values[high], float(metric[low]), float(metric[high]), reach, share)


def tornado_of(metric: str, nominal: float, bars: list[Bar], lanes: int) -> Tornado:
    """Return the tornado of a metric that so many lanes have; what does not move it is only named.

    A bar without a value at one of its ends moves the metric, out of existence.

    Examples
    --------
    >>> found = [Bar("load.inertia", 0.0, 1.0, 0.2, 0.3, 0.1, 0.9), Bar("load.torque", 0.0, 0.5, 0.2, 0.2, 0.0, 0.0)]
    >>> tornado_of("rise_time", 0.2, found, 100).still
    ('load.torque',)
    """
    known = [bar.reach for bar in bars if not math.isnan(bar.reach)]
    least, chance = _LEAST_REACH * max(known, default=0.0), chance_share(lanes)
    moving = [bar for bar in bars if math.isnan(bar.reach) or bar.reach > least or bar.share > chance]
    return Tornado(metric, nominal, sorted_bars(moving), tuple(sorted(
        bar.name for bar in bars if bar not in moving)))


def chance_share(lanes: int) -> float:
    """Return what the share of a parameter without effect exceeds by chance in about one of a thousand.

    Three standard deviations: sorted into c classes, the part between them of n independent values is, as a share of
    the whole, that of a beta distribution with c − 1 and n − c degrees of freedom.

    Examples
    --------
    >>> round(chance_share(2000), 3)
    0.012
    """
    if lanes < _LEAST_LANES:
        return math.inf
    classes = _classes(lanes)
    return 3.0 * math.sqrt(2.0 * (classes - 1.0) / (lanes - classes)) / math.sqrt(lanes - 1.0)


def _classes(lanes: int) -> int:
    return min(int(math.sqrt(lanes)), _MOST_CLASSES)


def sorted_bars(bars: list[Bar]) -> tuple[Bar, ...]:
    """Return bars, the one that reaches farthest first; those that do not move the metric last, by their share."""
    def rank(bar: Bar) -> tuple[float, float, str]:
        reach, share = (0.0 if math.isnan(x) else x for x in (bar.reach, bar.share))
        return -reach, -share, bar.name

    return tuple(sorted(bars, key=rank))


def variance_share(values: NDArray[Any], metric: NDArray[np.float64]) -> float:
    """Return the share of a metric's variance that one parameter explains alone (first-order index of Sobol).

    The lanes are sorted into classes by the parameter, one for each value where there are few and of equal size
    otherwise; the share is the variance of the means of the classes over the whole one (correlation ratio), corrected
    for the number of classes (Kelley, 1935), which takes the place of the noise that few lanes make.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers or words.
    metric : ndarray, shape (n,)
        Lanes in which it is nan do not count.

    Returns
    -------
    float
        0 to 1; nan where the metric does not vary, or fewer than 8 lanes have it.

    Examples
    --------
    >>> x = np.linspace(0.0, 1.0, 10000)
    >>> round(variance_share(x, 3.0 * x), 2), round(variance_share(x, (x - 0.5)**2), 2)
    (1.0, 1.0)
    """
    if values.shape != metric.shape:
        raise InputError("metric", got=metric.shape, allowed=f"one number for each of {values.shape[0]} values")
    good = np.isfinite(metric)
    x, y = values[good], metric[good]
    if len(y) < _LEAST_LANES or not np.ptp(y) > 1e-12 * np.max(np.abs(y)):
        return math.nan
    count = _classes(len(y))
    options, of = np.unique(x, return_inverse=True)
    if len(options) > count:
        place = np.empty(len(x), dtype=np.int64)
        place[np.argsort(x, kind="stable")] = np.arange(len(x))
        of = place * count // len(x)
    sizes = np.bincount(of)
    if len(sizes) < 2:
        return 0.0
    y = y - y.mean()
    between = float(np.sum(np.bincount(of, weights=y)**2 / sizes) / np.sum(y**2))
    return max(0.0, 1.0 - (1.0 - between) * (len(y) - 1) / (len(y) - len(sizes)))
