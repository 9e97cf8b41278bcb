"""A number with its unit, as people write it on a command line: the one place that reads it."""

from __future__ import annotations

import math
import re
import warnings
from contextlib import suppress

from servotwin.errors import InputError, UnitError
from servotwin.units import DIMENSIONS, in_letters, to_si
from servotwin.units.words import UNSIGNED, unit_word

_FORM = re.compile(rf"\s*([+-]?{UNSIGNED})\s*(.*?)\s*")


def number_and_unit(text: str) -> tuple[float, str] | None:
    """Return a number and what stands behind it; None where no number stands in front.

    Examples
    --------
    >>> number_and_unit("13.2 kgf.cm"), number_and_unit("-3"), number_and_unit("V")
    ((13.2, 'kgf.cm'), (-3.0, ''), None)
    """
    match = _FORM.fullmatch(text)
    return None if match is None else (float(match[1]), match[2])


def bare_unit(unit: str) -> str:
    """Return a unit in small letters, without blanks, dots and dashes.

    Examples
    --------
    >>> bare_unit("Kg-cm"), bare_unit("N·m")
    ('kgcm', 'nm')
    """
    return re.sub(r"[\s.\-*]", "", in_letters(unit)).lower()


def unit_named(unit: str, dimension: str) -> str:
    """Return what `DIMENSIONS` calls a unit: kgf.cm, kg-cm and kgf cm are the same, but mega is not milli.

    A torque that is written as a quotient is read as the product that it can only mean.

    Warns
    -----
    UserWarning
        If a torque is written as a quotient, such as kg/cm.

    Raises
    ------
    UnitError
        If the unit does not measure this dimension.

    Examples
    --------
    >>> unit_named("kg-cm", "torque"), unit_named("Degrees", "angle"), unit_named("µs", "time")
    ('kgf cm', 'deg', 'us')
    """
    known = DIMENSIONS[dimension]
    plain, bare = in_letters(unit).replace(" / ", "/"), bare_unit(unit)
    found = plain if plain in known else _by_letters(bare, dimension)
    quotient = found is None and dimension == "torque" and re.fullmatch(r"[^/]+/[^/]+", bare) is not None
    if quotient:
        found = _by_letters(bare.replace("/", ""), dimension)
    if found is None or (unit.startswith("M") and found.startswith("m")):
        raise UnitError(f"unit of a {dimension}", got=unit, allowed=", ".join(known))
    if quotient:
        warnings.warn(f"read {unit} as {found}", stacklevel=2)
    return found


def _by_letters(bare: str, dimension: str) -> str | None:
    """Return the unit of a dimension that these letters write, None where there is none."""
    known = DIMENSIONS[dimension]
    found = next((name for name in known if bare_unit(name) == bare), None)
    if found is None and (word := unit_word(bare)) is not None and word[0] in known:
        found = word[0]
    return found


def quantity(what: str, text: str, dimension: str, *, bare: bool = False, positive: bool = False) -> float:
    """Return a number with its unit, in SI.

    Parameters
    ----------
    what : str
        Name of the quantity in an error.
    text : str
    dimension : str
        Of `servotwin.units`.
    bare : bool
        Whether a number may stand without a unit, in SI; else a unit is required.
    positive : bool
        Whether it has to be more than 0.

    Raises
    ------
    InputError
        If it is no finite number, or its unit does not fit.

    Examples
    --------
    >>> quantity("--max-error", "180 deg", "angle"), quantity("--leave-out", "3", "time", bare=True)
    (3.141592653589793, 3.0)
    >>> round(quantity("--torque", "13.2 kg-cm", "torque"), 4)
    1.2945
    """
    number, unit = number_and_unit(text) or (math.nan, "")
    value = math.nan
    with suppress(UnitError):
        value = to_si(number, unit_named(unit, dimension), dimension) if unit or not bare else number
    if math.isfinite(value) and (value > 0.0 or not positive):
        return value
    raise InputError(what, got=text, allowed=f"a {'positive ' * positive}number{' in SI, or' * bare} with one of the "
                     "units " + ", ".join(DIMENSIONS[dimension]))
