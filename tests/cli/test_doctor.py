"""`servotwin doctor`."""

import json

import pytest

from servotwin.cli import main


@pytest.mark.long
def test_doctor_names_cause_and_cure(capsys):
    words = ["doctor", "hitec-hs-422", "--set", "electronics.stretcher_gain=2500", "--load", "inertia=1e-3"]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "buzzes: swings" in told
    assert "lower it to" in told
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["findings"][0]["causes"][0]["cause"] == "gain"
    assert "threshold" in found["thresholds"]["sags"]


def test_doctor_finds_nothing_in_a_healthy_servo(capsys):
    assert main(["doctor", "hitec-hs-755hb"]) == 0
    told = capsys.readouterr().out
    assert "nothing found" in told
    assert "no threshold is near" in told
    assert "thermal numbers assumed by the servo's mass" in told
    assert "51 deg C" not in told  # no threshold is near
    assert main(["doctor", "hitec-hs-755hb", "--verbose"]) == 0
    assert "51 deg C" in capsys.readouterr().out


def test_doctor_says_whether_a_board_browns_out(capsys):
    words = ["doctor", "towerpro-sg90", "--supply", "5V:0.2A", "--step=-60:60", "--board", "uno"]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "browns out? Arduino Uno: its 5 V pin needs 2.5 to 2.9 V" in told
    assert "resets: 1.75 V at least, at 0.102 s" in told
    assert "470 uF fall by 8.5 V" in " ".join(told.split())
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["board"]
    assert (found["outcome"], found["log"]) == ("resets", None)
    assert found["cures"][-1]["voltage"] is None
    assert main(["doctor", "towerpro-sg90", "--board", "esp"]) == 2
    assert "unknown board 'esp'; did you mean 'esp32'?" in capsys.readouterr().err


def test_thresholds_are_shown_where_something_comes_near(capsys):
    """A torque that brings it to two thirds of what may be warm, and makes it sag; all stand in the JSON."""
    words = ["doctor", "hitec-hs-422", "--load", "torque=2kgf.cm"]
    assert main(words) == 0
    shown = capsys.readouterr().out.split("thresholds that are near")[1]
    assert "5 % of the way" in shown
    assert "51 deg C" in shown
    assert "10 % of a step" not in shown
    assert main([*words, "--json"]) == 0
    thresholds = json.loads(capsys.readouterr().out)["thresholds"]
    assert [name for name, each in thresholds.items() if each["near"]] == ["sags", "gets warm"]
    assert len(thresholds) == 6
    for each in thresholds.values():
        assert each["near"] is (each["run"]["value"] is not None and each["run"]["value"] > 0.5 * each["run"]["limit"])


def test_how_much_of_a_log_was_looked_at_is_said(cli, tmp_path):
    rows = ["time_s,command_deg,angle_deg"]
    rows += [f"{0.02 * k:.2f},{20 * (k >= 200)},{20 * (k >= 210) + 0.1 * (k % 3):.2f}" for k in range(501)]
    (tmp_path / "log.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    words = ("doctor", "hitec-hs-422", "log.csv")
    whole = cli(*words)
    assert "looked at all 10.0 s of the log: the target rests for half a second or more 2 times" in whole.out
    part = cli(*words, "--duration", "3")
    assert "looked at the first 3.0 of 10.0 s" in part.out.replace("\n", " ")
    assert json.loads(cli(*words, "--json").out)["looked_at"]["stretches"] == 2
    assert cli(*words, "--duration", "61").code == 2


def test_doctor_alone_looks_at_the_installation(capsys):
    assert main(["doctor"]) == 0
    assert "compiler" in capsys.readouterr().out
    assert main(["doctor", "--json"]) == 0
    assert "robots" in json.loads(capsys.readouterr().out)["extras"]


@pytest.mark.parametrize("words", [
    ["no-such.toml"], ["hitec-hs-422", "no-such.csv"], ["hitec-hs-422", "--load", "torque=nan"],
    ["hitec-hs-422", "--duration", "nan"], ["--load", "torque=1"], ["--verbose"],
    ["hitec-hs-422", "--model", "dc-motor"],
])
def test_bad_input_is_one_line(words, capsys):
    assert main(["doctor", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.long
def test_a_log_is_read_as_other_commands_read_it(cli, tmp_path):
    """Without times and commands, torn, and at the end of its travel: on a supply that is said."""
    rows = [f"{min(3 * k, 60)};0.1" for k in range(100)]
    rows[50] = "60;0.1;0"
    (tmp_path / "mine.txt").write_text("\n".join(["angle_deg;current_A", *rows]) + "\n", encoding="utf-8")
    words = ("doctor", "hitec-hs-422", "mine.txt", "--rate", "50Hz", "--commanded", "60deg@0s", "--supply", "usb")
    refused = cli(*words)
    assert refused.code == 2
    assert "--mend torn" in refused.error
    assert cli(*words, "--mend", "torn").code == 0
    assert cli("doctor", "--supply", "usb").code == 2
