"""Load-dependent gear friction: the joined law against M1 to M6 one by one, and what it means for a gear."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

torque = st.floats(-2.0, 2.0, allow_subnormal=False)
share = st.floats(0.0, 0.6)
K_C, R, W_S, ALPHA = 0.2, 1.4, 0.3, 1.5
K_CS = K_C * (R - 1.0)
SPEEDS = np.linspace(-1.0, 1.0, 9)
TORQUES = np.array(list(itertools.product([-1.5, -0.7, 0.0, 0.7, 1.1], repeat=2)))
BASE = {"coulomb_torque": K_C, "breakaway_ratio": R, "stribeck_speed": W_S, "stribeck_exponent": ALPHA}


def grid():
    """Speeds as a column, and both torques."""
    return SPEEDS[:, None], TORQUES[:, 0], TORQUES[:, 1]


def fading():
    return np.exp(-np.abs(SPEEDS[:, None] / W_S) ** ALPHA)


def test_the_static_part_fades_as_it_was_asked_to():
    assert physics.stribeck_factor(0.0, 0.3, 2.0) == 1.0
    assert physics.stribeck_factor(-0.3, 0.3, 2.0) == pytest.approx(np.exp(-1.0), rel=1e-15)
    assert physics.stribeck_factor(0.6, 0.3, 2.0) == pytest.approx(np.exp(-4.0), rel=1e-15)
    assert physics.stribeck_factor(0.6, 0.3) == pytest.approx(np.exp(-2.0), rel=1e-15)


def test_without_a_stribeck_speed_motion_ends_it_at_once():
    np.testing.assert_array_equal(physics.stribeck_factor(np.array([-1e-300, 0.0, 1e-300])), [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(physics.stribeck_factor(np.array([-0.1, 0.0, 0.1]), 1e-9, 4.0), [0.0, 1.0, 0.0])


def test_no_speed_is_too_large_for_it():
    assert physics.stribeck_factor(1e200, 1e-100, 3.0) == 0.0


def test_m1_and_m2():
    w, m, e = grid()
    np.testing.assert_allclose(
        physics.gear_friction_budget(w, m, e, coulomb_torque=K_C), np.full((9, 25), K_C), rtol=1e-15)
    np.testing.assert_allclose(physics.gear_friction_budget(w, m, e, **BASE), K_C + fading() * K_CS + 0.0 * m,
                               rtol=1e-15)


def test_m3_and_m4():
    w, m, e = grid()
    np.testing.assert_allclose(
        physics.gear_friction_budget(w, m, e, coulomb_torque=K_C, load_friction_motor=0.1, load_friction_external=0.1),
        K_C + 0.1 * np.abs(m - e) + 0.0 * w, rtol=1e-14)
    np.testing.assert_allclose(
        physics.gear_friction_budget(w, m, e, **BASE, load_friction_motor=0.1, load_friction_external=0.1,
                                     load_friction_motor_stribeck=0.05, load_friction_external_stribeck=0.05),
        K_C + 0.1 * np.abs(m - e) + fading() * (K_CS + 0.05 * np.abs(m - e)), rtol=1e-14)


def test_m5_and_m6():
    w, m, e = grid()
    shares = {"load_friction_motor": 0.08, "load_friction_external": 0.2, "load_friction_motor_stribeck": 0.03,
              "load_friction_external_stribeck": 0.1}
    m5 = K_C + np.abs(0.08 * m - 0.2 * e) + fading() * (K_CS + np.abs(0.03 * m - 0.1 * e))
    np.testing.assert_allclose(physics.gear_friction_budget(w, m, e, **BASE, **shares), m5, rtol=1e-14)
    Q = [0.0 if np.sign(a) == np.sign(b) or abs(a) == abs(b) else 0.5 * b**2 if abs(a) > abs(b) else 0.3 * a**2
         for a, b in TORQUES]
    np.testing.assert_allclose(
        physics.gear_friction_budget(w, m, e, **BASE, **shares, load_friction_motor_quad=0.3,
                                     load_friction_external_quad=0.5), m5 + fading() * Q, rtol=1e-14)


@given(m=torque, e=torque, K_mq=share, K_eq=share)
def test_the_quadratic_part_is_that_of_the_smaller_torque_where_they_oppose(m, e, K_mq, K_eq):
    Q = physics.quadratic_gear_friction(m, e, K_mq, K_eq)
    assert 0.0 <= Q <= max(K_mq, K_eq) * min(abs(m), abs(e)) ** 2
    assert physics.quadratic_gear_friction(-m, -e, K_mq, K_eq) == Q
    if m * e > 0.0:
        assert Q == 0.0


@given(m=torque, e=torque, K_m=share, K_e=share, w=st.floats(-1.0, 1.0))
def test_friction_does_not_know_left_from_right_apart_from_coulomb(m, e, K_m, K_e, w):
    shares = {"load_friction_motor": K_m, "load_friction_external": K_e}
    assert physics.gear_friction_budget(w, m, e, **BASE, **shares) == physics.gear_friction_budget(
        -w, -m, -e, **BASE, **shares)


def test_a_motor_that_holds_a_load_presses_with_the_sum_of_both():
    held = physics.gear_friction_budget(0.0, 0.5, -0.5, coulomb_torque=0.2, load_friction_motor=0.1,
                                        load_friction_external=0.1)
    assert held == pytest.approx(0.2 + 0.1 * 1.0)


@given(tau=torque, F=st.floats(0.0, 0.5), B=st.floats(0.0, 0.5), r=st.floats(1.0, 2.0), N=st.floats(1.0, 400.0))
def test_without_shares_it_sticks_as_the_motor_shaft_does(tau, F, B, r, N):
    at_motor = physics.sticks(tau, F, B, r)
    at_output = physics.gear_sticks(N * tau * (1.0 + 1e-12 * (1 if at_motor is False else -1)), 0.0,
                                    coulomb_torque_forward=N * F, coulomb_torque_backward=N * B, breakaway_ratio=r)
    assert at_output == at_motor or abs(tau) == pytest.approx(r * (F if tau > 0.0 else B), rel=1e-11)


def test_dry_friction_of_the_load_adds_to_both_bounds():
    friction = {"coulomb_torque_forward": 0.2, "coulomb_torque_backward": 0.3, "load_coulomb_torque": 0.1}
    np.testing.assert_array_equal(
        physics.gear_sticks(np.array([-0.41, -0.39, 0.29, 0.31]), 0.0, **friction), [False, True, True, False])


@pytest.mark.parametrize(("K_m", "K_e"), [(0.0, 0.0), (0.1, 0.1), (0.1, 0.3), (0.4, 1.2)])
def test_forward_efficiency_is_the_load_that_a_sliding_gear_carries_at_constant_speed(K_m, K_e):
    tau_m, eta = 1.0, physics.forward_efficiency(K_m, K_e)
    tau_e = -eta * tau_m
    G = physics.gear_friction_budget(1.0, tau_m, tau_e, coulomb_torque=0.0, load_friction_motor=K_m,
                                     load_friction_external=K_e)
    assert tau_m + tau_e - G == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("K_e", [0.0, 0.3, 0.9])
def test_the_torque_that_back_drives_is_where_an_unpowered_gear_stops_sticking(K_e):
    friction = {"coulomb_torque_forward": 0.2, "coulomb_torque_backward": 0.2, "load_friction_external": K_e}
    tau = physics.back_drive_torque(0.2, K_e)
    assert physics.gear_sticks(0.0, 0.999 * tau, **friction) is True
    assert physics.gear_sticks(0.0, 1.001 * tau, **friction) is False


def test_a_worm_gear_cannot_be_driven_back():
    assert physics.back_drive_torque(0.2, 1.0) == np.inf
    assert physics.gear_sticks(0.0, -1e6, coulomb_torque_forward=0.2, coulomb_torque_backward=0.2,
                               load_friction_external=1.0) is True


def test_a_load_is_held_between_the_torque_that_lets_it_sink_and_the_one_that_lifts_it():
    T, r, tau_c, K_m, K_e, K_ms, K_es = 1.0, 1.2, 0.1, 0.05, 0.2, 0.02, 0.1
    friction = {"coulomb_torque_forward": tau_c, "coulomb_torque_backward": tau_c, "breakaway_ratio": r,
                "load_friction_motor": K_m, "load_friction_external": K_e, "load_friction_motor_stribeck": K_ms,
                "load_friction_external_stribeck": K_es}
    lowest = (T * (1.0 - K_e - K_es) - r * tau_c) / (1.0 + K_m + K_ms)
    highest = (T * (1.0 + K_e + K_es) + r * tau_c) / (1.0 - K_m - K_ms)
    tau_m = np.array([lowest - 1e-9, lowest + 1e-9, T, highest - 1e-9, highest + 1e-9])
    np.testing.assert_array_equal(physics.gear_sticks(tau_m, -T, **friction), [False, True, True, True, False])
