"""Numbers with units, as people write them: many spellings, one value; what could mean two things is refused."""

import math

import pytest

from servotwin import units
from servotwin.errors import InputError
from servotwin.units.quantities import quantity

G = 9.80665


@pytest.mark.parametrize(("text", "dimension", "si"), [
    ("13 kgf.cm", "torque", 13e-2 * G), ("13 kg-cm", "torque", 13e-2 * G), ("13KGF CM", "torque", 13e-2 * G),
    ("-20 mN·m", "torque", -0.02), (" +.5N m ", "torque", 0.5), ("10oz-in", "torque", 0.28349523125 * G * 0.0254),
    ("1500 µs", "time", 1.5e-3), ("1500usec", "time", 1.5e-3), ("1.5e3us", "time", 1.5e-3), ("2 seconds", "time", 2.0),
    ("180°", "angle", math.pi), ("180 Degrees", "angle", math.pi), ("3 Ω", "resistance", 3.0),
    ("3 Ohm", "resistance", 3.0), ("5 g·cm²", "inertia", 5e-7), ("25%", "number", 0.25)])
def test_one_value_in_many_spellings(text, dimension, si):
    assert quantity("x", text, dimension) == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize(("text", "si", "said"), [
    ("1.8 kg/cm", 1.8e-2 * G, "read kg/cm as kgf cm"), ("1.8Kgf / cm", 1.8e-2 * G, "read Kgf / cm as kgf cm"),
    ("16.7 oz/in", 0.11792791530, "read oz/in as ozf in"), ("16.7 oz./in.", 0.11792791530, "read oz./in. as ozf in"),
    ("20 N/cm", 0.2, "read N/cm as N cm")])
def test_a_torque_written_as_a_quotient_is_read_as_the_product_it_means_and_that_is_said(text, si, said):
    with pytest.warns(UserWarning, match=f"^{said}$"):
        assert quantity("x", text, "torque") == pytest.approx(si, rel=1e-9)


@pytest.mark.parametrize("text", ["1 kg//cm", "1 /kgcm", "1 kg/m", "1 kg/cm2"])
def test_other_quotients_are_no_torque(text):
    with pytest.raises(InputError, match="one of the units N m"):
        quantity("x", text, "torque")


def test_every_unit_reads_as_itself():
    for dimension, known in units.DIMENSIONS.items():
        for unit in known:
            assert quantity("x", f"3 {unit}", dimension) == units.to_si(3.0, unit, dimension), (unit, dimension)


@pytest.mark.parametrize(("text", "dimension"), [
    ("1 MV", "voltage"), ("1 Mohm", "resistance"), ("1 MS", "time"), ("1", "torque"), ("", "torque"), ("V", "voltage"),
    ("1,29 N m", "torque"), ("1e999 V", "voltage"), ("nan V", "voltage"), ("1 2 V", "voltage"), ("1 A", "voltage"),
    ("1 ns", "time"), ("1 V V", "voltage"), ("0x10 V", "voltage"), ("1_0 V", "voltage"), ("--1 V", "voltage")])
def test_what_is_no_quantity_is_refused_with_the_units(text, dimension):
    with pytest.raises(InputError, match="one of the units") as caught:
        quantity("--x", text, dimension)
    assert str(caught.value).startswith(f"--x: got {text!r}, allowed: a number")


def test_bare_numbers_and_signs_where_they_are_allowed():
    assert quantity("x", "-3", "torque", bare=True) == -3.0
    for text in ("-3", "0", "-1 V"):
        with pytest.raises(InputError, match="a positive number in SI, or with one of the units V, mV"):
            quantity("x", text, "voltage", bare=True, positive=True)
