"""Gains by rule, from what a controller believes of a servo: none is set by hand.

Its delay limits a loop. A voltage is held for a period T and comes late by what program and bus need, so that
the loop is θ_0 = T/2 + lag late, without any filter. Every rule below is a share of 1/θ_0.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from servotwin.control.inverse import ServoInverse
from servotwin.errors import InputError
from servotwin.units import is_finite

KICK = 0.05  # of the voltage that there is: what one step of the encoder may make of it


class Rates(NamedTuple):
    """How fast the parts of a loop may be [rad/s]."""

    bandwidth: Any
    filter_rate: Any
    observer_rate: Any


class PidGains(NamedTuple):
    """Gains of a PID that commands a voltage [V/rad], [V/(rad s)], [V s/rad]."""

    proportional_gain: Any
    integral_gain: Any
    derivative_gain: Any


def rates(inverse: ServoInverse, *, period: float, lag: float = 0.0, frame: float = 0.0, count: float = 0.0) -> Rates:
    """Return bandwidth, filter and observer of a loop with a delay and an encoder in steps.

    The filter g = 2/θ_0 is as late as all the rest. Of the loop that is then θ = 2 θ_0 late, the bandwidth is
    ω = 1/4θ: its crossover is near 2 ω, so that the delay takes 29° of the 76° of phase margin that two equal poles
    have. The observer is twice as fast as the bandwidth. Where the encoder is coarse, all are slower: a step Δ of it
    then kicks the voltage by no more than 5 % of what there is, 2 ω (R/K)(J + J_L) g Δ/e = 0.05 V.

    Parameters
    ----------
    inverse : ServoInverse
        Numbers of one servo, or arrays (n,).
    period : float
        T of the controller [s].
    lag : float
        From a command until it acts, `port.lag` [s].
    frame : float
        How often a command can matter, `port.frame` [s].
    count : float
        Δ [rad].

    Raises
    ------
    InputError
        If a number makes no sense.

    Notes
    -----
    Åström and Murray, Feedback Systems, 2008, chapter 11: a delay bounds the crossover; shares by the rule above.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> [f"{rate:.1f}" for rate in rates(servo, period=1e-3, lag=5e-4)]
    ['125.0', '2000.0', '250.0']
    """
    late = _late(period, lag, frame)
    omega: Any = 1.0 / (8.0 * late)
    if count > 0.0:
        mass = inverse.volts_per_torque * inverse.total_inertia
        quiet = np.sqrt(math.e * KICK * inverse.voltage_limit / (32.0 * mass * count))
        omega = np.minimum(omega, quiet)[()]
    return Rates(omega, 16.0 * omega, 2.0 * omega)


def pid_gains(inverse: ServoInverse, bandwidth: Any, damping_ratio: float = 1.0) -> PidGains:
    """Return the gains that put the poles of motor, load and PID at −ω and −ζω ± iω√(1 − ζ²).

    k_p = m ω² (1 + 2 ζ), k_i = m ω³, k_d = m ω (1 + 2 ζ) − c with m = (R/K)(J + J_L), c = (R/K)(b + B_L) + K_b.

    Parameters
    ----------
    inverse : ServoInverse
    bandwidth : float or ndarray
        ω [rad/s].
    damping_ratio : float
        ζ.

    Notes
    -----
    Åström and Hägglund, PID Controllers, 2nd ed. 1995, chapter 4. A motor that brakes by itself more than is asked
    for has k_d < 0: a shaft that is slowed down needs more bandwidth, not that; 0 is returned then.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> [f"{gain:.2f}" for gain in pid_gains(servo, 50.0)]
    ['131.64', '2193.88', '1.59']
    """
    w, zeta = bandwidth, damping_ratio
    m = inverse.volts_per_torque * inverse.total_inertia
    c = inverse.volts_per_torque * inverse.damping
    return PidGains(m * w**2 * (1.0 + 2.0 * zeta), m * w**3, np.maximum(m * w * (1.0 + 2.0 * zeta) - c, 0.0)[()])


def integral_rate(inverse: ServoInverse, *, period: float, lag: float = 0.0, frame: float = 0.0,
                  correction: float = 0.0) -> Any:
    """Return k_i of an integral around the loop inside a servo, which corrects the angles that it is asked for [1/s].

    k_i = 1/2Θ, where Θ is all that the inner loop is late by: θ_0, what it needs to follow,
    (R/K)(b + B_L + K K_b/R)/(A k_s p), and 2√(D/a) that a profile takes for a way D. An inner loop that rings by itself
    bears no more than twice k_i = (b + B_L + K K_b/R)/2(J + J_L), its damping ζ ω_n.

    Parameters
    ----------
    inverse : ServoInverse
    period, lag, frame : float
        As in `rates` [s].
    correction : float
        D, the largest that it is for, such as a droop; it counts where the servo has a profile [rad].

    Notes
    -----
    Skogestad, Simple analytic rules for model reduction and PID controller tuning, J. Process Control 13 (2003): an
    integral alone for a process of pure delay, closed as fast as it is late. Of a lag of second order an integral is
    stable up to 2 ζ ω_n. `linear.tune` finds the gain of such a loop over pulses from its frames, a gain of k_i T.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> f"{integral_rate(servo, period=0.02):.1f}"
    '7.8'
    """
    slow = inverse.volts_per_torque * inverse.damping / inverse.volts_per_error
    profile = 2.0 * np.sqrt(correction / inverse.profile_acceleration)
    rings = 0.5 * inverse.damping / inverse.total_inertia
    return np.minimum(0.5 / (slow + profile + _late(period, lag, frame)), rings)[()]


def lag_angle(inverse: ServoInverse, *, speed: Any = math.inf, frame: float = 0.0) -> Any:
    """Return by how much a servo stays behind a slow motion: half its deadband, and what friction takes [rad].

    h + (R/K) F/(A k_s p) where the bridge has a mean voltage. One pulse a frame breaks friction that its mean does not:
    it speeds the shaft up by α = (K V/R − F)/J and friction stops it by β = F/J, so that at a speed w and by frames T_f
    the drive takes a share √(2 w/(T_f α (1 + α/β))) of the frame, and that share of V/(A k_s p) as error.

    Parameters
    ----------
    inverse : ServoInverse
    speed : float or ndarray
        Of the motion, where pulses drive it [rad/s].
    frame : float
        T_f of the pulses; 0 for a bridge that has a mean voltage [s].

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> [f"{57.29578 * angle:.2f} deg" for angle in (lag_angle(servo), lag_angle(servo, speed=0.05, frame=0.02))]
    ['2.70 deg', '1.24 deg']
    """
    F, V, J = inverse.friction(1.0, 0.0, 0.0), inverse.voltage_limit, inverse.total_inertia
    mean = inverse.volts_per_torque * F
    if frame > 0.0:
        alpha, beta = (V / inverse.volts_per_torque - F) / J, F / J
        mean = np.minimum(mean, V * np.sqrt(2.0 * speed / (frame * alpha * (1.0 + alpha / beta))))
    return inverse.half_deadband + mean / inverse.volts_per_error


def _late(period: float, lag: float, frame: float) -> float:
    """Return θ_0 [s]."""
    for name, value in (("period", period), ("lag", lag), ("frame", frame)):
        if not (is_finite(value) and value >= 0.0 and (value > 0.0 or name != "period")):
            raise InputError(f"{name} of a loop", got=value, allowed="seconds, not negative; a period positive")
    return 0.5 * max(period, frame) + lag
