"""Files and folders of logs in any format, and the Miuzei data as an example of an importer."""

import json
import math
import sys
from types import ModuleType

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

import servotwin as st
from servotwin.errors import InputError
from servotwin.logs import LOG_FORMATS, Log, LogFormat, read_logs, read_miuzei_logs

CSV = "time_s,pulse_width_us,output_angle_deg\n0,1500,0\n0.02,1600,9\n0.04,1600,18\n"
BAM = {"mass": 0.5, "length": 0.1, "kp": 100, "vin": 7.4, "motor": "xl330", "trajectory": "lift", "entries": [
    {"timestamp": 0.005 * k, "position": 0.1 * k, "goal_position": 0.5, "torque_enable": True} for k in range(4)]}
RUN = {"type": "drop", "index": 7, "actions": [None, -0.75, 0.3, None, 0.9], "sensor_data": [0.0, 0.1, None, 0.2, 0.5]}
MIUZEI = {"dataset": "real", "config": {"action_hz": 50}, "data": [RUN, {**RUN, "index": 12, "type": "step"}]}
SIDECAR = {"format": "servotwin-log-1", "motion": "step"}


def write(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else (
        content if isinstance(content, str) else json.dumps(content)).encode())
    return path


def refused(path, *words, **options):
    with pytest.raises(InputError) as caught:
        read_logs(path, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text


# ---------------------------------------------------------------------------------------- files and folders

@pytest.mark.parametrize(("content", "format", "names"), [
    (CSV, "csv", ["run"]), (BAM, "bam", ["run"]), (MIUZEI, "miuzei", ["007 drop", "012 step"]),
    (json.dumps(BAM, indent=2).join(["\ufeff \n", "\n"]), "bam", ["run"]),
])
@pytest.mark.parametrize("ending", [".csv", ".json", ".txt"])
def test_a_format_is_told_by_the_content(tmp_path, content, format, names, ending):
    path = write(tmp_path, f"run{ending}", content)
    auto, told = read_logs(path), read_logs(path, format)
    assert [log.name for log in auto] == [log.name for log in told] == names
    assert all(log.source == str(path) for log in auto)


def test_a_module_and_a_line_of_the_table_make_a_format_known(tmp_path, monkeypatch):
    mine = ModuleType("servotwin.logs.mine")
    mine.recognises = lambda content: isinstance(content, dict) and "mine" in content
    mine.logs_of = lambda path, content: [
        Log(name=content["mine"], time=[0.0, 0.1, 0.2], command=[0.0015] * 3, command_kind="pulse_width",
            measured={"output_angle": [0.0] * 3}, source=str(path))]
    path = write(tmp_path, "run.json", {"mine": "first"})
    refused(path, "one of the formats bam, miuzei")
    monkeypatch.setitem(sys.modules, mine.__name__, mine)
    monkeypatch.setitem(LOG_FORMATS, "mine", LogFormat("my logs", "json", "mine"))
    assert [log.name for log in read_logs(path)] == ["first"]
    write(tmp_path, "other.csv", CSV)
    assert [log.name for log in read_logs(tmp_path)] == ["other", "first"]


def test_a_folder_is_read_in_the_order_of_its_names(tmp_path):
    for name, content in {
        "b.csv": CSV, "a.json": BAM, "c.CSV": CSV, "d.json": MIUZEI, "b.json": SIDECAR, "logs.json": SIDECAR,
        "params.json": {"kt": 1.0, "model": "m1"}, "lone.json": SIDECAR, "notes.txt": "x", ".hidden.csv": "x",
    }.items():
        write(tmp_path, name, content)
    (tmp_path / "folder.csv").mkdir()
    assert [log.name for log in read_logs(tmp_path)] == ["a", "b", "c", "007 drop", "012 step"]
    assert [log.name for log in read_logs(tmp_path, "csv")] == ["b", "c"]
    refused(tmp_path, "d.json", "entries", format="bam")


def test_folders_without_logs_and_names_that_come_twice(tmp_path):
    refused(tmp_path, "a folder without logs", "*.csv", "bam, miuzei")
    write(tmp_path, "params.json", {"kt": 1.0})
    refused(tmp_path, "a folder without logs")
    write(tmp_path, "a.csv", CSV)
    write(tmp_path, "b.csv", CSV)
    write(tmp_path, "logs.json", {**SIDECAR, "name": "same"})
    refused(tmp_path, "same in a.csv and in b.csv")
    write(tmp_path, "logs.json", {"motion": "step"})
    refused(tmp_path, "logs.json", "format")


@pytest.mark.parametrize(("name", "content", "options", "words"), [
    ("run.json", SIDECAR, {}, ("a sidecar", "the CSV file")), ("run.json", {"kt": 1.0}, {}, ("no known log", "bam")),
    ("run.json", "[1, 2]", {}, ("no known log",)), ("run.json", "{", {}, ("line 1 is not valid JSON",)),
    ("run.json", b"", {}, ("empty file",)), ("run.csv", CSV, {"format": "bam"}, ("not valid JSON",)),
    ("run.csv", CSV, {"format": "matlab"}, ("format of logs", "auto, csv, bam, miuzei")),
    ("run.json", MIUZEI, {"format": "bam"}, ("entries",)), ("run.json", BAM, {"format": "miuzei"}, ("data",)),
])
def test_what_is_no_log_is_said_in_one_line(tmp_path, name, content, options, words):
    refused(write(tmp_path, name, content), *words, **options)


@pytest.mark.parametrize("name", ["missing", "missing.csv", "missing.json", "n" * 300, "nul\0", "run.csv/below"])
def test_places_that_are_no_files(tmp_path, name):
    write(tmp_path, "run.csv", CSV)
    refused(tmp_path / name)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some.binary(max_size=60) | some.text(alphabet='{}[]":,0123456789.eE-naNtruefls \n', max_size=60).map(str.encode),
       some.sampled_from(["auto", "csv", "bam", "miuzei"]))
def test_random_files_are_refused(tmp_path, content, format):
    refused(write(tmp_path, "run.json", content), format=format)


# ---------------------------------------------------------------------------------------- the Miuzei data

def test_a_run_of_the_miuzei_data(tmp_path):
    log = read_miuzei_logs(write(tmp_path, "runs.json", MIUZEI))[0]
    assert (log.motion, log.command_kind, dict(log.conditions)) == ("drop", "pulse_width", {"amplitude_deg": 162.0})
    np.testing.assert_allclose(log.time[5:], [0.0, 0.02, 0.04, 0.06, 0.08], rtol=1e-15)
    np.testing.assert_allclose(log.command[5:], [np.nan, 0.5e-3, 1.9e-3, np.nan, 2.5e-3], rtol=1e-15)
    assert log.sent[5:].tolist() == [False, True, True, False, True]
    np.testing.assert_allclose(log.measured["output_angle"][5:], np.array([0.0, 0.1, np.nan, 0.2, 0.5]) * math.pi)
    np.testing.assert_allclose(log.signal().edges, [*(0.01 * np.arange(10)), 0.12, 0.13, 0.14, 0.15, 0.18], rtol=1e-12)


def test_a_run_of_the_miuzei_data_begins_with_the_command_that_it_leaves(tmp_path):
    log = read_miuzei_logs(write(tmp_path, "runs.json", MIUZEI))[0]
    np.testing.assert_allclose(log.time[:5], [-0.1, -0.08, -0.06, -0.04, -0.02], rtol=1e-12)
    np.testing.assert_allclose(log.command[:5], 1.5e-3, rtol=1e-15)
    assert log.sent[:5].all()
    assert not log.used("output_angle")[:5].any()


def test_the_arm_of_the_rig(tmp_path):
    load = read_miuzei_logs(write(tmp_path, "runs.json", MIUZEI))[0].load
    assert load.total_inertia == pytest.approx(1.06e-2, rel=1e-12)
    # all of it at 0, where the arm is horizontal, and towards negative angles; none where it hangs
    np.testing.assert_allclose(load.external_torque(np.zeros(3), np.radians([0.0, -90.0, 90.0])),
                               [0.587, 0.0, 0.0], rtol=1e-12, atol=1e-12)
    servo = st.load_servo("hitec-hs-755hb")
    model = st.PulseServo(servo.replace({"stops.lower_angle": None, "stops.upper_angle": None}))
    silent = st.signals.pulse_train([9.0], [1500.0])
    fallen = st.simulate(model, silent, duration=8.0, load=load, initial={"output_angle": 0.0, "output_speed": 0.0})
    assert -1.8 < fallen["output_angle"][-1] < -1.0  # it hangs, but for friction


@pytest.mark.parametrize(("content", "words"), [
    ([1], ("list", "data")), ({"data": 3}, ("data",)), ({"data": [3]}, ("run 0", "3")),
    ({"data": [{**RUN, "type": None}]}, ("run 0, type",)), ({"data": [{**RUN, "index": "a"}]}, ("run 0, index",)),
    ({"data": [RUN, {**RUN, "actions": 1}]}, ("run 1, actions",)),
    ({"data": [{**RUN, "sensor_data": ["x"]}]}, ("run 0, sensor_data", "'x'")),
    ({"data": [{**RUN, "sensor_data": [0.0]}]}, ("output_angle", "6 values", "10, as many")),
    ({"data": [{**RUN, "sensor_data": [90.0] * 5}]}, ("282.743 rad", "degrees or counts?")),
    ({"data": [RUN, RUN]}, ("007 drop in runs.json", "a name for each")),
])
def test_what_is_wrong_in_the_miuzei_data_is_said_in_one_line(tmp_path, content, words):
    refused(write(tmp_path, "runs.json", content), *words, format="miuzei")


def test_the_measured_runs_are_read(data_folder):
    logs = read_logs(data_folder / "miuzei_25kg")
    assert len(logs) == 58
    assert {log.motion for log in logs} == {"step", "prbs", "square", "ramp", "triangle", "drop"}
    silent = {log.name: (~log.sent).sum() for log in logs if not log.sent.all()}
    assert silent == {"097 drop": 50, "098 drop": 50}
    for log in logs:
        asked = (log.command - 1.5e-3) / 1e-3 * 0.75 * math.pi  # 135 deg for a millisecond
        if log.motion == "drop":  # a pulse each 10 ms for as long as there are commands, and it falls
            np.testing.assert_allclose(log.signal().edges, 0.01 * np.arange(30), rtol=1e-12)
            assert log.measured["output_angle"][-1] < math.radians(-95.0)
        if log.motion == "ramp":  # it follows, some degrees behind
            assert np.nanmax(np.abs(log.measured["output_angle"] - asked)) < math.radians(15.0)


def test_the_measured_servo_coasts_without_pulses(data_folder):
    """Of two states that the file does not tell apart by any other run, the falling arm does: it coasts."""
    assumed = {
        "motor": {"armature_resistance": 1.8, "torque_constant": 1.1 / 300.0, "back_emf_constant": 1.1 / 300.0,
                  "rotor_inertia": 0.008 / 300.0**2, "motor_viscous_friction": 0.0},
        "gear": {"gear_reduction": 300.0},
        "friction": {"coulomb_torque_forward": 1e-3, "coulomb_torque_backward": 1e-3},
        "electronics": {"stretcher_gain": 65.0, "one_shot_slope": 1.0 / 850.0, "one_shot_offset": 0.0,
                        "frame_period": 0.01, "pulse_timeout": 0.03, "off_state": "brake"},
        "potentiometer": {"feedback_gain": 0.85 * 4.0 / 3.0 / math.pi, "feedback_offset": 0.85 * 1.5},
        "supply": {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 0.2},
    }
    off = {}
    for silence in ("brake", "coast"):
        servo = st.servo_from_values("miuzei", assumed).replace({"electronics.silence_state": silence})
        for log in read_logs(data_folder / "miuzei_25kg"):
            if log.motion == "drop":
                run = st.simulate(st.PulseServo(servo), log.signal(), duration=log.duration, load=log.load,
                                  output_times=log.time - log.start)
                error = np.degrees(run["output_angle"] - log.measured["output_angle"])[~log.sent]
                off[silence, log.name] = float(np.sqrt(np.mean(error**2)))
    assert min(value for (silence, _), value in off.items() if silence == "brake") > 40.0
    assert max(value for (silence, _), value in off.items() if silence == "coast") < 20.0


@pytest.mark.long
def test_the_maccepa_steps_are_read_without_code(data_folder, tmp_path):
    columns = {"time": {"column": "%time", "unit": "ns", "from_first": True}}
    columns["command_angle"] = {"column": "field.u1"}
    files = {f"servo{k}_*.csv": {"columns": {**columns, "output_angle": {"column": f"field.servo{k}_position"}}}
             for k in (1, 2)}
    sidecar = write(tmp_path, "maccepa.json", {
        "format": "servotwin-log-1", "motion": "step", "drop_repeated": True, "files": files})
    logs = read_logs(data_folder / "maccepa_hitec", sidecar=sidecar)
    assert len(logs) == 12
    for log in logs:
        step = math.radians(float(log.name.split("step")[1].split("_")[0]))
        assert np.ptp(log.command) == pytest.approx(abs(step), abs=0.02)
        assert log.time[0] == 0.0
        assert np.median(np.diff(log.time)) == pytest.approx(6e-3, abs=2e-3)
