"""Supplies in words."""

import pytest

import servotwin as st
from servotwin.errors import InputError


@pytest.mark.parametrize(("text", "numbers"), [
    ("usb", (5.0, None, 0.5)), (" USB ", (5.0, None, 0.5)), ("6", (6.0, None, None)),
    ("12V:150mohm", (12.0, 0.15, None)),
    ("6:0.3", (6.0, 0.3, None)), ("5V:500mA", (5.0, None, 0.5)), ("7.4V:0.1ohm:3A", (7.4, 0.1, 3.0)),
    ("7.4V:3A:0.1ohm", (7.4, 0.1, 3.0))])
def test_a_supply_is_its_numbers(text, numbers):
    found = st.Supply.of(text)
    assert (found.open_circuit_voltage, found.internal_resistance, found.current_limit) == numbers


@pytest.mark.parametrize("text", ["", "usc", "5V:", "-5V", "0V", "5V:-1ohm", "5V:0A", "5V:1A:2A", "5V:1:2", "5A",
                                  "5V:2kg", "nan"])
def test_anything_else_is_refused(text):
    with pytest.raises(InputError, match="supply"):
        st.Supply.of(text, what="--supply")
