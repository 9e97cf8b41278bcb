"""Small bounded least squares from several starts at once: what all have to know next is worked out in one go.

Levenberg-Marquardt on the normal equations, residuals weighted as a loss asks. Orthogonal decompositions of tall
matrices would cost more than the residuals do: libraries spread them over all cores, which then wait for each other.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Seen = tuple[Array, Array]  # residuals (N,) and their derivatives (N, p)
Ask = Callable[[list[Array]], list[Seen]]

_MOST = 60  # steps
_NOTHING = 1e-30  # of the squares of the first residuals: all is explained
_MOST_DAMPING = 1e9
_PATIENCE = 8  # trials
_SMALL = 2**17  # products of numbers


def solved(starts: Sequence[Array], lower: Array, upper: Array, ask: Ask, loss: str, scale: float,
           gain: float) -> list[tuple[float, Array]]:
    """Return the cost and the point where the search from each start ends.

    Parameters
    ----------
    starts : sequence of ndarray, shape (p,)
    lower, upper : ndarray, shape (p,)
    ask : callable
        Returns residuals and derivatives at several points.
    loss : {"linear", "soft_l1", "huber"}
    scale : float
        Residual from which a loss counts less than squares.
    gain : float
        Of the cost: where a step promises less, or several trials in a row gain less, a search ends.
    """
    ways = [_way(np.clip(start, lower, upper), lower, upper, loss, scale, gain) for start in starts]
    ends: dict[int, tuple[float, Array]] = {}
    asked = {k: next(way) for k, way in enumerate(ways)}
    while asked:
        now = list(asked)
        for k, seen in zip(now, ask([asked[k] for k in now]), strict=True):
            try:
                asked[k] = ways[k].send(seen)
            except StopIteration as end:
                del asked[k]
                ends[k] = end.value
    return [ends[k] for k in range(len(starts))]


def _counted(r: Array, loss: str, scale: float) -> tuple[float, Array]:
    """Return the cost of residuals, and the weight of the square of each."""
    if loss == "linear":
        return 0.5 * float(r @ r), np.ones(len(r))
    z = (r / scale) ** 2
    if loss == "huber":
        beyond = z > 1.0
        root = np.sqrt(np.maximum(z, 1.0))
        return 0.5 * scale**2 * float(np.where(beyond, 2.0 * root - 1.0, z).sum()), 1.0 / root
    root = np.sqrt(1.0 + z)
    return scale**2 * float((root - 1.0).sum()), 1.0 / root


def _way(x: Array, lower: Array, upper: Array, loss: str, scale: float,
         gain: float) -> Generator[Array, Seen, tuple[float, Array]]:
    r, J = yield x
    cost, weight = _counted(r, loss, scale)
    nothing, damping, size, vain = _NOTHING * max(cost, 1e-300), 1e-3, np.zeros(len(x)), 0
    for _ in range(_MOST):
        g, H = _normal(r, J, weight)
        size = np.maximum(size, np.diag(H))
        while True:
            step = _step(x, g, H + damping * np.diag(np.maximum(size, 1e-300)), lower, upper)
            promised = -float(g @ step) - 0.5 * float(step @ H @ step)
            if promised <= gain * cost or cost <= nothing or vain > _PATIENCE:
                return cost, x
            seen = yield x + step
            found, weighed = _counted(seen[0], loss, scale)
            vain = 0 if found < (1.0 - gain) * cost else vain + 1
            if found < cost:
                break
            damping *= 6.0
            if damping > _MOST_DAMPING:
                return cost, x
        x, (r, J), cost, weight, damping = x + step, seen, found, weighed, max(damping / 10.0, 1e-12)
    return cost, x


def _normal(r: Array, J: Array, weight: Array) -> tuple[Array, Array]:
    """Return gradient and matrix of the normal equations, from pieces so small that no library spreads them."""
    A = np.column_stack([J, r])
    rows = max(_SMALL // A.shape[1] ** 2, 1)
    H = np.zeros((A.shape[1], A.shape[1]))
    for first in range(0, len(A), rows):
        piece = slice(first, first + rows)
        H += (A[piece] * weight[piece, None]).T @ A[piece]
    return H[:-1, -1], H[:-1, :-1]


def _step(x: Array, g: Array, H: Array, lower: Array, upper: Array) -> Array:
    """Return a step within the bounds: what would cross its bound goes to it, and the rest is solved again."""
    step = np.zeros(len(x))
    stays = ((x <= lower) & (g > 0.0)) | ((x >= upper) & (g < 0.0))
    for _ in range(len(x) + 1):
        moves = np.flatnonzero(~stays)
        if not len(moves):
            break
        step[moves] = -np.linalg.solve(H[np.ix_(moves, moves)], g[moves] + H[np.ix_(moves, stays)] @ step[stays])
        there = x + step
        over = ~stays & ((there < lower) | (there > upper))
        if not over.any():
            break
        step[over] = np.clip(there, lower, upper)[over] - x[over]
        stays = stays | over
    return np.clip(x + step, lower, upper) - x
