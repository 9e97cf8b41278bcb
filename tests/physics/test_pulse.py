import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import physics

seconds = st.floats(0, 2e-3)
gains = st.floats(10, 300)
deadbands = st.floats(0, 2e-5)

# "Set S", the example of docs/theory/averaging.md.
R, K_OUT, SUPPLY, DROP, STRETCHER, PULSE_PER_RADIAN = 3.1, 1.03, 6.0, 0.4, 60.0, 573e-6


def test_the_one_shot_is_a_straight_line_that_ends_at_no_width():
    v = np.array([0.0, 0.1, 0.2, 1.0])
    np.testing.assert_allclose(physics.one_shot_width(v, 1e-3, -1.5e-4), [0.0, 0.0, 5e-5, 8.5e-4], atol=1e-18)


def test_the_one_shot_undoes_the_control_voltage_of_a_pulse():
    width = np.linspace(3e-4, 2.7e-3, 7)
    v_c = physics.control_voltage_from_pulse(width, 1.36e-3, -1.6e-4)
    np.testing.assert_allclose(physics.one_shot_width(v_c, 1.36e-3, -1.6e-4), width, rtol=1e-14)


@given(e=seconds, K=gains, w=deadbands, t_min=st.floats(0, 5e-4))
def test_the_drive_time_looks_at_the_size_of_the_error_alone(e, K, w, t_min):
    for tau_s in (None, 0.02):
        assert physics.drive_time(e, K, w, t_min, tau_s) == physics.drive_time(-e, K, w, t_min, tau_s)


@given(w=deadbands, K=gains, t_min=st.floats(1e-5, 5e-4))
def test_the_deadband_has_its_full_width_and_its_edge_is_no_drive(w, K, t_min):
    half = 0.5 * w
    assert physics.drive_time(half, K, w, t_min) == 0.0
    just_beyond = np.nextafter(half, 1.0)
    assert physics.drive_time(just_beyond, K, w, t_min) == pytest.approx(t_min, rel=1e-9)


def test_a_linear_stretcher_is_k_times_what_exceeds_the_deadband():
    assert physics.drive_time(54e-6, 60.0, 8e-6) == pytest.approx(3e-3, rel=1e-12)
    assert physics.drive_time(54e-6, 60.0, 8e-6, 2e-4) == pytest.approx(3.2e-3, rel=1e-12)


@given(e=st.floats(1e-5, 1e-3), K=gains)
def test_an_rc_stretcher_starts_linear_and_then_falls_behind(e, K):
    linear = physics.drive_time(e, K)
    assert physics.drive_time(e, K, stretcher_time_constant=0.02) < linear
    assert physics.drive_time(e, K, stretcher_time_constant=1e6) == pytest.approx(linear, rel=1e-6)
    rc = physics.drive_time(e, K, stretcher_time_constant=0.02)
    assert K * e == pytest.approx(0.02 * math.expm1(rc / 0.02), rel=1e-12)


@given(T_f=st.floats(3e-3, 0.025), K=gains, w=deadbands, t_min=st.floats(0, 5e-4))
def test_at_the_full_drive_error_the_drive_lasts_a_frame(T_f, K, w, t_min):
    for tau_s in (None, 0.02):
        e = physics.full_drive_error(T_f, K, w, t_min, tau_s)
        assert physics.drive_time(e, K, w, t_min, tau_s) == pytest.approx(T_f, rel=1e-10)


def test_the_stiffness_of_set_s_goes_as_the_frame_rate():
    stiffness = [physics.pulse_stiffness(K_OUT / R, SUPPLY - DROP, STRETCHER, PULSE_PER_RADIAN, T_f)
                 for T_f in (0.02, 0.01, 0.005)]
    assert stiffness[0] == pytest.approx(1.03 / 3.1 * 5.6 * 60 * 573e-6 / 0.02, rel=1e-14)
    np.testing.assert_allclose(np.divide(stiffness, stiffness[0]), [1.0, 2.0, 4.0], rtol=1e-14)


@given(T_f=st.floats(3e-3, 0.025), K=gains, s_r=st.floats(700, 1000), p=st.floats(0.2, 0.8))
def test_the_stiffness_is_that_of_the_averaged_gain(T_f, K, s_r, p):
    gain = physics.averaged_bridge_gain(SUPPLY, DROP, K, T_f, 1.0 / s_r)
    stiffness = physics.pulse_stiffness(K_OUT / R, SUPPLY - DROP, K, p / s_r, T_f)
    assert stiffness == pytest.approx(K_OUT / R * gain * p, rel=1e-12)


def test_the_stiffness_is_the_slope_of_the_mean_torque():
    # Drive times of two errors, times the stalled torque, over a frame: no more than what the definitions say.
    T_f, w, q = 0.02, 8e-6, np.radians([1.0, 1.5])
    t_on = physics.drive_time(PULSE_PER_RADIAN * q, STRETCHER, w)
    current = physics.bridge_current(SUPPLY, 0.0, DROP, R)
    torque = K_OUT * current * t_on / T_f
    slope = (torque[1] - torque[0]) / (q[1] - q[0])
    assert slope == pytest.approx(
        physics.pulse_stiffness(K_OUT / R, SUPPLY - DROP, STRETCHER, PULSE_PER_RADIAN, T_f), rel=1e-12)
