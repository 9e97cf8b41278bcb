"""Numbers that are fixed together: what is drawn in their place, and how they follow from it.

A servo file states each number with its own spread, but a sheet fixes several of them together: the torque constant
and the gear reduction by their product, the feedback gain and the slope of the one-shot by theirs. Drawn one by one
they make servos that no sheet describes. So a joint draws what is known, and its parameters follow.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from servotwin.parameters import Quantity, Servo
from servotwin.parameters.output_side import OUTPUT_SIDE
from servotwin.studies.kinds import Distribution, Normal, Uniform

Column = NDArray[Any]

TINY = float(np.nextafter(0.0, 1.0))
_SAME = 1e-4  # relative: ends of ranges that a file of six digits gives differ by less
_HOLDS = 0.01  # relative: how well a relation has to hold in the file, for a parameter to follow from it


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """A number that is drawn in place of parameters that follow from it.

    Parameters
    ----------
    dimension : str
        Of `servotwin.units`.
    lower, upper : float
        Least and largest possible value (SI).
    nominal : float
        Of the servo as its file has it (SI).
    spread : Distribution, optional
        What the servo's file states, or what is assumed; None where it is not drawn.
    """

    dimension: str
    lower: float
    upper: float
    nominal: float
    spread: Distribution | None = None


class Joint(ABC):
    """Numbers that are fixed together."""

    coordinates: Mapping[str, Coordinate]
    """What may be drawn, by name."""
    covers: frozenset[str]
    """Dotted names of parameters that follow, so that their own spreads do not count."""

    @abstractmethod
    def follow(self, drawn: Mapping[str, Column]) -> dict[str, Column]:
        """Return the parameters (SI, dotted names) that follow from what is drawn; what follows from nothing is absent.

        Parameters
        ----------
        drawn : mapping of str to ndarray, shape (lanes,)
            All that is drawn, by name (SI).
        """


DIMENSIONS: dict[str, str] = {
    "sheet.no_load_speed": "output speed", "sheet.stall_torque": "torque", "sheet.no_load_current": "current",
    "sheet.gear_efficiency": "number", "sheet.viscous_share": "number",
    "calibration.angle_per_pulse": "angle per pulse", "calibration.zero_pulse": "time",
    **{name: side.dimension for name, side in OUTPUT_SIDE.items()},
}
"""Of everything that a joint may draw, by name."""


def own_spread(quantity: Quantity, factor: float = 1.0) -> Distribution | None:
    """Return the spread that a file states of a number, times a positive factor; None where it states none.

    A standard error is a normal distribution about the value, a range a uniform one; where one bound is given, the
    value is the other.

    Examples
    --------
    >>> own_spread(Quantity(value=3.0, unit="ohm", origin="assumed", upper=4.0))
    Uniform(lower=3.0, upper=4.0)
    """
    value = quantity.value
    if not isinstance(value, float):
        return None
    if quantity.std:
        return Normal(factor * value, factor * quantity.std)
    lower = value if quantity.lower is None else quantity.lower
    upper = value if quantity.upper is None else quantity.upper
    return Uniform(factor * lower, factor * upper) if factor * lower < factor * upper else None


def scaled_spread(quantity: Quantity, partner: Quantity, nominal: float) -> Distribution | None:
    """Return the spread of the product of two numbers of which the first was found from the second.

    Where the range of the first holds that of one over the second, what it has beyond it is that of the product;
    otherwise the product is as uncertain as the first.

    Parameters
    ----------
    quantity, partner : Quantity
        Positive numbers.
    nominal : float
        What the product counts as, in place of the product of the values.

    Returns
    -------
    Distribution or None
        None where nothing is left.

    Examples
    --------
    >>> gain = Quantity(value=0.5, unit="V/rad", origin="assumed", lower=0.36, upper=0.66)
    >>> slope = Quantity(value=1.2, unit="s/V", origin="assumed", lower=1.0, upper=1.5)
    >>> scaled_spread(gain, slope, 600.0)
    Uniform(lower=540.0, upper=660.0)
    """
    value, with_value = quantity.value, partner.value
    if not (isinstance(value, float) and isinstance(with_value, float)) or value == 0.0:
        return None
    if quantity.std:
        return Normal(nominal, abs(nominal / value) * quantity.std)
    low, high = _ends(quantity)
    least, most = _ends(partner)
    ends = low * most, high * least
    if not ends[0] <= 1.0 + _SAME or not ends[1] >= 1.0 - _SAME:
        ends = low, high
    if max(abs(end - 1.0) for end in ends) <= _SAME:
        return None
    return Uniform(*sorted((round(nominal * ends[0], 15), round(nominal * ends[1], 15))))


def _ends(quantity: Quantity) -> tuple[float, float]:
    """Return the ends of a range over the value."""
    value = float(quantity.value)  # type: ignore[arg-type]
    lower = value if quantity.lower is None else quantity.lower
    upper = value if quantity.upper is None else quantity.upper
    return lower / value, upper / value


def number(servo: Servo, name: str, default: float = math.nan) -> float:
    """Return a parameter (SI); the default where the servo does not give it as a number."""
    value = servo.get(name)
    return value if isinstance(value, float) else default


def holds(value: float, law: float) -> bool:
    """Return whether a parameter of the file is what a relation makes of others.

    Examples
    --------
    >>> holds(45.67, 45.675), holds(45.67, 60.0)
    (True, False)
    """
    return math.isfinite(law) and abs(value - law) <= _HOLDS * abs(value)
