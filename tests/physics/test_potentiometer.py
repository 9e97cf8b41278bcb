import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servotwin import physics

volts = st.floats(-10, 10, allow_subnormal=False)


@given(q=st.floats(-7, 7), p=st.floats(0.1, 2.0), b_o=volts)
def test_angle_and_voltage_are_inverse(q, p, b_o):
    assert physics.angle_from_voltage(physics.feedback_voltage(q, p, b_o), p, b_o) == pytest.approx(q, abs=1e-12)


def test_the_offset_is_the_voltage_at_zero():
    assert physics.feedback_voltage(0.0, 0.42, 0.588) == 0.588
    assert physics.feedback_voltage(1.0, 0.42) == 0.42


@given(v=volts, step=st.floats(1e-3, 1.0))
def test_quantisation_errs_by_half_a_count_at_most_and_only_once(v, step):
    seen = physics.quantised(v, step)
    assert abs(seen - v) <= step / 2 * (1 + 1e-9) + 1e-12
    assert physics.quantised(seen, step) == pytest.approx(seen, abs=1e-12)


def test_half_a_count_goes_up():
    np.testing.assert_array_equal(physics.quantised(np.array([-0.5, 0.5, 1.5]), 1.0), [0.0, 1.0, 2.0])


ANGLES, ERRORS = [-1.0, 0.0, 0.5, 2.0], [0.0, 0.03, -0.02, 0.01]


def test_the_error_is_that_of_the_table_at_its_points_linear_between_and_held_at_its_ends():
    np.testing.assert_allclose(physics.linearity_error(np.array(ANGLES), ANGLES, ERRORS), ERRORS, atol=0.0)
    assert physics.linearity_error(0.25, ANGLES, ERRORS) == pytest.approx(0.005)
    assert physics.linearity_error(-9.0, ANGLES, ERRORS) == 0.0
    assert physics.linearity_error(9.0, ANGLES, ERRORS) == 0.01


@settings(deadline=None)
@given(q=st.floats(-7, 7), p=st.floats(0.1, 2.0), b_o=volts)
def test_without_errors_a_real_potentiometer_is_an_ideal_one(q, p, b_o):
    v = physics.feedback_voltage(q, p, b_o)
    assert physics.sensed_voltage(q, p, b_o) == v
    assert physics.angle_from_sensed_voltage(v, p, b_o) == physics.angle_from_voltage(v, p, b_o)


@pytest.mark.long
@settings(deadline=None)
@given(q=st.floats(-4, 4), p=st.floats(0.15, 2.0), b_o=st.floats(-1.0, 1.0))
def test_angle_and_voltage_with_errors_are_inverse(q, p, b_o):
    v = physics.sensed_voltage(q, p, b_o, ANGLES, ERRORS)
    assert physics.angle_from_sensed_voltage(v, p, b_o, ANGLES, ERRORS) == pytest.approx(q, abs=1e-13)


def test_the_inverse_takes_columns_of_everything_but_the_table():
    v, p, b_o = np.linspace(0.2, 1.8, 5), np.array([[0.3], [0.6]]), np.array([[0.5], [0.6]])
    q = physics.angle_from_sensed_voltage(v, p, b_o, ANGLES, ERRORS)
    assert q.shape == (2, 5)
    np.testing.assert_allclose(physics.sensed_voltage(q, p, b_o, ANGLES, ERRORS), v + 0.0 * p, atol=1e-15)


def test_where_the_curve_turns_back_the_angle_is_one_at_which_it_rises():
    angles, errors = [0.0, 1.0, 2.0], [0.0, 1.0, -1.0]  # with p = 1 the voltage falls from 2 to 1 between 1 and 2
    q = physics.angle_from_sensed_voltage(1.5, 1.0, 0.0, angles, errors)
    assert physics.sensed_voltage(q, 1.0, 0.0, angles, errors) == pytest.approx(1.5)
    assert q == pytest.approx(0.75) or q == pytest.approx(2.5)


def test_a_converter_counts_what_the_errors_have_made():
    v = physics.sensed_voltage(0.25, 0.42, 0.588, ANGLES, ERRORS, 0.00244)
    assert v == physics.quantised(0.588 + 0.42 * 0.25 + physics.linearity_error(0.25, ANGLES, ERRORS), 0.00244)
