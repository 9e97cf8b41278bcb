"""What a fit hands back: traces, errors, levels, draws; and what is left of one that is interrupted."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from identification.fits import DISC, STD, WRONG, fitted, some
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.search.stopping import LONGER


def test_traces_and_errors_are_those_of_the_simulation(logs, fit):
    for trace, log in zip(fit.traces, logs, strict=True):
        assert trace.log.name == log.name
        np.testing.assert_array_equal(trace.time, log.time)
        np.testing.assert_array_equal(trace.measured, log.measured["output_angle"])
        at = log.time - trace.delay
        result = st.simulate(fit.model, trace.command, load=log.load, duration=float(at[-1]))
        simulated = result.at("output_angle", np.maximum(at, 0.0)) + fit.estimates["angle_offset"]
        assert np.abs(trace.simulated - simulated).max() < 3e-3  # its start apart
        (error,) = [e for e in fit.training.errors["PulseServo"] if e.log == log.name]
        assert error.rms == pytest.approx(np.sqrt(np.mean(trace.residual**2)))
        assert error.largest == pytest.approx(np.abs(trace.residual).max())
    assert not fit.holdout


@pytest.mark.long
def test_logs_that_are_held_out_have_no_say(logs):
    other = noisy(run(WRONG, "prbs", seed=9, load=DISC, delay=0.05, duration=1.5), STD)
    found = fitted([*logs, other], holdout=[other.name])
    alone = fitted(logs)
    assert found.estimates == alone.estimates
    assert [t.held_out for t in found.traces] == [False, False, False, True]
    assert found.holdout.logs == (other.name,)
    assert found.training.logs == tuple(log.name for log in logs)
    assert found.holdout.total()["PulseServo"] > 3.0 * found.training.total()["PulseServo"]


@pytest.mark.long
def test_simpler_models_stand_beside():
    """Of a servo with friction that grows with load, M1 is off, and so is delay + slew + lag."""
    truth = TRUTH.replace({"friction.load_friction": 0.25})
    found = fitted(some(truth), truth, free=["output_inertia", "friction.load_friction"], compare_with=("slew", "M1"))
    total = found.training.total()
    assert set(total) == {"PulseServo", "M1", "delay + slew + lag"}
    assert total["PulseServo"] < total["M1"]
    assert total["PulseServo"] < total["delay + slew + lag"]


def test_levels(fit):
    """Of a normal law 1.645, 1.960 and 2.576 standard errors, and a little more of Student's with few samples."""
    k = fit.names.index("angle_offset")
    std, usual = float(fit.doubt.std[k]) * fit.scales["angle_offset"], fit.intervals()["angle_offset"]
    for level, reach in ((0.90, 1.644854), (0.95, 1.959964), (0.99, 2.575829)):
        lower, upper, method = fit.intervals(level)["angle_offset"]
        assert method == "normal"
        assert upper - lower >= 2.0 * fit.doubt.quantile(level, k) * std  # and what is left out, in proportion
        assert (upper - lower) / (usual.upper - usual.lower) == pytest.approx(
            fit.doubt.quantile(level, k) / fit.doubt.quantile(fit.level, k), rel=1e-6)
        assert reach <= fit.doubt.quantile(level, k) < 1.05 * reach
        assert all(type(x) is float for x in (lower, upper))


def test_correlation(fit):
    known = [k for k, name in enumerate(fit.names) if name != "delay"]  # which pulses tell, within a frame
    c = fit.correlation[np.ix_(known, known)]
    assert np.diag(c) == pytest.approx(np.ones(len(c)))
    np.testing.assert_allclose(c, c.T, atol=1e-12)
    assert (np.abs(c) <= 1.0 + 1e-12).all()


def test_draws_have_the_covariance_and_stay_within_bounds(fit):
    drawn = fit.draw(4000, seed=1)
    columns = {"motor.armature_resistance": "motor.armature_resistance", "output_inertia": "motor.rotor_inertia",
               "output_torque_constant": "motor.torque_constant"}
    x = np.array([np.log(drawn[member]) for member in columns.values()])
    which = [fit.names.index(name) for name in columns]
    values = np.array([fit.estimates[name] for name in columns])
    expected = fit.covariance[np.ix_(which, which)] / np.outer(values, values)
    found = np.cov(x)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.08)
    assert all(column.shape == (4000,) for column in drawn.values())
    np.testing.assert_array_equal(drawn["motor.torque_constant"], drawn["motor.back_emf_constant"])
    again = fit.draw(4000, seed=1)
    assert all((again[name] == column).all() for name, column in drawn.items())
    assert not (fit.draw(10, seed=2)["motor.rotor_inertia"] == drawn["motor.rotor_inertia"][:10]).any()
    st.simulate_many(fit.model, st.signals.step(0.0, 0.5, at=0.1, unit="rad"), duration=0.3, parameters=fit.draw(3),
                     output_times=[0.3], outputs=("output_angle",))


@pytest.mark.long
def test_draws_keep_to_bounds(logs):
    value = nominal(TRUTH, "output_inertia")
    found = fitted(logs, bounds={"output_inertia": (0.999 * value, 1.001 * value)})
    drawn = found.draw(500)["motor.rotor_inertia"] * TRUTH.gear.gear_reduction**2
    assert (drawn >= 0.999 * value * (1.0 - 1e-12)).all()
    assert (drawn <= 1.001 * value * (1.0 + 1e-12)).all()


def test_without_intervals(logs):
    found = fitted(logs, intervals=False)
    assert found.doubt is None
    assert {i.method for i in found.intervals().values()} == {"not sought"}
    assert np.isnan(found.covariance).all()
    drawn = found.draw(3)
    assert (drawn["motor.armature_resistance"] == found.estimates["motor.armature_resistance"]).all()


# ---------------------------------------------------------------------------------------- interrupts

def stopping(at):
    def tell(share, text):
        assert 0.0 <= share <= 1.0
        if text.startswith(at):
            raise KeyboardInterrupt
    return tell


@pytest.mark.parametrize("at", ["all logs", "intervals", "errors"])
def test_an_interrupt_keeps_the_best_so_far(logs, at):
    found = fitted(logs, progress=stopping(at), starts=2, seed=3)
    assert found.interrupted
    assert all(math.isfinite(value) for value in found.estimates.values())
    assert found.traces
    assert found.servo.fit["interrupted"] is True


@pytest.mark.long
def test_an_interrupt_in_a_bad_start_keeps_the_good_one(logs):
    """The first start ends at the truth; the others begin at random, and all are interrupted midway."""
    best = fitted(logs, intervals=False)
    bounds = {"output_inertia": (0.05, 0.2)} | {"motor.armature_resistance": (3.0, 60.0)}
    good = fitted(logs, intervals=False, bounds=bounds)

    told = []

    def midway(share, text):
        told.append(text.removesuffix(LONGER))  # slow processors add it
        if told.count("3 starts") > 8:
            raise KeyboardInterrupt

    found = fitted(logs, progress=midway, starts=3, seed=0, bounds=bounds)
    assert found.interrupted
    assert found.training.total()["PulseServo"] < 1.5 * good.training.total()["PulseServo"]
    assert best.training.total()["PulseServo"] <= good.training.total()["PulseServo"]


def test_progress_grows_to_the_end(logs):
    told = []
    fitted(logs, progress=lambda share, text: told.append(share))
    assert told == sorted(told)
    assert told[-1] >= 0.9


def test_a_fit_is_pickled(fit):
    again = pickle.loads(pickle.dumps(fit))
    assert again.estimates == fit.estimates
    assert again.intervals() == fit.intervals()
