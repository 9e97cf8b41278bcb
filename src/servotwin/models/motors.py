"""The paper's first two plants: a DC motor alone, and with a geared load. Their command is the armature voltage."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast, final

from servotwin.errors import CommandError
from servotwin.models.base import Model
from servotwin.models.terms import packing

if TYPE_CHECKING:
    from servotwin.loads import Load
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal

_MOTOR = ("motor.armature_resistance", "motor.armature_inductance", "motor.torque_constant",
          "motor.back_emf_constant", "motor.rotor_inertia", "motor.motor_viscous_friction")


def _armature_voltage(model: Model, signal: Signal) -> Pieces:
    if signal.kind != "voltage":
        raise CommandError(f"command of {type(model).__name__}", got=f"unit {signal.unit}",
                           allowed="V, mV: a motor follows its armature voltage")
    return signal.pieces


@final
class DCMotor(Model):
    """A DC motor with armature inductance, eq. (7)-(15); a load, if any, sits on its own shaft.

    Examples
    --------
    >>> import servotwin as st
    >>> DCMotor(st.load_servo("hitec-hs-755hb")).layout
    ('motor_angle', 'motor_speed', 'armature_current')
    """

    requires = _MOTOR
    layout = ("motor_angle", "motor_speed", "armature_current")
    signals = ("armature_voltage", "armature_current", "motor_angle", "motor_speed", "motor_torque")

    def pack(self, load: Load) -> Numbers:
        """Return the plant at the motor's own shaft."""
        return cast("Numbers", self.made_of(packing.motor_alone, self.hung(load)))

    def command(self, signal: Signal) -> Pieces:
        """Return the armature voltage [V]; other units are refused."""
        return _armature_voltage(self, signal)

    def start_angle(self, drive: float) -> float:
        """Return 0: a motor starts at angle 0."""
        return 0.0


@final
class GearedMotor(Model):
    """A DC motor with a load behind a gear, eq. (16)-(22).

    Examples
    --------
    >>> import servotwin as st
    >>> GearedMotor(st.load_servo("hitec-hs-755hb")).layout
    ('output_angle', 'output_speed', 'armature_current')
    """

    requires = (*_MOTOR, "gear.gear_reduction")
    optional = ("gear.output_inertia",)
    layout = ("output_angle", "output_speed", "armature_current")
    signals = ("armature_voltage", "armature_current", "motor_angle", "motor_speed", "motor_torque",
               "output_angle", "output_speed", "load_torque")

    def pack(self, load: Load) -> Numbers:
        """Return the plant at the output shaft."""
        return cast("Numbers", self.made_of(packing.motor_alone, self.hung(load)))

    def command(self, signal: Signal) -> Pieces:
        """Return the armature voltage [V]; other units are refused."""
        return _armature_voltage(self, signal)

    def start_angle(self, drive: float) -> float:
        """Return 0: a motor starts at angle 0."""
        return 0.0
