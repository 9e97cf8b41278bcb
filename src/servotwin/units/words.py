"""Units as people write them in the names of columns."""

from __future__ import annotations

import re

from servotwin.errors import UnitError
from servotwin.units import in_letters

COUNTS = "counts"  # what an analog-digital converter or an encoder gives: no unit before it is calibrated

# dimension -> {unit: how it is written, in small letters}
_WORDS: dict[str, dict[str, str]] = {
    "time": {"s": "s sec secs second seconds sek sekunde sekunden", "min": "min minutes",
             "ms": "ms msec msecs milli millis millisec millisecs millisecond milliseconds millisekunden",
             "us": "us usec usecs micro micros microsec microsecs microsecond microseconds mikrosekunden",
             "ns": "ns nsec nsecs nanos nanosecond nanoseconds nanosekunden"},
    "angle": {"deg": "deg degs degree degrees grad", "rad": "rad rads radian radians radiant"},
    "speed": {"deg/s": "deg/s dps deg/sec deg_per_s deg_per_sec degrees/s grad/s deg_s",
              "rad/s": "rad/s rad/sec rad_per_s rad_per_sec rad_s", "rpm": "rpm 1/min u/min upm"},
    "voltage": {"V": "v volt volts", "mV": "mv millivolt millivolts"},
    "current": {"A": "a amp amps ampere amperes", "mA": "ma milliamp milliamps milliampere milliamperes"},
    "torque": {"N m": "nm newtonmeter", "mN m": "mnm", "N cm": "ncm", "kgf cm": "kgcm kgfcm", "gf cm": "gfcm",
               "ozf in": "ozfin ozin ozinch ozfinch"},
    "temperature": {"K": "k kelvin"},
    "frequency": {"Hz": "hz hertz"},
    "mass": {"kg": "kg kilogram kilograms kilogramm kilos", "g": "g gram grams gramm"},
    "length": {"m": "m meter", "cm": "cm", "mm": "mm"},
    "number": {"%": "% pct percent prozent"},
    COUNTS: {COUNTS: "counts count cnt adc raw lsb tick ticks digit digits steps"},
}
_UNITS = {word: (unit, dimension) for dimension, units in _WORDS.items() for unit, words in units.items()
          for word in words.split()}
UNSIGNED = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"  # a number
_FORM = re.compile(rf"\s*(?P<sign>[+-]?)\s*(?P<over>{UNSIGNED})?(?:\s*/\s*(?P<under>{UNSIGNED}))?\s*\*?\s*"
                   rf"(?P<unit>[^\s\d+*-][^+*-]*?)\s*(?P<offset>[+-]\s*{UNSIGNED})?\s*")


def unit_word(word: str) -> tuple[str, str] | None:
    """Return the unit that a word means, and its dimension; None where it means none.

    Examples
    --------
    >>> unit_word("µs"), unit_word("Degrees"), unit_word("kg"), unit_word("horn")
    (('us', 'time'), ('deg', 'angle'), ('kg', 'mass'), None)
    """
    plain = in_letters(word.strip()).casefold()
    found = _UNITS.get(plain) or _UNITS.get(plain.replace(" per ", "/").replace(" / ", "/")) or _UNITS.get(
        plain.replace(" ", "_"))  # the "deg s" of "speed_deg_s"
    return found or _UNITS.get(plain.replace(" ", ""))


def is_unit(text: str) -> bool:
    """Return whether a text is a unit, in brackets or not."""
    return unit_word(text.strip().strip("[](){}")) is not None


def units_written(dimension: str) -> str:
    """Return the units of a dimension as they may be written, for messages.

    Examples
    --------
    >>> units_written("current")
    'A, mA'
    """
    return ", ".join(unit.replace(" ", "") for unit in _WORDS[dimension])


def scaled_unit(what: str, text: str) -> tuple[str, str, float, float]:
    """Return unit, dimension, scale and offset of words such as ``deg-90``, ``-deg`` or ``300/1023 deg - 150``.

    A number x of the file means (scale · x + offset) in that unit.

    Raises
    ------
    UnitError
        If the words have another form, or the unit does not exist.

    Examples
    --------
    >>> scaled_unit("angle", "-0.5deg+90")
    ('deg', 'angle', -0.5, 90.0)
    """
    form = "[SCALE]UNIT[+OFFSET], such as deg, -deg, deg-90, 0.3deg-90 or 300/1023deg-150"
    match = _FORM.fullmatch(text)
    if match is None:
        raise UnitError(what, got=text, allowed=form)
    found = unit_word(match["unit"])
    if found is None or found[1] == COUNTS or (match["under"] and not match["over"]):
        raise UnitError(what, got=text, allowed=form)
    try:
        scale = float(match["over"] or 1.0) / float(match["under"] or 1.0)
    except ZeroDivisionError:
        scale = 0.0
    offset = float((match["offset"] or "0").replace(" ", ""))
    if not 0.0 < scale < float("inf") or abs(offset) == float("inf"):
        raise UnitError(what, got=text, allowed="a scale that is a finite number, not 0")
    return found[0], found[1], -scale if match["sign"] == "-" else scale, offset


def unit_shown(unit: str, scale: float = 1.0, offset: float = 0.0) -> str:
    """Return a unit with scale and offset as words.

    Examples
    --------
    >>> unit_shown("deg", -1.0, 90.0), unit_shown("deg", 0.25, -128.0), unit_shown("us")
    ('-deg+90', '0.25deg-128', 'us')
    """
    front = "" if scale == 1.0 else "-" if scale == -1.0 else f"{scale:.12g}"
    return f"{front}{unit}" + (f"{offset:+.12g}" if offset else "")
