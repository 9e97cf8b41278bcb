"""Distributions out of words such as ``normal:10%`` and ``uniform:4us..8us``."""

from __future__ import annotations

import re
from collections.abc import Callable

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.studies.kinds import (
    Choice,
    Distribution,
    LogNormal,
    Normal,
    Offset,
    Relative,
    Triangular,
    Uniform,
)
from servotwin.units.quantities import number_and_unit, unit_named

_ABOUT = re.compile(r"±|\+-|\+/-")
FORMS = {
    "uniform": "uniform:10%, uniform:1us or uniform:4us..8us",
    "normal": "normal:10%, normal:0.3ohm or normal:3ohm±0.3ohm",
    "lognormal": "lognormal:10% or lognormal:3ohm±10%", "triangular": "triangular:10% or triangular:4us..6us..8us",
    "choice": "choice:brake,coast or choice:4us,8us",
}


def distribution_of(text: str, dimension: str) -> Distribution:
    """Return the distribution that a text describes.

    Parameters
    ----------
    text : str
        ``KIND:NUMBERS``; a single number is a spread about the nominal value, in per cent of it or with a unit. A
        number without unit is in SI; before one with a unit it has the same.
    dimension : str
        Of the parameter; "word" for words.

    Raises
    ------
    InputError
        If it is malformed, or a number is out of its range.
    UnitError
        If a unit does not measure this dimension.

    Examples
    --------
    >>> distribution_of("uniform:4us..8us", "time")
    Uniform(lower=4e-06, upper=8e-06)
    >>> distribution_of("normal:10%", "resistance")
    Relative(factor=Normal(mean=1.0, std=0.1))
    """
    kind, _, rest = (part.strip() for part in text.partition(":"))
    if kind not in FORMS:
        raise UnknownNameError("distribution", kind, FORMS)
    if dimension == "word" and kind != "choice":
        raise InputError("distribution of a word", got=text, allowed="choice:WORD,WORD")
    return _MAKERS[kind](rest, dimension)


class _Numbers:
    """The numbers of a text, each with its unit."""

    def __init__(self, kind: str, parts: list[str], dimension: str) -> None:
        found = [pair for part in parts if (pair := number_and_unit(part)) is not None]
        if len(found) < len(parts):
            raise InputError(kind, got=", ".join(parts) or "nothing", allowed=FORMS[kind])
        self.kind, self.dimension = kind, dimension
        self.numbers, self.units = [number for number, _ in found], [unit for _, unit in found]
        for k in reversed(range(len(parts) - 1)):
            self.units[k] = self.units[k] or self.units[k + 1]

    def si(self, k: int = 0) -> float:
        """Return a number in SI."""
        unit = unit_named(self.units[k], self.dimension) if self.units[k] else units.si_unit(self.dimension)
        return units.to_si(self.numbers[k], unit, self.dimension)

    def percent(self, k: int = 0) -> bool:
        """Whether a spread is relative."""
        return self.units[k] == "%"


def _range(kind: str, make: Callable[..., Distribution], count: int) -> Callable[[str, str], Distribution]:
    """Return what makes a distribution between bounds: of one number about the nominal value, of `count` between."""
    def maker(rest: str, dimension: str) -> Distribution:
        parts = _Numbers(kind, [_ABOUT.sub("", rest, count=1)] if ".." not in rest else rest.split(".."), dimension)
        if len(parts.numbers) == 1:
            if parts.percent():
                half = parts.numbers[0] / 100.0
                return Relative(make(1.0 - half, *[1.0] * (count - 2), 1.0 + half))
            return Offset(make(-parts.si(), *[0.0] * (count - 2), parts.si()))
        if len(parts.numbers) != count:
            raise InputError(kind, got=rest, allowed=FORMS[kind])
        return make(*map(parts.si, range(count)))
    return maker


def _normal(rest: str, dimension: str) -> Distribution:
    *centre, spread = _ABOUT.split(rest)
    if not any(centre):
        parts = _Numbers("normal", [spread], dimension)
        return Relative(Normal(1.0, parts.numbers[0] / 100.0)) if parts.percent() else Offset(Normal(0.0, parts.si()))
    std = _Numbers("normal", [spread], dimension)
    mean = _Numbers("normal", centre if std.percent() else [*centre, spread], dimension).si()
    return Normal(mean, abs(mean) * std.numbers[0] / 100.0 if std.percent() else std.si())


def _lognormal(rest: str, dimension: str) -> Distribution:
    *centre, spread = _ABOUT.split(rest)
    sigma = _Numbers("lognormal", [spread], dimension)
    if not sigma.percent():
        raise InputError("lognormal", got=rest, allowed=FORMS["lognormal"])
    if not any(centre):
        return Relative(LogNormal(1.0, sigma.numbers[0] / 100.0))
    return LogNormal(_Numbers("lognormal", centre, dimension).si(), sigma.numbers[0] / 100.0)


def _choice(rest: str, dimension: str) -> Distribution:
    parts = [part.strip() for part in rest.split(",")]
    if dimension == "word":
        return Choice(tuple(parts))
    numbers = _Numbers("choice", parts, dimension)
    return Choice(tuple(map(numbers.si, range(len(parts)))))


_MAKERS: dict[str, Callable[[str, str], Distribution]] = {
    "uniform": _range("uniform", Uniform, 2), "normal": _normal, "lognormal": _lognormal,
    "triangular": _range("triangular", Triangular, 3), "choice": _choice,
}
