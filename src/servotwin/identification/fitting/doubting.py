"""The doubts of a fit: how surely it knows its numbers, and what the logs do not say of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Outcome, Prior, Search
from servotwin.identification.fitting.assumptions import Assumption, systematic, with_assumptions
from servotwin.identification.fitting.counts import counts_of
from servotwin.identification.fitting.delay_range import delay_range, phase_errors, unsure_commands
from servotwin.identification.fitting.doubts import Doubts, allowed, prior_share, sizes_at, vague
from servotwin.identification.fitting.intervals import ends
from servotwin.identification.fitting.phases import credible
from servotwin.identification.fitting.point import FINE, STEP, LogPart
from servotwin.identification.fitting.remedies import with_remedies
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of, uncertainty
from servotwin.identification.fitting.words import explain, simplest

Array = NDArray[np.float64]
Told = Callable[[float, str], None]


def doubts_of(task: Task, found: Outcome, level: float, show: Told) -> Doubts:
    """Return covariance, ends of the intervals, what is not determined, and what is prior.

    Where lanes may go nearly they do: what counts is how the cost rises, and it rises alike.

    Parameters
    ----------
    task : Task
    found : Outcome
        Its end.
    level : float
        Of the intervals.
    show : callable
    """
    with task.forecast.roughly():
        return _doubts_of(task, found, level, show)


def assumptions_at(task: Task, found: Outcome) -> tuple[Assumption, ...]:
    """Return what a servo file leaves out or assumes, and what the logs say of it where a search ended."""
    with task.forecast.roughly():
        return systematic(task, found.point, *_straight(task, found)[:4]).numbers


class _Straight(NamedTuple):
    """The problem made straight at a point: what logs say there, and the covariance of the shared numbers.

    Numbers that are not determined have flags, and directions in which nothing is known.
    """

    parts: list[LogPart]
    beliefs: list[Prior]
    rows: list[Rows]
    doubt: Uncertainty
    information: Array
    flags: NDArray[np.bool_]
    directions: Array


def _straight(task: Task, found: Outcome) -> _Straight:
    forecast = task.forecast
    parts = forecast.at(found.point, central=True, cases=task.fitted)
    beliefs = [Prior(*forecast.own_belief(forecast.cases[k])) for k in task.fitted]
    rows: list[Rows] = [rows_of(part, task.loss, own, found.point.own[k], counts_of(forecast, k))
                        for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
    stuck = task.at_bound(found) | task.held
    doubt = uncertainty(rows, task.prior, stuck)
    information = _information(task, found, parts, beliefs)
    flags, directions = vague(information, doubt.inflation, sizes_at(task, found), ~task.held)
    directions = simplest(directions)
    if flags.any():
        doubt = uncertainty(rows, task.prior, stuck, directions)
    return _Straight(parts, beliefs, rows, doubt, information, flags, directions)


def _doubts_of(task: Task, found: Outcome, level: float, show: Told) -> Doubts:
    forecast = task.forecast
    parts, beliefs, rows, doubt, information, flags, directions = _straight(task, found)
    stuck = task.at_bound(found) | task.held
    names = (*forecast.space.names, *forecast.extra)
    shares = [*forecast.space.shares(found.point.shared), *([math.nan] * len(forecast.extra))]
    open_ = explain(names, shares, flags, directions)
    which = [k for k in range(len(names)) if not flags[k] and not stuck[k]]
    search = Search(forecast, task.loss, task.prior, task.lower, task.upper, task.fitted, held=stuck)
    found = replace(found, cost=search.costs([found.point])[0]) if forecast.nearly else found
    count = max(len(which), 1)
    seen: list[Outcome] = []
    reaching = ends(search, found, doubt, which, level, rows=rows, deeper=seen.append,
                    tell=lambda done: show(0.76 + 0.18 * done / count, "intervals"))
    more = systematic(task, found.point, parts, beliefs, rows, doubt)
    return Doubts(doubt, with_assumptions(reaching, doubt, level, more),
                  with_remedies(forecast, found.point, open_, names),
                  prior_share(names, doubt, reaching, flags, directions, task.prior.weight),
                  allowed(task, found, rows, directions, information, flags, doubt, reaching, level),
                  _spans(task, found, parts, rows, doubt, level),
                  min(seen, key=lambda there: there.cost, default=None), more)


def _spans(task: Task, found: Outcome, parts: Sequence[LogPart], rows: Sequence[Rows], doubt: Uncertainty,
           level: float) -> dict[str, tuple[float, float]]:
    """Return the range of the delay (SI) where each log's pulses say when they take effect."""
    if not task.held.any():
        return {}
    reach = doubt.quantile(1.0 - (1.0 - level) / len(task.fitted))  # all of the logs have to hold
    errors = phase_errors(task.forecast, task.fitted, parts, rows, task.loss, doubt)
    scan = task.scan(found.point)
    pulses = credible(scan, task.fitted)
    task.unsure = unsure_commands(scan, pulses)
    return {"delay": delay_range(scan, pulses, [
        reach * error + task.stamps_off.get(k, 0.0) for k, error in zip(task.fitted, errors, strict=True)])}


def _information(task: Task, found: Outcome, central: Sequence[LogPart], beliefs: Sequence[Prior]) -> Array:
    """Return what the logs say of the shared numbers, from differences so fine that what has no effect has none."""
    jagged = task.forecast.step > STEP  # then fine differences are those of steps, not of what moves the shaft
    parts = central if jagged else task.forecast.at(found.point, step=FINE, cases=task.fitted)
    rows = [rows_of(part, task.loss, own, found.point.own[k])
            for k, part, own in zip(task.fitted, parts, beliefs, strict=True)]
    return np.asarray(np.sum([(r.slope * r.inside[:, None]).T @ r.slope for r in rows], axis=0))
