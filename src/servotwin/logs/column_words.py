"""The words of `--columns`: which column is which signal, in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from servotwin.errors import InputError, UnitError, UnknownNameError
from servotwin.logs.columns import CLOCKS, COMMANDS, NAMES, SWITCH, Column, dimension_of_signal
from servotwin.units.words import scaled_unit, units_written

SAID = "--columns"
COMMAND = "command"  # its kind follows from its unit
SHORT = {"pulse": "pulse_width", "angle": "output_angle", "feedback": "feedback_voltage", "current": "supply_current",
         "voltage": "bus_voltage", "speed": "output_speed"}
SIGNALS = ("time", COMMAND, *SHORT, *(name for name in NAMES if name != "time"))
_BARE = re.compile(r"""(\d+):([^\s=:'"]+)(?:\s+|$)""")  # "1:ms": a column by its number, a signal by its unit
_BY_UNIT = {"time": "time", "angle": "angle", "current": "current", "voltage": "voltage", "speed": "speed"}
_FORM = 'SIGNAL=COLUMN:UNIT, such as "time=t:ms angle=pos:deg-90"'
_KINDS = {dimension_of_signal(name): name for name in COMMANDS}
_WORD = re.compile(r"""\s*(?P<signal>[^\s=:'"]+)\s*=\s*
                       (?:"(?P<double>[^"]*)"|'(?P<single>[^']*)'|(?P<bare>[^"'\s].*?))
                       \s*(?::(?P<unit>[^:=]*?))?\s*(?=$|\s[^\s=:'"]+\s*=)""", re.VERBOSE)


class Wanted(NamedTuple):
    """The words on one signal.

    Parameters
    ----------
    signal : str
        Name of a signal, or "command".
    column : str
    unit : str
        With scale and offset, as it was written; empty where none was said.
    """

    signal: str
    column: str
    unit: str


def wanted_columns(words: str | Mapping[str, str] | None, option: str = "--columns") -> dict[str, Wanted]:
    """Return what words such as ``"time=t:ms angle=pos:deg-90"`` say, or a mapping such as ``{"time": "t:ms"}``.

    Raises
    ------
    InputError
        If the words have another form, or name a signal twice or one that does not exist.

    Examples
    --------
    >>> wanted_columns("time=t:ms angle=Pot 1:0.3deg-90 command='a=b'")["output_angle"]
    Wanted(signal='output_angle', column='Pot 1', unit='0.3deg-90')
    """
    if words is None:
        return {}
    if isinstance(words, Mapping):
        given = [_one(option, f"{name}={text}") for name, text in words.items()]
    elif isinstance(words, str):
        given = _all(option, words)
    else:
        raise InputError(option, got=words, allowed=_FORM)
    found: dict[str, Wanted] = {}
    for one in given:
        if one.signal in found:
            raise InputError(option, got=f"{one.signal} twice", allowed="once")
        found[one.signal] = one
    commands = [name for name in (COMMAND, *COMMANDS) if name in found]
    if len(commands) > 1:
        raise InputError(option, got=" and ".join(commands), allowed="one command")
    return found


def _all(option: str, words: str) -> list[Wanted]:
    given, place = [], 0
    words = with_signals(option, words)
    while words[place:].strip():
        match = _WORD.match(words, place)
        if match is None:
            raise InputError(option, got=words[place:].strip(), allowed=_FORM)
        given.append(_wanted(option, match))
        place = match.end()
    if not given:
        raise InputError(option, got="nothing", allowed=_FORM)
    return given


def with_signals(option: str, words: str) -> str:
    """Return words such as ``1:ms 2:deg`` with the signals that their units say.

    The second of two times is a pulse, and so is one in us that is not the first column.

    Examples
    --------
    >>> with_signals("--columns", "1:ms 2:us 3:-deg+90")
    'time=1:ms pulse=2:us angle=3:-deg+90'
    """
    found = _BARE.findall(words)
    if _BARE.sub("", words).strip() or not found:
        return words
    named: list[str] = []
    for number, unit in found:
        dimension = scaled_unit(f"{option} {number}:{unit}", unit)[1]
        if dimension not in _BY_UNIT:
            raise UnitError(f"{option} {number}:{unit}", got=unit, allowed=f"a signal before it: {_FORM}")
        known = dimension == "time" and (any(word.startswith("time=") for word in named)
                                         or (number != "1" and unit.endswith("us") and len(found) > 1))
        named.append(f"{'pulse' if known else _BY_UNIT[dimension]}={number}:{unit}")
    return " ".join(named)


def _one(option: str, word: str) -> Wanted:
    match = _WORD.fullmatch(word)
    if match is None:
        raise InputError(option, got=word, allowed=_FORM)
    return _wanted(option, match)


def _wanted(option: str, match: re.Match[str]) -> Wanted:
    signal = SHORT.get(match["signal"], match["signal"])
    if signal not in SIGNALS:
        raise UnknownNameError(f"signal of {option}", match["signal"], SIGNALS)
    column = next((match[group] for group in ("double", "single", "bare") if match[group] is not None), "").strip()
    if not column:
        raise InputError(option, got=match[0].strip(), allowed=_FORM)
    return Wanted(signal, column, (match["unit"] or "").strip())


def column_said(one: Wanted, column: str, option: str = "--columns") -> tuple[str, Column]:
    """Return the signal and the column of words that say a unit; `column` is the name in the header.

    Raises
    ------
    UnitError
        If the unit does not exist, or does not measure the signal.
    """
    what = f"{option} {one.signal}={one.column}"
    if one.signal == "time" and one.unit in CLOCKS:
        return one.signal, Column(column, one.unit, from_first=True)
    if one.signal == SWITCH:
        raise UnitError(what, got=one.unit, allowed="no unit")
    unit, dimension, scale, offset = scaled_unit(what, one.unit)
    signal = one.signal
    if signal == COMMAND:
        if dimension not in _KINDS:
            raise UnitError(what, got=one.unit, allowed="us, ms, s (pulse width), deg, rad (angle) or V, mV (voltage)")
        signal = _KINDS[dimension]
    if dimension_of_signal(signal) != dimension:
        raise UnitError(what, got=one.unit, allowed=units_written(dimension_of_signal(signal)) + (
            ", iso, clock" if signal == "time" else f"; feedback={one.column}:{one.unit} is the tap of a potentiometer"
            if dimension == "voltage" and dimension_of_signal(signal) == "angle" else ""))
    return signal, Column(column, unit, scale, offset)

