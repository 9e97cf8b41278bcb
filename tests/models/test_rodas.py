"""The integrator step: its order, its dense output, and its stability where the friction is steep."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from servotwin.models.engine.dynamics.coefficients import jacobian, rates_of
from servotwin.models.engine.motions import rodas
from servotwin.models.state.modes import FREE, LINEAR, RIGID, Mode, Vector
from servotwin.models.terms.load import NO_LOAD
from servotwin.models.terms.motor import Motor
from servotwin.models.terms.numbers import Numbers
from servotwin.models.terms.shaft import Shaft
from servotwin.physics.pieces import Piece, piece_rate, piece_value

# A pendulum behind a motor with inductance: ẇ = −sin q − 0.3 w + i + cos 2t, di/dt = −50 i + 50 (sin 3t − w)
NUMBERS = Numbers(motor=Motor(K=1.0, K_b=1.0, R=1.0, L=0.02), shaft=Shaft(J=1.0, b=0.3, J_out=0.0, b_out=0.0),
                  load=NO_LOAD._replace(gravity=1.0))
MODE = Mode(LINEAR, FREE, RIGID, FREE, 0)
U = Piece(amplitude=1.0, frequency=3.0)
TAU = Piece(amplitude=-1.0, frequency=2.0, phase=0.5 * math.pi)


def rates(t, q, w, i):
    return rates_of(NUMBERS, MODE, piece_value(U, t), piece_value(TAU, t), Vector(q, w, i, 0.0, 0.0, q, w))[1:3]


def state(q, w, i):
    return Vector(q, w, i, 0.0, 0.0, q, w)


def one_step(numbers, u, tau, t, y, h):
    jac = jacobian(numbers, MODE, piece_value(u, t), piece_rate(u, t), piece_rate(tau, t), y[0], y[1])
    return rodas.step(numbers, MODE, u, tau, jac, t, y, h)


def solve(count, fraction=0.37):
    y, t, h, between = state(1.0, 0.0, 0.0), 0.0, 1.0 / count, []
    for _ in range(count):
        y1, _, stages = one_step(NUMBERS, U, TAU, t, y, h)
        between.append(rodas.interpolate(y, y1, rodas.dense_coefficients(stages), fraction)[:3])
        y, t = y1, t + h
    return np.array(y[:3]), np.array(between)


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
    numbers = Numbers(shaft=Shaft(J=1.0, b=1e6, J_out=0.0, b_out=0.0))
    y, error, _ = one_step(numbers, Piece(), Piece(), 0.0, state(0.0, 1.0, 0.0), 1.0)
    assert abs(y[1]) < 1e-4
    assert np.isfinite(error).all()
