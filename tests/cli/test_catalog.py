"""`servotwin catalog` tells what the servo files hold."""

import pytest

import servotwin as st
from servotwin.models import MODELS

SERVO = "hitec-hs-755hb"
OF_PULSES = {"averaged", "averaged-inductive", "bounded", "pulse", "pulse-inductive"}
ALONE = {"miuzei-25kg": {"digital"}}  # fitted to logs as one, without a sheet: no other model has numbers
MISSING = {"analog": {"digital"}, "digital": set(), "bus": OF_PULSES}  # models that a kind of servo has no numbers for


@pytest.mark.long
def test_list_has_every_servo(cli):
    ended = cli("catalog", "list")
    rows = [line for line in ended.out.splitlines() if not line.startswith(" ")]
    assert [line.split()[0] for line in rows] == ["id", *st.catalog_names()]
    found = {servo["id"]: servo for servo in cli("catalog", "list", "--json").data}
    assert set(found) == set(st.catalog_names())
    assert found[SERVO]["stall_torque"] == pytest.approx(1.2945, abs=1e-3)
    assert found[SERVO]["speed"] == pytest.approx(60.0 / 0.23, rel=1e-9)


def test_show_has_every_parameter(cli):
    servo = st.load_servo(SERVO)
    found = cli("catalog", "show", SERVO, "--json").data["parameters"]
    assert [row["name"] for row in found] == list(servo.names())
    for row in found:
        q = servo.source(row["name"])
        assert (row["unit"], row["origin"], row["source"], row["spread"]) == (q.unit, q.origin, q.source, q.spread)
        assert row["value"] == q.value
    text = cli("catalog", "show", SERVO).out
    for name in servo.names():
        assert name.partition(".")[2] in text
    assert "2.754" in text
    assert "Table II" in text


def test_show_takes_a_file_and_a_table_of_numbers(cli, tmp_path):
    values = {"potentiometer": {"linearity_angle": (0.0, 1.0), "linearity_error": (0.0, 0.01)}}
    st.servo_from_values("mine", values).save(tmp_path / "mine.toml")
    assert "0, 0.01" in cli("catalog", "show", "mine.toml").out
    assert cli("catalog", "show", "mine.toml", "--json").data["parameters"][1]["value"] == [0.0, 0.01]


@pytest.mark.long(but="emax-es08ma")
@pytest.mark.parametrize("name", st.catalog_names())
def test_check_finds_the_catalog_ready_for_every_model_of_its_kind(cli, tmp_path, name):
    st.load_servo(name).save(tmp_path / "copy.toml")
    ended = cli("catalog", "check", "copy.toml", "--json")
    assert ended.code == 0
    runs = {model for model, found in ended.data["models"].items() if found["runs"]}
    assert runs == ALONE.get(name, set(MODELS) - MISSING[st.load_servo(name).kind])
    assert ended.data["warnings"] == []


def test_check_says_what_is_lacking(cli, tmp_path):
    servo = st.load_servo(SERVO)
    values = {}
    for name in servo.names():
        group, _, key = name.partition(".")
        if name not in ("motor.armature_inductance", "electronics.one_shot_slope",
                        "electronics.pulse_to_voltage_gain"):
            values.setdefault(group, {})[key] = servo.get(name)
    st.servo_from_values("mine", values).save(tmp_path / "mine.toml")
    models = cli("catalog", "check", "mine.toml", "--json").data["models"]
    assert models["dc-motor"]["lacks"] == ["motor.armature_inductance"]
    assert "electronics.pulse_to_voltage_gain" in models["averaged"]["lacks"]
    assert "electronics.one_shot_slope" in models["bounded"]["lacks"][0]
    text = cli("catalog", "check", "mine.toml").out
    assert "cannot run: lacks motor.armature_inductance" in text


@pytest.mark.long
def test_check_warns_of_calibrations_that_disagree(cli, tmp_path):
    servo = st.load_servo(SERVO)
    slope = servo.get("electronics.one_shot_slope")
    servo.replace({"electronics.one_shot_slope": 1.2 * slope}).save(tmp_path / "mine.toml")
    ended = cli("catalog", "check", "mine.toml", "--json")
    assert len(ended.data["warnings"]) == 1
    assert "each is used for its own kind of command" in ended.data["warnings"][0]
    assert "warning: " in cli("catalog", "check", "mine.toml").out
    run = cli("simulate", "mine.toml", "--step", "0:90", "--model", "bounded")
    assert run.code == 0
    assert run.err.startswith("servotwin: warning: ")
    assert run.err.count("\n") == 1


@pytest.mark.long(but="words0-did you mean 'hitec-hs-755hb', ")
@pytest.mark.parametrize(("words", "said"), [
    (["show", "hitec-hs-755"], "did you mean 'hitec-hs-755hb', "),
    (["check", "none.toml"], "none.toml: no such file"),
    (["check", "broken.toml"], "broken.toml: is not valid TOML"),
    (["check", "."], "folder"),
    (["check", "binary.toml"], "is not UTF-8 text"),
    (["check", "group.toml"], "engine"),
])
def test_bad_files(cli, tmp_path, words, said):
    (tmp_path / "broken.toml").write_text("name = \n")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "group.toml").write_text('name = "x"\n[engine]\n')
    ended = cli("catalog", *words)
    assert said in ended.error
    failed = cli("catalog", *words, "--json")
    assert failed.data["error"]["message"] == ended.error


def test_a_sheet_may_hold_anything(cli, tmp_path):
    (tmp_path / "mine.toml").write_text(
        'name = "x"\n[sheet]\nstall_torque = 3\nsupply_voltage = {value = "six", unit = "V"}\n'
        'speed_per_60deg = {value = 0.2, unit = "parsec"}\n')
    found = cli("catalog", "show", "mine.toml", "--json").data
    assert (found["stall_torque"], found["supply_voltage"], found["speed"]) == (None, None, None)
    assert found["parameters"] == []


def test_the_twins_torque_stands_beside_the_sheets(cli):
    found = {servo["id"]: servo for servo in cli("catalog", "list", "--json").data}
    # K_out (V - V_d)/R - tau_c by hand for the HS-755HB, whose file has no load friction; DF05BB follows its sheet
    assert found[SERVO]["twin_stall_torque"] == pytest.approx(1.04 * (6.0 - 0.4) / 3.041 - 0.2634, rel=2e-3)
    other = found["dfrobot-df05bb"]
    assert other["twin_stall_torque"] == pytest.approx(other["stall_torque"], rel=2e-3)
    page = cli("catalog", "show", SERVO).out
    assert "stall torque at 6 V: 1.29 N m by the sheet, 1.65 N m by these parameters" in page


def test_a_servo_without_motor_has_no_torque(cli, tmp_path):
    (tmp_path / "mine.toml").write_text('name = "x"\n')
    assert cli("catalog", "show", "mine.toml", "--json").data["twin_stall_torque"] is None
    assert "stall torque" not in cli("catalog", "show", "mine.toml").out


@pytest.mark.long
def test_a_wrong_unit_in_a_file_or_an_option_is_warned_of(cli, tmp_path):
    text = ('name = "mine"\n[electronics]\ndeadband = { value = 8, unit = "s", origin = "assumed" }\n')
    (tmp_path / "mine.toml").write_text(text)
    ended = cli("catalog", "check", "mine.toml")
    assert ended.code == 0
    said = "electronics.deadband of 8 s is not plausible (1e-07 to 0.0005 s): 8 us?"
    assert f"warning: mine: {said}" in " ".join(ended.out.split())
    assert cli("catalog", "check", "mine.toml", "--json").data["warnings"] == [f"mine: {said}"]
    for words in (("simulate", "hitec-hs-755hb", "--step", "0:10"), ("curves", "hitec-hs-755hb", "--quick")):
        ended = cli(*words, "--set", "gear.backlash=0.3", "--set", "gear.output_inertia=2e-6")
        assert ended.code == 0
        assert "gear.backlash of 0.3 rad is not plausible (0 to 0.2 rad): 0.3 deg?" in ended.err
        assert ended.err.count("plausible") == 1
