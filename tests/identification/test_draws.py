"""Servos that logs, priors and bounds allow: closed forms of the law, and what is drawn of a fit."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.fits import fitted
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification import LUMPED
from servotwin.identification.fitting.assumptions import Allowed

N = TRUTH.gear.gear_reduction
SCALED = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]


def law(**changes):
    """Return a law of two numbers: standard errors of 0.1, nothing cut off."""
    plain = {"best": np.zeros(2), "shift": np.zeros(2), "axes": np.eye(2), "precision": np.full(2, 100.0),
             "lower": np.full(2, -3.0), "upper": np.full(2, 3.0), "by_logarithm": np.zeros(2, np.bool_),
             "by_value": np.zeros(2, np.bool_),
             "open": np.zeros((2, 0)), "reach": np.zeros((2, 0)), "stretch": np.ones((2, 2))}
    return Allowed(**{**plain, **changes}).draw(4000, np.random.default_rng(0))


def test_without_bounds_it_is_a_normal_law():
    axes = np.array([[0.8, -0.6], [0.6, 0.8]])
    x = law(axes=axes, precision=np.array([1.0 / 0.2**2, 1.0 / 0.05**2]))
    expected = axes @ np.diag([0.2**2, 0.05**2]) @ axes.T
    np.testing.assert_allclose(np.cov(x.T), expected, rtol=0.08, atol=1e-3)


def test_at_a_bound_it_is_the_part_on_this_side():
    """Where the cost is least at the bound, half a normal law: mean σ √(2/π); far beyond it, an exponential one."""
    x = law(lower=np.array([0.0, -3.0]))
    assert x[:, 0].min() >= 0.0
    assert x[:, 0].mean() == pytest.approx(0.1 * math.sqrt(2.0 / math.pi), rel=0.05)
    assert np.corrcoef(x.T)[0, 1] == pytest.approx(0.0, abs=0.05)
    x = law(lower=np.array([0.0, -3.0]), shift=np.array([-1.0, 0.0]))
    assert x[:, 0].mean() == pytest.approx(0.1**2, rel=0.08)  # σ² over the distance


def test_where_nothing_is_known_anything_within_bounds_is_as_likely():
    """A pair whose sum is known: it keeps its standard error, the difference fills the bounds."""
    axes = np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2.0)
    x = law(axes=axes, precision=np.array([1.0 / 0.01**2, 0.0]), upper=np.array([1.0, 3.0]), open=axes[:, 1:],
            reach=np.array([[-9.0], [9.0]]))
    assert (x.sum(axis=1) / math.sqrt(2.0)).std() == pytest.approx(0.01, rel=0.05)
    assert np.quantile(x[:, 0], [0.1, 0.5, 0.9]) == pytest.approx([-2.6, -1.0, 0.6], abs=0.15)  # from -3 to 1


def test_what_is_open_one_way_only_stays_on_that_way():
    x = law(precision=np.array([0.0, 100.0]), open=np.array([[1.0], [0.0]]), reach=np.array([[-0.5], [9.0]]))
    assert x[:, 0].min() == pytest.approx(-0.5, abs=0.02)
    assert x[:, 0].max() > 2.9


def test_a_profile_that_is_wider_above_is_drawn_so():
    x = law(stretch=np.array([[1.0, 1.0], [4.0, 1.0]]))
    assert np.quantile(x[:, 0], [0.025, 0.975]) == pytest.approx([-0.196, 0.784], rel=0.1)


@pytest.fixture(scope="module")
def hidden():
    """Return a servo that is not that of the file, and its logs without a load, and the fit."""
    factors = {"motor.armature_resistance": 1.08, "motor.rotor_inertia": 0.8,
               "friction.coulomb_torque_forward": 0.97, "friction.coulomb_torque_backward": 0.97}
    truth = TRUTH.replace({name: factor * TRUTH.get(name) for name, factor in factors.items()})
    logs = [noisy(run(truth, motion, seed=k, load=None, delay=0.05, duration=1.5), 1e-3, seed=k)
            for k, motion in enumerate(("step", "prbs"))]
    return truth, fitted(logs, TRUTH, free=SCALED, priors="servo")


@pytest.mark.long
def test_what_is_open_is_drawn_within_its_prior_and_keeps_what_is_known(hidden):
    truth, fit = hidden
    assert set(fit.undetermined) == {SCALED[0], *SCALED[2:]}
    drawn = fit.draw(2000)
    r, j, f = (np.log(drawn[name]) for name in (SCALED[0], "motor.rotor_inertia", "friction.coulomb_torque_forward"))
    assert r.std() > 0.03
    assert (r + j).std() < 0.1 * r.std()
    assert (r + f).std() < r.std()
    for name in ("motor.armature_resistance", "motor.rotor_inertia", "friction.coulomb_torque_forward"):
        assert drawn[name].min() < truth.get(name) < drawn[name].max(), name


def test_a_predicted_sag_contains_the_true_one(hidden):
    truth, fit = hidden
    run_of = {"duration": 1.0, "load": st.loads.Constant(0.5), "output_times": [1.0]}
    command = st.signals.constant(90.0, unit="deg")
    true = st.simulate(st.PulseServo(truth), command, **run_of)["output_angle"][-1]
    lanes = st.simulate_many(fit.model, command, parameters=fit.draw(300), **run_of)["output_angle"][:, 0]
    low, high = np.quantile(lanes, [0.025, 0.975])
    assert low < true < high
    assert high - low > np.radians(0.3)  # and what is not known is not said


def test_what_is_open_is_saved_with_what_was_known_of_it(hidden):
    _, fit = hidden
    for name in fit.undetermined:
        for member in LUMPED.get(name, ((name,),))[0]:
            now, before = fit.servo.source(member), TRUTH.source(member)
            assert (now.origin, now.lower, now.upper) == (before.origin, before.lower, before.upper)
        assert fit.prior_share[name] == 1.0
    assert fit.prior_share["output_torque_constant"] < 0.2
    assert fit.servo.fit["prior_share"]["output_inertia"] == 1.0


@pytest.mark.long
def test_without_priors_what_is_open_fills_the_bounds():
    logs = [noisy(run(TRUTH, "step", load=None, delay=0.05, duration=1.5), 1e-3)]
    logs = [replace(log, load=st.loads.Inertia(1e-3)) for log in logs]
    both = ["output_inertia", "load.inertia"]
    j = N**2 * TRUTH.motor.rotor_inertia
    fit = fitted(logs, free=both, bounds={both[0]: (0.2 * j, 3.0 * j), both[1]: (1e-4, 2.0 * j)})
    assert set(fit.undetermined) == set(both)
    drawn = fit.draw(1000)
    total = N**2 * drawn["motor.rotor_inertia"] + drawn["load.inertia"]
    assert np.ptp(drawn["load.inertia"]) > 0.6 * j
    assert total.std() < 0.1 * drawn["load.inertia"].std()
