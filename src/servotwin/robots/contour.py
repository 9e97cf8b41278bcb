"""The contour error: how far a tool is from the line that it was to follow, however late it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
_CLOSE = 2e-4  # m, between the points among which the nearest is looked for
_NEAREST = 4  # of them, whose pieces are looked at


class Contour(NamedTuple):
    """Distances from the line [m]: over time, root mean square, largest."""

    error: Array
    rms: float
    largest: float


def contour_error(places: Array, line: Array) -> Contour:
    """Return how far places are from a line.

    Parameters
    ----------
    places : ndarray, shape (n, 3)
        Of the tool [m]
    line : ndarray, shape (m, 3)
        Points that are joined by straight pieces [m]

    Examples
    --------
    >>> contour_error(np.array([[0.5, 0.2, 0.0], [2.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])).error
    array([0.2, 1. ])
    """
    starts, ways = _pieces(line)
    lengths = np.maximum(np.einsum("ij,ij->i", ways, ways), np.finfo(float).tiny)
    count = min(_NEAREST, len(starts))
    _, near = cKDTree(starts + 0.5 * ways).query(places, k=count)
    best = np.full(len(places), np.inf)
    for which in np.reshape(near, (len(places), count)).T:
        from_start = places - starts[which]
        share = np.clip(np.einsum("ij,ij->i", from_start, ways[which]) / lengths[which], 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(from_start - share[:, None] * ways[which], axis=1))
    return Contour(best, float(np.sqrt(np.mean(best**2))), float(best.max()))


def _pieces(line: Array) -> tuple[Array, Array]:
    """Return beginnings and ways of the pieces of a line, none of them long."""
    ways = np.diff(line, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(ways, axis=1) / _CLOSE).astype(np.int64), 1)
    whole = np.repeat(ways / counts[:, None], counts, axis=0)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(line[:-1], counts, axis=0) + within[:, None] * whole, whole
