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
    numbers = model.pack(Load())
    K, K_b, R, _ = numbers.motor
    gain, p, b_o, J, b = numbers.follower.gain, numbers.sensor.p, numbers.sensor.b_o, numbers.shaft.J, numbers.shaft.b
    forward, backward, kappa = numbers.friction.F_forward, numbers.friction.F_backward, numbers.friction.kappa

    def f(t: float, y: np.ndarray) -> list[float]:
        q, w = y
        v_a = gain * (v_c - p * q - b_o)
        f_ec = (forward if w >= 0.0 else backward) * math.tanh(kappa * w)
        return [w, (K * (v_a - K_b * w) / R - b * w - f_ec) / J]

    return f


def bounded_right_side(model: st.BoundedServo, v_c: float) -> Callable[[float, np.ndarray], list[float]]:
    """The bounded servo while it turns forward: saturation, deadband and Coulomb friction in plain floats."""
    numbers = model.pack(Load())
    K, K_b, R, _ = numbers.motor
    p, b_o, J, b = numbers.sensor.p, numbers.sensor.b_o, numbers.shaft.J, numbers.shaft.b
    gain, half_deadband, V_max = numbers.follower
    forward = numbers.friction.F_forward

    def f(t: float, y: np.ndarray) -> list[float]:
        q, w = y
        v_e = v_c - p * q - b_o
        v_d = 0.0 if abs(v_e) <= half_deadband else v_e - math.copysign(half_deadband, v_e)
        v_a = min(max(gain * v_d, -V_max), V_max)
        return [w, (K * (v_a - K_b * w) / R - b * w - forward) / J]

    return f


def standstill(t: float, y: np.ndarray) -> float:
    """The event that ends a run of `bounded_right_side`: from here on the servo sticks."""
    return float(y[1])


standstill.terminal = True
standstill.direction = -1.0
