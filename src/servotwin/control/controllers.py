"""PID with a filtered derivative, weights of the reference, and anti-windup by back-calculation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from servotwin.control.controller import (
    ANGLE,
    VOLTAGE,
    Controller,
    Decision,
    Measured,
    check_commands,
    check_numbers,
    check_period,
    clipped,
)
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference
from servotwin.errors import InputError

# --- A signal without its noise, and with its rates: two equal poles, solved exactly from tick to tick ----------------

class Smoothed(NamedTuple):
    """A filtered value, its rate, and the value that went in last, of one servo or of joints."""

    value: Any
    rate: Any
    last: Any


def resting(value: Any) -> Smoothed:
    """Return the filter at rest at a value."""
    return Smoothed(value, 0.0 * value, value)


def smoothed(before: Smoothed, value: Any, rate: float, period: float) -> Smoothed:
    """Return the filter g²/(s + g)² one tick later, of a signal that is straight from sample to sample.

    Parameters
    ----------
    before : Smoothed
    value : float or ndarray
        That was measured now.
    rate : float
        g, of both poles; a steady motion is seen 2/g late [rad/s].
    period : float
        T [s].

    Examples
    --------
    >>> state = resting(0.0)
    >>> for k in range(1, 1001):
    ...     state = smoothed(state, 3.0 * 1e-3 * k, 100.0, 1e-3)
    >>> round(state.value, 6), round(state.rate, 6)
    (2.94, 3.0)
    """
    return _later(before, value, (value - before.last) / period, rate, period)


def held(before: Smoothed, value: Any, rate: float, period: float) -> Smoothed:
    """Return the same filter of a signal that was held at a value since the tick before, such as a command.

    Examples
    --------
    >>> round(held(resting(0.0), 1.0, 100.0, 0.01).value, 6)  # 1 - 2/e
    0.264241
    """
    return _later(before, value, 0.0, rate, period)


def second_rate(state: Smoothed, rate: float) -> Any:
    """Return the second derivative of a filtered value, ẍ = g² (u − x) − 2 g ẋ.

    Examples
    --------
    >>> second_rate(Smoothed(0.0, 0.0, 1.0), 10.0)
    100.0
    """
    return rate * rate * (state.last - state.value) - 2.0 * rate * state.rate


def _later(before: Smoothed, value: Any, slope: Any, g: float, T: float) -> Smoothed:
    """Return the filter a tick later; a ramp is followed 2/g late, and what differs from that fades.

    [d, f] ← e^(−gT) [[1 + gT, T], [−g² T, 1 − gT]] [d, f] with d = x − (u − 2 m/g), f = ẋ − m.
    """
    fading, late = math.exp(-g * T), 2.0 * slope / g
    d, f = before.value - (value - slope * T - late), before.rate - slope
    return Smoothed(value - late + fading * ((1.0 + g * T) * d + T * f),
                    slope + fading * ((1.0 - g * T) * f - g * g * T * d), value)


# --- Computed torque --------------------------------------------------------------------------------------------------

@dataclass(frozen=True, kw_only=True)
class ComputedTorque:
    """A shaft that moves about its reference as a unit mass on a spring and a damper, whatever it carries.

    q̈_c = q̈_r + 2 ζ ω (q̇_r − q̇_f) + ω² (q_r − q), and the voltage of (40) that makes it, gravity and friction included.

    Parameters
    ----------
    period : float
        Positive [s].
    inverse : ServoInverse
        Its own numbers. Friction counts at the speed of the reference: at the measured one it would chatter.
    bandwidth : float or ndarray
        ω; `bandwidth` of `tuning.rates` [rad/s].
    damping_ratio : float
        ζ [1].
    load_torque : callable, optional
        Torque [N m] of measured angle and speed and commanded acceleration, beside the inertia and damping that the
        inverse has: `LoadModel` of one servo, the rigid-body dynamics of a robot.
    filter_rate : float
        g of the two poles through which the speed is seen [rad/s].
    ahead : float
        How far ahead it is given the reference [s].

    Raises
    ------
    InputError
        If a number makes no sense.

    Notes
    -----
    Kelly, Santibáñez and Loría, Control of Robot Manipulators in Joint Space, 2005, chapter 10; Siciliano et
    al., Robotics, 2009, section 8.5.2. The actuator is that of (40).

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Reference, inverse_of
    >>> model, arm = st.PulseServo(st.load_servo("hitec-hs-755hb")), st.loads.Pendulum(mass=0.1, length=0.12)
    >>> controller = ComputedTorque(period=1e-3, inverse=inverse_of(model, arm), bandwidth=20.0, filter_rate=400.0)
    >>> rest = {"output_angle": 0.0}
    >>> away = controller.step(controller.initial(rest, Reference(0.0)), Reference(0.1), rest)
    >>> f"{away.command:.3f} V"
    '0.871 V'
    """

    period: float
    inverse: ServoInverse
    bandwidth: Any
    damping_ratio: float = 1.0
    load_torque: Callable[[Any, Any, Any], Any] | None = None
    filter_rate: float
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)
        check_numbers(self, ("bandwidth", "damping_ratio"))
        check_numbers(self, ("filter_rate",), positive=True)

    @property
    def commands(self) -> str:
        """A voltage."""
        return VOLTAGE

    def initial(self, measured: Measured, reference: Reference) -> Smoothed:
        """Return the measured angle, at rest."""
        return resting(measured["output_angle"])

    def step(self, state: Smoothed, reference: Reference, measured: Measured) -> Decision:
        """Return the voltage that makes the acceleration."""
        q, w, zeta = measured["output_angle"], self.bandwidth, self.damping_ratio
        seen = smoothed(state, q, self.filter_rate, self.period)
        qdd_c = (reference.acceleration + 2.0 * zeta * w * (reference.speed - seen.rate)
                 + w * abs(w) * (reference.angle - q))
        tau = 0.0 if self.load_torque is None else self.load_torque(q, seen.rate, qdd_c)
        v = self.inverse.voltage(Reference(q, reference.speed, qdd_c), tau)
        limit = self.inverse.voltage_limit
        return Decision(clipped(v, -limit, limit), seen)


# --- A disturbance observer -------------------------------------------------------------------------------------------

class ObserverState(NamedTuple):
    """State of an observer: its controller's state, angle and voltage as they are filtered, the last voltage."""

    controller: Any
    angle: Smoothed
    voltage: Smoothed
    last: Any


@dataclass(frozen=True, kw_only=True)
class DisturbanceObserver:
    """Makes a shaft behave as its linear model, whatever load and friction do, as fast as its filter allows.

    d = Q v_a − P⁻¹ Q q with Q = g²/(s + g)² and P⁻¹ = (R/K) (J s² + (b + K K_b/R) s); v_a = v_c + d.

    Parameters
    ----------
    controller : Controller
        Commands a voltage. Its own terms against friction or a load would count twice: give a `Feedforward`
        the inverse `.frictionless`.
    inverse : ServoInverse
        Its own numbers; dry friction does not count.
    filter_rate : float
        g; `observer_rate` of `tuning.rates` [rad/s].

    Raises
    ------
    InputError
        If the controller commands no voltage, or the rate is not positive.

    Notes
    -----
    Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, IEEE/ASME Trans. Mechatronics 1 (1996),
    with a filter of two poles, through which no measured angle has to be differentiated.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Feedforward, inverse_of
    >>> inverse = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> plain = Feedforward(period=1e-3, inverse=inverse.frictionless)
    >>> DisturbanceObserver(controller=plain, inverse=inverse, filter_rate=50.0).period
    0.001
    """

    controller: Controller
    inverse: ServoInverse
    filter_rate: float

    def __post_init__(self) -> None:
        check_commands(self.controller, VOLTAGE, "DisturbanceObserver")
        check_numbers(self, ("filter_rate",), positive=True)

    @property
    def period(self) -> float:
        """That of the controller [s]."""
        return self.controller.period

    @property
    def commands(self) -> str:
        """A voltage."""
        return VOLTAGE

    @property
    def ahead(self) -> Any:
        """That of the controller [s]."""
        return self.controller.ahead

    def initial(self, measured: Measured, reference: Reference) -> ObserverState:
        """Return the state at rest at the measured angle, without a disturbance."""
        q = measured["output_angle"]
        return ObserverState(self.controller.initial(measured, reference), resting(q), resting(0.0 * q), 0.0 * q)

    def step(self, state: ObserverState, reference: Reference, measured: Measured) -> Decision:
        """Return the controller's voltage and that which the disturbance takes."""
        g, T, q = self.filter_rate, self.period, measured["output_angle"]
        angle, voltage = smoothed(state.angle, q, g, T), held(state.voltage, state.last, g, T)
        d = disturbance(self.inverse, angle, voltage, g)
        v_c, inner = self.controller.step(state.controller, reference, measured)
        limit = self.inverse.voltage_limit
        v = clipped(v_c + d, -limit, limit)
        return Decision(v, ObserverState(inner, angle, voltage, v))


def disturbance(inverse: ServoInverse, angle: Smoothed, voltage: Smoothed, rate: float) -> Any:
    """Return what a motion has taken more than the linear model takes, both seen through the same filter [V].

    Parameters
    ----------
    inverse : ServoInverse
        Without its dry friction.
    angle, voltage : Smoothed
        [rad] and [V]
    rate : float
        g of the filter [rad/s].

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> from servotwin.control.controllers import resting
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> disturbance(servo, resting(0.5), resting(2.0), 50.0)
    2.0
    """
    moved = inverse.total_inertia * second_rate(angle, rate) + inverse.damping * angle.rate
    return voltage.value - inverse.volts_per_torque * moved


# --- Compensation of a deadband and of play ---------------------------------------------------------------------------

class SidedState(NamedTuple):
    """State of a compensation: its controller's state, and the side on which it is, −1, 0 or +1."""

    controller: Any
    side: Any


@dataclass(frozen=True, kw_only=True)
class _Sided:
    """Moves what a controller commands, or what it is given, to the side to which the reference goes."""

    controller: Controller
    least_speed: Any = 1e-3

    @property
    def period(self) -> float:
        """That of the controller [s]."""
        return self.controller.period

    @property
    def commands(self) -> str:
        """The command of the controller."""
        return self.controller.commands

    @property
    def ahead(self) -> Any:
        """That of the controller [s]."""
        return self.controller.ahead

    def initial(self, measured: Measured, reference: Reference) -> SidedState:
        """Return the state of the controller, and no side."""
        return SidedState(self.controller.initial(measured, reference), 0.0 * reference.angle)

    def _side(self, before: Any, reference: Reference) -> Any:
        """Return to which side the reference goes; while it stands, that to which it went last."""
        speed = reference.speed
        return np.where(np.abs(speed) > self.least_speed, np.sign(speed), before)[()]


@dataclass(frozen=True, kw_only=True)
class DeadbandCompensation(_Sided):
    """Asks for so much more that a servo moves at once: half its deadband, and what it takes to overcome friction.

    command_angle = what the controller asks for + h side, where the side is that to which the reference goes.

    Parameters
    ----------
    controller : Controller
        Commands an angle.
    half_width : float or ndarray
        h; `tuning.lag_angle` computes it [rad].
    least_speed : float or ndarray
        Of a reference that moves; below it the side stays as it was [rad/s].

    Examples
    --------
    >>> from servotwin.control import PlainCommand, Reference
    >>> sends = DeadbandCompensation(controller=PlainCommand(period=0.02), half_width=0.01)
    >>> state = sends.initial({}, Reference(0.0))
    >>> [f"{sends.step(state, Reference(0.5, w), {}).command:g}" for w in (-0.2, 0.0, 0.2)]
    ['0.49', '0.5', '0.51']
    """

    half_width: Any

    def __post_init__(self) -> None:
        check_commands(self.controller, ANGLE, "DeadbandCompensation")
        check_numbers(self, ("half_width", "least_speed"))

    def step(self, state: SidedState, reference: Reference, measured: Measured) -> Decision:
        """Return what the controller asks for, moved to the side."""
        command, inner = self.controller.step(state.controller, reference, measured)
        side = self._side(state.side, reference)
        return Decision(command + self.half_width * side, SidedState(inner, side))


@dataclass(frozen=True, kw_only=True)
class PlayCompensation(_Sided):
    """Tells a controller a reference that is moved by half the play, so that the far side of the play follows it.

    The inverse of a play operator, whose side changes where the reference turns.

    Parameters
    ----------
    controller : Controller
    play : float or ndarray
        b, total. Positive where the angle is measured before the play, as at a motor; negative where it is measured
        behind a play that the shaft does not have, as by a potentiometer on a gear of its own [rad].
    least_speed : float or ndarray
        Of a reference that moves; below it the side stays as it was [rad/s].

    Notes
    -----
    Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996, chapter 2.

    Examples
    --------
    >>> from servotwin.control import PlainCommand, Reference
    >>> sends = PlayCompensation(controller=PlainCommand(period=0.02), play=0.02)
    >>> state = sends.initial({}, Reference(0.0))
    >>> [f"{sends.step(state, Reference(0.5, w), {}).command:g}" for w in (-0.2, 0.2)]
    ['0.49', '0.51']
    """

    play: Any

    def __post_init__(self) -> None:
        check_numbers(self, ("play", "least_speed"))

    def step(self, state: SidedState, reference: Reference, measured: Measured) -> Decision:
        """Return what the controller decides of the moved reference."""
        side = self._side(state.side, reference)
        moved = reference._replace(angle=reference.angle + 0.5 * self.play * side)
        command, inner = self.controller.step(state.controller, moved, measured)
        return Decision(command, SidedState(inner, side))


# --- PID with a filtered derivative, weights of the reference, and anti-windup by back-calculation --------------------

class PidState(NamedTuple):
    """State of a PID: its integral [V or rad], and the angle as it is filtered."""

    integral: Any
    seen: Smoothed


@dataclass(frozen=True, kw_only=True)
class Pid:
    """A PID about the measured angle: it commands a voltage, or corrects the angle that a servo is asked for.

    u = u_0 + k_p (b r − y) + I + k_d (c ṙ − ẏ_f), with u_0 = r where it commands an angle and 0 where a voltage, and

    İ = k_i (r − y) + (clip(u) − u)/T_t

    Parameters
    ----------
    period : float
        Of its ticks, positive [s].
    proportional_gain, integral_gain, derivative_gain : float or ndarray
        k_p [V/rad or 1], k_i [V/(rad s) or 1/s], k_d [V s/rad or s]; `tuning.pid_gains` computes them.
    filter_rate : float
        g of the two poles through which the derivative sees the angle [rad/s].
    commands : str
        "armature_voltage" or "command_angle".
    lower, upper : float or ndarray
        Bounds of the command, ∓∞ unless given [V or rad].
    reference_weight, speed_weight : float
        b and c; 1 acts on the error, 0 on the measurement alone.
    tracking_time : float, optional
        T_t [s]; √(k_d/k_i) unless given, without a derivative k_p/k_i or, where that is 0 too, 1/k_i.
    ahead : float
        How far ahead it is given the reference [s].

    Raises
    ------
    InputError
        If a number makes no sense.

    Notes
    -----
    Åström and Hägglund, PID Controllers, 2nd ed. 1995, chapter 3. The rate of the reference is known and not
    taken from differences.

    Examples
    --------
    >>> from servotwin.control import Reference
    >>> pid = Pid(period=0.01, proportional_gain=2.0, integral_gain=5.0, filter_rate=100.0)
    >>> start = {"time": 0.0, "output_angle": 0.0}
    >>> decision = pid.step(pid.initial(start, Reference(0.0)), Reference(0.5), start)
    >>> decision.command, decision.state.integral
    (1.0, 0.025)
    """

    period: float
    proportional_gain: Any = 0.0
    integral_gain: Any = 0.0
    derivative_gain: Any = 0.0
    filter_rate: float
    commands: str = VOLTAGE
    lower: Any = -math.inf
    upper: Any = math.inf
    reference_weight: float = 1.0
    speed_weight: float = 1.0
    tracking_time: float | None = None
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)
        check_numbers(self, ("proportional_gain", "integral_gain", "derivative_gain", "reference_weight",
                             "speed_weight"))
        check_numbers(self, ("filter_rate", *(() if self.tracking_time is None else ("tracking_time",))), positive=True)
        if self.commands not in (VOLTAGE, ANGLE):
            raise InputError("commands of Pid", got=self.commands, allowed=f"{VOLTAGE} or {ANGLE}")
        if not np.all(np.asarray(self.lower) < np.asarray(self.upper)):
            raise InputError("bounds of Pid", got=(self.lower, self.upper), allowed="lower < upper")

    @property
    def _tracking_rate(self) -> Any:
        """Return 1/T_t [1/s]; 0 without an integral."""
        if self.tracking_time is not None:
            return 1.0 / self.tracking_time
        k_p, k_i, k_d = (np.abs(gain) for gain in (self.proportional_gain, self.integral_gain, self.derivative_gain))
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.where(k_d > 0.0, np.sqrt(k_i / k_d), np.where(k_p > 0.0, k_i / k_p, k_i))
        return rate if rate.ndim else float(rate)

    def initial(self, measured: Measured, reference: Reference) -> PidState:
        """Return the state at rest at the measured angle."""
        q = measured["output_angle"]
        return PidState(0.0 * q, resting(q))

    def step(self, state: PidState, reference: Reference, measured: Measured) -> Decision:
        """Return the command, beside nothing or the reference itself."""
        return self.beside(reference.angle if self.commands == ANGLE else 0.0, state, reference, measured)

    def beside(self, given: Any, state: PidState, reference: Reference, measured: Measured) -> Decision:
        """Return the command where another one is given already [V or rad], within the bounds of both."""
        r, y, T = reference.angle, measured["output_angle"], self.period
        seen = smoothed(state.seen, y, self.filter_rate, T)
        u = (given + self.proportional_gain * (self.reference_weight * r - y) + state.integral
             + self.derivative_gain * (self.speed_weight * reference.speed - seen.rate))
        w = clipped(u, self.lower, self.upper)
        integral = state.integral + T * (self.integral_gain * (r - y) + self._tracking_rate * (w - u))
        return Decision(w, PidState(integral, seen))


# --- The inverse servo as feedforward, with a PID beside it or without any feedback -----------------------------------

@dataclass(frozen=True, kw_only=True)
class Feedforward:
    """The voltage that the reference takes by (40), and what a PID adds.

    Without a PID it needs no sensor: sent through `AheadOfServo`, the loop inside the servo does the rest.

    Parameters
    ----------
    period : float
        Positive [s].
    inverse : ServoInverse
        Its own numbers.
    load_torque : callable, optional
        External torque [N m] of angle, speed and acceleration of the reference, beside the inertia and damping that the
        inverse has, such as `LoadModel`.
    feedback : Pid, optional
        Of the same period, that commands a voltage; its bounds are those of the sum.
    ahead : float
        How far ahead it is given the reference [s].

    Raises
    ------
    InputError
        If the feedback commands something else or has another period.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import Reference, inverse_of
    >>> inverse = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> moves = Reference(0.5, speed=2.0)
    >>> f"{Feedforward(period=0.02, inverse=inverse).step(None, moves, {}).command:.3f} V"
    '2.849 V'
    """

    period: float
    inverse: ServoInverse
    load_torque: Callable[[Any, Any, Any], Any] | None = None
    feedback: Pid | None = None
    ahead: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)
        if self.feedback is not None:
            check_commands(self.feedback, VOLTAGE, "Feedforward")
            if self.feedback.period != self.period:
                raise InputError("period of feedback", got=self.feedback.period, allowed=f"{self.period:g} s, as here")

    @property
    def commands(self) -> str:
        """A voltage."""
        return VOLTAGE

    def initial(self, measured: Measured, reference: Reference) -> Any:
        """Return the state of the PID."""
        return None if self.feedback is None else self.feedback.initial(measured, reference)

    def step(self, state: Any, reference: Reference, measured: Measured) -> Decision:
        """Return the voltage that the reference takes, and what the PID adds, within its bounds."""
        tau = 0.0 if self.load_torque is None else self.load_torque(*reference[:3])
        v = self.inverse.voltage(reference, tau)
        if self.feedback is None:
            return Decision(clipped(v, -self.inverse.voltage_limit, self.inverse.voltage_limit), None)
        return self.feedback.beside(v, state, reference, measured)
