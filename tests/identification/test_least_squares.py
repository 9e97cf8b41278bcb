"""The solver of the fit against SciPy's, on problems without a servo."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from identification.toy_forecast import Toy
from servotwin.identification.fitting.search.case import STEP, LogPart, Point
from servotwin.identification.fitting.search.least_squares import (
    _LEAST_GAIN,
    Block,
    Loss,
    NormalEquations,
    Prior,
    Search,
    block,
    bounded_step,
    together,
)

T = np.linspace(0.0, 4.0, 31)
WAVE = np.cos(7.0 * T)
TRUTH = np.array([1.3, 1.5, 0.4])


def decays(logs=4, outliers=0.0, seed=0):
    """Return logs a e^(-b t) + c sin 3t + own offset + own wave, with noise."""
    rng = np.random.default_rng(seed)
    functions = []
    for k in range(logs):
        a, b, c = TRUTH
        y = a * np.exp(-b * T) + c * np.sin(3.0 * T) + 0.2 * k - 0.1 * k * WAVE + 0.02 * rng.normal(size=len(T))
        y += outliers * (rng.random(len(T)) < 0.1)
        functions.append(lambda x, o, y=y: (x[0] * np.exp(-x[1] * T) + x[2] * np.sin(3.0 * T) + o[0] + o[1] * WAVE - y)
                         / 0.02)
    return functions


def rosenbrock(x, own):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


class Exact(Search):
    """The search, to the very end."""

    def run(self, start, **more):
        return super().run(start, **{"least_gain": 1e-13, **more})


def search(functions, size=3, own=2, *, limit=math.inf, prior=None, lower=None, upper=None, belief=(0.0, 0.0),
           **more):
    toy = Toy(functions, size, own, belief)
    prior = prior or Prior(np.zeros(size), np.zeros(size))
    lower = np.full(size, -np.inf) if lower is None else np.asarray(lower)
    upper = np.full(size, np.inf) if upper is None else np.asarray(upper)
    return Exact(toy, Loss(limit), prior, lower, upper, **more)


def start(x, logs=4, own=2):
    return Point(np.array(x, float), tuple(np.zeros(own) for _ in range(logs)))


def scipy_says(functions, x, own=2, *, limit=math.inf, prior=None, lower=None, upper=None, belief=(0.0, 0.0)):
    """Return shared numbers, own numbers and cost of the same problem, all numbers in one heap."""
    size, logs = len(x), len(functions)

    def residuals(z):
        parts = [np.real(f(z[:size], z[size + own * k:size + own * (k + 1)])) for k, f in enumerate(functions)]
        if np.isfinite(limit):  # what is proportional beyond a limit, as the root of twice its cost
            parts = [np.sign(r) * np.sqrt(np.where(np.abs(r) > limit, 2.0 * limit * np.abs(r) - limit**2, r**2))
                     for r in parts]
        if prior is not None:
            parts.append((z[:size] - prior.mean) * prior.weight)
        parts.append((z[size:] - belief[0]) * belief[1])
        return np.concatenate(parts)

    low, high = (np.concatenate([np.full(size, s) if b is None else b, np.full(own * logs, s)])
                 for s, b in ((-np.inf, lower), (np.inf, upper)))
    first = np.concatenate([np.clip(x, low[:size], high[:size]) if lower is not None else x, np.zeros(own * logs)])
    found = least_squares(residuals, first, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=2000)
    return found.x[:size], found.x[size:].reshape(logs, own), found.cost


def agree(outcome, expected, abs_=1e-5):
    x, own, cost = expected
    assert outcome.converged
    assert outcome.cost == pytest.approx(cost, rel=1e-8)
    np.testing.assert_allclose(outcome.point.shared, x, atol=abs_)
    np.testing.assert_allclose(np.array(outcome.point.own), own, atol=10.0 * abs_)


# ------------------------------------------------------------------------------------- against SciPy

def test_shared_and_own_numbers():
    functions = decays()
    agree(search(functions).run(start([0.5, 0.2, 0.0])), scipy_says(functions, [0.5, 0.2, 0.0]))


def test_beliefs_about_shared_and_own_numbers():
    functions = decays()
    prior, belief = Prior(np.array([1.0, 0.0, 0.4]), np.array([300.0, 0.0, 1000.0])), (0.05, 20.0)
    agree(search(functions, prior=prior, belief=belief).run(start([0.5, 0.2, 0.0])),
          scipy_says(functions, [0.5, 0.2, 0.0], prior=prior, belief=belief))


@pytest.mark.parametrize(("lower", "upper", "at"), [
    ([-9.0, 1.8, -9.0], [9.0, 3.0, 9.0], (1,)), ([0.0, 0.0, 0.5], [9.0, 0.6, 0.9], (1, 2)),
    ([-5.0, 0.0, -9.0], [0.5, 5.0, 0.2], (0, 2)), ([0.0, 0.0, 0.0], [9.0, 9.0, 9.0], ()),
], ids=["lower", "both", "upper", "none"])
def test_bounds_are_hit_where_they_bind(lower, upper, at):
    functions = decays()
    outcome = search(functions, lower=lower, upper=upper).run(start([0.5, 0.7, 0.3]))
    agree(outcome, scipy_says(functions, np.array([0.45, 0.5, 0.1]), lower=np.array(lower), upper=np.array(upper)),
          abs_=2e-5)
    x = outcome.point.shared
    assert tuple(k for k in range(3) if x[k] in (lower[k], upper[k])) == at


@pytest.mark.parametrize("limit", [1.345, 3.0])
def test_robust_loss(limit):
    functions = decays(outliers=2.0)
    expected = scipy_says(functions, [1.0, 0.6, 0.3], limit=limit)
    agree(search(functions, limit=limit).run(start([1.0, 0.6, 0.3])), expected, abs_=1e-4)
    plain = search(functions).run(start([1.0, 0.6, 0.3]))
    own = [np.array([0.2 * k, -0.1 * k]) for k in range(4)]
    off = [np.abs(np.array([*(o.shared - TRUTH), *np.ravel(np.array(o.own) - own)])).max()
           for o in (plain.point, Point(expected[0], tuple(expected[1])))]
    assert off[1] < 0.5 * off[0]


def test_a_curved_valley():
    outcome = search([rosenbrock], 2, 0).run(start([-1.2, 1.0], 1, 0))
    np.testing.assert_allclose(outcome.point.shared, [1.0, 1.0], atol=1e-6)
    bounded = search([rosenbrock], 2, 0, lower=[-2.0, -2.0], upper=[0.8, 2.0]).run(start([-1.2, 1.0], 1, 0))
    np.testing.assert_allclose(bounded.point.shared, [0.8, 0.64], atol=1e-6)


@pytest.mark.parametrize("steep", [1.0, 10.0, 100.0, 1000.0])
@pytest.mark.parametrize("x", [(-1.2, 1.0), (3.0, -4.0)], ids=["left", "right"])
def test_the_usual_end_is_within_a_tenth_of_a_standard_error(steep, x):
    """In a valley that is steep and curved too, where steps are refused and the next ones small."""
    def valley(z, own):
        return np.array([steep * (z[1] - z[0] ** 2), 1.0 - z[0]])

    outcome = search([valley], 2, 0).run(start(x, 1, 0), least_gain=_LEAST_GAIN, most=200)
    assert outcome.converged or steep > 100.0
    if outcome.converged:
        assert outcome.point.shared[0] == pytest.approx(1.0, abs=0.1)  # its standard error is 1


def test_numbers_that_are_held_stay():
    functions, prior = decays(), Prior(np.array([0.0, 0.7, 0.0]), np.array([0.0, 1e7, 0.0]))
    held = search(functions, held=np.array([False, True, False])).run(start([0.5, 0.7, 0.0]))
    assert held.point.shared[1] == 0.7
    agree(held, scipy_says(functions, [0.5, 0.7, 0.0], prior=prior), abs_=1e-4)


def test_some_logs_only():
    functions = decays()
    outcome = search(functions, cases=[0, 2]).run(start([0.5, 0.2, 0.0]))
    x, _, cost = scipy_says([functions[0], functions[2]], [0.5, 0.2, 0.0])
    np.testing.assert_allclose(outcome.point.shared, x, atol=1e-5)
    assert outcome.cost == pytest.approx(cost, rel=1e-8)
    assert (outcome.point.own[1] == 0.0).all()
    assert (outcome.point.own[3] == 0.0).all()


def test_a_number_that_nothing_says_stays_where_it_is():
    outcome = search([lambda x, o: np.array([x[0] + o[0] - 2.0, o[0] - 0.5])], 2, 2).run(start([0.0, 0.3], 1))
    assert outcome.point.shared == pytest.approx([1.5, 0.3])
    assert outcome.point.own[0] == pytest.approx([0.5, 0.0])


def test_two_numbers_of_which_only_the_sum_counts_end_anywhere_on_it():
    outcome = search([lambda x, o: np.array([x[0] + x[1] - 2.0, 2.0 * (x[0] + x[1] - 2.0)])], 2, 0).run(
        start([0.3, 0.1], 1, 0))
    assert outcome.converged
    assert outcome.point.shared.sum() == pytest.approx(2.0)
    assert np.abs(outcome.point.shared).max() < 3.0


# -------------------------------------------------------------------------------- the way to the end

def test_the_cost_never_rises():
    for functions, size, own, first in ((decays(outliers=2.0), 3, 2, start([3.0, 3.0, -2.0])),
                                        ([rosenbrock], 2, 0, start([-1.2, 1.0], 1, 0))):
        told = []
        s = search(functions, size, own, limit=2.0)
        s.run(first, tell=lambda k, best, told=told: told.append((k, best.cost)))
        costs = [s.costs([first])[0], *(c for _, c in told)]
        assert len(costs) > 3
        assert (np.diff(costs) <= 0.0).all()
        assert [k for k, _ in told] == list(range(1, len(told) + 1))


def test_what_is_told_is_the_best_so_far():
    s, told = search(decays()), []
    outcome = s.run(start([0.5, 0.2, 0.0]), tell=lambda k, best: told.append(best))
    assert told[-1].point is outcome.point
    assert s.costs([best.point for best in told]) == pytest.approx([best.cost for best in told], rel=1e-12)


def test_no_more_steps_than_allowed():
    outcome = search([rosenbrock], 2, 0).run(start([-1.2, 1.0], 1, 0), most=3)
    assert not outcome.converged
    assert outcome.steps == 3


def test_a_search_is_the_same_each_time_bit_for_bit():
    functions = decays(outliers=1.0)
    a, b = (search(functions, limit=1.345).run(start([0.5, 0.2, 0.0])) for _ in range(2))
    assert a.cost == b.cost
    assert (a.point.shared == b.point.shared).all()


def test_the_order_of_logs_changes_rounding_only():
    functions = decays()
    a = search(functions).run(start([0.5, 0.2, 0.0]))
    b = search(functions[::-1]).run(start([0.5, 0.2, 0.0]))
    np.testing.assert_allclose(a.point.shared, b.point.shared, rtol=1e-9)
    np.testing.assert_allclose(np.array(a.point.own), np.array(b.point.own[::-1]), atol=1e-8)


def test_a_start_beyond_the_bounds_begins_at_them():
    outcome = search([rosenbrock], 2, 0, lower=[0.0, 0.0], upper=[2.0, 2.0]).run(start([-7.0, 9.0], 1, 0))
    np.testing.assert_allclose(outcome.point.shared, [1.0, 1.0], atol=1e-6)


def test_steps_that_fail_are_taken_back():
    """Where a simulation fails its residuals are nan: the search goes round, and never ends there."""
    def holes(x, own):
        return np.array([np.nan, np.nan]) if np.real(x[0]) > 1.05 else np.array([x[0] - 2.0, x[1] - 0.3 + 0.1 * x[0]])

    outcome = search([holes], 2, 0).run(start([0.0, 0.0], 1, 0))
    assert math.isfinite(outcome.cost)
    assert 0.9 < outcome.point.shared[0] <= 1.05
    failed = search([holes], 2, 0).run(start([1.5, 0.0], 1, 0))
    assert failed.cost == math.inf
    assert not failed.converged


# -------------------------------------------------------------------------------------------- loss

def test_loss_is_hubers():
    loss, r = Loss(2.0), np.array([-5.0, -1.0, 0.0, 0.5, 2.0, 10.0])
    expected = np.where(np.abs(r) <= 2.0, 0.5 * r**2, 2.0 * (np.abs(r) - 1.0))
    assert [loss.cost(np.array([v])) for v in r] == pytest.approx(expected)
    assert loss.cost(r) == pytest.approx(expected.sum())
    h = 1e-6
    slope = [(loss.cost(np.array([v + h])) - loss.cost(np.array([v - h]))) / (2.0 * h) for v in r]
    assert loss.weight(r) * r == pytest.approx(slope, abs=1e-6)
    assert Loss().cost(r) == pytest.approx(0.5 * (r @ r))
    assert (Loss().weight(r) == 1.0).all()


def test_elimination_is_that_of_the_whole_matrix():
    rng = np.random.default_rng(2)
    blocks = []
    for _ in range(3):
        part = LogPart(rng.normal(size=9), rng.normal(size=(9, 2)), rng.normal(size=(9, 2)))
        blocks.append(block(part, Loss(1.0), Prior(rng.normal(size=2), np.array([0.5, 2.0])), rng.normal(size=2)))
    g, H = np.sum([b.g_s for b in blocks], axis=0), np.sum([b.H_ss for b in blocks], axis=0)
    whole, right = np.zeros((8, 8)), np.zeros(8)
    whole[:2, :2], right[:2] = H, g
    for k, b in enumerate(blocks):
        rows = slice(2 + 2 * k, 4 + 2 * k)
        whole[:2, rows], whole[rows, :2], whole[rows, rows], right[rows] = b.H_so, b.H_so.T, b.H_oo, b.g_o
    reduced = NormalEquations(tuple(blocks), g, H).reduced()
    np.testing.assert_allclose(np.linalg.solve(reduced[1], reduced[0]), np.linalg.solve(whole, right)[:2], rtol=1e-8)
    assert isinstance(blocks[0], Block)


def test_searches_side_by_side_take_the_steps_that_they_take_alone():
    functions = decays()
    starts = [start([0.5, 0.2, 0.0]), start([1.5, -0.4, 0.7]), start([0.1, 0.1, 0.1])]
    alone = [search(functions).run(one, least_gain=1e-9) for one in starts]
    s = search(functions)
    found = together(s.forecast, s.cases, [s.steps(one, least_gain=1e-9) for one in starts])
    assert [one.steps for one in found] == [one.steps for one in alone]
    assert len({one.steps for one in found}) > 1  # they do not all end together
    for one, other in zip(found, alone, strict=True):
        assert one.cost == other.cost
        assert (one.point.shared == other.point.shared).all()


def test_among_kinks_no_step_is_tried_that_promises_less_than_one_of_them():
    """A cost that rises all around, by kinks that no derivative knows, would be tried with ever smaller steps."""
    smooth, here = decays(), [1.31, 1.49, 0.4]

    def kinked(x, own, f):
        return f(x, own) + 30.0 * (np.abs(np.real(x) - np.array(here)).sum() > 0.0)

    toy = Toy([lambda x, own, f=f: kinked(x, own, f) for f in smooth], 3, 2)
    calls = {}
    for step in (STEP, 300.0 * STEP):
        toy.step, toy.calls = step, 0
        none = Prior(np.zeros(3), np.zeros(3))
        found = Search(toy, Loss(), none, np.full(3, -np.inf), np.full(3, np.inf)).run(start(here))
        assert found.point.shared == pytest.approx(here)
        calls[step] = toy.calls
    assert calls[300.0 * STEP] < calls[STEP] - 3


@pytest.mark.parametrize("limit", [math.inf, 1.0])
def test_a_linear_step_ends_where_the_cost_with_its_ridge_is_flat(limit):
    """The gradient of the loss and of the ridge together is 0 there, whatever counts how much."""
    rng = np.random.default_rng(3)
    slopes, ridge = rng.normal(size=(40, 3)), np.array([0.0, 4.0, 50.0])
    residual = rng.normal(size=40) + 30.0 * (rng.random(40) < 0.2)
    loss = Loss(limit)
    step, cost = loss.linear_step(residual, slopes, ridge, rounds=200)
    left = residual + slopes @ step
    np.testing.assert_allclose(slopes.T @ np.clip(left, -limit, limit) + ridge * step, 0.0, atol=1e-8)
    assert cost == loss.cost(left)


def test_a_bounded_step_solves_for_the_others():
    """A held number stays, one that would cross goes to its bound; for the others H·change is -g."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        A, g, x = rng.normal(size=(7, 5)), rng.normal(size=5), rng.uniform(-1.0, 1.0, 5)
        H, held = A.T @ A, rng.random(5) < 0.2
        lower, upper = np.full(5, -1.0), np.full(5, 1.0)
        change = bounded_step(x, g, H, lower, upper, held)
        there = x + change
        at_bound = (np.abs(there - lower) < 1e-12) | (np.abs(there - upper) < 1e-12)
        assert not change[held].any()
        assert np.all((there >= lower - 1e-12) & (there <= upper + 1e-12))
        np.testing.assert_allclose((H @ change + g)[~held & ~at_bound], 0.0, atol=1e-9)
