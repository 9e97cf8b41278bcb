"""Whatever is wrong becomes one line and exit code 2, and nothing is written."""

import json

import pytest

STEP = ["--step", "0:90"]
SERVO_FILES = {
    "broken.toml": 'name = "x"\n[motor\n',
    "unit.toml": 'name = "x"\n[motor]\narmature_resistance = {value = 3, unit = "V", origin = "assumed"}\n',
    "negative.toml": 'name = "x"\n[motor]\narmature_resistance = {value = -3, unit = "ohm", origin = "assumed"}\n',
    "reduction.toml": 'name = "x"\n[gear]\ngear_reduction = {value = 0.5, unit = "1", origin = "assumed"}\n',
    "nan.toml": 'name = "x"\n[motor]\narmature_resistance = {value = nan, unit = "ohm", origin = "assumed"}\n',
    "bare.toml": 'name = "x"\n',
}
COMMAND_FILES = {
    "empty.csv": b"",
    "header.csv": b"time_s,pulse_width_us\n",
    "unsorted.csv": b"time_s,pulse_width_us\n0,1500\n0.5,1600\n0.3,1700\n",
    "return.csv": b"time_s,pulse_width_us\n0,15\r00\n0.5,1600\n",
    "nul.csv": b"time_s,pulse_width_us\n0,15\x0000\n",
    "binary.csv": bytes(range(256)) * 8,
    "column.csv": b"time_s,something\n0,1500\n",
    "no-time.csv": b"pulse_width_us\n1500\n",
    "nan.csv": b"time_s,pulse_width_us\n0,nan\n",
    "word.csv": b"time_s,pulse_width_us\n0,much\n",
    "short.csv": b"time_s,pulse_width_us\n0\n",
    "zero.csv": b"time_s,pulse_width_us\n0,0\n0.5,1500\n",
    "negative.csv": b"time_s,pulse_width_us\n0,1500\n0.5,-1\n",
}


def nothing_new(folder, before):
    return sorted(path.name for path in folder.iterdir()) == sorted(before)


@pytest.mark.parametrize(("words", "said"), [
    (["hitec-hs-755", *STEP], "did you mean 'hitec-hs-755hb', "),
    (["none.toml", *STEP], "none.toml: no such file"),
    ([".", *STEP], "unknown servo '.'"),
    (["./", *STEP], "folder"),
    (["broken.toml", *STEP], "broken.toml: is not valid TOML"),
    (["unit.toml", *STEP], "got 'V', allowed: ohm"),
    (["negative.toml", *STEP], "got -3.0, allowed: a positive number [ohm]"),
    (["reduction.toml", *STEP], "got 0.5, allowed: a number of at least 1"),
    (["nan.toml", *STEP], "got nan"),
    (["bare.toml", *STEP], "PulseServo needs motor.armature_resistance"),
])
def test_servos(cli, tmp_path, words, said):
    for name, text in SERVO_FILES.items():
        (tmp_path / name).write_text(text)
    assert said in cli("simulate", *words, "--out", "run.csv").error
    assert nothing_new(tmp_path, SERVO_FILES)


@pytest.mark.long(but="words17---ramp needs --over")
@pytest.mark.parametrize(("words", "said"), [
    ([], "no command is given; use one of --step, --ramp"),
    (["--step", "0:1", "--ramp", "0:1", "--over", "1"], "commands contradict: got '--step, --ramp'"),
    (["--step", "0:1", "--constant", "1", "--command", "x.csv"], "--step, --constant, --command"),
    (["--step", "0:300"], "angle command: got '300 deg', allowed: -15 to 195 deg"),
    (["--sine", "90:200:1"], "angle command: got '-110 deg'"),
    (["--step", "0:nan"], "step(after): got nan"),
    (["--step", "inf:0"], "step(before): got inf"),
    (["--step", "0"], "--step: got '0', allowed: BEFORE:AFTER"),
    (["--step", "0us:90us"], "numbers alone; --unit says the unit"),
    (["--step", "0:1:2"], "--step: got '0:1:2'"),
    (["--step", "a:b"], "--step: got 'a:b'"),
    (["--step", ""], "--step: got ''"),
    (["--step", "0:1", "--at", "nan"], "step(at): got nan"),
    (["--step", "0:1", "--at", "-1"], "--at: got -1, allowed: 0 s or later"),
    (["--step", "0:1", "--over", "1"], "--over goes with --ramp, not with --step"),
    (["--step", "0:1", "--hold", "linear"], "--hold goes with --command, not with --step"),
    (["--constant", "0", "--at", "1"], "--at goes with --step, --ramp, not with --constant"),
    (["--ramp", "0:1"], "--ramp needs --over"),
    (["--ramp", "0:1", "--over", "0"], "ramp(over): got 0.0"),
    (["--sine", "90:1"], "--sine: got '90:1', allowed: MEAN:AMPLITUDE:HZ"),
    (["--sine", "90:1:-2"], "sine(frequency): got -2.0"),
    (["--chirp", "90:1:0:5"], "chirp(start_frequency): got 0.0"),
    (["--prbs", "0:90:0"], "prbs(bit_time): got 0.0"),
    (["--prbs", "0:90:1e-12"], "at most 10 000 000 bits"),
    (["--constant", "0", "--unit", "us"], "pulse width: got 0.0, allowed: a positive width"),
    (["--constant", "-1500", "--unit", "us"], "a positive width"),
    (["--constant", "1", "--unit", "N"], "got 'N', allowed: deg, rad, us, ms, s, V"),
    (["--step", "0:1", "--model", "dc-motor"], "command of DCMotor: got 'unit deg'"),
    (["--constant", "1500", "--unit", "us", "--model", "geared-motor"], "got 'unit us', allowed: V"),
    (["--step", "0:1", "--model", "bound"], "unknown model 'bound'; did you mean 'bounded'?"),
])
def test_commands(simulate, tmp_path, words, said):
    assert said in simulate(*words, "--out", "run.csv").error
    assert nothing_new(tmp_path, [])


@pytest.mark.long(but="short.csv---pulses")
@pytest.mark.parametrize("option", ["--command", "--pulses"])
@pytest.mark.parametrize("name", COMMAND_FILES)
def test_command_files(simulate, tmp_path, option, name):
    (tmp_path / name).write_bytes(COMMAND_FILES[name])
    assert simulate(option, name, "--out", "run.csv").error.startswith(f"{name}: ")
    assert nothing_new(tmp_path, [name])


@pytest.mark.long
def test_files_that_are_none(simulate, tmp_path):
    for option in ("--command", "--pulses"):
        assert simulate(option, "none.csv").error == "none.csv: no such file"
        assert "directory" in simulate(option, tmp_path).error
        assert f"--unit goes with --step, --ramp, --sine, --chirp, --prbs, --constant, not with {option}" == simulate(
            option, "none.csv", "--unit", "V").error


def test_pulses_do_not_overlap(simulate, tmp_path):
    (tmp_path / "pulses.csv").write_text("time_s,pulse_width_us\n0,1500\n0.001,1500\n")
    assert "a pulse that ends before the next" in simulate("--pulses", "pulses.csv").error


@pytest.mark.long(but="pendulum=-1:1-got -1.0")
@pytest.mark.parametrize(("load", "said"), [
    ("inertia=-1", "--load inertia: Inertia(inertia): got -1.0, allowed: a number of at least 0"),
    ("inertia=nan", "got 'nan'"),
    ("inertia=a", "--load inertia: got 'a', allowed: a number"),
    ("inertia=1,5", "--load inertia: got '1,5', allowed: a number"),
    ("inertia", "--load: got 'inertia', allowed: inertia="),
    ("", "--load: got ''"),
    ("inertia=", "--load: got 'inertia='"),
    ("foo=1", "unknown part of --load 'foo'"),
    ("inertia=1,foo=1", "unknown part of --load 'foo'"),
    ("viscous=-1", "got -1.0"),
    ("coulomb=-1", "got -1.0"),
    ("torque=inf", "got 'inf'"),
    ("pendulum=1", "--load pendulum: got '1', allowed: KG:M"),
    ("pendulum=-1:1", "got -1.0"),
    ("spring=-1", "got -1.0"),
    ("recorded=none.csv", "none.csv: no such file"),
    ("recorded=torque.csv", "got 'a run from 0 to 1.5 s', allowed: times from 0 to 1 s"),
    ("recorded=twice.csv", "times that do not increase"),
    ("recorded=nan.csv", "not finite"),
    ("recorded=column.csv", "one of torque_Nm"),
])
def test_loads(simulate, tmp_path, load, said):
    files = {"torque.csv": "time_s,torque_Nm\n0,0\n1,0.1\n", "twice.csv": "time_s,torque_Nm\n0,0\n0,0.1\n",
             "nan.csv": "time_s,torque_Nm\n0,0\n1,nan\n", "column.csv": "time_s,x\n0,0\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert said in simulate(*STEP, "--load", load, "--out", "run.csv").error
    assert nothing_new(tmp_path, files)


@pytest.mark.long(but="electronics.off_state=stop-allowed: brake or coast")
@pytest.mark.parametrize(("change", "said"), [
    ("motor.x=1", "unknown parameter 'motor.x'"),
    ("motor.armature_resistence=1", "did you mean 'motor.armature_resistance'?"),
    ("motor.armature_resistance=nan", "--set motor.armature_resistance: got 'nan', allowed: a number in SI"),
    ("motor.armature_resistance=-1", "got -1.0"),
    ("motor.armature_resistance=a", "got 'a'"),
    ("motor.armature_resistance=1,2", "got (1.0, 2.0)"),
    ("motor.armature_resistance", "--set: got 'motor.armature_resistance', allowed: GROUP.NAME=VALUE"),
    ("=1", "--set: got '=1'"),
    ("gear.gear_reduction=0.5", "a number of at least 1"),
    ("electronics.off_state=stop", "allowed: brake or coast"),
    ("stops.lower_angle=9", "stops.lower_angle: got 9.0"),
])
def test_changed_parameters(simulate, tmp_path, change, said):
    assert said in simulate(*STEP, "--set", change, "--out", "run.csv").error
    assert nothing_new(tmp_path, [])


def test_a_parameter_is_set_once(simulate):
    words = ["--set", "motor.armature_resistance=3", "--set", "motor.armature_resistance=4"]
    assert "one value" in simulate(*STEP, *words).error


@pytest.mark.parametrize(("words", "said"), [
    (["--duration", "0"], "--duration: got 0.0"),
    (["--duration", "-1"], "--duration: got -1.0"),
    (["--duration", "nan"], "--duration: got nan"),
    (["--duration", "inf"], "--duration: got inf"),
    (["--duration", "long"], "'--duration'"),
    (["--duration", "1e9"], "at most 1e+06 frames of 20 ms"),
    (["--model", "bounded", "--duration", "1e9"], "take a larger output_step"),
    (["--model", "bounded", "--duration", "1e300", "--output-step", "1e-300"], "take a larger output_step"),
    (["--output-step", "0"], "--output-step: got 0.0"),
    (["--output-step", "-1"], "--output-step: got -1.0"),
    (["--output-step", "nan"], "--output-step: got nan"),
    (["--output-step", "1e-12"], "take a larger output_step"),
])
def test_times(simulate, tmp_path, words, said):
    assert said in simulate(*STEP, *words, "--out", "run.csv").error
    assert nothing_new(tmp_path, [])


@pytest.mark.parametrize(("words", "said"), [
    (["simulat"], "simulat"),
    (["simulate"], "Missing argument"),
    (["simulate", "hitec-hs-755hb", "more", *STEP], "unexpected extra argument"),
    (["simulate", "hitec-hs-755hb", "--step"], "'--step' requires an argument"),
    (["simulate", "hitec-hs-755hb", "--stp", "0:1"], "--stp"),
    (["--unknown"], "--unknown"),
    (["catalog", "find"], "find"),
    (["catalog", "show"], "Missing argument"),
    (["catalog", "list", "more"], "unexpected extra argument"),
])
def test_usage(cli, words, said):
    assert said in cli(*words).error


@pytest.mark.long
def test_json_tells_errors_as_json_too(simulate, cli):
    ended = simulate("--step", "0:nan", "--json")
    assert ended.error == ended.data["error"]["message"]
    assert ended.data["error"] == {
        "type": "CommandError", "message": ended.error, "what": "step(after)", "got": "nan",
        "allowed": "a finite number [deg]"}
    usage = cli("simulate", "--json")
    assert json.loads(usage.out)["error"]["type"] == "UsageError"
    assert usage.error == usage.data["error"]["message"]


def test_a_report_needs_a_folder_with_a_name(cli):
    assert "--out" in cli("paper", "--out", "").error


@pytest.mark.parametrize(("change", "said"), [
    ("supply.open_circuit_voltage=5ohm", "got '5ohm', allowed: a number in SI, or with one of the units V, mV"),
    ("electronics.deadband=8 us us", "got '8 us us'"),
    ("electronics.deadband=nan", "got 'nan'"),
    ("motor.armature_resistance=-3ohm", "got -3.0, allowed: a positive number [ohm]"),
    ("supply.voltage=5V", "unknown parameter 'supply.voltage'; did you mean 'supply.open_circuit_voltage'?"),
    ("voltage=5V", "did you mean 'supply.open_circuit_voltage', "),
    ("gear.ratio=200", "did you mean 'gear.gear_reduction'?"),
])
def test_units_and_names_of_set(simulate, change, said):
    assert said in simulate(*STEP, "--set", change).error


@pytest.mark.parametrize(("name", "first", "count"), [
    ("hs755", "hitec-hs-755", 5), ("mg996", "towerpro-mg996r", 5), ("sg90", "towerpro-sg90", 5),
    ("HS-755HB", "hitec-hs-755hb", 5), ("futaba", "futaba-s", 5), ("zzz", None, 0)])
def test_an_unknown_servo_gets_suggestions(cli, name, first, count):
    error = cli("catalog", "show", name).error
    assert error.count("', '") + error.count("' or '") == max(count - 1, 0)
    assert first is None or f"did you mean '{first}" in error
    assert error.endswith("allowed: an id that `servotwin catalog list` shows, or a servo file")
