"""The numbers that docs/theory/corrections.md draws from Table II of the paper."""

import numpy as np
import pytest

from servotwin import physics

ANGLE = np.radians([0.0, 45.0, 90.0, 135.0, 180.0])
VOLTAGE = np.array([0.609, 1.002, 1.425, 1.827, 2.246])
COUNT_IN = np.array([250, 411, 582, 748, 920])
PULSE = np.array([646, 1078, 1526, 1974, 2438]) * 1e-6
FEEDBACK = np.array([0.590, 0.912, 1.253, 1.572, 1.908])
COUNT_OUT = np.array([212, 350, 497, 636, 782])


def _line(x, y):
    slope, offset = np.polyfit(x, y, 1)
    return slope, offset, float(np.abs(y - slope * x - offset).max())


def test_fits_of_the_feedback():
    p, b_o, worst = _line(ANGLE, FEEDBACK)
    assert (p, b_o, worst) == pytest.approx((0.4197, 0.5878, 6.0e-3), rel=2e-4)
    k_p, b_i, _ = _line(VOLTAGE, FEEDBACK)
    assert (k_p, b_i) == pytest.approx((0.8041, 0.1038), rel=5e-4)
    s_r, b_t, worst = _line(PULSE, FEEDBACK)
    assert (s_r, b_t, worst) == pytest.approx((735.6, 0.1197, 10.7e-3), rel=1e-3)
    assert -b_t / s_r == pytest.approx(-0.163e-3, rel=5e-3)


def test_as_printed_equation_38_stands_67_degrees_off():
    k_p, p = 0.8041, 0.4197
    printed = physics.angle_from_voltage(k_p * VOLTAGE[0], p)
    assert np.degrees(printed) == pytest.approx(66.85, abs=0.02)
    with_offsets = physics.angle_from_voltage(
        physics.control_voltage_from_voltage(VOLTAGE, k_p, 1.0, 0.1038), p, 0.5878
    )
    assert np.degrees(np.abs(with_offsets - ANGLE)).max() < 1.1


def test_the_two_tables_disagree():
    slope, _, _ = _line(PULSE, np.degrees(ANGLE))
    assert slope * 1e-6 / (180 / 2000) == pytest.approx(1.116, abs=1e-3)
    assert 0.4197 / (1.5 / np.pi) == pytest.approx(0.879, abs=1e-3)


def test_the_two_converters_disagree():
    gain_in, zero_in, _ = _line(VOLTAGE, COUNT_IN)
    gain_out, zero_out, worst = _line(FEEDBACK, COUNT_OUT)
    assert (gain_in, gain_out) == pytest.approx((409.12, 432.65), rel=1e-4)
    assert (zero_in, zero_out) == pytest.approx((0.51, -44.1), abs=0.05)
    assert worst <= 1.0


def test_the_pulse_generator_counts_in_sixteen_microseconds():
    steps = (COUNT_IN - 1) // 6 - 1
    np.testing.assert_allclose(16e-6 * steps + 6e-6, PULSE, rtol=1e-12)


def test_another_pulse_width_in_the_middle_row_would_straighten_the_line():
    moved = PULSE.copy()
    moved[2] = 1542e-6
    assert _line(moved, FEEDBACK)[2] == pytest.approx(2.9e-3, rel=1e-2)
