"""Figures of a table [sheet]: units, what is assumed, spreads."""

import math

import pytest

from servotwin import units
from servotwin.errors import InputError
from servotwin.parameters.servo_file import POINT, WHOLE, figure, printed


def test_a_speed_is_read_from_its_time_and_its_spread_turns_round():
    found = figure("mine", "speed_per_60deg", {"value": 200.0, "unit": "ms", "lower": 160.0, "upper": 250.0})
    assert (found.value, found.lower, found.upper) == pytest.approx((math.pi / 0.6, math.pi / 0.75, math.pi / 0.48))
    found = figure("mine", "speed_per_60deg", {"value": 0.2, "unit": "s", "std": 0.01})
    assert found.std / found.value == pytest.approx(0.05)


@pytest.mark.parametrize("key", [*POINT, *WHOLE])
def test_printing_and_reading_are_inverse(key):
    _, dimension, unit = {**POINT, **WHOLE}[key]
    found = figure("mine", key, {"value": 3.0, "unit": unit, "source": "the box", "std": 0.3})
    assert units.from_si(printed(key, found.value), unit, dimension) == pytest.approx(3.0)
    assert found.std / found.value == pytest.approx(0.1)
    assert found.source == "the box"


def test_what_is_assumed_is_not_printed():
    assert figure("mine", "stall_current", {"value": 1.0, "unit": "A", "source": "assumed"}) is None


@pytest.mark.parametrize(("entry", "said"), [
    (3.0, "[sheet] stall_torque of 'mine'"), ({"value": 3.0}, "unit = \"N m\""),
    ({"value": "x", "unit": "N m"}, "value"), ({"value": math.nan, "unit": "N m"}, "value"),
    ({"value": 3.0, "unit": "V"}, "unit"), ({"value": 3.0, "unit": "N m", "std": "x"}, "value"),
    ({"value": 3.0, "unit": "N m", "std": -1.0}, "std: got -1.0"),
    ({"value": 3.0, "unit": "N m", "std": float("nan")}, "std: got nan"),
    ({"value": 3.0, "unit": "N m", "std": 0.1, "lower": 2.0}, "either std or lower and upper"),
    ({"value": 3.0, "unit": "N m", "lower": 3.1}, "lower: got 3.1"),
    ({"value": 3.0, "unit": "N m", "lower": 0.0}, "lower: got 0.0"),
    ({"value": 3.0, "unit": "N m", "upper": 2.9}, "upper: got 2.9"),
    ({"value": 3.0, "unit": "N m", "upper": math.inf}, "upper: got inf"),
])
def test_bad_figures(entry, said):
    with pytest.raises(InputError) as caught:
        figure("mine", "stall_torque", entry)
    assert said in str(caught.value)
