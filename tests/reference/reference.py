"""Independent reference solutions of the servo models: slow, simple, very accurate; NumPy and SciPy only.

Written from the equations alone, so that agreement with the package means something. Plain SI floats everywhere:
rad, rad/s, V, A, N·m, kg·m². Output shaft for q and w, motor shaft for friction, as the fields say.
Inputs are callables of time, right-continuous, smooth between their `breaks`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .collocation import Kink, RightSide, integrate
from .hybrid import solve_bounded
from .plant import Load, Plant, Signal, Trajectory, segments, zero_error_angle

__all__ = [
    "Load",
    "Plant",
    "Trajectory",
    "solve_averaged",
    "solve_averaged_inductive",
    "solve_bounded",
    "solve_dc_motor",
    "solve_geared_motor",
    "zero_error_angle",
]

Array = NDArray[np.float64]


def _smoothed_friction(plant: Plant, w: Array, side: int) -> tuple[Array, Array]:
    """Torque at the output shaft and its slope: N fec(N w), (41) on one of its branches, and the load's."""
    F = plant.F1 if side > 0 else plant.F2
    th = np.tanh(plant.k * plant.N * w)
    size = plant.N * F + plant.load.coulomb
    return size * th, size * plant.k * plant.N * (1.0 - th * th)


def _external(plant: Plant, t: Array, q: Array, tau: Array) -> tuple[Array, Array]:
    load = plant.load
    torque = tau + load.pendulum * np.sin(q - load.hanging) + load.stiffness * (q - load.rest)
    return torque, load.pendulum * np.cos(q - load.hanging) + load.stiffness


def _solve_smooth(
    make: Callable[[Array, Array], RightSide], plant: Plant, signal: Signal, t_end: float,
    times: Array, y0: Sequence[float], scale: Sequence[float], breaks: Sequence[float], tol: float,
) -> Array:
    """Integrate from break to break; `make` turns sampled input and torque into a right side."""
    times = np.asarray(times, dtype=float)
    y = np.array(y0, dtype=float)
    out = np.empty((times.size, y.size))
    kink = Kink(1) if plant.F1 != plant.F2 else None
    filled = 0
    cuts = segments(t_end, [*breaks, *plant.load.tau_breaks])
    for n, (a, b) in enumerate(cuts):
        inside = math.nextafter(b, -math.inf)

        def f(t: Array, states: Array, side: int, inside: float = inside) -> tuple[Array, Array]:
            v = np.array([signal(min(x, inside)) for x in t.tolist()])
            tau = np.array([plant.load.tau(min(x, inside)) for x in t.tolist()])
            return make(v, tau)(t, states, side)

        last = times.size if n == len(cuts) - 1 else int(np.searchsorted(times, b, side="left"))
        got = integrate(f, [(a, b)], y, np.append(times[filled:last], b), np.array(scale), kink, tol)
        out[filled:last], y, filled = got[:-1], got[-1], last
    return out


def solve_dc_motor(
    plant: Plant, v_a: Signal, t_end: float, times: Array, y0: Sequence[float] = (0.0, 0.0, 0.0),
    breaks: Sequence[float] = (), tol: float = 1e-12,
) -> Trajectory:
    """(1)-(15): motor alone, q and w of the motor shaft; nothing of gear, friction table or load is read."""
    alone = Plant(R=plant.R, L=plant.L, k_a=plant.k_a, k_b=plant.k_b, J_m=plant.J_m, B_m=plant.B_m)
    return solve_geared_motor(alone, v_a, t_end, times, y0, breaks, tol)


def solve_geared_motor(
    plant: Plant, v_a: Signal, t_end: float, times: Array, y0: Sequence[float] = (0.0, 0.0, 0.0),
    breaks: Sequence[float] = (), tol: float = 1e-12,
) -> Trajectory:
    """(16)-(22): linear, no friction of the gear; a load with Coulomb friction is refused (no equation for it)."""
    if plant.load.coulomb:
        raise ValueError("the geared motor has no law for a load with Coulomb friction")
    P, N = plant, plant.N

    def make(v: Array, tau: Array) -> RightSide:
        def f(t: Array, y: Array, side: int) -> tuple[Array, Array]:
            q, w, i = y.T
            ext, ext_q = _external(P, t, q, tau)
            dy = np.stack([w, (N * P.k_a * i - P.B * w - ext) / P.J, (v - P.R * i - P.k_b * N * w) / P.L], axis=1)
            jac = np.zeros((t.size, 3, 3))
            jac[:, 0, 1] = 1.0
            jac[:, 1, 0], jac[:, 1, 1], jac[:, 1, 2] = -ext_q / P.J, -P.B / P.J, N * P.k_a / P.J
            jac[:, 2, 1], jac[:, 2, 2] = -P.k_b * N / P.L, -P.R / P.L
            return dy, jac

        return f

    linear = replace(plant, F1=0.0, F2=0.0)
    w_scale = 1.0 if N > 1.0 else 100.0
    y = _solve_smooth(make, linear, v_a, t_end, times, y0, (w_scale, w_scale, 0.1), breaks, tol)
    return Trajectory(q=y[:, 0], w=y[:, 1], i=y[:, 2])


def solve_averaged(
    plant: Plant, v_c: Signal, t_end: float, times: Array, y0: Sequence[float] | None = None,
    breaks: Sequence[float] = (), tol: float = 1e-12,
) -> Trajectory:
    """(35)-(41) run forward, with offsets: i = (A ks (v_c − p q − b_o) − k_b N w)/R."""
    P, N = plant, plant.N
    gain = N * P.k_a / P.R

    def make(v: Array, tau: Array) -> RightSide:
        def f(t: Array, y: Array, side: int) -> tuple[Array, Array]:
            q, w = y.T
            ext, ext_q = _external(P, t, q, tau)
            fric, fric_w = _smoothed_friction(P, w, side)
            v_a = P.A_ks * (v - (P.p * q + P.b_o))
            wd = (gain * (v_a - P.k_b * N * w) - P.B * w - fric - ext) / P.J
            jac = np.zeros((t.size, 2, 2))
            jac[:, 0, 1] = 1.0
            jac[:, 1, 0] = -(gain * P.A_ks * P.p + ext_q) / P.J
            jac[:, 1, 1] = -(gain * P.k_b * N + P.B + fric_w) / P.J
            return np.stack([w, wd], axis=1), jac

        return f

    start = (zero_error_angle(plant, v_c), 0.0) if y0 is None else y0
    y = _solve_smooth(make, plant, v_c, t_end, times, start, (1.0, 1.0), breaks, tol)
    return Trajectory(q=y[:, 0], w=y[:, 1])


def solve_averaged_inductive(
    plant: Plant, v_c: Signal, t_end: float, times: Array, y0: Sequence[float] | None = None,
    breaks: Sequence[float] = (), tol: float = 1e-12,
) -> Trajectory:
    """(27)-(34) with the current as a state: L i' = A ks (v_c − p q − b_o) − R i − k_b N w."""
    P, N = plant, plant.N

    def make(v: Array, tau: Array) -> RightSide:
        def f(t: Array, y: Array, side: int) -> tuple[Array, Array]:
            q, w, i = y.T
            ext, ext_q = _external(P, t, q, tau)
            fric, fric_w = _smoothed_friction(P, w, side)
            v_a = P.A_ks * (v - (P.p * q + P.b_o))
            wd = (N * P.k_a * i - P.B * w - fric - ext) / P.J
            jac = np.zeros((t.size, 3, 3))
            jac[:, 0, 1] = 1.0
            jac[:, 1, 0], jac[:, 1, 1] = -ext_q / P.J, -(P.B + fric_w) / P.J
            jac[:, 1, 2] = N * P.k_a / P.J
            jac[:, 2, 0], jac[:, 2, 1] = -P.A_ks * P.p / P.L, -P.k_b * N / P.L
            jac[:, 2, 2] = -P.R / P.L
            return np.stack([w, wd, (v_a - P.R * i - P.k_b * N * w) / P.L], axis=1), jac

        return f

    start = (zero_error_angle(plant, v_c), 0.0, 0.0) if y0 is None else y0
    y = _solve_smooth(make, plant, v_c, t_end, times, start, (1.0, 1.0, 1.0), breaks, tol)
    return Trajectory(q=y[:, 0], w=y[:, 1], i=y[:, 2])
