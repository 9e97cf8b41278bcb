"""The numbers of docs/theory/supply_vibration.md are those of a new run."""

import re
import sys

import pytest

from docs.pages import ROOT

PAGE = ROOT / "docs" / "theory" / "supply_vibration.md"


@pytest.fixture(scope="module")
def vibration():
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        import vibration as found
    finally:
        sys.path.pop(0)
    return found


@pytest.fixture(scope="module")
def page():
    return PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["case", "angle", "resistance", "share", "unknown", "coupling", "inductance"])
def test_the_table_is_the_one_that_the_runs_give(vibration, page, name):
    assert vibration.TABLES[name]() in page


def test_no_table_of_the_page_goes_unchecked(vibration, page):
    assert len(re.findall(r"^\| ---", page, re.MULTILINE)) == len(vibration.TABLES)


def test_the_numbers_of_the_loop(vibration, page):
    """What a start from rest, and a drive against the motion, take off the pulse and the angle."""
    value = vibration.bench().model.value
    left = 1.0 - value("supply.bridge_drop_voltage") / value("supply.open_circuit_voltage")
    sag = vibration.SOFT / (value("motor.armature_resistance") + vibration.SOFT) * left
    assert f"{6.0 * sag:.2f} V or {100.0 * sag:.0f} %" in page
    widths = [vibration.bench().generator.width(n) for n in vibration.run().counts[200:]]
    full = vibration.bench().pulse_width(vibration.ROWS[2])
    per_angle = value("electronics.one_shot_slope") * value("potentiometer.feedback_gain")
    at_rest = full - vibration.bench().pulse_width(vibration.ROWS[2] * (1.0 - sag))
    assert f"by {1e6 * at_rest:.0f} µs after a start from rest" in page
    assert f"asks for {57.29578 * at_rest / per_angle:.1f}° less" in page
    assert f"up to {1e6 * (full - min(widths)):.0f} µs" in page


def test_eight_frames_make_one_swing(vibration, page):
    counts = vibration.run().counts[-48:]
    assert counts[8:] == counts[:-8]
    assert all(counts[k:] != counts[:-k] for k in (1, 2, 4))
    rate = vibration.bench().generator.pulse_rate / 8.0
    assert f"Eight frames make one swing, {rate:.1f} a second" in page
