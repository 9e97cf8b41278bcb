"""The inverse servo as feedforward, with a PID beside it or without any feedback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from servotwin.control.controller import VOLTAGE, Decision, Measured, check_commands, check_period, clipped
from servotwin.control.inverse import ServoInverse
from servotwin.control.pid import Pid
from servotwin.control.reference import Reference
from servotwin.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Feedforward:
    """The voltage that the reference takes by (40), and what a PID adds.

    Without a PID it needs no sensor: sent through `AheadOfServo`, the loop inside the servo does the rest.

    Parameters
    ----------
    period : float
        Positive [s].
    inverse : ServoInverse
        Its own numbers.
    load_torque : callable, optional
        External torque [N m] of angle, speed and acceleration of the reference, beside the inertia and damping that the
        inverse knows, such as `LoadModel`.
    feedback : Pid, optional
        Of the same period, that commands a voltage; its bounds are those of the sum.
    ahead : float
        How far ahead it is told the reference [s].

    Raises
    ------
    InputError
        If the feedback commands something else or has another period.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Reference, inverse_of
    >>> inverse = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> moves = Reference(0.5, speed=2.0)
    >>> f"{Feedforward(period=0.02, inverse=inverse).step(None, moves, {}).command:.3f} V"
    '2.849 V'
    """

    period: float
    inverse: ServoInverse
    load_torque: Callable[[Any, Any, Any], Any] | None = None
    feedback: Pid | None = None
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)
        if self.feedback is not None:
            check_commands(self.feedback, VOLTAGE, "Feedforward")
            if self.feedback.period != self.period:
                raise InputError("period of feedback", got=self.feedback.period, allowed=f"{self.period:g} s, as here")

    @property
    def commands(self) -> str:
        """A voltage."""
        return VOLTAGE

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return the state of the PID."""
        return None if self.feedback is None else self.feedback.initial(measured, reference)

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the voltage that the reference takes, and what the PID adds, within its bounds."""
        tau = 0.0 if self.load_torque is None else self.load_torque(*reference[:3])
        v = self.inverse.voltage(reference, tau)
        if self.feedback is None:
            return Decision(clipped(v, -self.inverse.voltage_limit, self.inverse.voltage_limit), None)
        return self.feedback.beside(v, state, reference, measured)
