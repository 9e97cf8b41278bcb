"""What a column of a table of weights, currents and speeds says: a role, a unit and a factor to SI."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from servotwin import units
from servotwin.errors import InputError
from servotwin.logs.column_values import meaning_of, words_and_unit
from servotwin.units.quantities import bare_unit
from servotwin.units.words import unit_word

LOAD, ARM, CURRENT, SPEED, TIME, SAG, ANGLE, VOLTAGE = (
    "load", "arm", "current", "speed", "time", "sag", "angle", "voltage")
GRAVITY = 9.80665
_WORDS: dict[str, frozenset[str]] = {name: frozenset(words.split()) for name, words in {
    LOAD: "mass masses weight weights load masse gewicht last torque moment drehmoment force kraft",
    ARM: "arm radius drum lever hebel trommel",
    SAG: "sag droop error deviation durchhang abweichung fehler err",
    VOLTAGE: "supply battery bus psu source netzteil vcc volts volt voltage spannung",
}.items()}
_LETTERS = {"g": ("g", "mass"), "n": ("N", "force"), "m": ("m", "length"), "a": ("A", "current"),
            **dict.fromkeys(("oz", "ounce", "ounces"), ("oz", "mass")),
            **dict.fromkeys(("lb", "lbs", "pound", "pounds"), ("lb", "mass")),
            "in": ("in", "length"), "kgf": ("kgf", "force")}
_FORCE = {"N": 1.0, "kgf": GRAVITY}
_OF_LOAD = ("mass", "force", "torque")
_NOT_SUPPLY = frozenset("command cmd target feedback pot poti wiper signal".split())
_TURN = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*_?(?:deg|degrees|°|grad)?", re.IGNORECASE)
_TIME = re.compile(r"(?i)(?<![a-z])(time|zeit|t(?=\d)|s(?=\s*(/|per|pro|_per))|sec|seconds?)")
_MS = re.compile(r"(?i)(?<![a-z])(ms|msec|millis)(?![a-z])")
_LEAST_TURN, _MOST_TURN = 10.0, 360.0  # deg
_LOAD_UNITS = "g, kg, oz, lb, N, kgf cm, N m, N cm"


class Name(NamedTuple):
    """What a name says.

    Parameters
    ----------
    role : str
    unit : str
        As the table has it.
    factor : float
        To SI; of a load that hangs on an arm to newtons, of one that is a torque to N m.
    on_arm : bool
        Whether a load becomes a torque by an arm.
    turn : float
        Of a time: the angle that is turned in it [rad].
    """

    role: str
    unit: str
    factor: float
    on_arm: bool = False
    turn: float = math.nan


def name_of(column: str, below: str = "") -> Name | None:
    """Return what a column's name says; None where it says nothing that a table of loads has.

    Raises
    ------
    InputError
        If it names a load without a unit, or in one that measures no load.

    Examples
    --------
    >>> name_of("mass_g").factor, name_of("load [kgf cm]").on_arm, name_of("time_60deg_s").role, name_of("note")
    (0.00980665, False, 'time', None)
    """
    if (time := _time(column, below)) is not None:
        return time
    words, said = words_and_unit(column, below)
    unit, dimension = unit_word(said) or next(
        (_LETTERS[word] for word in sorted({*words, bare_unit(said)}) if word in _LETTERS), (said, ""))
    if dimension in _OF_LOAD:
        return _load(column, unit, dimension)
    if dimension == "length":
        return Name(ARM, unit, units.factor(unit, dimension)) if words & _WORDS[ARM] else None
    if dimension in (CURRENT, SPEED):
        return Name(dimension, unit, units.factor(unit, dimension))
    if dimension == "voltage":
        meant = not words - {"v"} or (words & _WORDS[VOLTAGE] and not words & _NOT_SUPPLY)
        return Name(VOLTAGE, unit, units.factor(unit, dimension)) if meant else None
    if dimension == "angle":
        found = meaning_of(column, below)
        role = SAG if words & _WORDS[SAG] else ANGLE if found is not None and found.role == "angle" else None
        return None if role is None else Name(role, unit, units.factor(unit, dimension))
    if words and words <= _WORDS[LOAD] | {said.casefold()} and words & _WORDS[LOAD]:
        raise InputError(f"column {column}", got=f"the unit {said}" if said else "no unit",
                         allowed=f"one of {_LOAD_UNITS} in its name, such as mass_g or load [N]")
    return None


def _load(column: str, unit: str, dimension: str) -> Name:
    if dimension == "torque":
        return Name(LOAD, unit, units.factor(unit, dimension))
    factor = _FORCE[unit] if dimension == "force" else units.factor(unit, dimension) * GRAVITY
    return Name(LOAD, unit, factor, on_arm=True)


def _time(column: str, below: str) -> Name | None:
    """Return the time of a turn, such as `time_60deg_s`, `s/60°` or `t60`; None where it is none."""
    turns = [turn for turn in map(float, _TURN.findall(column)) if _LEAST_TURN <= turn <= _MOST_TURN]
    if _TIME.search(column) is None or not turns:
        return None
    angle = turns[0] * math.pi / 180.0
    unit = "ms" if _MS.search(column) or _MS.search(below) else "s"
    return Name(TIME, unit, units.factor(unit, "time"), turn=angle)
