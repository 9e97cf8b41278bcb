"""The analog servo at pulse level: what its chip measures, decides and drives, frame by frame."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, final

import numpy as np

from servotwin.errors import InputError
from servotwin.models.base import Model, check_travel, check_widths, clipped
from servotwin.models.bounded import BoundedServo
from servotwin.models.kernels.frame import Chip
from servotwin.models.kernels.hybrid import Plant
from servotwin.models.plant import make_plant
from servotwin.physics import electronics, potentiometer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from servotwin.loads import Load
    from servotwin.physics.pieces import Pieces
    from servotwin.signals import Signal


def _edges_first(timeout: Any, period: Any) -> Any:
    """Return a timeout, longer by 1e-11 where it is a whole number of frames.

    The edge that comes as it runs out then restarts the clock, whichever way k T_f is rounded.
    """
    if np.ndim(timeout) == 0 and math.isinf(timeout):
        return timeout
    frames = np.maximum(np.round(timeout / period), 1.0)
    longer = np.where(abs(timeout - frames * period) <= 1e-9 * period, timeout * (1.0 + 1e-11), timeout)
    return longer if longer.ndim else float(longer)


@final
class PulseServo(Model):
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

    requires = (
        "motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant", "motor.rotor_inertia",
        "motor.motor_viscous_friction", "gear.gear_reduction",
        "friction.coulomb_torque_forward", "friction.coulomb_torque_backward",
        "electronics.stretcher_gain", "electronics.one_shot_slope",
        "potentiometer.feedback_gain", "supply.open_circuit_voltage",
    )
    optional = (
        "motor.brush_drop_voltage", "gear.output_inertia", "friction.breakaway_ratio",
        "electronics.frame_period", "electronics.deadband", "electronics.minimum_drive_time",
        "electronics.stretcher_time_constant", "electronics.off_state", "electronics.one_shot_offset",
        "electronics.back_emf_injection", "electronics.supply_coupling", "electronics.pulse_timeout",
        "electronics.pulse_width_min", "electronics.pulse_width_max",
        "electronics.voltage_to_pulse_gain", "electronics.command_pulse_offset",
        "potentiometer.feedback_offset", "potentiometer.noise",
        "supply.internal_resistance", "supply.bridge_drop_voltage", "supply.bridge_drop_resistance",
        "stops.lower_angle", "stops.upper_angle", "stops.restitution",
    )
    layout = ("output_angle", "output_speed")
    signals = (
        "command_voltage", "command_angle", "pulse_width", "error_time", "drive", "armature_voltage",
        "armature_current", "motor_angle", "motor_speed", "motor_torque", "output_angle", "output_speed",
        "load_torque", "feedback_voltage", "bus_voltage", "supply_current",
    )

    @property
    def frame_period(self) -> float:
        """T_f of a command that does not bring its own [s]; 20 ms unless the servo gives it."""
        return self.value_or("electronics.frame_period", 0.02)

    def _coasts(self) -> Any:
        """Return 1 where the bridge opens between drives, 0 where it brakes."""
        off: Any = self.servo.get("electronics.off_state")
        return np.where(off == "coast", 1.0, 0.0) if isinstance(off, np.ndarray) else float(off == "coast")

    def pack(self, load: Load) -> Plant:
        """Return the plant at the output shaft, with the bridge before it."""
        R_a, R_b = self.value("motor.armature_resistance"), self.value_or("supply.internal_resistance", 0.0)
        r_c = self.value_or("supply.bridge_drop_resistance", 0.0)
        V_oc, V_ce0 = self.value("supply.open_circuit_voltage"), self.value_or("supply.bridge_drop_voltage", 0.0)
        V_br = self.value_or("motor.brush_drop_voltage", 0.0)
        coasts = self._coasts()
        return make_plant(
            self, load, reduction=self.value("gear.gear_reduction"),
            friction=(self.value("friction.coulomb_torque_forward"), self.value("friction.coulomb_torque_backward")),
            breakaway=self.value_or("friction.breakaway_ratio", 1.0),
            p=self.value("potentiometer.feedback_gain"), b_o=self.value_or("potentiometer.feedback_offset", 0.0),
            stops=(self.value_or("stops.lower_angle", -math.inf), self.value_or("stops.upper_angle", math.inf)),
            restitution=self.value_or("stops.restitution", 0.0),
            bridge=(V_oc, V_ce0 + V_br, R_a + r_c + R_b, V_br + coasts * (V_oc + V_ce0), R_a + coasts * R_b))

    def chip(self, signal: Signal | None = None) -> Chip:
        """Return the numbers of the frame logic; the frame period is that of the command where it gives one."""
        period = self.frame_period if signal is None or signal.frame_period is None else signal.frame_period
        return Chip(
            T_0=self.value_or("electronics.one_shot_offset", 0.0), slope=self.value("electronics.one_shot_slope"),
            p=self.value("potentiometer.feedback_gain"), b_o=self.value_or("potentiometer.feedback_offset", 0.0),
            beta=self.value_or("electronics.back_emf_injection", 0.0),
            c_s=self.value_or("electronics.supply_coupling", 0.0), noise=self.value_or("potentiometer.noise", 0.0),
            half_deadband=0.5 * self.value_or("electronics.deadband", 0.0),
            K=self.value("electronics.stretcher_gain"), t_min=self.value_or("electronics.minimum_drive_time", 0.0),
            tau_s=self.value_or("electronics.stretcher_time_constant", 0.0),
            shortest=self.value_or("electronics.pulse_width_min", 0.0),
            longest=self.value_or("electronics.pulse_width_max", math.inf),
            timeout=_edges_first(self.value_or("electronics.pulse_timeout", math.inf), period), frame_period=period,
            R_a=self.value("motor.armature_resistance"), R_b=self.value_or("supply.internal_resistance", 0.0),
            V_br=self.value_or("motor.brush_drop_voltage", 0.0), V_oc=self.value("supply.open_circuit_voltage"),
            coast=self._coasts())

    def edges(self, signal: Signal) -> tuple[float, ...] | None:
        """Return when the frames of a command start [s]; None where they come regularly."""
        return None if signal.edges is None else tuple(t for t in signal.edges if t >= 0.0)

    def command(self, signal: Signal) -> Pieces:
        """Return the pulse width t_a [s]: k_p1 v_i + t_0 of a voltage, T_0 + (p q* + b_o)/s_r of an angle.

        Raises
        ------
        CommandError
            If a width is not positive or not shorter than a frame, or an angle outside the travel.
        """
        if signal.kind == "voltage":
            pieces = signal.pieces.scaled(self.value("electronics.voltage_to_pulse_gain"),
                                          self.value_or("electronics.command_pulse_offset", 0.0))
        elif signal.kind == "angle":
            check_travel(signal, self.servo)
            slope = self.value("electronics.one_shot_slope")
            pieces = signal.pieces.scaled(
                slope * self.value("potentiometer.feedback_gain"),
                self.value_or("electronics.one_shot_offset", 0.0)
                + slope * self.value_or("potentiometer.feedback_offset", 0.0))
        else:
            pieces = signal.pieces
        check_widths(signal, pieces, self.chip(signal).frame_period if signal.edges is None else math.inf)
        return pieces

    def command_signal(self, name: str, drive: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `command_voltage`, `command_angle` or `pulse_width` that stand for a pulse width [s]."""
        if name == "pulse_width":
            return drive
        if name == "command_voltage":
            return (drive - self.value_or("electronics.command_pulse_offset", 0.0)) / self.value(
                "electronics.voltage_to_pulse_gain")
        return np.asarray(self._angle_of(drive))

    def _angle_of(self, pulse_width: Any) -> Any:
        """Return the angle [rad] at which the one-shot is as long as this pulse."""
        v_o = electronics.control_voltage_from_pulse(
            pulse_width, self.value("electronics.one_shot_slope"), self.value_or("electronics.one_shot_offset", 0.0))
        return potentiometer.angle_from_voltage(
            v_o, self.value("potentiometer.feedback_gain"), self.value_or("potentiometer.feedback_offset", 0.0))

    def start_angle(self, drive: float) -> float:
        """Return the angle without error, within the stops [rad]."""
        return clipped(self._angle_of(drive), self.value_or("stops.lower_angle", -math.inf),
                       self.value_or("stops.upper_angle", math.inf))

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
            If the bridge coasts between drives: it then has no mean voltage that follows the error.

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
        if self.servo.get("electronics.off_state") == "coast":
            raise InputError("averaged()", got="a bridge that coasts",
                             allowed="one that brakes: without current the mean voltage is the motor's own")
        left_out = [name for name in ("electronics.minimum_drive_time", "electronics.stretcher_time_constant",
                                      "electronics.back_emf_injection") if self.value_or(name, 0.0) != 0.0]
        if left_out:
            warnings.warn(f"{self.servo.name}: the averaged servo leaves out {', '.join(left_out)}", stacklevel=2)
        T_f = self.frame_period if frame_period is None else frame_period
        slope = self.value("electronics.one_shot_slope")
        s_r, T_0 = 1.0 / slope, self.value_or("electronics.one_shot_offset", 0.0)
        gain = electronics.averaged_bridge_gain(
            self.value("supply.open_circuit_voltage"), self.value_or("supply.bridge_drop_voltage", 0.0),
            self.value("electronics.stretcher_gain"), T_f, slope)
        t_0 = self.value_or("electronics.command_pulse_offset", 0.0)
        return BoundedServo(self.servo.replace({
            "electronics.bridge_gain": float(gain), "electronics.comparator_gain": 1.0,
            "electronics.pulse_to_voltage_gain": s_r, "electronics.command_offset": s_r * (t_0 - T_0),
            "electronics.voltage_deadband": s_r * self.value_or("electronics.deadband", 0.0)}))
