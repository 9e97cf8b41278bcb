"""Kinds of distributions to draw from: each one is its quantile function, so that a draw needs one number."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, UnknownNameError
from servotwin.units import is_finite
from servotwin.units.quantities import number_and_unit, unit_named

# --- Kinds of distributions to draw from ------------------------------------------------------------------------------

Array = NDArray[np.float64]

ENDS = (0.05, 0.95)  # of a bar of the tornado


class Distribution(ABC):
    """Something to draw from: probabilities between 0 and 1 become values, in SI."""

    @abstractmethod
    def quantile(self, p: Array) -> NDArray[Any]:
        """Return the values below which a draw falls with probability `p`, same shape."""

    @abstractmethod
    def cdf(self, x: float) -> float:
        """Return the probability of a draw of at most `x`."""

    @property
    def ends(self) -> tuple[Any, ...]:
        """The 5 % and the 95 % value; of a choice, all its options."""
        low, high = self.quantile(np.array(ENDS)).tolist()
        return low, high

    def about(self, nominal: float) -> Distribution:
        """Return the distribution for a parameter that is nominally `nominal`; the same where that does not matter."""
        return self

    @property
    def needs_nominal(self) -> bool:
        """Whether it is a spread about the nominal value."""
        return False

    def described(self) -> dict[str, Any]:
        """Return kind and numbers, ready for JSON; what is infinite is None."""
        found: dict[str, Any] = {"kind": type(self).__name__}
        for f in fields(self):  # type: ignore[arg-type]  # all that are final are dataclasses
            found[f.name] = _plain(getattr(self, f.name))
        return found


def _plain(value: Any) -> Any:
    if isinstance(value, Distribution):
        return value.described()
    if isinstance(value, tuple):
        return list(value)
    return None if isinstance(value, float) and math.isinf(value) else value


def _checked(kind: Distribution, **rules: str) -> None:
    """Raise unless all fields are finite and those named in `rules` hold: "positive"."""
    for f in fields(kind):  # type: ignore[arg-type]
        value = getattr(kind, f.name)
        positive = rules.get(f.name) == "positive"
        if not is_finite(value) or (positive and not value > 0.0):
            raise InputError(f"{type(kind).__name__}({f.name})", got=value,
                             allowed="a positive number" if positive else "a finite number")
        object.__setattr__(kind, f.name, float(value))


class Continuous(Distribution):
    """A distribution that SciPy has."""

    @abstractmethod
    def _law(self, stats: Any) -> Any:
        """Return the frozen distribution of `scipy.stats`, which is slow to load."""

    def quantile(self, p: Array) -> Array:
        """Return the values at probabilities `p`."""
        return np.asarray(_frozen(self).ppf(p), dtype=np.float64)

    def cdf(self, x: float) -> float:
        """Return the probability of a draw of at most `x`."""
        return float(_frozen(self).cdf(x))


@lru_cache(256)  # SciPy takes a millisecond for it, and robots draw anew in each episode
def _frozen(kind: Continuous) -> Any:
    from scipy import stats

    return kind._law(stats)


@dataclass(frozen=True)
class Uniform(Continuous):
    """All values from `lower` to `upper` alike.

    Examples
    --------
    >>> Uniform(4e-6, 8e-6).quantile(np.array([0.5])).tolist()
    [6e-06]
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        _checked(self)
        if not self.lower < self.upper:
            raise InputError("Uniform(lower, upper)", got=(self.lower, self.upper), allowed="lower less than upper")

    def _law(self, stats: Any) -> Any:
        return stats.uniform(self.lower, self.upper - self.lower)


@dataclass(frozen=True)
class Normal(Continuous):
    """The bell curve with mean and standard deviation `std`.

    Examples
    --------
    >>> Normal(3.0, 0.3).quantile(np.array([0.5])).tolist()
    [3.0]
    """

    mean: float
    std: float

    def __post_init__(self) -> None:
        _checked(self, std="positive")

    def _law(self, stats: Any) -> Any:
        return stats.norm(self.mean, self.std)


@dataclass(frozen=True)
class LogNormal(Continuous):
    """Positive values whose natural logarithm is normal: `median` times e to a normal draw of deviation `sigma`.

    Examples
    --------
    >>> LogNormal(3.0, 0.1).quantile(np.array([0.5])).tolist()
    [3.0]
    """

    median: float
    sigma: float

    def __post_init__(self) -> None:
        _checked(self, median="positive", sigma="positive")

    def _law(self, stats: Any) -> Any:
        return stats.lognorm(self.sigma, scale=self.median)


@dataclass(frozen=True)
class Triangular(Continuous):
    """Likeliest at `mode`, impossible outside `lower` and `upper`.

    Examples
    --------
    >>> Triangular(0.0, 1.0, 2.0).quantile(np.array([0.125, 0.5])).tolist()
    [0.5, 1.0]
    """

    lower: float
    mode: float
    upper: float

    def __post_init__(self) -> None:
        _checked(self)
        if not (self.lower <= self.mode <= self.upper and self.lower < self.upper):
            raise InputError("Triangular(lower, mode, upper)", got=(self.lower, self.mode, self.upper),
                             allowed="numbers that increase")

    def _law(self, stats: Any) -> Any:
        width = self.upper - self.lower
        return stats.triang((self.mode - self.lower) / width, self.lower, width)


@dataclass(frozen=True)
class Choice(Distribution):
    """One of a few numbers or words, each as likely; one that is listed twice is twice as likely.

    Examples
    --------
    >>> Choice(("brake", "coast")).quantile(np.array([0.2, 0.7])).tolist()
    ['brake', 'coast']
    """

    options: tuple[float, ...] | tuple[str, ...]

    def __post_init__(self) -> None:
        given: Any = self.options
        options = tuple(given) if isinstance(given, list | tuple | np.ndarray) else ()
        words = all(isinstance(x, str) for x in options)
        if not options or not (words or all(map(is_finite, options))):
            raise InputError("Choice(options)", got=given, allowed="a list of finite numbers, or of words")
        object.__setattr__(self, "options", options if words else tuple(map(float, options)))

    def quantile(self, p: Array) -> NDArray[Any]:
        """Return the options at probabilities `p`, in the order of the list."""
        index = np.minimum((p * len(self.options)).astype(np.int64), len(self.options) - 1)
        return np.array(self.options)[index]

    def cdf(self, x: float) -> float:
        """Return the probability of a draw of at most `x`."""
        return sum(not isinstance(option, str) and option <= x for option in self.options) / len(self.options)

    @property
    def ends(self) -> tuple[Any, ...]:
        """All options."""
        return tuple(dict.fromkeys(self.options))


@dataclass(frozen=True)
class Relative(Distribution):
    """A factor on the nominal value.

    Examples
    --------
    >>> Relative(Uniform(0.9, 1.1)).about(3.0).ends
    (2.73, 3.27)
    """

    factor: Distribution

    @property
    def needs_nominal(self) -> bool:
        """Whether it is a spread about the nominal value."""
        return True

    def about(self, nominal: float) -> Distribution:
        """Return the distribution for a parameter that is nominally `nominal`, which is not 0."""
        if nominal == 0.0:
            raise InputError("a relative spread", got="a nominal value of 0", allowed="an absolute spread")
        return Affine(self.factor, offset=0.0, scale=nominal)

    def quantile(self, p: Array) -> NDArray[Any]:
        """Return the factors at probabilities `p`."""
        return self.factor.quantile(p)

    def cdf(self, x: float) -> float:
        """Return the probability of a factor of at most `x`."""
        return self.factor.cdf(x)


@dataclass(frozen=True)
class Offset(Distribution):
    """Something added to the nominal value.

    Examples
    --------
    >>> Offset(Uniform(-1.0, 1.0)).about(3.0).ends
    (2.1, 3.9)
    """

    added: Distribution

    @property
    def needs_nominal(self) -> bool:
        """Whether it is a spread about the nominal value."""
        return True

    def about(self, nominal: float) -> Distribution:
        """Return the distribution for a parameter that is nominally `nominal`."""
        return Affine(self.added, offset=nominal, scale=1.0)

    def quantile(self, p: Array) -> NDArray[Any]:
        """Return what is added, at probabilities `p`."""
        return self.added.quantile(p)

    def cdf(self, x: float) -> float:
        """Return the probability that at most `x` is added."""
        return self.added.cdf(x)


@dataclass(frozen=True)
class Affine(Distribution):
    """`offset` + `scale` times a draw of another distribution.

    Examples
    --------
    >>> Affine(Uniform(0.0, 1.0), offset=1.0, scale=-2.0).quantile(np.array([0.0, 1.0])).tolist()
    [-1.0, 1.0]
    """

    distribution: Distribution
    offset: float
    scale: float

    def quantile(self, p: Array) -> Array:
        """Return the values at probabilities `p`."""
        drawn: Array = self.distribution.quantile(p if self.scale > 0.0 else 1.0 - p)
        return self.offset + self.scale * drawn

    def cdf(self, x: float) -> float:
        """Return the probability of a draw of at most `x`."""
        below = self.distribution.cdf((x - self.offset) / self.scale)
        return below if self.scale > 0.0 else 1.0 - below


@dataclass(frozen=True)
class Truncated(Distribution):
    """Another distribution between two bounds, which are possible themselves.

    Examples
    --------
    >>> Truncated(Uniform(-1.0, 1.0), 0.0, math.inf).quantile(np.array([0.5])).tolist()
    [0.5]
    """

    distribution: Distribution
    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not self.distribution.cdf(self.lower) < self.distribution.cdf(self.upper):
            raise InputError("a truncated distribution", got=f"nothing from {self.lower:g} to {self.upper:g}",
                             allowed="one that reaches into these bounds")

    def quantile(self, p: Array) -> Array:
        """Return the values at probabilities `p`."""
        below, upto = self.distribution.cdf(self.lower), self.distribution.cdf(self.upper)
        drawn: Array = self.distribution.quantile(below + p * (upto - below))
        return np.clip(drawn, self.lower, self.upper)

    def cdf(self, x: float) -> float:
        """Return the probability of a draw of at most `x`."""
        below, upto = self.distribution.cdf(self.lower), self.distribution.cdf(self.upper)
        return min(max((self.distribution.cdf(x) - below) / (upto - below), 0.0), 1.0)


# --- Distributions out of words such as ``normal:10%`` and ``uniform:4us..8us`` ---------------------------------------

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
