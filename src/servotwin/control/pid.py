"""PID with a filtered derivative, weights of the reference, and anti-windup by back-calculation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from servotwin.control.controller import ANGLE, VOLTAGE, Decision, Measured, check_numbers, check_period, clipped
from servotwin.control.reference import Reference
from servotwin.control.smoothing import Smoothed, resting, smoothed
from servotwin.errors import InputError


class PidState(NamedTuple):
    """What a PID remembers: its integral [V or rad], and the angle as it is filtered."""

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
        How far ahead it is told the reference [s].

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
