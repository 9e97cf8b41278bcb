"""The shapes of commands that a bench can be given, each a table of plain values, as signals from a start on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from servotwin import signals
from servotwin.errors import InputError, UnknownNameError
from servotwin.signals import Signal
from servotwin.units import is_finite

UNITS = ("us", "deg", "V")
_PERIODS = 1000  # of a step that repeats: then it stays
MOST_SAMPLES = 200_000  # of a recorded command
_MOST_STEPS = 1000  # of a staircase, one way

FIELDS: dict[str, tuple[str, ...]] = {
    "hold": ("value",),
    "step": ("low", "high", "period"),
    "sine": ("mean", "amplitude", "frequency"),
    "sweep": ("mean", "amplitude", "start_frequency", "end_frequency", "duration"),
    "staircase": ("low", "high", "steps", "dwell"),
    "recorded": ("time", "value", "hold"),
}
"""What each shape is given by, beside its `unit`."""


def checked_command(value: Any) -> dict[str, Any]:
    """Return a command with all its fields and no others, as plain values.

    Raises
    ------
    InputError
        If it is no shape of `FIELDS` in a unit of `UNITS`, or its numbers make no signal.

    Examples
    --------
    >>> checked_command({"shape": "hold", "value": 90, "unit": "deg"})
    {'shape': 'hold', 'unit': 'deg', 'value': 90.0}
    """
    if not isinstance(value, Mapping):
        raise InputError("command", got=value, allowed="a table with a shape, a unit and what the shape is given by")
    shape, unit = value.get("shape"), value.get("unit")
    if not isinstance(shape, str) or shape not in FIELDS:
        raise InputError("shape of a command", got=shape, allowed=", ".join(FIELDS))
    if unit not in UNITS:
        raise InputError("unit of a command", got=unit, allowed=", ".join(UNITS))
    for name in value:
        if name not in ("shape", "unit", *FIELDS[shape]):
            raise UnknownNameError(f"field of a command of shape {shape}", str(name), ("unit", *FIELDS[shape]))
    found = {"shape": shape, "unit": str(unit)} | {name: _field(shape, name, value) for name in FIELDS[shape]}
    command_signal(found, 0.0)
    return found


def command_signal(command: Mapping[str, Any], start: float) -> Signal:
    """Return a command that was checked as a signal that begins at a time [s].

    Examples
    --------
    >>> command = {"shape": "sine", "unit": "us", "mean": 1500.0, "amplitude": 100.0, "frequency": 1.0}
    >>> sine = command_signal(command, 3.0)
    >>> round(1e6 * float(sine(3.25)), 6)
    1600.0
    """
    unit: Any = command["unit"]
    return _SHAPES[command["shape"]](command, unit).delayed(start)


def _hold(command: Mapping[str, Any], unit: str) -> Signal:
    return signals.constant(command["value"], unit=unit)


def _step(command: Mapping[str, Any], unit: str) -> Signal:
    low, high, period = (command[name] for name in FIELDS["step"])
    if period == 0.0:
        return signals.constant(high, unit=unit)
    half = np.arange(2 * _PERIODS + 1)
    return signals.samples(0.5 * period * half, np.where(half % 2 == 0, low, high), unit=unit)


def _sine(command: Mapping[str, Any], unit: str) -> Signal:
    return signals.sine(mean=command["mean"], amplitude=command["amplitude"], frequency=command["frequency"], unit=unit)


def _sweep(command: Mapping[str, Any], unit: str) -> Signal:
    return signals.chirp(**{name: command[name] for name in FIELDS["sweep"]}, unit=unit)


def _staircase(command: Mapping[str, Any], unit: str) -> Signal:
    low, high, steps, dwell = (command[name] for name in FIELDS["staircase"])
    up = np.linspace(low, high, steps + 1)
    values = np.concatenate([up, up[-2::-1]])
    return signals.samples(dwell * np.arange(len(values)), values, unit=unit)


def _recorded(command: Mapping[str, Any], unit: str) -> Signal:
    time = np.asarray(command["time"], dtype=np.float64)
    return signals.samples(time - time[0], command["value"], unit=unit, hold=command["hold"])


_SHAPES = {"hold": _hold, "step": _step, "sine": _sine, "sweep": _sweep, "staircase": _staircase,
           "recorded": _recorded}


def _field(shape: str, name: str, command: Mapping[str, Any]) -> Any:
    what, value = f"{name} of a command of shape {shape}", command.get(name)
    if shape == "recorded":
        return _of_record(what, name, "previous" if name == "hold" and value is None else value, command)
    if name == "steps":
        if isinstance(value, bool) or not isinstance(value, int | float) or not 1 <= value <= _MOST_STEPS \
                or value != math.floor(value):
            raise InputError(what, got=value, allowed=f"a whole number from 1 to {_MOST_STEPS}")
        return int(value)
    if not is_finite(value):
        raise InputError(what, got=value, allowed="a finite number")
    number = float(value)
    if name in ("dwell", "frequency", "start_frequency", "end_frequency", "duration") and number <= 0.0:
        raise InputError(what, got=number, allowed="a positive number")
    if name == "period" and number < 0.0:
        raise InputError(what, got=number, allowed="at least 0; 0: once")
    return number


def _of_record(what: str, name: str, value: Any, command: Mapping[str, Any]) -> Any:
    if name == "hold":
        if value not in ("previous", "linear"):
            raise InputError(what, got=value, allowed="previous, linear")
        return value
    if not isinstance(value, list | tuple) or not 2 <= len(value) <= MOST_SAMPLES:
        got = f"{len(value)} numbers" if isinstance(value, list | tuple) else type(value).__name__
        raise InputError(what, got=got, allowed=f"a list of 2 to {MOST_SAMPLES} numbers")
    if len(value) != len(command.get("time") or ()):
        raise InputError(what, got=f"{len(value)} numbers", allowed="as many as times")
    if not all(is_finite(x) for x in value):
        raise InputError(what, got="something that is no finite number", allowed="finite numbers")
    return [float(x) for x in value]
