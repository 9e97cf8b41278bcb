"""The digital servo: a program that decides on the duty of its bridge, tick by tick."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast, final

import numpy as np

from servotwin.errors import CommandError, MissingParameterError
from servotwin.models.base import check_goals, check_travel, clipped
from servotwin.models.switched import HIDDEN, MOTOR, SHAFT, SwitchedServo
from servotwin.models.terms import duty, elastic, firmware, friction, heat, packing, play, sensor, source, stops
from servotwin.models.terms.firmware import Firmware

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal

_PULSES = ("electronics.one_shot_slope", "potentiometer.feedback_gain")
_OF_PULSES = ("command_voltage", "pulse_width")


@final
class DigitalServo(SwitchedServo):
    """A servo with a microcontroller: counts, filter, dead zone, P, I and D, profile, limits and protections.

    At every tick the program measures the angle, follows its profile to the goal, computes a duty and protects itself;
    the bridge averages its supply by that duty until the next. Commands are pulses, or goals on a bus
    (`firmware.command_kind`). Armature inductance is neglected.

    Raises
    ------
    MissingParameterError
        If the servo lacks a required parameter.

    Examples
    --------
    >>> import servotwin as st
    >>> analog = st.load_servo("hitec-hs-755hb")
    >>> servo = analog.replace({"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0})
    >>> result = st.simulate(DigitalServo(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0)
    >>> bool(55.0 < 57.29578 * result["output_angle"][-1] < 62.0)
    True
    """

    numbers = staticmethod(packing.digital)
    requires = (*MOTOR, "firmware.control_period", "firmware.proportional_gain")
    optional = (
        "gear.output_inertia", *elastic.READS, *play.READS, *friction.READS, *duty.READS, *firmware.READS,
        *sensor.READS, *source.READS, *stops.READS, *heat.READS, *_PULSES, "potentiometer.noise",
        "electronics.one_shot_offset", "electronics.deadband", "electronics.frame_period",
        "electronics.pulse_width_min", "electronics.pulse_width_max", "electronics.voltage_to_pulse_gain",
        "electronics.command_pulse_offset",
    )
    layout = (*SHAFT, *HIDDEN)
    signals = (
        "command_voltage", "command_angle", "pulse_width", "duty", "goal_angle", "reference_angle", "trip", "drive",
        "armature_voltage", "armature_current", "motor_angle", "motor_speed", "motor_torque", "output_angle",
        "output_speed", "load_torque", "feedback_voltage", "bus_voltage", "supply_current", "winding_temperature",
        "housing_temperature",
    )

    @property
    def takes_goals(self) -> bool:
        """Whether commands are goals on a bus, not pulses."""
        return bool(self.servo.get("firmware.command_kind") == "goal")

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the output signals that can be computed for this servo, `time` apart."""
        missing = {"feedback_voltage"} if self.servo.get("potentiometer.feedback_gain") is None else set()
        missing |= set(_OF_PULSES) if self.takes_goals else set()
        goals = {"command_angle"} if self.takes_goals else set()  # given as it is, whatever the shaft does
        shown = {*super().available, *goals}
        return tuple(name for name in self.signals if name in shown and name not in missing)

    def firmware(self, signal: Signal | None = None) -> Firmware:
        """Return the numbers of the program; the frame period is that of the command where it gives one."""
        return cast("Firmware", self.made_of(firmware.pack, self._period(signal)))

    def command(self, signal: Signal) -> Pieces:
        """Return the pulse width t_a [s], or the goal [rad] of a servo on a bus.

        Raises
        ------
        CommandError
            If the servo does not take this kind of command, an angle lies outside the travel or the goals, a pulse
            does not fit into its frame, or a tick lasts longer than that.
        """
        if signal.kind == "angle":
            check_goals(signal, self)
        if self.takes_goals:
            if signal.kind != "angle":
                raise CommandError(f"{signal.kind.replace('_', ' ')} command of {self.servo.name}", got=signal.kind,
                                   allowed="angles: it takes goals on a bus (firmware.command_kind)")
            check_travel(signal, self.servo)
            return signal.pieces
        lacks = [name for name in _PULSES if self.servo.get(name) is None]
        if lacks:
            raise MissingParameterError(f"{type(self).__name__} with pulses", self.servo.name, lacks)
        T_c, T_f = self.value("firmware.control_period"), self._period(signal)
        if signal.edges is None and np.any(T_c > T_f):
            raise CommandError("firmware.control_period", got=f"{1e3 * float(np.max(T_c)):.6g} ms",
                               allowed=f"at most a frame of {1e3 * float(np.min(T_f)):.6g} ms")
        return super().command(signal)

    def framed(self, signal: Signal, until: float) -> Signal:
        """Return a command as its pulses come; on a bus a goal stays over a silence, a time without a write."""
        return signal if self.takes_goals else super().framed(signal, until)

    def start_angle(self, drive: float) -> float:
        """Return the angle without error, within stops and goals [rad]; 0 of a shaft that turns without end."""
        if self.endless:
            return abs(0.0 * drive)
        angle = drive if self.takes_goals else super().start_angle(drive)
        for low, high in (("firmware.lower_goal", "firmware.upper_goal"), ("stops.lower_angle", "stops.upper_angle")):
            angle = clipped(angle, self.value_or(low, -math.inf), self.value_or(high, math.inf))
        return angle

    def command_signal(self, name: str, drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the command as an angle, or what else stands for a pulse width [s]."""
        return drive if self.takes_goals else super().command_signal(name, drive)

    @property
    def most_duty(self) -> Any:
        """The most duty that the bridge gets while nothing has tripped [1]."""
        return np.minimum(self.value_or("firmware.torque_limit", 1.0), self.value_or("firmware.duty_limit", 1.0))

    def loop_stiffness(self) -> Any:
        """Return the stiffness of the loop at rest, within its limits: k_p (V − V_ce0) K_out/R [N m/rad].

        R is R_a + r_c; brushes, dead zone and friction are left out.
        """
        K = self.value("gear.gear_reduction") * self.value("motor.torque_constant")
        R = self.value("motor.armature_resistance") + self.value_or("supply.bridge_drop_resistance", 0.0)
        return self.value("firmware.proportional_gain") * self.driving_voltage * K / R

    @property
    def driving_voltage(self) -> Any:
        """Voltage at the motor per duty: what the bridge leaves of the supply's, V − V_ce0 [V]."""
        return self.value("supply.open_circuit_voltage") - self.value_or("supply.bridge_drop_voltage", 0.0)
