"""Units at the edge: every factor against an independent definition, and one rule for numbers and arrays."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin import units
from servotwin.errors import UnitError

PAIRS = [(dimension, unit) for dimension, known in units.DIMENSIONS.items() for unit in known]
POUND, INCH, GRAVITY = 0.45359237, 0.0254, 9.80665  # exact by definition (1959, 1901)
TURN = 2.0 * math.pi

# (value, unit, dimension, the same in SI), each from a definition and not from the table
KNOWN = [
    (50.0, "%", "number", 0.5), (1500.0, "us", "time", 0.0015), (20.0, "ms", "time", 0.02), (2.0, "min", "time", 120.0),
    (180.0, "deg", "angle", math.pi), (360.0, "deg/s", "speed", TURN), (60.0, "rpm", "speed", TURN),
    (360.0, "deg/s", "output speed", TURN), (0.1, "deg/us", "angle per pulse", TURN / 3600.0 * 1e6),
    (1.0, "s/deg", "inverse speed", 180.0 / math.pi), (250.0, "mV", "voltage", 0.25), (285.0, "mA", "current", 0.285),
    (80.0, "mohm", "resistance", 0.08), (0.5, "mH", "inductance", 5e-4), (120.0, "uH", "inductance", 1.2e-4),
    (1.0, "mN m", "torque", 1e-3), (100.0, "kgf cm", "torque", GRAVITY), (13.2, "kgf cm", "torque", 1.2944778),
    (16.0, "ozf in", "torque", POUND * GRAVITY * INCH), (1000.0, "mN m/A", "torque per current", 1.0),
    (1000.0, "mV s/rad", "voltage per speed", 1.0), (1.0, "V/krpm", "voltage per speed", 60.0 / (1000.0 * TURN)),
    (1.0, "g cm2", "inertia", 1e-3 * 1e-2**2), (1.0, "kg cm2", "inertia", 1e-2**2),
    (1.0, "mN m s/rad", "torque per speed", 1e-3), (1.0, "N m/deg", "torque per angle", 180.0 / math.pi),
    (1092.93, "us/V", "time per voltage", 1.09293e-3), (1.4, "ms/V", "time per voltage", 1.4e-3),
    (0.7356, "V/ms", "voltage per time", 735.6), (1.0, "mV/us", "voltage per time", 1000.0),
    (7.324, "mV/deg", "voltage per angle", 7.324e-3 * 180.0 / math.pi),
    (1.0, "V/deg", "voltage per angle", 180.0 / math.pi),
    (2.44, "mV", "voltage per count", 2.44e-3), (55.0, "g", "mass", 0.055), (12.0, "cm", "length", 0.12),
    (3.0, "mm", "length", 0.003), (13.0, "N cm", "torque", 0.13), (100.0, "gf cm", "torque", 9.80665e-3),
    (10.0, "in", "length", 10 * INCH), (10.0, "lb", "mass", 10 * POUND),
    (1.0, "1/deg", "inverse angle", 180.0 / math.pi), (360.0, "deg/s2", "angular acceleration", TURN),
    (160.0, "oz", "mass", 10 * POUND), (-0.15, "%/K", "inverse temperature", -1.5e-3),
]


@pytest.mark.parametrize(("value", "unit", "dimension", "si"), KNOWN)
def test_known_conversions(value, unit, dimension, si):
    assert units.to_si(value, unit, dimension) == pytest.approx(si, rel=1e-14)
    assert units.from_si(si, unit, dimension) == pytest.approx(value, rel=1e-14)


def test_every_unit_that_is_not_si_has_a_known_conversion():
    si = {(dimension, units.si_unit(dimension)) for dimension in units.DIMENSIONS}
    assert set(PAIRS) - si == {(dimension, unit) for _, unit, dimension, _ in KNOWN}


@pytest.mark.parametrize("dimension", units.DIMENSIONS)
def test_the_first_unit_is_si(dimension):
    assert units.factor(units.si_unit(dimension), dimension) == 1.0
    assert units.to_si(0.1, units.si_unit(dimension), dimension) == 0.1


@given(st.sampled_from(PAIRS), st.floats(-1e12, 1e12))
def test_there_and_back(pair, value):
    dimension, unit = pair
    back = units.from_si(units.to_si(value, unit, dimension), unit, dimension)
    assert back == pytest.approx(value, rel=1e-15, abs=1e-300)


@given(st.sampled_from(PAIRS), st.lists(st.floats(-1e12, 1e12), min_size=1))
def test_an_array_is_converted_like_its_numbers(pair, values):
    dimension, unit = pair
    for convert in (units.to_si, units.from_si):
        array = convert(values, unit, dimension)
        assert array.tolist() == [convert(value, unit, dimension) for value in values]


@pytest.mark.parametrize(("unit", "dimension"), [("us", "time"), ("ms", "time"), ("mV", "voltage"),
                                                 ("mH", "inductance"),
                                                 ("g cm2", "inertia"), ("%", "number"), ("mm", "length")])
def test_a_decimal_prefix_costs_no_rounding(unit, dimension):
    """The SI value is the float next to the exact decimal, as if it had been typed in SI."""
    divisor = round(1.0 / units.factor(unit, dimension))
    for value in range(1, 3000):
        assert units.to_si(float(value), unit, dimension) == float(Fraction(value, divisor))


@given(st.sampled_from(PAIRS), st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_conversion_keeps_order(pair, a, b):
    dimension, unit = pair
    low, high = sorted((a, b))
    with np.errstate(over="ignore"):
        assert units.to_si(low, unit, dimension) <= units.to_si(high, unit, dimension)


def test_shapes_and_types():
    assert type(units.to_si(3, "ms", "time")) is float
    assert units.to_si(np.ones((2, 3)), "ms", "time").shape == (2, 3)
    assert units.to_si(np.ones(2, dtype=np.float32), "deg", "angle").dtype == np.float64
    assert units.to_si([], "ms", "time").shape == (0,)


@pytest.mark.parametrize("call", [
    lambda: units.factor("deg", "time"), lambda: units.factor("", "time"), lambda: units.factor("US", "time"),
    lambda: units.to_si(1.0, "kg", "length"), lambda: units.from_si(1.0, "C", "temperature"),
])
def test_a_wrong_unit_is_refused_with_those_that_fit(call):
    with pytest.raises(UnitError) as caught:
        call()
    error = caught.value
    assert error.got in str(error)
    assert error.allowed.split(", ")[0] in {units.si_unit(d) for d in ("time", "length", "temperature")}
    assert "\n" not in str(error)


@pytest.mark.parametrize("call", [lambda: units.si_unit("colour"), lambda: units.factor("V", "colour")])
def test_an_unknown_dimension_is_refused(call):
    with pytest.raises(UnitError, match=r"dimension: got 'colour', allowed: number, time"):
        call()


@pytest.mark.parametrize(("value", "finite"), [
    (0, True), (-1.5, True), (np.float32(2.0), True), (np.int64(3), True), (Fraction(1, 3), True), (1e308, True),
    (math.nan, False), (math.inf, False), (10**400, False), (True, False), (np.bool_(True), False), ("1", False),
    (1j, False), (np.complex128(1.0), False), (None, False), ([1.0], False), (np.ones(1), False),
])
def test_what_a_finite_number_is(value, finite):
    assert units.is_finite(value) is finite
