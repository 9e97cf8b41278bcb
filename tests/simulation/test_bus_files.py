"""Fleets on their way out: files with units, pandas and xarray."""

import sys

import numpy as np
import pytest

import servotwin as st
from servotwin.tables.columns import read_columns

# signals that the second servo lacks
WARM = ("winding_temperature", "housing_temperature")


@pytest.fixture(scope="module")
def fleet():
    servo = st.load_servo("hitec-hs-755hb")
    warm = servo.replace({"thermal.winding_to_housing": 6.0, "thermal.winding_capacity": 4.0,
                          "thermal.housing_to_ambient": 18.0, "thermal.housing_capacity": 30.0})
    command = st.signals.step(0.0, 60.0, at=0.05, unit="deg")
    return st.simulate_bus({"warm, left": (st.PulseServo(warm), command), "plain": (st.PulseServo(servo), command)},
                           supply=st.Supply(open_circuit_voltage=6.0, internal_resistance=0.4), duration=0.2,
                           output_step=0.01)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_file_has_a_row_for_each_servo_and_time(fleet, tmp_path, ending):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    fleet.save(tmp_path / f"a.{ending}")
    found = read_columns(tmp_path / f"a.{ending}")
    times = len(fleet.time)
    assert list(found)[:2] == ["servo", "time_s"]
    assert found["servo"].tolist() == ["warm, left"] * times + ["plain"] * times
    np.testing.assert_allclose(found["time_s"], np.tile(fleet.time, 2))
    for column, name in (("output_angle_deg", "output_angle"), ("supply_current_A", "supply_current")):
        values = np.concatenate([result[name] for result in fleet.values()])
        np.testing.assert_allclose(found[column], np.degrees(values) if "deg" in column else values, rtol=1e-14)
    np.testing.assert_array_equal(found["bus_voltage_V"], np.tile(fleet.bus_voltage, 2))
    np.testing.assert_array_equal(found["bus_current_A"], np.tile(fleet.supply_current, 2))
    assert list(found).count("bus_voltage_V") == 1
    np.testing.assert_array_equal(found["winding_temperature_K"][:times], fleet["warm, left"]["winding_temperature"])
    assert np.isnan(found["winding_temperature_K"][times:]).all()


def test_files_are_kept_unless_asked(fleet, tmp_path):
    (tmp_path / "a.csv").write_text("mine")
    with pytest.raises(st.errors.OutputExistsError, match="exists already"):
        fleet.save(tmp_path / "a.csv")
    for name, said in (("a.txt", r"file of a fleet: .*ends in \.csv or \.parquet"), ("none/a.csv", "none")):
        with pytest.raises(st.errors.OutputError, match=said):
            fleet.save(tmp_path / name)
    assert (tmp_path / "a.csv").read_text() == "mine"
    fleet.save(tmp_path / "a.csv", overwrite=True)
    assert (tmp_path / "a.csv").read_text().startswith("servo,time_s,")


def test_a_dataframe(fleet):
    pytest.importorskip("pandas")
    frame = fleet.to_dataframe()
    assert frame.index.names == ["servo", "time"]
    assert list(frame.columns) == [name for name in fleet.units if name != "time"]
    for name, result in fleet.items():
        for signal in result.model.available:
            np.testing.assert_array_equal(frame.loc[name, signal], result[signal])
        np.testing.assert_array_equal(frame.loc[name, "bus_current"], fleet.supply_current)
    assert frame.loc["plain", list(WARM)].isna().all(axis=None)
    assert frame.attrs["units"] == fleet.units


def test_a_dataset(fleet):
    pytest.importorskip("xarray")
    data = fleet.to_xarray()
    assert data.sizes == {"servo": 2, "time": len(fleet.time)}
    assert data["servo"].values.tolist() == list(fleet)
    assert {"time", *data.data_vars} == set(fleet.units)
    for name in data.data_vars:
        assert data[name].dims == (("time",) if name.startswith("bus_") else ("servo", "time"))
        assert data[name].attrs["units"] == fleet.units[name]
        assert data[name].attrs["long_name"]
    np.testing.assert_array_equal(data["output_angle"].sel(servo="plain"), fleet["plain"]["output_angle"])
    np.testing.assert_array_equal(data["bus_voltage"], fleet.bus_voltage)
    np.testing.assert_allclose(data["supply_current"].sum("servo"), data["bus_current"], rtol=1e-14)
    assert data["model"].values.tolist() == ["PulseServo"] * 2


@pytest.mark.parametrize(("package", "call"), [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named_in_one_line(fleet, monkeypatch, package, call):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(st.errors.MissingExtraError, match=rf"{package} is needed for this"):
        getattr(fleet, call)()
