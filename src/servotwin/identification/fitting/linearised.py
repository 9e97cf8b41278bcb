"""Intervals of a fit that was stopped: those of the problem made straight at the best so far, and wider."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from servotwin.errors import ServotwinError
from servotwin.identification.fitting.arrow import Outcome, Prior
from servotwin.identification.fitting.counts import counts_of
from servotwin.identification.fitting.doubts import Doubts, sizes_at, vague
from servotwin.identification.fitting.intervals import Ends
from servotwin.identification.fitting.point import DELAY_SCALE
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, rows_of, uncertainty
from servotwin.identification.fitting.words import simplest

LINEARISED = "intervals (those here are of the problem made straight at the best so far, three times as wide)"
"""What is not known, where there are such."""
_UNKNOWN = 3.0  # times as wide, assumed: among kinks those of a finished fit are up to three times what is straight


def hurried(task: Task, found: Outcome, level: float) -> tuple[Outcome, Doubts]:
    """Return where a fit was stopped, in the noise that it leaves there, and what is known of its numbers by then.

    The problem counts as straight there. How far its end is, and how it bends, is not known: intervals reach to either
    side of where a whole step would lead, and are three times as wide.
    """
    forecast, nothing = task.forecast, Doubts()
    try:
        task.measure(found.point)
        parts = forecast.at(found.point, central=True, cases=task.fitted)
        beliefs = [Prior(*forecast.own_belief(forecast.cases[k])) for k in task.fitted]
        rows: list[Rows] = [rows_of(part, task.loss, own, found.point.own[k], counts_of(forecast, k))
                            for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
        stuck = task.at_bound(found) | task.held
        doubt = uncertainty(rows, task.prior, stuck)
        flags, directions = vague(doubt.information, doubt.inflation, sizes_at(task, found), ~task.held)
        if flags.any():
            doubt = uncertainty(rows, task.prior, stuck, simplest(directions))
    except (ServotwinError, np.linalg.LinAlgError, ValueError, ArithmeticError):
        return found, nothing  # nothing is there to make straight
    slope = (found.point.shared - task.prior.mean) * task.prior.weight**2 + np.sum(
        [r.slope.T @ r.score for r in rows], axis=0)
    ahead, std = np.abs(doubt.curvature @ slope), doubt.std
    reaching = {k: Ends(-reach, reach, "linearised") for k in np.flatnonzero(~flags & ~stuck).tolist()
                if std[k] > 0.0 and math.isfinite(reach := _UNKNOWN * (doubt.quantile(level, k) + ahead[k] / std[k]))}
    spans = _pulses(task, found)
    reaching = {k: reach for k, reach in reaching.items() if not (spans and k == _delay(task))}
    return found, replace(nothing, doubt=doubt, ends=reaching, spans=spans) if reaching else nothing


def _delay(task: Task) -> int:
    """Return the place of the delay among the shared numbers; -1 where it is none."""
    extra = task.forecast.extra
    return len(task.forecast.space) + extra.index("delay") if "delay" in extra else -1


def _pulses(task: Task, found: Outcome) -> dict[str, tuple[float, float]]:
    """Return the range of the delay (SI) where pulses have not told yet which of them carries a command: a frame."""
    k = _delay(task)
    if k < 0 or not task.forecast.phased:
        return {}
    delay = float(found.point.shared[k]) * DELAY_SCALE
    return {"delay": (max(delay - task.period, 0.0), delay + task.period)}
