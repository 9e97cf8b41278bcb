"""Angles that turn against the command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from servotwin.identification.fitting.suspicions.look import Array, Finding, Look, aligned

_LAGS = np.arange(0.0, 0.301, 0.02)  # s: delay and slew of a servo that follows at all
_SHORT_LAGS = np.arange(0.0, 0.161, 0.02)
_RESPONSE = 0.06  # s, over which an angle begins to change
_CLEAR = 0.6  # correlation; of 130 clean logs, measured and simulated, none reaches -0.6 against its own command
_APART = 0.2  # by which the correlation against the command has to be larger than that with it
_FEWEST = 8  # samples
_LEAST = 5e-3  # rad, standard deviation of commands that say something


def turned(looks: Sequence[Look]) -> list[Finding]:
    """Return the logs whose angle turns against the command."""
    found = [one for one in looks if _is_turned(one)]
    good = [one for one in looks if one not in found and _LEAST < float(np.std(one.asked[one.counts]))]
    return [Finding("sign", one.log.name, (
        f"log {one.log.name!r}: the angle turns against the command throughout" + (", unlike that of other logs"
        if good else "") + "; turn its sign where it is recorded, or the servo's command; mending \"sign\" turns it"),
        one.with_angle(aligned(one, -one.angle, good))) for one in found]


def _is_turned(one: Look) -> bool:
    time, angle = one.time[one.counts], one.angle[one.counts]
    if len(time) < _FEWEST or float(np.std(one.asked[one.counts])) < _LEAST:
        return False
    followed = [_correlation(_asked(one, time[time >= lag] - lag), angle[time >= lag]) for lag in _LAGS]
    if max(np.max(followed), -np.min(followed)) < _CLEAR:  # commands so fast that the shaft only feels them
        followed = _responses(one, time, angle)
    return bool(-np.min(followed) > max(_CLEAR, np.max(followed) + _APART))


def _responses(one: Look, time: Array, angle: Array) -> list[float]:
    """Return the correlations of commands and the changes of angle after them, where the angle stood being known."""
    apart = float(np.median(np.diff(time)))
    later = max(_RESPONSE, 3.0 * apart)
    at = np.arange(time[0], time[-1] - later, apart)
    if len(at) < _FEWEST:
        return [0.0]
    here = np.interp(at, time, angle)
    change = np.interp(at + later, time, angle) - here
    return [_correlation(*(_without(here, y) for y in (_asked(one, at + 0.5 * later - lag), change)))
            for lag in _SHORT_LAGS]


def _asked(one: Look, time: Array) -> Array:
    """Return the commanded angle that held at some times [rad]."""
    at = np.searchsorted(one.time, time + 1e-9, side="right") - 1
    return one.asked[np.maximum(at, 0)]


def _without(known: Array, y: Array) -> Array:
    """Return what a straight line over `known` does not explain."""
    if float(np.ptp(known)) == 0.0:
        return y
    slope, constant = np.polyfit(known, y, 1)
    return np.asarray(y - slope * known - constant)


def _correlation(x: Array, y: Array) -> float:
    if len(x) < _FEWEST or min(float(np.std(x)), float(np.std(y))) < 1e-9:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])
