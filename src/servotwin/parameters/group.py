"""What a parameter group is: a frozen dataclass whose fields say unit, range, meaning and symbol.

They check themselves; a field that is None is absent: the effect is off, or not known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import ParameterError
from servotwin.units import is_finite, si_unit

POSITIVE = "a positive number"
NOT_NEGATIVE = "a number of at least 0"
ANY = "a finite number"
AT_LEAST_ONE = "a number of at least 1"
FRACTION = "a number from 0 to 1"

class Range(NamedTuple):
    """Between which numbers a value has to be."""

    low: float = -math.inf
    high: float = math.inf
    open: bool = False  # whether `low` is not possible itself

    def __call__(self, x: Any) -> Any:
        """Tell whether a number, or each number of a column, is there."""
        return (x > self.low if self.open else x >= self.low) & (x <= self.high)


RULES = {POSITIVE: Range(0.0, open=True), NOT_NEGATIVE: Range(0.0), ANY: Range(), AT_LEAST_ONE: Range(1.0),
         FRACTION: Range(0.0, 1.0)}
"""What numbers each rule allows."""


class Relation(NamedTuple):
    """What has to hold between fields of a group; of columns, lane by lane, or for all lanes alike."""

    what: str
    holds: bool | NDArray[np.bool_]
    got: Any
    allowed: str
    bound: Any = None  # a number that `allowed` ends with

    def check(self) -> None:
        """Raise ParameterError if it does not hold; of columns, for the first such lane."""
        if self.holds is True or np.all(self.holds):
            return
        lane = None
        if any(isinstance(x, np.ndarray) for x in (self.holds, self.got)):
            lane = int(np.argmin(self.holds))  # 0 where what does not hold is the same in all lanes
        got, bound = (_of_lane(x, lane) for x in (self.got, self.bound))
        raise ParameterError(self.what if lane is None else f"{self.what} of lane {lane}", got=got,
                             allowed=self.allowed if bound is None else f"{self.allowed} = {bound!r}")


def _of_lane(value: Any, lane: int | None) -> Any:
    return value[lane].item() if isinstance(value, np.ndarray) else value


class Plausible(NamedTuple):
    """Between which numbers (SI) a parameter of a servo lies, and by what source; others have probably a wrong unit."""

    low: float
    high: float
    source: str


class Basis(NamedTuple):
    """What plausible ranges are taken from."""

    source: str

    def of(self, low: float, high: float) -> Plausible:
        """Return a range (SI) with this source."""
        return Plausible(low, high, self.source)


CATALOG = Basis("the servos of the catalog and about ten times beyond; assumed")
THEORY = Basis("values and priors of the theory pages and about ten times beyond; assumed")
PROGRAMS = Basis("registers and programs of digital and bus servos and about ten times beyond; assumed")
TURNS = Basis("about three turns either way; assumed")
CELSIUS = Basis("temperatures that servos bear; assumed")
SHARE = Basis("a share, by what it means")


def parameter(symbol: str, dimension: str, rule: str, meaning: str, plausible: Plausible) -> Any:
    """Declare a number that may be absent."""
    return field(default=None, metadata={"symbol": symbol, "dimension": dimension, "rule": rule, "meaning": meaning,
                                         "plausible": plausible})


def table(symbol: str, dimension: str, meaning: str, plausible: Plausible) -> Any:
    """Declare a table of numbers that may be absent."""
    return field(default=None, metadata={"symbol": symbol, "dimension": dimension, "rule": "table",
                                         "meaning": meaning, "plausible": plausible})


def choice(options: tuple[str, ...], meaning: str) -> Any:
    """Declare a word out of a few that may be absent."""
    return field(default=None, metadata={"symbol": "", "dimension": "word", "rule": options, "meaning": meaning,
                                         "plausible": None})


@dataclass(frozen=True, kw_only=True)
class Group:
    """Base of all groups: checks every field once, and the relations between fields."""

    title: ClassVar[str]
    less: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Fields of which the first has to be less than the second."""

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if value is not None:
                object.__setattr__(self, f.name, self._checked(f.name, value, f.metadata))
        for relation in self._relations():
            relation.check()

    def _checked(self, name: str, value: Any, metadata: Any) -> Any:
        rule = metadata["rule"]
        what = f"{self.title}.{name}"
        if isinstance(rule, tuple):
            if value not in rule:
                raise ParameterError(what, got=value, allowed=" or ".join(rule))
            return value
        if rule == "table":
            if isinstance(value, np.ndarray) and value.ndim == 1:
                value = value.tolist()
            if not isinstance(value, list | tuple) or not all(is_finite(x) for x in value) or not value:
                unit = si_unit(metadata["dimension"])
                raise ParameterError(what, got=value, allowed=f"a list of finite numbers [{unit}]")
            return tuple(float(x) for x in value)
        if not is_finite(value) or not RULES[rule](float(value)):  # the float is kept, so it is what counts
            raise ParameterError(what, got=value, allowed=f"{rule} [{si_unit(metadata['dimension'])}]")
        return float(value)

    def _relations(self) -> Iterator[Relation]:
        """Return what has to hold between several fields."""
        for pair in self.less:
            yield from self._less(*pair)

    def _only_with(self, name: str, partners: tuple[str, ...]) -> Iterator[Relation]:
        """Yield that a field may be given only where all its partners are."""
        value = getattr(self, name)
        if value is not None and any(getattr(self, partner) is None for partner in partners):
            names = ", ".join(f"{self.title}.{partner}" for partner in partners)
            yield Relation(f"{self.title}.{name}", False, value, f"only together with {names}")

    def _less(self, low: str, high: str) -> Iterator[Relation]:
        a, b = getattr(self, low), getattr(self, high)
        if a is not None and b is not None:
            yield Relation(f"{self.title}.{low}", a < b, a, f"less than {self.title}.{high}", b)


def check_column(what: str, column: NDArray[np.float64], rule: str, unit: str) -> None:
    """Raise ParameterError that names the first lane whose number is not finite or breaks the rule.

    Examples
    --------
    >>> check_column("gear.gear_reduction", np.array([2.0, 1.0]), AT_LEAST_ONE, "1")
    """
    Relation(what, np.isfinite(column) & RULES[rule](column), column, f"{rule} [{unit}]").check()
