"""Results on their way out: signals by name, CSV files with units, pandas and xarray."""

import csv
import math
import os
import sys

import numpy as np
import pytest

import servotwin as st
from servotwin import loads
from servotwin.errors import CommandError, MissingExtraError, OutputError, OutputExistsError, UnknownNameError
from servotwin.models.outputs import SIGNALS

DURATION = 0.3
# column of the file -> (signal, factor from SI)
COLUMNS = {
    "time_s": ("time", 1.0), "command_voltage_V": ("command_voltage", 1.0), "pulse_width_us": ("pulse_width", 1e6),
    "command_angle_deg": ("command_angle", 180.0 / math.pi), "armature_voltage_V": ("armature_voltage", 1.0),
    "armature_current_A": ("armature_current", 1.0), "motor_angle_deg": ("motor_angle", 180.0 / math.pi),
    "motor_speed_deg_per_s": ("motor_speed", 180.0 / math.pi), "motor_torque_Nm": ("motor_torque", 1.0),
    "output_angle_deg": ("output_angle", 180.0 / math.pi), "output_speed_deg_per_s": ("output_speed", 180.0 / math.pi),
    "load_torque_Nm": ("load_torque", 1.0), "feedback_voltage_V": ("feedback_voltage", 1.0),
    "error_time_us": ("error_time", 1e6), "drive": ("drive", 1.0), "bus_voltage_V": ("bus_voltage", 1.0),
    "supply_current_A": ("supply_current", 1.0), "winding_temperature_K": ("winding_temperature", 1.0),
    "housing_temperature_K": ("housing_temperature", 1.0), "duty": ("duty", 1.0), "trip": ("trip", 1.0),
    "load_angle_deg": ("load_angle", 180.0 / math.pi),
    "goal_angle_deg": ("goal_angle", 180.0 / math.pi), "reference_angle_deg": ("reference_angle", 180.0 / math.pi),
}


@pytest.fixture(scope="module")
def result(model):
    command = st.signals.step(0.8, 1.4, at=0.05, unit="V")
    return st.simulate(model, command, duration=DURATION, load=loads.Inertia(1e-3), output_step=0.01)


def table_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    return header, np.array(rows, dtype=np.float64)


# ---------------------------------------------------------------------------------------- signals by name

def test_names_units_and_values(result):
    assert result.names == ("time", *result.model.available)
    assert list(result) == list(result.names)
    assert len(result) == len(result.names)
    assert set(result.units) == set(result.names)
    for name in result:
        assert result[name].shape == result.time.shape
        assert result[name].dtype == np.float64
        assert np.isfinite(result[name]).all()
    np.testing.assert_array_equal(result["time"], result.time)


def test_a_signal_cannot_be_changed(result):
    name = result.names[-1]
    with pytest.raises(ValueError, match="read-only"):
        result[name][0] = 7.0
    assert result[name] is result[name]


@pytest.mark.parametrize("name", ["speed", "", "output_angel", "Time", "propeller_pitch", 0, None, ("time",)])
def test_an_unknown_signal_is_a_key_error_with_the_known_ones(result, name):
    with pytest.raises(KeyError) as caught:
        result[name]
    assert isinstance(caught.value, UnknownNameError)
    assert "armature_voltage" in str(caught.value)
    assert str(caught.value).isprintable()
    assert name not in result


def test_the_continuous_solution_agrees_with_the_samples(result):
    for name in result:
        np.testing.assert_array_equal(result.at(name, result.time), result[name])
        np.testing.assert_array_equal(result.at(name, result.time[::-1]), result[name][::-1])
    assert result.at("armature_voltage", 0.1).shape == (1,)


def test_beyond_the_run_nothing_is_known(result):
    name = result.model.layout[0]
    assert np.isnan(result.at(name, [-0.1, DURATION + 0.1])).all()


def test_signals_fit_each_other(result):
    """Relations that hold in every model, whatever computed the signals."""
    servo, motor = result.model.servo, result.model.servo.motor
    warm = 1.0
    if "housing_temperature" in result:
        warm = 1.0 + servo.thermal.magnet_coefficient * (result["housing_temperature"] - 298.15)
    k_a = motor.torque_constant * warm
    np.testing.assert_allclose(result["motor_torque"], k_a * result["armature_current"], rtol=1e-12)
    if servo.gear.backlash is not None:
        return  # motor and potentiometer have their own angles
    if "output_angle" in result:
        N = servo.gear.gear_reduction
        np.testing.assert_allclose(result["motor_angle"], N * result["output_angle"], rtol=1e-14)
        np.testing.assert_allclose(result["motor_speed"], N * result["output_speed"], rtol=1e-14)
    if "feedback_voltage" in result:
        pot = servo.potentiometer
        np.testing.assert_allclose(
            result["feedback_voltage"], pot.feedback_gain * result["output_angle"] + pot.feedback_offset, rtol=1e-14)
        expected = np.where(result.time < 0.05, 0.8, 1.4)
        np.testing.assert_allclose(result["command_voltage"], expected, rtol=1e-13)


# ---------------------------------------------------------------------------------------- CSV

def test_the_file_has_every_signal_with_its_unit(result, tmp_path):
    result.save(tmp_path / "run.csv")
    header, rows = table_of(tmp_path / "run.csv")
    assert [COLUMNS[column][0] for column in header] == list(result.names)
    for column, values in zip(header, rows.T, strict=True):
        name, factor = COLUMNS[column]
        np.testing.assert_allclose(values, result[name] * factor, rtol=1e-11, atol=1e-300, err_msg=column)
    assert os.listdir(tmp_path) == ["run.csv"]


def test_all_signals_have_a_column():
    assert {name for name, _ in COLUMNS.values()} - {"time"} == set(SIGNALS)


def test_the_file_is_plain(result, tmp_path):
    result.save(str(tmp_path / "run.csv"))
    text = (tmp_path / "run.csv").read_bytes()
    assert text.isascii()
    assert b"\r" not in text
    assert not text.startswith((b"#", b"\xef"))
    assert text.count(b"\n") == len(result.time) + 1


@pytest.mark.long(but="averaged")
def test_what_was_commanded_can_be_commanded_again(result, tmp_path):
    result.save(tmp_path / "run.csv")
    columns = [column for column, (name, _) in COLUMNS.items()
               if name in result and name in ("command_voltage", "command_angle", "pulse_width")]
    if not columns:
        again = st.signals.from_csv(tmp_path / "run.csv")
        assert again.unit == "V"
        np.testing.assert_allclose(again(result.time), result["armature_voltage"], rtol=1e-11)
        return
    with pytest.raises(CommandError, match="chosen by column="):
        st.signals.from_csv(tmp_path / "run.csv")
    last = {}
    for column in columns:
        again = st.signals.from_csv(tmp_path / "run.csv", column=column)
        np.testing.assert_allclose(again(result.time), result[COLUMNS[column][0]], rtol=1e-11)
        run = st.simulate(result.model, again, duration=DURATION, load=result.load, output_step=0.01)
        last[column] = run["output_angle"]
    if type(result.model).__name__.startswith("Averaged"):  # one calibration: all three say the same
        for angle in last.values():
            np.testing.assert_allclose(angle, result["output_angle"], atol=1e-8)
    np.testing.assert_allclose(last["command_voltage_V"], result["output_angle"], atol=1e-8)


def test_what_exists_is_kept_unless_asked(result, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("precious")
    with pytest.raises(OutputExistsError, match="exists already"):
        result.save(path)
    assert path.read_text() == "precious"
    result.save(path, overwrite=True)
    assert table_of(path)[0][0] == "time_s"


@pytest.mark.parametrize("where", ["", "file/run.csv", "none/run.csv", "n" * 300, "a\0b"])
def test_what_cannot_be_written_is_one_line_and_leaves_nothing(result, tmp_path, where):
    (tmp_path / "file").write_text("old")
    with pytest.raises(OutputError) as caught:
        result.save(tmp_path / where, overwrite=True)
    assert str(caught.value).isprintable()
    assert os.listdir(tmp_path) == ["file"]
    assert (tmp_path / "file").read_text() == "old"


@pytest.mark.long(but="averaged-inductive")
def test_a_full_disc_leaves_what_was_there(result, tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    path.write_text("precious")

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savetxt", full)
    with pytest.raises(OutputError, match="No space left on device"):
        result.save(path, overwrite=True)
    assert path.read_text() == "precious"
    assert os.listdir(tmp_path) == ["run.csv"]


# ---------------------------------------------------------------------------------------- pandas, xarray

def test_a_dataframe(result):
    pytest.importorskip("pandas")
    frame = result.to_dataframe()
    assert list(frame.columns) == list(result.model.available)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, result.time)
    for name in frame:
        np.testing.assert_array_equal(frame[name], result[name])
    assert frame.attrs["units"] == dict(result.units)


def test_the_file_is_read_by_pandas(result, tmp_path):
    pandas = pytest.importorskip("pandas")
    result.save(tmp_path / "run.csv")
    frame = pandas.read_csv(tmp_path / "run.csv", index_col="time_s")
    np.testing.assert_allclose(frame["armature_voltage_V"], result["armature_voltage"], rtol=1e-11)


def test_a_dataset(result):
    pytest.importorskip("xarray")
    data = result.to_xarray()
    assert set(data.data_vars) == set(result.model.available)
    for name in result.model.available:
        assert data[name].dims == ("time",)
        assert data[name].attrs["units"] == result.units[name]
        assert data[name].attrs["long_name"]
        np.testing.assert_array_equal(data[name], result[name])
    assert data["time"].attrs["units"] == "s"
    assert data.attrs == {"model": type(result.model).__name__, "servo": result.model.servo.name}


@pytest.mark.parametrize(("package", "call"), [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named_in_one_line(result, monkeypatch, package, call):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"{package} is needed for this: pip install 'servotwin\[data\]'"):
        getattr(result, call)()


@pytest.mark.long
def test_saving_loads_neither(tmp_path):
    import subprocess

    code = (
        "import sys, servotwin as st\n"
        "model = st.BoundedServo(st.load_servo('hitec-hs-755hb'))\n"
        "result = st.simulate(model, st.signals.step(0.0, 9.0, unit='deg'), duration=0.1)\n"
        f"result.save({os.fspath(tmp_path / 'run.csv')!r}); result.step_metrics(); result.energy\n"
        "print([name for name in ('pandas', 'xarray', 'scipy', 'matplotlib', 'tomlkit') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
