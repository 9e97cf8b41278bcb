"""How surely a fit knows its numbers: covariance from the curvature of the cost and from how the residuals scatter.

Where the residuals of a log follow each other (a model never fits perfectly), their number overstates what they say.
The covariance is then that of first-order autoregressive residuals, widened to that of Newey & West (1987) where these
remember longer; with many logs it is what varies between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.arrow import Loss, Prior
from servotwin.identification.fitting.point import LogPart

Array = NDArray[np.float64]

_MANY_LOGS = 5  # as many logs for each number
_HARDLY, _SURELY = 1.5, 3.0  # standard errors of a correlation of 0


@dataclass(frozen=True, eq=False)
class Rows:
    """What one log says of the shared numbers once its own numbers have been fitted too.

    Parameters
    ----------
    score : ndarray, shape (m,)
        Residuals, those beyond the limit of the loss cut off, in units of noise.
    slope : ndarray, shape (m, p)
        Derivatives, with the part that the log's own numbers can imitate taken away.
    inside : ndarray of float, shape (m,)
        1 within the limit of the loss, else 0.
    own : int
        How many of the last rows are beliefs about the log's own numbers.
    follow : ndarray, shape (own, p), optional
        How the own numbers follow when the shared ones move.
    """

    score: Array
    slope: Array
    inside: Array
    own: int = 0
    follow: Array | None = None

    @property
    def residual(self) -> Array:
        """The score of measurements alone."""
        return self.score[:len(self.score) - self.own]


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of the shared numbers of a fit (scaled).

    Parameters
    ----------
    information : ndarray, shape (p, p)
        Of the data alone, per unit of noise.
    covariance : ndarray, shape (p, p)
        With priors.
    curvature : ndarray, shape (p, p)
        Inverse curvature of the cost, priors included.
    inflation : float
        By how much the correlation of residuals widens the standard errors, in the mean.
    method : str
        "independent residuals", "correlated residuals" or "between logs".
    freedom : float
        Degrees of freedom of Student's t; inf for a normal law.
    autocorrelation : float
        Of neighbouring residuals.
    """

    information: Array
    covariance: Array
    curvature: Array
    inflation: float
    method: str
    freedom: float
    autocorrelation: float

    @property
    def std(self) -> Array:
        """Standard errors."""
        return np.sqrt(np.diag(self.covariance))

    def quantile(self, level: float) -> float:
        """Return how many standard errors an interval reaches either way."""
        from scipy.special import ndtri, stdtrit

        tail = 0.5 + 0.5 * level
        return float(ndtri(tail)) if math.isinf(self.freedom) else float(stdtrit(self.freedom, tail))


def rows_of(part: LogPart, loss: Loss, own: Prior, at: Array) -> Rows:
    """Return what a log says of the shared numbers.

    Parameters
    ----------
    part : LogPart
        With central derivatives.
    loss : Loss
    own : Prior
        Beliefs about the log's own numbers.
    at : ndarray, shape (l,)
        These numbers.
    """
    inside = (np.abs(part.residual) <= loss.limit).astype(np.float64)
    score = np.clip(part.residual, -loss.limit, loss.limit)
    slope = part.shared
    if part.own.shape[1]:
        # The beliefs are rows like any measurement
        belief = np.diag(own.weight)
        score, inside = np.concatenate([score, (at - own.mean) * own.weight]), np.append(inside, np.ones(len(at)))
        slope = np.concatenate([slope, np.zeros((len(at), slope.shape[1]))])
        alone = np.concatenate([part.own, belief])
        weighted = alone * inside[:, None]
        H = weighted.T @ alone
        follow = np.linalg.solve(H + 1e-12 * np.eye(len(at)) * max(H.max(), 1.0), weighted.T @ slope)
        return Rows(score, slope - alone @ follow, inside, len(at), -follow)
    return Rows(score, slope, inside)


def uncertainty(rows: Sequence[Rows], prior: Prior, held: NDArray[np.bool_],
                vague: Array | None = None) -> Uncertainty:
    """Return the covariance of the shared numbers.

    Parameters
    ----------
    rows : sequence of Rows
        Of each log.
    prior : Prior
    held : ndarray of bool, shape (p,)
        Numbers that are known or at a bound: they do not vary.
    vague : ndarray, shape (p, q), optional
        Directions that are not determined: nothing varies along them either, or it would drown all else.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> rows = [Rows(rng.normal(size=400), np.ones((400, 1)), np.ones(400))]
    >>> u = uncertainty(rows, Prior(np.zeros(1), np.zeros(1)), np.array([False]))
    >>> u.method, round(float(u.std[0]), 2)
    ('independent residuals', 0.05)
    """
    p = rows[0].slope.shape[1]
    information = np.sum([(r.slope * r.inside[:, None]).T @ r.slope for r in rows], axis=0)
    count = sum(len(r.residual) for r in rows)
    correlation, lag = _correlation([r.residual for r in rows])
    plain = _meat(rows, 0)
    freedom = math.inf
    if len(rows) >= _MANY_LOGS * p:
        # Whatever varies within logs or from log to log is in this
        scores = np.array([r.slope.T @ r.score for r in rows])
        meat, method = scores.T @ scores * len(rows) / (len(rows) - 1.0), "between logs"
        freedom = len(rows) - 1.0
    elif abs(correlation) < _HARDLY / math.sqrt(count):
        meat, method = plain, "independent residuals"
    else:
        meat, freedom = _first_order(rows, correlation)
        if abs(correlation) > _SURELY / math.sqrt(count):  # perhaps a longer memory than that
            longer = _meat(rows, lag)
            more = np.sqrt(np.maximum(np.diag(longer) / np.maximum(np.diag(meat), 1e-300), 1.0))
            meat = meat * np.outer(more, more)
        method = "correlated residuals"
    meat = meat * count / max(count - p, 1)
    free = ~held
    stiff = np.zeros((p, p))
    if vague is not None and vague.shape[1]:
        stiff = 1e6 * max(float(np.diag(information).max()), 1.0) * vague @ vague.T
    beliefs = np.diag(prior.weight**2)
    curvature, covariance, simple = (np.zeros((p, p)) for _ in range(3))
    inner = np.ix_(free, free)
    curvature[inner] = _inverse((information + stiff + beliefs)[inner])
    covariance[inner] = _sandwich(curvature[inner], (meat + beliefs)[inner])
    simple[inner] = _sandwich(curvature[inner], (plain + beliefs)[inner])
    known = np.diag(simple) > 0.0
    ratio = np.sqrt(np.diag(covariance)[known] / np.diag(simple)[known])
    inflation = max(float(np.median(ratio)), 1.0) if known.any() else 1.0
    return Uncertainty(information, covariance, curvature, inflation, method, freedom, correlation)


def _first_order(rows: Sequence[Rows], correlation: float) -> tuple[Array, float]:
    """Return the covariance of the gradient if residuals are first-order autoregressive, and degrees of freedom.

    The fit itself takes slow residuals away; their correlation is corrected for that (Kendall 1954), and so is their
    size.
    """
    from scipy.signal import lfilter

    p, own = rows[0].slope.shape[1], float(np.mean([r.own for r in rows]))
    sizes = [len(r.residual) for r in rows]
    fitted, mean = own + p / len(rows), float(np.mean(sizes))
    rho = min(max(correlation + (1.0 + 3.0 * max(correlation, 0.0)) * fitted / mean, 0.0), 0.98)
    apart = (1.0 - rho) / (1.0 + rho)  # independent residuals for each that there is
    power = sum(float(r.residual @ r.residual) for r in rows) / sum(sizes)
    power /= max(1.0 - fitted / (apart * mean), 0.3)
    total = np.zeros((p, p))
    for r in rows:
        m = len(r.residual)
        g = (r.slope * r.inside[:, None])[:m]
        echo = lfilter([1.0], [1.0, -rho], g, axis=0)
        total += power * (echo.T @ g + g.T @ echo - g.T @ g) + r.slope[m:].T @ r.slope[m:]
    return total, max(sum(sizes) * apart - p - own * len(rows), 3.0)


def _sandwich(bread: Array, meat: Array) -> Array:
    """Return bread · meat · bread, without variances that rounding makes negative."""
    values, vectors = np.linalg.eigh(meat)
    half = bread @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(half @ half.T)


def _inverse(H: Array) -> Array:
    """Return the inverse of a symmetric matrix; what has no curvature at all stays without, and is told apart."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12 * max(float(np.diag(H).max(initial=0.0)), 1e-12)))
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    values = np.maximum(values, 1e-14)
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _meat(rows: Sequence[Rows], lag: int) -> Array:
    """Return the covariance of the gradient, residuals up to `lag` samples apart being related (Bartlett weights)."""
    total = np.zeros((rows[0].slope.shape[1],) * 2)
    for r in rows:
        g = r.slope * r.score[:, None]
        total += g.T @ g
        for k in range(1, min(lag, len(g) - 1) + 1):
            part = g[k:].T @ g[:-k]
            total += (1.0 - k / (lag + 1.0)) * (part + part.T)
    return total


def _correlation(scores: Sequence[Array]) -> tuple[float, int]:
    """Return the correlation of neighbouring residuals, and after how many samples little of it is left."""
    longest = max(len(s) for s in scores)
    power = sum(float(s @ s) for s in scores)
    if power == 0.0:
        return 0.0, 0
    first = sum(float(s[1:] @ s[:-1]) for s in scores) / power
    lag = 1
    while lag < longest // 2 and sum(float(s[lag:] @ s[:-lag]) for s in scores if len(s) > lag) > 0.1 * power:
        lag += 1
    return first, min(2 * lag, longest // 2)
