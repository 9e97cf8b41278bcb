"""What a controller is: a plain function of measured signals, with its state in the hands of the one who calls it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from servotwin.control.reference import Reference
from servotwin.errors import InputError
from servotwin.units import is_finite

Measured = Mapping[str, Any]
"""What the sensors show: `time` and signals by name (SI), numbers of one servo or arrays (n,) of joints."""

VOLTAGE, ANGLE = "armature_voltage", "command_angle"
"""What a controller can command: the voltage of the motor [V], past the servo's own loop, or an angle [rad]."""


class Decision(NamedTuple):
    """What a controller has decided: a command [V or rad], and the state to go on from."""

    command: Any
    state: Any


@runtime_checkable
class Controller(Protocol):
    """A frozen object whose numbers are its own; its state pickles, compares, and is passed in and out.

    A controller knows measured signals only, so that the same object runs on `Simulator`, on `ServoDrive` and on
    hardware. All of it is elementwise: numbers of one servo, or arrays (n,) of the joints of a robot.
    """

    @property
    def period(self) -> float:
        """Of its own ticks [s]."""

    @property
    def commands(self) -> str:
        """What its commands are: "armature_voltage" or "command_angle"."""

    @property
    def ahead(self) -> Any:
        """How far ahead it is told the reference: 0, a lead [s], or an array of them."""

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return its state before the first tick."""

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return what to command from now until the next tick."""


@dataclass(frozen=True, kw_only=True)
class PlainCommand:
    """Sends the reference as it is, or a little ahead: what a program without a controller does.

    Parameters
    ----------
    period : float
        Positive [s].
    ahead : float
        By which the reference is sent early, against the lag of the servo [s].

    Examples
    --------
    >>> from servotwin.control import Reference
    >>> PlainCommand(period=0.02).step(None, Reference(0.5), {"time": 0.0})
    Decision(command=0.5, state=None)
    """

    period: float
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)

    @property
    def commands(self) -> str:
        """An angle."""
        return ANGLE

    def initial(self, measured: Measured, reference: Reference) -> None:
        """Return nothing: it remembers nothing."""

    def step(self, state: None, reference: Reference, measured: Measured) -> Decision:
        """Return the angle of the reference."""
        return Decision(reference.angle, None)


def check_period(controller: Any) -> None:
    """Raise InputError unless the period of a controller is a positive number."""
    if not (is_finite(controller.period) and controller.period > 0.0):
        raise InputError(f"period of {type(controller).__name__}", got=controller.period,
                         allowed="a positive number of seconds")


def check_numbers(thing: Any, names: tuple[str, ...], *, positive: bool = False) -> None:
    """Raise InputError unless fields are finite numbers, or arrays of them; positive ones where that is asked for."""
    for name in names:
        try:
            value = np.asarray(getattr(thing, name), dtype=np.float64)
        except (TypeError, ValueError):
            value = np.full((), np.nan)
        if not (np.isfinite(value).all() and (not positive or (value > 0.0).all())):
            raise InputError(f"{name} of {type(thing).__name__}", got=getattr(thing, name),
                             allowed=f"a {'positive' if positive else 'finite'} number, or one for each joint (SI)")


def check_commands(controller: Any, commands: str, what: str) -> None:
    """Raise InputError unless a controller that another one stands on commands what that needs."""
    if getattr(controller, "commands", None) != commands:
        raise InputError(f"controller of {what}", got=getattr(controller, "commands", controller),
                         allowed=f"a controller that commands {commands}")


def clipped(value: Any, lower: Any, upper: Any) -> Any:
    """Return a number, or an array, within bounds.

    Examples
    --------
    >>> clipped(3.0, -1.0, 1.0)
    1.0
    """
    if isinstance(value, float) and isinstance(lower, float) and isinstance(upper, float):
        return min(max(value, lower), upper)  # much faster than an array of one
    return np.clip(value, lower, upper)
