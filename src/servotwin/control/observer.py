"""A disturbance observer: what a shaft takes more than its linear model is added to what a controller asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from servotwin.control.controller import (
    VOLTAGE,
    Controller,
    Decision,
    Measured,
    check_commands,
    check_numbers,
    clipped,
)
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference
from servotwin.control.smoothing import Smoothed, held, resting, second_rate, smoothed


class ObserverState(NamedTuple):
    """What an observer remembers: its controller's state, angle and voltage as they are filtered, the last voltage."""

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
        Commands a voltage. What it already does against friction or a load would count twice: give a `Feedforward`
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
    >>> from servotwin.control.smoothing import resting
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> disturbance(servo, resting(0.5), resting(2.0), 50.0)
    2.0
    """
    moved = inverse.total_inertia * second_rate(angle, rate) + inverse.damping * angle.rate
    return voltage.value - inverse.volts_per_torque * moved
