"""Distributions, their words, and draws that do not depend on what is drawn beside them."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, ParameterError, UnitError, UnknownNameError
from servotwin.loads import Load
from servotwin.simulation.lanes.inputs import LOAD_NAMES
from servotwin.studies import distributions as d
from servotwin.studies.kinds import distribution_of
from servotwin.studies.plan import (
    SAMPLINGS,
    checked_table,
    dimension_of,
    distributions_of,
    drawn,
    noise_seeds,
    parameter,
)

P = np.linspace(0.001, 0.999, 41)
NUMBERS = [d.Uniform(-1.0, 3.0), d.Normal(2.0, 0.3), d.LogNormal(3.0, 0.2), d.Triangular(1.0, 1.5, 4.0),
           d.Triangular(1.0, 1.0, 4.0), d.Triangular(1.0, 4.0, 4.0),
           d.Affine(d.Normal(0.0, 1.0), offset=2.0, scale=-3.0),
           d.Truncated(d.Normal(0.0, 1.0), 0.0, math.inf), d.Truncated(d.Uniform(-1.0, 1.0), -0.5, 0.25)]


@pytest.fixture(scope="module")
def model(servo):
    return st.PulseServo(servo)


@pytest.mark.parametrize("distribution", NUMBERS, ids=lambda x: repr(x)[:40])
def test_a_quantile_is_the_inverse_of_the_distribution_function(distribution):
    values = distribution.quantile(P)
    assert np.all(np.diff(values) > 0.0)
    np.testing.assert_allclose([distribution.cdf(x) for x in values.tolist()], P, atol=1e-12)
    assert distribution.ends == tuple(distribution.quantile(np.array([0.05, 0.95])).tolist())


@pytest.mark.parametrize(("distribution", "mean", "std"), [
    (d.Uniform(1.0, 3.0), 2.0, 2.0 / math.sqrt(12.0)), (d.Normal(2.0, 0.3), 2.0, 0.3),
    (d.LogNormal(2.0, 0.1), 2.0 * math.exp(0.005), 2.0 * math.exp(0.005) * math.sqrt(math.expm1(0.01))),
    (d.Triangular(0.0, 1.0, 2.0), 1.0, 1.0 / math.sqrt(6.0)),
    (d.Relative(d.Normal(1.0, 0.1)).about(5.0), 5.0, 0.5), (d.Offset(d.Uniform(-1.0, 1.0)).about(5.0), 5.0, 3**-0.5),
    (d.Truncated(d.Normal(0.0, 1.0), 0.0, math.inf), math.sqrt(2.0 / math.pi), math.sqrt(1.0 - 2.0 / math.pi)),
])
def test_mean_and_deviation_are_those_of_the_books(distribution, mean, std):
    values = distribution.quantile((np.arange(200_000) + 0.5) / 200_000)
    assert values.mean() == pytest.approx(mean, abs=1e-4)
    assert values.std() == pytest.approx(std, abs=1e-3)


@pytest.mark.parametrize(("text", "dimension", "expected"), [
    ("uniform:4us..8us", "time", d.Uniform(4e-6, 8e-6)),
    ("uniform:4..8us", "time", d.Uniform(4e-6, 8e-6)),
    ("uniform: 1e-3 .. 2e-3", "inertia", d.Uniform(1e-3, 2e-3)),
    ("uniform:10%", "time", d.Relative(d.Uniform(0.9, 1.1))),
    ("uniform:±10%", "time", d.Relative(d.Uniform(0.9, 1.1))),
    ("uniform:1 us", "time", d.Offset(d.Uniform(-1e-6, 1e-6))),
    ("normal:10%", "resistance", d.Relative(d.Normal(1.0, 0.1))),
    ("normal:0.3", "resistance", d.Offset(d.Normal(0.0, 0.3))),
    ("normal:3ohm±0.3ohm", "resistance", d.Normal(3.0, 0.3)),
    ("normal:3+-300mohm", "resistance", d.Normal(3e-3, 0.3)),
    ("normal:3Ω±10%", "resistance", d.Normal(3.0, 0.3)),
    ("lognormal:10%", "resistance", d.Relative(d.LogNormal(1.0, 0.1))),
    ("lognormal:3ohm±10%", "resistance", d.LogNormal(3.0, 0.1)),
    ("triangular:4us..6us..8us", "time", d.Triangular(4e-6, 6e-6, 8e-6)),
    ("triangular:10%", "time", d.Relative(d.Triangular(0.9, 1.0, 1.1))),
    ("choice:4us,8us", "time", d.Choice((4e-6, 8e-6))),
    ("choice:brake, coast", "word", d.Choice(("brake", "coast"))),
])
def test_words(text, dimension, expected):
    assert distribution_of(text, dimension) == expected


@pytest.mark.parametrize(("name", "text", "kind", "said"), [
    ("motor.armature_resistance", "gauss:10%", ParameterError, "unknown distribution 'gauss'"),
    ("motor.armature_resistance", "normal", InputError, "normal:10%"),
    ("motor.armature_resistance", "normal:nan", InputError, "got 'nan'"),
    ("motor.armature_resistance", "normal:inf%", InputError, "got 'inf%'"),
    ("motor.armature_resistance", "normal:0%", InputError, "Normal(std): got 0.0, allowed: a positive number"),
    ("motor.armature_resistance", "normal:-0.1", InputError, "Normal(std): got -0.1"),
    ("motor.armature_resistance", "normal:1e999%", InputError, "got inf"),
    ("motor.armature_resistance", "normal:3V", InputError, "got 'V', allowed: ohm, mohm"),
    ("motor.armature_resistance", "lognormal:0.3ohm", InputError, "lognormal:10%"),
    ("electronics.deadband", "uniform:8us..4us", InputError, "lower less than upper"),
    ("electronics.deadband", "uniform:4us..5us..6us", InputError, "uniform:4us..8us"),
    ("electronics.deadband", "triangular:4us..6us", InputError, "triangular:4us..6us..8us"),
    ("electronics.off_state", "normal:10%", InputError, "choice:WORD,WORD"),
    ("electronics.off_state", "choice:brake,break", InputError, "got 'break', allowed: brake or coast"),
    ("load.inertia", "normal:10%", ParameterError, "got 'a nominal value of 0'"),
    ("electronics.pulse_timeout", "normal:10%", ParameterError, "no nominal value"),
    ("load.pendulum.mass", "normal:10%", InputError, "0 pendulums"),
    ("motor.armature_inductance", "normal:10%", ParameterError, "does not read"),
    ("motor.resistance", "normal:10%", UnknownNameError, "did you mean"),
    ("motor.armature_resistance", 3.0, ParameterError, "normal:10%"),
    ("motor.armature_resistance", d.Choice(("brake",)), ParameterError, "a positive number"),
])
def test_what_cannot_be_is_refused_with_its_name(model, name, text, kind, said):
    with pytest.raises(kind) as caught:
        distributions_of({name: text}, model, Load(), truncate=False)
    assert said in str(caught.value)
    assert name.split(".")[0] in str(caught.value)


def test_a_wrong_unit_is_one_of_its_own_kind():
    with pytest.raises(UnitError):
        distribution_of("uniform:4V..8V", "time")


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_draws_follow_their_distribution(sampling):
    found = drawn({"a": d.Normal(1.0, 2.0), "b": d.Uniform(0.0, 1.0)}, 4096, 3, sampling)
    assert found["a"].mean() == pytest.approx(1.0, abs=0.12)
    assert found["a"].std() == pytest.approx(2.0, abs=0.1)
    assert abs(np.corrcoef(found["a"], found["b"])[0, 1]) < 0.05


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_a_lane_does_not_depend_on_how_many_there_are(sampling):
    kinds = {"a": d.Normal(1.0, 2.0), "b": d.Uniform(0.0, 1.0)}
    few, many = (drawn(kinds, lanes, 3, sampling) for lanes in (37, 1000))
    for name in kinds:
        np.testing.assert_array_equal(few[name], many[name][:37])
    np.testing.assert_array_equal(noise_seeds(37, 3), noise_seeds(1000, 3)[:37])


@pytest.mark.parametrize("sampling", ["latin-hypercube", "random"])
def test_a_parameter_does_not_depend_on_the_others(sampling):
    alone = drawn({"b": d.Uniform(0.0, 1.0)}, 100, 3, sampling)
    beside = drawn({"a": d.Normal(1.0, 2.0), "b": d.Uniform(0.0, 1.0)}, 100, 3, sampling)
    np.testing.assert_array_equal(alone["b"], beside["b"])
    other = drawn({"b": d.Uniform(0.0, 1.0)}, 100, 4, sampling)
    assert not np.any(alone["b"] == other["b"])


def test_a_latin_hypercube_has_one_lane_in_each_stratum():
    column = drawn({"a": d.Uniform(0.0, 100.0)}, 100, 0, "latin-hypercube")["a"]
    assert sorted(np.floor(column).astype(int).tolist()) == list(range(100))
    assert not np.all(np.diff(column) > 0.0)


def test_truncation_keeps_draws_inside_and_lanes_in_place(model):
    name = "motor.armature_resistance"
    free, cut = (distributions_of({name: "normal:60%"}, model, Load(), truncate=flag)[name] for flag in (False, True))
    values = {flag: drawn({name: kind}, 1000, 1, "random")[name] for flag, kind in ((False, free), (True, cut))}
    assert values[False].min() < 0.0 < values[True].min()
    np.testing.assert_array_equal(np.argsort(values[True]), np.argsort(values[False]))
    np.testing.assert_array_equal(values[True][:10], drawn({name: cut}, 10, 1, "random")[name])


def test_truncation_leaves_alone_what_is_inside(model):
    found = distributions_of({"electronics.deadband": "uniform:4us..8us"}, model, Load(), truncate=True)
    assert found == {"electronics.deadband": d.Uniform(4e-6, 8e-6)}


def test_nothing_is_left_of_what_is_outside(model):
    with pytest.raises(ParameterError, match="reaches into"):
        distributions_of({"motor.armature_resistance": d.Uniform(-2.0, -1.0)}, model, Load(), truncate=True)


def test_the_spread_of_the_file(model):
    found = d.stated(model)
    assert found["electronics.stretcher_gain"] == d.Uniform(60.0, 200.0)
    assert found["electronics.one_shot_slope"] == d.Normal(0.00135937, 9.71642e-6)
    assert found["electronics.deadband"] == d.Uniform(8e-6, 16e-6)
    assert "motor.armature_inductance" not in found  # it is not read
    assert "supply.open_circuit_voltage" not in found  # it has none


def test_every_number_of_a_load_can_be_varied(model):
    load = st.loads.Inertia(1e-3) + st.loads.Pendulum(mass=0.1, length=0.2) + st.loads.Spring(0.3, 0.1)
    load += st.loads.Flexible(stiffness=20.0, mass=0.1, length=0.1)
    found = {name: parameter(name, model, load) for name in LOAD_NAMES}
    assert found["load.pendulum.inertia"].nominal == pytest.approx(0.1 * 0.2**2)
    assert found["load.flexible.inertia"].nominal == pytest.approx(0.1 * 0.1**2)
    assert found["load.flexible.stiffness"].lower > 0.0
    assert found["load.spring.rest_angle"].lower == -math.inf
    assert found["load.inertia"].lower == 0.0
    assert {dimension_of(name) for name in LOAD_NAMES} <= set(st.units.DIMENSIONS)


@pytest.mark.parametrize(("draws", "said"), [
    ({"motor.torque_constant": [[1.0]]}, "draws of motor.torque_constant"),
    ({"motor.torque_constant": []}, "a positive number"),
    ({"motor.torque_constant": ["a"]}, "a positive number"),
    ({"motor.torque_constant": [1.0, 2.0], "load.torque": [1.0]}, "columns of one length"),
    ([1.0], "a mapping"),
])
def test_bad_tables_of_draws(model, draws, said):
    with pytest.raises(InputError) as caught:
        checked_table(draws, model, Load())
    assert said in str(caught.value)


def test_what_is_infinite_can_be_written_down():
    assert d.Truncated(d.Normal(0.0, 1.0), 0.0, math.inf).described() == {
        "kind": "Truncated", "distribution": {"kind": "Normal", "mean": 0.0, "std": 1.0}, "lower": 0.0, "upper": None}
