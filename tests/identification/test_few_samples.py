"""With few samples every number that was fitted counts: variances are divided by n − p."""

import math

import numpy as np
import pytest

from servotwin.identification.fitting.search.least_squares import Prior
from servotwin.identification.fitting.uncertainty import Rows, uncertainty


def nothing(p):
    return Prior(np.zeros(p), np.zeros(p))


SIGNS = {4: [1, -1, -1, 1], 6: [1, 1, -1, -1, 1, -1], 8: [1, -1, -1, 1, 1, -1, -1, 1]}  # of mean 0, hardly correlated


@pytest.mark.parametrize("n", SIGNS)
def test_the_error_of_a_mean_of_few(n):
    """Residuals ±e about a mean: s²/n with s² = n e²/(n − 1)."""
    e = 0.3
    rows = [Rows(e * np.array(SIGNS[n], float), np.ones((n, 1)), np.ones(n))]
    found = uncertainty(rows, nothing(1), np.array([False]))
    assert found.method == "independent residuals"
    assert found.std[0] == pytest.approx(e / math.sqrt(n - 1.0), rel=1e-12)


@pytest.mark.parametrize("p", [1, 2, 3, 4])
def test_orthogonal_numbers_share_the_samples(p):
    """Columns of ±1 and residuals ±e of eight samples: e²/(n − p) for each, as in any book."""
    H = np.array([[1.0]])
    for _ in range(3):
        H = np.block([[H, H], [H, -H]])
    residual = 0.2 * H[:, 3]
    found = uncertainty([Rows(residual, H[:, [5, 6, 2, 4][:p]], np.ones(8))], nothing(p), np.zeros(p, np.bool_))
    assert found.method == "independent residuals"
    np.testing.assert_allclose(found.covariance, np.eye(p) * 0.2**2 / (8.0 - p), atol=1e-15)


def test_as_many_numbers_as_samples_leave_one():
    """Nothing is divided by 0, and errors stay finite."""
    found = uncertainty([Rows(np.array([0.1, -0.1, -0.1, 0.1]), np.eye(4), np.ones(4))], nothing(4),
                        np.zeros(4, np.bool_))
    assert np.isfinite(found.covariance).all()
    assert (np.diag(found.covariance) >= 4.0 * 0.1**2 * (1.0 - 1e-9)).all()
