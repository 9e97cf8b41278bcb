"""Actions at a bench: command, numbers, a push, frames, registers, torque, the control circuit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from servotwin import signals
from servotwin.bench import INPUT_CONVERTER, ControlSupply, PulseGenerator
from servotwin.errors import InputError
from servotwin.models.engine.live.screen import FIELDS, PERIODS
from servotwin.signals import Signal
from servotwin.units import is_finite
from servotwin.web.live.rules import ACTIONS, COMMAND, CONTROL, FOR_ALL
from servotwin.web.live.rules import checked as rules_checked

# --- The shapes of commands that a bench can be given, each a table of plain values, as signals from a start ----------

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
    found: dict[str, Any] = rules_checked(COMMAND, value)
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


# --- The paper's control circuit at a bench: a program that reads its command off the supply of the servo -------------

_GENERATOR = PulseGenerator()


def checked_control(value: Any) -> dict[str, float]:
    """Return numbers of a control circuit, as plain values.

    Raises
    ------
    InputError
        If they are none.

    Examples
    --------
    >>> checked_control({"command_share": 0})
    {'command_share': 0.0}
    """
    found: dict[str, float] = rules_checked(CONTROL, value)
    return found


class ControlCircuit:
    """A program that sends a pulse, waits, reads its command, and makes the next pulse of what it read.

    Parameters
    ----------
    numbers : mapping
        By `CONTROL_FIELDS`; what is left out is as `ControlSupply` has it.
    voltage : float
        The command before anything has moved [V].

    Examples
    --------
    >>> circuit = ControlCircuit({}, 1.425)
    >>> width = circuit.send(0.0)
    >>> round(1e6 * width), round(1e3 * circuit.next_look(0.016), 4)
    (1526, 1.726)
    >>> circuit.look(1.425, sag=0.1)
    >>> round(1e6 * circuit.send(0.016))
    1382
    """

    def __init__(self, numbers: Mapping[str, float], voltage: float) -> None:
        self.numbers = dict(numbers)
        self.width = _GENERATOR.width(INPUT_CONVERTER.count(voltage))
        """Of the next pulse [s]."""
        self._looks = math.inf

    @property
    def longest(self) -> float:
        """From the edge of the longest pulse to when the program looks [s]."""
        return self.longest_with({})

    def longest_with(self, numbers: Mapping[str, float]) -> float:
        """Return the same with other numbers [s]."""
        delay = ControlSupply(**{**self.numbers, **numbers}).sampling_delay
        return _GENERATOR.width(INPUT_CONVERTER.highest) + delay

    @property
    def _supply(self) -> ControlSupply:
        return ControlSupply(**self.numbers)

    def next_look(self, edge: float) -> float:
        """Return when the program looks next, where its next frame begins at `edge` [s]."""
        return self._looks if self._looks < math.inf else edge + self.width + self._supply.sampling_delay

    def send(self, edge: float) -> float:
        """Send a pulse at an edge [s]; return its width [s]."""
        self._looks = edge + self.width + self._supply.sampling_delay
        return self.width

    def look(self, voltage: float, sag: float) -> None:
        """Read the command [V] while the supply has lost a part of its voltage."""
        self.width = _GENERATOR.width(self._supply.count(INPUT_CONVERTER, voltage, sag))
        self._looks = math.inf


# --- Actions at a bench -----------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Action:
    """Something that was done.

    Parameters
    ----------
    time : float
        When [s].
    kind : str
        One of `KINDS`.
    value : object
        Plain values, as `checked` returns them.
    servo : int, optional
        To which servo; None: to all that it fits.
    """

    time: float
    kind: str
    value: Any
    servo: int | None = None

    def row(self) -> list[Any]:
        """Return it as a scene writes it.

        Examples
        --------
        >>> Action(0.5, "push", 0.1).row()
        [0.5, 'push', 0.1]
        """
        return [self.time, self.kind, self.value, *([] if self.servo is None else [self.servo])]


def action_of(row: Any, servos: int) -> Action:
    """Return the action that a row of a scene says.

    Raises
    ------
    InputError
        If it says none.

    Examples
    --------
    >>> action_of([0, "frames", {"rate": 100}], 1).value
    {'rate': 100.0}
    """
    if not isinstance(row, list | tuple) or len(row) not in (3, 4):
        raise InputError("action", got=row, allowed="[time in s, kind, value] or [time in s, kind, value, servo]")
    time, kind, value, *servo = row
    if not (is_finite(time) and time >= 0.0):
        raise InputError("time of an action", got=time, allowed="a number of seconds of at least 0")
    return checked(float(time), kind, value, servo[0] if servo else None, servos)


def checked(time: float, kind: Any, value: Any, servo: Any, servos: int) -> Action:
    """Return an action whose value has been looked at; whether a servo takes it, the servo decides.

    Parameters
    ----------
    time : float
        [s]
    kind, value, servo
        As a page or a file says them.
    servos : int
        How many there are.

    Raises
    ------
    InputError
        If there is no such action.
    """
    if not isinstance(kind, str) or kind not in ACTIONS:
        raise InputError("kind of action", got=kind, allowed=", ".join(ACTIONS))
    if servo is not None and (isinstance(servo, bool) or not isinstance(servo, int) or not 0 <= servo < servos):
        raise InputError("servo of an action", got=servo, allowed=f"a whole number from 0 to {servos - 1}")
    if servo is not None and kind in FOR_ALL:
        raise InputError("servo of an action", got=servo, allowed="none: all servos hear one transmitter")
    return Action(time, kind, _LOOKS[kind](value) if kind in _LOOKS else rules_checked(ACTIONS[kind], value), servo)


_LOOKS = {"command": checked_command, "control": checked_control}  # which make something of it, too
KINDS = tuple(ACTIONS)
"""Kinds of actions."""
