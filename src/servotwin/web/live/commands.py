"""The shapes of commands that a bench can be given, each a table of plain values, as signals from a start on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from servotwin import signals
from servotwin.models.engine.live.screen import FIELDS, PERIODS
from servotwin.signals import Signal
from servotwin.web.live.rules import checked
from servotwin.web.live.said import COMMAND


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
    found: dict[str, Any] = checked(COMMAND, value)
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
    half = np.arange(2 * PERIODS + 1)
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

