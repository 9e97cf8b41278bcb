"""The commands on the file of a servo that turns without end."""

import math

import pytest

import servotwin as st

# Sold as continuous: rpm, and the pulses at which it stands
FS90R = ["--name", "fs90r", "--torque", "1.3 kgf.cm @4.8", "--torque", "1.5 kgf.cm @6.0", "--speed", "100 rpm @4.8",
         "--speed", "130 rpm @6.0", "--stall-current", "800 mA @6.0", "--running-current", "120 mA @6.0", "--mass",
         "9 g", "--pulse-range", "700-2300 us", "--deadband", "90 us"]
RPM = math.pi / 30.0


@pytest.fixture
def wheel(tmp_path):
    st.load_servo("hitec-hs-755hb").continuous(math.radians(86.0)).save(tmp_path / "wheel.toml")
    return "wheel.toml"


@pytest.mark.long
def test_it_is_simulated_by_pulses_only(cli, wheel):
    ended = cli("simulate", wheel, "--step", "1500:1560", "--unit", "us", "--json")
    assert ended.code == 0
    assert ended.data["final_angle"] > 0.5
    assert "pulse commands only" in cli("simulate", wheel, "--step", "0:90").error
    assert "potentiometer.fixed_angle" in cli("simulate", wheel, "--step", "1500:1560", "--unit", "us", "--set",
                                              "stops.upper_angle=2").error


@pytest.mark.long
def test_check_and_curves_take_it(cli, wheel):
    assert "fixed_angle" in cli("catalog", "check", wheel).out
    shown = cli("curves", wheel).out
    assert "speed without load" in shown
    assert "smallest move" not in shown


@pytest.mark.long
@pytest.mark.parametrize("words", [["--continuous"], ["--travel", "endless"]])
def test_a_sheet_makes_a_servo_that_turns_without_end(cli, tmp_path, words):
    made = cli("catalog", "from-sheet", *FS90R, *words, "--out", "fs90r.toml")
    assert made.code == 0
    assert "not given" not in made.out
    assert cli("catalog", "from-sheet", "fs90r.toml", "--out", "again.toml").code == 0
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "fs90r.toml").read_text()
    part = cli("curves", "fs90r.toml", "--json").data["servos"][0]["voltages"][0]
    low, high = part["turning"]["still"]
    assert 1e6 * low == pytest.approx(1455.0, abs=0.5)
    assert 1e6 * high == pytest.approx(1545.0, abs=0.5)
    assert part["turning"]["output_speed"][-1] == pytest.approx(130.0 * RPM, rel=0.02)
    assert part["turning"]["output_speed"][0] == pytest.approx(-130.0 * RPM, rel=0.02)
    assert "speed at 1700 us" in cli("curves", "fs90r.toml").out
    for width, least, most in ((1540, 0.0, 0.0), (1600, 5.0, 60.0), (1900, 127.0, 133.0)):
        told = ("simulate", "fs90r.toml", "--constant", width, "--unit", "us", "--duration", "2")
        assert least <= cli(*told, "--json").data["mean_speed"] / RPM <= most
        assert "rpm" in cli(*told).out


@pytest.mark.parametrize("words", [["--continuous", "--travel", "180 deg"], ["--continuous", "--stops", "180 deg"],
                                   ["--travel", "endless", "--rate", "0.1 deg/us"]])
def test_a_travel_of_one_that_turns_without_end_is_refused(cli, tmp_path, words):
    assert "of a servo that turns without end" in cli("catalog", "from-sheet", *FS90R, *words, "--out", "a.toml").error
    assert not list(tmp_path.iterdir())


def test_a_list_has_servos_that_turn_without_end(cli, tmp_path):
    (tmp_path / "list.csv").write_text("model,V,stall_torque_Nm,speed_s_per_60deg,travel_deg\nA,6,0.15,0.08,endless\n")
    assert cli("catalog", "from-sheet", "--csv", "list.csv", "--out", "mine").code == 0
    assert st.load_servo(tmp_path / "mine" / "a.toml").potentiometer.fixed_angle == 0.0


@pytest.mark.long
def test_stops_can_be_taken_away_and_the_refusal_says_how(cli):
    fixed = ["--set", "potentiometer.fixed_angle=0", "--constant", "1700", "--unit", "us"]
    assert "stops=none" in cli("simulate", "towerpro-sg90", *fixed).error
    turning = cli("simulate", "towerpro-sg90", *fixed, "--set", "stops=none", "--json")
    assert turning.data["mean_speed"] > 1.0
    words = [w for name in ("lower_angle", "upper_angle", "restitution") for w in ("--set", f"stops.{name}=none")]
    one_by_one = cli("simulate", "towerpro-sg90", *fixed, *words, "--json")
    assert one_by_one.data["mean_speed"] == turning.data["mean_speed"]
    assert "got 'none and 3'" in cli("simulate", "towerpro-sg90", *fixed, "--set", "stops=none", "--set",
                                     "stops.upper_angle=3").error
    assert "unknown parameter 'stop'" in cli("simulate", "towerpro-sg90", *fixed, "--set", "stop=none").error
    assert "needs motor.rotor_inertia" in cli("simulate", "towerpro-sg90", "--step", "0:9", "--set",
                                              "motor.rotor_inertia=none").error
