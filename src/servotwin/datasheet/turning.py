"""A servo that turns endlessly: its speed over the width of its pulse."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from servotwin import signals
from servotwin.errors import InputError
from servotwin.loads import Load, Part
from servotwin.models import DigitalServo, Model
from servotwin.models.switched import SwitchedServo
from servotwin.parameters import printed_points
from servotwin.parameters.servo import output_value
from servotwin.simulation.simulator import simulate

if TYPE_CHECKING:
    from servotwin.parameters import Servo


# --- The rotor beside the sheet: how long a servo takes to speed up, and whether that can be true ---------------------

def time_constant_of(servo: Servo) -> float | None:
    """Return the mechanical time constant τ_m = J R/K_out² [s], of rotor and circuit; None where a number is missing.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> round(time_constant_of(load_servo("hitec-hs-755hb")), 4)
    0.0169
    """
    K_out, J = output_value(servo, "output_torque_constant"), output_value(servo, "output_inertia")
    R_a, supply = servo.motor.armature_resistance, servo.supply
    if K_out is None or J is None or R_a is None:
        return None
    R = R_a + (supply.bridge_drop_resistance or 0.0) + (supply.internal_resistance or 0.0)
    return J * R / K_out**2


def slow_rotor(servo: Servo) -> str | None:
    """Return that a rotor takes longer to speed up than the sheet prints for 60°, in words; None where it does not.

    The time is that of the voltage nearest the servo's own.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> heavy = load_servo("hitec-hs-755hb").replace({"motor.rotor_inertia": 2e-6})
    >>> slow_rotor(heavy)
    'rotor: time constant 441.2 ms, longer than the 230 ms that are printed for 60 deg'
    """
    tau, own = time_constant_of(servo), servo.supply.open_circuit_voltage
    printed = [point for point in printed_points(servo) if point.time_60 and point.supply_voltage is not None]
    if tau is None or own is None or not printed:
        return None
    time_60 = float(min(printed, key=lambda point: abs(float(point.supply_voltage or 0.0) - own)).time_60 or 0.0)
    if tau <= time_60:
        return None
    return (f"rotor: time constant {1e3 * tau:.4g} ms, longer than the {1e3 * time_60:.3g} ms that are printed for "
            "60 deg")


# --- A servo that turns endlessly: its speed over the width of its pulse ----------------------------------------------

Array = NDArray[np.float64]
_ERRORS = np.concatenate([np.geomspace(1e-6, 1.2e-4, 28), np.geomspace(1.4e-4, 6e-4, 8)])  # s from the neutral pulse
_SETTLE, _LOOK = 0.5, 0.4  # s: a map's speeds are means of the last whole frames after it
_SLOW = 1e-9  # rad/s
_FINE = 1e-7  # s


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
        With `potentiometer.fixed_angle`, commanded by pulses.
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
    >>> import servotwin as st
    >>> speeds = wheel_speed_of(st.PulseServo(st.load_servo("hitec-hs-755hb").continuous(1.5)))
    >>> round(speeds.most, 2), round(float(speeds.speed(speeds.pulse(2.0))), 6)
    (4.65, 2.0)
    """
    servo = endless(model)
    frame = servo.frame_period
    neutral = servo.neutral_pulse
    pulses = neutral + np.concatenate([-_ERRORS[::-1], [0.0], _ERRORS])
    low, high = (servo.value_or(f"electronics.pulse_width_{end}", usual)
                 for end, usual in (("min", 0.0), ("max", math.inf)))
    accepted = np.asarray((pulses >= low) & (pulses <= high))
    pulses = pulses[(pulses > 1e-5) & (pulses < frame - 1e-5) & accepted]
    found = np.array([_speed_at(servo, width, load, seed) for width in pulses.tolist()])
    return SpeedMap(pulses, np.maximum.accumulate(found), neutral)  # beyond full drive they differ by rounding


def still_pulses(model: Model, found: SpeedMap) -> tuple[float, float] | None:
    """Return the shortest and the longest pulse [s] at which a servo stands, to 0.1 us; None where it always creeps.

    Parameters
    ----------
    model : Model
        The servo of the map.
    found : SpeedMap
    """
    servo, still = endless(model), np.flatnonzero(found.speeds == 0.0)
    if len(still) == 0:
        return None
    ends = []
    for inside, outside in ((still[0], still[0] - 1), (still[-1], still[-1] + 1)):
        stands, turns = float(found.pulses[inside]), float(found.pulses[outside])
        while abs(turns - stands) > _FINE:
            half = 0.5 * (stands + turns)
            stands, turns = (half, turns) if _speed_at(servo, half, None, 0) == 0.0 else (stands, half)
        ends.append(stands)
    return ends[0], ends[1]


def _speed_at(model: SwitchedServo, width: float, load: Load | Part | None, seed: int) -> float:
    """Return the mean speed [rad/s] under constant pulses of a width [s], without noise of the potentiometer."""
    quiet = type(model)(model.servo.replace({"potentiometer.noise": None}))
    end = _SETTLE + max(1, round(_LOOK / model.frame_period)) * model.frame_period
    q = simulate(quiet, signals.constant(1e6 * width, unit="us"), duration=end, load=load,
                 output_times=[_SETTLE, end], seed=seed)["output_angle"]
    speed = float(q[1] - q[0]) / (end - _SETTLE)
    return 0.0 if abs(speed) < _SLOW else speed


def endless(model: Model) -> SwitchedServo:
    """Return a model, or raise InputError unless it turns endlessly by pulses."""
    if not isinstance(model, SwitchedServo) or not is_pulsed(model):
        raise InputError("servo of a wheel", got=model, allowed="one that turns endlessly by pulses, such as "
                         "PulseServo(servo.continuous(...))")
    return model


def is_pulsed(model: Model) -> bool:
    """Tell whether a servo turns endlessly by pulses: then its command is their width."""
    return model.endless and not (isinstance(model, DigitalServo) and model.takes_goals)
