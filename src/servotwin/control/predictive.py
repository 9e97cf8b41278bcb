"""Model predictive control of one joint: the voltages that follow the next of the reference best, within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from servotwin.control.controller import VOLTAGE, Decision, Measured, check_numbers, check_period, clipped
from servotwin.control.controllers import Smoothed, disturbance, held, resting, smoothed
from servotwin.control.inverse import ServoInverse
from servotwin.control.reference import Reference
from servotwin.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_EXACT = 1e-6  # of the voltage limit, to which the programme is solved
_FIRM = 1e4  # what a speed beyond its bound costs, of the largest cost beside it
_ROUNDS = 4000


class PredictiveState(NamedTuple):
    """State of a predictive controller: angle and voltage as they are filtered, and the last voltage."""

    angle: Smoothed
    voltage: Smoothed
    last: float


class _Horizon(NamedTuple):
    """The inputs of the next ticks' angles and speeds: the state now, and the voltages."""

    free_angle: Array  # (H, 2)
    free_speed: Array
    driven_angle: Array  # (H, H)
    driven_speed: Array


@dataclass(frozen=True, kw_only=True)
class PredictiveControl:
    """Plans the voltages of a horizon on the linear model, and sends the first.

    minimise Σ (q_k − r_k)² + λ² Σ (v_k − v_{k−1})², subject to abs(v) ≤ V and abs(q̇) ≤ the speed limit, of the model
    (J + J_L) q̈ = (K/R) (v − d) − (b + B_L + K K_b/R) q̇, where d is what an observer sees of load and friction.

    Parameters
    ----------
    period : float
        T, positive [s].
    inverse : ServoInverse
        Its own numbers, of one servo; dry friction does not count.
    horizon : int
        Ticks that it looks ahead.
    observer_rate : float
        g of the observer; `tuning.rates` computes it [rad/s].
    speed_limit : float
        [rad/s]
    angle_per_volt : float
        λ: an error that is worth a change of 1 V from tick to tick; some counts of the encoder [rad/V].
    lag : float
        From a command until it acts, up to a period [s].

    Raises
    ------
    InputError
        If a number makes no sense.
    MissingExtraError
        Without OSQP.

    Notes
    -----
    Rawlings, Mayne and Diehl, Model Predictive Control, 2nd ed. 2017, chapter 1, with a constant disturbance. The
    programme is solved by OSQP (Stellato et al., Math. Prog. Comp. 12, 2020), afresh at every tick: a step remembers
    nothing but its state.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.control import inverse_of
    >>> servo = inverse_of(st.PulseServo(st.load_servo("hitec-hs-755hb")))
    >>> PredictiveControl(period=0.01, inverse=servo, horizon=20, observer_rate=25.0).ahead.shape
    (20,)
    """

    period: float
    inverse: ServoInverse
    horizon: int = 20
    observer_rate: float
    speed_limit: float = math.inf
    angle_per_volt: float = 5e-3
    lag: float = 0.0

    def __post_init__(self) -> None:
        check_period(self)
        check_numbers(self, ("observer_rate", "angle_per_volt"), positive=True)
        if not (isinstance(self.horizon, int) and self.horizon >= 2):
            raise InputError("horizon of PredictiveControl", got=self.horizon, allowed="a whole number of at least 2")
        if np.ndim(self.inverse.inertia):
            raise InputError("inverse of PredictiveControl", got="several joints", allowed="one")
        if not 0.0 <= self.lag <= self.period:
            raise InputError("lag of PredictiveControl", got=self.lag, allowed="from 0 to a period [s]")
        if not self.speed_limit > 0.0:
            raise InputError("speed_limit of PredictiveControl", got=self.speed_limit, allowed="a positive number")
        _osqp()

    @property
    def commands(self) -> str:
        """A voltage."""
        return VOLTAGE

    @property
    def ahead(self) -> Array:
        """The ticks of the horizon, from when the command of now has acted [s]."""
        return self.lag + self.period * np.arange(1.0, self.horizon + 1.0)

    @cached_property
    def _plan(self) -> _Horizon:
        A, B = self._model(self.period)
        H = self.horizon
        free, driven = np.zeros((H, 2, 2)), np.zeros((H, 2, H))
        power, response = np.eye(2), B
        for k in range(H):
            for i in range(H - k):
                driven[i + k, :, i] = response
            power, response = A @ power, A @ response
            free[k] = power
        return _Horizon(free[:, 0], free[:, 1], driven[:, 0], driven[:, 1])

    def _model(self, time: float) -> tuple[Array, Array]:
        """Return how (q, q̇) follow themselves and a constant voltage over a time [s]."""
        servo = self.inverse
        a = servo.damping / servo.total_inertia
        final = 1.0 / (servo.volts_per_torque * servo.damping)  # rad/s a volt
        settled = -math.expm1(-a * time)
        return (np.array([[1.0, settled / a], [0.0, 1.0 - settled]]),
                np.array([final * (time - settled / a), final * settled]))

    def initial(self, measured: Measured, reference: Reference) -> PredictiveState:
        """Return the state at rest at the measured angle, without a disturbance."""
        return PredictiveState(resting(float(measured["output_angle"])), resting(0.0), 0.0)

    def step(self, state: PredictiveState, reference: Reference, measured: Measured) -> Decision:
        """Return the first voltage of the best plan."""
        g, T, limit = self.observer_rate, self.period, self.inverse.voltage_limit
        angle = smoothed(state.angle, float(measured["output_angle"]), g, T)
        voltage = held(state.voltage, state.last, g, T)
        d = disturbance(self.inverse, angle, voltage, g)
        servo = self.inverse  # q̈ of the model [rad/s²] brings the filtered speed up to now
        acceleration = float(((voltage.value - d) / servo.volts_per_torque - servo.damping * angle.rate)
                             / servo.total_inertia)
        now = np.array([angle.last, angle.rate + 2.0 / g * acceleration])
        A, B = self._model(self.lag)
        x = A @ now + B * (state.last - d)
        v = clipped(self._best(x, np.asarray(reference.angle), d, state.last), -limit, limit)
        return Decision(v, PredictiveState(angle, voltage, v))

    def _best(self, x: Array, wanted: Array, d: float, last: float) -> float:
        """Return the first of the voltages, in parts of the limit V and with one slack for all speeds."""
        from scipy import sparse

        plan, H, V = self._plan, self.horizon, self.inverse.voltage_limit
        G, S, lam = V * plan.driven_angle, V * plan.driven_speed, V * self.angle_per_volt
        change = np.eye(H) - np.eye(H, k=-1)
        missing = plan.free_angle @ x - d / V * G.sum(axis=1) - wanted
        P, q = G.T @ G + lam**2 * change.T @ change, G.T @ missing
        q[0] -= lam**2 * last / V
        bounds, rows = np.ones(H), np.eye(H)
        lower, upper = -bounds, bounds
        if math.isfinite(self.speed_limit):
            coasting = (plan.free_speed @ x - d / V * S.sum(axis=1)) / self.speed_limit
            S, free = S / self.speed_limit, np.full(H, np.inf)
            one = np.ones((H, 1))
            rows = np.block([[rows, 0.0 * one], [S, -one], [S, one]])
            lower = np.concatenate([lower, -free, -bounds - coasting])
            upper = np.concatenate([upper, bounds - coasting, free])
            firm = np.full((1, 1), _FIRM * P.max())
            P, q = np.block([[P, np.zeros((H, 1))], [np.zeros((1, H)), firm]]), np.append(q, 0.0)
        scale = 1.0 / P.max()
        solver = _osqp().OSQP()
        solver.setup(sparse.csc_matrix(np.triu(scale * P)), scale * q, sparse.csc_matrix(rows), lower, upper,
                     verbose=False, eps_abs=_EXACT, eps_rel=_EXACT, max_iter=_ROUNDS, adaptive_rho_interval=50)
        return float(V * solver.solve(raise_error=False).x[0])


def _osqp() -> Any:
    try:
        import osqp
    except ImportError:
        raise MissingExtraError("osqp", "mpc") from None
    return osqp
