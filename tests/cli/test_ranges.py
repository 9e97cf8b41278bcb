"""Figures that rest on guesses show their range, and the commands name the guesses."""

import math

import pytest

import servotwin as st
from servotwin.datasheet.holding import guesses

pytestmark = pytest.mark.long


def test_curves_and_simulate_show_the_range_and_name_the_guesses(cli):
    text = cli("curves", "hitec-hs-311", "--quick").out
    assert "deg (3." in next(line for line in text.splitlines() if line.startswith("holding 0.2 N m"))
    assert "electronics.stretcher_gain" in text
    step = ("simulate", "hitec-hs-311", "--step", "-30:30", "--load", "torque=0.2")
    found = cli(*step, "--json").data
    low, high = found["ranges"]["holding_error"]
    assert low < found["holding_error"] < high
    assert f"holding error      {math.degrees(found['holding_error']):.2f} deg ({math.degrees(low):.2f} to " in cli(
        *step).out
    fixed = cli(*step, *(word for name in guesses(st.PulseServo(st.load_servo("hitec-hs-311")), rotor=True)
                         for word in ("--set", f"{name}={st.load_servo('hitec-hs-311').get(name)}")), "--json").data
    assert fixed["ranges"] == {}
    assert fixed["holding_error"] == pytest.approx(found["holding_error"])
    assert "ranges" not in cli(*step[:4], "--duration", "6", "--json").data  # too long for four more


def test_digital_droop_shows_its_range(cli):
    text = cli("curves", "towerpro-mg996r", "--quick", "--load", "torque=0.2").out
    droop = next(line for line in text.splitlines() if "droop for 0.2 N m" in line)
    assert droop.count(" to ") >= 1
    loop = cli("curves", "towerpro-mg996r", "--quick", "--load", "torque=0.2", "--json").data["servos"][0]["voltages"][
        0]["loop"]
    assert loop["spans"]["stiffness"][0] < loop["stiffness"] < loop["spans"]["stiffness"][1]
    assert loop["droop_spans"]["lifted"][0] < loop["droop"]["lifted"] < loop["droop_spans"]["lifted"][1]
