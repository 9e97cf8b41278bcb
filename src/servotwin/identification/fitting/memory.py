"""How long residuals remember: the first-order correlation of the noise, from residuals that a fit has left.

A fit takes away what its numbers can imitate, mostly what is slow: what is left is smaller than the noise and remembers
less. Both are known exactly for every correlation, so the one is found whose expectation is what is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from servotwin.identification.fitting.uncertainty import Rows

Array = NDArray[np.float64]

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
    """Return columns y of columns x that go on by y_k = x_k + ρ y_(k−1), as first-order noise does.

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
