"""The paper's servo: mean armature voltage proportional to the error, Coulomb friction smoothed by tanh."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast, final

import numpy as np

from servotwin.models.base import KINDS, Model, check_accepted, check_sent, check_travel, feedback_line, solved
from servotwin.models.terms import packing, wiring
from servotwin.models.terms.wiring import Line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal

_REQUIRES = (
    "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
    "motor.motor_viscous_friction", "gear.gear_reduction",
    "friction.coulomb_torque_forward", "friction.coulomb_torque_backward", "friction.zero_crossing_slope",
    "electronics.bridge_gain", "electronics.comparator_gain", "electronics.voltage_to_pulse_gain",
    "electronics.pulse_to_voltage_gain", "potentiometer.feedback_gain",
)
_SIGNALS = (
    "command_voltage", "command_angle", "pulse_width", "armature_voltage", "armature_current", "motor_angle",
    "motor_speed", "motor_torque", "output_angle", "output_speed", "load_torque", "feedback_voltage",
)


class _Averaged(Model):
    """The common part of the two averaged servos: (38) with offsets, (41), and the command chain."""

    optional = ("electronics.command_offset", "electronics.command_pulse_offset", "electronics.pulse_width_min",
                "electronics.pulse_width_max", "potentiometer.feedback_offset", "gear.output_inertia")
    signals = _SIGNALS

    def pack(self, load: Load) -> Numbers:
        """Return the plant at the output shaft."""
        return cast("Numbers", self.made_of(packing.averaged, self.hung(load)))

    def _line(self, kind: str) -> Line:
        """Return how the control voltage [V] follows a command of this kind."""
        if kind == "angle":
            return feedback_line(self)
        law = wiring.averaged_by_voltage if kind == "voltage" else wiring.averaged_by_pulse
        return cast("Line", self.made_of(law))

    def command(self, signal: Signal) -> Pieces:
        """Return v_c [V]: k_p v_i + b_i of a voltage, k_p2 (t_a − t_0) + b_i of a pulse, p q* + b_o of an angle.

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
        """Return the angle without error, (v_c − b_o)/p [rad]."""
        angle: float = solved(feedback_line(self), drive)
        return angle


@final
class AveragedServo(_Averaged):
    """The paper's model, eq. (35)-(41) with the offsets of the measured servo; armature inductance neglected.

    As printed it has no supply: the armature voltage grows with the error without bound. It has no deadband and
    no static friction, so a loaded shaft creeps.

    Examples
    --------
    >>> import servotwin as st
    >>> model = AveragedServo(st.load_servo("hitec-hs-755hb"))
    >>> "supply.open_circuit_voltage" in model.ignored
    True
    """

    requires = _REQUIRES
    layout = ("output_angle", "output_speed")


@final
class AveragedServoInductive(_Averaged):
    """The averaged servo with armature inductance, eq. (27)-(33) and (41), the current as a state.

    The paper's (34) gives the rate of the torque from the third derivative of the angle and cannot be run forward;
    this is the same physics.

    Examples
    --------
    >>> import servotwin as st
    >>> AveragedServoInductive(st.load_servo("hitec-hs-755hb")).layout
    ('output_angle', 'output_speed', 'armature_current')
    """

    requires = (*_REQUIRES, "motor.armature_inductance")
    layout = ("output_angle", "output_speed", "armature_current")
