"""Registers at the page as one file: what it makes of them is what the package does."""

import random
import warnings

import pytest

import servotwin as st
from servotwin.errors import ServotwinError
from servotwin.parameters import catalog_names
from servotwin.web.alone.pack import register_tables
from servotwin.web.live.scene import family_of, with_registers

SERVOS = [name for name in catalog_names() if family_of(st.load_servo(name)) is not None]


def at(table, value):
    """Return the numbers that a table has for a value, as the page reads it; None of a value that is refused."""
    allowed = value in table["only"] if table["only"] else table["low"] <= value <= table["high"]
    start, *made = [piece for piece in table["pieces"] if piece[0] <= value][-1] if allowed else (0,)
    if not made:
        return None
    return [one + slope * (value - start) if isinstance(one, float) else one
            for one, slope in zip(*made, strict=True)]


@pytest.mark.long(but="dynamixel-ax-12a")
@pytest.mark.parametrize("name", SERVOS)
def test_tables_of_registers_are_the_laws(name):
    servo, rng = st.load_servo(name), random.Random(name)
    tables = register_tables(st.DigitalServo(servo))
    assert len(tables) >= 10
    assert any(table["name"] in ("P_Coefficient", "Position_P_Gain", "P_Gain", "CW_Compliance_Slope")
               for table in tables)
    looked, said = 0, []
    for table in tables:
        low, high = table["low"], table["high"]
        for value in {low, high, low - 1, high + 1, table["value"], *(rng.randint(low, high) for _ in range(6))}:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    after = with_registers(servo, {table["name"]: value})
                except ServotwinError as error:
                    assert at(table, value) is None, (table["name"], value)
                    said.append((str(error), f"{table['what']}: got {value}, allowed: {table['allowed']}"))
                    continue
            for number, ours in zip(table["numbers"], at(table, value), strict=True):
                theirs = after.get(number)
                assert ours == (pytest.approx(theirs, rel=1e-12, abs=1e-15) if isinstance(theirs, float) else theirs), (
                    table["name"], value, number)
                looked += 1
    assert looked > 50
    assert sum(theirs == ours for theirs, ours in said) >= len(said) / 2  # the others do not go together


@pytest.mark.parametrize("name", ["feetech-sts3215-12v", "dynamixel-xl430-w250"])
def test_the_stiffness_follows_the_gain(name):
    servo = st.load_servo(name)
    gain = "firmware.proportional_gain"
    gains = [share * servo.get(gain) for share in (0.25, 1.0, 3.0)]
    ratios = [st.DigitalServo(servo.replace({gain: one})).loop_stiffness() / one for one in gains]
    assert ratios == pytest.approx([ratios[1]] * 3, rel=1e-12)
