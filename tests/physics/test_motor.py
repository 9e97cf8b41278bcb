import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

moderate = st.floats(-1e3, 1e3, allow_subnormal=False)
positive = st.floats(1e-3, 1e3)


def test_equation_7_is_recovered_from_the_current_rate():
    v_a, i_a, w, R_a, L_a, k_b = 6.0, 0.7, 310.0, 3.1, 4e-4, 4e-3
    rate = physics.armature_current_rate(v_a, i_a, w, R_a, L_a, k_b)
    assert L_a * rate + R_a * i_a + physics.back_emf(w, k_b) == pytest.approx(v_a, rel=1e-14)


@given(v_a=moderate, w=moderate, R_a=positive, k_b=positive)
def test_the_steady_current_has_no_rate(v_a, w, R_a, k_b):
    i_a = physics.steady_armature_current(v_a, w, R_a, k_b)
    rate = physics.armature_current_rate(v_a, i_a, w, R_a, 1.0, k_b)
    assert rate == pytest.approx(0.0, abs=1e-12 * (1 + abs(v_a) + abs(k_b * w)))


def test_equation_11_matches_torque_and_motion_of_the_bare_motor():
    # A bare motor turning exponentially up to speed: q̇ = w (1 − e^{−t/T}), T = J_m/(B_m + k_a k_b/R_a)
    R_a, k, J_m, B_m, v_a = 3.1, 4e-3, 1e-7, 2e-7, 5.0
    damping = B_m + k * k / R_a
    T, w_end = J_m / damping, k * v_a / R_a / damping
    t = np.linspace(0.0, 5 * T, 50)
    w, acceleration = w_end * -np.expm1(-t / T), w_end / T * np.exp(-t / T)
    made = physics.electromagnetic_torque(physics.steady_armature_current(v_a, w, R_a, k), k)
    np.testing.assert_allclose(made, physics.required_motor_torque(acceleration, w, J_m, B_m), rtol=1e-11, atol=1e-18)


@given(i_a=moderate, w=moderate, k=positive)
def test_equal_constants_conserve_power_between_circuit_and_shaft(i_a, w, k):
    electrical = physics.back_emf(w, k) * i_a
    assert electrical == pytest.approx(physics.electromagnetic_torque(i_a, k) * w, rel=1e-12)


def test_signs_follow_current_and_speed():
    assert physics.electromagnetic_torque(-1.0, 4e-3) < 0 < physics.electromagnetic_torque(1.0, 4e-3)
    assert physics.steady_armature_current(0.0, 100.0, 3.0, 4e-3) < 0  # a turning shorted motor brakes itself


def test_the_current_rate_leads_to_the_steady_current():
    i_a, dt = 0.0, 1e-6
    for _ in range(2000):
        i_a += dt * physics.armature_current_rate(6.0, i_a, 100.0, 3.0, 3e-4, 4e-3)
    assert i_a == pytest.approx(physics.steady_armature_current(6.0, 100.0, 3.0, 4e-3), rel=1e-6)
