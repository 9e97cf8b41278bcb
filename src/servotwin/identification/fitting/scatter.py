"""How far residuals scatter, told so that a few outliers change it little."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.case import LogPart
from servotwin.identification.fitting.forecast import Forecast

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NORMAL = 1.4826  # standard deviation over median magnitude of a normal law
_MOVING = 0.05  # of the fastest change of a simulated signal
_SHARE = 0.3  # of the rms, that the noise is at least
_FEWEST = 20  # values of a part, below which its median says too little
_LEAST = 1e-9  # SI


class _Piece(NamedTuple):
    """Residuals of one sensor in one log, and where its simulated signal changes."""

    residual: Array
    moving: Mask


def scatter_of(forecast: Forecast, parts: Sequence[LogPart], cases: Sequence[int]) -> dict[str, float]:
    """Return the noise of each sensor (SI): the median magnitude of its residuals, as of a normal law.

    Where a servo mostly stands still, the median of all would call every motion an outlier: so it is at least a share
    of the rms. That in turn is put together from medians where the simulated signal moves and where it stands, so that
    true outliers do not count. What is not finite keeps the noise that it has.
    """
    gathered: dict[str, list[_Piece]] = {}
    for k, part in zip(cases, parts, strict=True):
        case = forecast.cases[k]
        for name, residual in by_sensor(forecast, k, part).items():
            gathered.setdefault(name, []).append(_Piece(residual, moving(
                case.times[case.places[name]], case.values[name] + residual)))
    found = {}
    for name, pieces in gathered.items():
        residual = np.concatenate([piece.residual for piece in pieces])
        found[name] = max(scatter(residual, np.concatenate([piece.moving for piece in pieces])), _LEAST) \
            if np.isfinite(residual).all() else forecast.noise[name]
    return found


def scatter(residual: Array, moves: Mask) -> float:
    """Return the robust standard deviation of residuals, at least a share of the robust rms of both parts.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white, moves = rng.standard_normal(1000), np.arange(1000) < 200
    >>> outliers = np.where(rng.random(1000) < 0.05, 1000.0, white)
    >>> 0.9 < scatter(white, moves) < 1.15, 0.9 < scatter(outliers, moves) < 1.3
    (True, True)
    >>> 0.3 * 4.0 < scatter(np.where(moves, 10.0, 0.1) * white, moves) < 0.3 * 5.0
    True
    """
    parts = [part for part in (residual[moves], residual[~moves]) if len(part) >= _FEWEST] or [residual]
    squares = sum(len(part) * _deviation(part) ** 2 for part in parts)
    return max(_deviation(residual), _SHARE * math.sqrt(squares / sum(map(len, parts))))


def _deviation(residual: Array) -> float:
    return NORMAL * float(np.median(np.abs(residual)))


def moving(time: Array, simulated: Array) -> Mask:
    """Tell where a simulated signal, which has no noise, changes visibly."""
    if len(time) < 2:
        return np.zeros(len(time), np.bool_)
    rate = np.abs(np.gradient(simulated, time))
    return np.asarray(rate > _MOVING * float(rate.max()))


def by_sensor(forecast: Forecast, k: int, part: LogPart) -> dict[str, Array]:
    """Return the residuals of a log by sensor (SI)."""
    found, first = {}, 0
    for name, place in forecast.cases[k].places.items():
        found[name] = part.residual[first:first + len(place)] * forecast.cases[k].sigma(name, forecast.noise)
        first += len(place)
    return found
