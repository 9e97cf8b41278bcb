"""One log as ten and more loggers would have written it: the same log, and the same fit."""

import json
import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.identification import identify, keep_columns, read_csv_log, read_logs
from servotwin.logs.column_words import with_signals

RNG = np.random.default_rng(11)
TIME = np.arange(60) * 20  # ms
COMMAND = np.where(TIME < 100, 1500, np.where(TIME < 700, 1700, 1450))  # us
TRUTH = {"motor.rotor_inertia": 6.0e-8}


def _angles():
    servo = st.load_servo("hitec-hs-755hb").replace(TRUTH)
    run = st.simulate(st.BoundedServo(servo), st.signals.samples(TIME / 1e3, COMMAND, unit="us"),
                      duration=float(TIME[-1] / 1e3), output_times=TIME / 1e3)
    return np.degrees(run["output_angle"]) + RNG.normal(0.0, 0.05, TIME.size)


ANGLE = [float(f"{value:.4f}") for value in _angles()]  # deg
MISSED = {7: "NaN", 8: "", 9: "NA", 10: "-", 11: "null"}


def written(header, separator=",", decimal=".", *, time=lambda t: str(t), command=lambda u: str(u),
            angle=lambda q: f"{q:.4f}", missing=MISSED.get, before="", between="", end="\n", more=""):
    """Return the log as a text."""
    rows = [header] if header else []
    for k, (t, u, q) in enumerate(zip(TIME.tolist(), COMMAND.tolist(), ANGLE, strict=True)):
        gap = missing(k)
        cells = [time(t), command(u), angle(q) if gap is None else gap]
        rows.append(separator.join(cell.replace(".", decimal) for cell in cells) + more)
        rows += [between] if between and k % 20 == 10 else []
    return before + end.join([*rows, ""])


def _stamp(t):
    return f"2024-05-03T12:00:{t / 1e3:06.3f}+02:00"


def _nan(k):
    return "nan" if k in MISSED else None


DIALECTS = {  # name -> content, columns
    "ours": (written("time_ms,pulse_width_us,output_angle_deg"), None),
    "semicolons, decimal commas": (written("Zeit [ms];Soll [us];Winkel [Grad]", ";", ",").encode("latin-1"), None),
    "tabs, CRLF": (written("t/ms\tcmd_us\tpos_deg", "\t", end="\r\n"), None),
    "blanks, a preamble": (written("millis pwm angle", " ", missing=_nan, before="Servo logger v1.2\nrate: 50 Hz\n\n"),
                           None),
    "comments between": (written("micros,target,deg", time=lambda t: str(1000 * t), before="# AS5600\n// 6 V\n",
                                 between="% still here"), None),
    "header in a comment": (written("# seconds, pulse, position", time=lambda t: f"{t / 1e3:.2f}"), None),
    "Latin-1, degree sign": (written("Time (ms);Pulse (us);Angle (°)", ";").encode("latin-1"), None),
    "UTF-16": (written("Time (ms),Pulse (us),Angle (°)").encode("utf-16"), None),
    "UTF-8 with a mark": (written("Time (ms),Pulse (µs),Angle (°)").encode("utf-8-sig"), None),
    "UTF-16 without a mark": (written("t,setpoint,pos").encode("utf-16-le"), None),
    "units below": (written("t;setpoint;pos\n[ms];[us];[deg]", ";"), None),
    "repeated header, too many separators": (written("ms,us,deg,", between="ms,us,deg,", more=","), None),
    "radians": (written("t_s,command_us,angle_rad", time=lambda t: f"{t / 1e3:.2f}",
                        angle=lambda q: f"{math.radians(q):.14g}"), None),
    "dates": (written("timestamp,pwm_us,angle_deg", time=_stamp), None),
    "times of day past midnight": (written("Uhrzeit;Impuls;Winkel", ";", time=lambda t: (
        f"23:59:59.{t:03}" if t < 1000 else f"00:00:00.{t - 1000:03}")), None),
    "nanoseconds since 1970": (written("%time,field.pwm,field.angle",
                                       time=lambda t: str(1494360095580806970 + 1_000_000 * t)), None),
    "quotes": (written('"Time, ms","PWM, us","Angle, deg"', '","', more='"').replace("\n", '\n"')[:-1], None),
    "reversed counts": (written("x,y,z", angle=lambda q: repr((90.0 - q) / 0.25)),
                        "time=x:ms command=y:us angle=z:-0.25deg+90"),
    "no header": (written(""), "time=1:ms command=2:us angle=3:deg"),
    "names with blanks": (written("Time since start;Servo out;Pot 1 (horn)", ";"),
                          "time=Time since start:ms command='Servo out':us angle=Pot 1 (horn):deg"),
}


def read(folder, content, columns=None, name="run"):
    path = folder / f"{name}.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_csv_log(path, columns=columns)


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_is_the_same_log(tmp_path, name):
    log = read(tmp_path, *DIALECTS[name])
    seen = np.array([math.nan if k in MISSED else math.radians(q) for k, q in enumerate(ANGLE)])
    np.testing.assert_allclose(log.time - log.time[0], TIME / 1e3, rtol=1e-12, atol=1e-12 * 1.2)
    np.testing.assert_allclose(log.command, COMMAND / 1e6, rtol=1e-12)
    np.testing.assert_allclose(log.measured["output_angle"], seen, rtol=1e-12, atol=1e-12)
    assert (log.command_kind, list(log.measured)) == ("pulse_width", ["output_angle"])


def test_every_dialect_is_the_same_fit(tmp_path):
    fits = {}
    for name, (content, columns) in DIALECTS.items():
        log = read(tmp_path, content, columns)
        bits = log.time.tobytes() + log.command.tobytes() + log.measured["output_angle"].tobytes()
        if bits not in fits:  # what is the same to the last bit is the same fit
            fits[bits] = identify([log], st.load_servo("hitec-hs-755hb"), st.BoundedServo,
                                  ["output_inertia", "output_coulomb_torque"], nuisance=(), priors=None, starts=1,
                                  compare_with=(), holdout=0.0), name
    assert len(fits) > 1
    first, _ = next(iter(fits.values()))
    for fit, name in fits.values():
        for key, value in fit.estimates.items():
            spread = math.sqrt(first.covariance.diagonal()[list(first.estimates).index(key)])
            assert abs(value - first.estimates[key]) < 1e-6 * spread, (name, key)


# ---------------------------------------------------------------------------------------- what is said

def body(angle="9.5", pwm="1500", time=lambda k: str(20 * k)):
    return "".join(f"{time(k)},{pwm},{angle}\n" for k in range(5))


@pytest.mark.parametrize(("header", "rows", "columns", "known"), [
    ("time_ms,pulse_width_us,output_angle_deg", body(), None, ["named", "named", "named"]),
    ("millis,pwm,angle", body(), None, ["guessed from its name", "guessed from its values, 1500 throughout",
                                        "guessed from its values, 9.5 throughout"]),
    ("time,pwm,angle", body(), None, ["guessed from its values, steps of 20",
                                      "guessed from its values, 1500 throughout",
                                      "guessed from its values, 9.5 throughout"]),
    ("t,pwm,adc", body("512"), "angle=adc:0.3deg-90", ["guessed from its values, steps of 20",
                                                       "guessed from its values, 1500 throughout", "--columns"]),
])
def test_how_it_was_known_is_kept(tmp_path, header, rows, columns, known):
    log = read(tmp_path, f"{header}\n{rows}", columns)
    assert [one.known for one in log.reading.columns] == known
    assert str(log.reading).splitlines()[0].split() == ["column", "signal", "unit", "known"]


@pytest.mark.parametrize(("column", "values", "signal", "factor"), [
    ("current", "500", "supply_current", 1e-3), ("mA", "500", "supply_current", 1e-3),
    ("amps", "0.5", "supply_current", 1),
    ("Strom (mA)", "500", "supply_current", 1e-3), ("i", "0.25", "supply_current", 1),
    ("motor_current_mA", "500", "armature_current", 1e-3), ("voltage", "6.1", "bus_voltage", 1),
    ("vbat", "6100", "bus_voltage", 1e-3), ("Spannung [V]", "6.1", "bus_voltage", 1),
    ("speed deg/s", "50", "output_speed", math.pi / 180), ("pot_mV", "800", None, None), ("temp", "25", None, None),
    ("error_deg", "3", None, None), ("current", "3", None, None),
])
def test_what_else_was_measured(tmp_path, column, values, signal, factor):
    rows = "".join(f"{20 * k},1500,9.5,{values}\n" for k in range(5))
    log = read(tmp_path, f"millis,pwm,angle,{column}\n{rows}")
    assert set(log.measured) - {"output_angle"} == ({signal} if signal else set())
    if signal:
        np.testing.assert_allclose(log.measured[signal], float(values) * factor, rtol=1e-12)
    else:
        assert log.reading.unread == (column,)


@pytest.mark.parametrize(("pwm", "unit", "kind"), [
    ("pwm", "us", "pulse_width"), ("target_us", "us", "pulse_width"), ("cmd_deg", "deg", "angle"),
    ("Sollwinkel (°)", "deg", "angle"), ("setpoint_V", "V", "voltage"), ("goal_position [rad]", "rad", "angle"),
])
def test_the_kind_of_a_command_follows_its_unit(tmp_path, pwm, unit, kind):
    log = read(tmp_path, f"millis,{pwm},angle_deg\n" + body(pwm="1500" if unit == "us" else "1.5"))
    assert (log.command_kind, log.reading.columns[1].unit) == (kind, unit)


def test_a_row_that_does_not_end_is_left_out_and_that_is_said(tmp_path):
    log = read(tmp_path, "millis,pwm,angle\n" + body() + "100,1500,-11")
    assert len(log) == 5
    assert log.reading.remarks == ("line 7 does not end in a newline and was left out",)
    torn = read(tmp_path, ("millis,pwm,Winkel (°)\n" + body() + "100,1500,9 °").encode()[:-1])
    assert len(torn) == 5  # torn within a character


@pytest.mark.parametrize(("content", "columns", "words"), [
    ("a,b,c\n" + body(), None, ("a, b, c", '--columns "time=a:ms command=b:us angle=c:deg"')),
    (body(), None, ("no header, 3 columns", '--columns "time=1:ms command=2:us angle=3:deg"')),
    ("millis,pwm,adc\n" + body("512"), None, ("column adc holds counts", "512", '--columns "angle=adc:0.3deg-90"')),
    ("millis,pwm,pot\n" + body("512"), None, ("column pot holds counts",)),
    ("millis,pwm,angle\n" + body("0.5"), None, ("unit of column angle is not known", "0.5", "deg or rad")),
    ("millis,pwm,angle\n" + body("2048"), None, ("unit of column angle is not known", "2048")),
    ("millis,pwm,angle\n" + body(pwm="120"), None, ("unit of column pwm is not known", "120", "4.88us")),
    ("millis,cmd,angle\n" + body(pwm="1.5"), None, ("unit of column cmd is not known", "us, ms, deg or rad")),
    ("t,pwm,angle\n" + body(time=lambda k: str(300 * k)), None, ("unit of column t is not known", "s, ms or us")),
    ("millis,pwm,angle_kg\n" + body(), None, ("unit of column angle_kg", "'kg'", "deg or rad")),
    ("millis,pwm,angle [furlong]\n" + body(), None, ("angle [furlong]", "'furlong'")),
    ("millis,pwm,angle,pos\n" + body("9,8"), None, ("angle and pos", "angle=angle")),
    ("millis,pwm,angle,angle\n" + body("9,8"), None, ("angle 2 times", "once")),
    ("millis,pwm\n" + "0,1500\n20,1500\n", None, ("no measured angle",)),
    ("t,pwm,angle\n0,00,1500,12,5\n0,02,1500,13,5\n", None, ("line 2", "5 cells", "decimal commas need another")),
    ("t;pwm;angle\n0,00;1500;12.5\n0,02;1500;13,5\n", None, ("line 2, angle", "'12.5'", "decimal comma")),
    ("t;pwm;angle\n0.00;1500;12.5\n0.02,1500,13.5\n0.04;1500;9\n", None, ("line 3", "1 cell", "semicolons")),
    ("millis,pwm,angle\n" + body() + "0,1500,9\n", None, ("line 7, millis", "runs backwards")),
    ("millis,pwm,angle\n0,1500,9\n", None, ("1 sample", "at least 3")),
    ("millis,pwm,angle\n0,1500,9", None, ("header without rows", "ends in a newline")),
    ("millis,pwm,angle\n0,1500,9\n20,1500\n40,1500,9\n", None, ("line 3", "2 cells", "3, as the header")),
    ("millis,pwm,angle\n0,1500,9\n20,15_00,9\n40,1500,9\n", None, ("line 3, pwm", "'15_00'")),
    ("timestamp,pwm,angle\n2024-05-03T12:00:00Z,1500,9\n2024-05-03T12:00:01,1500,9\n", None, ("line 3", "time zone")),
    ("timestamp,pwm,angle\nMay 3 12:00:00,1500,9\nMay 3 12:00:01,1500,9\n", None, ("line 2, timestamp",)),
    ("ms,servo,angle\n" + "".join(f"{20 * k},{90 + k},{90 + k}\n" for k in range(9)), None, ("command=servo:deg",)),
    ("ms,servo,angle\n" + "".join(f"{20 * k},{90 + k},{90 + k}\n" for k in range(9)), "command=servo:us",
     ("98 us at most", "degrees or ticks")),
    ("min:0\tmax:180\tpwm:1500\tangle:9\n" * 5, None, ("no time", "--rate 50Hz")),
    ("timestamp,pwm,angle\n2024-05-03T12:00:00,1500,9\nsoon,1500,9\n", None, ("line 3, timestamp", "'soon'", "dates")),
    (b"PK\x03\x04" + b"\0" * 50, None, ("Excel workbook",)), (b"\x89PNG\r\n", None, ("a picture",)),
    (bytes(range(1, 32)) * 9, None, ("binary data",)),
    ("millis,pwm,angle\n" + body(), "angle=pos:deg", ("column of output_angle", "'pos'", "millis, pwm, angle")),
    ("millis,pwm,angle\n" + body(), "angel=angle:deg", ("'angel'", "did you mean 'angle'")),
    ("millis,pwm,angle\n" + body(), "angle=angle:us", ("--columns output_angle=angle", "'us'", "deg, rad")),
    ("millis,pwm,angle\n" + body(), "angle=angle:furlong", ("'furlong'", "0.3deg-90")),
    ("millis,pwm,angle\n" + body(), "angle=angle:0deg", ("'0deg'", "not 0")),
    ("millis,pwm,angle\n" + body(), "command=pwm:kg", ("'kg'", "us, ms, s (pulse width)")),
    ("millis,pwm,angle\n" + body(), "angle=angle:deg angle=pwm:deg", ("output_angle twice",)),
    ("millis,pwm,angle\n" + body(), "pulse=pwm:us command=pwm:us", ("command and pulse_width", "one command")),
    ("millis,pwm,angle\n" + body(), "angle", ("--columns", "'angle'", "SIGNAL=COLUMN:UNIT")),
    ("millis,pwm,angle\n" + body(), "", ("--columns", "nothing")),
    ("millis,pwm,angle\n" + body(), 3, ("--columns", "3", "SIGNAL=COLUMN:UNIT")),
    ("millis,pwm,angle\n" + body(), "pulse=angle:us angle=angle:deg", ("column angle", "one of both")),
    ("millis,pwm,angle\n" + body(), "time=millis:iso", ("line 2, millis", "dates")),
])
def test_what_cannot_be_told_is_asked_for_in_one_line(tmp_path, content, columns, words):
    with pytest.raises(InputError) as caught:
        read(tmp_path, content, columns)
    text = str(caught.value)
    assert text.isprintable()
    assert all(word in text for word in words), text


# ---------------------------------------------------------------------------------------- what is kept

def test_what_was_said_is_kept_and_need_not_be_said_again(tmp_path):
    words = {"angle": "adc:300/1023deg-150", "time": "x"}
    path = tmp_path / "run.csv"
    path.write_text("x,pwm,adc\n" + "".join(f"{20 * k},1500,{512 + k}\n" for k in range(5)))
    (tmp_path / "run.json").write_text('{"format": "servotwin-log-1", "motion": "step"}')
    first = read_logs(path, columns={**words, "time": "x:ms"})
    assert keep_columns(first) == [tmp_path / "run.json"]
    assert json.loads((tmp_path / "run.json").read_text())["motion"] == "step"
    again = read_logs(path)
    assert [one.known for one in again[0].reading.columns] == ["sidecar"] * 3
    for name in ("time", "command"):
        assert getattr(again[0], name).tobytes() == getattr(first[0], name).tobytes()
    assert again[0].measured["output_angle"].tobytes() == first[0].measured["output_angle"].tobytes()
    before = (tmp_path / "run.json").read_bytes()
    assert keep_columns(read_logs(path, columns={"time": "x:ms"})) == []
    other = read_logs(path, columns={"angle": "adc:0.3deg"})
    with pytest.raises(InputError, match=r"output_angle: got 'adc:0.29.*deg-150 there, adc:0.3deg here'.*--force"):
        keep_columns(other)
    assert (tmp_path / "run.json").read_bytes() == before
    assert keep_columns(other, overwrite=True) == [tmp_path / "run.json"]
    assert json.loads((tmp_path / "run.json").read_text())["columns"]["output_angle"] == {
        "column": "adc", "unit": "deg", "scale": 0.3}


def test_logs_of_one_folder_share_what_was_said(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("x,pwm,angle\n" + body())
    logs = read_logs(tmp_path, columns="time=x:ms")
    assert keep_columns(logs, tmp_path) == [tmp_path / "logs.json"]
    assert [log.time.tobytes() for log in read_logs(tmp_path)] == [log.time.tobytes() for log in logs]
    assert keep_columns(read_logs(tmp_path), tmp_path) == []  # nothing was said


def test_refusals_name_the_way_on(tmp_path):
    """Counts are proposed as counts, a command is none of what grows, and a tap in volts is a feedback."""
    path = tmp_path / "log.csv"
    bare = "".join(f"{20 * k},{1500 + 400 * (k > 20)},{300 + 4 * min(max(k - 20, 0), 40)}\n" for k in range(80))

    def refused(text, words=None):
        path.write_text(text)
        with pytest.raises(InputError) as caught:
            read_logs(path, columns=words)
        return str(caught.value)

    said = refused(bare)
    assert 'time=1:ms command=2:us angle=3:0.3deg-90", with what one of its counts is' in said
    assert read_logs(path, columns="time=1:ms command=2:us angle=3:0.3deg-90")[0].command_kind == "pulse_width"
    assert 'angle=3:deg"' in refused("".join(f"{20 * k},1500,{k % 9}\n" for k in range(80)))
    assert '"command=a:us angle=b:deg"' in refused("time_ms,a,b\n" + "".join(
        f"{20 * k},1500,{1 + k % 7}\n" for k in range(40)))
    assert "feedback=tap:V is the tap of a potentiometer" in refused(
        "time_ms,pulse_us,tap\n" + "".join(f"{20 * k},1500,{0.01 * k}\n" for k in range(40)), "angle=tap:V")
    assert "line 41, column 3: got 'x'" in refused("".join(
        f"{20 * k},1500,{'x' if k == 40 else k}\n" for k in range(80)), "time=1:ms command=2:us angle=3:deg")


def test_a_pulse_by_its_number_is_no_time_where_there_is_one(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time_ms,a,b\n" + "".join(f"{20 * k},1500,{1 + k % 7}\n" for k in range(40)))
    (log,) = read_logs(path, columns=with_signals("--columns", "2:us 3:deg"))
    assert log.command_kind == "pulse_width"
    assert with_signals("--columns", "1:us 2:us 3:deg") == "time=1:us pulse=2:us angle=3:deg"
    assert with_signals("--columns", "1:us") == "time=1:us"
