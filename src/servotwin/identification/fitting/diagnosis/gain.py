"""Which samples of a log teach a trial, and what a trial gains on those that judge it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PARTS = 4  # of a log: every second one teaches, the others judge
_BLOCK = 20  # samples that are judged together
_MOST_OF = 0.98  # of the samples, beyond which a larger error counts no more
_COUNTS = ((3.0, 0.95), (2.3, 0.75), (1.5, 0.5))
"""Standard errors, and the share of the error that may be left: by chance one trial of 700 is so good, of 90 if it also
takes a fourth of the error away, of 15 if it takes half of it away."""


def teaching(time: Array, *, alternate: bool) -> NDArray[np.bool_]:
    """Return which samples teach: those of every second part of a log, or every second sample.

    Examples
    --------
    >>> teaching(np.arange(8.0), alternate=False).tolist()
    [True, True, False, False, True, True, False, False]
    """
    if alternate:
        return np.asarray(np.arange(len(time)) % 2 == 0)
    span = max(float(time[-1] - time[0]), 1e-12) * (1.0 + 1e-9)
    parts = (_PARTS * (time - time[0]) / span).astype(np.int64)
    return np.asarray(parts % 2 == 0)


@dataclass(frozen=True)
class Gain:
    """What a trial gains on samples that did not teach it: rms error before and after (SI), and how surely."""

    before: float
    after: float
    sure: float

    @property
    def counts(self) -> bool:
        """Whether it is more than chance, and worth a word."""
        return any(self.sure > sure and self.after < worth * self.before for sure, worth in _COUNTS)


@dataclass(frozen=True)
class Told:
    """A candidate that was tried: its name, its words, what to do about it, and what it gains."""

    name: str
    words: str
    remedy: str
    gain: Gain


def gain(before: Sequence[Array], after: Sequence[Array], noise: float, *, alternate: bool = False) -> Gain:
    """Return what a trial gains, from the residuals of all logs at all samples (SI).

    Stretches are compared by the logarithm of their powers, so that no single one decides.
    """
    said, pairs = [], []
    for b, a in zip(before, after, strict=True):
        n = min(len(a), len(b))
        judge = ~teaching(np.arange(max(n, 2), dtype=np.float64), alternate=alternate)[:n]
        b, a = b[:n][judge], a[:n][judge]
        pairs.append((b, a))
        for x, y in zip(*(np.array_split(v, max(1, len(v) // _BLOCK)) for v in (b, a)), strict=True):
            if len(x):
                said.append(math.log((float(np.mean(x**2)) + noise**2) / (float(np.mean(y**2)) + noise**2)))
    every = np.array(said)
    spread = float(every.std(ddof=1)) / math.sqrt(len(every)) if len(every) > 1 else math.inf
    sure = float(every.mean()) / spread if spread > 0.0 else 0.0
    b, a = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    far = float(np.quantile(np.abs(b), _MOST_OF))  # outliers are in both
    errors = [float(np.sqrt(np.mean(np.minimum(np.abs(v), far)**2))) for v in (b, a)]
    return Gain(errors[0], errors[1], sure if math.isfinite(sure) else 0.0)
