"""Computed torque: the acceleration that a stiff spring and damper ask for, and the voltage that it takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from servotwin.control.controller import VOLTAGE, Decision, Measured, check_numbers, check_period, clipped
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference
from servotwin.control.smoothing import Smoothed, resting, smoothed


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
        inverse knows: `LoadModel` of one servo, the rigid-body dynamics of a robot.
    filter_rate : float
        g of the two poles through which the speed is seen [rad/s].
    ahead : float
        How far ahead it is told the reference [s].

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
