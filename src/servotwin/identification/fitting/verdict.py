"""Is what a fit leaves noise? Its residuals beside noise that needs no model, and what that says of the model.

Tests, each with a false alarm in a thousand fits: whether residuals are larger, sample after sample, than the sensor's
own noise at rest; whether they follow the motion, or the command of some time before; whether logs want different
numbers; and whether a model without any physics is nearer. None of them is harmed by noise that remembers itself or by
stamps that jitter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from servotwin.identification.fitting.residual_noise import (
    CrossCorrelation,
    Noise,
    NoiseGuess,
    SensorSeries,
    cross_correlation,
    isolated,
    noise_of,
)
from servotwin.identification.fitting.uncertainty import Rows

Array = NDArray[np.float64]

UNHELD = "the intervals below do not hold"
"""Until it is checked."""
FALSE_ALARM = 1e-3
"""Of each test."""
UNDECIDED = 1.5
"""Times the noise that neighbours show, where none is known that remembers itself: beyond it nothing is sure."""
_SMALL = 0.04  # of the noise's power: a slow part of a fifth of the noise is left unsaid
_CLIP = 3.0  # times the noise: nothing counts more
_CLIPPED = 0.9950  # mean square of a normal law's values that are cut off there
_UNKNOWN = 0.8  # memory of noise of which nothing is known: that of a smoothed sensor, assumed
_LEAST = 20  # samples that a test needs
_BLOCK = 20  # samples at least that are judged together
_BLOCKS = 8  # that a test needs
_SHORTLY = 0.15  # s
_ALONE = 1.0  # s: so far apart errors of a model are those of different motions, assumed


@dataclass(frozen=True)
class Cause:
    """Causes of residuals that are not noise, tried on the logs.

    Parameters
    ----------
    name : str
        Such as "load friction".
    sentence : str
    before, after : float
        Rms error on logs, or parts of logs, that took no part in the trial [rad; V where no angle was measured].
    remedy : str
        Remedy for it.
    """

    name: str
    sentence: str
    before: float
    after: float
    remedy: str

    @property
    def gain(self) -> float:
        """Share of the error that goes."""
        return 1.0 - self.after / self.before if self.before > 0.0 else 0.0


@dataclass(frozen=True)
class Rival:
    """A model without physics beside the fitted servo, on the same samples.

    Parameters
    ----------
    name : str
        Such as "delay + slew + lag".
    own, error : float
        Rms error of the fitted servo and of this model [rad; V where no angle was measured].
    held_out : bool
        Whether that is on logs that were held out; else on those that were fitted.
    beats : bool
        Whether this model is nearer by more than chance.
    odds : float
        How often chance alone would make it as much nearer.
    """

    name: str
    own: float
    error: float
    held_out: bool
    beats: bool
    odds: float


@dataclass(frozen=True)
class Verdict:
    """Whether the model can do what the logs show.

    Parameters
    ----------
    sentence : str
    holds : bool
        Whether what is left is noise, so that the intervals hold, and no rival is nearer; if it is not, `moved` says
        which do nevertheless.
    ratio : float
        Rms residual over the noise that needs no model, of the angle.
    noise : mapping of str to float
        That noise by sensor (SI).
    autocorrelation : float
        Of neighbouring residuals.
    causes : tuple of Cause
        The best first.
    odds : mapping of str to float
        How often a true model would fail each test by as much, such as "size".
    outliers : float
        Share of samples that lie far off alone.
    moved : mapping of str to tuple
        Where what is left is no noise: by how many half widths of its interval each number would be off if the model
        lacks the worst of what may be missing, as large as what is left allows; and what that is. Empty where it was
        not simulated.
    rival : Rival, optional
        The simplest model beside it; None where there is none, or too little to judge by.
    command_lag : float
        How long before the command came that residuals follow [s]; nan where they follow none.
    command : CrossCorrelation, optional
        Of the residuals with the command before; None of too few samples or changes.
    """

    sentence: str
    holds: bool
    ratio: float
    noise: Mapping[str, float]
    autocorrelation: float
    causes: tuple[Cause, ...] = ()
    odds: Mapping[str, float] = field(default_factory=dict)
    outliers: float = 0.0
    moved: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    rival: Rival | None = None
    command_lag: float = math.nan
    command: CrossCorrelation | None = None

    @property
    def word(self) -> str:
        """The verdict in a word: "good", "undecided" or "bad"."""
        return "bad" if not self.holds else "undecided" if self.undecided else "good"

    @property
    def undecided(self) -> bool:
        """Whether residuals may be noise that remembers itself, or what the model lacks: trials may tell."""
        return self.holds and "size" not in self.odds and self.ratio > UNDECIDED

    def __str__(self) -> str:
        """Return the sentence, and those of the causes."""
        return "\n".join((self.sentence, *(cause.sentence for cause in self.causes)))


@dataclass(frozen=True)
class Excess:
    """One test: how large what it looks for is, as a share of the noise's power, and the odds of that by chance."""

    size: float
    odds: float

    @property
    def fails(self) -> bool:
        """Whether it is neither small nor chance."""
        return self.size > _SMALL and self.odds < FALSE_ALARM


def judge(series: Sequence[SensorSeries], sensor: str, rows: Sequence[Rows] = (), numbers: int = 0,
          accuracy: float = 0.0) -> Verdict:
    """Return the verdict on a fit, without causes.

    Parameters
    ----------
    series : sequence of SensorSeries
        The angle in every fitted log.
    sensor : str
        Its name, for the words.
    rows : sequence of Rows, optional
        Rows of each log on the shared numbers.
    numbers : int
        How many were fitted.
    accuracy : float
        Of the simulation (SI): what leaves less is exact.
    """
    noise = noise_of(series)
    left = math.sqrt(float(np.mean(np.concatenate([one.residual for one in series])**2)))
    if left <= accuracy:
        return Verdict(f"exact: what is left, {shown(left, sensor)}, is no more than the simulation is off", True,
                       left / noise.size, {sensor: noise.size}, 0.0)
    inner = [~isolated(one, noise.jitter) for one in series]
    # Changes that the measured values alone show too: fast errors of a wrong model are no outliers
    plain = [replace(one, simulated=np.zeros(len(one.time))) for one in series]
    lost = sum(float((isolated(one) & ~k).sum()) for one, k in zip(plain, inner, strict=True)) / sum(map(len, inner))
    scaled = [one.residual / noise.of(one) for one in series]
    ratio = math.sqrt(float(np.mean(np.concatenate([u[k] for u, k in zip(scaled, inner, strict=True)])**2)))
    tests = {"size": _size(series, inner, noise), "memory": _memory(series, inner, noise),
             "motion": None if noise.known else _motion(series, scaled, inner), "logs": _between(rows, noise, numbers)}
    follows = cross_correlation(series, rows if len(rows) == len(series) else (), noise)
    if follows is not None:
        usual = noise.size**2 if noise.known else left**2
        tests["command"] = Excess((follows.followed - noise.count**2 / 12.0) / usual, follows.odds)
    power = sum(float(one.residual @ one.residual) for one in series)
    first = sum(float(one.residual[1:] @ one.residual[:-1]) for one in series) / power if power > 0.0 else 0.0
    failed = [name for name, test in tests.items() if test is not None and test.fails]
    lag = follows.clearest if follows is not None and "command" in failed else math.nan
    sentence = _sentence(failed, ratio, noise, sensor, lag)
    if lost > 0.005:
        sentence += f"; {100.0 * lost:.2g} % of the samples lie far off alone and are no noise of that kind"
    return Verdict(sentence, not failed, ratio, {sensor: noise.size}, first,
                   odds={name: test.odds for name, test in tests.items() if test is not None}, outliers=lost,
                   command_lag=lag, command=follows)


def rival(name: str, pairs: Sequence[tuple[Array, Array]], step: float, noise: float, *,
          held_out: bool) -> Rival | None:
    """Return how a model without physics stands beside the fitted servo; None of too few samples.

    It is nearer if the sum of its squared errors is less by more than 4 %, and if by more than chance it is nearer in
    stretches of a second, of 20 samples at least: Student's t of the logarithm of both mean squares' ratio, in each of
    which the noise counts too. Two models that are alike could as well change places in any stretch.

    Parameters
    ----------
    name : str
    pairs : sequence of tuple of ndarray
        Residuals of the servo and of the model in each log (SI).
    step : float
        From sample to sample [s].
    noise : float
        Of the sensor (SI).
    held_out : bool
        Whether the logs were held out.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> near, far = rng.normal(size=400), 2.0 * rng.normal(size=400)
    >>> [rival("lag", [pair], 0.02, 1.0, held_out=True).beats for pair in ((far, near), (near, far), (near, near))]
    [True, False, False]
    """
    from scipy.special import stdtr

    count = sum(len(own) for own, _ in pairs)
    block = max(_BLOCK, min(round(_ALONE / step), count // _BLOCKS))
    squares = np.array([[float(np.mean(one**2)) for one in (own[some], other[some])] for own, other in pairs
                        for some in np.array_split(np.arange(len(own)), max(1, len(own) // block)) if len(some)])
    if len(squares) < _BLOCKS:
        return None
    own, error = (math.sqrt(sum(float(pair[k] @ pair[k]) for pair in pairs) / count) for k in (0, 1))
    ratio = np.log((squares[:, 0] + noise**2) / (squares[:, 1] + noise**2))
    spread = float(ratio.std(ddof=1)) / math.sqrt(len(ratio))
    odds = float(stdtr(len(ratio) - 1.0, -float(ratio.mean()) / max(spread, 1e-12)))
    return Rival(name, own, error, held_out, error**2 < (1.0 - _SMALL) * own**2 and odds < FALSE_ALARM, odds)


def against(verdict: Verdict, rival: Rival | None, sensor: str) -> Verdict:
    """Return a verdict with the simplest model beside the fit; where that is nearer, it says so first."""
    if rival is None or not rival.beats:
        return replace(verdict, rival=rival)
    where = "logs that were held out" if rival.held_out else "the same logs"
    rest = f"of the fitted logs {verdict.sentence}" if verdict.holds else verdict.sentence
    return replace(verdict, rival=rival, holds=False, sentence=(
        f"a plain {rival.name} without physics is nearer on {where}: {shown(rival.error, sensor)} against "
        f"{shown(rival.own, sensor)}; {rest}"))


def _sentence(failed: Sequence[str], ratio: float, noise: Noise, sensor: str, lag: float) -> str:
    size = shown(noise.size, sensor)
    command = "the command at once" if lag == 0.0 else f"the command of {lag:.2g} s before"
    if not failed:
        if not noise.known and ratio > UNDECIDED:
            return (f"residuals are {ratio:.2g} times the noise of {size} that neighbours show: the sensor's noise "
                    "remembers itself, or the model lacks something; no log stands still long enough to tell")
        if not noise.known:
            return (f"what is left does not follow the motion; the sensor's noise is {size} where neighbours tell it, "
                    "but no log stands still long enough to compare")
        return f"what is left is noise of {size}: the model can do what these logs show"
    lacks = f"the model lacks something; {UNHELD}"
    if ratio >= 1.3:
        follow = f" and follow {command}" if "command" in failed else ""
        return f"residuals are {ratio:.2g} times the sensor's noise of {size}{follow}: {lacks}"
    if "command" in failed:
        return f"residuals are hardly larger than the sensor's noise of {size}, but follow {command}: {lacks}"
    if "memory" in failed or "size" in failed:
        return f"residuals are hardly larger than the sensor's noise of {size}, but follow each other: {lacks}"
    if "motion" in failed:
        return f"residuals are hardly larger than the sensor's noise of {size}, but follow the motion: {lacks}"
    return f"each log is followed to {size}, but they want different numbers: {lacks}"


def intervals_said(moved: Mapping[str, tuple[float, str]], *, sought: bool = True) -> str:
    """Return what a simulated check says of the intervals of a model that lacks something.

    Examples
    --------
    >>> intervals_said({"delay": (0.4, "play"), "output_inertia": (5.3, "load friction")})
    'of the intervals below only that of delay holds (load friction would move output_inertia by 5.3 half widths)'
    >>> intervals_said({"delay": (0.4, "play")})
    'the intervals below hold nevertheless (play would move delay by 0.4 half widths)'
    """
    if not moved:
        return "whether the intervals below hold was not simulated" if sought else "there are no intervals"
    worst = max(moved, key=lambda name: moved[name][0])
    why = f"{moved[worst][1]} would move {worst} by {moved[worst][0]:.2g} half widths"
    good = [name for name, (widths, _) in moved.items() if widths <= 1.0]
    if len(good) == len(moved):
        return f"the intervals below hold nevertheless ({why})"
    if not good:
        return f"{UNHELD} ({why})"
    said = f"only that of {good[0]} holds" if len(good) == 1 else f"only those of {', '.join(good)} hold"
    return f"of the intervals below {said} ({why})"


def shown(value: float, sensor: str) -> str:
    """Return an error of a sensor in words.

    Examples
    --------
    >>> shown(1.04e-3, "output_angle"), shown(2e-3, "feedback_voltage")
    ('1.0 mrad', '2.0 mV')
    """
    unit = {"output_angle": "mrad", "feedback_voltage": "mV"}.get(sensor, "mA")
    thousand = 1e3 * value
    return f"{thousand:.1f} {unit}" if 0.95 <= thousand < 100.0 else f"{thousand:.2g} {unit}"


def _blocks(parts: Sequence[Array]) -> tuple[Array, Array]:
    """Return sums over stretches of some samples, and how many each has: what chance is judged by."""
    blocks = [some for part in parts for some in np.array_split(part, max(1, len(part) // _BLOCK)) if len(some)]
    return np.array([float(some.sum()) for some in blocks]), np.array([float(len(some)) for some in blocks])


def _test(parts: Sequence[Array], expected: float, sure: float) -> Excess | None:
    """Test whether a mean is above what is expected, which is known to `sure`: Student's t over stretches."""
    from scipy.special import stdtr

    sums, sizes = _blocks(parts)
    if len(sums) < _BLOCKS:
        return None
    mean = float(sums.sum() / sizes.sum())
    spread = math.hypot(math.sqrt(float(((sums - mean * sizes)**2).sum())) / float(sizes.sum()), sure)
    more = mean - expected
    if spread <= 0.0:
        return Excess(more, 0.0 if more > 0.0 else 1.0)
    return Excess(more, float(stdtr(len(sums) - 1.0, -more / spread)))


def _size(series: Sequence[SensorSeries], inner: Sequence[NDArray[np.bool_]], noise: Noise) -> Excess | None:
    """Test whether residuals are larger than the noise; nothing counts more than three times it."""
    def more(guess: NoiseGuess) -> Array:
        parts = [np.minimum((one.residual / noise.of(one, guess.size))[keep]**2, _CLIP**2)
                 for one, keep in zip(series, inner, strict=True)]
        return np.concatenate(parts) - _CLIPPED
    return _over(noise, more)


def _memory(series: Sequence[SensorSeries], inner: Sequence[NDArray[np.bool_]], noise: Noise) -> Excess | None:
    """Test whether neighbouring residuals are more alike than noise at rest is."""
    def more(guess: NoiseGuess) -> Array:
        parts = []
        for one, keep in zip(series, inner, strict=True):
            v = np.clip(one.residual / noise.of(one, guess.size), -_CLIP, _CLIP)
            parts.append((v[1:] * v[:-1])[keep[1:] & keep[:-1] & one.joined[1:]])
        return np.concatenate(parts) - guess.memory
    return _over(noise, more)


def _over(noise: Noise, more: Callable[[NoiseGuess], Array]) -> Excess | None:
    """Test whether a mean is above 0, which it is at most of true noise; all likely noises are asked in turn."""
    from scipy.special import ndtr

    if not noise.known:
        return None
    odds, sizes = [], []
    for guess in noise.guesses:
        values = more(guess)
        if len(values) < _LEAST:
            return None
        rho = guess.memory
        # Products of neighbours, and squares, of first-order noise (Bartlett 1946)
        spread = math.sqrt(2.0 * (1.0 + rho**2) / max(1.0 - rho**2, 0.02) / len(values))
        sizes.append(float(values.mean()))
        odds.append(float(ndtr(-sizes[-1] / spread)))
    return Excess(sizes[len(sizes) // 2], float(np.mean(odds)))


def _motion(series: Sequence[SensorSeries], scaled: Sequence[Array],
            inner: Sequence[NDArray[np.bool_]]) -> Excess | None:
    """Test whether residuals are larger while the shaft moves or has just moved, of whatever noise."""
    power = [np.minimum(u[keep]**2, _CLIP**2) for u, keep in zip(scaled, inner, strict=True)]
    moves = [_moves(one)[keep] for one, keep in zip(series, inner, strict=True)]
    order = np.concatenate(moves).argsort(kind="stable").argsort(kind="stable") / max(sum(map(len, moves)) - 1, 1)
    ranks = np.split(2.0 * math.sqrt(3.0) * (order - 0.5), np.cumsum([len(m) for m in moves])[:-1])
    mean = max(float(np.mean(np.concatenate(power))), 1e-300)
    return _test([rank * (p / mean - 1.0) for rank, p in zip(ranks, power, strict=True)], 0.0, 0.0)


def _moves(one: SensorSeries) -> Array:
    """Return how much the shaft moves in the simulation at each sample and shortly before."""
    speed = np.abs(one.speed)
    step = float(np.median(np.diff(one.time))) if len(one.time) > 1 else _SHORTLY
    width = max(1, min(len(speed), round(_SHORTLY / step)))
    return np.convolve(speed, np.ones(width), "full")[:len(speed)]


def _between(rows: Sequence[Rows], noise: Noise, numbers: int) -> Excess | None:
    """Test whether what each log wants of the shared numbers scatters more than its own residuals explain."""
    from scipy.special import chdtrc

    if len(rows) < 2:
        return None
    total, freedom = 0.0, 0.0
    for r in rows:
        m = len(r.residual)
        g = r.slope[:m] * r.score[:m, None]
        F = r.slope.T @ r.slope
        if not np.isfinite(F).all():  # a simulation at the edge of what is possible
            continue
        values, vectors = np.linalg.eigh(F)
        known = vectors[:, values > 1e-6 * max(float(values.max(initial=0.0)), 1e-12)]
        score = (r.slope.T @ r.score) @ known
        M = known.T @ (g.T @ g) @ known + known.T @ (r.slope[m:].T @ r.slope[m:]) @ known
        if m <= 3 * known.shape[1]:
            continue
        total += float(score @ np.linalg.lstsq(M, score, rcond=1e-10)[0])
        freedom += known.shape[1]
    freedom -= min(numbers, freedom / max(len(rows), 1))
    if freedom < 1.0:
        return None
    # Noise that remembers itself makes scores scatter more, by as much as the likely ones do
    shares = [(1.0 - memory) / (1.0 + memory) for memory in ([g.memory for g in noise.guesses] or [_UNKNOWN])]
    odds = float(np.mean([chdtrc(freedom, share * total) for share in shares]))
    return Excess(shares[len(shares) // 2] * total / freedom - 1.0, odds)
