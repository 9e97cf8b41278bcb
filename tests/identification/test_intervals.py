"""Ends of intervals: the normal approximation where it holds, the profile of the cost where it does not."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from identification.toy_forecast import Toy
from servotwin.identification.fitting.assumptions import ends
from servotwin.identification.fitting.search.case import Point
from servotwin.identification.fitting.search.least_squares import Loss, Prior, Search
from servotwin.identification.fitting.uncertainty import Uncertainty, rows_of, uncertainty

T = np.linspace(0.05, 1.0, 12)
LEVEL = 0.95


def straight(p=3, own=0, logs=2, correlated=1.0, seed=0):
    """Return a search over straight lines, its end, and a doubt that may be wider than its residuals say."""
    rng = np.random.default_rng(seed)
    A = [rng.normal(size=(40, p)) + 0.8 for _ in range(logs)]
    B = [np.column_stack([np.ones(40), np.linspace(-1.0, 1.0, 40)])[:, :own] for _ in range(logs)]
    y = [rng.normal(size=40) for _ in range(logs)]
    toy = Toy([lambda x, o, a=a, b=b, v=v: a @ x + b @ o - v for a, b, v in zip(A, B, y, strict=True)], p, own)
    return toy, *ended(toy, p, own, logs, correlated)


def ended(toy, p, own, logs, correlated=1.0, lower=None, upper=None, prior=None, begin=None):
    prior = prior or Prior(np.zeros(p), np.zeros(p))
    lower = np.full(p, -np.inf) if lower is None else np.asarray(lower, float)
    upper = np.full(p, np.inf) if upper is None else np.asarray(upper, float)
    search = Search(toy, Loss(), prior, lower, upper)
    best = search.run(Point(np.zeros(p) if begin is None else np.array(begin, float),
                            tuple(np.zeros(own) for _ in range(logs))))
    beliefs = [Prior(*toy.own_belief(k)) for k in toy.cases]
    rows = [rows_of(part, Loss(), belief, at) for part, belief, at in
            zip(toy.at(best.point), beliefs, best.point.own, strict=True)]
    information = np.sum([r.slope.T @ r.slope for r in rows], axis=0)
    covariance = np.linalg.inv(information + np.diag(prior.weight**2))
    doubt = Uncertainty(information, covariance * correlated**2, covariance, covariance, correlated, "", math.inf, 0.0)
    search.rows = rows
    return search, best, doubt


# ------------------------------------------------------------------------------------ straight lines

@pytest.mark.parametrize("correlated", [1.0, 4.0])
@pytest.mark.parametrize("own", [0, 2])
def test_a_parabola_has_normal_intervals(own, correlated):
    """Also where every log has numbers of its own, and where correlated residuals widen all."""
    _, search, best, doubt = straight(own=own, correlated=correlated)
    found = ends(search, best, doubt, [0, 1, 2], LEVEL, rows=search.rows)
    for end in found.values():
        assert (end.lower, end.upper) == pytest.approx((-1.959964, 1.959964), rel=0.02)
        assert end.method == "normal"


def test_a_parabola_whose_correlation_differs_from_its_curvature():
    """The covariance of correlated residuals is not the inverse of the curvature: no reason for a profile."""
    _, search, best, doubt = straight(p=2)
    spread = np.array([[4.0, -1.5], [-1.5, 1.0]]) * doubt.covariance[1, 1]
    other = Uncertainty(doubt.information, spread, spread, doubt.curvature, 2.0, "", math.inf, 0.3)
    found = ends(search, best, other, [0, 1], LEVEL)
    for end in found.values():
        assert (end.lower, end.upper) == pytest.approx((-1.959964, 1.959964), rel=0.03)
        assert end.method == "normal"


def test_only_what_is_asked_for_and_all_of_it_is_told():
    _, search, best, doubt = straight()
    told = []
    assert list(ends(search, best, doubt, [2, 0], LEVEL, tell=told.append)) == [2, 0]
    assert told == [1, 2]
    assert ends(search, best, doubt, [], LEVEL) == {}


def test_students_t_reaches_further():
    _, search, best, doubt = straight(p=1)
    few = Uncertainty(doubt.information, doubt.covariance, doubt.covariance, doubt.curvature, 1.0, "", 4.0, 0.0)
    assert ends(search, best, few, [0], LEVEL)[0].upper == pytest.approx(2.776445, rel=0.02)
    assert few.quantile(0.95) == pytest.approx(2.776445, rel=1e-6)  # a table of t, 4 degrees of freedom


# ------------------------------------------------------------------------------------------- curved

def saturating(sigma, seed=1):
    """y = a (1 - e^(-b t)), seen until b t = 1.5: a and b hardly to be told apart, and curved."""
    y = 2.0 * (1.0 - np.exp(-1.5 * T)) + sigma * np.random.default_rng(seed).normal(size=len(T))
    return Toy([lambda x, o: (x[0] * (1.0 - np.exp(-x[1] * T)) - y) / sigma], 2, 0), y


def profile(y, sigma, k, rise):
    """Return where the least cost over the other number has risen by `rise`: by SciPy, for a and for b."""
    def least(value):
        if k == 1:  # a is linear
            f = 1.0 - np.exp(-value * T)
            a = f @ y / (f @ f)
            return 0.5 * float((((a * f - y) / sigma) ** 2).sum())
        return min((minimize_scalar(lambda b: 0.5 * float((((value * (1.0 - np.exp(-b * T)) - y) / sigma) ** 2).sum()),
                                    bounds=bounds, method="bounded", options={"xatol": 1e-10})
                    for bounds in ((1e-4, 3.0), (0.5, 30.0))), key=lambda r: r.fun).fun

    best = minimize_scalar(least, bounds=(0.2, 8.0), method="bounded", options={"xatol": 1e-10})
    return (brentq(lambda v: least(v) - best.fun - rise, 0.02, best.x, xtol=1e-9),
            brentq(lambda v: least(v) - best.fun - rise, best.x, 60.0, xtol=1e-9))


@pytest.mark.parametrize("k", [0, 1])
def test_a_curved_cost_has_the_ends_of_its_profile(k):
    sigma = 0.06
    toy, y = saturating(sigma)
    search, best, doubt = ended(toy, 2, 0, 1, begin=[1.0, 1.0])
    end = ends(search, best, doubt, [k], LEVEL)[k]
    assert end.method == "profile"
    found = [best.point.shared[k] + side * doubt.std[k] for side in (end.lower, end.upper)]
    expected = profile(y, sigma, k, 0.5 * 1.959964**2)
    assert found == pytest.approx(expected, rel=0.02)
    skew = abs(end.upper) / abs(end.lower)
    assert abs(skew - 1.0) > 0.05  # or the normal one would have done


def test_a_deeper_valley_on_the_way_is_told():
    """A parabola in the square has two bottoms; the search ends in that at -1, and what else counts favours 1."""
    toy = Toy([lambda x, o: np.array([4.0 * (x[0]**2 - 1.0), 1.5 * (x[0] - 1.0)])], 1, 0)
    search, best, doubt = ended(toy, 1, 0, 1, lower=[-3.0], upper=[3.0], begin=[-0.9])
    assert best.point.shared[0] < -0.5
    seen = []
    ends(search, best, doubt, [0], 1.0 - 1e-9, deeper=seen.append)
    assert min(there.cost for there in seen) < best.cost - 2.0
    seen.clear()
    search, best, doubt = ended(toy, 1, 0, 1, lower=[-3.0], upper=[3.0], begin=[0.9])
    ends(search, best, doubt, [0], 1.0 - 1e-9, deeper=seen.append)
    assert seen == []


def test_a_hardly_curved_cost_needs_no_profile():
    toy, _ = saturating(1e-3)
    search, best, doubt = ended(toy, 2, 0, 1, begin=[1.0, 1.0])
    assert {end.method for end in ends(search, best, doubt, [0, 1], LEVEL).values()} == {"normal"}


def test_a_profile_ends_at_a_bound():
    sigma = 0.06
    toy, y = saturating(sigma)
    lower, upper = profile(y, sigma, 1, 0.5 * 1.959964**2)
    bound = 0.5 * (1.5 + upper)
    search, best, doubt = ended(toy, 2, 0, 1, begin=[1.0, 1.0], lower=[0.0, 0.0], upper=[50.0, bound])
    end = ends(search, best, doubt, [1], LEVEL)[1]
    assert best.point.shared[1] + end.upper * doubt.std[1] == pytest.approx(bound, rel=1e-6)
    assert best.point.shared[1] + end.lower * doubt.std[1] == pytest.approx(lower, rel=0.02)


def test_correlated_residuals_widen_a_profile_as_they_widen_a_parabola():
    """The cost has to rise four times as far where standard errors are twice as large."""
    sigma = 0.03
    toy, y = saturating(sigma)
    search, best, doubt = ended(toy, 2, 0, 1, correlated=2.0, begin=[1.0, 1.0])
    end = ends(search, best, doubt, [1], LEVEL)[1]
    found = [best.point.shared[1] + side * doubt.std[1] for side in (end.lower, end.upper)]
    assert found == pytest.approx(profile(y, sigma, 1, 2.0 * 1.959964**2), rel=0.03)


def test_what_is_held_stays_in_a_profile():
    toy, y = saturating(0.06)
    search, best, doubt = ended(toy, 2, 0, 1, begin=[1.0, 1.0])
    held = Search(search.forecast, search.loss, search.prior, search.lower, search.upper, None,
                  np.array([True, False]))
    variance = np.diag([0.0, 1.0 / doubt.information[1, 1]])
    alone = Uncertainty(doubt.information, variance, variance, variance, 1.0, "", math.inf, 0.0)
    end = ends(held, best, alone, [1], LEVEL)[1]
    a, b = best.point.shared
    first = 0.5 * float((((a * (1.0 - np.exp(-b * T)) - y) / 0.06) ** 2).sum())

    def rise(value):
        return 0.5 * float((((a * (1.0 - np.exp(-value * T)) - y) / 0.06) ** 2).sum()) - first - 0.5 * 1.959964**2

    expected = brentq(rise, 0.1, b), brentq(rise, b, 20.0)
    found = [b + side * alone.std[1] for side in (end.lower, end.upper)]
    assert found == pytest.approx(expected, rel=0.05 if end.method == "normal" else 0.02)


def test_uncertainty_and_ends_fit_together():
    """From residuals to ends, with the covariance that the package computes."""
    toy, _ = saturating(0.01)
    search, best, _ = ended(toy, 2, 0, 1, begin=[1.0, 1.0])
    none = Prior(np.zeros(0), np.zeros(0))
    doubt = uncertainty([rows_of(toy.at(best.point)[0], Loss(), none, np.zeros(0))], Prior(np.zeros(2), np.zeros(2)),
                        np.zeros(2, np.bool_))
    for end in ends(search, best, doubt, [0, 1], LEVEL).values():
        assert -4.0 < end.lower < -1.0
        assert 1.0 < end.upper < 4.0
