"""Figures as sheets print them: the time for 60 degrees, ranges of pulses, and for which voltage they hold."""

from __future__ import annotations

import math
import re

from servotwin.errors import InputError, UnitError
from servotwin.units import in_letters, to_si
from servotwin.units.quantities import bare_unit, number_and_unit, quantity, unit_named
from servotwin.units.words import UNSIGNED

_VOLTS = rf"(?P<volts>{UNSIGNED})\s*(?i:v|volts?)(?i:\s*(?:dc))?(?i:[\s,]*(?:no|without)[\s-]*load)?"
# behind the figure, in brackets or not, and in front of it: "(6V)", "@(6.8 V)", "at 6v", "6.0 V", "6V: ..."
_VOLTAGES = (re.compile(rf"\s*(?P<figure>\S.*?)\s*@?\s*[(\[]\s*(?:@|(?i:at)\b)?\s*{_VOLTS}\s*[)\]]\s*"),
             re.compile(rf"\s*(?P<figure>\S.*?)(?:\s*@|\s+(?i:at)\b|\s)\s*{_VOLTS}\s*"),
             re.compile(rf"\s*{_VOLTS}\s*[:=]\s*(?P<figure>\S.*?)\s*"))


def speed(option: str, text: str) -> float:
    """Return a speed in rad/s; sheets print the time for 60 degrees.

    Raises
    ------
    InputError
        If it is no positive number with a unit of speed.

    Examples
    --------
    >>> round(speed("--speed", "0.23 s/60deg"), 3), round(speed("--speed", "60 rpm"), 3)
    (4.553, 6.283)
    >>> round(speed("--speed", "0.23s/60"), 3), round(speed("--speed", "60 degrees in 0.23 sec"), 3)
    (4.553, 4.553)
    """
    allowed = "0.23 s/60deg, or a number with deg/s, rad/s or rpm"
    plain = re.sub(r"\s+(?:per|in)\s+", "/", text)
    number, unit = number_and_unit(plain) or (math.nan, "")
    turned = re.fullmatch(rf"deg(?:rees?)?/({UNSIGNED})s(?:ecs?|econds?)?", re.sub(r"\s", "", in_letters(unit)).lower())
    try:
        if re.fullmatch(r"s(ecs?|econds?)?/60(deg(rees?)?)?", bare_unit(unit)):
            value = math.pi / 3.0 / number if number else math.nan
        elif turned:
            value = math.radians(number) / float(turned[1]) if float(turned[1]) else math.nan
        else:
            value = to_si(number, unit_named(unit, "speed"), "speed")
    except UnitError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise InputError(option, got=text, allowed=allowed)
    return value


def rate(option: str, text: str) -> float:
    """Return an angle per pulse width in rad/s.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> [round(rate("--rate", text)) for text in ("0.1 deg/us", "45deg/400us")]
    [1745, 1963]
    """
    found = re.fullmatch(rf"\s*\+?({UNSIGNED})\s*deg(?:rees?)?\s*/\s*(\d+(?:\.\d+)?)?\s*us(?:ec)?\s*",
                         in_letters(text))
    if found is None or not float(found[1]) > 0.0 or not float(found[2] or 1.0) > 0.0:
        raise InputError(option, got=text, allowed="0.1 deg/us or 45 deg/400us")
    return math.radians(float(found[1])) / (float(found[2] or 1.0) * 1e-6)


def two_ends(option: str, text: str, dimension: str) -> tuple[float, float]:
    """Return the two ends of a range of pulse widths [s] or of voltages [V]: dimension "time" or "voltage".

    Raises
    ------
    InputError
        If there are not two, with a unit.

    Examples
    --------
    >>> two_ends("--pulse-range", "556-2410 us", "time"), two_ends("--voltage-range", "4.8V~7.2V", "voltage")
    ((0.000556, 0.00241), (4.8, 7.2))
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(us|ms|mV|V)?\s*(?:-|to|:|\.\.|\u2013|~)\s*"
                         r"(\d+(?:\.\d+)?)\s*([^\W\d]+)\s*", in_letters(text))
    if found is None:
        raise InputError(option, got=text, allowed={
            "time": "two pulse widths with a unit, such as 500-2500 us",
            "voltage": "two voltages with a unit, such as 4.8-7.2 V"}[dimension])
    return (quantity(option, f"{found[1]} {found[2] or found[4]}", dimension, positive=True),
            quantity(option, f"{found[3]} {found[4]}", dimension, positive=True))


def ratio(option: str, text: str) -> float:
    """Return a gear ratio, motor turns for one turn of the output.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> ratio("--gear-ratio", "280:1"), ratio("--gear-ratio", "1/310")
    (280.0, 310.0)
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(?:[:/]\s*(\d+(?:\.\d+)?))?\s*", text)
    one, two = (float(found[1]), float(found[2] or 1.0)) if found else (0.0, 0.0)
    if not (one > 0.0 and two > 0.0):
        raise InputError(option, got=text, allowed="motor turns for one turn of the output, such as 280 or 280:1")
    return max(one, two) / min(one, two)


def without_voltage(option: str, text: str, usual: float | None) -> tuple[str, float]:
    """Return a figure's text without its voltage, and the voltage [V].

    Parameters
    ----------
    option, text : str
    usual : float, optional
        Voltage of a figure that names none [V].

    Raises
    ------
    InputError
        If there is no voltage, or one that is none.

    Examples
    --------
    >>> without_voltage("--torque", "1.29 N m @ 6.0", None), without_voltage("--torque", "13 kgf.cm at 6V", None)
    (('1.29 N m', 6.0), ('13 kgf.cm', 6.0))
    >>> without_voltage("--speed", "0.17sec/60degree (6v, no load)", None)
    ('0.17sec/60degree', 6.0)
    """
    for form in _VOLTAGES:
        found = form.fullmatch(text)
        if found is not None:
            return found["figure"], quantity(option, f"{found['volts']} V", "voltage", positive=True)
    front, at, back = (part.strip() for part in re.sub(r"\s+at\s+", "@", text, count=1).partition("@"))
    if not at:
        if usual is None:
            raise InputError(option, got=text, allowed="also the supply voltage that it holds for, such as "
                             f'"{text} @6.0V", or --at VOLTAGE for all')
        return front, usual
    return front, quantity(option, back, "voltage", bare=True, positive=True)
