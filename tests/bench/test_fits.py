"""The fits of the paper's Table II, as the theory pages quote them."""

import numpy as np
import pytest

from servotwin.bench import curvature_test, fit_line, table_fits
from servotwin.errors import InputError

# name: slope, its error, intercept, its error, largest residual; in the table's units
QUOTED = {
    "q(V_i)": ((109.77, 0.005), (0.69, 0.005), (-66.07, 0.005), (1.06, 0.005), (1.08, 0.005)),
    "q(t_a)": ((0.10043, 5e-6), (0.00072, 5e-6), (-63.90, 0.005), (1.19, 0.005), (0.98, 0.005)),
    "V_o(q)": ((7.324e-3, 5e-7), (0.039e-3, 5e-7), (0.5878, 5e-5), (0.0043, 5e-5), (6.0e-3, 5e-5)),
    "V_o(V_i)": ((0.8041, 5e-5), (0.0026, 5e-5), (0.1038, 5e-5), (0.0040, 5e-5), (3.4e-3, 5e-5)),
    "V_o(t_a)": ((735.6e-6, 5e-8), (5.3e-6, 5e-8), (0.1197, 5e-5), (0.0087, 5e-5), (10.7e-3, 5e-5)),
    "t_a(V_i)": ((1092.9, 0.05), (5.4, 0.05), (-21.5, 0.05), (8.3, 0.05), (9.9, 0.05)),
    "ADC_i(V_i)": ((409.12, 0.005), (0.78, 0.005), (0.5, 0.05), (1.2, 0.05), (1.51, 0.005)),
    "ADC_o(V_o)": ((432.65, 0.005), (0.84, 0.005), (-44.1, 0.05), (1.1, 0.05), (1.0, 0.005)),
}


@pytest.mark.parametrize("name", QUOTED)
def test_quoted_numbers(fits, name):
    line = fits[name].line
    found = (line.slope, line.slope_error, line.intercept, line.intercept_error, line.max_residual)
    for value, (quoted, digits) in zip(found, QUOTED[name], strict=True):
        assert value == pytest.approx(quoted, abs=1.001 * digits)


def test_residuals_of_the_curved_fit(fits):
    assert fits["q(t_a)"].line.residuals == pytest.approx([-0.98, 0.64, 0.64, 0.65, -0.95], abs=0.005)


def test_only_the_angle_over_pulse_width_is_curved(fits):
    assert [name for name, fit in fits.items() if fit.curvature.p_value < 0.05] == ["q(t_a)"]


def test_against_numpy_with_covariance():
    rng = np.random.default_rng(3)
    x = rng.uniform(-2.0, 5.0, 12)
    y = 3.0 * x - 1.0 + rng.normal(0.0, 0.2, 12)
    line = fit_line(x, y)
    best, covariance = np.polyfit(x, y, 1, cov=True)
    assert (line.slope, line.intercept) == pytest.approx(tuple(best), rel=1e-10)
    assert (line.slope_error, line.intercept_error) == pytest.approx(tuple(np.sqrt(np.diag(covariance))), rel=1e-9)


def test_curvature_against_numpy_and_the_fisher_distribution():
    from scipy.stats import f

    rng = np.random.default_rng(4)
    x = rng.uniform(500.0, 2500.0, 9)
    y = 0.1 * x - 2e-6 * x**2 + rng.normal(0.0, 0.5, 9)
    test = curvature_test(x, y)
    best, covariance = np.polyfit(x - x.mean(), y, 2, cov=True)
    assert (test.quadratic, test.quadratic_error) == pytest.approx((best[0], np.sqrt(covariance[0, 0])), rel=1e-8)
    straight = sum(r * r for r in fit_line(x, y).residuals)
    curved = float(((y - np.polyval(best, x - x.mean())) ** 2).sum())
    assert test.f_value == pytest.approx((straight - curved) / (curved / 6.0), rel=1e-6)
    assert test.p_value == pytest.approx(float(f.sf(test.f_value, 1, 6)), rel=1e-6)


@pytest.mark.parametrize(("x", "y"), [([1.0, 2.0], [1.0, 2.0]), ([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]),
                                      ([1.0, 2.0, 3.0], [1.0, 2.0]), ([1.0, 2.0, np.nan], [1.0, 2.0, 3.0])])
def test_bad_points_are_refused(x, y):
    with pytest.raises(InputError):
        fit_line(x, y)


def test_a_parabola_needs_three_places():
    with pytest.raises(InputError):
        curvature_test([1.0, 1.0, 2.0, 2.0], [1.0, 2.0, 3.0, 4.0])


def test_columns_that_allow_no_line_are_named(table):
    with pytest.raises(InputError, match=r"at least two of output_angle_deg"):
        table_fits({"q_deg": table["q_deg"]})
