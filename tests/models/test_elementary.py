"""Polynomials against 40 digits."""

import mpmath
import numpy as np
import pytest

from servotwin.models.engine.motions import elementary

EPS = 2.3e-16


@pytest.fixture(autouse=True)
def _digits():
    with mpmath.workdps(40):
        yield


def powers(low, high, n=400):
    return (10.0 ** np.random.default_rng(0).uniform(low, high, n)).tolist()


@pytest.mark.parametrize("x", [1e-300, 0.2, 0.41, 0.42, 1.0, 1e300])
def test_log1p_at_places_where_its_form_changes(x):
    assert abs(elementary.log1p(x) / mpmath.log1p(x) - 1) < 2 * EPS


def test_logarithms():
    for x in powers(-12, 12):
        log, rest = elementary.log1p_and_rest(x)
        exact = mpmath.log1p(mpmath.mpf(x))
        assert abs(log / exact - 1) < 2 * EPS
        assert abs(rest / (x - exact) - 1) < 10 * EPS
        if abs(x - 1.0) > 0.1:
            assert abs(elementary.log(x) / mpmath.log(x) - 1) < 2 * EPS


def test_decay_has_no_cancellation():
    for rate, t in zip(powers(-9, 4), powers(-8, 1), strict=True):
        once, twice = elementary.decay(rate, 1.0 / rate, t)
        exact = -mpmath.expm1(-mpmath.mpf(rate) * t) / rate
        assert abs(once / exact - 1) < 3 * EPS
        assert abs(twice / ((t - exact) / rate) - 1) < 10 * EPS
