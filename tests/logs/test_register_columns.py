"""Columns named after the registers of a bus servo: their raw numbers become angles, speeds, currents and voltages."""

import math
from pathlib import Path

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, UnknownNameError
from servotwin.logs import keep_columns, read_logs
from servotwin.logs.register_columns import raw_registers, register_named
from servotwin.parameters.registers.listing import listed_models, register_words

STS, XM430 = "feetech-sts3215-7v4", "dynamixel-xm430-w350"
ROWS = 400
TIME = 0.01 * np.arange(ROWS)
WAVE = np.sin(2.0 * math.pi * TIME)  # of 40 deg, at most 251 deg/s
GOAL = 2048 + np.round(455.0 * WAVE).astype(int)
POSITION = 2048 + np.round(455.0 * np.roll(WAVE, 3)).astype(int)
SPEED = np.round(2560.0 * np.cos(2.0 * math.pi * TIME)).astype(int)  # counts/s: 225 deg/s
CURRENT, LOAD = np.round(100.0 * WAVE).astype(int), np.round(500.0 * WAVE).astype(int)


def with_sign_bit(values, bit):
    return np.where(values < 0, -values + (1 << bit), values)


def two(values, bits):
    return np.where(values < 0, values + (1 << bits), values)


def write(path, **columns):
    rows = zip(*(np.broadcast_to(values, ROWS).tolist() for values in columns.values()), strict=True)
    Path(path).write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows), ""]), "utf-8")
    return path


def sts(path, spell=lambda name: name, **more):
    """A poll of an STS, bytes as they come."""
    raw = {"Goal_Position": GOAL, "Present_Position": POSITION, "Present_Speed": with_sign_bit(SPEED, 15),
           "Present_Load": with_sign_bit(LOAD, 10), "Present_Voltage": 74, "Present_Temperature": 31,
           "Present_Current": with_sign_bit(CURRENT, 15), "Moving": 1}
    return write(path, t=TIME, **{spell(name): values for name, values in (raw | more).items()})


def units_of(log):
    return {one.signal: one.unit for one in log.reading.columns}


@pytest.mark.parametrize("registers", ["feetech-sts", "STS3215-12V", STS])
@pytest.mark.parametrize("spell", [str, str.lower, lambda name: name.replace("_", " "), lambda name: name.replace(
    "_", "")], ids=["Present_Position", "present_position", "Present Position", "PresentPosition"])
def test_an_sts_has_its_counts_signs_and_steps(tmp_path, spell, registers):
    said = st.load_servo(registers) if registers == STS else registers
    log = read_logs(sts(tmp_path / "raw.csv", spell), registers=said)[0]
    assert log.command_kind == "angle"
    np.testing.assert_allclose(np.degrees(log.command), (GOAL - 2048) * 360.0 / 4096.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(np.degrees(log.measured["output_angle"]), (POSITION - 2048) * 360.0 / 4096.0, rtol=0.0,
                               atol=1e-9)
    np.testing.assert_allclose(np.degrees(log.measured["output_speed"]), SPEED * 360.0 / 4096.0, rtol=0.0, atol=1e-9)
    assert np.degrees(log.measured["output_speed"]).max() == pytest.approx(225.0)
    assert np.degrees(log.measured["output_speed"]).min() == pytest.approx(-225.0)
    np.testing.assert_allclose(log.measured["armature_current"], 6.5e-3 * CURRENT, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log.measured["duty"], 1e-3 * LOAD, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log.measured["bus_voltage"], 7.4, rtol=1e-14)
    np.testing.assert_allclose(log.measured["housing_temperature"], 304.15, rtol=1e-14)
    assert log.reading.unread == (spell("Moving"),)
    known = {one.known for one in log.reading.columns if one.signal != "time"}
    assert known == {"register of STS3215-7V4" if registers == STS else f"--registers {registers}"}


@pytest.mark.parametrize(("registers", "step", "signal"), [
    ("XM430-W350", 2.69e-3, "armature_current"), ("XL330-M288", 1e-3, "supply_current"),
    ("MX-106(2.0)", 3.36e-3, "armature_current")])
@pytest.mark.parametrize("decoded", [True, False])
def test_a_dynamixel_x_has_its_own_current_and_twos_complements(tmp_path, registers, step, signal, decoded):
    turns, ticks = POSITION - 4096, np.round(50.0 * WAVE).astype(int)
    position, speed, current, pwm = (values if decoded else two(values, bits) for values, bits in (
        (turns, 32), (ticks, 32), (CURRENT, 16), (LOAD, 16)))
    log = read_logs(write(tmp_path / "raw.csv", t=TIME, Goal_Position=GOAL, Present_Position=position, Present_PWM=pwm,
                          Present_Velocity=speed, Present_Current=current, Present_Input_Voltage=119, Realtime_Tick=7),
                    registers=registers)[0]
    np.testing.assert_allclose(np.degrees(log.measured["output_angle"]), (turns - 2048) * 360.0 / 4096.0, rtol=0.0,
                               atol=1e-9)
    np.testing.assert_allclose(log.measured["output_speed"], ticks * 0.229 * math.pi / 30.0, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log.measured[signal], step * CURRENT, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log.measured["duty"], LOAD / 885.0, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(log.measured["bus_voltage"], 11.9, rtol=1e-14)
    assert log.reading.unread == ("Realtime_Tick",)


def test_speeds_of_an_sts_have_the_step_that_its_phase_says(tmp_path):
    """50 counts/s where bit 2 is not set, as the bench has it."""
    slow = st.feetech_sts({"Phase": 8, "Goal_Velocity": 60}, servo=STS)
    one, other = (read_logs(sts(tmp_path / "raw.csv", Present_Speed=40), registers=servo)[0].measured["output_speed"][0]
                  for servo in (st.load_servo(STS), slow))
    assert (one, other) == pytest.approx((math.radians(40 * 360.0 / 4096.0), math.radians(2000 * 360.0 / 4096.0)))


def test_the_load_of_a_dynamixel_is_no_duty(tmp_path):
    path = write(tmp_path / "raw.csv", t=TIME, Goal_Position=GOAL, Present_Position=POSITION, Present_Load=LOAD)
    log = read_logs(path, registers="XL430-W250")[0]
    assert (set(log.measured), log.reading.unread) == ({"output_angle"}, ("Present_Load",))


def test_of_a_family_alone_a_step_that_differs_within_it_is_not_read_and_not_guessed(tmp_path):
    """The current of an X servo would be 1 to 3.36 mA a count; values up to 100 look like milliamperes."""
    path = write(tmp_path / "raw.csv", t=TIME, Goal_Position=GOAL, Present_Position=POSITION, Present_Current=CURRENT)
    log = read_logs(path, registers="dynamixel-x")[0]
    assert set(log.measured) == {"output_angle"}
    assert log.reading.unread == ("Present_Current",)
    other = read_logs(sts(tmp_path / "other.csv"), registers="dynamixel-x")[0]
    assert {"Present_Speed", "Present_Voltage", "Present_Current"} < set(other.reading.unread)  # names of an STS


@pytest.mark.parametrize(("registers", "middle", "count", "rpm"), [
    ("dynamixel-ax", 512, 300.0 / 1023.0, 0.111), ("dynamixel-xl320", 512, 300.0 / 1023.0, 0.111),
    ("MX-28", 2048, 360.0 / 4096.0, 0.114), ("MX-12W", 2048, 360.0 / 4096.0, 0.916)])
def test_the_older_dynamixels_have_their_own_counts_and_a_sign_in_bit_10(tmp_path, registers, middle, count, rpm):
    ticks = np.round(400.0 * WAVE).astype(int)
    path = write(tmp_path / "raw.csv", t=TIME, Goal_Position=middle + ticks, Present_Position=middle + ticks,
                 Present_Speed=with_sign_bit(ticks, 10), Present_Voltage=111)
    log = read_logs(path, registers=registers)[0]
    np.testing.assert_allclose(np.degrees(log.command), ticks * count, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(log.measured["output_speed"], ticks * rpm * math.pi / 30.0, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("columns", "families"), [
    ((), ["feetech-sts"]), (("Present_Current", "Present_Load"), ["feetech-sts", "dynamixel-mx"]),
    (("Present_Speed", "Present_Current", "Present_Load", "Present_Voltage", "Present_Temperature", "Moving"),
     ["feetech-sts", "dynamixel-x", "dynamixel-mx"])])
def test_where_nobody_says_whose_they_are_it_is_asked(tmp_path, columns, families):
    path = sts(tmp_path / "raw.csv")
    table = np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding="utf-8")
    left = {name: table[name] for name in table.dtype.names if name not in columns}
    for servo in (None, st.load_servo("hitec-hs-755hb")):
        with pytest.raises(InputError, match="names of registers of a bus servo, and counts") as asked:
            read_logs(write(path, **left), registers=servo)
        assert f"--registers {' or '.join(families)}, or a model" in str(asked.value)


@pytest.mark.parametrize(("scale", "asked"), [(40.5, False), (40.0, True)])
def test_what_may_be_degrees_is_no_count_of_the_servos_registers(tmp_path, scale, asked):
    """Broken numbers are degrees, as they were; whole ones that are small could be either."""
    angles = np.round(scale * WAVE, 1 if scale % 1.0 else 0)
    path = write(tmp_path / "run.csv", t=TIME, Goal_Position=angles, Present_Position=angles)
    if asked:
        with pytest.raises(InputError, match=r"Present_Position: got 'whole numbers up to 40'.*Present_Position:deg"):
            read_logs(path, registers=st.load_servo(STS))
    log = read_logs(path, registers=None if asked else st.load_servo(STS))[0]
    np.testing.assert_allclose(np.degrees(log.measured["output_angle"]), angles, rtol=0.0, atol=1e-9)
    said = read_logs(path, registers=st.load_servo(STS), columns="command=Goal_Position:deg angle=Present_Position:deg")
    assert units_of(said[0])["output_angle"] == "deg"


@pytest.mark.parametrize(("change", "message"), [
    ({"Present_Voltage": 7.4}, r"line 2, Present_Voltage: got '7.4', allowed: a whole number from 0 to 255"),
    ({"Present_Load": 5000}, r"Present_Load: got '5000', allowed: a whole number from -1023 to 2047"),
    ({"present position": 2048}, "register Present_Position: got 'columns Present_Position and present position'")])
def test_what_a_register_cannot_hold_is_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        read_logs(sts(tmp_path / "raw.csv", **change), registers="feetech-sts")


@pytest.mark.parametrize(("name", "got"), [("run.json", "JSON"), ("dataset", "a dataset .lerobot.")])
def test_only_tables_have_registers(tmp_path, name, got):
    (tmp_path / "dataset" / "meta").mkdir(parents=True)
    (tmp_path / "dataset" / "meta" / "info.json").write_text('{"codebase_version": "v2.1"}')
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match=f"--registers for .*: got '{got}', allowed: tables"):
        read_logs(tmp_path / name, registers="feetech-sts")


def test_a_column_that_is_said_counts_before_its_register(tmp_path):
    path = sts(tmp_path / "raw.csv", Present_Voltage=7.4)
    log = read_logs(path, registers="feetech-sts", columns="voltage=Present_Voltage:V")[0]
    np.testing.assert_allclose(log.measured["bus_voltage"], 7.4, rtol=1e-14)
    assert units_of(log)["armature_current"] == "6.5mA"


def test_a_sidecar_keeps_what_was_said_with_its_signs(tmp_path):
    path = sts(tmp_path / "raw.csv")
    log = read_logs(path, registers="feetech-sts")[0]
    assert keep_columns([log]) == [tmp_path / "raw.json"]
    again = read_logs(path)[0]
    assert {one.known for one in again.reading.columns} == {"sidecar"}
    for name, values in log.measured.items():
        np.testing.assert_array_equal(again.measured[name], values, name)
    assert keep_columns(read_logs(sts(tmp_path / "other.csv"), registers=st.load_servo(STS))) == []  # said by nobody


@pytest.mark.parametrize(("sign_bit", "message"), [("0", "from 1 to 64"), ("true", "from 1 to 64"), ("1.5", "from 1")])
def test_a_sidecar_with_a_sign_that_is_none_is_refused(tmp_path, sign_bit, message):
    path = sts(tmp_path / "raw.csv")
    path.with_suffix(".json").write_text('{"format": "servotwin-log-1", "columns": {"output_angle": {"column": '
                                         f'"Present_Position", "unit": "deg", "sign_bit": {sign_bit}}}}}}}')
    with pytest.raises(InputError, match=rf"output_angle, sign_bit: got .*, allowed: a whole number {message}"):
        read_logs(path)


def test_every_model_tells_position_voltage_and_temperature():
    """And what each of them means can be read from its table."""
    names = {"Present_Position", "Present_Temperature"}
    for word in (*register_words(), *(model.name for model in listed_models())):
        family = raw_registers(word).family
        assert all(family.registers[name].unit for name in names), word
        assert {register_named(family, name) for name in names} == names
        assert family.registers["Present_Position"].unit == "count"
    with pytest.raises(UnknownNameError, match="did you mean 'XM430-W350'"):
        raw_registers("XM430-W35")
