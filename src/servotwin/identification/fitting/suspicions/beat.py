"""The beat of a log's time stamps: its period, how far each stamp lies off it, and which rows are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.look import Array, Mask

_FEWEST = 20  # stamps
_ROUND = 15  # stamps to either side, over which the beat is the mean: clocks drift
_STEADY = 0.05  # of a period: most stamps have to be that near
_PAUSE = 5.5  # periods: the beat may begin anew
_OFF = 0.1  # of a period
_SIGMAS = 6.0
_MOST_OFF = 0.2  # of all stamps: with more there is no beat to be off


@dataclass(frozen=True)
class Beat:
    """The beat of time stamps.

    Parameters
    ----------
    period : float
        [s].
    place : ndarray, shape (n,)
        Where each row lies on the beat [s].
    number : ndarray of int, shape (n,)
        Of the beats, rising by one where no row is missing.
    off : ndarray of bool, shape (n,)
        Whether a stamp lies beside its place by far more than most.
    """

    period: float
    place: Array
    number: NDArray[np.int64]
    off: Mask


def beat_of(time: Array) -> Beat | None:
    """Return the beat of rising time stamps; None where they have none.

    Examples
    --------
    >>> stamps = 0.02 * np.arange(60.0)
    >>> stamps[[20, 40]] += 0.008
    >>> found = beat_of(np.delete(stamps, 30))
    >>> round(found.period, 6), np.flatnonzero(found.off).tolist(), found.number[-1].item()
    (0.02, [20, 39], 59)
    """
    if len(time) < _FEWEST:
        return None
    period = _period(time)
    turn = 2.0 * np.pi * time / period
    hand = np.exp(1j * turn)
    parts = np.concatenate([[0], np.cumsum(np.diff(time) > _PAUSE * period)])
    on = np.ones(len(time), np.bool_)
    for _ in range(3):
        slip = np.angle(hand * np.conj(_local(hand * on, parts))) / (2.0 * np.pi)  # of a period, -0.5 to 0.5
        scale = 1.4826 * float(np.median(np.abs(slip)))
        off = np.abs(slip) > max(_SIGMAS * scale, _OFF)
        on = ~off
    if scale > _STEADY or off.mean() > _MOST_OFF or not on[[0, -1]].any():
        return None
    rough = _whole(time / period - slip)
    off[[k + int(abs(slip[k + 1]) > abs(slip[k])) for k in np.flatnonzero(np.diff(rough) < 1)]] = True
    number = _numbered(rough, off)
    place = _places(time, number, ~off, period)
    return None if place is None else Beat(period, place, number, off)


def _period(time: Array) -> float:
    """Return the median time of a beat, from ever more rows apart, each counted with what was known before."""
    steps = np.diff(time)
    period = float(np.median(steps))
    apart = 2
    while apart <= min(64, len(time) // 4):
        spans = time[apart:] - time[:-apart]
        period = float(np.median(spans / np.maximum(np.round(spans / period), 1.0)))
        apart *= 2
    return period


def _local(hand: NDArray[np.complex128], parts: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Return the mean direction around each row, within its part of the log."""
    sums = np.zeros(len(hand), np.complex128)
    for part in np.unique(parts):
        here = np.flatnonzero(parts == part)
        total = np.concatenate([[0.0], np.cumsum(hand[here])])
        k = np.arange(len(here))
        sums[here] = total[np.minimum(k + _ROUND + 1, len(here))] - total[np.maximum(k - _ROUND, 0)]
    return sums


def _whole(beats: Array) -> NDArray[np.int64]:
    """Return whole numbers of beats; the local beat drifts, so they come from step to step."""
    return np.concatenate([[0], np.cumsum(np.round(np.diff(beats)))]).astype(np.int64)


def _numbered(rough: NDArray[np.int64], off: Mask) -> NDArray[np.int64]:
    """Return numbers that rise from row to row: a row that is off goes where there is room between others."""
    number = rough.copy()
    for k in range(1, len(number)):
        if off[k]:
            number[k] = max(number[k], number[k - 1] + 1)
    for k in range(len(number) - 2, -1, -1):
        if off[k]:
            number[k] = min(number[k], number[k + 1] - 1)
    return number


def _places(time: Array, number: NDArray[np.int64], on: Mask, period: float) -> Array | None:
    """Return where each row lies on the beat: its stamp, or between its neighbours that are on."""
    if (np.diff(number) < 1).any():
        return None
    drift = time - number * period
    place = np.where(on, time, number * period + np.interp(number, number[on], drift[on]))
    return place if (np.diff(place) > 0.0).all() else None
