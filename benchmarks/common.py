"""What all scenarios share: timing, and the right-hand sides that the peers integrate."""

import math
import time
from collections.abc import Callable

import numpy as np

import servotwin as st
from servotwin.loads import Load

TIMES = np.linspace(0.0, 2.0, 201)


def best(run: Callable[[], object], repetitions: int = 15) -> float:
    """Return the shortest time of several runs [s]."""
    shortest = math.inf
    for _ in range(repetitions):
        start = time.perf_counter()
        run()
        shortest = min(shortest, time.perf_counter() - start)
    return shortest


def averaged_right_side(model: st.AveragedServo, v_c: float) -> Callable[[float, np.ndarray], list[float]]:
    """The averaged servo as a SciPy user would write it, in plain floats."""
    p = model.pack(Load())

    def f(t: float, y: np.ndarray) -> list[float]:
        q, w = y
        v_a = p.gain * (v_c - p.p * q - p.b_o)
        f_ec = (p.F_forward if w >= 0.0 else p.F_backward) * math.tanh(p.kappa * w)
        return [w, (p.K * (v_a - p.K_b * w) / p.R - p.b * w - f_ec) / p.J]

    return f


def bounded_right_side(model: st.BoundedServo, v_c: float) -> Callable[[float, np.ndarray], list[float]]:
    """The bounded servo while it turns forward: saturation, deadband and Coulomb friction in plain floats."""
    p = model.pack(Load())

    def f(t: float, y: np.ndarray) -> list[float]:
        q, w = y
        v_e = v_c - p.p * q - p.b_o
        v_d = 0.0 if abs(v_e) <= p.half_deadband else v_e - math.copysign(p.half_deadband, v_e)
        v_a = min(max(p.gain * v_d, -p.V_max), p.V_max)
        return [w, (p.K * (v_a - p.K_b * w) / p.R - p.b * w - p.F_forward) / p.J]

    return f


def standstill(t: float, y: np.ndarray) -> float:
    """The event that ends a run of `bounded_right_side`: from here on the servo sticks."""
    return float(y[1])


standstill.terminal = True
standstill.direction = -1.0
