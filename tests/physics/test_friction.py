import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

torque = st.floats(1e-5, 1e-1)
speed = st.floats(-1e3, 1e3, allow_subnormal=False)


@given(w=speed, F_ec1=torque, F_ec2=torque, k=st.floats(1e-3, 1e3))
def test_the_smooth_law_opposes_motion_and_stays_below_the_true_one(w, F_ec1, F_ec2, k):
    smooth = physics.smoothed_coulomb_torque(w, F_ec1, F_ec2, k)
    true = physics.coulomb_torque(w, F_ec1, F_ec2)
    assert smooth * w >= 0
    assert abs(smooth) <= abs(true) * (1 + 1e-15)


@pytest.mark.parametrize("w", [-30.0, -0.1, 0.0, 0.1, 30.0])
def test_a_steep_smooth_law_becomes_the_true_one(w):
    assert physics.smoothed_coulomb_torque(w, 2.0, 3.0, 1e6) == physics.coulomb_torque(w, 2.0, 3.0)


def test_the_smooth_law_is_exact_where_its_hyperbolic_tangent_is():
    assert physics.smoothed_coulomb_torque(2.0, 2.0, 3.0, 0.25) == pytest.approx(2.0 * np.tanh(0.5), rel=1e-15)
    assert physics.smoothed_coulomb_torque(-2.0, 2.0, 3.0, 0.25) == pytest.approx(-3.0 * np.tanh(0.5), rel=1e-15)


def test_the_slopes_at_rest_differ_by_direction_as_the_magnitudes_do():
    h = 1e-8
    assert physics.smoothed_coulomb_torque(h, 2.0, 3.0, 10.0) / h == pytest.approx(20.0)
    assert physics.smoothed_coulomb_torque(-h, 2.0, 3.0, 10.0) / -h == pytest.approx(30.0)


def test_neither_law_gives_a_torque_at_rest():
    assert physics.smoothed_coulomb_torque(0.0, 2.0, 3.0, 1e3) == 0
    assert physics.coulomb_torque(0.0, 2.0, 3.0) == 0


def test_sticking_includes_its_bounds_and_takes_the_side_of_the_motion_that_would_begin():
    torques = np.array([-3.0001, -3.0, 0.0, 2.0, 2.0001])
    np.testing.assert_array_equal(physics.sticks(torques, 2.0, 3.0), [False, True, True, True, False])
    np.testing.assert_array_equal(physics.sticks(1.5 * torques, 2.0, 3.0, 1.5), [False, True, True, True, False])


@given(
    T=st.floats(-1.0, 1.0, allow_subnormal=False), F_ec1=torque, F_ec2=torque,
    k=st.floats(1e-2, 1e3), c=st.floats(1e-8, 1e-2), N=st.floats(1.0, 400.0),
)
def test_creep_balances_the_torque(T, F_ec1, F_ec2, k, c, N):
    w = physics.creep_speed(T, N, F_ec1, F_ec2, k, c)
    balance = physics.smoothed_coulomb_torque(w, F_ec1, F_ec2, k) + c * w
    assert balance == pytest.approx(T / N, rel=1e-9, abs=1e-300)


@given(x=st.floats(-0.999, 0.999), k=st.floats(1e-2, 1e3), N=st.floats(1.0, 400.0))
def test_undamped_creep_balances_the_torque(x, k, N):
    F_ec1, F_ec2 = 8e-4, 1.1e-3
    T = x * N * (F_ec1 if x > 0 else F_ec2)
    w = physics.undamped_creep_speed(T, N, F_ec1, F_ec2, k)
    assert physics.smoothed_coulomb_torque(w, F_ec1, F_ec2, k) == pytest.approx(T / N, rel=1e-9, abs=1e-300)
    assert w == pytest.approx(physics.creep_speed(T, N, F_ec1, F_ec2, k), rel=1e-15)


def test_damping_only_slows_creep_and_its_limit_is_the_undamped_one():
    case = (0.15, 250.0, 8e-4, 1.1e-3, 0.3)
    undamped = physics.undamped_creep_speed(*case)
    damped = physics.creep_speed(*case, np.array([1e-3, 1e-5, 1e-7, 1e-12]))
    assert np.all(np.diff(damped) > 0)
    assert damped[-1] == pytest.approx(undamped, rel=1e-6)
    assert damped[-1] < undamped


def test_creep_goes_to_zero_as_one_over_the_slope():
    slow, slower = (physics.creep_speed(0.1, 250.0, 8e-4, 1.1e-3, k) for k in (100.0, 1000.0))
    assert slow / slower == pytest.approx(10.0)
    assert slow == pytest.approx(np.arctanh(0.1 / 250.0 / 8e-4) / 100.0)


def test_a_torque_past_the_friction_runs_away_without_damping_and_is_damped_otherwise():
    np.testing.assert_array_equal(
        physics.creep_speed(np.array([-1.0, 0.0, 1.0]), 250.0, 8e-4, 1.1e-3, 100.0), [-np.inf, 0.0, np.inf]
    )
    c = 5e-6
    assert physics.creep_speed(1.0, 250.0, 8e-4, 1.1e-3, 100.0, c) == pytest.approx((1.0 / 250.0 - 8e-4) / c)
    assert physics.creep_speed(-1.0, 250.0, 8e-4, 1.1e-3, 100.0, c) == pytest.approx(-(1.0 / 250.0 - 1.1e-3) / c)


def test_without_friction_damping_alone_sets_the_speed():
    assert physics.creep_speed(1.0, 250.0, 0.0, 0.0, 100.0, 1e-5) == pytest.approx(400.0)
    assert physics.creep_speed(0.0, 250.0, 0.0, 0.0, 100.0) == 0.0
