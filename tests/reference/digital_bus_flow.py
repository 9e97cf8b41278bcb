"""All servos of a bus between two events: as one linear system, by the series of its exponential, or integrated.

Where nothing is warm, no spring or pendulum pulls and friction knows no Stribeck speed, all speeds u of all bodies obey
u' = A u + b, for V_bus too is linear in them. The rest is integrated by DOP853.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from .digital_bus_circuit import Winding, bus_voltage
from .drivetrain_circuit import Source
from .drivetrain_laws import Plant
from .drivetrain_motion import T_H, T_W, Mode, Q, V, W, X, joined, motion

Array = NDArray[np.float64]
Parts = list[list[float]]
LONGEST, TERMS = 2e-3, 40  # s | of the series, which ends where terms are below the last bit
FAST = 8.0  # rad/s: the second speed at which a straight law is asked


class Body(Protocol):
    """What is asked of a servo."""

    P: Plant
    mode: Mode

    def winding(self, y: Sequence[float]) -> Winding: ...


def straight(P: Plant) -> bool:
    """Whether a servo's law is straight between two events."""
    return not (P.hot or P.w_s or P.stiffness or P.gravity)


def tidy(P: Plant, m: Mode, y: list[float]) -> list[float]:
    """Put two bodies that are one exactly together."""
    if joined(P, m):
        y[X], y[V] = y[Q] + 0.5 * m.flank * P.play, y[W]
    return y


class Straight:
    """Speeds by the series of the exponential, angles by their integrals."""

    def __init__(self, source: Source, zone: str, bodies: Sequence[Body], parts: Parts) -> None:
        self.bodies, self.parts = bodies, parts
        A, b = _law(source, zone, bodies, parts)
        u = np.array([x for y in parts for x in (y[W], y[V])])
        found = [u, A @ u + b]
        for k in range(2, TERMS):
            found.append(A @ found[-1] / k)
            if np.max(np.abs(found[-1])) * LONGEST**k < 1e-22 * (1.0 + np.max(np.abs(u))):
                break
        self.orders, self.longest = np.arange(len(found)), LONGEST
        speeds = np.array(found)
        self.series = np.hstack([speeds, speeds / (1.0 + self.orders)[:, None]])  # of speeds, and of mean speeds

    def at(self, s: float) -> Parts:
        """States after a time."""
        u, out = (s**self.orders @ self.series).tolist(), []
        n = 2 * len(self.parts)
        for k, (body, y) in enumerate(zip(self.bodies, self.parts, strict=True)):
            j = 2 * k
            now = [y[Q] + s * u[n + j], u[j], 0.0, y[X] + s * u[n + j + 1], u[j + 1], y[T_W], y[T_H]]
            out.append(tidy(body.P, body.mode, now))
        return out


def _law(source: Source, zone: str, bodies: Sequence[Body], parts: Parts) -> tuple[Array, Array]:
    """A and b of u' = A u + b, u = (w, v) of each servo."""
    n = len(bodies)
    rest = [[y[Q], 0.0, 0.0, y[X], 0.0, y[T_W], y[T_H]] for y in parts]
    windings = [body.winding(y) for body, y in zip(bodies, rest, strict=True)]
    volts, G = bus_voltage(source, zone, windings), np.zeros(2 * n)
    for k, (one, y) in enumerate(zip(windings, parts, strict=True)):
        if one.z:
            K_b = bodies[k].P.electric(y[T_W], y[T_H])[2]
            moving = [*windings[:k], one._replace(emf=K_b * FAST), *windings[k + 1:]]
            G[2 * k + 1] = (bus_voltage(source, zone, moving) - volts) / FAST
    A, b = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
    for k, (body, one, y) in enumerate(zip(bodies, windings, rest, strict=True)):
        still, by_w, by_v, by_tau = _shares(body, y)
        _, K, K_b = body.P.electric(y[T_W], y[T_H])
        slope = K * (one.response(1.0) - one.response(0.0))
        tau, taus = K * one.response(volts), slope * G
        taus[2 * k + 1] -= K * K_b / one.R if one.z else 0.0
        rows = slice(2 * k, 2 * k + 2)
        b[rows] = still + by_tau * tau
        A[rows] = np.outer(by_tau, taus)
        A[rows, 2 * k] += by_w
        A[rows, 2 * k + 1] += by_v
    return A, b


def _shares(body: Body, rest: list[float]) -> tuple[Array, Array, Array, Array]:
    """Accelerations of output and motor at rest without current, and what speeds and the motor's torque add."""
    def asked(w: float, v: float, tau: float) -> Array:
        y = [*rest]
        y[W], y[V] = w, v
        found = motion(body.P, body.mode, y, tau)
        return np.array([found.output, found.motor])

    still = asked(0.0, 0.0, 0.0)
    return (still, (asked(FAST, 0.0, 0.0) - still) / FAST, (asked(0.0, FAST, 0.0) - still) / FAST,
            asked(0.0, 0.0, 1.0) - still)


class Integrated:
    """All states by DOP853, step by step as far as they are asked for."""

    def __init__(self, source: Source, zone: str, bodies: Sequence[Body], parts: Parts) -> None:
        self.source, self.zone, self.bodies, self.longest = source, zone, bodies, LONGEST
        solver: Any = DOP853
        y = np.array([x for part in parts for x in part])
        self.parts, self.dense = parts, list[tuple[float, Callable[[float], Array]]]()
        self.solver = solver(self._rates, 0.0, y, LONGEST, rtol=1e-13, atol=1e-15, first_step=1e-4)

    def _rates(self, _: float, y: Array) -> Array:
        parts = y.reshape(-1, 7).tolist()
        windings = [body.winding(part) for body, part in zip(self.bodies, parts, strict=True)]
        volts, out = bus_voltage(self.source, self.zone, windings), []
        for body, part, one in zip(self.bodies, parts, windings, strict=True):
            P, (R_a, K, _) = body.P, body.P.electric(part[T_W], part[T_H])
            i = one.response(volts)
            go = motion(P, body.mode, part, K * i)
            through, off = (part[T_W] - part[T_H]) / P.R_wh, (part[T_H] - P.ambient) / P.R_ha
            warm = ((R_a * i * i - through) / P.C_w, (through - off) / P.C_h) if P.hot else (0.0, 0.0)
            out += [part[W], go.output, 0.0, part[V], go.motor, *warm]
        return np.array(out)

    def at(self, s: float) -> Parts:
        """States after a time."""
        if s == 0.0:
            return [[*part] for part in self.parts]
        while not self.dense or self.dense[-1][0] < s:
            message = self.solver.step()
            if self.solver.status == "failed":
                raise RuntimeError(f"no step: {message}")
            self.dense.append((self.solver.t, self.solver.dense_output()))
        dense = next(found for end, found in self.dense if s <= end)
        parts = dense(s).reshape(-1, 7).tolist()
        return [tidy(body.P, body.mode, part) for body, part in zip(self.bodies, parts, strict=True)]
