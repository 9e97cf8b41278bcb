"""How surely a fit knows its numbers: known covariances of linear problems, and what intervals cover, by many draws."""

import math
import re

import numpy as np
import pytest

from servotwin.identification.fitting.search.case import LogPart
from servotwin.identification.fitting.search.least_squares import Loss, Prior
from servotwin.identification.fitting.uncertainty import Counts, Rows, _widest, memory_of, rows_of, uncertainty

NONE = Prior(np.zeros(1), np.zeros(1))


def nothing(p):
    return Prior(np.zeros(p), np.zeros(p))


def waves(logs, n, p):
    """Return smooth regressors of each log, different from log to log."""
    t = np.linspace(0.0, 1.0, n)
    return [np.column_stack([np.sin((2.0 + 3.0 * j) * t * (1.0 + 0.2 * k) + k) for j in range(p)])
            for k in range(logs)]


def ar(rng, n, rho):
    e = rng.normal(size=n)
    for k in range(1, n):
        e[k] = rho * e[k - 1] + math.sqrt(1.0 - rho**2) * e[k]
    return e


def solved(X, y, limit=math.inf):
    """Return shared numbers and an offset of each log, by (weighted) least squares in one heap."""
    n, p = X[0].shape
    A = np.zeros((len(X) * n, p + len(X)))
    for k, x in enumerate(X):
        A[k * n:(k + 1) * n, :p], A[k * n:(k + 1) * n, p + k] = x, 1.0
    Y, w = np.concatenate(y), np.ones(len(X) * n)
    for _ in range(25 if math.isfinite(limit) else 1):
        weighted = A.T * w
        theta = np.linalg.solve(weighted @ A, weighted @ Y)
        w = np.minimum(1.0, limit / np.maximum(np.abs(Y - A @ theta), 1e-12))
    return theta, A


def doubt(X, y, limit=math.inf):
    """Return the numbers that fit, and what the package says of them."""
    n, p = X[0].shape
    theta, _ = solved(X, y, limit)
    rows = [rows_of(LogPart(x @ theta[:p] + theta[p + k] - y[k], x, np.ones((n, 1))), Loss(limit), NONE,
                    theta[p + k:p + k + 1]) for k, x in enumerate(X)]
    return theta[:p], uncertainty(rows, nothing(p), np.zeros(p, np.bool_))


# ------------------------------------------------------------------------------------ closed forms

def test_white_noise_gives_the_covariance_of_least_squares():
    """sigma² (A'A)⁻¹, with what each log's own number eats taken away."""
    rng = np.random.default_rng(1)
    X = waves(3, 400, 3)
    y = [x @ [1.0, -2.0, 0.5] + 0.3 * k + 2.0 * rng.normal(size=400) for k, x in enumerate(X)]
    _, u = doubt(X, y)
    _, A = solved(X, y)
    expected = 4.0 * np.linalg.inv(A.T @ A)[:3, :3]
    assert u.method == "independent residuals"
    np.testing.assert_allclose(np.sqrt(np.diag(u.covariance)), np.sqrt(np.diag(expected)), rtol=0.1)
    np.testing.assert_allclose(u.information, np.linalg.inv(np.linalg.inv(A.T @ A)[:3, :3]), rtol=1e-6)


def test_a_mean_of_numbers():
    rng = np.random.default_rng(0)
    score = rng.normal(size=900)
    u = uncertainty([Rows(score - score.mean(), np.ones((900, 1)), np.ones(900))], NONE, np.array([False]))
    assert u.std[0] == pytest.approx(score.std(ddof=1) / 30.0, rel=1e-3)
    assert u.freedom == pytest.approx(900.0)  # each says as much
    assert u.quantile(0.95) == pytest.approx(1.962610, abs=1e-5)  # of Student with 900
    assert u.inflation == pytest.approx(1.0, abs=0.01)


def test_the_scale_of_the_noise_does_not_matter():
    rng = np.random.default_rng(3)
    X = waves(2, 100, 2)
    y = [rng.normal(size=100) for _ in X]
    a, b = (doubt([s * x for x in X], [s * v for v in y])[1].std for s in (1.0, 50.0))
    np.testing.assert_allclose(a, b, rtol=1e-9)


def test_beliefs_narrow_as_a_further_measurement_would():
    rng = np.random.default_rng(2)
    rows = [Rows(rng.normal(size=2500), np.ones((2500, 1)), np.ones(2500))]
    alone = uncertainty(rows, NONE, np.array([False])).std[0]
    believed = uncertainty(rows, Prior(np.zeros(1), np.array([1.0 / 0.01])), np.array([False])).std[0]
    assert alone == pytest.approx(0.02, rel=0.05)
    assert believed == pytest.approx(1.0 / math.hypot(1.0 / alone, 1.0 / 0.01), rel=0.02)


def test_a_belief_about_a_logs_own_number_counts():
    """An offset that is known takes nothing away; one that is free takes away the mean of the slope."""
    n = 200
    slope = 1.0 + 0.2 * np.sin(np.linspace(0.0, 20.0, n))[:, None]
    part = LogPart(np.random.default_rng(0).normal(size=n), slope, np.ones((n, 1)))
    known, free = (rows_of(part, Loss(), Prior(np.zeros(1), np.array([w])), np.zeros(1)) for w in (1e6, 0.0))
    assert (known.slope[:n] ** 2).sum() == pytest.approx((slope**2).sum(), rel=1e-6)
    assert (free.slope[:n] ** 2).sum() == pytest.approx(n * slope.var(), rel=1e-6)


def test_residuals_beyond_the_limit_tell_only_their_sign():
    part = LogPart(np.array([0.5, -9.0, 2.0, 1.0]), np.ones((4, 1)), np.zeros((4, 0)))
    rows = rows_of(part, Loss(1.5), Prior(np.zeros(0), np.zeros(0)), np.zeros(0))
    assert rows.score.tolist() == [0.5, -1.5, 1.5, 1.0]
    assert rows.inside.tolist() == [1.0, 0.0, 0.0, 1.0]


def test_numbers_that_are_held_do_not_vary():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(300, 3))
    X[:, 2] = X[:, 1] + 0.1 * rng.normal(size=300)
    rows = [Rows(rng.normal(size=300), X, np.ones(300))]
    free, held = (uncertainty(rows, nothing(3), np.array([False, False, h])) for h in (False, True))
    assert (held.covariance[2] == 0.0).all()
    assert held.std[1] < 0.2 * free.std[1]
    assert np.isfinite(uncertainty(rows, nothing(3), np.ones(3, np.bool_)).covariance).all()


@pytest.mark.parametrize("slopes", ["none", "twins"])
def test_what_the_logs_do_not_say_makes_no_warning(slopes):
    """Warnings are errors here; the other numbers keep their standard errors."""
    rng = np.random.default_rng(4)
    X = rng.normal(size=(500, 3))
    X[:, 2] = 0.0 if slopes == "none" else -2.0 * X[:, 1]
    rows = [Rows(rng.normal(size=500), X, np.ones(500))]
    u = uncertainty(rows, nothing(3), np.zeros(3, np.bool_))
    assert u.std[0] == pytest.approx(1.0 / math.sqrt(500.0), rel=0.15)
    assert math.isfinite(u.inflation)
    vague = np.array([[0.0, 0.0, 1.0]]).T if slopes == "none" else np.array([[0.0, 2.0, 1.0]]).T / math.sqrt(5.0)
    u = uncertainty(rows, nothing(3), np.zeros(3, np.bool_), vague)
    assert np.isfinite(u.std).all()
    assert u.std[0] == pytest.approx(1.0 / math.sqrt(500.0), rel=0.15)


def test_logs_that_fit_exactly_leave_no_doubt():
    u = uncertainty([Rows(np.zeros(50), np.ones((50, 1)), np.ones(50))], NONE, np.array([False]))
    assert u.std[0] == 0.0
    assert np.isfinite([u.inflation, u.autocorrelation]).all()


# ---------------------------------------------------------------------- what intervals cover, by draws

def covered(logs, n, p, *, rho=0.0, limit=math.inf, tails=False, cluster=0.0, draws=200):
    """Return the share of 95 % intervals that hold the truth [%], which is 0; and the methods."""
    rng = np.random.default_rng(0)
    X, hits, methods = waves(logs, n, p), [], set()
    for _ in range(draws):
        y = [(rng.standard_t(3, size=n) if tails else ar(rng, n, rho)) + cluster * x @ rng.normal(size=p) for x in X]
        theta, u = doubt(X, y, limit)
        hits.append(np.abs(theta) <= u.quantile(0.95) * u.std)
        methods.add(re.sub(" .*", "", u.method))
    return 100.0 * np.mean(hits), methods


@pytest.mark.long
@pytest.mark.parametrize("case", [{}, {"limit": 1.345}, {"tails": True}, {"tails": True, "limit": 1.345}],
                         ids=["squares", "huber", "tails, squares", "tails, huber"])
def test_intervals_cover_the_truth_with_white_noise(case):
    share, _ = covered(3, 100, 4, **case)
    assert 92.0 < share < 97.5


@pytest.mark.long
@pytest.mark.parametrize("rho", [0.15, 0.3, 0.7, 0.9])
def test_intervals_cover_the_truth_with_correlated_noise(rho):
    assert 90.5 < covered(3, 125, 4, rho=rho)[0] < 98.8


@pytest.mark.long
def test_intervals_cover_the_truth_with_correlated_noise_and_huber():
    assert 90.0 < covered(3, 125, 4, rho=0.7, limit=1.345, draws=120)[0] < 98.8


@pytest.mark.long
@pytest.mark.parametrize(("rho", "cluster"), [(0.7, 0.0), (0.9, 0.0), (0.0, 0.3)])
def test_many_logs_speak_for_themselves(rho, cluster):
    """Noise that lasts, or a servo that is a little different in each log: the scatter between logs knows."""
    share, methods = covered(40, 30, 4, rho=rho, cluster=cluster, draws=60)
    assert 91.0 < share < 98.5
    assert methods == {"between"}


def test_correlated_noise_widens_as_it_has_to():
    """The mean of AR(1) noise scatters (1 + rho)/(1 - rho) times as much (variance) as that of white noise."""
    rng = np.random.default_rng(1)
    rows = []
    for _ in range(4):
        e = ar(rng, 4000, 0.8)
        rows.append(Rows(e - e.mean(), np.ones((4000, 1)), np.ones(4000)))
    u = uncertainty(rows, NONE, np.array([False]))
    assert u.method != "independent residuals"
    assert u.inflation == pytest.approx(3.0, rel=0.15)
    assert u.autocorrelation == pytest.approx(0.8, abs=0.03)


# ------------------------------------------------------------------------------- what the fit itself takes away

def _fitted_line(noise, X):
    """Return the rows of a least-squares fit of some columns, with what it is off by."""
    theta = np.linalg.lstsq(X, noise, rcond=None)[0]
    return [Rows(noise - X @ theta, -X, np.ones(len(noise)))], theta


@pytest.mark.parametrize(("rho", "tolerance"), [(0.0, 0.02), (0.5, 0.03), (0.8, 0.04)])
def test_the_memory_of_noise_is_found_behind_what_a_fit_takes_away(rho, tolerance):
    """Ten slow columns of 100 samples: the correlation that is left is far smaller (Kendall 1954)."""
    rng = np.random.default_rng(7)
    time = np.linspace(-1.0, 1.0, 100)
    X = np.polynomial.legendre.legvander(time, 9)
    found, left = [], []
    for _ in range(200):
        e = rng.normal(size=100)
        for k in range(1, 100):
            e[k] = rho * e[k - 1] + math.sqrt(1.0 - rho**2) * e[k]
        rows, _ = _fitted_line(e, X)
        memory = memory_of(rows, np.eye(10))
        found.append((memory.excess if rho == 0.0 else memory.correlation, memory.power))
        r = rows[0].residual
        left.append(r[1:] @ r[:-1] / (r @ r))
    middle = np.median(found, axis=0)
    assert middle[0] == pytest.approx(rho, abs=tolerance)
    assert np.mean(left) < rho - 0.05
    assert rho > 0.6 or middle[1] == pytest.approx(1.0, abs=0.12)


@pytest.mark.long
def test_few_samples_that_say_most_are_not_believed_too_much():
    """Six of 60 samples tell a slope: intervals hold it in 95 % of 1000 fits, ± 0.7 % by chance."""
    rng = np.random.default_rng(11)
    X = np.column_stack([np.ones(60), np.where(np.arange(60) % 10 == 3, rng.uniform(2.0, 6.0, 60), 0.0)])
    held = []
    for _ in range(1000):
        rows, theta = _fitted_line(rng.normal(size=60), X)
        u = uncertainty(rows, Prior(np.zeros(2), np.zeros(2)), np.zeros(2, bool))
        held.append(abs(theta[1]) <= u.quantile(0.95, 1) * u.std[1])
    assert 0.93 <= np.mean(held) <= 0.985


def test_what_stands_is_read_wrong_by_the_same():
    """Of 20 readings of 25 samples each a mean is known to q/√12/√20, not to q/√12/√500."""
    rng = np.random.default_rng(3)
    q = 2.0
    reading = np.repeat(np.arange(20), 25)
    error = np.repeat(rng.uniform(-0.5 * q, 0.5 * q, 20), 25)
    counts = Counts(reading, np.full(500, q**2 / 12.0), np.zeros(0))
    rows = [Rows(error - error.mean(), np.ones((500, 1)), np.ones(500), counts=counts)]
    u = uncertainty(rows, NONE, np.array([False]))
    # The noise that its residuals have beside, which is chance here, adds little
    assert u.std[0] == pytest.approx(q / math.sqrt(12.0 * 20.0), rel=0.5)
    assert u.std[0] > 0.95 * q / math.sqrt(12.0 * 20.0)


def test_what_does_not_vary_is_no_wider_than_nothing():
    varies, stands = np.diag([4.0, 1e12]), np.diag([1.0, 0.0])
    with np.errstate(all="raise"):
        assert np.array_equal(_widest([stands, varies]), np.diag([4.0, 0.0]))
