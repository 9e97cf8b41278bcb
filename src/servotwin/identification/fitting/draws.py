"""What logs, priors and bounds allow together, and servos drawn from that.

Near the best point the logs' cost is a parabola; along directions that they do not determine it is flat, and there a
prior counts, if there is one, or else any point within the bounds as much as any other. A number at a bound is drawn
from the part of its law on this side of it. The whole is a normal law, without limits in some directions, cut off by
the bounds: sampled along its axes in turn (Gibbs sampling of a truncated normal law; Geweke 1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SWEEPS = 40  # through all axes
_FLAT = 1e-6  # of the precision that the bounds alone would give: nothing is known
_OPEN = math.log(20.0)  # how far a logarithm goes down where its bound is 0: as far as usual bounds
_LEAST = 1e-12


@dataclass(frozen=True, eq=False)
class Allowed:
    """A normal law about the best point, cut off by bounds, of all shared numbers of a fit.

    Parameters
    ----------
    best : ndarray, shape (p,)
        Scaled numbers at the end of the search.
    shift : ndarray, shape (p,)
        From there to where the cost would be least without bounds.
    axes : ndarray, shape (p, p)
        Directions along which the law is independent, a column each.
    precision : ndarray, shape (p,)
        Inverse of the variance along each of them, in its lengths; 0 where nothing is known.
    lower, upper : ndarray, shape (p,)
        Bounds of the scaled numbers.
    by_logarithm : ndarray of bool, shape (p,)
        Numbers, searched as they are, that move in proportion: they appear in products with others.
    by_value : ndarray of bool, shape (p,)
        Numbers, searched by their logarithm, that move as they are: they appear in sums.
    open : ndarray, shape (p, q)
        Directions that the logs do not determine.
    reach : ndarray, shape (2, q)
        How far the logs allow to go along each of them, back and forth.
    stretch : ndarray, shape (2, p)
        How many times wider than the normal law each number's own law is, below the best value and above it.
    """

    best: Array
    shift: Array
    axes: Array
    precision: Array
    lower: Array
    upper: Array
    by_logarithm: NDArray[np.bool_]
    by_value: NDArray[np.bool_]
    open: Array
    reach: Array
    stretch: Array

    def draw(self, number: int, rng: np.random.Generator) -> Array:
        """Return points, shape (number, p).

        Examples
        --------
        >>> nothing = np.zeros((1, 0)), np.zeros((2, 0))
        >>> one = Allowed(np.zeros(1), np.zeros(1), np.eye(1), np.zeros(1), np.array([-1.0]), np.array([3.0]),
        ...               np.array([False]), np.array([False]), *nothing, np.ones((2, 1)))
        >>> drawn = one.draw(2000, np.random.default_rng(0))
        >>> round(float(drawn.mean()), 1), bool(drawn.min() > -1.0)
        (1.0, True)
        """
        axes = self.axes / self._scale[:, None]
        back = np.linalg.inv(axes)
        limits = np.vstack([np.eye(len(axes)), np.linalg.pinv(self.directions)])
        ends = np.concatenate([self.box, self.reach], axis=1)
        y = np.zeros((number, len(axes)))
        for sweep in range(_SWEEPS):
            cut = False
            for k in np.argsort(-self.precision):
                middle = (self.shift / self._scale - y) @ back[k]
                cut |= move(y, axes[:, k], float(self.precision[k]), middle, limits, ends, rng)
            if sweep == 0 and not cut:  # the axes are independent where nothing is cut off
                break
        y *= np.where(y < 0.0, self.stretch[0], self.stretch[1])
        return np.clip(self.points(y), self.lower, self.upper)

    def points(self, y: Array) -> Array:
        """Return scaled numbers at steps from the best point on the scale of the drawing; shape (n, p)."""
        grown = self.best * np.exp(np.where(self.by_logarithm, y, 0.0))
        added = self.best + np.log1p(np.where(self.by_value, np.maximum(y, _LEAST - 1.0), 0.0))
        return np.asarray(np.where(self.by_logarithm, grown, np.where(self.by_value, added, self.best + y)))

    @property
    def _scale(self) -> Array:
        """Scaled numbers to a step."""
        return np.where(self.by_logarithm, self.best, 1.0)

    @property
    def directions(self) -> Array:
        """Undetermined directions in steps."""
        return np.asarray(self.open / self._scale[:, None])

    @property
    def box(self) -> Array:
        """Bounds as steps from the best point on the scale of the drawing, shape (2, p)."""
        ends = np.array([self.lower - self.best, self.upper - self.best])
        ends[:, self.by_value] = np.expm1(ends[:, self.by_value])
        for k in np.flatnonzero(self.by_logarithm):
            ratios = sorted((self.lower[k] / self.best[k], self.upper[k] / self.best[k]))
            ends[:, k] = [math.log(ratios[0]) if ratios[0] > 0.0 else -_OPEN, math.log(ratios[1])]
        return np.asarray([np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)])


def move(y: Array, axis: Array, precision: float, middle: Array, limits: Array, ends: Array,
          rng: np.random.Generator) -> bool:
    """Move all points along one axis to where the law about `middle` allows; return whether limits cut it off."""
    change = limits @ axis
    counts = np.abs(change) > _LEAST
    room = (ends[:, None, counts] - (y @ limits[counts].T)) / change[counts]
    low, high = room.min(axis=0).max(axis=1), room.max(axis=0).min(axis=1)
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    width = float((high - low).max())
    uniform = rng.random(len(y))
    if precision * width**2 < _FLAT or not math.isfinite(precision):
        y += (low + uniform * (high - low))[:, None] * axis
        return True
    std = 1.0 / math.sqrt(precision)
    a, b = (low - middle) / std, (high - middle) / std
    step = middle + std * _truncated(a, b, uniform)
    y += np.clip(step, low, high)[:, None] * axis
    return bool((a > -4.0).any() or (b < 4.0).any())


def _truncated(a: Array, b: Array, uniform: Array) -> Array:
    """Return quantiles of the standard normal law between a and b."""
    from scipy.special import log_ndtr, ndtri_exp

    flip = a > 0.0  # the lower tail keeps its digits
    low, high = np.where(flip, -b, a), np.where(flip, -a, b)
    with np.errstate(divide="ignore"):
        level = np.logaddexp(np.log1p(-uniform) + log_ndtr(low), np.log(uniform) + log_ndtr(high))
    found = ndtri_exp(np.minimum(level, 0.0))
    return np.asarray(np.where(flip, -found, found))
