"""Figures as people and sheets write them: a number with a unit, and for which supply voltage it holds."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from servotwin.errors import InputError
from servotwin.units import DIMENSIONS

_DEG = math.pi / 180.0
_G = 9.80665
# Spellings without blanks, dots and dashes, in small letters -> factor to SI
TORQUE = {"nm": 1.0, "mnm": 1e-3, "ncm": 1e-2, "kgfcm": _G * 1e-2, "kgcm": _G * 1e-2, "gfcm": _G * 1e-5,
          "ozfin": 0.0070615518, "ozin": 0.0070615518}
VOLTAGE = {"v": 1.0, "mv": 1e-3}
CURRENT = {"a": 1.0, "ma": 1e-3}
TIME = {"us": 1e-6, "usec": 1e-6, "ms": 1e-3, "s": 1.0}
ANGLE = {"deg": _DEG, "degree": _DEG, "degrees": _DEG, "rad": 1.0}
MASS, LENGTH = DIMENSIONS["mass"], DIMENSIONS["length"]
SECONDS = {"s": 1.0, "ms": 1e-3}
SPEED = {"deg/s": _DEG, "rad/s": 1.0, "rpm": math.pi / 30.0}
_SHOWN = {"nm": "N m", "mnm": "mN m", "ncm": "N cm", "kgfcm": "kgf.cm", "ozfin": "oz.in", "v": "V", "mv": "mV",
          "a": "A", "ma": "mA"}
_HIDDEN = ("kgcm", "ozin", "gfcm", "usec", "degree", "degrees")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SPELLINGS = str.maketrans({"\u00b5": "u", "\u03bc": "u", "\u00b0": "deg", "\u00b7": ".", "\u22c5": ".",
                            "\u00b2": "2"})


def figure(option: str, text: str, known: Mapping[str, float]) -> float:
    """Return a figure in SI.

    Parameters
    ----------
    option : str
        What to call it in an error.
    text : str
        Such as ``"285 mA"``; kgf.cm, kg-cm and kgf cm are the same.
    known : mapping of str to float
        Units and their factors.

    Raises
    ------
    InputError
        If it is no number, not positive, has no unit or another one.

    Examples
    --------
    >>> figure("--stall-current", "285 mA", CURRENT)
    0.285
    >>> round(figure("--torque", "13.2 kg-cm", TORQUE), 4)
    1.2945
    """
    value, unit = _split(option, text, _allowed(known))
    if unit not in known:
        raise InputError(option, got=text, allowed=f"a number with one of the units {_allowed(known)}")
    return value * known[unit]


def with_usual_unit(option: str, text: str, known: Mapping[str, float], usual: str) -> float:
    """Return a figure in SI; a bare number has the usual unit.

    Raises
    ------
    InputError
        As `figure`.

    Examples
    --------
    >>> with_usual_unit("--voltage", "6", VOLTAGE, "V"), with_usual_unit("--time", "300 ms", SECONDS, "s")
    (6.0, 0.3)
    """
    return figure(option, text if re.search(r"[A-Za-z]", text.replace("e", "")) else f"{text} {usual}", known)


def spelled(dimension: str) -> dict[str, float]:
    """Return the units of a dimension as `figure` spells them, with their factors to SI.

    Examples
    --------
    >>> spelled("inertia")
    {'kgm2': 1.0, 'gcm2': 1e-07, 'kgcm2': 0.0001}
    """
    return {_plain(unit): factor for unit, factor in DIMENSIONS[dimension].items()}


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
    """
    allowed = "0.23 s/60deg, or a number with deg/s, rad/s or rpm"
    value, unit = _split(option, text, allowed)
    if re.fullmatch(r"s(ec)?/60(deg(rees?)?)", unit):
        return math.pi / 3.0 / value
    if unit not in SPEED:
        raise InputError(option, got=text, allowed=allowed)
    return value * SPEED[unit]


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
    found = re.fullmatch(rf"\s*({_NUMBER})\s*deg(?:rees?)?\s*/\s*(\d+(?:\.\d+)?)?\s*us(?:ec)?\s*",
                         text.translate(_SPELLINGS))
    if found is None or not float(found[1]) > 0.0 or not float(found[2] or 1.0) > 0.0:
        raise InputError(option, got=text, allowed="0.1 deg/us or 45 deg/400us")
    return float(found[1]) * _DEG / (float(found[2] or 1.0) * 1e-6)


def pulse_range(option: str, text: str) -> tuple[float, float]:
    """Return the two pulse widths of a range [s].

    Raises
    ------
    InputError
        If there are not two, with a unit.

    Examples
    --------
    >>> pulse_range("--pulse-range", "556-2410 us")
    (0.000556, 0.00241)
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(?:us|ms)?\s*(?:-|to|:|\.\.|\u2013)\s*(\d+(?:\.\d+)?\s*\w+)\s*",
                         text.translate(_SPELLINGS))
    if found is None:
        raise InputError(option, got=text, allowed="two pulse widths with a unit, such as 500-2500 us")
    unit = re.sub(r"[\d.\s]", "", found[2])
    return figure(option, f"{found[1]} {unit}", TIME), figure(option, found[2], TIME)


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


def at_voltage(option: str, text: str, usual: float | None) -> tuple[str, float]:
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
    >>> at_voltage("--torque", "1.29 N m @ 6.0", None), at_voltage("--torque", "13 kgf.cm at 6V", None)
    (('1.29 N m', 6.0), ('13 kgf.cm', 6.0))
    """
    front, at, back = (part.strip() for part in re.sub(r"\s+at\s+", "@", text, count=1).partition("@"))
    if not at:
        if usual is None:
            raise InputError(option, got=text, allowed="also the supply voltage that it holds for, such as "
                             f'"{text} @6.0V", or --at VOLTAGE for all')
        return front, usual
    return front, figure(option, back if re.search(r"[A-Za-z]", back) else f"{back} V", VOLTAGE)


def _split(option: str, text: str, allowed: str) -> tuple[float, str]:
    found = re.fullmatch(rf"\s*({_NUMBER})\s*([^\d\s@].*)?", text.translate(_SPELLINGS))
    if found is None:
        raise InputError(option, got=text, allowed=f"a positive number with a unit ({allowed})")
    value = float(found[1])
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(option, got=text, allowed=f"a positive number with a unit ({allowed})")
    return value, _plain(found[2] or "")


def _plain(unit: str) -> str:
    """Return a unit without blanks, dots and dashes, in small letters."""
    return re.sub(r"[\s.\-*]", "", unit).lower()


def _allowed(known: Mapping[str, float]) -> str:
    return ", ".join(_SHOWN.get(unit, unit) for unit in known if unit not in _HIDDEN)
