"""How a position loop that sets a duty, as in smart servos and in BAM, is written as a pulse servo and as firmware."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Self

from servotwin.errors import InputError, UnknownNameError
from servotwin.units import is_finite

# --- BAM's actuators (github.com/Rhoban/bam) --------------------------------------------------------------------------

_TURN = 2.0 * math.pi
_STS = ("feetech-sts3215",)


@dataclass(frozen=True, kw_only=True)
class BamActuator:
    """What BAM's code says of one actuator.

    Parameters
    ----------
    error_gain : float or None
        Duty per radian and unit of the gain k_P [1/rad]; None if BAM sets a current or a torque, and no duty.
    largest_duty : float
        Most of the supply that the servo gets [1].
    speed : float or None
        At which the goal moves at most, where a file gives no max_velocity [rad/s].
    sets : {"duty", "current", "torque"}
        What its loop sets.
    servos : tuple of str
        How the ids of the catalog begin of which it is the model.
    source : str
        Where BAM's code says it.
    writes : tuple of str
        Which gains of the firmware its recorder writes into the servo, of P, I and D; 0 into I and D. All else is as
        whoever had the servo before left it.
    """

    error_gain: float | None
    largest_duty: float = 1.0
    speed: float | None = None
    sets: str = "duty"
    servos: tuple[str, ...] = ()
    source: str
    writes: tuple[str, ...] = ("P",)


def _driven(sets: str, source: str) -> BamActuator:
    return BamActuator(error_gain=None, sets=sets, source=source, writes=())


# one line here makes an actuator known
BAM_ACTUATORS = {
    "mx64": BamActuator(error_gain=0.158, largest_duty=0.9625, servos=("dynamixel-mx-64",),
                        source="bam/dynamixel/actuator.py, MXActuator: by oscilloscope"),
    "mx106": BamActuator(error_gain=0.158, largest_duty=0.9625, servos=("dynamixel-mx-106",),
                         source="bam/dynamixel/actuator.py, MXActuator: by oscilloscope"),
    "xl320": BamActuator(error_gain=0.05048199, servos=("dynamixel-xl-320",),
                         source="bam/dynamixel/actuator.py, XL320Actuator: by oscilloscope"),
    "xl330": BamActuator(error_gain=4096.0 / _TURN / (256.0 * 885.0), servos=("dynamixel-xl330",),
                         source="bam/dynamixel/actuator.py, XL330Actuator: counts a radian over 256 and 885 steps"),
    "xc330m288t": BamActuator(error_gain=0.00575504, servos=("dynamixel-xc330-m288",),
                              source="bam/dynamixel/actuator.py, an XC330-M288-T at 5.1 V; the manual's P/128 times "
                                     "0.113 %"),
    "sts3215": BamActuator(error_gain=0.166, largest_duty=0.97, speed=3400.0 * _TURN / 4096.0, servos=_STS,
                           source="bam/feetech/actuator.py, STS3215Actuator: by oscilloscope", writes=("P", "D")),
    "waveshare_st3025": BamActuator(error_gain=0.166,
                                    source="bam/waveshare/actuator.py: the STS3215's gain; the duty was not measured"),
    "xl330i": _driven("current", "bam/dynamixel/actuator.py, XL330CurrentActuator"),
    "erob80_50": _driven("current", "bam/erob/actuator.py, ErobActuator with a damping of 1"),
    "erob80_100": _driven("current", "bam/erob/actuator.py, ErobActuator with a damping of 2"),
    "feetech_hls": _driven("current", "bam/feetech_hls/actuator.py, FeetechHLSActuator"),
    "sts3250": _driven("torque", "an older bam/feetech/actuator.py: stiffness and damping"),
    "unitree_go1": _driven("torque", "bam/unitree/actuator.py, UnitreeGo1Actuator"),
}


def bam_actuator(name: str) -> BamActuator:
    """Return what BAM's code knows of an actuator.

    Parameters
    ----------
    name : str
        As BAM's files give it under `actuator`, and its logs under `motor`.

    Raises
    ------
    UnknownNameError
        If BAM has none of that name.

    Examples
    --------
    >>> bam_actuator("sts3215").error_gain, bam_actuator("mx64").largest_duty
    (0.166, 0.9625)
    """
    if name not in BAM_ACTUATORS:
        raise UnknownNameError("actuator of BAM", name, tuple(BAM_ACTUATORS))
    return BAM_ACTUATORS[name]


def writes_gain(motor: object) -> bool:
    """Return whether the gain in a log of BAM is what its recorder wrote into the servo; True of an unknown motor.

    Examples
    --------
    >>> writes_gain("sts3215"), writes_gain("sts3250")
    (True, False)
    """
    return not isinstance(motor, str) or motor not in BAM_ACTUATORS or "P" in BAM_ACTUATORS[motor].writes


def bam_name_of(servo: str) -> str | None:
    """Return what BAM calls a servo of the catalog, None if it has no model of it.

    Examples
    --------
    >>> bam_name_of("feetech-sts3215-7v4"), bam_name_of("hitec-hs-755hb")
    ('sts3215', None)
    """
    return next((name for name, one in BAM_ACTUATORS.items() if servo.startswith(one.servos or ("\0",))), None)

# --- Bam convention ---------------------------------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class BamConvention:
    """Numbers under which a `PulseServo` does what BAM's servo does.

    BAM's servo sets the mean voltage V = V_in clip(k_P g (q* − q), ±1) with firmware gain k_P and error gain g.
    A pulse servo without deadband drives at V_in for K s_µ abs(q* − q) of each frame of T_f, and not beyond its end;
    K = k_P g T_f/s_µ makes the two mean voltages equal. s_µ and the one-shot's offset are free: both are small here, so
    that a decision comes at most 20 µs after its frame starts. One for all: logs and servos have to use the same.

    Parameters
    ----------
    error_gain : float
        g, duty per radian and unit of k_P, in BAM's code and not in its files; the XL330's unless given [1/rad].
    frame_period : float
        T_f, how often the loop looks at the shaft [s].
    pulse_per_angle : float
        s_µ [s/rad].
    centre : float
        Pulse width at angle 0; angles reach from −centre/s_µ to +centre/s_µ, ±10 rad [s].
    largest_duty : float
        Most of the supply that the servo gets, in BAM's code. The firmware has it, the pulse servo not.

    Raises
    ------
    InputError
        If a number is not positive, a pulse is not shorter than its frame, or the duty is more than 1.

    Notes
    -----
    Friction feels pulses and not their mean, and they break it where their mean does not. Beside an integration of
    BAM's law with its published parameters of the XL330, a pendulum lifted at k_P = 100 differs by 44, 11 and 2 mrad
    rms at frames of 5, 1 and 0.2 ms with M6, and by 7, 2 and 0.5 mrad with M1. A shaft without torque coasts in BAM; a
    pulse servo does then what `electronics.silence_state`, or else `electronics.off_state`, says.

    Examples
    --------
    >>> round(BamConvention().stretcher_gain(400), 1), round(BamConvention.of("sts3215").stretcher_gain(32), 6)
    (1151.0, 5312.0)
    """

    error_gain: float = BAM_ACTUATORS["xl330"].error_gain or 0.0
    frame_period: float = 1e-3
    pulse_per_angle: float = 1e-6
    centre: float = 1e-5
    largest_duty: float = 1.0

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if not is_finite(value) or not value > 0.0:
                raise InputError(f"BamConvention({f.name})", got=value, allowed="a positive number")
        if 2.0 * self.centre >= self.frame_period:
            raise InputError("BamConvention(centre)", got=self.centre, allowed="less than half of frame_period")
        if self.largest_duty > 1.0:
            raise InputError("BamConvention(largest_duty)", got=self.largest_duty, allowed="at most 1")

    @classmethod
    def of(cls, actuator: str) -> Self:
        """Return the numbers of one of BAM's actuators, those of `BAM_ACTUATORS`.

        Parameters
        ----------
        actuator : str
            What BAM calls it.

        Raises
        ------
        UnknownNameError
            If BAM has none of that name.
        InputError
            If BAM sets its current or its torque, so that no duty belongs to a gain.
        """
        one = bam_actuator(actuator)
        if one.error_gain is None:
            raise InputError("firmware gain of an actuator of BAM", got=actuator,
                             allowed=f"one whose duty BAM sets; of {actuator} it sets the {one.sets}, and no duty "
                                     "belongs to a gain")
        return cls(error_gain=one.error_gain, largest_duty=one.largest_duty)

    def stretcher_gain(self, gain: float) -> float:
        """Return K for a firmware gain k_P."""
        if not is_finite(gain) or not gain > 0.0:
            raise InputError("firmware gain kp", got=gain, allowed="a positive number")
        return gain * self.error_gain * (self.frame_period / self.pulse_per_angle)

    def parameters(self, gain: float | None = None, voltage: float | None = None,
                   ratio: float = 1.0) -> dict[str, float]:
        """Return the servo parameters by dotted name; those of gain and supply only where they are given.

        Parameters
        ----------
        gain : float, optional
            k_P.
        voltage : float, optional
            V_in [V].
        ratio : float
            BAM's error_gain_ratio, by which a fit corrects g [1].
        """
        made = {
            "electronics.frame_period": self.frame_period,
            "electronics.one_shot_offset": self.centre,
            "electronics.one_shot_slope": self.pulse_per_angle,
            "potentiometer.feedback_gain": 1.0,
            "potentiometer.feedback_offset": 0.0,
        }
        if voltage is not None:
            made["supply.open_circuit_voltage"] = voltage
        if gain is not None:
            made["electronics.stretcher_gain"] = self.stretcher_gain(gain) * ratio
        if gain is not None and voltage is not None:  # the same law with the mean voltage, for the bounded servo
            made["electronics.bridge_gain"] = gain * self.error_gain * ratio * voltage
            made["electronics.comparator_gain"] = 1.0
        return made

    def firmware(self, gain: float | None = None, ratio: float = 1.0, speed: float | None = None,
                 delay: float | None = None) -> dict[str, Any]:
        """Return the same loop as numbers of the firmware, by dotted name; the gain only where it is given.

        Parameters
        ----------
        gain : float, optional
            k_P.
        ratio : float
            BAM's error_gain_ratio, by which a fit corrects g [1].
        speed : float, optional
            BAM's max_velocity, at which the goal moves at most [rad/s].
        delay : float, optional
            BAM's command_delay, from the write of a goal until it counts [s].

        Examples
        --------
        >>> round(BamConvention().firmware(400)["firmware.proportional_gain"], 6)
        1.150951
        """
        made: dict[str, Any] = {"firmware.control_period": self.frame_period, "firmware.duty_limit": self.largest_duty,
                                "firmware.command_kind": "goal"}
        if gain is not None:
            made["firmware.proportional_gain"] = gain * self.error_gain * ratio
        if speed is not None:
            made["firmware.speed_limit"] = speed
        if delay is not None:
            made["firmware.bus_latency"] = delay
        return made
