import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

volts = st.floats(-10, 10, allow_subnormal=False)

# The example of docs/theory/bounded.md; "set S" in the names of tests below.
SUPPLY, DROP, STRETCHER, FRAME, PULSE_PER_RADIAN = 6.0, 0.4, 60.0, 0.02, 573e-6


def test_the_deadband_is_full_width_centred_and_continuous():
    e = np.array([-0.31, -0.1, -0.05, 0.0, 0.1, 0.1 + 1e-12, 0.31])
    np.testing.assert_allclose(
        physics.comparator_voltage(e, 0.2), [-0.21, 0.0, 0.0, 0.0, 0.0, 1e-12, 0.21], rtol=1e-3, atol=1e-16
    )


@given(e=volts, w_v=st.floats(0, 3))
def test_the_comparator_is_odd_and_never_larger_than_the_error(e, w_v):
    v_d = physics.comparator_voltage(e, w_v)
    assert v_d == -physics.comparator_voltage(-e, w_v)
    assert abs(v_d) <= abs(e)
    assert v_d * e >= 0


@given(v_c=volts, v_o=volts, A=st.floats(0.1, 100), k_s=st.floats(0.1, 100))
def test_without_deadband_and_limit_the_bounded_voltage_is_equation_38(v_c, v_o, A, k_s):
    error = physics.feedback_error(v_c, v_o)
    assert physics.bounded_armature_voltage(error, 0.0, A, k_s, np.inf) == pytest.approx(
        physics.unbounded_armature_voltage(v_c, v_o, A, k_s), rel=1e-12
    )


@given(e=volts, w_v=st.floats(0, 3), A=st.floats(0.1, 100), k_s=st.floats(0.1, 100), V_max=st.floats(0, 12))
def test_the_bounded_voltage_keeps_its_bound(e, w_v, A, k_s, V_max):
    assert abs(physics.bounded_armature_voltage(e, w_v, A, k_s, V_max)) <= V_max


def test_a_positive_error_drives_to_positive_angles():
    assert physics.feedback_error(1.5, 1.0) > 0
    assert physics.unbounded_armature_voltage(1.5, 1.0, 10.0, 2.0) > 0


def test_the_two_kinds_of_command_give_one_control_voltage():
    k_p1, t_0, s_r, b_t = 1092.9e-6, -21.5e-6, 735.6, 0.1197  # fits of the paper's Table II
    v_i = np.array([0.609, 1.425, 2.246])
    t_a = physics.pulse_width_from_voltage(v_i, k_p1, t_0)
    by_pulse = physics.control_voltage_from_pulse(t_a, 1 / s_r, -b_t / s_r)
    np.testing.assert_allclose(by_pulse, s_r * t_a + b_t, rtol=1e-13)
    by_voltage = physics.control_voltage_from_voltage(v_i, k_p1, s_r, s_r * t_0 + b_t)
    np.testing.assert_allclose(by_pulse, by_voltage, rtol=1e-13)


def test_the_averaged_gain_of_set_s_does_not_depend_on_the_potentiometer():
    for p in (0.3, 0.4197, 0.6):
        gain = physics.averaged_bridge_gain(SUPPLY, DROP, STRETCHER, FRAME, PULSE_PER_RADIAN / p)
        assert gain * p == pytest.approx(5.6 * 60 * 573e-6 / 0.02, rel=1e-13)


def test_the_averaged_gain_is_the_mean_of_the_pulses():
    one_shot_slope, error = 1.36e-3, 0.05
    on_time = STRETCHER * error * one_shot_slope
    assert on_time < FRAME
    mean = (SUPPLY - DROP) * on_time / FRAME
    gain = physics.averaged_bridge_gain(SUPPLY, DROP, STRETCHER, FRAME, one_shot_slope)
    assert physics.bounded_armature_voltage(error, 0.0, gain, 1.0, SUPPLY - DROP) == pytest.approx(mean, rel=1e-13)


def test_the_mean_voltage_servo_of_set_s_sags_by_about_two_degrees():
    # 0.3 N m against 0.2 N m of Coulomb friction: the shaft stops where the drive carries the difference.
    R, K_out, w, p = 3.1, 1.03, 8e-6, 0.4197
    gain = physics.averaged_bridge_gain(SUPPLY, DROP, STRETCHER, FRAME, PULSE_PER_RADIAN / p)
    sag = np.radians(2.2)
    w_v = w / (PULSE_PER_RADIAN / p)
    v_a = physics.bounded_armature_voltage(p * sag, w_v, gain, 1.0, SUPPLY - DROP)
    assert K_out * v_a / R == pytest.approx(0.1, abs=0.001)
