"""Priors that the logs contradict yield, and those that they do not stay."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification import identify
from servotwin.identification.fitting.search.free import nominal
from servotwin.identification.fitting.yielding import Yielded

FORWARD, BACKWARD = "friction.coulomb_torque_forward", "friction.coulomb_torque_backward"
N = TRUTH.gear.gear_reduction
PLAIN = {"starts": 1, "compare_with": (), "holdout": 0}


def surely(servo, share, *names):
    """Return a servo whose file is sure of some numbers, within a share."""
    quantities = {name: replace(servo.source(name), lower=None, upper=None, std=share * servo.source(name).value)
                  for name in names}
    return replace(servo, quantities={**servo.quantities, **quantities})


def one_way(truth, torque, seed):
    """Return a log of steps in one direction, against a torque."""
    time = np.round(np.arange(0.0, 2.4, 0.01), 9)
    rng = np.random.default_rng(seed)
    width = 1e-6 * (1000.0 + np.cumsum(rng.uniform(50.0, 150.0, 8)))[np.minimum((time / 0.3 + 1e-9).astype(int), 7)]
    load = st.loads.Constant(torque)
    log = st.Log(name="up", time=time, command=width, command_kind="pulse_width", load=load, motion="steps",
                 measured={"output_angle": np.zeros(len(time))})
    result = st.simulate(st.PulseServo(truth), log.signal(0.01), load=load, duration=float(time[-1]), output_times=time)
    return noisy(replace(log, measured={"output_angle": result["output_angle"]}), 1e-3, seed=seed)


@pytest.mark.long
@pytest.mark.parametrize(("factor", "torque", "share"), [(1.6, 0.45, 0.03), (1.6, 0.35, 0.02), (0.6, 0.3, 0.02)],
                         ids=["slides back", "does not slide back", "slides easily"])
def test_a_sheet_does_not_beat_the_data(factor, torque, share):
    """Backward friction far from the file's, in logs that see little of it: the file goes, the truth is inside.

    In the second case the shaft never slides back: the cost is a cliff on one side and flat on the other.
    """
    truth = TRUTH.replace({BACKWARD: factor * TRUTH.get(BACKWARD)})
    fit = identify([one_way(truth, torque, 11)], surely(TRUTH, share, FORWARD, BACKWARD),
                   free=[FORWARD, BACKWARD, "output_inertia", "electronics.stretcher_gain"], **PLAIN)
    (one,) = fit.yielded
    assert one.name == BACKWARD
    assert one.apart > 3.5
    assert (one.file, one.file_std) == pytest.approx((TRUTH.get(BACKWARD), share * TRUTH.get(BACKWARD)))
    assert any("the logs contradict the servo file" in line and BACKWARD in line for line in fit.warnings)
    drawn = np.quantile(fit.draw(400)[BACKWARD], [0.0, 1.0])
    assert drawn[0] <= truth.get(BACKWARD) <= drawn[1]
    interval = fit.intervals()[BACKWARD]
    if interval.method != "undetermined":
        assert interval.lower <= truth.get(BACKWARD) <= interval.upper
        assert (one.logs_lower, one.logs_upper) == pytest.approx((interval.lower, interval.upper))
        assert fit.servo.source(BACKWARD).origin == "identified"
    assert fit.prior_share[BACKWARD] < fit.prior_share[FORWARD]


@pytest.mark.long
def test_an_interval_is_open_where_the_cost_is_flat_behind_a_cliff():
    """Friction that holds the load from some value on: the best is at the cliff, and all above it as likely."""
    truth = TRUTH.replace({BACKWARD: 1.6 * TRUTH.get(BACKWARD)})
    fit = identify([one_way(truth, 0.35, 12)], surely(TRUTH, 0.02, FORWARD, BACKWARD),
                   free=[FORWARD, BACKWARD, "output_inertia", "electronics.stretcher_gain"], **PLAIN)
    low, high, method = fit.intervals()[BACKWARD]
    assert method == "profile"
    assert low < truth.get(BACKWARD) < 5.0 * truth.get(BACKWARD) < high


@pytest.fixture(scope="module")
def unloaded():
    """Return logs that see only products of resistance, inertia and friction."""
    return [noisy(run(TRUTH, motion, seed=k, load=None, delay=0.05, duration=1.5), 1e-3, seed=k)
            for k, motion in enumerate(("step", "prbs"))]


FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]


@pytest.mark.long
def test_a_prior_within_its_own_doubt_stays(unloaded):
    """Two and a half of its standard deviations off, beside logs that say nothing of it alone."""
    value = TRUTH.motor.armature_resistance
    fit = identify(unloaded, TRUTH, free=FREE, priors={FREE[0]: (1.25 * value, 0.1 * value)}, **PLAIN)
    assert fit.yielded == ()
    assert fit.warnings == ()


@pytest.mark.long
def test_of_a_product_the_least_certain_prior_yields_and_none_is_far_off_alone(unloaded):
    """Resistance times inertia is seen, and is a third of what the priors say; inertia is the one that they guess."""
    r, j = TRUTH.motor.armature_resistance, N**2 * TRUTH.motor.rotor_inertia
    fit = identify(unloaded, TRUTH, free=FREE, priors={FREE[0]: (r, 0.03 * r), FREE[2]: (3.0 * j, 0.45 * j)}, **PLAIN)
    (one,) = fit.yielded
    assert one.name == "output_inertia"
    assert one.others == ("motor.armature_resistance",)
    assert not one.of_file
    assert "the priors that were given: motor.armature_resistance and output_inertia cannot all be" in str(one)
    assert math.isnan(one.logs_std)
    assert fit.estimates["output_inertia"] == pytest.approx(j, rel=0.1)
    assert fit.estimates["motor.armature_resistance"] == pytest.approx(r, rel=0.01)


@pytest.mark.parametrize(("one", "words"), [
    (Yielded("a", 1.0, 0.1, 2.0, 0.05, 8.94, 1.9, 2.1, "ohm"),
     "the logs contradict the servo file: a is 2 ohm (1.9 to 2.1), it says 1 ± 0.1 ohm (8.9 standard errors apart); it "
     "is fitted without that prior"),
    (Yielded("a", 1.0, 0.1, 2.0, math.nan, 8.94, unit="ohm", of_file=False),
     "the logs contradict the prior that was given: a is not 1 ± 0.1 ohm (8.9 standard errors apart); it is fitted "
     "without that prior, and the logs alone do not determine it"),
], ids=["file", "given, open"])
def test_lines(one, words):
    assert str(one) == words


def sag(model, **more):
    """Return by how many degrees a servo gives way to 0.5 N m."""
    zero = st.simulate(model, st.signals.constant(1500.0, unit="us"), duration=0.1)["output_angle"][0]
    lanes = st.simulate_many(model, st.signals.constant(1500.0, unit="us"), duration=1.5, load=st.loads.Constant(0.5),
                             output_times=np.linspace(1.2, 1.5, 16), **more)
    return np.degrees(zero - lanes["output_angle"].mean(axis=1))


@pytest.mark.long
def test_a_prior_that_is_pushed_is_widened():
    """A file that is sure of resistance, rotor and friction to 5 %, and 15 % off in the first; nothing on the horn."""
    names = ["motor.armature_resistance", "output_inertia", "output_coulomb_torque"]
    values = {name: nominal(TRUTH, name) for name in names}
    truth = TRUTH.replace({names[0]: 0.85 * values[names[0]]})
    logs, time = [], np.arange(0.0, 2.0, 0.02)
    for k in range(4):
        rng = np.random.default_rng(k)
        width = 1500.0 + np.repeat(rng.uniform(-400.0, 400.0, 10), 10)
        made = st.simulate(st.PulseServo(truth), st.signals.samples(time, width, unit="us"), duration=float(time[-1]),
                           output_times=time)
        logs.append(st.Log(name=str(k), time=time, command=1e-6 * width, command_kind="pulse_width",
                           measured={"output_angle": made["output_angle"] + 1e-3 * rng.standard_normal(len(time))}))
    fit = identify(logs, TRUTH, free=names, priors={name: (v, 0.05 * v) for name, v in values.items()}, **PLAIN)
    assert fit.yielded == ()
    (one,) = fit.widened
    assert one.name == names[0]
    assert one.std > 2.5 * one.file_std
    assert any("the logs push motor.armature_resistance" in line for line in fit.warnings)
    drawn, true = sag(fit.model, parameters=fit.draw(400)), sag(st.PulseServo(truth))[0]
    assert np.quantile(drawn, 0.1) < true < np.quantile(drawn, 0.9)  # it was in the lowest 4 % of them
    assert "widened" in fit.servo.fit
