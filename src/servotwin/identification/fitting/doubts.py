"""How surely a fit knows each number: intervals, what the logs leave open, and how much of it is prior."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Outcome, Search
from servotwin.identification.fitting.assumptions import Systematic
from servotwin.identification.fitting.draws import Allowed
from servotwin.identification.fitting.intervals import Ends
from servotwin.identification.fitting.task import Task
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, uncertainty
from servotwin.identification.fitting.words import Unidentifiable, vague_directions

Array = NDArray[np.float64]

_RISE = 1.92  # of the cost at the ends of a 95 % interval of one number
_PART = 0.05  # of a direction
_WIDE = 6.0  # e-folds between usual bounds: a prior that is wider says nothing
_LEAST = 1e-12
_WAY = (0.02, 0.05, 0.1, 0.2, 0.35, 0.55, 0.8, 1.0)  # of the way to the bounds, at which the cost is asked


@dataclass(frozen=True)
class Doubts:
    """What a fit knows of its uncertainty.

    Parameters
    ----------
    doubt : Uncertainty, optional
        None where it was not sought.
    ends : mapping of int to Ends
        Of the intervals.
    unidentifiable : tuple of Unidentifiable
    prior_share : mapping of str to float
        How much of each interval is prior.
    allowed : Allowed, optional
    spans : mapping of str to tuple of float
        Ranges (SI) of what pulses tell.
    systematic : Systematic, optional
        What the servo file leaves out does to the numbers; `ends` hold it.
    deeper : Outcome, optional
        The best that was seen on the way, if that is clearly better than where the search ended.
    """

    doubt: Uncertainty | None = None
    ends: Mapping[int, Ends] = field(default_factory=dict)
    unidentifiable: tuple[Unidentifiable, ...] = ()
    prior_share: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed | None = None
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    deeper: Outcome | None = None
    systematic: Systematic | None = None


def sizes_at(task: Task, found: Outcome) -> Array:
    """Return by how much each shared number counts as changed much: by itself, of a logarithmic one by a factor e."""
    searched = task.forecast.space.parameters
    sizes = np.maximum(np.abs(found.point.shared), 1.0)
    sizes[:len(searched)][[p.logarithmic for p in searched]] = 1.0
    return sizes


def vague(information: Array, inflation: float, sizes: Array, asked: NDArray[np.bool_]) -> tuple[Any, Array]:
    """Return what is not determined of the numbers that are asked about, and the directions."""
    flags, directions = vague_directions(information[np.ix_(asked, asked)], inflation, sizes[asked])
    all_flags, all_directions = np.zeros(len(asked), np.bool_), np.zeros((len(asked), directions.shape[1]))
    all_flags[asked], all_directions[asked] = flags, directions
    return all_flags, all_directions


def prior_share(names: Sequence[str], doubt: Uncertainty, reaching: Mapping[int, Ends], flags: NDArray[np.bool_],
                directions: Array, weight: Array) -> dict[str, float]:
    """Return how much of what is known of each number is prior: 1 less the variance with over that without priors.

    Of a profile it is the part of the priors in the rise of the cost at its ends, which is the same for a parabola. Of
    a number that the logs do not determine it is 1 if a prior does, and else 0; of one that does not vary, nan.
    """
    lengths = np.maximum(np.abs(directions).max(axis=0, initial=0.0), _LEAST)
    believed = ((weight[:, None] * directions / lengths) ** 2).sum(axis=0) > 1.0 / _WIDE**2
    found = {}
    for k, name in enumerate(names):
        if flags[k]:
            size = np.abs(directions[k])
            found[name] = float(directions.shape[1] > 0 and bool(believed[int(np.argmax(size))]))
        elif k in reaching and not math.isnan(reaching[k].prior):
            found[name] = reaching[k].prior
        elif doubt.alone[k, k] > 0.0:
            found[name] = float(np.clip(1.0 - doubt.covariance[k, k] / doubt.alone[k, k], 0.0, 1.0))
        else:
            found[name] = math.nan
    return found


def allowed(task: Task, found: Outcome, rows: Sequence[Rows], directions: Array, information: Array,
            flags: NDArray[np.bool_], doubt: Uncertainty, reaching: Mapping[int, Ends], level: float) -> Allowed:
    """Return what logs, priors and bounds allow together.

    Parameters
    ----------
    task : Task
    found : Outcome
        The end of its search.
    rows : sequence of Rows
        Of the fitted logs.
    directions : ndarray, shape (p, q)
        That the logs do not determine.
    information : ndarray, shape (p, p)
        Of the logs alone, from fine differences.
    flags : ndarray of bool, shape (p,)
        Numbers that are not determined.
    doubt : Uncertainty
    reaching : mapping of int to Ends
        Of the intervals at `level`: a law that is no parabola is wider on one side.
    """
    inflation = doubt.inflation
    x = found.point.shared
    p, stuck = len(x), task.at_bound(found) | task.held
    whole = uncertainty(rows, task.prior, task.held, directions)
    score = np.sum([r.slope.T @ r.score for r in rows], axis=0) + task.prior.weight**2 * (x - task.prior.mean)
    shift = -whole.curvature @ np.where(stuck, score, 0.0)
    stretch = np.ones((2, p))
    for k, ends in reaching.items():
        reach = doubt.quantile(level, k)
        stretch[:, k] = -ends.lower / reach, ends.upper / reach
    axes, precision = _axes(directions, whole.covariance, task.prior.weight, information / inflation**2)
    grows, adds = _in_proportion(task, x, directions) & flags & ~stuck, _in_sums(task, directions) & flags & ~stuck
    made = Allowed(x, shift, axes, precision, task.lower, task.upper, grows, np.zeros(p, np.bool_), directions,
                   np.zeros((2, directions.shape[1])), stretch)
    tried = [made] if not adds.any() else [made, replace(made, by_logarithm=np.zeros(p, np.bool_), by_value=adds)]
    reached = [_reach(task, found, one, inflation) for one in tried]
    # What the logs leave open is straight where numbers are taken as they stand in it: in products, or in sums
    best = int(np.argmax([way for _, way in reached]))
    return replace(tried[best], reach=reached[best][0])


def _in_proportion(task: Task, x: Array, directions: Array) -> NDArray[np.bool_]:
    """Tell which numbers may be drawn by their logarithm although they are searched as they are.

    What is in a product with others keeps it by moving in proportion; and of a size that nothing is known of, each
    factor is as likely as any other.
    """
    space = task.forecast.space
    found = np.zeros(len(x), np.bool_)
    for direction in directions.T:
        members = np.abs(direction) > _PART * np.abs(direction).max()
        believed = (task.prior.weight[members] > 0.0).any()
        if members.sum() > 1 or not believed:
            found |= direction != 0.0
    for k, p in enumerate(space.parameters):
        found[k] &= not p.logarithmic and p.lower >= 0.0 and x[k] > _PART
    found[len(space):] = False
    return found


def _in_sums(task: Task, directions: Array) -> NDArray[np.bool_]:
    """Tell which numbers may be drawn as they are although they are searched by their logarithm."""
    several = (np.abs(directions) > _PART * np.abs(directions).max(axis=0, initial=0.0)).sum(axis=0) > 1
    found = (directions[:, several] != 0.0).any(axis=1)
    for k, p in enumerate(task.forecast.space.parameters):
        found[k] &= p.logarithmic
    found[len(task.forecast.space):] = False
    return np.asarray(found)


def _axes(directions: Array, covariance: Array, weight: Array, information: Array) -> tuple[Array, Array]:
    """Return axes along which what is known is independent, and the precision along each.

    Those of what the logs determine first, each going along in the open directions as the priors there want; then those
    of the open directions.
    """
    q = directions.shape[1]
    basis = np.linalg.svd(directions)[0] if q else np.eye(len(weight))
    V, Q = basis[:, :q], basis[:, q:]
    beliefs = np.diag(weight**2)
    variance, known = np.linalg.eigh(Q.T @ covariance @ Q)
    precision, open_axes = np.linalg.eigh(V.T @ (beliefs + information) @ V)
    follow = np.linalg.pinv(V.T @ (beliefs + information) @ V, hermitian=True) @ (V.T @ beliefs @ Q)
    return (np.column_stack([(Q - V @ follow) @ known, V @ open_axes]),
            np.append(1.0 / np.maximum(variance, _LEAST**2), np.maximum(precision, 0.0)))


def _reach(task: Task, found: Outcome, made: Allowed, inflation: float) -> tuple[Array, float]:
    """Return how far the logs allow to go along each open direction, back and forth, and which part of all that is.

    They may be open one way only.
    """
    farthest = np.zeros((2, made.open.shape[1]))
    for k, direction in enumerate(made.directions.T):
        moves = np.abs(direction) > _LEAST
        room = made.box[:, moves] / direction[moves]
        farthest[:, k] = room.min(axis=0).max(), room.max(axis=0).min()
    if not farthest.size:
        return farthest, 1.0
    steps = farthest[:, :, None] * np.array(_WAY)
    points = made.points((steps[..., None] * made.directions.T[None, :, None, :]).reshape(-1, len(made.best)))
    points = np.clip(np.vstack([made.best, points]), task.lower, task.upper)
    search = Search(task.forecast, task.loss, task.prior, task.lower, task.upper, task.fitted, task.held)
    with task.forecast.roughly():
        costs = search.costs([found.point._replace(shared=x) for x in points])
    of_logs = np.array([cost - task.prior.cost(x) for cost, x in zip(costs, points, strict=True)])
    rises = ((of_logs[1:] - of_logs[0]) / inflation**2).reshape(steps.shape)
    reach = np.array([[_until(steps[side, k], rises[side, k]) for k in range(steps.shape[1])] for side in (0, 1)])
    way = np.ptp(reach, axis=0) / np.maximum(np.ptp(farthest, axis=0), _LEAST)
    return reach, float(way.mean())


def _until(steps: Array, rises: Array) -> float:
    """Return the step at which the cost has risen as far as it may; the last one if it never does."""
    over = np.flatnonzero(~(rises <= _RISE))
    if not over.size:
        return float(steps[-1])
    k = int(over[0])
    last, before = (float(steps[k - 1]), max(float(rises[k - 1]), 0.0)) if k else (0.0, 0.0)
    # About a parabola in between; none where a simulation failed
    share = math.sqrt((_RISE - before) / (float(rises[k]) - before)) if math.isfinite(rises[k]) else 0.0
    return last + share * (float(steps[k]) - last)
