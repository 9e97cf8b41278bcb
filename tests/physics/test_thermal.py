import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from servotwin import physics

MASSES = {"winding_capacity": 2.0, "housing_capacity": 30.0, "winding_to_housing": 8.0, "housing_to_ambient": 16.0}
positive = st.floats(0.1, 100.0)


def matrix(winding_capacity, housing_capacity, winding_to_housing, housing_to_ambient):
    a, b = 1.0 / (winding_capacity * winding_to_housing), 1.0 / (housing_capacity * winding_to_housing)
    return np.array([[-a, a], [b, -b - 1.0 / (housing_capacity * housing_to_ambient)]])


def test_copper_has_its_value_at_25_degrees_and_a_tenth_more_26_kelvin_above():
    assert physics.winding_resistance(298.15, 3.1) == 3.1
    assert physics.winding_resistance(298.15 + 0.1 / 0.00385, 3.0) == pytest.approx(3.3, rel=1e-12)


def test_copper_agrees_with_its_coefficient_at_20_degrees():
    at_20 = physics.winding_resistance(293.15, 1.0)
    assert physics.winding_resistance(393.15, 1.0) / at_20 == pytest.approx(1.0 + 100.0 * 0.00393, rel=5e-4)


def test_magnets_weaken_with_heat():
    assert physics.magnet_factor(298.15, -0.0015) == 1.0
    assert physics.magnet_factor(348.15, -0.002) == pytest.approx(0.9)


@settings(deadline=None)
@given(C_w=positive, C_h=positive, R_wh=positive, R_ha=positive)
def test_time_constants_are_those_of_the_matrix(C_w, C_h, R_wh, R_ha):
    times = physics.thermal_time_constants(winding_capacity=C_w, housing_capacity=C_h, winding_to_housing=R_wh,
                                           housing_to_ambient=R_ha)
    rates = np.sort(np.linalg.eigvals(matrix(C_w, C_h, R_wh, R_ha)).real)
    np.testing.assert_allclose([-1.0 / times.fast, -1.0 / times.slow], rates, rtol=1e-8)


def test_a_light_winding_knows_its_own_time_and_then_the_housing_s():
    times = physics.thermal_time_constants(winding_capacity=1e-4, housing_capacity=30.0, winding_to_housing=8.0,
                                           housing_to_ambient=16.0)
    assert times.fast == pytest.approx(8e-4, rel=1e-4)
    assert times.slow == pytest.approx(480.0, rel=1e-4)


@pytest.mark.long
@settings(deadline=None)
@given(t=st.floats(0.0, 2000.0), P=st.floats(0.0, 20.0), T_w=st.floats(250.0, 450.0), T_h=st.floats(250.0, 450.0))
def test_the_closed_form_is_the_matrix_exponential(t, P, T_w, T_h):
    A = matrix(**MASSES)
    end = np.linalg.solve(A, -np.array([P / 2.0, 300.0 / (30.0 * 16.0)]))
    expected = end + expm(A * t) @ (np.array([T_w, T_h]) - end)
    np.testing.assert_allclose(physics.two_mass_temperatures(t, P, T_w, T_h, ambient=300.0, **MASSES), expected,
                               rtol=1e-11)


def test_the_closed_form_solves_the_two_equations():
    def rates(t, T):
        return [(5.0 - (T[0] - T[1]) / 8.0) / 2.0, ((T[0] - T[1]) / 8.0 - (T[1] - 298.15) / 16.0) / 30.0]

    t = np.linspace(0.0, 300.0, 31)
    run = solve_ivp(rates, (0.0, 300.0), [298.15, 298.15], t_eval=t, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(physics.two_mass_temperatures(t, 5.0, **MASSES), run.y, rtol=1e-9)


def test_it_starts_where_it_is_said_to_and_ends_steady():
    assert physics.two_mass_temperatures(0.0, 3.0, 350.0, 320.0, **MASSES) == pytest.approx((350.0, 320.0), rel=1e-15)
    steady = physics.steady_temperatures(3.0, winding_to_housing=8.0, housing_to_ambient=16.0)
    assert steady == pytest.approx((298.15 + 72.0, 298.15 + 48.0))
    assert physics.two_mass_temperatures(1e5, 3.0, 400.0, 250.0, **MASSES) == pytest.approx(steady, rel=1e-14)


def test_all_heat_is_in_the_masses_or_in_the_air():
    t = np.linspace(0.0, 200.0, 20_001)
    warm = physics.two_mass_temperatures(t, 4.0, **MASSES)
    lost = np.trapezoid((warm.housing - 298.15) / 16.0, t)
    stored = 2.0 * (warm.winding[-1] - 298.15) + 30.0 * (warm.housing[-1] - 298.15)
    assert stored + lost == pytest.approx(4.0 * 200.0, rel=1e-8)


def test_at_first_the_winding_warms_up_alone():
    warm = physics.two_mass_temperatures(1e-3, 10.0, **MASSES)
    assert (warm.winding - 298.15) / 1e-3 == pytest.approx(10.0 / 2.0, rel=1e-4)
    assert warm.housing - 298.15 == pytest.approx(0.5 * (10.0 / 2.0) * 1e-6 / (30.0 * 8.0), rel=1e-2)
