"""Causes taken away one by one: how much of a symptom goes, and what the least change is that does."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

from servotwin.diagnosis.causes import NUMBERS
from servotwin.errors import ServotwinError

if TYPE_CHECKING:
    from collections.abc import Callable

    from servotwin.diagnosis.numbers import Number, Patient

_HALVINGS = 5
_SPEAKS = 0.05  # of a symptom: what takes less away is no cause
_SEARCHED = 3  # causes whose least change is looked for where a number is unusual
_PAIRED = 0.5  # of a symptom, that two take away together and neither alone


class Strength(NamedTuple):
    """How strong a symptom is, and up to where it is none."""

    value: float
    limit: float


class Cause(NamedTuple):
    """What a symptom becomes where one number is taken away.

    Parameters
    ----------
    cause, name : str
        Of the row of the table.
    now, end : float
        As it is, and as it was taken (SI).
    share : float
        Of the symptom, that goes with it.
    cures : bool
        Whether the symptom is gone.
    needed : float
        The least change that does; nan where it does not cure (SI).
    odd : float
        How many times beyond what is usual the number is; 1 where it is within.
    usual : tuple of float
        Between which it usually is (SI).
    source : str
        Of that.
    """

    cause: str
    name: str
    now: float
    end: float
    share: float
    cures: bool
    needed: float
    odd: float
    usual: tuple[float, float]
    source: str
    number: Number

    @property
    def cure(self) -> str:
        """What to do, with its number."""
        number = self.number
        value = number.factor * (self.end if math.isnan(self.needed) else self.needed)
        return number.cure.format(f"{rounded(value, up=number.rises)} {number.unit}".strip())


def rounded(value: float, *, up: bool) -> str:
    """Return a number of two digits that does not fall short of it.

    Examples
    --------
    >>> rounded(7.31, up=True), rounded(0.0468, up=False), rounded(0.0, up=False), rounded(1119.0, up=False)
    ('7.4', '0.046', '0', '1100')
    """
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    step = 10.0**(math.floor(math.log10(abs(value))) - 1)
    found = (math.ceil(value / step - 1e-9) if up else math.floor(value / step + 1e-9)) * step
    return f"{found:.0f}" if 1e3 <= abs(found) < 1e6 else f"{found:.3g}"


class Trials:
    """Runs of one patient with something taken away, each once.

    Parameters
    ----------
    patient : Patient
    strength : callable
        Returns how strong the symptom is in a patient.
    """

    def __init__(self, patient: Patient, strength: Callable[[Patient], Strength]) -> None:
        self.patient, self._strength = patient, strength
        self.base = strength(patient)

    def value(self, *taken: tuple[Number, float]) -> float:
        """Return how strong the symptom is with numbers at other values; inf where there is no such servo."""
        try:
            patient = self.patient
            for number, end in taken:
                patient = number.put(patient, end)
            found = self._strength(patient).value
        except (ServotwinError, ValueError, ArithmeticError):
            return math.inf
        return math.inf if math.isnan(found) else found

    def share(self, value: float) -> float:
        """Return which share of the symptom is gone."""
        return max(0.0, min(1.0, 1.0 - value / self.base.value))

    def taken(self, number: Number) -> Cause | None:
        """Return what taking one number away does; None of one that is not there, or as far as it can be."""
        now, tried = number.now(self.patient), []
        if now is None or not (stops := number.stops(self.patient)):
            return None
        for end in stops:
            value = self.value((number, end))
            tried.append((value, end))
            if value <= self.base.limit:
                break
        value, end = min(tried)
        usual = number.usual(self.patient)
        return Cause(number.cause, number.name, now, end, self.share(value), value <= self.base.limit, math.nan,
                     math.exp(min(number.oddness(self.patient), 50.0)), (usual.low, usual.high), usual.source, number)

    def with_need(self, cause: Cause) -> Cause:
        """Return a cause that cures with the least change of it that does."""
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            there = self.value((cause.number, cause.number.between(cause.now, cause.end, middle)))
            low, high = (low, middle) if there <= self.base.limit else (middle, high)
        needed = cause.end if high == 1.0 else cause.number.between(cause.now, cause.end, high)
        return cause._replace(needed=needed)

    def pair(self, causes: list[Cause]) -> tuple[Cause, Cause] | None:
        """Return the two of different causes that take most away together, where neither does alone."""
        best, found = 0.0, None
        for one, other in combinations(causes, 2):
            if one.cause == other.cause:
                continue
            value = self.value((one.number, one.end), (other.number, other.end))
            gain = self.share(value) if value > self.base.limit else 1.0 + math.log(one.odd * other.odd)
            if gain > best and gain > max(one.share, other.share) + _SPEAKS:
                best, found = gain, (one, other)
        return found if best >= _PAIRED else None


def ranked(trials: Trials) -> tuple[list[Cause], tuple[Cause, Cause] | None]:
    """Return the causes of a symptom, the likeliest first, each by its best number, and a pair where none cures alone.

    Of those that cure, the first is the one whose number is furthest from what is usual; of those that are as usual,
    the one that needs the smallest part of the way. What does not cure goes by the share that it takes away.
    """
    found = [each for each in map(trials.taken, NUMBERS) if each is not None]
    best: dict[str, Cause] = {}
    for each in found:
        if each.cause not in best or _rank(each) < _rank(best[each.cause]):
            best[each.cause] = each
    curing = sorted((each for each in best.values() if each.cures), key=_rank)
    looked_at = len(curing) if not (curing and curing[0].odd > 1.0) else _SEARCHED  # the rest is not told apart by it
    curing = [trials.with_need(each) if k < looked_at else each for k, each in enumerate(curing)]
    others = [each for each in best.values() if not each.cures]
    causes = sorted([*curing, *(each for each in others if each.share >= _SPEAKS)], key=_rank)
    return causes, None if curing else trials.pair(
        [each for each in found if each.odd > 1.0 or each is best[each.cause]])


def _rank(cause: Cause) -> tuple[float, ...]:
    if not cause.cures:
        return (1.0, -cause.share, -cause.odd)
    return (0.0, -cause.odd, _way(cause))


def _way(cause: Cause) -> float:
    """Return which part of the way to its end a cause needs."""
    whole = cause.end - cause.now
    return 1.0 if math.isnan(cause.needed) or whole == 0.0 else (cause.needed - cause.now) / whole
