"""The commands on the file of a servo that turns without end."""

import math

import pytest

import servotwin as st


@pytest.fixture
def wheel(tmp_path):
    st.load_servo("hitec-hs-755hb").continuous(math.radians(86.0)).save(tmp_path / "wheel.toml")
    return "wheel.toml"


def test_it_is_simulated_by_pulses_only(cli, wheel):
    ended = cli("simulate", wheel, "--step", "1500:1560", "--unit", "us", "--json")
    assert ended.code == 0
    assert ended.data["final_angle"] > 0.5
    assert "pulse commands only" in cli("simulate", wheel, "--step", "0:90").error
    assert "potentiometer.fixed_angle" in cli("simulate", wheel, "--step", "1500:1560", "--unit", "us", "--set",
                                              "stops.upper_angle=2").error


def test_check_and_curves_take_it(cli, wheel):
    assert "fixed_angle" in cli("catalog", "check", wheel).out
    shown = cli("curves", wheel).out
    assert "speed without load" in shown
    assert "smallest move" not in shown
