"""How certain the numbers of a fit are: covariance from the curvature of the cost and from how the residuals scatter.

Where the residuals of a log follow each other (a model never fits perfectly), their number overstates what they say.
The covariance is then that of first-order autoregressive residuals, widened to that of Newey & West (1987) where these
remember longer; with many logs it is what varies between them.

A fit takes away what its numbers can imitate, mostly what is slow: what is left is smaller than the noise and remembers
less. Both are known exactly for every correlation, so the one is found whose expectation is what is seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.search.case import LogPart
from servotwin.identification.fitting.search.least_squares import Loss, Prior

# --- How long residuals remember --------------------------------------------------------------------------------------

_GRID = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.96, 0.98])
_LEAST = 0.2  # of the noise's power is left at least: beyond that the numbers follow the noise itself


class NoiseMemory(NamedTuple):
    """First-order autoregressive noise behind residuals.

    Parameters
    ----------
    correlation : float
        Of neighbours, at least 0.
    power : float
        Variance of the noise, in units of that of the residuals' scale.
    excess : float
        Correlation that is seen, less what independent noise would leave.
    plain : float
        The variance if the noise were independent.
    """

    correlation: float
    power: float
    excess: float
    plain: float


def memory_of(rows: Sequence[Rows], directions: Array) -> NoiseMemory:
    """Return the noise that leaves such residuals.

    Parameters
    ----------
    rows : sequence of Rows
    directions : ndarray, shape (p, q)
        Along which the shared numbers were fitted.

    Examples
    --------
    >>> from servotwin.identification.fitting.uncertainty import Rows
    >>> noise = np.random.default_rng(0).normal(size=400)
    >>> rows = [Rows(part - part.mean(), np.ones((20, 0)), np.ones(20), alone=np.ones((20, 1)))
    ...         for part in noise.reshape(20, 20)]  # of each log its mean is taken away
    >>> found = memory_of(rows, np.zeros((0, 0)))
    >>> abs(found.excess) < 0.1, abs(found.power - 1.0) < 0.15
    (True, True)
    """
    power = sum(float(r.residual @ r.residual) for r in rows)
    if power == 0.0:
        return NoiseMemory(0.0, 0.0, 0.0, 0.0)
    seen = sum(float(r.residual[1:] @ r.residual[:-1]) for r in rows) / power
    bases = _bases(rows, directions)
    left = np.array([_left(bases, rho) for rho in _GRID])
    expected = np.maximum.accumulate(left[:, 1] / left[:, 0])
    rho = float(np.interp(seen, expected, _GRID))
    behind = power / np.interp([rho, 0.0], _GRID, left[:, 0])
    return NoiseMemory(rho, float(behind[0]), seen - float(expected[0]), float(behind[1]))


def _bases(rows: Sequence[Rows], directions: Array) -> list[tuple[Array, Array]]:
    """Return orthonormal columns for each log: of the shared numbers, together with the other logs, and of its own."""
    own = []
    for r in rows:
        own.append(_orthonormal(r.alone) if r.alone is not None else np.zeros((len(r.residual), 0)))
    shared = [r.slope[:len(r.residual)] @ directions for r in rows]
    shared = [s - u @ (u.T @ s) for s, u in zip(shared, own, strict=True)]
    joint = np.split(_orthonormal(np.concatenate(shared)), np.cumsum([len(s) for s in shared])[:-1])
    return list(zip(joint, own, strict=True))


def echo(columns: Array, rho: float) -> Array:
    """Return columns y of columns x that continue by y_k = x_k + ρ y_(k−1), as first-order noise does.

    Examples
    --------
    >>> echo(np.array([[1.0], [0.0], [0.0], [1.0]]), 0.5)[:, 0].tolist()
    [1.0, 0.5, 0.25, 1.125]
    """
    from scipy.linalg import solve_banded  # scipy.signal, which has a filter for it, takes 0.7 s to load

    if not columns.size:
        return columns.copy()
    bands = np.ones((2, len(columns)))
    bands[1] = -rho
    return np.asarray(solve_banded((1, 0), bands, columns))


def _orthonormal(columns: Array) -> Array:
    size = np.sqrt(np.sum(columns**2, axis=0))
    vectors, values, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(vectors[:, values > 1e-7 * values.max(initial=0.0)])


def _left(bases: Sequence[tuple[Array, Array]], rho: float) -> Array:
    """Return the expected sums of squares and of products of neighbours that noise of power 1 leaves.

    With P = U Uᵀ the projection that a fit makes, R the noise's correlation and L the shift by one sample, they are the
    traces of (1 − P) R and of L (1 − P) R (1 − P).
    """
    p = bases[0][0].shape[1]
    squares, products = 0.0, 0.0
    R_ss, L_ss = np.zeros((p, p)), np.zeros((p, p))
    for shared, own in bases:
        U = np.concatenate([shared, own], axis=1)
        n = len(U)
        ahead, back = echo(U, rho), echo(U[::-1], rho)[::-1]
        RU = ahead + back - U
        LU = np.zeros_like(U)
        LU[:-1] = U[1:]
        R, L = U.T @ RU, U.T @ LU
        LR = float(np.sum(U[:-1] * RU[1:]))  # of Uᵀ L R U and of Uᵀ R L U
        RL = float(np.sum(RU * LU))
        squares += n - float(np.trace(R))
        products += rho * (n - 1) - LR - RL
        R_ss, L_ss = R_ss + R[:p, :p], L_ss + L[:p, :p]
        products += float(np.sum(L * R.T)) - float(np.sum(L[:p, :p] * R[:p, :p].T))
    products += float(np.sum(L_ss * R_ss.T))
    total = sum(len(shared) for shared, _ in bases)
    return np.array([max(squares, _LEAST * total), products])


# --- How certain the numbers of a fit are -----------------------------------------------------------------------------
Array = NDArray[np.float64]
_MANY_LOGS = 5  # as many logs for each number
_HARDLY, _SURELY = 1.5, 3.0  # standard errors of a correlation of 0
_NOTHING, _PART = 1e-11, 0.0025  # of the most that is known: nothing; the square of a part of a direction that counts
_MOST_LEVER = 0.95


@dataclass(frozen=True, eq=False)
class Counts:
    """The effect of a counting instrument on the residuals of a log.

    Parameters
    ----------
    reading : ndarray of int, shape (m,)
        Number of the reading that a sample belongs to: samples in a row with the same value.
    power : ndarray, shape (m,)
        Variance of the error of its reading, in units of noise: a twelfth of the squared step, 0 where nothing counts.
    belief : ndarray, shape (own,)
        By how much the beliefs about the log's own numbers are off where the first reading is off by one of noise.
    """

    reading: NDArray[np.int64]
    power: Array
    belief: Array


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of one log on the shared numbers, its own numbers fitted too.

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
    lever : ndarray, shape (m,), optional
        Share of each residual that the log's own numbers take away.
    counts : Counts, optional
        Where an instrument that counts read the same value for a while.
    alone : ndarray, shape (m, l), optional
        Derivatives to the log's own numbers, beliefs apart.
    """

    score: Array
    slope: Array
    inside: Array
    own: int = 0
    follow: Array | None = None
    lever: Array | None = None
    counts: Counts | None = None
    alone: Array | None = None

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
    alone : ndarray, shape (p, p)
        Covariance that the logs alone would leave; that of what they do not determine is 0 too.
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
    freedoms : ndarray, shape (p,), optional
        The same for each number, where they differ.
    """

    information: Array
    covariance: Array
    alone: Array
    curvature: Array
    inflation: float
    method: str
    freedom: float
    autocorrelation: float
    freedoms: Array | None = None

    @property
    def std(self) -> Array:
        """Standard errors."""
        return np.sqrt(np.diag(self.covariance))

    def quantile(self, level: float, k: int | None = None) -> float:
        """Return how many standard errors an interval reaches either way: that of a number, or of most of them."""
        from scipy.special import ndtri, stdtrit

        tail = 0.5 + 0.5 * level
        freedom = self.freedom if k is None or self.freedoms is None else float(self.freedoms[k])
        return float(ndtri(tail)) if math.isinf(freedom) else float(stdtrit(freedom, tail))


def rows_of(part: LogPart, loss: Loss, own: Prior, at: Array, counts: Counts | None = None) -> Rows:
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
    counts : Counts, optional
        Where its instruments count.
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
        H = H + 1e-12 * np.eye(len(at)) * max(H.max(), 1.0)
        follow = np.linalg.solve(H, weighted.T @ slope)
        lever = np.sum(weighted * np.linalg.solve(H, alone.T).T, axis=1)
        return Rows(score, slope - alone @ follow, inside, len(at), -follow, lever, counts, part.own)
    return Rows(score, slope, inside, counts=counts)


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
    Q = _varying(held, vague)
    memory = memory_of(rows, Q)
    beliefs = np.diag(prior.weight**2)
    bread, bare = _inverse(Q.T @ (information + beliefs) @ Q), _inverse(Q.T @ information @ Q)
    curvature = Q @ bread @ Q.T
    plain = _meat(rows, 0, [_lever(r, curvature) for r in rows])
    freedom, freedoms, uneven = math.inf, None, False
    if len(rows) >= _MANY_LOGS * p:
        # All that varies within logs or from log to log is in this
        scores = np.array([r.slope.T @ r.score for r in rows])
        meats = [scores.T @ scores * len(rows) / (len(rows) - 1.0) * count / max(count - p, 1)]
        method, freedom = "between logs", len(rows) - 1.0
    elif abs(memory.excess) < _HARDLY / math.sqrt(count):
        meats, method, freedoms = [plain], "independent residuals", _freedom(rows, curvature)
        freedom = float(np.median(freedoms[~held])) if not held.all() else math.inf
    else:
        meats, freedom = [_first_order(rows, memory)], _independent(rows, memory)
        method, uneven = "correlated residuals", True
        if abs(memory.excess) > _SURELY / math.sqrt(count):  # perhaps a longer memory than that
            meats.append(_meat(rows, _lag([r.residual for r in rows])))
    if any(r.counts is not None for r in rows):
        meats.append(np.sum([_counted(r) for r in rows], axis=0))

    chance = 1.0 + 2.0 * np.sqrt(2.0 / _freedom(rows, curvature))

    def spread(inverse: Array, more: Array) -> Array:
        def of(meat: Array) -> Array:
            return np.asarray(Q @ _sandwich(inverse, Q.T @ (meat + more) @ Q) @ Q.T)

        found = _widest([of(meat) for meat in meats])
        if not uneven:
            return found
        # Errors that are larger where more is learnt, such as those of stamps while the shaft moves
        wider = _ratio(of(plain), of(_first_order(rows, memory._replace(correlation=0.0, power=memory.plain))))
        return _times(found, np.where(wider > chance, wider, 1.0))

    if freedoms is not None:  # a prior's part of a variance is known (Welch 1947)
        whole, data = (np.diag(Q @ _sandwich(bread, Q.T @ m @ Q) @ Q.T) for m in (plain + beliefs, plain))
        freedoms = np.where(data > 0.0, freedoms * (whole / np.maximum(data, 1e-300))**2, math.inf)
    covariance, simple = spread(bread, beliefs), Q @ _sandwich(bread, Q.T @ (plain + beliefs) @ Q) @ Q.T
    known = (np.diag(simple) > 0.0) & ~_open(information)
    ratio = np.sqrt(np.diag(covariance)[known] / np.diag(simple)[known])
    inflation = max(float(np.median(ratio)), 1.0) if known.any() else 1.0
    return Uncertainty(information, covariance, spread(bare, np.zeros_like(beliefs)), curvature, inflation, method,
                       freedom, memory.correlation if memory.excess > 0.0 else memory.excess, freedoms)


def _open(information: Array) -> NDArray[np.bool_]:
    """Tell which numbers have a part in a direction of which nothing is known: their variances there are rounding."""
    values, vectors = np.linalg.eigh(information)
    nothing = values < _NOTHING * max(float(values[-1]), 1e-300)
    return np.asarray((vectors[:, nothing] ** 2).sum(axis=1) > _PART)


def _varying(held: NDArray[np.bool_], vague: Array | None) -> Array:
    """Return directions of unit length, a column each, in which anything varies: neither held nor vague.

    Vague directions are left out rather than made stiff: the smallest part of a determined number in one of them, by
    rounding, would make that number stiff too.
    """
    Q = np.eye(len(held))[:, ~held]
    if vague is None or not vague.shape[1] or not Q.shape[1]:
        return Q
    vectors, sizes, _ = np.linalg.svd(Q.T @ vague)
    return np.asarray(Q @ vectors[:, int((sizes > 1e-9).sum()):])


def _first_order(rows: Sequence[Rows], memory: NoiseMemory) -> Array:
    """Return the covariance of the gradient if residuals are first-order autoregressive."""
    total = np.zeros((rows[0].slope.shape[1],) * 2)
    for r in rows:
        m = len(r.residual)
        g = r.slope[:m]
        later = echo(g, memory.correlation)
        total += memory.power * (later.T @ g + g.T @ later - g.T @ g) + r.slope[m:].T @ r.slope[m:]
    return total


def _independent(rows: Sequence[Rows], memory: NoiseMemory) -> float:
    """Return how many independent residuals there are, less the numbers that were fitted."""
    count = sum(len(r.residual) for r in rows) * (1.0 - memory.correlation) / (1.0 + memory.correlation)
    return float(max(count - rows[0].slope.shape[1] - sum(r.own for r in rows), 3.0))


def _lever(r: Rows, curvature: Array) -> Array:
    """Return which share of each residual the fit takes away."""
    own = r.lever if r.lever is not None else np.zeros(len(r.score))
    return np.asarray(np.clip(own + r.inside * np.sum(r.slope @ curvature * r.slope, axis=1), 0.0, _MOST_LEVER))


def _freedom(rows: Sequence[Rows], curvature: Array) -> Array:
    """Return how many residuals tell the standard error of each number (Satterthwaite 1946).

    Where a few samples of a fast motion say most of it, they are few.
    """
    shares = [(r.slope @ curvature)**2 * r.inside[:, None] for r in rows]
    once, twice = (np.sum([np.sum(x**k, axis=0) for x in shares], axis=0) for k in (1, 2))
    return np.asarray(np.maximum(once**2 / np.maximum(twice, 1e-300), 3.0))


def _widest(covariances: Sequence[Array]) -> Array:
    """Return the first covariance with those variances larger that another has larger.

    The variances of numbers are compared: of gradients, whose parts largely cancel, one must not be changed alone.
    """
    first, *others = covariances
    for other in others:
        first = _times(first, _ratio(other, first))
    return first


def _ratio(one: Array, other: Array) -> Array:
    """Return the ratio of two covariances' variances, at least 1; 1 of what does not vary."""
    upper, lower = np.diag(one), np.diag(other)
    varies = lower > 1e-300 * np.maximum(upper, 1.0)
    return np.maximum(np.divide(upper, lower, out=np.ones(len(upper)), where=varies), 1.0)


def _times(covariance: Array, wider: Array) -> Array:
    """Return a covariance with its variances times something, and the correlations as they were."""
    more = np.sqrt(wider)
    return np.asarray(covariance * np.outer(more, more))


def _counted(r: Rows) -> Array:
    """Return the covariance of the gradient if each reading of an instrument that counts has an error of its own.

    Readings that stay are wrong by the same. The first of them is also what the log's start is believed to be.
    """
    m = len(r.residual)
    if r.counts is None:
        g = r.slope * r.score[:, None]
        return np.asarray(g.T @ g)
    c = r.counts
    total = np.zeros((int(c.reading.max()) + 1, r.slope.shape[1]))
    np.add.at(total, c.reading, r.slope[:m] * np.sqrt(c.power)[:, None])
    total[0] += math.sqrt(c.power[0]) * c.belief @ r.slope[m:]
    rest = max(float(np.mean(r.residual**2 - c.power)), 0.0)  # noise beside
    return np.asarray(total.T @ total + rest * r.slope[:m].T @ r.slope[:m])


def _sandwich(bread: Array, meat: Array) -> Array:
    """Return bread · meat · bread, without variances that rounding makes negative."""
    values, vectors = np.linalg.eigh(meat)
    half = bread @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(half @ half.T)


def _inverse(H: Array) -> Array:
    """Return the inverse of a symmetric matrix; what has no curvature at all stays without, and is distinguished."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-12 * max(float(np.diag(H).max(initial=0.0)), 1e-12)))
    values, vectors = np.linalg.eigh(H * np.outer(scale, scale))
    values = np.maximum(values, 1e-14)
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _meat(rows: Sequence[Rows], lag: int, levers: Sequence[Array] = ()) -> Array:
    """Return the covariance of the gradient, residuals up to `lag` samples apart being related (Bartlett weights).

    With levers residuals are as large as before the fit took a share of each away (MacKinnon & White 1985, HC2).
    """
    total = np.zeros((rows[0].slope.shape[1],) * 2)
    for n, r in enumerate(rows):
        score = r.score / np.sqrt(1.0 - levers[n]) if len(levers) else r.score
        g = r.slope * score[:, None]
        total += g.T @ g
        for k in range(1, min(lag, len(g) - 1) + 1):
            part = g[k:].T @ g[:-k]
            total += (1.0 - k / (lag + 1.0)) * (part + part.T)
    return total


def _lag(scores: Sequence[Array]) -> int:
    """Return twice the number of samples after which little of the residuals' correlation is left."""
    longest, power = max(len(s) for s in scores), sum(float(s @ s) for s in scores)
    lag = 1
    while lag < longest // 2 and sum(float(s[lag:] @ s[:-lag]) for s in scores if len(s) > lag) > 0.1 * power:
        lag += 1
    return min(2 * lag, longest // 2)


# --- Limits of logs, in words: which numbers only appear together, and what would tell them apart ---------------------
_VAGUE = 1.0  # standard error of a direction that is not determined: a factor e, or as much as is typical
_SHARE = 0.25  # what such a direction may add to the standard error of a number that counts as determined
_WORDS_PART = 0.05  # of a direction
_FAR = _SHARE / _WORDS_PART  # e-folds that anything may go at most in a direction that is open: the bounds are nearer
_HIGHEST = 2  # power in a product that is put into words
_NEAR = 0.03  # to such a power
_GEAR = "gear.gear_reduction"  # what most products are with


@dataclass(frozen=True)
class Unidentifiable:
    """A direction in which the searched numbers may go without the logs noticing.

    Parameters
    ----------
    parameters : tuple of str
        That go together, none of which gets an interval.
    direction : tuple of float
        How far each of them goes; of logarithms where a number is searched by its logarithm.
    combinations : tuple of str
        Combinations that are determined nevertheless, such as ``"motor.torque_constant · gear.gear_reduction"``.
    remedies : tuple of str
        Measurements that would tell them apart.
    """

    parameters: tuple[str, ...]
    direction: tuple[float, ...]
    combinations: tuple[str, ...]
    remedies: tuple[str, ...] = ()

    def __str__(self) -> str:
        if len(self.parameters) == 1:
            text = f"{self.parameters[0]} is not determined by these logs"
        elif self.combinations:
            text = f"only {_and(self.combinations)} {'is' if len(self.combinations) == 1 else 'are'} determined, not " \
                   f"{_and(self.parameters)} each"
        else:
            text = f"{_and(self.parameters)} are not determined each: a change of one is made up for by the others"
        if not self.remedies:
            return text
        return f"{text}; {_or(self.remedies)} would {'tell' if len(self.parameters) == 1 else 'separate them'}"


def vague_directions(information: Array, inflation: float = 1.0,
                     sizes: Array | None = None) -> tuple[NDArray[np.bool_], Array]:
    """Return which numbers are not determined by the data, and the directions that are not (columns of unit length).

    Parameters
    ----------
    information : ndarray, shape (p, p)
        Of the data alone, of scaled numbers.
    inflation : float
        Of standard errors, by correlated residuals.
    sizes : ndarray, shape (p,), optional
        Value that counts as the whole of each number; 1 unless given.

    Examples
    --------
    >>> flags, directions = vague_directions(np.array([[1e4, -1e4], [-1e4, 1e4]]))
    >>> flags.tolist(), directions.shape
    ([True, True], (2, 1))
    """
    whole = np.ones(len(information)) if sizes is None else sizes
    values, vectors = np.linalg.eigh(information * np.outer(whole, whole))
    floor = 1e-11 * max(float(values[-1]), 1e-300)
    std = inflation / np.sqrt(np.maximum(values, 1e-300))
    vague = (std > _VAGUE) | (values < floor)
    directions = vectors[:, vague]
    added = np.sqrt(((directions * np.minimum(std[vague], _FAR)) ** 2).sum(axis=1))
    moved = directions * whole[:, None]
    return added > _SHARE, moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)


def explain(names: Sequence[str], shares: Sequence[float], flags: NDArray[np.bool_],
            directions: Array) -> tuple[Unidentifiable, ...]:
    """Return the undetermined directions in words, the simplest ones first.

    Parameters
    ----------
    names : sequence of str
    shares : sequence of float
        By which share of its value a number changes with what is searched; nan where it may be 0. Only shares make
        products.
    flags, directions : ndarray
        Of `vague_directions`.
    """
    if not flags.any() or not directions.shape[1]:
        return ()
    simple = simplest(directions)
    parts = np.abs(simple) / np.abs(simple).max(axis=0)
    members = (parts > _WORDS_PART) & flags[:, None]
    for k in np.flatnonzero(flags & ~members.any(axis=1)):  # a little of several: none is left without words
        members[k, np.argmax(parts[k])] = True
    found = []
    for v, those in zip(simple.T, members.T, strict=True):
        which = np.flatnonzero(those).tolist()
        if not which:
            continue
        combinations: tuple[str, ...] = ()
        if len(which) > 1 and all(math.isfinite(shares[k]) for k in which):
            combinations = _products([names[k] for k in which], [float(v[k]) * shares[k] for k in which])
        found.append(Unidentifiable(tuple(names[k] for k in which), tuple(float(v[k]) for k in which), combinations))
    return tuple(sorted(found, key=lambda item: (len(item.parameters), item.parameters)))


def simplest(directions: Array) -> Array:
    """Return directions that span the same space with few numbers in each: rows reduced one after the other.

    Parameters
    ----------
    directions : ndarray, shape (p, q)

    Examples
    --------
    >>> simplest(np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]])).T.tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    basis = directions.T.copy()
    for row in range(len(basis)):
        pivot = row + int(np.argmax(np.abs(basis[row:]).max(axis=1)))
        basis[[row, pivot]] = basis[[pivot, row]]
        column = int(np.argmax(np.abs(basis[row])))
        basis[row] /= basis[row, column]
        for other in range(len(basis)):
            if other != row:
                basis[other] -= basis[other, column] * basis[row]
    return np.asarray(basis.T)


def _products(names: list[str], v: Sequence[float]) -> tuple[str, ...]:
    """Return products of small whole powers that a direction leaves alone; none where there are none such."""
    tried = [found for pivot in range(len(names)) if (found := _about(pivot, names, v)) is not None]
    # With the reduction where that will do, else with the smallest powers, else with what moves least
    order = sorted(tried, key=lambda f: (names[f.pivot] != _GEAR, f.powers, abs(v[f.pivot])))
    return order[0].texts if order else ()


class _Products(NamedTuple):
    """Products of each number with one of them, the sum of their powers, and which one that is."""

    texts: tuple[str, ...]
    powers: int
    pivot: int


def _about(pivot: int, names: list[str], v: Sequence[float]) -> _Products | None:
    """Return products of each other number with one; None where a power is no small whole number."""
    texts, powers = [], 0
    for k, name in enumerate(names):
        if k == pivot:
            continue
        exact = -v[k] / v[pivot]
        power = Fraction(exact).limit_denominator(_HIGHEST)
        if not 0 < abs(power.numerator) <= _HIGHEST or abs(float(power) - exact) > _NEAR:
            return None
        sign = " / " if power < 0 else " · "
        texts.append(f"{name}{_power(power.denominator)}{sign}{names[pivot]}{_power(abs(power.numerator))}")
        powers += power.denominator + abs(power.numerator)
    return _Products(tuple(texts), powers, pivot)


def _power(power: int) -> str:
    return "" if power == 1 else "⁰¹²³⁴⁵⁶⁷⁸⁹"[power]


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _or(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} or {words[-1]}"
