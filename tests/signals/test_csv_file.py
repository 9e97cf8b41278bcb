"""Command files as people make them: whatever is in one, it is read rightly or refused in one line."""

import csv
import io
import math
import os

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from servotwin import signals
from servotwin.errors import CommandError


@pytest.fixture
def file(tmp_path):
    def write(content):
        path = tmp_path / "command.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path
    return write


def refused(path, *words, **options):
    with pytest.raises(CommandError) as caught:
        signals.from_csv(path, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert text.count(os.fspath(path)) == 1 or "\0" in os.fspath(path)
    assert all(word in text for word in words), text


# ---------------------------------------------------------------------------------------- what is read

@pytest.mark.parametrize("content", [
    "time_s,pulse_width_us\n0,1500\n0.5,1600\n",
    "time_s,pulse_width_us\r\n0,1500\r\n0.5,1600\r\n",  # Windows
    "time_s,pulse_width_us\r0,1500\r0.5,1600\r",  # old Macs
    "time_s,pulse_width_us\n0,1500\n0.5,1600",  # no line end
    "\ufefftime_s,pulse_width_us\n0,1500\n0.5,1600\n",  # Excel's mark
    '"time_s","pulse_width_us"\n"0","1500"\n"0.5","1600"\n',
    " time_s , pulse_width_us \n 0 , 1500 \n 0.5 , 1600 \n",
    "\n\ntime_s,pulse_width_us\n\n0,1500\n , \n,\n0.5,1600\n\n\n",
    "time_s,pulse_width_us,\n0,1500,\n0.5,1600,\n",  # a comma too many
    "pulse_width_us,note,time_s\n1500,first,0\n1600,\"second, and\nlast\",0.5\n",
    "time_ms,pulse_width_ms\n0,1.5\n500,1.6\n",
    "time,pulse_width\n0,0.0015\n0.5,1.6e-3\n",
    "time,pulse_width_s\n+0,.0015\n5e-1,16.0E-4\n",
    "time_s;pulse_width_us\n0,0;1500\n0,5;1600\n", "# a bench\ntime_s\tpulse_width_us\n0\t1500\n0.5\t1600\n",
    "time_s pulse_width_us\n0 1500\n0.5 1600\n",
])
def test_one_command_in_many_hands(file, content):
    signal = signals.from_csv(file(content))
    assert signal.kind == "pulse_width"
    np.testing.assert_allclose(signal([0.0, 0.499, 0.5, 9.0]), [1.5e-3, 1.5e-3, 1.6e-3, 1.6e-3], rtol=1e-15)
    assert signal.initial == pytest.approx(1.5e-3)


@pytest.mark.parametrize(("column", "unit", "factor"), [
    ("pulse_width_us", "us", 1e-6), ("pulse_width_ms", "ms", 1e-3), ("pulse_width_s", "s", 1.0),
    ("pulse_width", "s", 1.0),
    ("command_angle_deg", "deg", math.pi / 180), ("command_angle_rad", "rad", 1.0), ("command_angle", "rad", 1.0),
    ("command_voltage_V", "V", 1.0), ("command_voltage_mV", "mV", 1e-3), ("command_voltage", "V", 1.0),
    ("armature_voltage_V", "V", 1.0), ("armature_voltage", "V", 1.0),
])
def test_every_column_has_its_unit(file, column, unit, factor):
    signal = signals.from_csv(file(f"time_s,{column}\n0,2\n1,3\n"))
    assert signal.unit == unit
    np.testing.assert_allclose(signal([0.0, 1.0]), [2.0 * factor, 3.0 * factor], rtol=1e-15)


def test_linear_and_frame_period_go_on(file):
    signal = signals.from_csv(file("time_s,pulse_width_us\n0,1500\n1,1600\n"), hold="linear", frame_period=0.01)
    assert signal(0.5) == pytest.approx(1.55e-3)
    assert signal.frame_period == 0.01


def test_one_column_out_of_several(file):
    path = file("time_s,pulse_width_us,command_angle_deg,output_angle_deg\n0,1500,10,9\n1,1600,20,19\n")
    assert signals.from_csv(path, column="command_angle_deg").kind == "angle"
    assert signals.from_csv(path, column="pulse_width_us").kind == "pulse_width"
    refused(path, "pulse_width_us, command_angle_deg", "column=")
    refused(path, "column", "output_angle_deg", "pulse_width_us, command_angle_deg", column="output_angle_deg")


@pytest.mark.parametrize("empty", ["", "nan", "NA", "-"])
def test_an_empty_cell_means_no_pulses(file, empty):
    content = f"time_s,pulse_width_us\n0,{empty}\n0.1,1500\n0.2,{empty}\n0.3,1600\n0.4,{empty}\n"
    nan = math.nan
    assert signals.from_csv(file(content)) == signals.samples(
        [0.0, 0.1, 0.2, 0.3, 0.4], [nan, 1500.0, nan, 1600.0, nan], unit="us")


def test_other_columns_may_hold_anything(file):
    signal = signals.from_csv(file("time_s,remark,command_voltage\n0,nan,1\n1,x y z,2\n"))
    assert signal([0.0, 1.0]).tolist() == [1.0, 2.0]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.floats(1e-6, 10.0), min_size=1, max_size=20), st.data())
def test_what_python_writes_is_read_back_exactly(file, gaps, data):
    t = np.cumsum(gaps).tolist()
    y = data.draw(st.lists(st.floats(-1e9, 1e9), min_size=len(t), max_size=len(t)))
    text = io.StringIO()
    csv.writer(text).writerows([("time", "command_voltage"), *zip(t, y, strict=True)])
    assert signals.from_csv(file(text.getvalue())) == signals.samples(t, y, unit="V")


# ---------------------------------------------------------------------------------------- what is refused

@pytest.mark.parametrize(("content", "words"), [
    ("", ("empty file",)), ("\n\n \n", ("empty file",)), ("\ufeff", ("empty file",)),
    ("time_s,pulse_width_us\n", ("header without rows",)), ("time_s,pulse_width_us\n\n,\n", ("header without rows",)),
    ("0,1500\n1,1600\n", ("a time column", "time_s, time_ms, time")),
    ("pulse_width_us\n1500\n", ("a time column",)),
    ("time_s\n0\n", ("one of pulse_width_us",)),
    ("time_s,output_angle_deg\n0,1\n", ("command columns", "output_angle_deg", "one of pulse_width_us")),
    ("Time_s,pulse_width_us\n0,1500\n", ("a time column", "Time_s")),
    ("time_s;pulse_width_us\n0,5;1500\n1.0;1600\n", ("line 3, time_s", "'1.0'", "decimal comma")),
    ("time_s,time_s,pulse_width_us\n0,1,1500\n", ("time_s 2 times", "once")),
    ("time_s,pulse_width_us,pulse_width_us\n0,1500,1600\n", ("pulse_width_us 2 times", "once")),
    ("time_s,pulse_width_us\n0,abc\n", ("line 2, pulse_width_us", "'abc'", "a number")),
    ("time_s,command_voltage\n\n\n0,1500\n1,\n", ("line 5, command_voltage", "nothing")),
    ("time_s,pulse_width_us\n0,1500\n1\n", ("line 3, pulse_width_us", "nothing")),
    ("time_s,pulse_width_us\n0,1500 us\n", ("line 2", "'1500 us'")),
    ("time_s,pulse_width_us\nnull,1500\n", ("line 2, time_s", "'null'")),
    ("time_s,pulse_width_us\n0,0,1500,0\n", ("line 2", "4 cells", "2, as the header")),  # decimal commas
    ("time_s,pulse_width_us\n0,1500\n0,1600\n", ("time of sample 1", "the one before")),
    ("time_s,pulse_width_us\n1,1500\n0,1600\n", ("time of sample 1", "got 0.0")),
    ("time_s,pulse_width_us\n0,1e400\n", ("value of sample 0", "inf")),
    ("time_s,pulse_width_us\n0,nan\n1,\n", ("no value that is a number",)),
    ("time_s,command_voltage\n0,nan\n", ("value of sample 0", "nan", "only pulses and angles")),
    ("time_s,pulse_width_us\n-inf,1500\n", ("time of sample 0",)),
    ("time_s,pulse_width_us\n0,0\n", ("pulse width", "positive")),
    ("time_s,pulse_width_us\n0,-1500\n", ("pulse width", "positive")),
    (b"time_s,pulse_width_us\n0,1500\0\n", ("line 2", "a NUL")),
    (b"\0\0\0", ("binary data",)), (b"\0\n\0\n", ("empty file",)),
    (b"\xff\xfet\0i\0m\0e\0", ("header without rows",)),  # UTF-16
    (b"time_s,pulse_width_\xb5s\n0,1500\n", ("pulse_width_µs", "one of pulse_width_us")),  # Latin-1
    (b"PK\x03\x04\x14\0\x06\0\xd0\x9f\xe2", ("a zip archive or an Excel workbook",)),
    ('time_s,pulse_width_us\n0,"1500\n1,1600\n', ("line",)),  # a quote that never ends
    (b'time_s,pulse_width_us\n0,"' + b"9" * 200_000 + b'"\n', ("not readable as CSV", "field limit")),
    ("\x1b[2Jtime_s,x\n0,1\n", ("line 1, name of column 1",)),
])
def test_what_is_wrong_is_said_in_one_line(file, content, words):
    refused(file(content), *words)


@pytest.mark.parametrize("column", ["", "pulse_width", "time_s", 3])
def test_a_column_that_is_not_there(file, column):
    refused(file("time_s,pulse_width_us\n0,1500\n"), "column", "pulse_width_us", column=column)


@pytest.mark.parametrize(("options", "word"), [({"hold": "next"}, "hold"), ({"frame_period": -1.0}, "frame_period")])
def test_bad_options_name_themselves(file, options, word):
    refused(file("time_s,pulse_width_us\n0,1500\n"), word, **options)


def test_places_that_are_no_files(tmp_path, file):
    path = file("x")
    refused(tmp_path / "missing.csv", "no such file")
    refused(tmp_path, "cannot be read", "directory")
    refused(path / "below.csv", "cannot be read")
    refused(tmp_path / ("n" * 300), "cannot be read")
    refused(f"{path}\0", "cannot be read")


def read_or_refuse(path):
    try:
        signal = signals.from_csv(path)
    except CommandError as error:
        said = str(error)
    else:
        assert np.isfinite(signal([0.0, 1.0, 1e6])).all()
        return
    assert said.isprintable()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200))
@example(b"\xef\xbb\xbf")
def test_random_bytes_are_read_or_refused(file, content):
    read_or_refuse(file(content))


cells = st.one_of(st.text(alphabet='0123456789.,-+eE"\r\n\0 _;infa\ufeff٣', max_size=8), st.floats().map(repr))


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.lists(cells, max_size=4), max_size=6))
@example([["0", "1_5"]])
def test_almost_right_files_are_read_or_refused(file, rows):
    read_or_refuse(file("time_s,command_voltage\n" + "\n".join(",".join(row) for row in rows)))
