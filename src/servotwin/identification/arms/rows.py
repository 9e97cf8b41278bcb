"""Residuals of a robot's joints in units of noise, and how they change with every number.

Noise of a joint is that of its positions, and that of the clock: a row whose stamp is off by some milliseconds is off
at all joints at once, each by its speed. With s the deviation of stamps, v_j the speeds and σ_j the noise of positions,
a row has the covariance diag(σ²) + s² v vᵀ; it is multiplied by the inverse root of that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.arms.copies import Copies
from servotwin.identification.arms.episodes import Episode
from servotwin.identification.arms.numbers import LATENCY, Numbers
from servotwin.identification.fitting.point import LogPart

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_MOST, _MOST_ZERO, _LEAST_STEP = 0.1, 0.03, 1e-3  # of a number on its scale, of a zero [rad]; of either
_SEEN = 1.0  # times the noise: what a step for a derivative is to change
_BEGIN = 0.6  # s: until then an episode still shows how it began
_MAD = 1.4826
_LEAST = 2.0e-4  # rad
_FAST = 0.3  # rad/s
_SURE = 2.0  # times its noise, of a derivative's power: nothing below
_MOST_OFF = 0.02  # s
_COARSE, _COUNTED = 0.01, 0.05  # rad, of a count


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of positions of each joint [rad], and of stamps [s]."""

    positions: Array
    stamps: float


def quantum_of(positions: Sequence[Array]) -> float:
    """Return the step in which positions were counted [rad]; 0 where they do not look counted.

    Examples
    --------
    >>> round(quantum_of([np.round(np.sin(np.linspace(0.0, 3.0, 99)) / 0.002) * 0.002]), 4)
    0.002
    """
    steps = np.concatenate([np.abs(np.diff(one)) for one in positions])
    some = steps[steps > 1e-6]
    least = float(some.min(initial=math.inf))
    if not some.size or least > _COARSE:
        return 0.0
    return least if float(np.abs(some / least - np.round(some / least)).max()) < _COUNTED else 0.0


def used_rows(episode: Episode) -> Mask:
    """Return which samples of an episode count before anything is known of it, shape (n, joints)."""
    return np.repeat((episode.time >= episode.time[0] + _BEGIN)[:, None], episode.measured.shape[1], axis=1)


def noise_of(episodes: Sequence[Episode], residuals: Sequence[Array], used: Sequence[Mask]) -> Noise:
    """Return the noise that residuals show, robust: at rest that of positions, in motion that of stamps too."""
    joints, positions, off = episodes[0].measured.shape[1], [], []
    for j in range(joints):
        r = np.concatenate([one[mask[:, j], j] for one, mask in zip(residuals, used, strict=True)])
        v = np.concatenate([e.speed[mask[:, j], j] for e, mask in zip(episodes, used, strict=True)])
        still = np.abs(v) < _FAST
        sigma = max(_MAD * float(np.median(np.abs(r[still] if still.sum() > 20 else r))), _LEAST,
                    quantum_of([e.measured[:, j] for e in episodes]) / math.sqrt(12.0))
        positions.append(sigma)
        if (~still).sum() > 20:
            more = np.maximum(r[~still]**2 - sigma**2, 0.0) / v[~still]**2
            off.append(np.sqrt(float(np.median(more))) * _MAD)
    return Noise(np.array(positions), min(float(np.median(off)) if off else 0.0, _MOST_OFF))


def spread_of(residuals: Sequence[Array], used: Sequence[Mask]) -> float:
    """Return how far residuals spread: the mean logarithm of the joints' rms, of noise that nobody knows yet."""
    r, mask = np.concatenate(list(residuals)), np.concatenate(list(used))
    squares = (np.where(mask, r, 0.0)**2).sum(axis=0) / np.maximum(mask.sum(axis=0), 1)
    return float(np.mean(0.5 * np.log(squares + _LEAST**2)))


def whitened(values: Array, episode: Episode, noise: Noise, used: Mask) -> Array:
    """Return residuals or derivatives, shape (n, joints, …), in units of noise; 0 where a sample does not count."""
    sigma = noise.positions
    u = used * (noise.stamps * episode.speed / sigma)
    s = (u**2).sum(axis=1)
    share = np.where(s > 1e-12, (1.0 - 1.0 / np.sqrt(1.0 + s)) / np.maximum(s, 1e-12), 0.0)
    flat = (values.reshape(*values.shape[:2], -1) / sigma[:, None]) * used[..., None]
    along = np.einsum("nj,njp->np", u, flat)
    return np.asarray((flat - share[:, None, None] * u[..., None] * along[:, None, :]).reshape(values.shape))


def residuals(simulated: Copies, episode: Episode, points: Array) -> Array:
    """Return simulated less measured angles at several points, shape (copies, n, joints)."""
    return simulated.angles(episode, points) - episode.measured


class Linear(NamedTuple):
    """An episode about a point.

    Parameters
    ----------
    residual : ndarray, shape (n, joints)
        [rad]
    slopes : ndarray, shape (n, joints, numbers)
        Derivatives.
    scatter : ndarray, shape (n, joints, numbers)
        Half of what steps either way differ by: what their noise is; 0 of steps one way.
    """

    residual: Array
    slopes: Array
    scatter: Array


def usual_steps(numbers: Numbers) -> Array:
    """Return the longest steps for derivatives, on the scales of numbers: servos stick and slip over short ones."""
    return np.array([_MOST_ZERO / one.scale if one.unit == "rad" and not one.logarithmic else _MOST
                     for one in numbers.all])


def steps_by(usual: Array, slopes: Array) -> Array:
    """Return steps for derivatives that change an episode by about its noise, or the usual ones if these change less.

    An arm near what its servos can carry answers a tenth less resistance by a fall. That is no derivative, and no sum
    of such says that resistance, masses and friction together are only the scale of all torques.

    Parameters
    ----------
    usual : ndarray, shape (numbers,)
    slopes : ndarray, shape (m, numbers)
        In units of noise.

    Examples
    --------
    >>> steps_by(np.array([0.1, 0.1]), np.array([[50.0, 1.0], [-50.0, 0.0]])).tolist()
    [0.02, 0.1]
    """
    size = np.sqrt(np.mean(slopes**2, axis=0))
    return np.asarray(np.clip(_SEEN / np.maximum(size, 1e-300), _LEAST_STEP / _MOST * usual, usual))


def linear_at(simulated: Copies, episode: Episode, x: Array, held: Mask, steps: Array, *,
              central: bool = False) -> Linear:
    """Return residuals at a point and their derivatives by differences of such steps, one way or central."""
    numbers = simulated.numbers
    moved = [k for k in range(len(x)) if not held[k] and numbers.names[k] != LATENCY]
    ways = [np.where(x + side * steps > numbers.upper, -0.5 * side, np.where(
        x + side * steps < numbers.lower, -0.5 * side, side)) * steps for side in ((1.0, -1.0) if central else (1.0,))]
    points = np.repeat(x[None], 1 + len(ways) * len(moved), axis=0)
    for k, way in enumerate(ways):
        points[1 + k * len(moved) + np.arange(len(moved)), moved] += way[moved]
    smooth = simulated.angles(episode, points, fine=True)
    sides = [np.moveaxis((smooth[1 + k * len(moved):1 + (k + 1) * len(moved)] - smooth[0]) / way[moved][:, None, None],
                         0, -1) for k, way in enumerate(ways)]
    slopes, scatter = np.zeros((2, *smooth.shape[1:], len(x)))
    slopes[..., moved] = np.mean(sides, axis=0)
    if central:
        scatter[..., moved] = 0.5 * (sides[0] - sides[1])
    late = numbers.names.index(LATENCY)
    if not held[late]:
        slopes[..., late] = -np.gradient(smooth[0], episode.time, axis=0) * numbers.all[late].scale
    return Linear(residuals(simulated, episode, x[None])[0], slopes, scatter)


def beyond_scatter(slopes: Array, scatter: Array) -> Array:
    """Return what makes derivatives of directions that are no more than their noise nothing, shape (numbers, numbers).

    Simulated servos stick and slip, and count: differences have a noise, which would look like knowledge. With A the
    product sum of the derivatives and N that of their noise, a direction v counts by 1 − vᵀNv/vᵀAv of what it has.

    Parameters
    ----------
    slopes, scatter : ndarray, shape (m, numbers)
        In units of noise.
    """
    from scipy.linalg import eigh

    A, N = slopes.T @ slopes, scatter.T @ scatter
    scale = 1.0 / np.sqrt(np.maximum(np.diag(A), 1e-12 * max(float(np.diag(A).max(initial=0.0)), 1e-300)))
    A, N = A * np.outer(scale, scale), N * np.outer(scale, scale)
    values, vectors = eigh(A, N + 1e-6 * np.eye(len(A)))
    left = np.sqrt(np.clip(1.0 - _SURE / np.maximum(values, 1e-300), 0.0, 1.0))
    return np.asarray((scale[:, None] * vectors) @ (left[:, None] * np.linalg.inv(scale[:, None] * vectors)))


def parts_of(episode: Episode, residual: Array, slopes: Array | None, noise: Noise, used: Mask) -> list[LogPart]:
    """Return what an episode says, joint by joint, in units of noise."""
    r = whitened(residual, episode, noise, used)
    s = np.zeros((*residual.shape, 0)) if slopes is None else whitened(slopes, episode, noise, used)
    return [LogPart(r[mask, j], s[mask, j], np.zeros((int(mask.sum()), 0))) for j, mask in enumerate(used.T)
            if mask.any()]
