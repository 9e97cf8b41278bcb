"""Which experiment next: predicted intervals against those of a fit with that experiment."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.errors import InputError
from servotwin.identification import advise, identify

FREE = ["motor.armature_resistance", "output_torque_constant", "output_inertia", "output_coulomb_torque"]
STD = 1e-3
PLAIN = {"free": FREE, "priors": None, "starts": 1, "compare_with": (), "holdout": 0, "loss": "squares"}


@pytest.fixture(scope="module")
def logs():
    """Return logs without a load: the scale of all torques is unknown."""
    return [noisy(run(TRUTH, motion, seed=k, load=None, delay=0.05, duration=1.5), STD, seed=k)
            for k, motion in enumerate(("step", "prbs"))]


@pytest.fixture(scope="module")
def fit(logs):
    return identify(logs, TRUTH, **PLAIN)


@pytest.fixture(scope="module")
def advice(fit):
    return advise(fit, sensors=())


def performed(experiment, k):
    """Return the log that an experiment brings: the true servo under its command, with noise."""
    log = experiment.command
    servo = TRUTH.replace({n: v for n, v in log.parameters.items()})
    at = log.time - log.time[0] - 0.05
    result = st.simulate(st.PulseServo(servo), log.signal(0.01), load=log.load, duration=float(at[-1]))
    angle = result.at("output_angle", np.maximum(at, 0.0))
    return noisy(replace(log, name=f"next {k}", measured={"output_angle": angle}), STD, seed=100 + k)


def widths(fit):
    """Return half widths of 95 % relative to the values."""
    return {name: 0.5 * (i.upper - i.lower) / fit.estimates[name] for name, i in fit.intervals().items()
            if name in FREE}


@pytest.mark.long
def test_the_best_is_first_and_narrows_what_is_widest(fit, advice):
    best = advice.experiments[0]
    assert advice.widest in fit.undetermined
    assert best.widths[advice.widest] < 0.1 * advice.now[advice.widest]
    assert best.widest == max(best.widths.values())
    loads = [e.load for e in advice.experiments[:3]]
    assert all(load != "nothing on the horn" for load in loads)  # a known load is what is missing
    rounded = [math.log(e.widest) for e in advice.experiments]
    assert all(b >= a - 0.11 for a, b in pairwise(rounded))
    assert advice.widest in str(advice)
    assert str(best) in str(advice)


def test_no_experiment_can_make_anything_worse(advice):
    for experiment in advice.experiments:
        for name, width in experiment.widths.items():
            assert width <= advice.now[name] * (1.0 + 1e-9), (str(experiment), name)


@pytest.mark.long(but="5")
@pytest.mark.parametrize("which", [0, 5])
def test_predicted_widths_are_those_of_a_fit_with_the_experiment(logs, advice, which):
    experiment = advice.experiments[which]
    found = identify([*logs, performed(experiment, which)], TRUTH, **PLAIN)
    assert found.unidentifiable == ()
    for name, width in widths(found).items():
        assert experiment.widths[name] == pytest.approx(width, rel=0.25), name


@pytest.mark.long
def test_what_is_known_is_what_the_fit_says():
    known = [noisy(run(TRUTH, motion, seed=k, delay=0.05, duration=1.5,
                       load=st.loads.Inertia(1e-2) + st.loads.Constant(0.3)), STD, seed=k)
             for k, motion in enumerate(("step", "prbs", "triangle"))]
    fit = identify(known, TRUTH, **PLAIN)
    now = advise(fit, sensors=(), voltages=[6.0]).now
    for name, width in widths(fit).items():
        assert now[name] == pytest.approx(width, rel=0.1), name


def test_a_current_tells_what_no_unloaded_motion_can(fit):
    advice = advise(fit, sensors=("supply_current",))
    bare = [e for e in advice.experiments if e.load == "nothing on the horn"]
    with_current = min(e.widest for e in bare if "supply_current" in e.sensors)
    without = min(e.widest for e in bare if "supply_current" not in e.sensors)
    assert with_current < 0.2 * without
    assert any("supply current" in str(e) for e in bare)


def test_a_servo_alone_is_enough_to_begin():
    advice = advise(TRUTH, free=["output_inertia", "motor.armature_resistance"], priors="servo", sensors=())
    prior = TRUTH.source("motor.armature_resistance")
    a, b = math.log(prior.lower / prior.value), math.log(prior.upper / prior.value)
    share = 1.96 * math.sqrt((a * a + a * b + b * b) / 3.0)  # of a uniform law of the logarithm
    assert advice.now["motor.armature_resistance"] == pytest.approx(share, rel=0.02)
    assert advice.experiments[0].widths["motor.armature_resistance"] < share
    assert math.isinf(advice.alone["motor.armature_resistance"]) or advice.alone["motor.armature_resistance"] > 10.0
    assert "by logs alone" in str(advice)
    command = advice.experiments[0].command
    assert command.time.tolist() == [round(t, 9) for t in command.time.tolist()]
    low, high = TRUTH.stops.lower_angle, TRUTH.stops.upper_angle
    assert low < command.command.min() < command.command.max() < high


def test_priors_count_as_known(fit):
    value = TRUTH.motor.armature_resistance
    loose = advise(TRUTH, free=FREE, priors=None, sensors=(), voltages=[6.0])
    tight = advise(TRUTH, free=FREE, priors={"motor.armature_resistance": (value, 1e-4 * value)}, sensors=(),
                   voltages=[6.0])
    assert tight.now["motor.armature_resistance"] == pytest.approx(1.96e-4, rel=1e-3)
    for a, b in zip(sorted(map(str, loose.experiments)), sorted(map(str, tight.experiments)), strict=True):
        assert a == b
    best = {str(e): e.widths["output_inertia"] for e in loose.experiments}
    assert all(e.widths["output_inertia"] <= best[str(e)] * (1.0 + 1e-9) for e in tight.experiments)


@pytest.mark.long
def test_advice_is_the_same_each_time(fit):
    a, b = (advise(fit, sensors=("supply_current",)) for _ in range(2))
    assert [str(e) for e in a.experiments] == [str(e) for e in b.experiments]
    assert [dict(e.widths) for e in a.experiments] == [dict(e.widths) for e in b.experiments]


def test_voltages_and_sensors_are_those_allowed(fit):
    advice = advise(fit, sensors=(), voltages=[5.0, 7.4])
    assert {e.voltage for e in advice.experiments} == {5.0, 7.4}
    assert {e.sensors for e in advice.experiments} == {("output_angle",)}
    for experiment in advice.experiments:
        assert experiment.command.parameters["supply.open_circuit_voltage"] == experiment.voltage


@pytest.mark.parametrize(("more", "words"), [
    ({"sensors": ("current",)}, "sensors"), ({"sensors": ("output_angle",)}, "sensors"),
    ({"voltages": [0.0]}, "voltages"), ({"voltages": [-6.0]}, "voltages"), ({"voltages": [float("nan")]}, "voltages"),
    ({"voltages": []}, "voltages|experiments"), ({"voltages": ["6"]}, "voltages"),
], ids=["unknown", "not further", "zero", "negative", "nan", "none", "text"])
def test_what_makes_no_sense_is_refused(fit, more, words):
    with pytest.raises(InputError, match=words) as caught:
        advise(fit, **more)
    assert "\n" not in str(caught.value)


def test_a_fit_without_intervals_cannot_be_asked(logs):
    rough = identify(logs, TRUTH, **{**PLAIN, "intervals": False})
    with pytest.raises(InputError, match="intervals"):
        advise(rough)
