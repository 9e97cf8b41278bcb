import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

volts = st.floats(-20, 20, allow_subnormal=False)
drops = st.floats(0, 3)
ohms = st.floats(0.1, 20)

R_A, R_C, R_B, V_OC, V_CE0, V_BR = 3.1, 0.2, 0.5, 6.0, 0.4, 0.3


@given(u=volts, v_b=volts, R=ohms)
def test_without_drops_it_is_ohms_law(u, v_b, R):
    assert physics.bridge_current(u, v_b, 0.0, R) == pytest.approx((u - v_b) / R, rel=1e-14, abs=0.0)


@given(u=volts, v_b=volts, D=drops, R=ohms)
def test_a_drop_never_makes_a_current_turn_or_grow(u, v_b, D, R):
    i, plain = physics.bridge_current(u, v_b, D, R), physics.bridge_current(u, v_b, 0.0, R)
    assert i * plain >= 0.0
    assert abs(i) <= abs(plain)
    assert (i == 0.0) == (abs(u - v_b) <= D)


@given(u=volts, v_b=volts, D=drops, R=ohms)
def test_the_other_way_round_everything_changes_sign(u, v_b, D, R):
    assert physics.bridge_current(-u, -v_b, D, R) == -physics.bridge_current(u, v_b, D, R)


def test_the_stalled_current_and_the_speed_without_current():
    D, R = V_CE0 + V_BR, R_A + R_C + R_B
    assert physics.bridge_current(V_OC, 0.0, D, R) == pytest.approx(5.3 / 3.8, rel=1e-14)
    assert physics.bridge_current(V_OC, V_OC - D, D, R) == pytest.approx(0.0, abs=1e-15)


def test_driving_against_the_motion_draws_up_to_twice_the_stalled_current():
    no_load = V_OC - V_CE0
    stalled = physics.bridge_current(V_OC, 0.0, V_CE0, R_A)
    assert physics.bridge_current(V_OC, -no_load, V_CE0, R_A) == pytest.approx(2.0 * stalled, rel=1e-14)


def test_a_coasting_motor_feeds_the_source_only_above_its_voltage():
    D = V_OC + V_CE0 + V_BR
    v_b = np.array([-8.0, -6.7, 0.0, 6.7, 8.0])
    np.testing.assert_allclose(physics.bridge_current(0.0, v_b, D, R_A + R_B), [1.3 / 3.6, 0, 0, 0, -1.3 / 3.6],
                               atol=1e-15)


@given(u=st.sampled_from([-V_OC, V_OC]), v_b=volts)
def test_the_voltage_at_the_motor_is_what_bridge_and_source_leave(u, v_b):
    i = physics.bridge_current(u, v_b, V_CE0 + V_BR, R_A + R_C + R_B)
    v_a = physics.motor_voltage(i, v_b, R_A, V_BR, v_b)
    left = u - (R_C + R_B) * i - np.copysign(V_CE0, i) if i != 0.0 else v_b
    assert v_a == pytest.approx(left, rel=1e-12, abs=1e-12)


@given(v_b=volts)
def test_a_braked_motor_has_no_voltage(v_b):
    i = physics.bridge_current(0.0, v_b, V_BR, R_A)
    assert physics.motor_voltage(i, v_b, R_A, V_BR, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert i * v_b <= 0.0  # it brakes
