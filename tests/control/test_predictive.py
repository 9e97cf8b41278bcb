"""Predictive control: bounds, offsets, and the plan against a solution of SciPy."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin import control
from servotwin.errors import InputError

pytest.importorskip("osqp")

JUMP = control.step(0.3, 1.8, at=0.05, duration=1.0)


def controller_of(servo, load, **more):
    bridge = control.bare_bridge(servo, period=0.01)
    inverse = control.inverse_of(bridge, load)
    return bridge, control.PredictiveControl(period=0.01, inverse=inverse, observer_rate=25.0, **more)


def test_the_plan_is_the_best_one_within_the_voltage(servo):
    from scipy.optimize import lsq_linear

    _, controller = controller_of(servo, st.loads.Inertia(0.02), horizon=12)
    plan, x, wanted, last, d = controller._plan, np.array([0.1, 2.0]), np.linspace(0.2, 0.5, 12), 1.0, 0.4
    V, lam = controller.inverse.voltage_limit, controller.angle_per_volt
    change = np.eye(12) - np.eye(12, k=-1)
    A = np.vstack([plan.driven_angle, lam * change])
    b = np.concatenate([wanted - plan.free_angle @ x + d * plan.driven_angle.sum(axis=1), lam * last * np.eye(12)[0]])
    best = lsq_linear(A, b, bounds=(-V, V), tol=1e-12).x[0]
    assert controller._best(x, wanted, d, last) == pytest.approx(best, abs=2e-3)


def test_the_model_is_that_of_the_motor(servo):
    _, controller = controller_of(servo, st.loads.Inertia(0.02))
    A, B = controller._model(0.01)
    inverse = controller.inverse
    x = np.array([0.0, 0.0])
    for _ in range(500):
        x = A @ x + B * 2.0
    assert x[1] == pytest.approx(2.0 / (inverse.volts_per_torque * inverse.damping), rel=1e-9)
    half_A, half_B = controller._model(0.005)
    assert half_A @ half_A == pytest.approx(A)
    assert half_A @ half_B + half_B == pytest.approx(B)


def test_a_step_arrives_within_its_bounds_and_stays_against_a_load(servo):
    load = st.loads.Inertia(0.02) + st.loads.Constant(0.3)
    bridge, controller = controller_of(servo, load, speed_limit=4.0)
    port = control.SimulatedServo(bridge, load, sensors=[control.Encoder()])
    run = control.run_loop(port, controller, JUMP)
    assert np.abs(run.command).max() <= controller.inverse.voltage_limit
    assert run.true["output_speed"].max() < 4.1
    assert run.true["output_angle"].max() < 1.8 + math.radians(2.5)
    assert run.rms_error(since=0.8) < math.radians(0.2)


@pytest.mark.parametrize(("more", "words"), [
    ({"horizon": 1}, "horizon"), ({"angle_per_volt": 0.0}, "angle_per_volt"), ({"lag": 0.02}, "lag"),
    ({"speed_limit": -1.0}, "speed_limit")])
def test_bad_input_is_one_line(servo, more, words):
    with pytest.raises(InputError, match=words):
        controller_of(servo, None, **more)
