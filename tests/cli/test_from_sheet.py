"""`servotwin catalog from-sheet`: figures with units in, a servo file out."""

import json
import math

import pytest

import servotwin as st
from servotwin.identification import Sheet, SheetPoint, servo_file_text, servo_from_sheet

GOOD = ["--name", "mine", "--torque", "13.2 kgf.cm @6V", "--speed", "0.23 s/60deg@6.0", "--running-current",
        "285 mA at 6V"]
IMPOSSIBLE = ["--name", "wonder", "--torque", "2.5 N m", "--speed", "0.11 s/60deg", "--stall-current", "2.1 A",
              "--at", "6V"]
LIST = ("maker,model,V,stall_torque_Nm,speed_s_per_60deg,noload_running_current_A,stall_current_A\n"
        "Acme,S 1,4.8,0.2942,0.19,0.16,0.7\nAcme,S 1,6.0,0.3432,0.15,0.18,0.8\n"
        "Acme,Wonder,8.4,3.3539,0.098,0.34,3.6\nAcme,Unknown,6.0,1.0,,,\n")


@pytest.fixture
def make(cli):
    return lambda *words: cli("catalog", "from-sheet", *words)


@pytest.mark.long
def test_the_table_shows_what_follows_with_its_range(make):
    ended = make(*GOOD)
    assert ended.code == 0
    for text in ("possible  yes", "2.754 to 3.724", "1.023 to 1.123", "armature_resistance", "load_friction_motor",
                 "stall current not given"):
        assert text in ended.out


@pytest.mark.long
def test_a_file_is_written_that_the_function_makes_too(make, cli, tmp_path):
    ended = make(*GOOD, "--voltage-range", "4.8 V to 6 V", "--deadband", "8 us", "--pulse-range",
                 "556-2410 us", "--rate", "45 deg/400us", "--neutral",
                 "1.5 ms", "--mass", "110 g", "--gear-ratio", "280:1", "--backlash", "0.5 deg", "--stops", "230 deg",
                 "--travel", "202 deg", "--idle-current", "8.7 mA@6", "--source", "the box", "--note", "Blue.",
                 "--motor-type", "3-pole", "--modulation", "analog", "--title", "Mine", "--out", "mine.toml")
    assert ended.code == 0
    point = SheetPoint(supply_voltage=6.0, stall_torque=13.2 * 0.0980665, no_load_speed=math.pi / 3 / 0.23,
                       no_load_current=0.285, idle_current=0.0087)
    expected = servo_from_sheet(Sheet(
        name="mine", title="Mine", points=(point,), voltage_min=4.8, voltage_max=6.0, deadband=8e-6, pulse_min=556e-6,
        pulse_max=2410e-6, angle_per_pulse=math.radians(45.0) / 400e-6, neutral_pulse=1.5e-3, mass=0.11,
        gear_reduction=280.0, backlash=math.radians(0.5), stop_travel=math.radians(230.0), travel=math.radians(202.0),
        source="the box", note="Blue.", motor_type="3-pole", modulation="analog"))
    text = (tmp_path / "mine.toml").read_text(encoding="utf-8")
    assert text == servo_file_text(expected)
    found = cli("catalog", "check", "mine.toml", "--json").data
    assert {name for name, model in found["models"].items() if not model["runs"]} == {"digital"}
    assert found["warnings"] == []


@pytest.mark.long
@pytest.mark.parametrize(("words", "kind", "gain"), [
    (["--modulation", "digital"], "digital", 8.0),
    (["--modulation", "bus", "--registers", "dynamixel-mx"], "bus", 16.0 / math.pi)])
def test_a_servo_with_a_program_gets_its_firmware(make, tmp_path, words, kind, gain):
    assert make(*GOOD, *words, "--out", "mine.toml").code == 0
    mine = st.load_servo(tmp_path / "mine.toml")
    assert mine.kind == kind
    assert mine.firmware.proportional_gain == gain
    assert (mine.potentiometer.feedback_gain is None) is (kind == "bus")
    made = make("mine.toml", "--out", "again.toml")
    assert made.code == 0
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "mine.toml").read_text()


@pytest.mark.long(but="0.23 s/60deg-13.2 kg.cm")
@pytest.mark.parametrize("torque", ["1.2945 N m", "1.2945Nm", "1294.5 mN.m", "129.45 N-cm", "13.2 kg.cm", "13.2kgf·cm",
                                    "13.2 kg-cm", "183.3 oz-in", "183.31 ozf.in"])
@pytest.mark.parametrize("speed", ["0.23 s/60deg", "0.23sec/60°", "0.23 s / 60 deg", "43.478 rpm", "260.87 deg/s"])
def test_units_as_people_write_them(make, torque, speed):
    found = make("--name", "mine", "--torque", torque, "--speed", speed, "--running-current", "0.285A", "--at", "6",
                 "--json").data
    assert found["stall_torque"] == pytest.approx(1.2945, rel=1e-3)
    assert found["speed"] == pytest.approx(60.0 / 0.23, rel=1e-3)


@pytest.mark.long(but="figures4")
@pytest.mark.parametrize("figures", [
    ["--at", "6V", "--torque", "1.8 kg/cm", "--speed", "0.11 s/60deg"],
    ["--at", "6V", "--torque", "25 oz/in", "--speed", "0.11s/60"],
    ["--torque", "1.8 kg.cm (6V)", "--speed", "0.11sec/60degree (6v)"],
    ["--torque", "1.8kg/cm @(6 V)", "--speed", "0.11s/60°@6V"],
    ["--torque", "6V: 1.8 Kg/cm", "--speed", "6V: 0.11s/60º"],
    ["--torque", "1.8 kgf/cm [6.0V]", "--speed", "0.11 sec / 60deg (6.0V no load)"],
    ["--torque", "25 oz./in 6V", "--speed", "0.11 seconds per 60 degrees at 6 volts"],
    ["--at", "6", "--torque", "1.8 kg-cm", "--speed", "60°/0.11s"]])
def test_figures_as_shops_print_them(make, figures):
    ended = make("--name", "mine", *figures, "--torque", "1.5 kg/cm @4.8V", "--speed", "0.13s/60 (4.8V)", "--json")
    assert ended.code == 0
    assert ended.data["voltages"] == [4.8, 6.0]
    assert ended.data["stall_torque"] == pytest.approx(1.8e-2 * 9.80665, rel=2e-3)
    assert ended.data["speed"] == pytest.approx(60.0 / 0.11, rel=1e-9)
    assert ended.err.count("warning: read kg/cm as kgf cm") == 1


@pytest.mark.long
def test_json_has_everything_in_si(make, tmp_path):
    found = make(*GOOD, "--out", "mine.toml", "--json").data
    assert found["possible"] is True
    assert found["motor"]["resistance"]["value"] == pytest.approx(3.04, abs=0.01)
    assert found["files"] == ["mine.toml"]
    assert found["contradictions"] == []
    names = {row["name"] for row in found["parameters"]}
    assert names == set(st.load_servo(tmp_path / "mine.toml").names())


@pytest.mark.long
def test_every_printed_figure_is_simulated_and_what_is_off_is_flagged(make):
    words = [*GOOD, "--torque", "7 kgf.cm@4.8V", "--speed", "0.3 s/60deg@4.8V", "--idle-current", "8.7 mA@6",
             "--allow-impossible"]
    found = make(*words, "--json").data
    figures = {(figure["name"], figure["voltage"]): figure for figure in found["figures"]}
    assert set(figures) == {("stall torque", 6.0), ("time for 60 deg", 6.0), ("current without load", 6.0),
                            ("current at rest", 6.0), ("stall torque", 4.8), ("time for 60 deg", 4.8)}
    off = figures["stall torque", 4.8]
    assert off["off"] > 0.15
    flag = f"stall torque at 4.8 V: {off['simulated']:.3g} N m simulated, 0.686 printed"
    assert flag in found["flags"]
    assert flag in " ".join(make(*words).out.split())
    assert found["motion"]["passes"] < 1.4 * 0.23
    low, high = found["motion"]["spans"]["passes"]
    assert low < found["motion"]["passes"] < high


@pytest.mark.long
@pytest.mark.parametrize(("more", "said", "possible"), [
    ([], "not checked, needs a current", None), (["--stall-current", "3 A"], "yes", True),
    (["--torque", "20 kgf.cm@4.8V", "--speed", "0.25 s/60deg@4.8V"], "NO", False)])
def test_a_sheet_without_a_current_is_not_called_possible(make, more, said, possible):
    words = ["--name", "mine", "--at", "6V", "--torque", "15 kg cm", "--speed", "0.2 s/60deg", *more,
             "--allow-impossible"]
    assert f"possible  {said}" in make(*words).out
    assert make(*words, "--json").data["possible"] is possible


def test_plain_leaves_out_what_grows_with_the_load(make, tmp_path):
    make(*GOOD, "--backlash", "1 deg", "--plain", "--out", "mine.toml")
    servo = st.load_servo(tmp_path / "mine.toml")
    assert servo.friction.load_friction_motor is None
    assert servo.gear.backlash is None


@pytest.mark.long
def test_nothing_is_overwritten_without_force(make, tmp_path):
    (tmp_path / "mine.toml").write_text("kept")
    assert "mine.toml exists already; use --force" in make(*GOOD, "--out", "mine.toml").error
    assert (tmp_path / "mine.toml").read_text() == "kept"
    assert make(*GOOD, "--out", "mine.toml", "--force").code == 0
    assert st.load_servo(tmp_path / "mine.toml").name == "mine"


@pytest.mark.long
def test_two_voltages_are_used_together(make):
    one = make(*GOOD, "--json").data["motor"]["resistance"]
    two = make(*GOOD, "--torque", "11 kgf.cm @4.8V", "--speed", "0.28 s/60deg @4.8V", "--running-current",
               "230 mA@4.8V", "--json").data
    assert two["voltages"] == [4.8, 6.0]
    assert two["supply_voltage"] == 6.0
    assert two["motor"]["resistance"]["lower"] < one["lower"]


@pytest.mark.long
def test_an_impossible_sheet_is_explained_and_not_made(make, tmp_path):
    ended = make(*IMPOSSIBLE, "--out", "wonder.toml")
    for word in ("2.5 N m and 0.11 s/60°", "2.1 A", "% or more efficiency", "at most"):
        assert word in ended.error
    assert not (tmp_path / "wonder.toml").exists()
    ended = make(*IMPOSSIBLE, "--allow-impossible", "--out", "wonder.toml")
    assert ended.code == 0
    assert "possible  NO" in ended.out
    servo = st.load_servo(tmp_path / "wonder.toml")
    assert servo.sheet["flags"][0].startswith("impossible")


@pytest.mark.long
def test_the_sheet_of_a_servo_is_taken_again(make, tmp_path):
    ended = make("hitec-hs-645mg", "--out", "again.toml")
    assert ended.code == 0
    assert st.load_servo(tmp_path / "again.toml") == st.load_servo("hitec-hs-645mg")
    make("hitec-hs-645mg", "--name", "other", "--plain", "--out", "plain.toml")
    servo = st.load_servo(tmp_path / "plain.toml")
    assert (servo.name, servo.friction.load_friction_motor) == ("other", None)


@pytest.mark.long
def test_a_list_makes_a_folder_of_servos(make, tmp_path):
    (tmp_path / "list.csv").write_text(LIST)
    ended = make("--csv", "list.csv", "--out", "mine")
    assert ended.code == 0
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["acme-s-1.toml"]
    assert "left out: Acme Unknown: no torque and speed at one voltage" in ended.out
    assert "left out: Acme Wonder: 3.354 N m and 0.098 s/60° from 3.6 A" in ended.out
    assert "exists already" in make("--csv", "list.csv", "--out", "mine").error
    found = make("--csv", "list.csv", "--out", "mine", "--allow-impossible", "--force", "--json").data
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == ["acme-s-1.toml", "acme-wonder.toml"]
    assert [row["possible"] for row in found["servos"]] == [True, False]
    assert len(found["left_out"]) == 1


@pytest.mark.long(but="words18-stall torque at 6 V")
@pytest.mark.parametrize(("words", "said"), [
    ([], "--name is missing"), (["--name", "mine"], "no figures of a sheet are given"),
    ([*GOOD[:4]], "torque without speed"), (["--name", "mine", *GOOD[4:6]], "speed without torque"),
    (["--name", "mine", "--torque", "1 N m@4.8V", "--speed", "0.2 s/60deg@6V"], "different voltages"),
    (["--name", "mine", "--torque", "1 N m", "--speed", "0.2 s/60deg@6V"], "also the supply voltage"),
    (["--name", "mine", "--torque", "1 N m@6V", "--torque", "2 N m@6V"], "--torque at 6 V: got 'two, 1 and 2 in SI'"),
    (["--name", "mine", "--torque", "1@6V"], "--torque: got '1', allowed: a positive number with one of the units N m"),
    (["--name", "mine", "--torque", "1 V@6V"], "--torque: got '1 V'"),
    (["--name", "mine", "--torque", "nan N m@6V"], "--torque: got 'nan N m'"),
    (["--name", "mine", "--torque", "-1 N m@6V"], "--torque: got '-1 N m'"),
    (["--name", "mine", "--torque", "1,29 N m@6V"], "--torque: got '1,29 N m'"),
    (["--name", "mine", "--torque", "1e999 N m@6V"], "--torque: got '1e999 N m'"),
    (["--name", "mine", "--torque", "1 N m@6A"], "--torque: got '6A'"),
    (["--name", "mine", "--torque", "1 N m@0"], "--torque: got '0'"),
    (["--name", "mine", "--torque", "1 N m@"], "--torque"), (["--name", "mine", "--torque", ""], "--torque"),
    (["--name", "mine", "--speed", "0.2 s@6V"], "--speed: got '0.2 s', allowed: 0.23 s/60deg"),
    (["--name", "mine", "--torque", "1290 N m@6V", "--speed", "0.2 s/60deg@6V"], "stall torque at 6 V"),
    ([*GOOD, "--stall-current", "200 mA@6V"], "stall current at 6 V: got 0.2, allowed: more than the no-load"),
    ([*GOOD, "--deadband", "8"], "--deadband: got '8'"), ([*GOOD, "--deadband", "8 ms"], "deadband: got 0.008"),
    ([*GOOD, "--voltage-range", "5 V"], "--voltage-range: got '5 V', allowed: two voltages with a unit"),
    ([*GOOD, "--voltage-range", "7.2-4.8 V"], "voltage range: got '7.2 to 4.8 V'"),
    ([*GOOD, "--pulse-range", "500 us"], "--pulse-range"), ([*GOOD, "--pulse-range", "2500-500 us"], "pulse range"),
    ([*GOOD, "--rate", "0.1 deg"], "--rate"), ([*GOOD, "--gear-ratio", "many"], "--gear-ratio"),
    ([*GOOD, "--modulation", "fm"], "modulation: got 'fm'"),
    ([*GOOD, "--modulation", "bus", "--registers", "dynamixel-y"], "did you mean 'dynamixel-x'"),
    ([*GOOD, "--modulation", "bus"], "registers of a bus servo: got 'nothing', allowed: feetech-sts, dynamixel-x"),
    ([*GOOD, "--modulation", "bus", "--registers", "lx-16a"], "(LX-16A, SCS, HTS) no table says what its registers do"),
    ([*GOOD, "--registers", "dynamixel-x"], "registers: got 'dynamixel-x'"),
    ([*GOOD, "--name", "my servo"], "name of a servo"),
    ([*GOOD, "--mass", "110"], "--mass: got '110'"), ([*GOOD, "--at", "six"], "--at: got 'six'"),
    ([*GOOD, "--csv", "list.csv"], "--csv holds the sheet already"),
    (["hitec-hs-311", "--torque", "1 N m@6V"], "SERVO holds the sheet already"),
    (["hitec-hs-311", "--csv", "list.csv"], "--csv holds the sheet already"),
    (["none.toml"], "none.toml: no such file"), (["--csv", "none.csv"], "none.csv: no such file"),
    ([*GOOD, "--out", "none/mine.toml"], "cannot be written"), ([*GOOD, "--out", "."], "."),
])
def test_bad_words_end_in_one_line(make, tmp_path, words, said):
    (tmp_path / "list.csv").write_text(LIST)
    assert said in make(*words).error
    failed = make(*words, "--json")
    assert failed.code == 2
    assert said in json.loads(failed.out)["error"]["message"]
    assert [path.name for path in tmp_path.iterdir()] == ["list.csv"]


@pytest.mark.long
def test_the_list_of_the_catalog_shows_the_flags(cli):
    lines = {line.split()[0]: line for line in cli("catalog", "list").out.splitlines()}
    assert "impossible" in lines["feetech-ft-7235"]
    assert "currents unknown" in lines["futaba-s3004"]
    assert "impossible" not in lines["hitec-hs-645mg"]
    found = {servo["id"]: servo["flags"] for servo in cli("catalog", "list", "--json").data}
    assert found["feetech-ft-7235"][0] == "impossible: efficiency 1.45 at 8.4 V"
    shown = cli("catalog", "show", "feetech-ft-7235").out
    assert "flags: impossible: efficiency 1.45 at 8.4 V" in shown
    assert "With this current and speed the torque is at most 2.3 N m" in " ".join(shown.split())
