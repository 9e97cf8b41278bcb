"""Values in the unit in which people read them."""

from __future__ import annotations

import math

from servotwin import units

_FOREIGN = ("N cm", "kgf cm", "gf cm", "ozf in", "V/krpm", "min", "%", "%/K", "s/deg", "N m/deg", "V/deg", "rpm",
            "deg/s", "oz", "lb", "in")
_PRINTED = {"ohm": "Ω", "mohm": "mΩ", "us": "µs", "uH": "µH", "us/V": "µs/V", "deg": "°", "1": "",
            "mV/us": "mV/µs", "deg/us": "°/µs",
            "deg/s": "°/s"}


def readable(value: float | str, dimension: str) -> str:
    """Return a value (SI) with the unit in which its number is neither long nor small; a word as it is.

    Examples
    --------
    >>> readable(8e-6, "time"), readable(3.04101, "resistance"), readable("coast", "word")
    ('8 µs', '3.041 Ω', 'coast')
    >>> readable(-0.0, "angle")
    '0°'
    """
    if isinstance(value, str):
        return value
    unit = unit_for(value, dimension)
    text = label_of(unit)
    return f"{units.from_si(value, unit, dimension):z.4g}{'' if text in ('', '°') else ' '}{text}"


def unit_for(value: float, dimension: str) -> str:
    """Return the unit in which a value (SI) is neither long nor small; angles are in degrees.

    Examples
    --------
    >>> unit_for(3.7e-3, "torque per current"), unit_for(1.0, "angle")
    ('mN m/A', 'deg')
    """
    known = [unit for unit in units.DIMENSIONS[dimension] if unit not in _FOREIGN]
    for usual in ("deg", "deg/us"):
        if usual in known:
            return usual
    if dimension == "output speed":  # of a shaft that turns by degrees; motors are read in rad/s
        return "deg/s"
    if not value or not math.isfinite(value):
        return known[0]
    numbers = {unit: abs(units.from_si(value, unit, dimension)) for unit in known}
    return min(known, key=lambda unit: abs(math.log10(numbers[unit]) - 1.0))


def label_of(unit: str) -> str:
    """Return a unit as it is printed.

    Examples
    --------
    >>> label_of("kg m2"), label_of("ohm"), label_of("1")
    ('kg m²', 'Ω', '')
    """
    return _PRINTED.get(unit, unit.replace("m2", "m²"))


def figure_in(value: float, unit: str, dimension: str, *, within: float = math.nan) -> str:
    """Return the number of a value (SI) in a unit, to two digits of what it is uncertain by; else to four digits.

    Parameters
    ----------
    value : float
    unit, dimension : str
        Of `servotwin.units`.
    within : float
        Uncertainty, in the unit of the value (SI); nan or 0 where there is none.

    Examples
    --------
    >>> figure_in(3.7188e-3, "mN m/A", "torque per current", within=2e-5)
    '3.719'
    >>> figure_in(0.0123456, "V", "voltage"), figure_in(float("nan"), "V", "voltage")
    ('0.01235', '–')
    """
    if not math.isfinite(value):
        return "–"
    shown = units.from_si(value, unit, dimension)
    spread = abs(units.from_si(within, unit, dimension)) if math.isfinite(within) else 0.0
    if spread == 0.0 or spread < 1e-6 * abs(shown):
        return f"{shown:z.4g}"
    places = 1 - math.floor(math.log10(spread))
    least = 2 - math.floor(math.log10(abs(shown))) if shown else 0  # never fewer than three digits of the value
    places = max(places, min(least, places + 2), 0)
    text = f"{shown:z.{places}f}"
    return text if len(text) <= 12 else f"{shown:z.4g}"
