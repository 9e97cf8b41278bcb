"""The noise of a sensor as measured values show it without any model: while the shaft stands, from neighbours, counts.

White noise shows in second differences, also while the shaft moves smoothly; noise that remembers itself only while the
shaft stands, or where the same command was recorded twice; an instrument that counts scatters by its step over √12.

A model that holds leaves noise, and noise does not follow commands: `resid` of the System Identification Toolbox tests
the same (Ljung 1999, 16.6). Both are filtered so that noise has no memory (Box & Jenkins 1970; Haugh 1976).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.search.case import robust_deviation
from servotwin.identification.fitting.uncertainty import Rows
from servotwin.logs.columns import step_of
from servotwin.logs.log import Log

# --- The noise of a sensor as measured values show it without any model -----------------------------------------------

Array = NDArray[np.float64]
_SETTLED = 0.2  # s after the last change of the command: a servo of 60°/0.1 s has done a large step
_LEAST, _MOST = 8, 40  # samples of a stretch in which the shaft stands
_FAR = 5.0  # robust standard deviations beyond which a stretch or a sample is not like the others
_ENOUGH = 24  # samples at rest, from which on they tell the noise's memory
_BENT = 0.3  # of what is measured: how far a simulation that stands may leave a line
_GUESSES = 9
_COUNTED = 0.9  # memory of counts of a shaft that stands
_DITHER = 0.02  # rad or V: a servo that stands moves less, pulse by pulse
_FAST = 0.3  # of the largest speed
_GAP = 1.75  # times the usual step, beyond which neighbours are none
_RHO = np.linspace(0.0, 0.96, 25)
_BY_BENDS = 0.2  # how surely second differences tell the noise's power, in its logarithm


@dataclass(frozen=True)
class SensorSeries:
    """Values of one sensor in one log, where it counts.

    Parameters
    ----------
    log : Log
    time, measured, simulated : ndarray, shape (n,)
        [s], SI.
    """

    log: Log
    time: Array
    measured: Array
    simulated: Array

    @property
    def residual(self) -> Array:
        """Simulated less measured."""
        return np.asarray(self.simulated - self.measured)

    @property
    def joined(self) -> NDArray[np.bool_]:
        """Whether each sample follows the one before without a gap, shape (n,); the first does not."""
        steps = np.diff(self.time)
        if not len(steps):
            return np.zeros(len(self.time), np.bool_)
        return np.append(False, steps < _GAP * float(np.median(steps)))

    @property
    def speed(self) -> Array:
        """Of the simulation, per second."""
        return np.gradient(self.simulated, self.time) if len(self.time) > 1 else np.zeros(len(self.time))


class NoiseGuess(NamedTuple):
    """One of several equally likely noises: standard deviation (SI) and correlation of neighbours."""

    size: float
    memory: float


@dataclass(frozen=True)
class Noise:
    """Noise that needs no model (SI).

    Parameters
    ----------
    size : float
        Its standard deviation, of the best source that there is.
    memory : float
        Correlation of neighbouring samples, known from where the shaft stands; nan where it hardly does.
    white : float
        From second differences alone, which noise that remembers itself hides from.
    guesses : tuple of NoiseGuess
        How sure that is: noises that what stands makes equally likely; none where it hardly does.
    repeats : float
        How far logs of the same command are apart, as of one sample; nan where there are none.
    count : float
        Step of an instrument that counts; 0 where none is seen.
    jitter : float
        How far time stamps are off, as far as they are uneven and fast samples show it [s].
    """

    size: float
    memory: float
    white: float
    guesses: tuple[NoiseGuess, ...]
    repeats: float
    count: float
    jitter: float

    @property
    def known(self) -> bool:
        """Whether the noise's memory is known."""
        return bool(self.guesses)

    def of(self, one: SensorSeries, size: float | None = None) -> Array:
        """Return the noise of each sample of a log: stamps that are off make it larger while the shaft moves."""
        return np.asarray(np.hypot(self.size if size is None else size, one.speed * self.jitter))


def noise_of(series: Sequence[SensorSeries]) -> Noise:
    """Return the noise of one sensor in several logs.

    Examples
    --------
    >>> time = np.arange(400) * 0.01
    >>> angle = 1e-3 * np.random.default_rng(0).normal(size=400)
    >>> log = Log(name="stands", time=time, command=np.full(400, 1.5e-3), command_kind="pulse_width",
    ...           measured={"output_angle": angle})
    >>> found = noise_of([SensorSeries(log, time, angle, np.zeros(400))])
    >>> round(1e3 * found.size, 1), abs(found.memory) < 0.1, found.count
    (1.0, True, 0.0)
    """
    count, repeats, white = step_of(np.concatenate([one.measured for one in series])), _repeats(series), _white(series)
    floor = max(count / math.sqrt(12.0), 1e-12)
    guesses = _at_rest([window for one in series for window in _windows(one)], white, floor)
    if not guesses:
        size = next((value for value in (repeats, white) if math.isfinite(value)), 0.0)
        return Noise(max(size, floor), math.nan, white, (), repeats, count, _jitter(series))
    # A shaft that stands is counted off by the same each time
    found = tuple(NoiseGuess(max(g.size, floor), g.memory if g.size > 0.5 * count else max(g.memory, _COUNTED))
                  for g in guesses)
    middle = found[len(found) // 2]
    return Noise(middle.size, middle.memory, white, found, repeats, count, _jitter(series))


def _jitter(series: Sequence[SensorSeries]) -> float:
    """Return how far stamps are off: as they scatter about their neighbours' middle, and as fast samples do [s]."""
    uneven, seen = [], []
    for one in series:
        if len(one.time) < 5:
            continue
        whole = one.joined[1:-1] & one.joined[2:]
        uneven.append(np.diff(one.time, n=2)[whole] / math.sqrt(6.0))
        speed = np.abs(one.speed[1:-1][whole])
        fast = speed > max(_FAST * float(speed.max(initial=0.0)), 1e-9)
        seen.append(bends(one)[fast] / speed[fast])
    if not uneven or not len(np.concatenate(seen)):
        return 0.0
    stamps, shaft = (robust_deviation(np.concatenate(x)) for x in (uneven, seen))
    return min(stamps, shaft)


def _white(series: Sequence[SensorSeries]) -> float:
    """Return white noise from second differences; nan of too few samples."""
    every = np.concatenate([bends(one) for one in series if len(one.time) >= 5] or [np.zeros(0)])
    return robust_deviation(every) if len(every) >= _LEAST else math.nan


def bends(one: SensorSeries) -> Array:
    """Return each sample minus the line between its neighbours, as large as one sample's noise."""
    t, y = one.time, one.residual
    first = (t[2:] - t[1:-1]) / (t[2:] - t[:-2])
    bend = y[1:-1] - first * y[:-2] - (1.0 - first) * y[2:]
    return np.asarray((bend / np.sqrt(1.0 + first**2 + (1.0 - first)**2))[one.joined[1:-1] & one.joined[2:]])


def _windows(one: SensorSeries) -> list[Array]:
    """Return the scatter while the shaft stood, in stretches of some samples: the command has been the same long."""
    place = one.log.rows_at(one.time)
    changed = np.append(True, np.diff(np.searchsorted(one.log.changes, place, side="right")) != 0)
    changed |= ~one.joined
    first = np.maximum.accumulate(np.where(changed, np.arange(len(place)), 0))
    since = one.time - one.time[first]
    begins_still = first == 0  # a log may begin at rest
    still = (since >= _SETTLED) | (begins_still & (np.abs(one.simulated - one.simulated[0]) == 0.0))
    found: list[Array] = []
    alone = ~isolated(one)
    k = 0
    while k < len(still):
        if not still[k]:
            k += 1
            continue
        stop = k
        while stop < len(still) and still[stop] and first[stop] == first[k]:
            stop += 1
        pieces = max(1, math.ceil((stop - k) / _MOST))
        for piece in np.array_split(np.arange(k, stop), pieces):
            quiet = _quiet(one, piece, alone) if len(piece) >= _LEAST else None
            if quiet is not None:
                found.append(quiet)
        k = stop
    return found


def _quiet(one: SensorSeries, piece: NDArray[np.int64], near: NDArray[np.bool_]) -> Array | None:
    """Return the scatter about a line of a stretch in which the shaft stands, creeps or dithers evenly.

    None if the simulation goes somewhere. Of a servo that dithers from frame to frame, what the simulation leaves.
    """
    piece = piece[near[piece]]
    if len(piece) < _LEAST:
        return None
    left, bent = _level(one.measured[piece]), _level(one.simulated[piece])
    if float(bent @ bent) <= _BENT**2 * float(left @ left) or not bent.any():
        return left
    rest = _level(one.residual[piece])
    less = rest if float(rest @ rest) < float(left @ left) else left
    return less if np.ptp(one.simulated[piece]) < _DITHER else None


def isolated(one: SensorSeries, jitter: float = 0.0) -> NDArray[np.bool_]:
    """Return which samples are outliers: far from the four around them, which are near each other.

    Examples
    --------
    >>> time, values = np.arange(40) * 0.02, np.random.default_rng(0).normal(size=40)
    >>> values[7] += 50.0
    >>> log = Log(name="one", time=time, command=time, command_kind="angle", measured={"output_angle": values})
    >>> np.flatnonzero(isolated(SensorSeries(log, time, values, np.zeros(40)))).tolist()
    [7]
    """
    r = one.residual
    if len(r) < _LEAST:
        return np.zeros(len(r), np.bool_)
    padded = np.pad(r, 2, mode="reflect")
    around = np.stack([padded[k:k + len(r)] for k in (0, 1, 3, 4)])
    middle = np.median(around, axis=0)
    apart = np.sort(np.abs(around - middle), axis=0)[2]  # of the third nearest: one more outlier may be beside
    rough = bends(one)
    usual = robust_deviation(rough) if len(rough) else 0.0
    return np.asarray(np.abs(r - middle) > _FAR * np.hypot(1.3 * usual, one.speed * jitter) + 3.0 * apart)


def _level(values: Array) -> Array:
    """Return values less their straight line: a stick-slip servo creeps where it stands."""
    return np.asarray(values - _line(len(values)) @ values)


def _line(m: int) -> Array:
    """Return the matrix, shape (m, m), that draws the straight line through m values."""
    x = np.linspace(-1.0, 1.0, m)
    return np.full((m, m), 1.0 / m) + np.outer(x, x) / float(x @ x)


def _at_rest(windows: Sequence[Array], white: float, floor: float) -> tuple[NoiseGuess, ...]:
    """Return noises that are equally likely, first-order autoregressive ones, the smaller ones first; none if unknown.

    As likely as they make stretches whose lines were taken away (Patterson & Thompson 1971), and second differences.
    Where an instrument counts, which has the noise `floor` by that alone, a stretch at the edge of a count scatters
    more than most: it is like the others.
    """
    if not windows or sum(len(w) for w in windows) < _ENOUGH:
        return ()
    powers = np.array([float(np.mean(w**2)) for w in windows])
    most = _FAR * max(float(np.median(powers)), floor**2)
    kept = [w for w, power in zip(windows, powers, strict=True) if power <= most]
    free = float(sum(len(w) - 2 for w in kept))
    squares, volumes = _forms(kept)
    usual = squares[0] / free
    if usual == 0.0:
        return (NoiseGuess(0.0, 0.0),)
    power = usual * np.geomspace(0.2, 20.0, 80)[None, :]
    rho = _RHO[:, None]
    likely = -0.5 * (free * np.log(power) + volumes[:, None] + squares[:, None] / power)
    if white > 0.0:
        off = np.log(white**2 / (power * (6.0 - 8.0 * rho + 2.0 * rho**2) / 6.0)) / _BY_BENDS
        likely = likely - np.log1p(0.25 * off**2)  # heavy tails: where it moves, a wrong model bends too
    weight = np.exp(likely - likely.max())
    weight /= weight.sum()
    by_power = weight.sum(axis=0)
    memory = (weight * rho).sum(axis=0) / np.maximum(by_power, 1e-300)
    middle = np.interp((np.arange(_GUESSES) + 0.5) / _GUESSES, np.cumsum(by_power) - 0.5 * by_power, power[0])
    return tuple(NoiseGuess(math.sqrt(p), float(np.interp(p, power[0], memory))) for p in middle.tolist())


def _forms(windows: Sequence[Array]) -> tuple[Array, Array]:
    """Return quadratic forms and log determinants of all stretches, by memory."""
    squares, volumes = np.zeros(len(_RHO)), np.zeros(len(_RHO))
    for m in sorted({len(w) for w in windows}):
        basis = np.linalg.svd(_line(m))[0][:, 2:]
        reduced = np.array([w for w in windows if len(w) == m]) @ basis
        apart = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
        for k, rho in enumerate(_RHO):
            C = basis.T @ rho**apart @ basis
            squares[k] += float(np.sum(reduced * np.linalg.solve(C, reduced.T).T))
            volumes[k] += len(reduced) * float(np.linalg.slogdet(C)[1])
    return squares, volumes


def _repeats(series: Sequence[SensorSeries]) -> float:
    """Return how far logs of the same command under the same load are apart, as of one sample."""
    groups: dict[tuple[object, ...], list[SensorSeries]] = {}
    for one in series:
        log = one.log
        key = (log.command.tobytes(), np.round(one.time - log.start, 6).tobytes(), repr(log.load),
               tuple(sorted(log.parameters.items())))
        groups.setdefault(key, []).append(one)
    found = []
    for members in groups.values():
        if len(members) > 1:
            values = np.array([one.measured for one in members])
            apart = (values - values.mean(axis=0)) * math.sqrt(len(members) / (len(members) - 1.0))
            found.append(apart.ravel())
    if not found:
        return math.nan
    every = np.concatenate(found)
    return robust_deviation(every)


# --- Do residuals follow the command of some time before? Their cross-correlation with its past changes ---------------

_REACH = 1.0  # s: a servo has followed a command by then, assumed
_MOST_LAGS = 50
_PER_LAG = 10  # samples
_INDEPENDENCE_LEAST = 4  # lags
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
        Bound that 99 % of the magnitudes stay below, each lag for itself, if residuals are noise.
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
        Rows of each log on the numbers that were fitted; nothing is taken out without.
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
    if not spans or count < _PER_LAG * _INDEPENDENCE_LEAST:
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
    if len(lags) < _INDEPENDENCE_LEAST or not (squares > 0.0).all() or not white.any():
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
    """Residuals and changes of the command in one log, and where it begins and continues after gaps."""

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
