"""Do residuals follow the command of some time before? Their cross-correlation with its past changes.

A model that holds leaves noise, and noise knows nothing of commands: `resid` of the System Identification Toolbox tests
the same (Ljung 1999, 16.6). Both are filtered so that noise has no memory (Box & Jenkins 1970; Haugh 1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.noise import Noise, SensorSeries, isolated
from servotwin.identification.fitting.uncertainty import Rows

Array = NDArray[np.float64]

_REACH = 1.0  # s: a servo has followed a command by then, assumed
_MOST_LAGS = 50
_PER_LAG = 10  # samples
_LEAST = 4  # lags
_NOTHING = 1e-7  # of a unit vector
LEVEL = 0.99  # of the band of each lag
_MOST_ORDER = 10.0  # times the decimal logarithm of the samples: of the filter, as R's `ar` has it


@dataclass(frozen=True)
class CrossCorrelation:
    """How residuals follow the changes of the command before, by lag.

    Parameters
    ----------
    lag : ndarray, shape (k,)
        How long before [s].
    value : ndarray, shape (k,)
        Correlation of filtered residuals and changes of the command.
    band : ndarray, shape (k,)
        What 99 % of the magnitudes stay below, each lag for itself, if residuals are noise.
    odds : float
        How often noise would follow the command as much, all lags together.
    clearest : float
        The lag that stands out most [s].
    followed : float
        Mean square of what the changes of the command explain, less what they would of noise (SI, squared).
    """

    lag: Array
    value: Array
    band: Array
    odds: float
    clearest: float
    followed: float


def cross_correlation(series: Sequence[SensorSeries], rows: Sequence[Rows] = (),
                      noise: Noise | None = None) -> CrossCorrelation | None:
    """Return how the residuals of some logs follow the commands before; None of too few samples or changes.

    The changes are those of the command that the log has, an angle or a pulse width, in windows of equal length up to
    1 s back. Residuals and changes are weighted and filtered so that the noise is even and has no memory; where its
    memory is not known, the filter is the autoregressive one of the residuals whose order has the least criterion of
    Akaike (1974). All lags are tested together by the F-test of the regression of residuals on changes.

    A fit of noise that remembers itself goes after it, which the filter lays bare: so what the numbers of the fit can
    imitate is taken out of residuals and changes behind the filter, as if it were fitted again by generalised least
    squares (Aitken 1936).

    Parameters
    ----------
    series : sequence of SensorSeries
    rows : sequence of Rows, optional
        What each log says of the numbers that were fitted; nothing is taken out without.
    noise : Noise, optional
        That needs no model: its memory, and where it is larger because stamps are off. The memory of the residuals
        counts where it is not known.

    Examples
    --------
    >>> from servotwin.logs.log import Log
    >>> rng, time = np.random.default_rng(0), 0.02 * np.arange(600)
    >>> command = np.repeat(rng.uniform(-1.0, 1.0, 40), 15)
    >>> log = Log(name="one", time=time, command=command, command_kind="angle", measured={"output_angle": command})
    >>> noise, late = rng.normal(size=600), np.roll(np.append(0.0, np.diff(command)), 5)
    >>> for residual in (noise, noise + 2.0 * late):
    ...     found = cross_correlation([SensorSeries(log, time, np.zeros(600), residual)])
    ...     print(found.odds < 0.01, round(found.clearest, 2))
    False 0.66
    True 0.1
    """
    from scipy.special import fdtrc, ndtri

    spans = [float(one.time[-1] - one.time[0]) for one in series if len(one.time) > 1]
    steps = np.concatenate([np.diff(one.time) for one in series])
    count = len(steps)
    if not spans or count < _PER_LAG * _LEAST:
        return None
    reach = min(_REACH, max(spans) / 3.0)
    width = max(float(np.median(steps)), reach / min(_MOST_LAGS, count // _PER_LAG))
    lags = np.asarray(width * np.arange(max(round(reach / width), 1)), float)
    moves = [_changes(one, lags, width) for one in series]
    sizes: dict[str, float] = {}  # of changes of an angle or a pulse width
    for one, change in zip(series, moves, strict=True):
        sizes[one.log.command_kind] = max(sizes.get(one.log.command_kind, 0.0), float(np.abs(change).max()))
    parts = [_Part(_centred(_rest(one)), _centred(change / (sizes[one.log.command_kind] or 1.0)),
                   np.flatnonzero(~one.joined)) for one, change in zip(series, moves, strict=True)]
    if noise is None or not noise.known:
        taps = _whitening([piece for part in parts for piece in np.split(part.residual, part.begins[1:])])
    else:
        taps = np.array([1.0, -noise.memory])
    said: Sequence[Rows | None] = rows or [None] * len(parts)
    weights = [np.ones(len(one.time)) if noise is None else noise.size / noise.of(one) for one in series]
    found = [_filtered(part, row, taps, weight) for part, row, weight in zip(parts, said, weights, strict=True)]
    basis = _basis(np.concatenate([one.slopes for one in found]))
    white, changes = (each - basis @ (basis.T @ each)
                      for each in (np.concatenate([one.residual for one in found]),
                                   np.concatenate([one.changes for one in found])))
    x = np.concatenate([part.changes for part in parts])
    squares = (changes**2).sum(axis=0)
    if len(lags) < _LEAST or not (squares > 0.0).all() or not white.any():
        return None
    axes, z, left = _basis(changes), changes.T @ white, float(white @ white)
    explained = float(((axes.T @ white)**2).sum())
    free = len(white) - sum(one.own for one in found) - basis.shape[1] - axes.shape[1]
    power = max((left - explained) / max(free, 1), 1e-300)
    odds = float(fdtrc(axes.shape[1], max(free, 1), explained / axes.shape[1] / power))
    inverse, spanned = np.linalg.pinv(changes.T @ changes, rcond=1e-8, hermitian=True), x.T @ x / len(x)
    slope = inverse @ z
    followed = float(slope @ spanned @ slope) - power * float(np.sum(inverse * spanned))  # less what noise would
    value = z / np.sqrt(left * squares)
    band = np.full(len(lags), float(ndtri(0.5 + 0.5 * LEVEL)) / math.sqrt(len(white)))
    return CrossCorrelation(lags, value, band, odds, float(lags[int(np.argmax(np.abs(value)))]), max(followed, 0.0))


def _changes(one: SensorSeries, lags: Array, width: float) -> Array:
    """Return by how much the command changed about each lag before each sample, shape (n, k).

    Lags are counted in samples: those of stamps that are off would tell by how much.
    """
    step = float(np.median(np.diff(one.log.time)))
    before = np.maximum(np.ceil((np.append(lags, lags[-1] + width) - 0.5 * width) / step - 1e-6), 0.0).astype(int)
    place = one.log.rows_at(one.time)[:, None] - before
    return np.asarray(-np.diff(one.log.held[np.maximum(place, 0)], axis=1))


def _rest(one: SensorSeries) -> Array:
    """Return residuals with lines drawn across samples that lie far off alone."""
    far = isolated(one)
    return np.interp(one.time, one.time[~far], one.residual[~far]) if not far.all() else one.residual


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(axis=0))


class _Part(NamedTuple):
    """Residuals and changes of the command in one log, and where it begins and goes on after gaps."""

    residual: Array
    changes: Array
    begins: NDArray[np.int64]


class _Filtered(NamedTuple):
    """Residuals, changes of the command and slopes of the shared numbers of one log as filtered."""

    residual: Array
    changes: Array
    slopes: Array
    own: int


def _filtered(part: _Part, row: Rows | None, taps: Array, weight: Array) -> _Filtered:
    """Return a log as filtered, less its first samples, and less what its own numbers can imitate."""
    count, order = len(part.residual), len(taps) - 1
    own, shared = np.ones((count, 1)), np.zeros((count, 0))
    if row is not None and len(row.residual) == count:  # else other sensors are among them
        shared = row.slope[:count]
        own = own if row.alone is None else np.column_stack([own, row.alone])
    every = np.column_stack([part.residual, part.changes, shared, own]) * weight[:, None]
    done = np.concatenate([every[:0], *(_convolved(piece, taps) for piece in np.split(every, part.begins[1:])
                                        if len(piece) > order)])
    first, last = 1 + part.changes.shape[1], 1 + part.changes.shape[1] + shared.shape[1]
    basis = _basis(done[:, last:])
    done = done[:, :last] - basis @ (basis.T @ done[:, :last])
    return _Filtered(done[:, 0], done[:, 1:first], done[:, first:], basis.shape[1])


def _convolved(values: Array, taps: Array) -> Array:
    """Return values as filtered, less the first ones, of which not all are known that count."""
    order = len(taps) - 1
    found = taps[0] * values[order:]
    for k in range(1, len(taps)):
        found = found + taps[k] * values[order - k:len(values) - k]
    return np.asarray(found)


def _basis(columns: Array) -> Array:
    """Return unit vectors, a column each, that span some columns, whatever their sizes."""
    sizes = np.linalg.norm(columns, axis=0)
    plane, corner = np.linalg.qr(columns[:, sizes > 0.0] / sizes[sizes > 0.0])  # far less work than of all samples
    vectors, values, _ = np.linalg.svd(corner, full_matrices=False)
    return np.asarray(plane @ vectors[:, values > _NOTHING])


def _whitening(pieces: Sequence[Array]) -> Array:
    """Return the autoregressive filter that takes the memory of residuals away: 1 and its further taps."""
    count = sum(map(len, pieces))
    most = min(int(_MOST_ORDER * math.log10(max(count, 10))), count // _PER_LAG)
    covariance = [sum(float(e[k:] @ e[:len(e) - k]) for e in pieces if len(e) > k) / count for k in range(most + 1)]
    taps, best = np.ones(1), np.ones(1)
    left, least = covariance[0], math.inf
    for order in range(most + 1):  # Levinson (1946)
        if order:
            reflection = -float(taps @ np.array(covariance[order:0:-1])) / left
            taps = np.append(taps, 0.0) + reflection * np.append(taps, 0.0)[::-1]
            left *= 1.0 - reflection**2
        if left <= 1e-12 * covariance[0]:
            break
        criterion = count * math.log(left) + 2.0 * order
        if criterion < least:
            best, least = taps, criterion
    return best
