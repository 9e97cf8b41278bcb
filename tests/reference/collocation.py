"""Radau IIA collocation of high order, for the smooth (and, through tanh friction, stiff) reference problems.

SciPy's Radau is of order 5 with an error estimate of order 3: at 1e-12 it needs millions of steps. The same family
with 10 stages (order 19, L-stable) reaches rounding in a few hundred, and its polynomial is the dense output.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
# (times (s,), states (s, d), side) -> (derivatives (s, d), Jacobians (s, d, d))
RightSide = Callable[[Array, Array, int], tuple[Array, Array]]

STAGES = 10
MAX_STEPS = 200_000


def _integrals(x: Array, count: int) -> Array:
    """Half the integral of the Legendre polynomials 0..count-1 from -1 to x; shape (len(x), count)."""
    v = legendre.legvander(x, count)
    out = np.empty((x.size, count))
    out[:, 0] = 0.5 * (x + 1.0)
    for j in range(1, count):
        out[:, j] = 0.5 * (v[:, j + 1] - v[:, j - 1]) / (2 * j + 1)
    return out


def _nodes(count: int) -> Array:
    """Radau points on [-1, 1]: zeros of P_s - P_(s-1), the right end among them."""
    c = np.zeros(count + 1)
    c[count], c[count - 1] = 1.0, -1.0
    x = np.sort(legendre.legroots(c).real)
    for _ in range(3):
        x -= legendre.legval(x, c) / legendre.legval(x, legendre.legder(c))
    x[-1] = 1.0
    return x


_X = _nodes(STAGES)
_C = 0.5 * (_X + 1.0)
_V_INV = np.linalg.inv(legendre.legvander(_X, STAGES - 1))
_A = _integrals(_X, STAGES) @ _V_INV
_TO_COEFFICIENTS = _V_INV @ np.linalg.inv(_A)
_AT_START = (-1.0) ** np.arange(STAGES)
_THETA = np.concatenate([[0.0], np.logspace(-7, -2, 11), np.linspace(0.025, 1.0, 40)])


@dataclass(frozen=True)
class Step:
    """One accepted step: y(t0 + θ h) = y0 + Σ_j coefficients_j ∫P_j, θ in [0, 1]."""

    t0: float
    h: float
    y0: Array
    y1: Array
    coefficients: Array  # of h y' in Legendre polynomials

    def at(self, times: Array) -> Array:
        x = 2.0 * (np.asarray(times) - self.t0) / self.h - 1.0
        return self.y0 + _integrals(np.atleast_1d(x), STAGES) @ self.coefficients


def one_step(f: RightSide, t0: float, y0: Array, h: float, side: int, scale: Array) -> Step | None:
    """Solve the stage equations by Newton's method with the full Jacobian; None if it does not converge."""
    d = y0.size
    t = t0 + _C * h
    z = np.zeros((STAGES, d))
    last = np.inf
    for _ in range(25):
        k, jac = f(t, y0 + z, side)
        residual = z - h * (_A @ k)
        m = -h * np.einsum("ij,jab->iajb", _A, jac)
        m = m.reshape(STAGES * d, STAGES * d)
        m[np.diag_indices(STAGES * d)] += 1.0
        dz = np.linalg.solve(m, -residual.ravel()).reshape(STAGES, d)
        z = z + dz
        size = float(np.max(np.abs(dz) / scale))
        if not np.isfinite(size) or size > 1e6:
            return None
        if size < 1e-15 or (size < 1e-12 and size >= 0.5 * last):
            return Step(t0, h, y0, y0 + z[-1], _TO_COEFFICIENTS @ z)
        last = size
    return None


def _error(f: RightSide, step: Step, side: int, scale: Array) -> float:
    """Error bound of the dense output: the tail of its Legendre series, and the defect at the start of the step.

    The start is no node: without its defect, a thin friction layer left before the first node would go unseen. The
    defect is filtered by (I - h c J)^-1, so that a stiff mode at rest does not inflate its rounding.
    """
    tail = np.max(np.abs(step.coefficients[-2:]), axis=0) / (2 * STAGES - 1)
    k, jac = f(np.array([step.t0]), step.y0[None, :], side)
    defect = step.h * k[0] - _AT_START @ step.coefficients
    start = np.linalg.solve(np.eye(step.y0.size) - step.h * _C[0] * jac[0], _C[0] * defect)
    return float(np.max(np.maximum(tail, np.abs(start)) / scale))


@dataclass(frozen=True)
class Kink:
    """A component of the state whose sign selects the branch of the right side."""

    component: int


def integrate(
    f: RightSide, segments: list[tuple[float, float]], y0: Array, times: Array, scale: Array,
    kink: Kink | None = None, tol: float = 1e-12,
) -> Array:
    """States at sorted `times`; `f` is smooth within each segment but for the kink, where steps are made to end."""
    out = np.empty((times.size, y0.size))
    y, h = np.array(y0, dtype=float), 1e-4
    done = 0
    for a, b in segments:
        t, side = a, _side(f, a, y, kink)
        h = min(h, b - a)
        for _ in range(MAX_STEPS):
            step, h_next = _accepted(f, t, y, min(h, b - t), side, scale, tol)
            reached = step.h == b - t
            step, crossed = _cut(f, step, side, scale, kink, 3.0 * tol)
            t1 = b if reached and not crossed else t + step.h
            stop = int(np.searchsorted(times, t1, side="right"))
            if stop > done:
                out[done:stop] = step.at(times[done:stop]) if step.h > 0 else step.y1
                done = stop
            t, y = t1, step.y1.copy()
            if crossed and kink is not None:
                if step.h > 0:
                    y[kink.component] = 0.0
                side = -side
            h = h_next
            if t >= b:
                break
        else:
            raise RuntimeError(f"no end of the segment [{a}, {b}] after {MAX_STEPS} steps, stopped at {t}")
    if done < times.size:
        raise ValueError("times lie outside the segments")
    return out


def _accepted(
    f: RightSide, t: float, y: Array, h: float, side: int, scale: Array, tol: float
) -> tuple[Step, float]:
    while True:
        step = one_step(f, t, y, h, side, scale)
        if step is not None:
            err = max(_error(f, step, side, scale), 1e-30)
            factor = min(4.0, max(0.2, 0.9 * (tol / err) ** (1.0 / STAGES)))
            if err <= tol:
                return step, h * factor
            h *= min(factor, 0.9)
        else:
            h *= 0.25
        if h < 1e-16:
            raise RuntimeError(f"step size underflow at t = {t}")


def _side(f: RightSide, t: float, y: Array, kink: Kink | None) -> int:
    """Branch of the right side: the sign of the component, or of its derivative where it is zero."""
    if kink is None:
        return 1
    value = y[kink.component]
    if value == 0.0:
        value = f(np.array([t]), y[None, :], 1)[0][0, kink.component]
    return 1 if value >= 0 else -1


def _cut(
    f: RightSide, step: Step, side: int, scale: Array, kink: Kink | None, noise: float
) -> tuple[Step, bool]:
    """Shorten the step to the first zero of the kink component; to nothing if it is on the other side from the start.

    Values on the other side that are within `noise` are left alone: the branches agree there to the same size.
    """
    if kink is None:
        return step, False
    c = kink.component
    w = side * step.at(step.t0 + _THETA * step.h)[:, c] / scale[c]
    below = np.flatnonzero(w < -noise)
    if below.size == 0:
        return step, False
    before = w[: below[0]] > noise
    before[:1] |= side * step.y0[c] > 0
    if not before.any():
        return Step(step.t0, 0.0, step.y0, step.y0, step.coefficients), True

    def after(theta: float) -> Step:
        made = one_step(f, step.t0, step.y0, float(theta) * step.h, side, scale)
        if made is None:
            raise RuntimeError("no convergence while a zero of the speed was sought")
        return made

    def signed(theta: float) -> float:
        return float(side * after(theta).y1[c])

    lo, hi = float(_THETA[np.flatnonzero(before)[-1]]), float(_THETA[below[0]])
    if signed(lo) <= 0.0 or signed(hi) >= 0.0:
        return after(lo if signed(lo) <= 0.0 else hi), True
    return after(brentq(signed, lo, hi, xtol=1e-16, rtol=8.9e-16)), True
