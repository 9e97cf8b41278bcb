import numpy as np
import pytest
from hypothesis import given
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
