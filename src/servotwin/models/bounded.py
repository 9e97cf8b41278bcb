"""The averaged servo with what a real one cannot do without: supply limit, deadband, sticking, end stops."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, cast, final

import numpy as np

from servotwin import physics
from servotwin.errors import MissingParameterError
from servotwin.models.base import (
    KINDS,
    Model,
    check_accepted,
    check_sent,
    check_travel,
    clipped,
    feedback_line,
    solved,
)
from servotwin.models.terms import packing, wiring
from servotwin.models.terms.wiring import Line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal


@final
class BoundedServo(Model):
    """Mean armature voltage, limited by the supply, with deadband, true sticking and end stops.

    Its command chain needs a calibration: `electronics.one_shot_slope` with `one_shot_offset`, or
    `pulse_to_voltage_gain` with `command_offset`. Where both are given each serves its own kind of command.

    Warns
    -----
    UserWarning
        If the two calibrations differ by more than 1 % of the supply voltage.

    Examples
    --------
    >>> import servotwin as st
    >>> BoundedServo(st.load_servo("hitec-hs-755hb")).layout
    ('output_angle', 'output_speed')
    """

    requires = (
        "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
        "motor.motor_viscous_friction", "gear.gear_reduction",
        "friction.coulomb_torque_forward", "friction.coulomb_torque_backward",
        "electronics.bridge_gain", "electronics.comparator_gain",
        "potentiometer.feedback_gain", "supply.open_circuit_voltage",
    )
    optional = (
        "gear.output_inertia", "potentiometer.feedback_offset",
        "electronics.voltage_deadband", "supply.bridge_drop_voltage", "friction.breakaway_ratio",
        "stops.lower_angle", "stops.upper_angle", "stops.restitution",
        "electronics.voltage_to_pulse_gain", "electronics.command_pulse_offset", "electronics.command_offset",
        "electronics.pulse_to_voltage_gain", "electronics.one_shot_slope", "electronics.one_shot_offset",
        "electronics.pulse_width_min", "electronics.pulse_width_max",
    )
    layout = ("output_angle", "output_speed")
    signals = (
        "command_voltage", "command_angle", "pulse_width", "armature_voltage", "armature_current", "motor_angle",
        "motor_speed", "motor_torque", "output_angle", "output_speed", "load_torque", "feedback_voltage",
    )

    def _prepare(self) -> None:
        given = self.servo.get
        slope, k_p2 = given("electronics.one_shot_slope"), given("electronics.pulse_to_voltage_gain")
        if slope is None and k_p2 is None:
            raise MissingParameterError(type(self).__name__, self.servo.name, [
                "electronics.one_shot_slope (or electronics.pulse_to_voltage_gain)"])

    def _warn(self) -> None:
        given = self.servo.get
        if given("electronics.one_shot_offset") is None and given("electronics.command_offset") is None:
            return
        own = wiring.calibration(self.given)
        for width in (0.5e-3, 2.5e-3):  # s, the range of Table I; between them both are straight
            of_pulse = physics.control_voltage_from_pulse(width, own.slope, own.T_0)
            of_voltage = physics.control_voltage_from_paper_pulse(width, own.k_p2, own.t_0, own.b_i)
            if abs(of_pulse - of_voltage) <= 0.01 * self.value("supply.open_circuit_voltage"):
                continue
            warnings.warn(
                f"{self.servo.name}: at {1e6 * width:.0f} us electronics.one_shot_slope/one_shot_offset give "
                f"{of_pulse:.4g} V and electronics.pulse_to_voltage_gain/command_offset "
                f"{of_voltage:.4g} V; each is used for its own kind of command", stacklevel=3)
            return

    @property
    def voltage_limit(self) -> float:
        """V_max = V_oc − V_ce0 [V]."""
        limit: float = physics.driving_voltage(
            self.value("supply.open_circuit_voltage"), 1.0, self.value_or("supply.bridge_drop_voltage", 0.0))
        return limit

    def pack(self, load: Load) -> Numbers:
        """Return the plant at the output shaft."""
        return cast("Numbers", self.made_of(packing.bounded, self.hung(load)))

    def _line(self, kind: str) -> Line:
        """Return how the control voltage [V] follows a command of this kind."""
        if kind == "angle":
            return feedback_line(self)
        law = wiring.bounded_by_pulse if kind == "pulse_width" else wiring.bounded_by_voltage
        return cast("Line", self.made_of(law))

    def command(self, signal: Signal) -> Pieces:
        """Return v_c [V]: k_p v_i + b_i of a voltage, (t_a − T_0)/one_shot_slope of a pulse, p q* + b_o of an angle.

        Raises
        ------
        CommandError
            If a pulse is one that the chip refuses, an angle is outside the travel, or pulses stay away.
        """
        check_sent(signal, self)
        if signal.kind == "pulse_width":
            check_accepted(signal, self)
        elif signal.kind == "angle":
            check_travel(signal, self.servo)
        return signal.pieces.scaled(*self._line(signal.kind))

    def command_signal(self, name: str, drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `command_voltage`, `command_angle` or `pulse_width` that stand for a control voltage [V]."""
        return np.asarray(solved(self._line(KINDS[name]), drive))

    def start_angle(self, drive: float) -> float:
        """Return the angle without error, (v_c − b_o)/p, within the stops [rad]."""
        q = solved(feedback_line(self), drive)
        return clipped(q, self.value_or("stops.lower_angle", -math.inf), self.value_or("stops.upper_angle", math.inf))


