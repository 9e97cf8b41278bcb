"""The paper's control circuit at a bench: a program that reads its command off the supply of the servo."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from servotwin.bench import INPUT_CONVERTER, ControlSupply, PulseGenerator
from servotwin.web.live.rules import checked
from servotwin.web.live.said import CONTROL

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
    found: dict[str, float] = checked(CONTROL, value)
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
