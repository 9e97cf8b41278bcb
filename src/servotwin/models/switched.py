"""Common parts of servos behind a switched bridge: their states, their potentiometer, commands that come in pulses."""

from __future__ import annotations

import math
from abc import abstractmethod
from bisect import bisect_left
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from servotwin import physics
from servotwin.errors import CommandError, InputError
from servotwin.models.base import Model, Place, check_travel, check_widths, clipped, solved
from servotwin.models.terms import elastic, play, sensor, wiring
from servotwin.models.terms.frame import FRAME
from servotwin.models.terms.given import inertia_on
from servotwin.models.terms.wiring import Line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.models.terms.given import Given, Hung
    from servotwin.models.terms.numbers import Numbers
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal

MOTOR = (
    "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
    "motor.motor_viscous_friction", "gear.gear_reduction", "friction.coulomb_torque_forward",
    "friction.coulomb_torque_backward", "supply.open_circuit_voltage",
)
"""Required numbers of every such servo."""
SHAFT = ("output_angle", "output_speed")
HIDDEN = ("winding_temperature", "housing_temperature", "motor_angle", "motor_speed")
"""States, angle and speed first."""
_HEAT = ("winding_temperature", "housing_temperature")
_NO_PULSES = ("command_voltage", "command_angle")
"""The word for no pulse where the shaft turns without end."""


class SwitchedServo(Model):
    """A servo whose motor hangs behind a switched bridge and which is commanded by pulses."""

    bears_flexible = True

    @staticmethod
    @abstractmethod
    def numbers(given: Given, hung: Hung, error: float) -> Numbers:
        """Return the numbers of the engine, as `terms.packing` makes them."""

    @property
    def available(self) -> tuple[str, ...]:
        """Names of the output signals that can be computed for this servo, `time` apart."""
        absent = (*(() if self.heats else _HEAT), *(_NO_PULSES if self.endless else ()))
        return tuple(name for name in super().available if name not in absent)

    @property
    def heats(self) -> bool:
        """Whether the servo gives what its temperatures depend on."""
        return self.servo.get("thermal.winding_capacity") is not None

    @property
    def states(self) -> tuple[Place, ...]:
        """Which signals are states of this servo, and where the engine keeps them."""
        N = self.value("gear.gear_reduction")
        places = [Place("output_angle", "q", 1.0), Place("output_speed", "w", 1.0)]
        if "armature_current" in self.layout:
            places.append(Place("armature_current", "i", 1.0))
        if self.heats:
            places += [Place("winding_temperature", "T_w", 1.0), Place("housing_temperature", "T_h", 1.0)]
        if self.servo.get("gear.backlash") is not None or self.servo.get("gear.stiffness") is not None:
            places += [Place("motor_angle", "q_m", N), Place("motor_speed", "w_m", N)]
        return tuple(places)

    @property
    def frame_period(self) -> float:
        """T_f of a command that does not bring its own [s]; 20 ms unless the servo gives it."""
        return self.value_or("electronics.frame_period", FRAME)

    def _period(self, signal: Signal | None) -> Any:
        return self.frame_period if signal is None or signal.frame_period is None else signal.frame_period

    def pack(self, load: Load) -> Numbers:
        """Return the plant at the output shaft, with the bridge before it.

        Raises
        ------
        ParameterError, LoadError
            If servo and load do not fit together.
        """
        hung = self.hung(load)
        J_L = self.made_of(inertia_on, hung)
        play.check(self.given, J_L)
        elastic.check(self.given, load, J_L)
        return cast("Numbers", self.made_of(self.numbers, hung, self.standing_error))

    @property
    def standing_error(self) -> Any:
        """The voltage that the potentiometer's table adds where the feedback stands [V]; 0 where it does not."""
        table: list[Any] = [self.servo.get(f"potentiometer.linearity_{name}") for name in ("angle", "error")]
        if not self.endless or None in table:
            return 0.0
        angles, errors = table
        return physics.linearity_error(self.value("potentiometer.fixed_angle"), angles, errors)

    def curve(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return angles [rad] and errors [V] of the potentiometer's linearity table; empty without, or at a stand."""
        if self.endless:
            return (), ()
        angles, errors = (self.servo.get(f"potentiometer.linearity_{name}") for name in ("angle", "error"))
        return (angles, errors) if isinstance(angles, tuple) and isinstance(errors, tuple) else ((), ())

    def edges(self, signal: Signal) -> tuple[float, ...] | None:
        """Return when the frames of a command start [s]; None where they come regularly."""
        return None if signal.edges is None else signal.edges[bisect_left(signal.edges, 0.0):]

    def framed(self, signal: Signal, until: float) -> Signal:
        """Return a command with its pulses one by one as far as `until` [s] where it has silences, else as it is.

        Raises
        ------
        CommandError
            If the model cannot follow it.
        """
        if not signal.silences:
            return signal
        self.command(signal)  # the widths have to fit into the frames that are lost here
        return signal.framed(self._period(signal), until)

    def command(self, signal: Signal) -> Pieces:
        """Return the pulse width t_a [s]: k_p1 v_i + t_0 of a voltage, T_0 + (p q* + b_o)/s_r of an angle.

        Raises
        ------
        CommandError
            If a width is not positive or not shorter than a frame, or an angle outside the travel; if a servo that
            turns without end gets anything but pulses.
        """
        if self.endless and signal.kind != "pulse_width":
            raise CommandError(
                f"{signal.kind} command of {self.servo.name}", got=signal.kind, allowed="pulse commands only: with "
                "potentiometer.fixed_angle it turns without end, and no angle or voltage stands for a speed")
        if signal.kind == "voltage":
            pieces = signal.pieces.scaled(*self._voltage_line())
        elif signal.kind == "angle":
            check_travel(signal, self.servo)
            pieces = signal.pieces.scaled(*self.made_of(wiring.pulse_of_angle))
        else:
            pieces = signal.pieces
        check_widths(signal, pieces, self._period(signal) if signal.edges is None else math.inf)
        return pieces

    def command_signal(self, name: str, drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `command_voltage`, `command_angle` or `pulse_width` that stand for a pulse width [s]."""
        if name == "pulse_width":
            return drive
        if name == "command_voltage":
            return np.asarray(solved(self._voltage_line(), drive))
        return np.asarray(self._angle_of(drive))

    def _voltage_line(self) -> Line:
        """Return how the pulse width [s] follows a voltage command [V]."""
        self.value("electronics.voltage_to_pulse_gain")  # has to be there
        return cast("Line", self.made_of(wiring.pulse_of_voltage))

    def _angle_of(self, pulse_width: Any) -> Any:
        """Return the angle [rad] at which the one-shot is as long as this pulse."""
        v_o = physics.control_voltage_from_pulse(
            pulse_width, self.value("electronics.one_shot_slope"), self.value_or("electronics.one_shot_offset", 0.0))
        return physics.angle_from_voltage(
            v_o, self.value("potentiometer.feedback_gain"), self.value_or("potentiometer.feedback_offset", 0.0))

    @property
    def neutral_pulse(self) -> float:
        """The pulse at which a servo that turns endlessly stands: that of its standing feedback [s].

        Raises
        ------
        InputError
            If the servo does not turn endlessly.
        """
        if not self.endless:
            raise InputError(f"neutral pulse of {self.servo.name}", got="no potentiometer.fixed_angle",
                             allowed="a servo that turns endlessly, such as servo.continuous(...)")
        return float(physics.pulse_width_from_feedback(
            sensor.pack_standing(self.given, self.standing_error).b_o, self.value("electronics.one_shot_slope"),
            self.value_or("electronics.one_shot_offset", 0.0)))

    def start_angle(self, drive: float) -> float:
        """Return the angle without error, within the stops [rad]; 0 of a shaft that turns without end."""
        if self.endless:
            return abs(0.0 * drive)
        angles, errors = self.curve()
        angle = self._angle_of(drive)
        if angles:
            p, b_o = self.value("potentiometer.feedback_gain"), self.value_or("potentiometer.feedback_offset", 0.0)
            angle = physics.angle_from_sensed_voltage(
                physics.feedback_voltage(angle, p, b_o), p, b_o, angles, errors)
        return clipped(angle, self.value_or("stops.lower_angle", -math.inf),
                       self.value_or("stops.upper_angle", math.inf))
