"""How surely the numbers of a robot are known: from the derivatives of the whole robot, and from beliefs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.numbers import RESISTANCE, VOLTAGE
from servotwin.identification.arms.problem import Problem
from servotwin.identification.arms.rows import Noise, parts_of
from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.point import LogPart
from servotwin.identification.fitting.task import HUBER
from servotwin.identification.fitting.uncertainty import Rows, Uncertainty, rows_of, uncertainty
from servotwin.identification.fitting.words import Unidentifiable, explain, simplest, vague_directions

Array = NDArray[np.float64]
_BOTH = 2.0  # times the variance of half a difference: that of a single simulation


class Doubts(NamedTuple):
    """Uncertainty of the numbers, how much of what is known of each is belief, and what the episodes cannot say."""

    all: Uncertainty
    shares: dict[str, float]
    unidentifiable: tuple[Unidentifiable, ...]


def doubts_of(what: Problem, x: Array, noise: Noise, found: Sequence[Array], slopes: Sequence[Array],
              shakes: Sequence[Array]) -> Doubts:
    """Return what residuals and derivatives at a point say of the numbers.

    Parameters
    ----------
    what : Problem
    x : ndarray, shape (numbers,)
    noise : Noise
    found : sequence of ndarray, shape (n, joints)
        Residuals [rad].
    slopes, shakes : sequence of ndarray, shape (n, joints, numbers)
        Derivatives, and by how much a simulation is off them [rad]: half of what steps to either side differ by.
    """
    numbers, loss, nothing = what.numbers, Loss(HUBER), Prior(np.zeros(0), np.zeros(0))
    rows: list[Rows] = [rows_of(part, loss, nothing, np.zeros(0)) for episode, residual, slope, used in zip(
        what.episodes, found, slopes, what.used, strict=True)
        for part in parts_of(episode, residual, slope, noise, used)]
    stuck = what.at_bound(x)
    prior = what.prior
    beliefs = uncertainty(rows, prior, stuck)
    rough = [part for episode, residual, shake, used in zip(what.episodes, found, shakes, what.used, strict=True)
             for part in parts_of(episode, residual, shake, noise, used)]
    beliefs = replace(beliefs, covariance=beliefs.covariance + shaken(rows, rough, beliefs.curvature))
    known = np.array([numbers.weight[k] if name in (VOLTAGE, RESISTANCE) else 0.0
                      for k, name in enumerate(numbers.names)])
    moves = ~stuck
    information = (beliefs.information + np.diag(known**2))[np.ix_(moves, moves)]
    flags, directions = np.zeros(len(x), np.bool_), np.zeros((len(x), 0))
    flags[moves], some = vague_directions(information, beliefs.inflation, _sizes(what)[moves])
    directions = np.zeros((len(x), some.shape[1]))
    directions[moves] = some
    if some.shape[1]:
        directions = simplest(directions)
    belief = np.array([one.belief for one in numbers.all])
    prior_share = dict(zip(numbers.names, np.clip((beliefs.std / belief)**2, 0.0, 1.0).tolist(), strict=True))
    shares = [1.0 if one.logarithmic else math.nan for one in numbers.all]
    named = {str(one): one for one in explain(numbers.names, shares, flags, directions)}  # several of the same members
    return Doubts(beliefs, prior_share, tuple(named.values()))


def shaken(rows: Sequence[Rows], shakes: Sequence[LogPart], curvature: Array) -> Array:
    """Return the covariance that the roughness of simulations adds, shape (numbers, numbers).

    Servos that stick and slip end a hair elsewhere for the smallest change, over many samples, and residuals at the
    best point have that too. Each derivative shows a draw of it, halved: what its two sides differ by.

    Parameters
    ----------
    rows : sequence of Rows
        What each part says of the numbers.
    shakes : sequence of LogPart
        Its draws in the place of derivatives, in units of noise; those of 0 are none.
    curvature : ndarray, shape (numbers, numbers)
        Inverse curvature of the cost.
    """
    g = np.sum([(r.slope * r.inside[:, None]).T @ part.shared for r, part in zip(rows, shakes, strict=True)], axis=0)
    drawn = np.any([np.abs(part.shared).any(axis=0) for part in shakes], axis=0)
    off = curvature @ g[:, drawn]
    return np.asarray(_BOTH * off @ off.T / max(off.shape[1], 1))


def _sizes(what: Problem) -> Array:
    """Return what counts as the whole of a number, on its scale: what is believed of it, or 1."""
    weight = what.numbers.weight
    return np.where(weight > 0.0, 1.0 / np.maximum(weight, 1e-300), 1.0)
