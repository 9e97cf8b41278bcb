"""The integrator step: its order, its dense output, and its stability where the friction is steep."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from servotwin.models.kernels import rodas


def rates(t, q, w, i):
    return -math.sin(q) - 0.3 * w + i + math.cos(2 * t), -50 * i + 50 * (math.sin(3 * t) - w)


def solve(count, fraction=0.37):
    y, t, h, between = (1.0, 0.0, 0.0), 0.0, 1.0 / count, []
    for _ in range(count):
        jacobian = (-math.cos(y[0]), -0.3, 1.0, 0.0, -50.0, -50.0)
        y1, _, stages = rodas.step(rates, jacobian, (-2 * math.sin(2 * t), 150 * math.cos(3 * t)), t, y, h)
        between.append(rodas.interpolate(y, y1, rodas.dense_coefficients(stages), fraction))
        y, t = y1, t + h
    return np.array(y), np.array(between)


@pytest.fixture(scope="module")
def reference():
    times = {n: [(k + 0.37) / n for k in range(n)] for n in (40, 80)}
    run = solve_ivp(lambda t, y: [y[1], *rates(t, *y)], (0, 1), [1, 0, 0], method="DOP853", rtol=3e-14, atol=1e-15,
                    dense_output=True)
    return run.sol(1.0), {n: run.sol(t).T for n, t in times.items()}


def test_order_five(reference):
    errors = [np.abs(solve(n)[0] - reference[0]).max() for n in (20, 40)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(5.0, abs=0.15)


def test_dense_output_is_of_order_four_at_least(reference):
    errors = [np.abs(solve(n)[1] - reference[1][n])[:, 0].max() for n in (40, 80)]
    assert math.log2(errors[0] / errors[1]) > 4.0


def test_a_step_far_beyond_the_stiff_time_scale_is_damped():
    # w' = -1e6 w: one step of 1 s must nearly remove it (an explicit method would explode)
    y, error, _ = rodas.step(lambda t, q, w, i: (-1e6 * w, 0.0), (0.0, -1e6, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0), 0.0,
                             (0.0, 1.0, 0.0), 1.0)
    assert abs(y[1]) < 1e-4
    assert np.isfinite(error).all()
