"""The delay that all logs share, as far as commands and pulses tell it.

A log tells when its pulses take effect: the phase of its pulses and the delay together. Its commands tell between which
bounds the phase lies (`frames.gap_of`). Where logger and generator are in step these are a whole frame apart, and so is
what is known of the delay; where they run apart, a little of a frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Loss
from servotwin.identification.fitting.forecast import Forecast
from servotwin.identification.fitting.frames import gap_of, near_edges
from servotwin.identification.fitting.phases import PulseChoice, Scan
from servotwin.identification.fitting.point import DELAY_SCALE, LogPart
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty
from servotwin.logs.log import Log
from servotwin.logs.regular import regular_times

Array = NDArray[np.float64]

_SHOWN = 3  # times of a log that are named


def delay_range(scan: Scan, credible: Mapping[int, Sequence[PulseChoice]],
                errors: Sequence[float]) -> tuple[float, float]:
    """Return between which values the delay lies [s]: what all logs allow, and where they do not agree what they say.

    Parameters
    ----------
    scan : Scan
        Where the search ended.
    credible : mapping of int to sequence of Choice
        Pulses that each fitted log allows.
    errors : sequence of float
        By how much the time at which each log's pulses take effect may be wrong, either way [s].
    """
    forecast, delay = scan.forecast, scan.forecast.nuisance_of(scan.point.shared, "delay")
    lows, highs = [], []
    for (k, choices), error in zip(credible.items(), errors, strict=True):
        log = forecast.cases[k].log
        ends = []
        for choice in choices:
            gap, takes_effect = gap_of(log, choice.frames), delay + choice.first * DELAY_SCALE
            sooner, later = _of_ticks(scan, k, choice)
            ends.append((takes_effect - sooner - gap.high, takes_effect + later - gap.low))
        unsure = error + _scatter(log)
        lows.append(min(low for low, _ in ends) - unsure)
        highs.append(max(high for _, high in ends) + unsure)
    low, high = max(lows), min(highs)
    return max(min(low, high), 0.0), max(low, high, 0.0)


def unsure_commands(scan: Scan, credible: Mapping[int, Sequence[PulseChoice]]) -> tuple[str, ...]:
    """Return the commands of which it is not sure which pulse carries them, a line a log."""
    lines = []
    for k, choices in credible.items():
        log, now = scan.forecast.cases[k].log, scan.now(k).frames
        others = [near_edges(log, now, choice.frames) for choice in choices if choice.frames != now]
        times = np.unique(np.concatenate(others)) if others else np.zeros(0)
        if len(times):
            shown = ", ".join(f"{t:.3f}" for t in times[:_SHOWN]) + (", ..." if len(times) > _SHOWN else "")
            lines.append(f"log {log.name!r}: the commands at {shown} s change near the edge of a pulse; which pulse "
                         "carries them is not sure")
    return tuple(lines)


def _of_ticks(scan: Scan, k: int, choice: PulseChoice) -> tuple[float, float]:
    """Return by how much sooner and later pulses could come if ticks were as much later and sooner after them [s]."""
    ticks = scan.ticks.get(k)
    if ticks is None:
        return 0.0, 0.0
    gap = ticks.gap_of(choice.frames.tick)
    return gap.high - choice.frames.tick, choice.frames.tick - gap.low


def _scatter(log: Log) -> float:
    """Return how far off their beat the stamps of commands lie at most [s]; where they have none, they are believed."""
    found = regular_times(log.time)
    if found is None:
        return 0.0
    off = np.abs(log.time - found.times)
    return float(np.quantile(off, 0.95))


def phase_errors(forecast: Forecast, cases: Sequence[int], parts: Sequence[LogPart], rows: Sequence[Rows],
                 loss: Loss, doubt: Uncertainty) -> list[float]:
    """Return the standard error of when each log's pulses take effect, at any time in the log [s].

    Parameters
    ----------
    forecast : Forecast
    cases : sequence of int
    parts : sequence of LogPart
        Of these logs, with derivatives.
    rows : sequence of Rows
        Of the same: how their own numbers follow the shared ones.
    loss : Loss
    doubt : Uncertainty
        Of the shared numbers.
    """
    drift = _drift(forecast, cases, parts, loss, doubt.inflation)
    errors = []
    for k, part, row in zip(cases, parts, rows, strict=True):
        case = forecast.cases[k]
        place = forecast.names_of_own(case).index("frame_phase")
        inside = np.abs(part.residual) <= loss.limit
        belief = forecast.own_belief(case)[1]
        H = (part.own * inside[:, None]).T @ part.own + np.diag(belief**2)
        own = doubt.inflation**2 * float(np.linalg.pinv(H)[place, place])
        follow = row.follow[place] if row.follow is not None else np.zeros(len(doubt.covariance))
        middle = DELAY_SCALE * math.sqrt(own + float(follow @ doubt.covariance @ follow))
        errors.append(math.hypot(middle, 0.5 * case.log.duration * drift))
    return errors


def _drift(forecast: Forecast, cases: Sequence[int], parts: Sequence[LogPart], loss: Loss, inflation: float) -> float:
    """Return how fast pulses may run away from the period that is used [s/s], as far as the residuals can say."""
    along, power = 0.0, 0.0
    for k, part in zip(cases, parts, strict=True):
        case = forecast.cases[k]
        time = np.concatenate([case.times[place] for place in case.places.values()]) - 0.5 * case.log.duration
        moved = part.later * time
        along -= float(moved @ np.clip(part.residual, -loss.limit, loss.limit))
        power += float(moved @ moved)
    return DELAY_SCALE * math.hypot(along / power, inflation / math.sqrt(power)) if power > 0.0 else 0.0
