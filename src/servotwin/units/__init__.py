"""Units at the edge: everything inside is SI, and this is the one place that converts.

A unit belongs to a dimension; a value is converted with one factor (temperatures are given in kelvin only).
"""

from __future__ import annotations

import math
import sys
from numbers import Real
from typing import TypeGuard, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from servotwin.errors import UnitError

_DEG = math.pi / 180.0
# micro sign and Greek mu, ohm sign and Greek omega, both dots, degree and two signs typed for it, square -> as below
_SPELLINGS = str.maketrans({"\u00b5": "u", "\u03bc": "u", "\u2126": "ohm", "\u03a9": "ohm", "\u00b7": " ",
                            "\u22c5": " ", "\u00b0": "deg", "\u00ba": "deg", "\u02da": "deg", "\u00b2": "2"})
_GRAVITY = 9.80665  # standard gravity, m/s^2 (CGPM 1901), for kgf
_POUND, _INCH = 0.45359237, 0.0254  # kg, m: the international pound and inch of 1959

# dimension -> {unit: factor to SI}; the first unit of each is the SI one.
DIMENSIONS: dict[str, dict[str, float]] = {
    "number": {"1": 1.0, "%": 0.01},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "angle": {"rad": 1.0, "deg": _DEG},
    "speed": {"rad/s": 1.0, "deg/s": _DEG, "rpm": math.pi / 30.0},
    "output speed": {"rad/s": 1.0, "deg/s": _DEG},
    "angle per pulse": {"rad/s": 1.0, "deg/us": _DEG * 1e6},
    "inverse speed": {"s/rad": 1.0, "s/deg": 1.0 / _DEG},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
    "resistance": {"ohm": 1.0, "mohm": 1e-3},
    "inductance": {"H": 1.0, "mH": 1e-3, "uH": 1e-6},
    "torque": {"N m": 1.0, "mN m": 1e-3, "N cm": 1e-2, "kgf cm": _GRAVITY * 1e-2, "gf cm": _GRAVITY * 1e-5,
               "ozf in": _POUND / 16 * _GRAVITY * _INCH},
    "torque per current": {"N m/A": 1.0, "mN m/A": 1e-3},
    "voltage per speed": {"V s/rad": 1.0, "mV s/rad": 1e-3, "V/krpm": 0.03 / math.pi},
    "inertia": {"kg m2": 1.0, "g cm2": 1e-7, "kg cm2": 1e-4},
    "torque per speed": {"N m s/rad": 1.0, "mN m s/rad": 1e-3},
    "torque per angle": {"N m/rad": 1.0, "N m/deg": 1.0 / _DEG},
    "inverse angle": {"1/rad": 1.0, "1/deg": 1.0 / _DEG},
    "inverse angle and time": {"1/(rad s)": 1.0},
    "inverse acceleration": {"s2/rad": 1.0},
    "angular acceleration": {"rad/s2": 1.0, "deg/s2": _DEG},
    "rate": {"1/s": 1.0},
    "inverse torque": {"1/(N m)": 1.0},
    "voltage gain": {"V/V": 1.0},
    "time per voltage": {"s/V": 1.0, "ms/V": 1e-3, "us/V": 1e-6},
    "voltage per time": {"V/s": 1.0, "V/ms": 1e3, "mV/us": 1e3},
    "voltage per angle": {"V/rad": 1.0, "mV/deg": 1e-3 / _DEG, "V/deg": 1.0 / _DEG},
    "voltage per count": {"V": 1.0, "mV": 1e-3},
    "mass": {"kg": 1.0, "g": 1e-3, "oz": _POUND / 16, "lb": _POUND},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": _INCH},
    "acceleration": {"m/s2": 1.0},
    "heat capacity": {"J/K": 1.0},
    "thermal resistance": {"K/W": 1.0},
    "temperature": {"K": 1.0},
    "inverse temperature": {"1/K": 1.0, "%/K": 0.01},
    "energy": {"J": 1.0},
    "frequency": {"Hz": 1.0},
}


def si_unit(dimension: str) -> str:
    """Return the SI unit of a dimension, for example ``"ohm"`` for ``"resistance"``.

    Raises
    ------
    UnitError
        If the dimension is not known.

    Examples
    --------
    >>> si_unit("angle")
    'rad'
    """
    return next(iter(_units_of(dimension)))


def factor(unit: str, dimension: str) -> float:
    """Return what a value in `unit` is multiplied by to be in SI; Ω, µ, °, · and ² may be written as such.

    Raises
    ------
    UnitError
        If the unit does not measure this dimension.

    Examples
    --------
    >>> factor("us", "time"), factor("µs", "time")
    (1e-06, 1e-06)
    """
    units = _units_of(dimension)
    if unit in units:
        return units[unit]
    plain = in_letters(unit).replace(" / ", "/") if isinstance(unit, str) else unit
    if plain not in units:
        raise UnitError(f"unit of a {dimension}", got=unit, allowed=", ".join(units))
    return units[plain]


def in_letters(unit: str) -> str:
    """Return a unit with µ, Ω, °, · and ² in letters, blanks and digits.

    Examples
    --------
    >>> in_letters("µs"), in_letters("kg·m²")
    ('us', 'kg m2')
    """
    return unit.translate(_SPELLINGS)


@overload
def to_si(value: float, unit: str, dimension: str) -> float: ...
@overload
def to_si(value: ArrayLike, unit: str, dimension: str) -> float | NDArray[np.float64]: ...
def to_si(value: ArrayLike, unit: str, dimension: str) -> float | NDArray[np.float64]:
    """Convert a number or array from `unit` to SI (same shape).

    Examples
    --------
    >>> to_si(1500.0, "us", "time")
    0.0015
    """
    return _scaled(value, factor(unit, dimension), divide=False)


@overload
def from_si(value: float, unit: str, dimension: str) -> float: ...
@overload
def from_si(value: ArrayLike, unit: str, dimension: str) -> float | NDArray[np.float64]: ...
def from_si(value: ArrayLike, unit: str, dimension: str) -> float | NDArray[np.float64]:
    """Convert a number or array from SI to `unit` (same shape).

    Examples
    --------
    >>> round(from_si(3.141592653589793, "deg", "angle"), 9)
    180.0
    """
    return _scaled(value, factor(unit, dimension), divide=True)


def is_finite(value: object) -> TypeGuard[float]:
    """Return whether it is a finite real number, of Python or NumPy; what is true or false is none.

    Examples
    --------
    >>> [is_finite(value) for value in (1, np.float32(1.0), True, "1", float("nan"), 10**400)]
    [True, True, False, False, False, False]
    """
    try:
        return not isinstance(value, bool) and isinstance(value, (float, Real)) and math.isfinite(value)
    except OverflowError:  # an integer beyond the range of a float
        return False


def is_masked(values: object) -> bool:
    """Tell whether something is an array of numpy's with masked elements, whose hidden numbers would count.

    Examples
    --------
    >>> is_masked(np.ma.array([1.0, 2.0], mask=[False, True])), is_masked([1.0])
    (True, False)
    """
    masked = sys.modules.get("numpy.ma")  # who has made one has loaded it, which takes as long as a first run
    return masked is not None and bool(masked.is_masked(values))


def _scaled(value: ArrayLike, by: float, *, divide: bool) -> float | NDArray[np.float64]:
    x = float(value) if isinstance(value, int | float) else np.asarray(value, dtype=np.float64)
    # Dividing by a whole number keeps decimals exact: 1500 us is 0.0015 s to the last bit.
    inverse = 1.0 / by
    if not divide and by < 1.0 and abs(inverse - round(inverse)) < 1e-9 * inverse:
        return x / float(round(inverse))
    return x / by if divide else x * by


def _units_of(dimension: str) -> dict[str, float]:
    if dimension not in DIMENSIONS:
        raise UnitError("dimension", got=dimension, allowed=", ".join(DIMENSIONS))
    return DIMENSIONS[dimension]
