"""How a voltage gets into a servo that takes angles only: about the reference, or about the measured angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from servotwin.control.controller import ANGLE, VOLTAGE, Controller, Decision, Measured, check_commands
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference


@dataclass(frozen=True, kw_only=True)
class AheadOfServo:
    """Asks for the reference plus what a voltage needs of error: the loop inside the servo stays the feedback.

    command_angle = q_r + v_a/(A k_s p) + h sgn(v_a). On the way, the servo's own loop then has the error that it takes
    to move; a controller behind it that measures nothing needs no sensor.

    Parameters
    ----------
    controller : Controller
        Commands a voltage.
    inverse : ServoInverse
        Of which the servo's own loop counts.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Feedforward, Reference, inverse_of
    >>> inverse = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> ahead = AheadOfServo(controller=Feedforward(period=0.02, inverse=inverse), inverse=inverse)
    >>> f"{ahead.step(None, Reference(0.5, speed=2.0), {}).command:.3f} rad"
    '0.656 rad'
    """

    controller: Controller
    inverse: ServoInverse

    def __post_init__(self) -> None:
        check_commands(self.controller, VOLTAGE, type(self).__name__)

    @property
    def period(self) -> float:
        """That of the controller [s]."""
        return self.controller.period

    @property
    def commands(self) -> str:
        """An angle."""
        return ANGLE

    @property
    def ahead(self) -> Any:
        """That of the controller [s]."""
        return self.controller.ahead

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return the state of the controller."""
        return self.controller.initial(measured, reference)

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the angle to ask for."""
        v, state = self.controller.step(state, reference, measured)
        return Decision(self.inverse.command_angle(v, reference.angle, reference.speed), state)


@dataclass(frozen=True, kw_only=True)
class ThroughServo(AheadOfServo):
    """Asks for the measured angle plus what a voltage needs of error: the loop inside the servo is taken out.

    command_angle = q + v_a/(A k_s p) + h sgn(v_a). The servo becomes a source of voltage, as far as the measurement is
    not late: what the shaft moves until the next tick, its own loop takes off. A profile in the servo spoils it.

    Parameters
    ----------
    controller : Controller
        Commands a voltage.
    inverse : ServoInverse
        Of which the servo's own loop counts.
    """

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the angle to ask for."""
        v, state = self.controller.step(state, reference, measured)
        return Decision(self.inverse.command_angle(v, measured["output_angle"]), state)
