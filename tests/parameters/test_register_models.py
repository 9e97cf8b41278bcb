"""Each model of bus servo has the registers of its own page; what no page prints is assumed, and says so."""

import math

import pytest

import servotwin as st
from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters import REGISTER_FAMILIES, catalog_names, load_servo
from servotwin.parameters.registers.dynamixel_one import MX_REGISTERS
from servotwin.parameters.registers.dynamixel_x import REGISTERS as X_REGISTERS
from servotwin.parameters.registers.dynamixel_x import family_of
from servotwin.parameters.registers.listing import listed_models, rows_of

COUNT = 2.0 * math.pi / 4096.0
RPM = math.pi / 30.0
# D, I and P of the position, I and P of the velocity, limits of velocity, voltage (most, least) and current, of the
# control tables in the e-manual (github.com/ROBOTIS-GIT/emanual, docs/en/dxl)
PRINTED = {
    "XL330-M288": (0, 0, 400, 1600, 180, 445, 70, 35, 1750), "XL330-M077": (0, 400, 400, 400, 40, 1620, 70, 35, 1750),
    "XC330-M288": (500, 0, 1100, 1600, 50, 350, 70, 35, 2352),
    "XC330-M181": (500, 0, 1200, 1400, 100, 545, 70, 35, 2352),
    "XC330-T288": (0, 0, 900, 1200, 40, 320, 140, 55, 910), "XC330-T181": (0, 0, 900, 1200, 40, 510, 140, 55, 910),
    "XL430-W250": (4000, 0, 640, 1000, 100, 265, 140, 60, None),
    "2XL430-W250": (2000, 0, 640, 1800, 100, 250, 140, 60, None),
    "XC430-W150": (0, 0, 460, 1920, 100, 460, 160, 60, None),
    "XC430-W240": (0, 0, 700, 1920, 100, 306, 160, 60, None), "XM430-W350": (0, 0, 800, 1920, 100, 200, 160, 95, 1193),
    "XM430-W210": (0, 0, 800, 1920, 100, 330, 160, 95, 1193), "XM540-W270": (0, 0, 800, 1920, 100, 128, 160, 95, 2047),
    "XM540-W150": (0, 0, 800, 1920, 100, 230, 160, 95, 2047), "XH430-W350": (0, 0, 900, 1920, 100, 130, 160, 95, 648),
    "XH430-W210": (0, 0, 900, 1920, 100, 210, 160, 95, 648), "XH430-V350": (0, 0, 800, 1920, 100, 135, 300, 110, 689),
    "XH540-W270": (0, 0, 800, 1920, 100, 167, 160, 95, 2047), "XH540-W150": (0, 0, 800, 1920, 100, 300, 160, 95, 2047),
    "XH540-V150": (0, 0, 800, 1920, 100, 230, 300, 110, 1188), "MX-28(2.0)": (0, 0, 850, 1920, 100, 230, 160, 95, None),
}
NAMES = ("Position_D_Gain", "Position_I_Gain", "Position_P_Gain", "Velocity_I_Gain", "Velocity_P_Gain",
         "Velocity_Limit", "Max_Voltage_Limit", "Min_Voltage_Limit", "Current_Limit")


@pytest.mark.parametrize("model", PRINTED)
def test_the_x_series_is_as_each_page_prints_it(model):
    family = family_of(st.servo_from_values("a", {}, title=f"Dynamixel {model}"))
    assert family.model == model
    for name, value in zip(NAMES, PRINTED[model], strict=True):
        if value is None:
            assert name not in family.registers
        else:
            assert family.registers[name].factory == value, name
            assert model in family.document(name), name


@pytest.mark.parametrize(("model", "registers", "expected"), [
    ("XC330-M288", {}, {"proportional_gain": 1100 / (256 * 885 * COUNT),
                        "derivative_gain": 500e-3 / (32 * 885 * COUNT)}),
    ("XC330-M288", {"Operating_Mode": 5, "Current_Limit": 2352}, {"current_limit": 2.352, "current_sense": "bus"}),
    ("XC330-T288", {}, {"proportional_gain": 900 / (256 * 885 * COUNT), "duty_slew": 255 * 3.955 / 12.0}),
    ("XH430-V350", {"Operating_Mode": 5}, {"current_limit": 689 * 1.34e-3, "current_sense": "motor"}),
    ("MX-64(2.0)", {"Operating_Mode": 5}, {"current_limit": 1941 * 3.36e-3}),
    ("XC430-W150", {}, {"proportional_gain": 460 / (128 * 885 * COUNT), "derivative_gain": 0.0}),
])
def test_what_follows_is_the_models_own(model, registers, expected):
    servo = st.servo_from_values("a", {"supply": {"open_circuit_voltage": 12.0}}, title=model)
    firmware = st.dynamixel_x(registers, servo=servo).firmware
    for name, value in expected.items():
        assert getattr(firmware, name) == (pytest.approx(value, rel=1e-12) if isinstance(value, float) else value), name


@pytest.mark.parametrize(("model", "register", "value"), [
    ("XL330-M288", "Current_Limit", 1751), ("XC330-M288", "Current_Limit", 2353),
    ("XL330-M288", "Max_Voltage_Limit", 71),
    ("XM430-W350", "Velocity_Limit", 1024), ("XL430-W250", "Current_Limit", 5)])
def test_a_value_beyond_the_models_own_range_is_refused(model, register, value):
    with pytest.raises((ParameterError, UnknownNameError), match=register):
        st.dynamixel_x({register: value}, servo=st.servo_from_values("a", {}, title=model))


def test_the_mx_and_ax_series_differ_by_model_too():
    wheel = st.dynamixel_mx({"Moving_Speed": 100}, servo=st.servo_from_values("mx-12w", {}))
    assert wheel.firmware.speed_limit == pytest.approx(91.6 * RPM)
    assert wheel.firmware.proportional_gain == pytest.approx(8 / (2 * math.pi))
    assert wheel.firmware.minimum_duty == pytest.approx(32 / 1023)
    strong = st.dynamixel_ax({}, servo=st.servo_from_values("ax-18a", {}))
    assert strong.firmware.torque_limit == pytest.approx(983 / 1023)
    assert strong.firmware.trip_temperature == pytest.approx(348.15)


def test_of_a_series_alone_what_differs_within_it_is_assumed():
    servo = st.dynamixel_x({}, servo=st.servo_from_values("my-xc330", {}))
    gain = servo.source("firmware.proportional_gain")
    assert gain.origin == "assumed"
    assert "Position_P_Gain (84) = 1100 assumed" in gain.source
    assert servo.source("firmware.upper_goal").origin == "literature"  # all of them have 4095
    told = st.dynamixel_x({"Model_Number": 1220}, servo=st.servo_from_values("my-xc330", {}))
    assert told.firmware.proportional_gain == pytest.approx(900 / (256 * 885 * COUNT))


def test_of_a_servo_that_tells_no_model_everything_is_assumed():
    servo = st.dynamixel_x({}, servo=st.servo_from_values("mine", {}))
    made = [name for name in servo.names() if name.startswith("firmware.")]
    of_registers = [name for name in made if "register" in servo.source(name).source]
    assert {servo.source(name).origin for name in of_registers} == {"assumed"}
    assert not any("e-manual" in servo.source(name).source for name in made)


def test_what_was_written_is_not_assumed_and_what_was_assumed_stays_so(tmp_path):
    """The provenance of a register goes through a file, and through a second call."""
    fast = st.feetech_sts({"Acceleration": 50}, servo="feetech-sts3250")
    limit = fast.source("firmware.acceleration_limit")
    assert (limit.origin, limit.value) == ("assumed", pytest.approx(5000 * COUNT))
    assert "Acceleration (41) = 50, Maximum_Acceleration (85) = 100 assumed" in limit.source
    fast.save(tmp_path / "fast.toml")
    known = st.feetech_sts({"Maximum_Acceleration": 254, "Acceleration_Multiplier": 1}, servo=tmp_path / "fast.toml")
    assert known.source("firmware.acceleration_limit").origin == "literature"
    assert st.feetech_sts({"P_Coefficient": 32}, servo="feetech-sts3250").source(
        "firmware.proportional_gain").origin == "literature"


def test_the_servos_of_the_catalog_have_a_page():
    """Of the STS3250 alone the page of its series leaves numbers open."""
    for name in catalog_names():
        servo = load_servo(name)
        family = servo.sheet.get("registers")
        if family is None:
            continue
        guessed = [key for key in servo.names() if " assumed" in (servo.source(key).source or "")
                   and servo.source(key).origin == "assumed" and key.startswith("firmware.")]
        assert bool(guessed) is (name == "feetech-sts3250"), (name, guessed)


def test_every_row_of_the_tables_has_a_page_or_is_assumed():
    names = [(model.family, model.name) for model in listed_models()]
    assert len(names) == len(set(names)) >= 38
    assert {family for family, _ in names} == set(REGISTER_FAMILIES)
    for model in listed_models():
        rows = rows_of(model)
        assert model.assumed == sum(not row.document for row in rows)
        assert model.rows == len(rows) > 15
        for row in rows:
            assert row.lower <= row.value <= row.upper, (model.name, row.name)
            assert bool(row.document) or row.page == ""
        assert bool(model.page) is any(row.document for row in rows)
    assert {"Present_Position", "Moving"} & {row.name for model in listed_models() for row in rows_of(model)} == set()
    assert X_REGISTERS["Present_Position"].reading
    assert MX_REGISTERS["Present_Load"].reading


def test_where_no_page_was_seen_all_rows_are_assumed():
    unseen = {model.name for model in listed_models() if model.assumed == model.rows}
    assert unseen == {"2XC430-W250", "XH540-V270", "XW540-T140", "AX-12W"}


@pytest.mark.parametrize("gripper", [False, True])
def test_lerobots_registers_are_a_named_set(gripper):
    """As so_follower.py writes them when it connects."""
    own = {"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32, "Maximum_Acceleration": 254,
           "Acceleration": 254}
    own |= {"Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25} if gripper else {}
    by_name = st.feetech_sts("lerobot-gripper" if gripper else "lerobot", servo="feetech-sts3215-7v4")
    by_hand = st.feetech_sts(own, servo="feetech-sts3215-7v4")
    assert by_name.firmware == by_hand.firmware
    assert by_name.firmware.torque_limit == (0.5 if gripper else 1.0)


@pytest.mark.parametrize(("change", "servo", "name", "error", "said"), [
    (st.feetech_sts, "feetech-sts3215-12v", "lerobo", UnknownNameError, "set of registers of Feetech STS 'lerobo'"),
    (st.feetech_sts, "feetech-sts3215-12v", "", UnknownNameError, "set of registers"),
    (st.dynamixel_x, "dynamixel-xl330-m288", "lerobot", UnknownNameError, "lerobot-elbow"),
    (st.dynamixel_mx, "dynamixel-mx-64", "lerobot", ParameterError, "this family has no named sets")])
def test_an_unknown_set_is_refused(change, servo, name, error, said):
    with pytest.raises(error, match=said):
        change(name, servo=servo)
