"""Which of several fits to the same logs the data pay for: by logs that were held out, or by a criterion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.identification.fitting.arrow import Loss
from servotwin.identification.fitting.fit import Fit
from servotwin.identification.fitting.gains import gained
from servotwin.identification.fitting.holdout import LogError, pooled
from servotwin.identification.fitting.phases import widening
from servotwin.identification.fitting.point import LogPart

_FEWEST = 3  # held out logs, whose scatter is believed


@dataclass(frozen=True)
class Rung:
    """One friction law, or one structure.

    Parameters
    ----------
    name : str
        "M1" to "M6", or such as "digital, diode, M1".
    fit : Fit
    training, holdout : float
        Rms error over all samples [rad]; nan without logs that were held out.
    criterion : float
        Bayesian information criterion of the fitted logs, with their residuals counted as often as those of the rung
        that leaves least are independent; smaller is better.
    """

    name: str
    fit: Fit
    training: float
    holdout: float
    criterion: float

    @property
    def overfits(self) -> bool:
        """Whether it is much better on the logs that it was fitted to than on others."""
        return self.holdout > 1.3 * self.training


@dataclass(frozen=True)
class Ladder:
    """All rungs, and the one that is chosen.

    Parameters
    ----------
    rungs : tuple of Rung
    chosen : str
    reason : str
    error : float
        Rms error on logs that had no say in the choice [rad], smaller ones being luck: the logs that were held out are
        halved, each half chooses a rung, and the other half tells its error. Where the criterion chose, that of all
        logs that were held out; nan with fewer than two.
    choices : tuple of str
        The rungs that the halves chose: two that differ are a close call.
    """

    rungs: tuple[Rung, ...]
    chosen: str
    reason: str
    error: float = math.nan
    choices: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """That of the chosen rung."""
        return self[self.chosen].fit

    def __getitem__(self, name: str) -> Rung:
        for rung in self.rungs:
            if rung.name == name:
                return rung
        raise InputError("rung", got=name, allowed=", ".join(rung.name for rung in self.rungs))


def ladder_of(rungs: Sequence[Rung], select: str) -> Ladder:
    """Return fits to the same logs, the simplest first, with the one that is chosen.

    Parameters
    ----------
    rungs : sequence of Rung
    select : {"holdout", "criterion"}
        As of `friction_ladder`.
    """
    rungs = with_criterion(rungs)
    chosen, reason = choice_of(rungs, select)
    told = told_of(rungs, select)
    before = _simpler(rungs, chosen)
    if before is not None:
        words = gained(before.fit, next(rung for rung in rungs if rung.name == chosen).fit, before.name)
        reason += f"; {words}" if words else ""
    return Ladder(tuple(rungs), chosen, reason, told.error, told.choices)


def _simpler(rungs: Sequence[Rung], chosen: str) -> Rung | None:
    """Return the best of the rungs with fewer parameters than the one that is chosen; None where there is none."""
    own = len(next(rung for rung in rungs if rung.name == chosen).fit.names)
    fewer = [rung for rung in rungs if len(rung.fit.names) < own]
    return min(fewer, key=lambda rung: rung.training if math.isnan(rung.holdout) else rung.holdout, default=None)


def rung_of(name: str, fit: Fit) -> Rung:
    """Return a fit as one of several, under a name."""
    own = type(fit.model).__name__
    training = fit.training.total()[own]
    holdout = fit.holdout.total()[own] if fit.holdout else math.nan
    return Rung(name, fit, training, holdout, math.nan)


def with_criterion(rungs: Sequence[Rung]) -> list[Rung]:
    """Return rungs with their information criterion.

    All count the same residuals, as often as those of the rung that leaves least are independent: where each counted
    its own, one whose residuals remember longer would have fewer, and so seem to explain more of them.
    """
    least = min(rungs, key=lambda rung: rung.training)
    fitted = [trace for trace in least.fit.traces if not trace.held_out]
    samples = sum(len(trace.time) for trace in fitted) / _memory([trace.residual for trace in fitted])
    return [replace(rung, criterion=samples * math.log(max(rung.training, 1e-300) ** 2)
                    + len(rung.fit.names) * math.log(max(samples, 1.0))) for rung in rungs]


def _memory(residuals: Sequence[NDArray[np.float64]]) -> float:
    """Return how many residuals stand for one that is independent, if each follows the one before it."""
    return widening([LogPart(residual, residual, residual) for residual in residuals], Loss())


class _Told(NamedTuple):
    """An error that the choice did not see, and which rungs were chosen without it."""

    error: float
    choices: tuple[str, ...]


def told_of(rungs: Sequence[Rung], select: str) -> _Told:
    """Return the error on logs that did not choose: those held out in two halves, each told by the other's choice."""
    if _by_criterion(rungs, select):
        chosen, _ = choice_of(rungs, select)
        return _Told(next(rung.holdout for rung in rungs if rung.name == chosen), ())
    count = len(_errors(rungs[0]))
    if count < 2:
        return _Told(math.nan, ())
    halves = [range(k, count, 2) for k in range(2)]  # logs of one kind of motion lie side by side
    named = {rung.name: rung for rung in rungs}
    choices = tuple(choice_of(rungs, select, half)[0] for half in halves)
    told = [_errors(named[name])[k] for name, other in zip(choices, reversed(halves), strict=True) for k in other]
    return _Told(pooled(told), choices)


def _by_criterion(rungs: Sequence[Rung], select: str) -> bool:
    return select == "criterion" or any(math.isnan(rung.holdout) for rung in rungs)


def choice_of(rungs: Sequence[Rung], select: str, some: Sequence[int] | None = None) -> tuple[str, str]:
    """Return the rung that some of the held out logs choose, or all, and why."""
    if _by_criterion(rungs, select):
        best = min(rungs, key=lambda rung: rung.criterion)
        return best.name, "smallest information criterion"
    best = min(rungs, key=lambda rung: pooled(_errors(rung, some)))
    for rung in rungs:  # from the simplest on
        worse, doubt = _difference(rung, best, some)
        if worse <= doubt:
            reason = "smallest error on logs that were held out" if rung is best else (
                f"simplest within one standard error of {best.name}, the smallest error on logs that were held out")
            return rung.name, reason
    return best.name, "smallest error on logs that were held out"


def _difference(rung: Rung, best: Rung, some: Sequence[int] | None) -> tuple[float, float]:
    """Return by how much a rung's mean square error of held out logs is above the best, and its standard error.

    Two logs do not say how logs scatter; with so few it is the standard error of a mean square of their samples.
    """
    theirs = _errors(best, some)
    gaps = np.array([a.rms**2 - b.rms**2 for a, b in zip(_errors(rung, some), theirs, strict=True)])
    if len(gaps) < _FEWEST:
        return float(gaps.mean()), pooled(theirs) ** 2 * math.sqrt(2.0 / sum(e.samples for e in theirs))
    return float(gaps.mean()), float(gaps.std(ddof=1) / math.sqrt(len(gaps)))


def _errors(rung: Rung, some: Sequence[int] | None = None) -> tuple[LogError, ...]:
    errors = rung.fit.holdout.errors[type(rung.fit.model).__name__]
    return errors if some is None else tuple(errors[k] for k in some)
