"""Wheels on servos that turn endlessly: speed over pulse width, and where a robot believes that they have taken it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin import loads, signals
from servotwin.errors import InputError
from servotwin.loads import Load, Part
from servotwin.models import Model, PulseServo
from servotwin.models.switched import SwitchedServo
from servotwin.parameters import Servo, load_servo
from servotwin.robots.told import is_pulsed
from servotwin.simulation.simulator import simulate
from servotwin.units import is_finite

Array = NDArray[np.float64]
NEUTRAL = 1.5  # rad: where the potentiometer of a rebuilt servo stands, near the middle of its range; assumed
_ERRORS = np.concatenate([np.geomspace(1e-6, 1.2e-4, 28), np.geomspace(1.4e-4, 6e-4, 8)])  # s from the neutral pulse
_SETTLE, _LOOK = 0.5, 0.4  # s: a map's speeds are means of the last whole frames after it
_SLOW = 1e-9  # rad/s


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


@dataclass(frozen=True, eq=False)
class SpeedMap:
    """How fast a wheel's servo turns over the width of its pulse, once it has settled.

    Parameters
    ----------
    pulses : ndarray, shape (n,)
        Increasing widths [s].
    speeds : ndarray, shape (n,)
        Mean speeds of the output shaft [rad/s], of which none is less than the one before.
    neutral : float
        The pulse at which it stands for certain [s].

    Raises
    ------
    InputError
        If the arrays do not go together, a width does not increase or a speed falls.

    Examples
    --------
    >>> line = SpeedMap(np.array([1.4e-3, 1.49e-3, 1.51e-3, 1.6e-3]), np.array([-2.0, 0.0, 0.0, 2.0]), 1.5e-3)
    >>> round(1e6 * line.pulse(1.0)), round(1e6 * line.pulse(0.0)), round(float(line.speed(1.555e-3)), 9), line.most
    (1555, 1500, 1.0, 2.0)
    """

    pulses: Array
    speeds: Array
    neutral: float

    def __post_init__(self) -> None:
        """Check."""
        t, w = self.pulses, self.speeds
        if t.ndim != 1 or t.shape != w.shape or len(t) < 3:
            raise InputError("map of a wheel's speed", got=f"arrays of shape {t.shape} and {w.shape}",
                             allowed="two of the same length, at least 3")
        if np.any(np.diff(t) <= 0.0) or np.any(np.diff(w) < 0.0) or not w[0] < 0.0 < w[-1]:
            raise InputError("map of a wheel's speed", got="pulses or speeds that do not increase",
                             allowed="increasing pulses, speeds from backward to forward that do not fall")

    @property
    def most(self) -> float:
        """The speed that it reaches both ways [rad/s]."""
        return float(min(-self.speeds[0], self.speeds[-1]))

    def speed(self, pulse: float | Array) -> Array:
        """Return the speed [rad/s] at a pulse [s]; beyond the table that of its end."""
        return np.asarray(np.interp(pulse, self.pulses, self.speeds))[()]

    def pulse(self, speed: float) -> float:
        """Return the pulse [s] for a speed [rad/s]; the neutral one for 0, and the end for more than there is."""
        if speed == 0.0:
            return self.neutral
        side = np.flatnonzero(self.speeds * speed > _SLOW * abs(speed))
        one = slice(side[0] - 1, None) if speed > 0.0 else slice(None, side[-1] + 2)  # and the last that stands
        w, t = self.speeds[one], self.pulses[one]
        kept = np.concatenate([[True], np.diff(w) > 0.0]) if speed > 0.0 else np.concatenate([np.diff(w) > 0.0, [True]])
        return float(np.interp(speed, w[kept], t[kept]))


def wheel_speed_of(model: Model, load: Load | Part | None = None, *, seed: int = 0) -> SpeedMap:
    """Measure how fast a servo that turns endlessly goes over the width of its pulse.

    It is simulated under constant pulses on both sides of its neutral one, half a second each until it has settled;
    what counts is the mean over the whole frames of the 0.4 s after that. Noise of the potentiometer is left out.

    Parameters
    ----------
    model : PulseServo, PulseServoInductive or DigitalServo
        With `potentiometer.fixed_angle`, told by pulses.
    load : Load, optional
        On its shaft: an inertia makes the bursts near the neutral pulse move it less.
    seed : int

    Returns
    -------
    SpeedMap

    Raises
    ------
    InputError
        If the servo does not turn endlessly, or not by pulses.

    Examples
    --------
    >>> speeds = wheel_speed_of(wheel_servo())
    >>> round(speeds.most, 2), round(float(speeds.speed(speeds.pulse(2.0))), 6)
    (4.65, 2.0)
    """
    servo = endless(model)
    quiet = type(model)(model.servo.replace({"potentiometer.noise": None}))
    frame = servo.frame_period
    end = _SETTLE + max(1, round(_LOOK / frame)) * frame
    neutral = servo.neutral_pulse
    pulses = neutral + np.concatenate([-_ERRORS[::-1], [0.0], _ERRORS])
    pulses = pulses[(pulses > 1e-5) & (pulses < frame - 1e-5) & _accepted(servo, pulses)]
    speeds = []
    for width in pulses.tolist():
        q = simulate(quiet, signals.constant(1e6 * width, unit="us"), duration=end, load=load,
                     output_times=[_SETTLE, end], seed=seed)["output_angle"]
        speeds.append(float(q[1] - q[0]) / (end - _SETTLE))
    found = np.array(speeds)
    found[np.abs(found) < _SLOW] = 0.0
    return SpeedMap(pulses, np.maximum.accumulate(found), neutral)  # beyond full drive they differ by rounding


def _accepted(model: SwitchedServo, pulses: Array) -> NDArray[np.bool_]:
    low, high = (model.value_or(f"electronics.pulse_width_{end}", usual) for end, usual in (
        ("min", 0.0), ("max", math.inf)))
    return np.asarray((pulses >= low) & (pulses <= high))


def endless(model: Model) -> SwitchedServo:
    """Return a model, or raise InputError unless it turns endlessly by pulses."""
    if not isinstance(model, SwitchedServo) or not is_pulsed(model):
        raise InputError("servo of a wheel", got=model, allowed="one that turns endlessly by pulses, such as "
                         "PulseServo(servo.continuous(...))")
    return model


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
