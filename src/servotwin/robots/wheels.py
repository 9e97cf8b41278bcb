"""Wheels on servos that turn endlessly, and where a robot believes that they have taken it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from servotwin import loads
from servotwin.datasheet import SpeedMap, wheel_speed_of
from servotwin.datasheet.turning import endless
from servotwin.errors import InputError
from servotwin.loads import Load
from servotwin.models import PulseServo
from servotwin.parameters import Servo, load_servo
from servotwin.units import is_finite

__all__ = ["Odometry", "Pose", "SpeedMap", "endless", "inertia_at_wheel", "wheel_servo", "wheel_speed_of", "worn"]
NEUTRAL = 1.5  # rad: where the potentiometer of a rebuilt servo stands, near the middle of its range; assumed


def wheel_servo(servo: Servo | str = "hitec-hs-755hb", fixed_angle: float = NEUTRAL) -> PulseServo:
    """Return the model of a servo rebuilt to turn endlessly, as a wheel has it.

    Parameters
    ----------
    servo : Servo or str
        Of the catalog, or a path.
    fixed_angle : float
        Where its potentiometer stands [rad].

    Examples
    --------
    >>> round(1e6 * wheel_servo().neutral_pulse)
    1492
    """
    found = load_servo(servo) if isinstance(servo, str) else servo
    if found.potentiometer.fixed_angle is None:
        found = found.continuous(fixed_angle)
    return PulseServo(found)


def worn(model: PulseServo, *, neutral: float = 0.0, torque: float = 1.0) -> PulseServo:
    """Return a wheel's servo with its neutral off, or weaker than it was, as no two servos are the same.

    Parameters
    ----------
    model : PulseServo
    neutral : float
        By how much its neutral pulse is longer [s].
    torque : float
        What its motor has left of its torque per current and back-EMF per speed: a motor whose magnets are weaker
        stalls with less torque and runs faster, until friction tells.

    Raises
    ------
    InputError, ParameterError
        If the servo does not turn endlessly, or a number is not possible.

    Examples
    --------
    >>> new = wheel_servo()
    >>> round(1e6 * (worn(new, neutral=1e-5).neutral_pulse - new.neutral_pulse), 6)
    10.0
    """
    servo = endless(model).servo
    per_angle = model.value("potentiometer.feedback_gain") * model.value("electronics.one_shot_slope")
    return PulseServo(servo.replace({
        "potentiometer.fixed_angle": model.value("potentiometer.fixed_angle") + neutral / per_angle,
        "motor.torque_constant": torque * model.value("motor.torque_constant"),
        "motor.back_emf_constant": torque * model.value("motor.back_emf_constant")}))


class Pose(NamedTuple):
    """Where a robot is on the floor, and where it looks.

    Parameters
    ----------
    x, y : float
        [m]
    heading : float
        From the x axis towards y, unbounded [rad]
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """Where two wheels that do not slip take a robot: along an arc while both turn evenly.

    Parameters
    ----------
    radius : float
        Of the wheels [m]
    track : float
        Between their points of contact [m]

    Raises
    ------
    InputError
        If one of them is not positive.

    Examples
    --------
    >>> turned = Odometry(radius=0.03, track=0.16).step(Pose(), -math.pi * 0.08 / 0.03, math.pi * 0.08 / 0.03)
    >>> round(turned.x, 12), round(turned.y, 12), round(turned.heading, 12) == round(math.pi, 12)
    (0.0, 0.0, True)
    """

    radius: float
    track: float

    def __post_init__(self) -> None:
        """Check."""
        for name in ("radius", "track"):
            value = getattr(self, name)
            if not (is_finite(value) and value > 0.0):
                raise InputError(f"{name} of an odometry", got=value, allowed="a positive number [m]")

    def step(self, pose: Pose, left: float, right: float) -> Pose:
        """Return the pose after both wheels have turned forward by these angles [rad]."""
        way, turn = 0.5 * self.radius * (left + right), self.radius * (right - left) / self.track
        chord = way * float(np.sinc(0.5 * turn / math.pi))
        middle = pose.heading + 0.5 * turn
        return Pose(pose.x + chord * math.cos(middle), pose.y + chord * math.sin(middle), pose.heading + turn)

    def wheel_speeds(self, speed: float, turn_rate: float) -> tuple[float, float]:
        """Return the speeds of left and right wheel [rad/s] of a robot that goes [m/s] and turns [rad/s]."""
        return ((speed - 0.5 * self.track * turn_rate) / self.radius,
                (speed + 0.5 * self.track * turn_rate) / self.radius)


def inertia_at_wheel(mass: float, radius: float) -> Load:
    """Return what half of a robot's mass [kg] is to the servo of a wheel [m] while it goes straight.

    Examples
    --------
    >>> round(inertia_at_wheel(2.0, 0.025).total_inertia, 9)
    0.000625
    """
    return loads.as_load(loads.Inertia(0.5 * mass * radius**2))
