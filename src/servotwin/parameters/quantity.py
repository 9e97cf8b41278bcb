"""A parameter with what is known about it: where it comes from, and how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from servotwin.errors import ParameterError

SET_BY_USER = "set by the user"
_SET = "set by "
ORIGINS = ("measured", "identified", "datasheet", "literature", "assumed")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A value in SI with unit, origin, source and spread.

    Parameters
    ----------
    value : float, tuple of float or str
    unit : str
        SI unit; empty for words.
    origin : str
        One of measured, identified, datasheet, literature, assumed.
    source : str, optional
        Where it was read; only what is assumed may lack it.
    std : float, optional
        Standard error, in `unit`.
    lower, upper : float, optional
        Range, in `unit`.

    Raises
    ------
    ParameterError
        If the origin is unknown, a source is missing, or the spread does not fit the value.

    Examples
    --------
    >>> Quantity(value=3.04, unit="ohm", origin="assumed", lower=2.75, upper=3.7).spread
    '2.75 to 3.7'
    """

    value: float | tuple[float, ...] | str
    unit: str
    origin: str
    source: str | None = None
    std: float | None = None
    lower: float | None = None
    upper: float | None = None

    def __post_init__(self) -> None:
        if self.origin not in ORIGINS:
            raise ParameterError("origin", got=self.origin, allowed=", ".join(ORIGINS))
        if not self.source and self.origin != "assumed":
            raise ParameterError(f"source of a value that is {self.origin}", got="none",
                                 allowed="a source; only what is assumed may lack it")
        for name in ("std", "lower", "upper"):
            bound = getattr(self, name)
            if bound is not None and not math.isfinite(bound):
                raise ParameterError(name, got=bound, allowed="a finite number")
        if self.std is not None and (self.std < 0.0 or self.lower is not None or self.upper is not None):
            raise ParameterError("std", got=self.std, allowed="at least 0, and either std or lower and upper")
        if isinstance(self.value, float):
            slack = 1e-12 * abs(self.value)
            if self.lower is not None and self.lower > self.value + slack:
                raise ParameterError("lower", got=self.lower, allowed=f"at most the value {self.value!r}")
            if self.upper is not None and self.upper < self.value - slack:
                raise ParameterError("upper", got=self.upper, allowed=f"at least the value {self.value!r}")

    @property
    def was_set(self) -> bool:
        """Whether a person set it, by `Servo.replace` or `--set`, rather than a file assumed it."""
        return self.origin == "assumed" and self.source is not None and self.source.startswith(_SET)

    @property
    def spread(self) -> str:
        """The spread in words; empty where none is given."""
        if self.std is not None:
            return f"± {self.std:.4g}"
        if self.lower is not None and self.upper is not None:
            return f"{self.lower:z.4g} to {self.upper:z.4g}"
        if self.lower is not None or self.upper is not None:
            return f"from {self.lower:z.4g}" if self.lower is not None else f"up to {self.upper:z.4g}"
        return ""
