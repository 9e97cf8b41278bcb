"""What can be done at a bench: command, numbers, a push, frames, registers, torque, the control circuit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from servotwin.errors import InputError
from servotwin.units import is_finite
from servotwin.web.live.commands import checked_command
from servotwin.web.live.control_circuit import checked_control

_MOST_PUSH = 1e3  # N m: beyond any servo
RATES = (1.0, 2000.0)
"""Lowest and highest frame rate of the transmitter [Hz]."""


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
    """Return an action whose value has been looked at; whether a servo takes it, only the servo knows.

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
    if not isinstance(kind, str) or kind not in _CHECKS:
        raise InputError("kind of action", got=kind, allowed=", ".join(_CHECKS))
    if servo is not None and (isinstance(servo, bool) or not isinstance(servo, int) or not 0 <= servo < servos):
        raise InputError("servo of an action", got=servo, allowed=f"a whole number from 0 to {servos - 1}")
    if servo is not None and kind in ("frames", "control"):
        raise InputError("servo of an action", got=servo, allowed="none: all servos hear one transmitter")
    return Action(time, kind, _CHECKS[kind](value), servo)


def _numbers(value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping) or not value:
        raise InputError("numbers to set", got=value, allowed="a table of dotted names and values in SI")
    for name, one in value.items():
        if not isinstance(name, str) or not (is_finite(one) or isinstance(one, str)):
            raise InputError(f"{name}", got=one, allowed="a finite number in SI, or a word")
    return {name: one if isinstance(one, str) else float(one) for name, one in value.items()}


def _push(value: Any) -> float:
    if not (is_finite(value) and abs(value) <= _MOST_PUSH):
        raise InputError("push", got=value, allowed=f"a torque of at most {_MOST_PUSH:g} N m")
    return float(value)


def _frames(value: Any) -> dict[str, float]:
    if not isinstance(value, Mapping) or not value or set(value) - {"rate", "lost"}:
        raise InputError("frames", got=value, allowed="a table of rate [Hz] and lost [share]")
    found = {}
    for name, (low, high) in (("rate", RATES), ("lost", (0.0, 1.0))):
        if name in value:
            if not (is_finite(value[name]) and low <= value[name] <= high):
                raise InputError(f"frames: {name}", got=value[name], allowed=f"a number from {low:g} to {high:g}")
            found[name] = float(value[name])
    return found


def _registers(value: Any) -> dict[str, int]:
    if not isinstance(value, Mapping) or not value:
        raise InputError("registers", got=value, allowed="a table of the maker's names and whole numbers")
    for name, one in value.items():
        if not isinstance(name, str) or not is_finite(one) or one != int(one):
            raise InputError(f"register {name}", got=one, allowed="a whole number")
    return {name: int(one) for name, one in value.items()}


def _torque(value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputError("torque", got=value, allowed="true or false")
    return value


_CHECKS = {"command": checked_command, "set": _numbers, "push": _push, "frames": _frames, "register": _registers,
           "torque": _torque, "control": checked_control}
KINDS = tuple(_CHECKS)
"""Kinds of actions."""
