"""What a command is moved by, against a deadband that swallows it and against play that it has to cross."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from servotwin.control.controller import ANGLE, Controller, Decision, Measured, check_commands, check_numbers
from servotwin.control.reference import Reference


class SidedState(NamedTuple):
    """What a compensation remembers: its controller's state, and the side on which it is, −1, 0 or +1."""

    controller: Any
    side: Any


@dataclass(frozen=True, kw_only=True)
class _Sided:
    """Moves what a controller commands, or what it is told, to the side to which the reference goes."""

    controller: Controller
    least_speed: Any = 1e-3

    @property
    def period(self) -> float:
        """That of the controller [s]."""
        return self.controller.period

    @property
    def commands(self) -> str:
        """What the controller commands."""
        return self.controller.commands

    @property
    def ahead(self) -> Any:
        """That of the controller [s]."""
        return self.controller.ahead

    def initial(self, measured: Measured, reference: Reference) -> SidedState:
        """Return the state of the controller, and no side."""
        return SidedState(self.controller.initial(measured, reference), 0.0 * reference.angle)

    def _side(self, before: Any, reference: Reference) -> Any:
        """Return to which side the reference goes; while it stands, that to which it went last."""
        speed = reference.speed
        return np.where(np.abs(speed) > self.least_speed, np.sign(speed), before)[()]


@dataclass(frozen=True, kw_only=True)
class DeadbandCompensation(_Sided):
    """Asks for so much more that a servo moves at once: half its deadband, and what it takes to overcome friction.

    command_angle = what the controller asks for + h side, where the side is that to which the reference goes.

    Parameters
    ----------
    controller : Controller
        Commands an angle.
    half_width : float or ndarray
        h; `tuning.lag_angle` computes it [rad].
    least_speed : float or ndarray
        Of a reference that moves; below it the side stays as it was [rad/s].

    Examples
    --------
    >>> from servotwin.control import PlainCommand, Reference
    >>> sends = DeadbandCompensation(controller=PlainCommand(period=0.02), half_width=0.01)
    >>> state = sends.initial({}, Reference(0.0))
    >>> [f"{sends.step(state, Reference(0.5, w), {}).command:g}" for w in (-0.2, 0.0, 0.2)]
    ['0.49', '0.5', '0.51']
    """

    half_width: Any

    def __post_init__(self) -> None:
        check_commands(self.controller, ANGLE, "DeadbandCompensation")
        check_numbers(self, ("half_width", "least_speed"))

    def step(self, state: SidedState, reference: Reference, measured: Measured) -> Decision:
        """Return what the controller asks for, moved to the side."""
        command, inner = self.controller.step(state.controller, reference, measured)
        side = self._side(state.side, reference)
        return Decision(command + self.half_width * side, SidedState(inner, side))


@dataclass(frozen=True, kw_only=True)
class PlayCompensation(_Sided):
    """Tells a controller a reference that is moved by half the play, so that the far side of the play follows it.

    The inverse of a play operator, whose side changes where the reference turns.

    Parameters
    ----------
    controller : Controller
    play : float or ndarray
        b, total. Positive where the angle is measured before the play, as at a motor; negative where it is measured
        behind a play that the shaft does not have, as by a potentiometer on a gear of its own [rad].
    least_speed : float or ndarray
        Of a reference that moves; below it the side stays as it was [rad/s].

    Notes
    -----
    Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, chapter 2.

    Examples
    --------
    >>> from servotwin.control import PlainCommand, Reference
    >>> sends = PlayCompensation(controller=PlainCommand(period=0.02), play=0.02)
    >>> state = sends.initial({}, Reference(0.0))
    >>> [f"{sends.step(state, Reference(0.5, w), {}).command:g}" for w in (-0.2, 0.2)]
    ['0.49', '0.51']
    """

    play: Any

    def __post_init__(self) -> None:
        check_numbers(self, ("play", "least_speed"))

    def step(self, state: SidedState, reference: Reference, measured: Measured) -> Decision:
        """Return what the controller decides of the moved reference."""
        side = self._side(state.side, reference)
        moved = reference._replace(angle=reference.angle + 0.5 * self.play * side)
        command, inner = self.controller.step(state.controller, moved, measured)
        return Decision(command, SidedState(inner, side))
