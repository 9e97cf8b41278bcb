"""How the state moves within one mode: in closed form wherever the mode is linear, else one integrator step.

A motion starts at its anchor and gives the state at any later time until its `length` is over.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Protocol

from servotwin.models.kernels import hybrid, rodas, second_order
from servotwin.models.kernels.hybrid import Mode, Plant
from servotwin.models.kernels.rodas import Vector
from servotwin.physics.pieces import Piece, piece_rate, piece_value

_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Inputs:
    """The two functions of time that act during a motion, and how long both stay one piece."""

    u: Piece
    tau: Piece

    @cached_property
    def periodic(self) -> bool:
        """Whether either of them oscillates."""
        return self.u.amplitude != 0.0 or self.tau.amplitude != 0.0

    def period(self, t0: float, t1: float) -> float:
        """Return the shortest period [s] of either between two times; inf where neither oscillates."""
        fastest = max((max(abs(p.frequency + p.sweep * (t - p.start)) for t in (t0, t1))
                       for p in (self.u, self.tau) if p.amplitude != 0.0), default=0.0)
        return _TURN / fastest if fastest > 0.0 else math.inf


class Motion(Protocol):
    """What the engine asks of a motion; s is the time since its anchor [s]."""

    @property
    def length(self) -> float:
        """How long it holds from its anchor [s]."""

    @property
    def closed(self) -> bool:
        """Whether this is an exact solution."""

    def state(self, s: float) -> Vector:
        """Return (q, w, i)."""

    def acceleration(self, s: float, y: Vector) -> tuple[float, float]:
        """Return ẇ and di/dt where the state is y."""

    def intervals(self, s0: float, s1: float) -> Iterator[float]:
        """Yield the ends of consecutive intervals from s0 to s1, in each of which the speed is monotone."""

    def scales(self) -> tuple[float, float]:
        """Return the time in which the free motion changes, and the time after which it has settled [s]."""


def grid(s0: float, s1: float, width: float) -> Iterator[float]:
    """Yield the ends of equal intervals of at most `width` from s0 to s1."""
    count = max(1, math.ceil((s1 - s0) / width)) if width < math.inf else 1
    for k in range(1, count):
        yield s0 + (s1 - s0) * (k / count)
    yield s1


@dataclass(frozen=True)
class Rest:
    """The shaft stands still; without inductance nothing else moves."""

    y: Vector
    inputs: Inputs
    t0: float
    length: float = math.inf
    closed: bool = True

    def state(self, s: float) -> Vector:
        """Return (q, 0, i)."""
        return self.y

    def acceleration(self, s: float, y: Vector) -> tuple[float, float]:
        """Return zero."""
        return 0.0, 0.0

    def scales(self) -> tuple[float, float]:
        """Nothing moves."""
        return math.inf, 0.0

    def intervals(self, s0: float, s1: float) -> Iterator[float]:
        """Follow the inputs alone."""
        return grid(s0, s1, self.inputs.period(self.t0 + s0, self.t0 + s1) / 12.0 if s1 < math.inf else math.inf)


@dataclass(frozen=True)
class SecondOrder:
    """A linear sliding motion without inductance."""

    coefficients: tuple[float, ...]
    inputs: Inputs
    t0: float
    length: float = math.inf
    closed: bool = True

    def state(self, s: float) -> Vector:
        """Return (q, w, 0)."""
        q, w = second_order.propagate(self.coefficients, s)
        return q, w, 0.0

    def acceleration(self, s: float, y: Vector) -> tuple[float, float]:
        """Return ẇ, 0."""
        return second_order.acceleration(self.coefficients, s, y[0], y[1]), 0.0

    def scales(self) -> tuple[float, float]:
        """From the two roots: real ones need fine intervals only while they are fast beside the time passed."""
        return _scales(*self.coefficients[:2])

    def intervals(self, s0: float, s1: float) -> Iterator[float]:
        """Between the zeros of the acceleration, which are known; under a sinusoid on a fine grid."""
        return _intervals(self.coefficients, self.inputs, self.t0, s0, s1)


def _scales(a: float, c: float) -> tuple[float, float]:
    rate = 2.0 * a + math.sqrt(abs(c))
    if rate == 0.0:
        return math.inf, 0.0
    if a * a >= c:
        return 1.0 / rate, 40.0 / rate
    return 1.0 / rate, 45.0 / a if a > 0.0 else math.inf


def _intervals(coefficients: tuple[float, ...], inputs: Inputs, t0: float, s0: float, s1: float) -> Iterator[float]:
    a, c, f0, f1, fs, _, _, q0, w0 = coefficients
    if fs != 0.0 or inputs.periodic:
        width = inputs.period(t0 + s0, t0 + s1) / 12.0
        fine, settled = _scales(a, c)
        if s0 < settled:
            middle = min(s1, settled)
            yield from grid(s0, middle, min(width, 0.5 * fine))
            s0 = middle
        if s0 < s1:
            yield from grid(s0, s1, width)
        return
    dw = f0 - c * q0 - 2.0 * a * w0
    zero, spacing = second_order.first_zero(a, c, dw, f1 - c * w0 - 2.0 * a * dw)
    settled = 45.0 / a if a > 0.0 else math.inf  # the free motion is below rounding from here on
    while zero < min(s1, settled):
        if zero > s0:
            yield zero
        zero += spacing
    yield s1


@dataclass(frozen=True)
class WithCurrent:
    """A sliding motion with inductance, without feedback or spring: the speed moves in second order.

    `coefficients` are those of the speed; the angle is its integral, and the current what accelerates the shaft.
    """

    coefficients: tuple[float, ...]
    plant: Plant
    angle: float
    torque: tuple[float, float]
    inputs: Inputs
    t0: float
    length: float = math.inf
    closed: bool = True

    def state(self, s: float) -> Vector:
        """Return (q, w, i)."""
        w, dw, way = second_order.propagate_with_integral(self.coefficients, s)
        plant = self.plant
        tau = self.torque[0] + self.torque[1] * s
        return self.angle + way, w, (plant.J * dw + plant.b * w + tau) / plant.K

    def acceleration(self, s: float, y: Vector) -> tuple[float, float]:
        """Return ẇ and di/dt."""
        w, dw = second_order.propagate(self.coefficients, s)
        ddw = second_order.acceleration(self.coefficients, s, w, dw)
        return dw, (self.plant.J * ddw + self.plant.b * dw + self.torque[1]) / self.plant.K

    def scales(self) -> tuple[float, float]:
        """As for a motion of second order."""
        return _scales(*self.coefficients[:2])

    def intervals(self, s0: float, s1: float) -> Iterator[float]:
        """Between the zeros of the second derivative of the speed."""
        return _intervals(self.coefficients, self.inputs, self.t0, s0, s1)


@dataclass(frozen=True)
class Step:
    """One accepted step of the integrator, with its dense output."""

    y0: Vector
    y1: Vector
    stages: list[Vector]
    length: float
    rates: Callable[[float, float, float, float], tuple[float, float]]
    t0: float
    closed: bool = False

    def state(self, s: float) -> Vector:
        """Return (q, w, i)."""
        if s >= self.length * (1.0 - 1e-15):  # the end, reached as a difference of two times
            return self.y1
        if s == 0.0:
            return self.y0
        return rodas.interpolate(self.y0, self.y1, self._dense, s / self.length)

    @cached_property
    def _dense(self) -> tuple[Vector, Vector, Vector]:
        return rodas.dense_coefficients(self.stages)

    def acceleration(self, s: float, y: Vector) -> tuple[float, float]:
        """Return ẇ and di/dt."""
        return self.rates(self.t0 + s, *y)

    def scales(self) -> tuple[float, float]:
        """Return the length of the step: the error control keeps it short beside what happens in it."""
        return self.length, math.inf

    def intervals(self, s0: float, s1: float) -> Iterator[float]:
        """Take the step as a whole, for the same reason."""
        yield s1


def closed_motion(plant: Plant, mode: Mode, y: Vector, inputs: Inputs, t0: float) -> Motion | None:
    """Return the exact motion from y at t0 [s], or None where the mode has to be integrated."""
    if hybrid.at_rest(mode.contact):
        return Rest((y[0], 0.0, 0.0), inputs, t0) if plant.L == 0.0 else None
    follows = hybrid.in_linear_zone(mode.zone)
    if plant.gravity != 0.0 or mode.contact == hybrid.CORE or (follows and inputs.u.sweep != 0.0):
        return None
    if plant.L > 0.0 and (plant.p != 0.0 or plant.stiffness != 0.0):
        return None  # of third order
    u, du = _polynomial(inputs.u, t0)
    phase = inputs.u.phase + inputs.u.frequency * (t0 - inputs.u.start)
    wave = (u, du, inputs.u.amplitude, inputs.u.frequency, phase) if follows else (u, du, 0.0, 0.0, 0.0)
    tau = _polynomial(inputs.tau, t0)
    if plant.L > 0.0:
        against = (tau[0] + hybrid.friction_torque(plant, mode.contact, y[1]), tau[1])
        return WithCurrent(hybrid.speed_coefficients(plant, mode, wave, against, y[1], y[2]), plant, y[0], against,
                           inputs, t0)
    return SecondOrder(hybrid.linear_coefficients(plant, mode, wave, tau, y[0], y[1]), inputs, t0)


def integrated_step(plant: Plant, mode: Mode, y: Vector, inputs: Inputs, t0: float, step: float,
                    limit: float, tolerance: float) -> tuple[Step | None, float]:
    """Return one accepted step from y at t0 [s] and the length to try next; None where no step is short enough.

    `step` is the length to try, at most `limit`; `tolerance` is the error per step, relative to the state.
    """
    u, tau = inputs.u, inputs.tau

    if u.slope == u.amplitude == tau.slope == tau.amplitude == 0.0:
        rates = partial(_rates_under_constants, plant, mode, u.value, tau.value)
    else:
        rates = partial(_rates_under_pieces, plant, mode, u, tau)
    *jac, Fu, Ft, Eu = hybrid.jacobian(plant, mode, y[0], y[1])
    du, dtau = piece_rate(u, t0), piece_rate(tau, t0)
    slopes = (Fu * du + Ft * dtau, Eu * du)
    h = min(step, limit, inputs.period(t0, t0 + min(step, limit)) / 6.0)
    for _ in range(60):
        y1, error, ks = rodas.step(rates, tuple(jac), slopes, t0, y, h)
        size = max(abs(e) / (tolerance * (1.0 + abs(b))) for e, b in zip(error, y1, strict=True))
        if not math.isfinite(size):
            size = 1e6
        factor = min(5.0, max(0.1, 0.85 * size**-0.2)) if size > 0.0 else 5.0
        if size <= 1.0:
            return Step(y, y1, ks, h, rates, t0), h * factor
        h *= factor
        if t0 + h == t0:
            break
    return None, h


def _rates_under_constants(plant: Plant, mode: Mode, u: float, tau: float, t: float, q: float, w: float,
                           i: float) -> tuple[float, float]:
    return hybrid.rates(plant, mode, u, tau, q, w, i)


def _rates_under_pieces(plant: Plant, mode: Mode, u: Piece, tau: Piece, t: float, q: float, w: float,
                        i: float) -> tuple[float, float]:
    return hybrid.rates(plant, mode, piece_value(u, t), piece_value(tau, t), q, w, i)


def _polynomial(piece: Piece, t0: float) -> tuple[float, float]:
    return piece.value + piece.slope * (t0 - piece.start), piece.slope
