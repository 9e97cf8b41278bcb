"""Friction M1 to M6, each as printed, in fixed small steps: motor and load, one body, under a given armature voltage.

Nothing here is shared with the fine reference: six formulas instead of one, RK4 steps instead of an event search, and
a stick test after each step. It looks for misreadings; its error is that of the step at a change of direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LAWS = ("M1", "M2", "M3", "M4", "M5", "M6")


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """Motor and load in SI at the output shaft; the letters are those of docs/theory."""

    N: float
    J: float
    k_a: float
    k_b: float
    R_a: float
    L_a: float = 0.0
    B_m: float = 0.0
    B_L: float = 0.0
    F_forward: float = 0.0  # of the motor shaft
    F_backward: float = 0.0
    r: float = 1.0
    v_s: float = 1.0  # motor shaft
    alpha: float = 1.0
    K_l: float = 0.0
    K_ls: float = 0.0
    K_m: float = 0.0
    K_e: float = 0.0
    K_ms: float = 0.0
    K_es: float = 0.0
    K_mq: float = 0.0
    K_eq: float = 0.0
    coulomb: float = 0.0
    torque: Callable[[float], float] = lambda q: 0.0  # τ_ext, positive towards −q


def budget(P: Rotor, law: str, direction: int, w: float, tau_m: float, tau_e: float) -> float:
    """What the gear's friction can take at this speed, K_v |w| included [N m]."""
    F = P.F_forward if direction > 0 else P.F_backward
    K_c, K_cs, K_v = P.N * F, P.N * (P.r - 1.0) * F, P.N**2 * P.B_m
    S = math.exp(-(abs(w / (P.v_s / P.N)) ** P.alpha))
    M1 = K_c + K_v * abs(w)
    if law == "M1":
        return M1
    if law == "M2":
        return M1 + S * K_cs
    if law == "M3":
        return M1 + P.K_l * abs(tau_m - tau_e)
    if law == "M4":
        M3 = M1 + P.K_l * abs(tau_m - tau_e)
        return M3 + S * (K_cs + P.K_ls * abs(tau_m - tau_e))
    M5 = K_c + K_v * abs(w) + abs(P.K_m * tau_m - P.K_e * tau_e) + S * (
        K_cs + abs(P.K_ms * tau_m - P.K_es * tau_e))
    if law == "M5":
        return M5
    if math.copysign(1.0, tau_m) == math.copysign(1.0, tau_e) or abs(tau_m) == abs(tau_e):
        return M5
    return M5 + S * (P.K_eq * tau_e**2 if abs(tau_m) > abs(tau_e) else P.K_mq * tau_m**2)


def _rates(P: Rotor, law: str, direction: int, v_a: float, y: Sequence[float]) -> list[float]:
    q, w, i = y
    if P.L_a == 0.0:
        i = (v_a - P.k_b * P.N * w) / P.R_a
    tau_m, tau_e = P.N * P.k_a * i, -P.torque(q) - P.B_L * w
    friction = budget(P, law, direction, w, tau_m, tau_e) + P.coulomb
    di = (v_a - P.R_a * i - P.k_b * P.N * w) / P.L_a if P.L_a else 0.0
    if direction == 0:
        return [0.0, 0.0, di]
    return [w, (tau_m + tau_e - direction * friction) / P.J, di]


def _direction(P: Rotor, law: str, v_a: float, y: Sequence[float]) -> int:
    """Where a resting shaft goes, 0 if friction holds it."""
    q, _, i = y
    tau_m = P.N * P.k_a * (i if P.L_a else v_a / P.R_a)
    tau_e = -P.torque(q)
    way = 1 if tau_m + tau_e > 0.0 else -1
    return way if abs(tau_m + tau_e) > budget(P, law, way, 0.0, tau_m, tau_e) + P.coulomb else 0


def creep(
    P: Rotor, law: str, voltage: Sequence[tuple[float, float]], end: float, h: float, start: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angle and speed at the ends of the voltage's pieces and at `end`.

    `voltage` holds (from time, armature voltage [V]), in order, the first at 0; a piece is cut into equal steps of at
    most `h`.
    """
    if law not in LAWS:
        raise ValueError(f"law {law!r}; known: {LAWS}")
    y, direction, out = [start, 0.0, 0.0], 0, []
    cuts = [*(t for t, _ in voltage), end]
    for (t, v_a), until in zip(voltage, cuts[1:], strict=True):
        count = max(math.ceil((until - t) / h), 1)
        for _ in range(count):
            y, direction = _step(P, law, direction, v_a, y, (until - t) / count)
        out.append(y)
    states = np.array(out)
    return states[:, 0], states[:, 1]


def _step(P: Rotor, law: str, direction: int, v_a: float, y: list[float], h: float) -> tuple[list[float], int]:
    """RK4; where the speed would change its sign the shaft stops, and the stick test says what then."""
    direction = direction or _direction(P, law, v_a, y)

    def f(x: float, k: Sequence[float]) -> list[float]:
        return _rates(P, law, direction, v_a, [a + x * b for a, b in zip(y, k, strict=True)])

    a = f(0.0, [0.0, 0.0, 0.0])
    b = f(0.5 * h, a)
    c = f(0.5 * h, b)
    d = f(h, c)
    new = [s + h / 6.0 * (k + 2.0 * m + 2.0 * n + p) for s, k, m, n, p in zip(y, a, b, c, d, strict=True)]
    if direction * new[1] < 0.0:
        share = y[1] / (y[1] - new[1])  # of the step until it stood still
        new = [y[0] + share * (new[0] - y[0]), 0.0, new[2]]
        direction = _direction(P, law, v_a, new)
    return new, direction
