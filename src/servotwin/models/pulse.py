"""The analog servo at pulse level: what its chip measures, decides and drives, frame by frame."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, cast, final

from servotwin import physics
from servotwin.errors import InputError
from servotwin.loads import Inertia, as_load
from servotwin.models.bounded import BoundedServo
from servotwin.models.engine.dynamics.currents import stall_current
from servotwin.models.switched import HIDDEN, MOTOR, SHAFT, SwitchedServo
from servotwin.models.terms import bridge, elastic, frame, friction, heat, packing, play, sensor, source, stops
from servotwin.models.terms.frame import Chip
from servotwin.units import is_finite

if TYPE_CHECKING:
    from servotwin.signals import Signal


_REQUIRES = (*MOTOR, "electronics.stretcher_gain", "electronics.one_shot_slope", "potentiometer.feedback_gain")


class _Pulsed(SwitchedServo):
    """The common part of both pulse servos: the chip and the bridge."""

    numbers = staticmethod(packing.pulsed)
    optional = (
        "gear.output_inertia", *elastic.READS, *play.READS, *friction.READS, *frame.READS, *bridge.READS,
        *sensor.READS, *source.READS, *stops.READS, *heat.READS, "electronics.voltage_to_pulse_gain",
        "electronics.command_pulse_offset",
    )
    signals = (
        "command_voltage", "command_angle", "pulse_width", "error_time", "drive", "armature_voltage",
        "armature_current", "motor_angle", "motor_speed", "motor_torque", "output_angle", "output_speed",
        "load_torque", "feedback_voltage", "bus_voltage", "supply_current", "winding_temperature",
        "housing_temperature",
    )

    def chip(self, signal: Signal | None = None) -> Chip:
        """Return the numbers of the frame logic; the frame period is that of the command where it gives one."""
        return cast("Chip", self.made_of(frame.pack, self._period(signal)))

    def check_mean(self, what: str, more: tuple[str, ...] = ()) -> None:
        """Say in one line where pulses have no mean that grows with the error; `what` is it that would need one.

        Raises
        ------
        InputError
            If the bridge coasts between drives: it then has no mean voltage that follows the error.

        Warns
        -----
        UserWarning
            If a minimum drive time, an RC stretcher, a back-EMF injection, or one of `more`, makes the mean another.
        """
        if self.servo.get("electronics.off_state") == "coast":
            raise InputError(f"{what} of {self.servo.name}", got="a bridge that coasts",
                             allowed="one that brakes: without current the mean voltage is the motor's own")
        left_out = [name for name in ("electronics.minimum_drive_time", "electronics.stretcher_time_constant",
                                      "electronics.back_emf_injection", *more) if self.value_or(name, 0.0) != 0.0]
        if left_out:
            warnings.warn(f"{self.servo.name}: {what} leaves out {', '.join(left_out)}: the gain that its pulses have "
                          "in the mean does not hold with it", stacklevel=3)

    def mean_gain(self, frame_period: float | None = None) -> float:
        """Return A k_s [V/V]: the mean voltage behind R_a, at standstill, per volt of error beyond the deadband.

        It is `physics.averaged_bridge_gain` of R_a times the current that a drive sends through the resting motor,
        so that the drops and resistances of supply, bridge and brushes count while the bridge drives.

        Parameters
        ----------
        frame_period : float, optional
            T_f [s]; the servo's own unless given.

        Raises
        ------
        InputError
            If the frame period is not a positive number.
        """
        T_f = self.frame_period if frame_period is None else frame_period
        if not (is_finite(T_f) and T_f > 0.0):
            raise InputError("frame_period", got=T_f, allowed="a positive number [s]")
        plant = self.pack(as_load(Inertia(1.0)))  # which does not count; an elastic gear has to have some
        gain = physics.averaged_bridge_gain(
            self.value("motor.armature_resistance") * stall_current(plant, plant.source.V), 0.0,
            self.value("electronics.stretcher_gain"), T_f, self.value("electronics.one_shot_slope"))
        return float(gain)


@final
class PulseServo(_Pulsed):
    """One-shot, comparator with deadband, pulse stretcher and switched bridge, with friction that truly sticks.

    Every frame the width of the command's pulse is compared with that of a one-shot, which the potentiometer sets. The
    difference, stretched, is how long the bridge drives; then it brakes or coasts until the next decision. Armature
    inductance is neglected. Frames come from the command where it gives their period or their edges, else from
    `electronics.frame_period`.

    Examples
    --------
    >>> import servotwin as st
    >>> result = st.simulate(PulseServo(st.load_servo("hitec-hs-755hb")),
    ...                      st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=1.0)
    >>> bool(55.0 < 57.29578 * result["output_angle"][-1] < 62.0)
    True
    """

    requires = _REQUIRES
    layout = (*SHAFT, *HIDDEN)

    def averaged(self, frame_period: float | None = None) -> BoundedServo:
        """Return the bounded servo that has the mean voltage of this one's pulses.

        Its gain is A k_s = (V_oc − V_ce0) K/(T_f s_r), with k_p2 = s_r, b_t = −s_r T_0 and w_v = s_r w. It is the same
        servo only in the mean: pulses break a friction that their mean does not.

        Parameters
        ----------
        frame_period : float, optional
            T_f [s]; the servo's own unless given.

        Raises
        ------
        InputError
            If the bridge coasts between drives: it then has no mean voltage that follows the error. If the servo turns
            without end, which no mean-voltage servo does.

        Warns
        -----
        UserWarning
            If a minimum drive time, an RC stretcher or a back-EMF injection makes the mean another one.

        Examples
        --------
        >>> import servotwin as st
        >>> model = PulseServo(st.load_servo("hitec-hs-755hb")).averaged()
        >>> round(model.value("electronics.bridge_gain"), 2)
        45.67
        """
        if self.endless:
            raise InputError(f"the averaged servo of {self.servo.name}", got="potentiometer.fixed_angle",
                             allowed="a servo whose potentiometer turns with its shaft")
        self.check_mean("the averaged servo")
        T_f = self.frame_period if frame_period is None else frame_period
        slope = self.value("electronics.one_shot_slope")
        s_r, T_0 = 1.0 / slope, self.value_or("electronics.one_shot_offset", 0.0)
        gain = physics.averaged_bridge_gain(
            self.value("supply.open_circuit_voltage"), self.value_or("supply.bridge_drop_voltage", 0.0),
            self.value("electronics.stretcher_gain"), T_f, slope)
        t_0 = self.value_or("electronics.command_pulse_offset", 0.0)
        return BoundedServo(self.servo.replace({
            "electronics.bridge_gain": float(gain), "electronics.comparator_gain": 1.0,
            "electronics.pulse_to_voltage_gain": s_r, "electronics.command_offset": s_r * (t_0 - T_0),
            "electronics.voltage_deadband": s_r * self.value_or("electronics.deadband", 0.0)},
            source="the mean of the pulses"))


@final
class PulseServoInductive(_Pulsed):
    """The pulse servo with armature inductance: the current is a state and needs time to rise, turn and fade.

    Between drives it freewheels through the diodes of a coasting bridge, back into the supply, or circulates in a
    braking one. A drive against the motion (plugging) draws up to twice the stall current.

    Examples
    --------
    >>> import servotwin as st
    >>> servo = st.load_servo("hitec-hs-755hb").replace({"motor.armature_inductance": 5e-4})
    >>> result = st.simulate(PulseServoInductive(servo), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=0.5)
    >>> bool(1.0 < result.peak("armature_current") < 2.0)
    True
    """

    requires = (*_REQUIRES, "motor.armature_inductance")
    layout = (*SHAFT, "armature_current", *HIDDEN)
