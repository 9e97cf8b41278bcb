"""Columns that no file holds: times by a rate, and commands that are said: "50Hz", "153deg", "0deg@0s,153deg@0.5s"."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from servotwin import units
from servotwin.errors import InputError, UnitError
from servotwin.logs.columns import COMMANDS, TIME, dimension_of_signal, si_unit_of
from servotwin.units.words import unit_word

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_VALUE = re.compile(rf"\s*({_NUMBER})\s*([^\W\d_]+)\s*(?:@\s*({_NUMBER})\s*([^\W\d_]+)\s*)?")
_KINDS = {dimension_of_signal(name): name for name in COMMANDS}
_HERTZ = {"Hz": 1.0, "hz": 1.0, "kHz": 1e3}


def is_defined(text: str) -> bool:
    """Tell whether words define a column.

    Examples
    --------
    >>> [is_defined(text) for text in ("50Hz", "153deg@0s", "angle", "A0", "2")]
    [True, True, False, False, False]
    """
    return all(match is not None and (match[2] in _HERTZ or unit_word(match[2]) is not None)
               for match in map(_VALUE.fullmatch, text.split(",")))


def checked_definition(what: str, signal: str, text: str) -> tuple[str, str]:
    """Return the signal that words define, and the unit of its numbers.

    Raises
    ------
    InputError
        If they define no time and no command.

    Examples
    --------
    >>> checked_definition("--commanded", "command", "153deg@0s")
    ('command_angle', 'deg')
    >>> checked_definition("--rate", "time", "50Hz")
    ('time', 's')
    """
    if signal == TIME:
        rate_of(what, text)
        return TIME, si_unit_of(TIME)
    found = {_part(what, part)[1] for part in text.split(",")}
    known = {unit_word(unit) for unit in found}
    unit, dimension = next(iter(known)) or ("", "")
    if len(known) > 1 or dimension not in _KINDS:
        raise UnitError(what, got=text, allowed="one unit: us, ms (pulse width), deg, rad (angle) or V, mV (voltage)")
    if signal in COMMANDS and signal != _KINDS[dimension]:
        raise UnitError(what, got=text, allowed=f"a value in {si_unit_of(signal)}")
    times = [_part(what, part)[2] for part in text.split(",")]
    if times[0] > 0.0:
        raise InputError(what, got=text, allowed="what was commanded at the start of the log too, such as "
                         f"0{unit}@0s,{text}")
    if any(later <= time for time, later in pairwise(times)):
        raise InputError(what, got=text, allowed="jumps in the order of their times, such as 0deg@0s,90deg@0.5s")
    return _KINDS[dimension], unit


def rate_of(what: str, text: str) -> float:
    """Return the rows per second that words say [Hz].

    Raises
    ------
    InputError
        If they say none.
    """
    match = _VALUE.fullmatch(text)
    if match is None or match[2] not in _HERTZ or match[3] or not 0.0 < float(match[1]) < 1e7:
        raise InputError(what, got=text, allowed="a rate of rows, such as 50Hz")
    return float(match[1]) * _HERTZ[match[2]]


def defined_times(text: str, count: int) -> NDArray[np.float64]:
    """Return the times of rows at a rate [s].

    Examples
    --------
    >>> defined_times("50Hz", 3).tolist()
    [0.0, 0.02, 0.04]
    """
    return np.asarray(np.arange(count) / rate_of("rate", text))


def defined_commands(signal: str, text: str, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the commands that words say, in SI; times of jumps count from the first row.

    Examples
    --------
    >>> defined_commands("pulse_width", "1500us@0s,1600us@0.05s", np.array([5.0, 5.02, 5.06])).tolist()
    [0.0015, 0.0015, 0.0016]
    """
    parts = [_part("command", part) for part in text.split(",")]
    at = np.array([time_ for _, _, time_ in parts])
    values = units.to_si(np.array([value for value, _, _ in parts]), (unit_word(parts[0][1]) or ("",))[0],
                         dimension_of_signal(signal))
    which = np.searchsorted(at, time - time[0] + 1e-9, side="right") - 1
    return np.asarray(np.asarray(values)[np.maximum(which, 0)])


def _part(what: str, text: str) -> tuple[float, str, float]:
    """Return value, unit and time [s] of one jump; without a time it came before the first row."""
    match = _VALUE.fullmatch(text)
    unit = None if match is None else unit_word(match[2])
    when = None if match is None or match[4] is None else unit_word(match[4])
    if match is None or unit is None or (match[4] is not None and (when is None or when[1] != "time")):
        raise InputError(what, got=text, allowed="a value with its unit, such as 153deg, or jumps such as "
                         "0deg@0s,153deg@0.5s")
    seconds = 0.0 if when is None else float(match[3]) * float(units.factor(when[0], "time"))
    return float(match[1]), match[2], seconds
