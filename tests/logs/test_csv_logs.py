"""Logs as CSV with a sidecar: whatever is in the files, it is read rightly or refused in one line."""

import json
import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as some

import servotwin as st
from servotwin.errors import HIDDEN, InputError, OutputError, OutputExistsError
from servotwin.identification import Log, read_csv_log, read_logs, write_log

HEADER = "time_s,pulse_width_us,output_angle_deg\n"
ROWS = "0,1500,0\n0.02,1600,9\n0.04,1600,18\n"


@pytest.fixture
def run(tmp_path):
    def write(content=HEADER + ROWS, sidecar=None, name="run"):
        path = tmp_path / f"{name}.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        if sidecar is not None:
            text = json.dumps({"format": "servotwin-log-1", **sidecar}) if isinstance(sidecar, dict) else sidecar
            (tmp_path / f"{name}.json").write_bytes(text if isinstance(text, bytes) else text.encode())
        return path
    return write


def refused(path, *words, **options):
    with pytest.raises(InputError) as caught:
        read_csv_log(path, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text
    assert text.count(os.fspath(path.parent)) == 1, text


# ---------------------------------------------------------------------------------------- what is read

@pytest.mark.parametrize(("column", "name", "factor"), [
    ("output_angle_deg", "output_angle", math.pi / 180), ("output_angle_rad", "output_angle", 1.0),
    ("output_angle", "output_angle", 1.0), ("feedback_voltage_V", "feedback_voltage", 1.0),
    ("feedback_voltage_mV", "feedback_voltage", 1e-3), ("armature_current_A", "armature_current", 1.0),
    ("armature_current_mA", "armature_current", 1e-3), ("supply_current", "supply_current", 1.0),
    ("bus_voltage_V", "bus_voltage", 1.0), ("output_speed_deg_per_s", "output_speed", math.pi / 180),
    ("output_speed_rpm", "output_speed", math.pi / 30), ("motor_torque_mNm", "motor_torque", 1e-3),
    ("winding_temperature_K", "winding_temperature", 1.0), ("drive", "drive", 1.0),
])
def test_every_column_has_its_unit(run, column, name, factor):
    extra = "" if name in ("output_angle", "feedback_voltage") else ",output_angle"
    cell = ",0.1" if extra else ""
    log = read_csv_log(run(f"time_ms,command_angle_deg,{column}{extra},remark\n"
                           f"0,90,1{cell},a\n20,90,{cell},b\n40,180,2{cell},\n"))
    np.testing.assert_allclose(log.measured[name], np.array([1.0, np.nan, 2.0]) * factor, rtol=1e-15)
    np.testing.assert_allclose(log.time, [0.0, 0.02, 0.04], rtol=1e-15)
    np.testing.assert_allclose(log.command, [math.pi / 2, math.pi / 2, math.pi], rtol=1e-15)
    assert (log.command_kind, log.name, log.source) == ("angle", "run", log.source)


@pytest.mark.parametrize(("names", "kind", "first"), [
    ("command_voltage_V,pulse_width_us,command_angle_deg", "pulse_width", 2e-6),
    ("command_voltage_V,command_angle,drive", "angle", 2.0), ("command_voltage_mV,drive,motor_angle", "voltage", 1e-3),
])
def test_of_several_commands_the_pulse_counts_first(run, names, kind, first):
    log = read_csv_log(run(f"time,{names},output_angle\n0,1,2,3,0\n1,1,2,3,1\n2,1,2,3,0.5\n"))
    assert (log.command_kind, log.command[0]) == (kind, pytest.approx(first, rel=1e-15))
    assert not {"pulse_width", "command_angle", "command_voltage"} & set(log.measured)


def test_the_sidecar_says_which_command(run):
    content = "time,pulse_width_us,command_angle_deg,output_angle\n0,1500,90,0\n1,1500,90,1\n2,1500,90,2\n"
    assert read_csv_log(run(content, {"command": "command_angle"})).command_kind == "angle"


@pytest.mark.parametrize("column", ["pulse_width_ms", "command_angle_deg"])
@pytest.mark.parametrize("empty", ["", "nan", "NA", "-"])
def test_an_empty_cell_of_the_command_means_no_pulses(run, column, empty):
    log = read_csv_log(run(f"time,{column},output_angle\n0,{empty},0\n1,1,0\n2,{empty},1\n3,2,1\n"))
    assert np.isnan(log.command).tolist() == [True, False, True, False]
    assert log.sent.tolist() == [False, True, False, True]
    assert log.held[[0, 2]].tolist() == log.command[[1, 1]].tolist()
    assert log.reading.remarks == ("2 of 4 samples have no command: no pulses were sent there",)


@pytest.mark.parametrize(("column", "unit"), [("load_angle_deg", math.pi / 180.0), ("load_angle_rad", 1.0),
                                              ("load_angle", 1.0)])
def test_the_angle_behind_the_shaft_is_kept(run, tmp_path, column, unit):
    log = read_csv_log(run(f"time,pulse_width_us,output_angle,{column}\n0,1500,0,0\n1,1500,0,\n2,1500,1,90\n"))
    np.testing.assert_allclose(log.measured["load_angle"], [0.0, np.nan, 90.0 * unit], rtol=1e-15)
    write_log(log, tmp_path / "again.csv")
    again = read_csv_log(tmp_path / "again.csv")
    np.testing.assert_array_equal(again.measured["load_angle"], log.measured["load_angle"])


def test_torque_off_in_words_and_numbers(run):
    log = read_csv_log(run("time,pulse_width_us,output_angle,torque_on\n0,1500,0,1\n1,1500,0,False\n2,1500,1,ON\n"))
    assert log.torque_on.tolist() == [True, False, True]


def test_all_that_a_sidecar_can_say(run):
    path = run(sidecar={
        "name": "third", "motion": "step", "conditions": {"gain": 3, "horn": "long"},
        "load": {"inertia": 1e-3, "pendulum": {"mass": 0.1, "length": 0.12, "hanging_angle": -1.0},
                 "spring": [{"stiffness": 1.0}, {"stiffness": 2.0, "rest_angle": 0.3}]},
        "parameters": {"supply.open_circuit_voltage": 6.0}, "leave_out": [[0.0, 0.01]], "command_hold": "linear",
        "source": "bench, 3 May"})
    log = read_csv_log(path)
    assert (log.name, log.motion, log.command_hold, log.source) == ("third", "step", "linear", "bench, 3 May")
    assert dict(log.conditions) == {"gain": 3.0, "horn": "long"}
    assert log.load == (st.loads.Inertia(1e-3) + st.loads.Pendulum(mass=0.1, length=0.12, hanging_angle=-1.0)
                        + st.loads.Spring(1.0) + st.loads.Spring(2.0, 0.3))
    assert log.left_out == ((0.0, 0.01),)
    assert log.used("output_angle").tolist() == [False, True, True]


def test_a_foreign_table_is_read_without_code(run):
    start = 1494360095580806970  # ns since 1970, 256 ns from the next double
    rows = "".join(f"{start + k * 6_000_001},{512 + k},{90 + k},x\n" for k in range(5))
    log = read_csv_log(run("%time,field.pot,field.u1,note\n" + rows, {"columns": {
        "time": {"column": "%time", "unit": "ns", "from_first": True},
        "output_angle": {"column": "field.pot", "unit": "deg", "scale": 0.5, "offset": -256.0},
        "command_angle": {"column": "field.u1", "unit": "deg"}}}))
    np.testing.assert_allclose(log.time, np.arange(5) * 6.000001e-3, rtol=1e-15)
    np.testing.assert_allclose(log.measured["output_angle"], np.radians(0.5 * np.arange(5)), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(log.command, np.radians(90.0 + np.arange(5)), rtol=1e-15)


def test_a_repeated_stamp_is_passed_over_on_request(run):
    content = HEADER + "0,1500,0\n0.02,1600,9\n0.02,1700,10\n0.04,1600,18\n"
    refused(run(content), "line 4", "time_s", "stands still", "0.02 s after 0.02 s in line 3", "drop-repeated")
    log = read_csv_log(run(content, {"drop_repeated": True}))
    assert log.time.tolist() == [0.0, 0.02, 0.04]
    np.testing.assert_allclose(log.command, [1.5e-3, 1.6e-3, 1.6e-3], rtol=1e-15)


def test_a_folder_speaks_for_its_files_and_a_file_for_itself(tmp_path, run):
    for name in ("a1", "a2", "b1"):
        run(name=name)
    run(name="a2", sidecar={"motion": "chirp", "conditions": {"gain": 2.0}})
    (tmp_path / "logs.json").write_text(json.dumps({
        "format": "servotwin-log-1", "motion": "step", "conditions": {"gain": 1.0, "volts": 6.0},
        "parameters": {"supply.open_circuit_voltage": 6.0},
        "files": {"b*.csv": {"motion": "ramp", "conditions": {"volts": 5.0}}}}))
    logs = {log.name: log for log in read_logs(tmp_path)}
    assert {name: (log.motion, dict(log.conditions)) for name, log in logs.items()} == {
        "a1": ("step", {"gain": 1.0, "volts": 6.0}), "a2": ("chirp", {"gain": 2.0, "volts": 6.0}),
        "b1": ("ramp", {"gain": 1.0, "volts": 5.0})}
    assert all(log.parameters["supply.open_circuit_voltage"] == 6.0 for log in logs.values())
    other = tmp_path / "other.json"
    other.write_text('{"format": "servotwin-log-1", "motion": "prbs"}')
    assert read_csv_log(tmp_path / "a1.csv", sidecar=other).motion == "prbs"


def test_a_saved_result_is_a_log(tmp_path, servo):
    command = st.signals.step(1500.0, 1600.0, at=0.1, unit="us")
    result = st.simulate(st.PulseServo(servo), command, duration=0.5, output_step=0.01)
    result.save(tmp_path / "run.csv")
    log = read_csv_log(tmp_path / "run.csv")
    assert log.command_kind == "pulse_width"
    assert set(log.measured) == set(result.names) - {"time", "pulse_width", "command_angle", "command_voltage"}
    np.testing.assert_allclose(log.time, result.time, rtol=1e-11)
    for name in ("output_angle", "feedback_voltage", "armature_current", "output_speed", "motor_angle", "error_time"):
        np.testing.assert_allclose(log.measured[name], result[name], rtol=1e-11, atol=1e-15)
    again = st.simulate(st.PulseServo(servo), log.signal(), duration=log.duration, output_step=0.01)
    np.testing.assert_allclose(again["output_angle"], result["output_angle"], rtol=0, atol=1e-9)


# ---------------------------------------------------------------------------------------- what is written

finite = some.floats(-50.0, 50.0, allow_nan=False).map(lambda x: x / 3.0)


@pytest.mark.long
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=some.data(), kind=some.sampled_from(["angle", "pulse_width", "voltage"]), n=some.integers(3, 8))
def test_what_is_written_is_read_back_bit_for_bit(tmp_path, data, kind, n):
    def column(element):
        return data.draw(some.lists(element, min_size=n, max_size=n))

    steps = column(some.floats(1e-6, 1e6))
    hold = data.draw(some.sampled_from(["previous", "linear"]))
    silent = some.nothing() if kind == "voltage" or hold == "linear" else some.just(math.nan)
    value = data.draw(some.floats(1e-9, 0.1))
    angle = [0.1, *column(finite | some.just(math.nan))[1:]]
    names = some.text(max_size=5).map(lambda text: HIDDEN.sub("", text))
    log = Log(
        name=data.draw(names) or "a", time=np.cumsum(steps), command_kind=kind,
        command=[value, *column((some.floats(1e-9, 0.1) if kind == "pulse_width" else finite) | silent)[1:]],
        measured={"output_angle": angle, "supply_current": column(finite)},
        torque_on=data.draw(some.none() | some.just(column(some.booleans()))),
        load=(st.loads.Recorded([0.0, 1.0], column(finite)[:2]) + st.loads.Constant(0.1 / 3.0)
              + st.loads.Pendulum(mass=0.1 / 3.0, length=0.12, inertia=1e-3)),
        parameters={"supply.open_circuit_voltage": 6.1 / 3.0}, motion=data.draw(names),
        conditions=data.draw(some.dictionaries(names, names | finite, max_size=2)),
        command_hold=hold, left_out=[(-3.1, -1.0 / 3.0)],
        source="a bench")
    write_log(log, tmp_path / "run.csv", overwrite=True)
    again = read_csv_log(tmp_path / "run.csv")
    for name in ("name", "command_kind", "command_hold", "load", "motion", "left_out", "source"):
        assert getattr(again, name) == getattr(log, name)
    assert dict(again.parameters) == dict(log.parameters)
    assert dict(again.conditions) == dict(log.conditions)
    assert list(again.measured) == list(log.measured)
    for a, b in [(again.time, log.time), (again.command, log.command),
                 *((again.measured[name], log.measured[name]) for name in log.measured)]:
        assert a.tobytes() == b.tobytes()
    assert (again.torque_on is None) == (log.torque_on is None)
    if log.torque_on is not None:
        np.testing.assert_array_equal(again.torque_on, log.torque_on)


def test_nothing_is_overwritten_unasked(tmp_path, run):
    log = read_csv_log(run())
    before = (tmp_path / "run.csv").read_bytes()
    with pytest.raises(OutputExistsError):
        write_log(log, tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_bytes() == before
    assert not (tmp_path / "run.json").exists()
    (tmp_path / "new.json").write_text("mine")
    with pytest.raises(OutputExistsError):
        write_log(log, tmp_path / "new.csv")
    assert not (tmp_path / "new.csv").exists()
    assert (tmp_path / "new.json").read_text() == "mine"
    for name in ("run.txt", "logs.csv", "missing/run.csv", "nul\0.csv"):
        with pytest.raises(OutputError):
            write_log(log, tmp_path / name)


# ---------------------------------------------------------------------------------------- what is refused

@pytest.mark.parametrize(("content", "words"), [
    ("", ("empty file",)), (HEADER, ("header without rows",)),
    (HEADER + "0,1500,0\n0.02,1500,1\n", ("2 samples", "at least 3")),
    ("pulse_width_us,output_angle\n1500,0\n", ("no time among", "pulse_width_us, output_angle", '--columns "time=')),
    ("time_s,output_angle\n0,0\n", ("no command among", "pulse_width_us, command_angle_deg or command_voltage_V")),
    ("time_s,pulse_width_us,bus_voltage\n0,1500,0\n", ("no measured angle", "output_angle_deg or feedback_voltage_V")),
    ("time_s,pulse_width_us,output_angle_kg\n0,1500,0\n", ("output_angle_kg", "'kg'", "deg, rad")),
    ("time_s,pulse_width_deg,output_angle\n0,1500,0\n", ("pulse_width_deg", "s, ms, us")),
    ("time_s,pulse_width_us,output_angel_deg\n0,1500,0\n", ("output_angel_deg", "output_angle", "sidecar")),
    ("time_s,time_ms,pulse_width_us,output_angle\n0,0,1500,0\n", ("time_s and time_ms", "one of them")),
    ("time_s,pulse_width_us,output_angle,output_angle\n0,1500,0,0\n", ("output_angle",)),
    (HEADER + "0,1500,0\n0.02,abc,1\n0.04,1500,2\n", ("line 3, pulse_width_us", "'abc'", "a number")),
    ("time,command_voltage,output_angle\n0,1,0\n1,,1\n2,1,2\n", ("line 3, command_voltage", "'nothing'")),
    (HEADER + "0,,0\n0.02,,1\n0.04,,2\n", ("command", "no value in any sample")),
    (HEADER + "0,1500,0\n0.02,1500,x\n0.04,1500,2\n", ("line 3, output_angle_deg", "'x'")),
    (HEADER + "0,1500,0\n,1500,1\n0.04,1500,2\n", ("line 3, time_s",)),
    (HEADER + "0,1500,0\n0.04,1500,1\n\n0.02,1500,2\n", ("line 5, time_s", "runs backwards", "in line 3")),
    (HEADER + "0,1500,0\nnan,1500,1\n0.04,1500,2\n", ("line 3, time_s", "nan")),
    ("time,command_voltage,output_angle\n0,nan,0\n1,1,1\n2,1,2\n", ("line 2, command_voltage", "nan")),
    (HEADER + "0,1500,\n0.02,1500,\n0.04,1500,\n", ("output_angle", "no value")),
    (HEADER + "0,1500,inf\n0.02,1500,1\n0.04,1500,2\n", ("output_angle of sample 0", "inf")),
    (HEADER + "0,-1500,0\n0.02,1500,1\n0.04,1500,2\n", ("pulse width of sample 0", "positive")),
    ("time_s,pulse_width,output_angle\n0,1500,0\n0.02,1500,1\n0.04,1500,2\n", ("1500 s", "microseconds?")),
    ("time_s,pulse_width_us,output_angle\n0,1500,0\n0.02,1500,4000\n0.04,1500,2\n", ("4000 rad", "degrees or counts?")),
    ("time_s,pulse_width_us,output_angle,torque_on\n0,1500,0,\n0.02,1500,1,1\n", ("line 2, torque_on", "1 or 0")),
    (HEADER + "0,0,1500,0\n", ("line 2", "4 cells", "3, as the header")),
    (b"\0\0\0", ("binary data",)), (b"\xff\xfet\0i\0m\0e\0", ("no line that ends in a newline",)),
    (HEADER.encode() + b"0,15\0,0\n", ("line 2", "a NUL", "damaged")),
    (HEADER.encode() + b'0,"' + b"9" * 200_000 + b'"\n', ("field limit",)),
    (HEADER + "0,1e400,0\n0.02,1500,1\n0.04,1500,2\n", ("command of sample 0", "inf")),
])
def test_what_is_wrong_in_a_file_is_said_in_one_line(run, content, words):
    refused(run(content), *words)


ANGLE = {"column": "output_angle_deg", "unit": "deg"}


@pytest.mark.parametrize(("sidecar", "words"), [
    ("", ("empty file",)), ("{\n  \"format\": }", ("line 2 is not valid JSON",)), ("[]", ("list", "servotwin-log-1")),
    ('{"format": "servotwin-log-9"}', ("format", "servotwin-log-9")), ("{}", ("format", "none")),
    (b"\xff\xfe", ("not readable as text",)), ("[" * 100_000, ("nested too deeply",)),
    ('{"a": 1, "a": 2}', ("a twice",)), ('{"format": ' + "9" * 5000 + "}", ("not valid JSON",)),
    ({"motoin": "step"}, ("unknown key 'motoin'", "did you mean 'motion'")), ({"motion": 3}, ("motion", "a text")),
    ({"name": ""}, ("name of a log",)), ({"files": {}}, ("files", "logs.json only")),
    ({"command": "angle"}, ("command", "pulse_width, command_angle")),
    ({"command": "command_angle"}, ("command", "'command_angle'", "pulse_width")),
    ({"command": []}, ("command",)),
    ({"command_hold": "next"}, ("command_hold", "previous, linear")), ({"drop_repeated": 1}, ("true or false",)),
    ({"leave_out": 3}, ("leave_out", "windows")), ({"leave_out": [[1, 0]]}, ("left_out", "start < stop")),
    ({"leave_out": [[0, 1]]}, ("outside the windows",)),
    ({"parameters": {"supply.voltage": 6.0}}, ("supply.voltage", "did you mean")),
    ({"parameters": [1]}, ("parameters", "an object")),
    ({"parameters": {"supply.open_circuit_voltage": None}}, ("supply.open_circuit_voltage", "positive")),
    ({"conditions": {"gain": [1]}}, ("conditions, gain",)),
    ({"load": 3}, ("load", "a mapping")), ({"load": {"mass": 1.0}}, ("'mass'", "inertia")),
    ({"load": {"inertia": -1.0}}, ("load.inertia", "at least 0")), ({"load": {"inertia": "1"}}, ("load.inertia",)),
    ({"load": {"pendulum": {"mass": 0.1}}}, ("load.pendulum", "also length")),
    ({"load": {"pendulum": {"mass": 0.1, "lenght": 0.1}}}, ("lenght", "did you mean 'length'")),
    ({"load": {"pendulum": 3}}, ("load.pendulum", "its fields")),
    ({"load": {"recorded": {"time": [0], "torque": [0]}}}, ("length of at least 2",)),
    ({"columns": {}}, ("no time, no command and no measured angle", "of the sidecar")),
    ({"columns": []}, ("columns", "an object")),
    ({"columns": {"output_angel": ANGLE}}, ("output_angel", "did you mean 'output_angle'")),
    ({"columns": {"output_angle": "output_angle_deg"}}, ("columns, output_angle", "an object, such as")),
    ({"columns": {"output_angle": {**ANGLE, "unit": "us"}}}, ("output_angle, unit", "'us'", "rad, deg")),
    ({"columns": {"output_angle": {**ANGLE, "unit": 3}}}, ("output_angle, unit", "a text")),
    ({"columns": {"output_angle": {**ANGLE, "scale": 0}}}, ("output_angle, scale", "not 0")),
    ({"columns": {"output_angle": {**ANGLE, "offset": "x"}}}, ("output_angle, offset",)),
    ({"columns": {"output_angle": {**ANGLE, "from_first": True}}}, ("'from_first'",)),
    ({"columns": {"output_angle": {"unit": "deg"}}}, ("output_angle, column", "header")),
    ({"columns": {"time": {"column": "%time", "unit": "ns"}}}, ("column of time", "'%time'", "time_s, pulse_width_us")),
    ({"columns": {"time": {"column": "time_s", "unit": "h"}}}, ("time, unit", "'h'", "ns")),
    ({"columns": {"time": {"column": "time_s", "from_first": 1}}}, ("from_first", "true or false")),
])
def test_what_is_wrong_in_a_sidecar_is_said_in_one_line(run, sidecar, words):
    refused(run(sidecar=sidecar), *words)


def test_places_that_are_no_files(tmp_path, run):
    refused(tmp_path / "missing.csv", "no such file")
    refused(run(), "no such file", sidecar=tmp_path / "missing.json")
    refused(run() / "below.csv", "cannot be read")
    refused(tmp_path / ("n" * 300 + ".csv"), "cannot be read")


def read_or_refuse(path):
    try:
        log = read_csv_log(path)
    except InputError as error:
        said = str(error)
    else:
        assert np.isfinite(log.time).all()
        assert (np.diff(log.time) > 0.0).all()
        return
    assert said.isprintable()


cells = some.one_of(some.text(alphabet='0123456789.,-+eE"\r\n\0 _;infa\ufeff٣', max_size=8), some.floats().map(repr))
words = some.recursive(
    some.none() | some.booleans() | some.floats() | some.integers() | some.text(max_size=6)
    | some.sampled_from(["time_s", "output_angle_deg", "deg", "ns", "previous"]),
    lambda inner: some.lists(inner, max_size=3) | some.dictionaries(some.sampled_from([
        "format", "name", "load", "pendulum", "mass", "length", "inertia", "columns", "time", "column", "unit", "scale",
        "output_angle", "pulse_width", "leave_out", "parameters", "supply.open_circuit_voltage", "conditions"])
        | some.text(max_size=4), inner, max_size=4), max_leaves=12)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some.binary(max_size=200))
@example(b"\xef\xbb\xbf")
def test_random_bytes_are_read_or_refused(run, content):
    read_or_refuse(run(content))


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some.lists(some.lists(cells, min_size=2, max_size=4), max_size=6), some.booleans())
def test_almost_right_files_are_read_or_refused(run, rows, from_first):
    sidecar = {"columns": {"time": {"column": "t", "from_first": from_first, "unit": "ns"},
                           "pulse_width": {"column": "p", "unit": "us"}, "output_angle": {"column": "q"}}}
    read_or_refuse(run("t,p,q\n" + "\n".join(",".join(row) for row in rows), sidecar))


@pytest.mark.long
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some.dictionaries(some.sampled_from([
    "name", "motion", "source", "conditions", "load", "parameters", "leave_out", "command_hold", "command", "columns",
    "drop_repeated", "files"]), words, max_size=4))
def test_almost_right_sidecars_are_read_or_refused(run, sidecar):
    read_or_refuse(run(sidecar=sidecar))


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(some.binary(max_size=100) | some.text(alphabet='{}[]":,0123456789.eE-naNtruefls \n', max_size=60))
def test_random_sidecars_are_read_or_refused(run, content):
    read_or_refuse(run(sidecar=content))
