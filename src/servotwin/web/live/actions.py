"""What can be done at a bench: command, numbers, a push, frames, registers, torque, the control circuit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from servotwin.errors import InputError
from servotwin.units import is_finite
from servotwin.web.live.commands import checked_command
from servotwin.web.live.control_circuit import checked_control
from servotwin.web.live.rules import checked as by_rule
from servotwin.web.live.said import ACTIONS, FOR_ALL


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
    if not isinstance(kind, str) or kind not in ACTIONS:
        raise InputError("kind of action", got=kind, allowed=", ".join(ACTIONS))
    if servo is not None and (isinstance(servo, bool) or not isinstance(servo, int) or not 0 <= servo < servos):
        raise InputError("servo of an action", got=servo, allowed=f"a whole number from 0 to {servos - 1}")
    if servo is not None and kind in FOR_ALL:
        raise InputError("servo of an action", got=servo, allowed="none: all servos hear one transmitter")
    return Action(time, kind, _LOOKS[kind](value) if kind in _LOOKS else by_rule(ACTIONS[kind], value), servo)


_LOOKS = {"command": checked_command, "control": checked_control}  # which make something of it, too
KINDS = tuple(ACTIONS)
"""Kinds of actions."""
