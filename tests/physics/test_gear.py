import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

positive = st.floats(1e-6, 1e3)
ratio = st.floats(1.0, 1e3)


@given(J_m=positive, J_L=positive, N=ratio)
def test_kinetic_energy_does_not_depend_on_the_shaft_it_is_seen_from(J_m, J_L, N):
    output_speed = 1.7
    motor_speed = physics.motor_from_output(output_speed, N)
    both = J_m * motor_speed**2 + J_L * output_speed**2
    assert physics.reflected_inertia(J_m, J_L, N) * motor_speed**2 == pytest.approx(both, rel=1e-12)
    assert physics.output_inertia(J_m, J_L, N) * output_speed**2 == pytest.approx(both, rel=1e-12)


@given(B_m=positive, B_L=positive, N=ratio)
def test_viscous_loss_does_not_depend_on_the_shaft_it_is_seen_from(B_m, B_L, N):
    output_speed = -0.6
    motor_speed = physics.motor_from_output(output_speed, N)
    both = B_m * motor_speed**2 + B_L * output_speed**2
    assert physics.reflected_viscous_friction(B_m, B_L, N) * motor_speed**2 == pytest.approx(both, rel=1e-12)
    assert physics.output_viscous_friction(B_m, B_L, N) * output_speed**2 == pytest.approx(both, rel=1e-12)


def test_a_reduction_of_one_joins_the_shafts():
    assert physics.motor_from_output(0.25, 1.0) == 0.25
    assert physics.reflected_inertia(2.0, 3.0, 1.0) == physics.output_inertia(2.0, 3.0, 1.0) == 5.0
    assert physics.reflected_viscous_friction(2.0, 3.0, 1.0) == physics.output_viscous_friction(2.0, 3.0, 1.0) == 5.0


def test_equations_16_and_17_are_the_same_transfer_function():
    J_m, B_m, J_L, B_L, N = 1e-7, 2e-7, 3e-3, 4e-4, 250.0
    s = 1j * np.logspace(-1, 3, 40) + 0.3
    n = 1 / N
    forward = n / ((J_m * s + B_m) * s)
    looped = forward / (1 + forward * n * s * (J_L * s + B_L))
    J_o = physics.reflected_inertia(J_m, J_L, N)
    B_o = physics.reflected_viscous_friction(B_m, B_L, N)
    np.testing.assert_allclose(looped, n / ((J_o * s + B_o) * s), rtol=1e-12)


def test_equation_22_follows_from_the_laws_it_was_built_from():
    R_a, L_a, k_a, k_b, J_m, B_m, J_L, B_L, N = 3.1, 4e-4, 4e-3, 4.2e-3, 1e-7, 2e-7, 3e-3, 4e-4, 250.0
    s = 1j * np.logspace(-1, 4, 40) + 0.3
    J_o = physics.reflected_inertia(J_m, J_L, N)
    B_o = physics.reflected_viscous_friction(B_m, B_L, N)
    # Unknown: the current and the motor angle, for 1 V; rows are eq. 7 and the torque balance of the motor shaft.
    theta_m = np.array([
        np.linalg.solve([[L_a * x + R_a, k_b * x], [k_a, -(J_o * x + B_o) * x]], [1.0, 0.0])[1] for x in s
    ])
    printed = k_a / N / (((L_a * s + R_a) * (J_o * s + B_o) + k_a * k_b) * s)
    np.testing.assert_allclose(theta_m / N, printed, rtol=1e-10)
