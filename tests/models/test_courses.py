"""When one course of first order leaves another: against a dense look at both, and where it begins at a bound."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from servotwin.models.engine.motions.first_order import Course, alike, lead_at, leaves


def looked_for(one, other, low, high, s0, s1):
    """Find the first crossing by looking at 2000 instants, then between two of them."""
    times = np.linspace(s0, s1, 2001)
    leads = np.array([lead_at(one, other, s).way for s in times])
    out = np.flatnonzero((leads > high) | (leads < low))
    if not len(out):
        return math.inf, 0
    k = out[0]
    bound, side = (high, 1) if leads[k] > high else (low, -1)
    return brentq(lambda s: lead_at(one, other, s).way - bound, times[k - 1], times[k], xtol=1e-15), side


@pytest.mark.parametrize("seed", range(60))
def test_against_a_dense_look(seed):
    u = np.random.default_rng(seed).uniform
    one, other = (Course(rate, u(-200.0, 200.0), u(-0.004, 0.004), u(-3.0, 3.0))
                  for rate in (u(0.0, 80.0), 0.0 if seed % 3 == 0 else u(0.0, 20.0)))
    s0, s1, bound = 0.0, u(1e-3, 0.1), 0.01
    found = leaves(one, other, -bound, bound, s0, s1, lead_at(one, other, s1))
    time, side = looked_for(one, other, -bound, bound, s0, s1)
    assert found.side == side
    if side:
        assert found.time == pytest.approx(time, abs=1e-12)
        assert abs(lead_at(one, other, found.time).way) == pytest.approx(bound, abs=1e-15)
        again = leaves(one, other, -bound, bound, 0.5 * found.time, s1, lead_at(one, other, s1))
        assert again.time == pytest.approx(found.time, abs=1e-15)  # however a run is split


def test_a_lead_that_turns_twice():
    """It comes near the upper bound, falls back, and leaves there later; a bound just above the hump is passed once."""
    one, other = Course(50.0, 0.0, 0.0, 4.0), Course(2.0, -5.2, 0.0, 3.4)
    hump = max(lead_at(one, other, s).way for s in np.linspace(0.0, 0.02, 2001))
    bends = alike(one, other)
    slopes = [lead_at(one, other, s).speed for s in (0.0, bends, 1.0)]
    assert slopes[0] > 0.0 > slopes[1]
    assert slopes[2] > 0.0
    end = lead_at(one, other, 1.0)
    late, early = (leaves(one, other, -1.0, bound, 0.0, 1.0, end) for bound in (hump + 1e-6, hump - 1e-6))
    assert (late.side, early.side) == (1, 1)
    assert early.time < bends < late.time


@pytest.mark.parametrize(("speed", "pull", "time"), [
    (0.0, -10.0, math.inf), (0.0, 10.0, 0.0), (0.5, 0.0, 0.0), (-0.5, 0.0, math.inf), (-0.5, 10.0, 0.1)])
def test_from_a_bound(speed, pull, time):
    """A parabola that begins at the upper bound, by rounding just beyond it too."""
    for beyond in (0.0, 7e-14):
        one, other = Course(0.0, pull, 0.01 + beyond, speed), Course(0.0, 0.0, 0.0, 0.0)
        end = lead_at(one, other, 0.15)
        found = leaves(one, other, -10.0, 0.01, 0.0, 0.15, end)
        assert found.time == pytest.approx(time, abs=1e-11)


def test_a_hump_below_the_bound_is_none():
    """From the bound at 1e-12 below a grazing parabola, exact to rounding either side of it."""
    other = Course(0.0, 0.0, 0.0, 0.0)
    one = Course(0.0, -10.0, 0.0, 0.2)  # to 0.002 at 0.02 s
    end = lead_at(one, other, 0.04)
    assert leaves(one, other, -1.0, 0.002 + 1e-12, 0.0, 0.04, end).side == 0
    assert leaves(one, other, -1.0, 0.002 - 1e-12, 0.0, 0.04, end).time == pytest.approx(0.02, abs=1e-6)
