"""How the motion of a log goes with its command: gain and zero, dead time, speed."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.suspicions.look import rough_noise
from servotwin.logs.log import Log

Array = NDArray[np.float64]

_HELD = 0.3  # s of one command, after which a shaft has arrived or is on its way for long
_AT_REST = 0.25  # of a stretch of one command: the end of it
_STEPS_ONLY = 0.2  # of the rows change the command at most: else it moves all the time
_LAGS = 61
_LONGEST_LAG = 0.6  # s
_CLEARLY = 0.2  # of what is left without a shift: an angle does not come first unless that is clear
_SEEN = 0.03  # of a travel, by which a motion has begun
_SIGMAS = 5.0
_FEWEST = 8  # rows
_SPEED_LASTS = 0.03  # s
_SPEED_OVER = 3  # rows to either side


class Motion(NamedTuple):
    """How a motion goes with its command.

    Parameters
    ----------
    gain : float
        Of the angle over the command [rad per SI unit of the command]; nan where the log does not tell.
    zero : float
        The command at which the angle is 0, in SI.
    correlation : float
        Of angle and command, the lag taken away.
    lag : float
        The dead time of steps in the median; where the command moves all the time, by how much the angle comes later
        [s].
    steps : int
        Whose dead time was seen; 0 where the command moves all the time.
    speed : float
        The fastest that lasts [rad/s].
    onset : float
        When the shaft first leaves where it was, from the first row on; nan where it does not [s].
    still : bool
        Whether the shaft does not move.
    """

    gain: float
    zero: float
    correlation: float
    lag: float
    steps: int
    speed: float
    onset: float
    still: bool


def motion_of(log: Log) -> Motion:
    """Return how the angle of a log goes with its command.

    Examples
    --------
    >>> time = 0.01 * np.arange(400.0)
    >>> command = np.where(time % 2.0 < 1.0, 0.0, 1.0)
    >>> angle = np.interp(time, [1.05, 1.25, 2.05, 2.25, 3.05, 3.25], [0.0, 1.0, 1.0, 0.0, 0.0, 1.0])
    >>> found = motion_of(Log(name="a", time=time, command=command, command_kind="angle",
    ...                       measured={"output_angle": angle}))
    >>> round(found.gain, 3), found.steps, 0.04 < found.lag < 0.08, round(found.speed, 1)
    (1.0, 3, True, 5.0)
    """
    used = log.used(log.angle_name) & log.sent
    time, angle, command = log.time[used], log.measured[log.angle_name][used], log.held[used]
    if len(time) < _FEWEST:
        return Motion(math.nan, math.nan, math.nan, math.nan, 0, math.nan, math.nan, still=log.is_constant)
    changes = np.flatnonzero(np.diff(command) != 0.0) + 1
    noise = rough_noise(angle)
    speed = _speed(time, angle)
    if len(changes) > _STEPS_ONLY * len(time):
        lag, steps = _lag(time, angle, command), 0
    else:
        seen = _dead_times(time, angle, command, changes, noise)
        lag, steps = (float(np.median(seen)) if seen else math.nan), len(seen)
    x = command[np.maximum(np.searchsorted(time, time - (lag if math.isfinite(lag) else 0.0), side="right") - 1, 0)]
    at = _rests(time, changes) if steps else np.ones(len(time), np.bool_)
    gain, zero, correlation = _line(x[at], angle[at])
    onset = _onset(time - log.start, angle, noise)
    return Motion(gain, zero, correlation, lag, steps, speed, onset, still=log.is_constant)


def _onset(time: Array, angle: Array, noise: float) -> float:
    way = np.abs(angle - np.median(angle[:3]))
    away = way > max(_SEEN * float(way.max()), _SIGMAS * noise)
    return float(time[int(np.argmax(away))]) if away.any() else math.nan


def _rests(time: Array, changes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the rows at the end of each stretch of one command, all where these are few."""
    rest = np.zeros(len(time), np.bool_)
    for first, stop in pairwise([0, *changes.tolist(), len(time)]):
        span = time[stop - 1] - time[first]
        if span >= _HELD:
            rest[first:stop] = time[first:stop] >= time[stop - 1] - _AT_REST * span
    return rest if rest.sum() >= _FEWEST else np.ones(len(time), np.bool_)


def _dead_times(time: Array, angle: Array, command: Array, changes: NDArray[np.int64], noise: float) -> list[float]:
    """Return the time from each step to the first motion, of those before and after which the command is held."""
    found = []
    for k, nxt in pairwise([*changes.tolist(), len(time)]):
        before = changes[changes < k]
        since = time[before[-1]] if len(before) else time[0]
        if time[k] - since < _HELD or time[nxt - 1] - time[k] < _HELD:
            continue
        base = float(np.median(angle[max(0, k - 5):k]))
        way = float(angle[nxt - 1]) - base
        seen = max(_SEEN * abs(way), _SIGMAS * noise)
        away = np.flatnonzero((angle[k:nxt] - base) * np.sign(way) > seen)
        if abs(way) > 2.0 * seen and len(away):
            found.append(float(time[k + away[0]] - time[k]))
    return found


def _lag(time: Array, angle: Array, command: Array) -> float:
    """Return the shift at which angle and command go together best; below 0 the angle comes first."""
    if np.ptp(command) == 0.0 or np.ptp(angle) == 0.0:
        return math.nan
    lags = np.linspace(-0.25 * _LONGEST_LAG, _LONGEST_LAG, _LAGS)
    fits = [abs(np.corrcoef(np.interp(time - lag, time, command), angle)[0, 1]) for lag in lags.tolist()]
    best = int(np.nanargmax(fits))
    if lags[best] < 0.0 and 1.0 - fits[best] > _CLEARLY * (1.0 - max(fits[int(np.searchsorted(lags, 0.0)):])):
        best = int(np.searchsorted(lags, 0.0))
    return float(lags[best])


def _line(x: Array, y: Array) -> tuple[float, float, float]:  # gain, zero, correlation
    if len(x) < _FEWEST or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return math.nan, math.nan, math.nan
    gain, constant = np.polyfit(x - x.mean(), y, 1)
    zero = float(x.mean() - constant / gain) if gain else math.nan
    return float(gain), zero, float(np.corrcoef(x, y)[0, 1])


def _speed(time: Array, angle: Array) -> float:
    """Return the fastest speed over some rows: single outliers do not count."""
    apart = max(2 * _SPEED_OVER, math.ceil(_SPEED_LASTS / float(np.median(np.diff(time)))))
    if len(time) <= apart + 2:
        return math.nan
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(angle, 2, mode="edge"), 5), axis=1)
    return float(np.abs((smooth[apart:] - smooth[:-apart]) / (time[apart:] - time[:-apart])).max())
