"""Registers of bus servos: each becomes the number of the firmware that its maker's tables and its recordings say."""

import math
import re

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters import ORIGINS, REGISTER_FAMILIES

COUNT = 2.0 * math.pi / 4096.0
T_c = 1e-3
STS, XL330, XL430, MX, AX = ("feetech-sts3215-12v", "dynamixel-xl330-m288", "dynamixel-xl430-w250", "dynamixel-mx-64",
                             "dynamixel-ax-12a")
RPM = math.pi / 30.0


def check(change, servo, registers, expected):
    firmware = change(registers, servo=servo).firmware
    for name, value in expected.items():
        found = getattr(firmware, name)
        assert found == (pytest.approx(value, rel=1e-14, abs=0.0) if isinstance(value, float) else value), name


# -- what each register becomes

@pytest.mark.parametrize(("registers", "expected"), [
    ({"P_Coefficient": 16}, {"proportional_gain": 16 / (4000 * COUNT)}),
    ({"P_Coefficient": 1}, {"proportional_gain": 1 / (4000 * COUNT)}),
    ({"D_Coefficient": 40}, {"derivative_gain": 40 * 20 * T_c / (8000 * COUNT), "derivative_ticks": 20.0}),
    ({"D_Coefficient": 40, "DTs": 10}, {"derivative_gain": 40 * 10 * T_c / (8000 * COUNT), "derivative_ticks": 10.0}),
    ({"I_Coefficient": 5, "Integral_Limit": 50},
     {"integral_gain": 5 / (500 * 1000 * COUNT * T_c), "integral_limit": 0.2, "anti_windup": 1000 * COUNT,
      "integral_at_rest": "yes", "rest_travel": 2 * COUNT}),
    ({"I_Coefficient": 5, "Moving_Velocity_Threshold": 0},
     {"integral_gain": 0.0, "integral_at_rest": None, "rest_travel": None, "derivative_threshold": 0.0}),
    ({"Moving_Velocity": 7}, {"derivative_threshold": 7 * COUNT}),
    ({"Minimum_Startup_Force": 25}, {"minimum_duty": 0.025}),
    ({"CW_Dead_Zone": 3, "CCW_Dead_Zone": 3}, {"deadband_angle": 3 * COUNT}),
    ({"Torque_Limit": 500}, {"torque_limit": 0.5, "duty_limit": 0.97}),
    ({"Max_Torque_Limit": 400}, {"torque_limit": 0.4}),
    ({"Max_Torque_Limit": 400, "Torque_Limit": 300}, {"torque_limit": 0.3}),
    ({"Goal_Velocity": 1000}, {"speed_limit": 1000 * COUNT, "minimum_speed": 50 * COUNT}),
    ({"Goal_Velocity": 20, "Phase": 8}, {"speed_limit": 1000 * COUNT}),
    ({"Maximum_Velocity_Limit": 80, "Hts": 0}, {"speed_limit": 4000 * COUNT, "minimum_speed": 0.0}),
    ({"Acceleration": 20}, {"acceleration_limit": 2000 * COUNT}),
    ({"Acceleration": 254}, {"acceleration_limit": 10000 * COUNT}),
    ({"Acceleration": 254, "Maximum_Acceleration": 254}, {"acceleration_limit": 25400 * COUNT}),
    ({"Maximum_Acceleration": 50, "Acceleration_Multiplier ": 3}, {"acceleration_limit": 15000 * COUNT}),
    ({"Overload_Torque": 25, "Protection_Time": 100, "Protective_Torque": 10},
     {"overload_duty": 0.25, "overload_time": 1.0, "overload_output": 0.1, "stall_travel": 50 * COUNT}),
    ({"Overload_Torque": 101}, {"overload_duty": None}),
    ({"Protection_Current": 250, "Over_Current_Protection_Time": 50}, {"trip_current": 1.625, "trip_time": 0.5}),
    ({"Max_Temperature_Limit": 60}, {"trip_temperature": 333.15}),
    ({"Unloading_Condition": 0}, {"overload_duty": None, "overload_time": None, "trip_current": None, "trip_time": None,
                                  "trip_temperature": None, "undervoltage": None}),
    ({"Unloading_Condition": 1, "Min_Voltage_Limit": 45}, {"undervoltage": 4.5, "undervoltage_action": "stop"}),
    ({"Min_Position_Limit": 1024, "Max_Position_Limit": 3072},
     {"lower_goal": -math.pi / 2, "upper_goal": math.pi / 2}),
    ({"Min_Position_Limit": 0, "Max_Position_Limit": 0}, {"lower_goal": None, "upper_goal": None}),
    ({}, {"proportional_gain": 32 / (4000 * COUNT), "derivative_gain": 32 * 20 * T_c / (8000 * COUNT),
          "integral_gain": 0.0, "minimum_duty": 0.016, "deadband_angle": COUNT, "overload_duty": 0.8,
          "overload_output": 0.2, "overload_time": 2.0, "trip_current": 2.015, "trip_time": 2.0,
          "acceleration_limit": 10000 * COUNT, "control_period": T_c, "compute_delay": T_c, "angle_quantum": COUNT,
          "duty_quantum": 1e-3, "whole_counts": "yes", "filter_weight": 0.8, "command_kind": "goal"}),
], ids=str)
def test_feetech(registers, expected):
    check(st.feetech_sts, STS, registers, expected)


def test_what_lerobot_writes():
    """Its follower: half the factory's P, the quickest profile; its gripper: half the torque and early protection."""
    arm = st.feetech_sts({"P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32, "Maximum_Acceleration": 254,
                          "Acceleration": 254}, servo="feetech-sts3215-7v4")
    assert arm.firmware.acceleration_limit == pytest.approx(38.963, abs=1e-3)
    gripper = st.feetech_sts({"Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}, servo=arm)
    check(st.feetech_sts, gripper, {}, {
        "torque_limit": 0.5, "trip_current": 1.625, "overload_duty": 0.25,
        "proportional_gain": arm.firmware.proportional_gain, "acceleration_limit": arm.firmware.acceleration_limit})


@pytest.mark.parametrize(("P", "zone", "startup", "duties"), [
    (32, 1, 0, {3: 16, 4: 24, 5: 32, 6: 40, 8: 56, 9: 64}), (32, 1, 16, {2: 24, 3: 32, 4: 40, 5: 48, 75: 608, 85: 688}),
    (50, 0, 16, {1: 28, 2: 41, 3: 53}), (50, 1, 16, {2: 28, 3: 41, 4: 53}), (32, 0, 0, {1: 8, 2: 16, 3: 24, 4: 32}),
])
def test_duties_at_rest_are_those_that_an_sts_shows(P, zone, startup, duties):
    firmware = st.feetech_sts({"P_Coefficient": P, "CW_Dead_Zone": zone, "CCW_Dead_Zone": zone,
                               "Minimum_Startup_Force": startup}, servo=STS).firmware
    step, delta = firmware.angle_quantum, firmware.duty_quantum
    h, least = firmware.deadband_angle / step, firmware.minimum_duty / delta
    for e, duty in duties.items():
        steps = firmware.proportional_gain * step / delta * (e - h)
        assert math.floor(steps + 1e-9) + round(least) == duty, e


@pytest.mark.parametrize(("servo", "registers", "expected"), [
    (XL330, {"Position_P_Gain": 400}, {"proportional_gain": 400 / (256 * 885 * COUNT)}),
    (XL330, {"Position_D_Gain": 100}, {"derivative_gain": 100 * T_c / (32 * 885 * COUNT)}),
    (XL330, {"Position_I_Gain": 10}, {"integral_gain": 10 / (2 * 65536 * 885 * COUNT * T_c)}),
    (XL330, {"PWM_Limit": 600}, {"duty_limit": 600 / 885, "torque_limit": 600 / 885}),
    (XL330, {"Goal_PWM": 300}, {"duty_limit": 1.0, "torque_limit": 300 / 885}),
    (XL330, {"Profile_Velocity": 100, "Profile_Acceleration": 20},
     {"speed_limit": 100 * 0.229 * RPM, "acceleration_limit": 20 * 214.577 * RPM / 60}),
    (XL330, {"Profile_Velocity": 0, "Profile_Acceleration": 0}, {"speed_limit": None, "acceleration_limit": None}),
    (XL330, {"Operating_Mode": 5, "Goal_Current": 300}, {"current_limit": 0.3, "current_sense": "bus"}),
    (XL330, {"Goal_Current": 300}, {"current_limit": None, "current_sense": None}),
    (XL330, {"Operating_Mode": 5, "Current_Limit": 900}, {"current_limit": 0.9}),
    (XL330, {"Operating_Mode": 4}, {"lower_goal": None, "upper_goal": None}),
    (XL330, {"PWM_Slope": 70}, {"duty_slew": 70 * 1.977 / 5.0}),
    (XL330, {"Temperature_Limit": 60, "Min_Voltage_Limit": 40}, {"trip_temperature": 333.15, "undervoltage": 4.0}),
    (XL330, {"Shutdown": 0}, {"trip_temperature": None, "undervoltage": None, "overload_latches": "no",
                              "overload_output": None}),
    (XL330, {"Bus_Watchdog": 10}, {"signal_timeout": 0.2, "signal_loss": "hold"}),
    (XL330, {"Min_Position_Limit": 1024, "Max_Position_Limit": 3072},
     {"lower_goal": -math.pi / 2, "upper_goal": math.pi / 2}),
    (XL330, {}, {"proportional_gain": 400 / (256 * 885 * COUNT), "derivative_gain": 0.0, "undervoltage": 3.5,
                 "trip_temperature": 343.15, "duty_slew": 140 * 1.977 / 5.0, "duty_quantum": 1 / 885,
                 "control_period": 1e-3, "compute_delay": 0.0, "angle_quantum": COUNT, "whole_counts": None}),
    (XL430, {"Position_I_Gain": 10}, {"integral_gain": 10 / (65536 * 885 * COUNT * T_c)}),
    (XL430, {}, {"proportional_gain": 640 / (128 * 885 * COUNT), "derivative_gain": 4000 * T_c / (16 * 885 * COUNT),
                 "trip_temperature": 345.15, "undervoltage": None, "duty_slew": None, "current_limit": None}),
    (st.servo_from_values("my-xm430", {}), {"Operating_Mode": 5, "Goal_Current": 100},
     {"proportional_gain": 800 / (128 * 885 * COUNT), "current_limit": 0.269, "current_sense": "motor"}),
    (st.servo_from_values("mine", {}), {"Model_Number": 1200}, {"proportional_gain": 400 / (256 * 885 * COUNT)}),
], ids=str)
def test_dynamixel_x(servo, registers, expected):
    check(st.dynamixel_x, servo, registers, expected)


@pytest.mark.parametrize(("registers", "expected"), [
    ({"P_Gain": 10}, {"proportional_gain": 10 / (2 * math.pi)}),
    ({"I_Gain": 2, "D_Gain": 5}, {"integral_gain": 2 * 1000 / 2048 * 4 / math.pi,
                                  "derivative_gain": 5 * 4 / 1000 * 4 / math.pi}),
    ({"Max_Torque": 512}, {"torque_limit": 512 / 1023}), ({"Torque_Limit": 100}, {"torque_limit": 100 / 1023}),
    ({"Punch": 40}, {"minimum_duty": 40 / 1023}),
    ({"Moving_Speed": 100, "Goal_Acceleration": 10},
     {"speed_limit": 11.4 * RPM, "acceleration_limit": math.radians(85.83)}),
    ({"CW_Angle_Limit": 1024, "CCW_Angle_Limit": 3072}, {"lower_goal": -math.pi / 2, "upper_goal": math.pi / 2}),
    ({"CW_Angle_Limit": 4095, "CCW_Angle_Limit": 4095}, {"lower_goal": None, "upper_goal": None}),
    ({"Alarm_Shutdown": 1}, {"undervoltage": 6.0, "trip_temperature": None, "overload_latches": "no"}),
    ({}, {"proportional_gain": 16 / math.pi, "integral_gain": 0.0, "derivative_gain": 0.0, "duty_limit": 0.9625,
          "speed_limit": None, "acceleration_limit": None, "trip_temperature": 353.15, "undervoltage": None,
          "angle_quantum": COUNT, "command_kind": "goal"}),
], ids=str)
def test_dynamixel_mx(registers, expected):
    check(st.dynamixel_mx, MX, registers, expected)


@pytest.mark.parametrize(("registers", "expected"), [
    ({"CW_Compliance_Margin": 2, "CCW_Compliance_Margin": 2}, {"deadband_angle": math.radians(600 / 1023)}),
    ({"CW_Compliance_Slope": 64, "CCW_Compliance_Slope": 64, "Punch": 0},
     {"proportional_gain": 1 / math.radians(64 * 0.29326), "minimum_duty": 0.0}),
    ({"CW_Compliance_Slope": 127, "CCW_Compliance_Slope": 127, "Punch": 0},
     {"proportional_gain": 1 / math.radians(64 * 0.29326)}),
    ({"CW_Compliance_Slope": 0, "CCW_Compliance_Slope": 0, "Punch": 0},
     {"proportional_gain": 1 / math.radians(2 * 0.29326)}),
    ({"Moving_Speed": 50}, {"speed_limit": 5.55 * RPM}),
    ({"CCW_Angle_Limit": 612}, {"lower_goal": -math.radians(512 * 300 / 1023), "upper_goal": math.radians(3e4 / 1023)}),
    ({}, {"proportional_gain": (1 - 32 / 1023) / math.radians(32 * 0.29326), "minimum_duty": 32 / 1023,
          "deadband_angle": math.radians(300 / 1023), "angle_quantum": math.radians(300 / 1023), "torque_limit": 1.0}),
], ids=str)
def test_dynamixel_ax(registers, expected):
    check(st.dynamixel_ax, AX, registers, expected)


# -- what stays, and what is known of it

def test_what_is_not_given_stays():
    mine = st.load_servo(STS).replace({"firmware.minimum_duty": 0.05, "firmware.speed_limit": None})
    changed = st.feetech_sts({"P_Coefficient": 8}, servo=mine)
    assert changed.firmware.minimum_duty == 0.05
    assert changed.source("firmware.minimum_duty").was_set
    assert changed.firmware.speed_limit is None
    rest = [name for name in mine.names() if name != "firmware.proportional_gain"]
    assert [changed.source(name) for name in rest] == [mine.source(name) for name in rest]


def test_a_register_follows_what_was_written_before_also_through_a_file(tmp_path):
    """The acceleration is that of two registers: the one of an earlier call counts, and not the factory's."""
    st.feetech_sts({"Maximum_Acceleration": 254, "Acceleration": 20}, servo=STS).save(tmp_path / "arm.toml")
    again = st.load_servo(tmp_path / "arm.toml")
    assert again == st.feetech_sts({"Maximum_Acceleration": 254, "Acceleration": 20}, servo=STS)
    check(st.feetech_sts, str(tmp_path / "arm.toml"), {"Acceleration": 200}, {"acceleration_limit": 20000 * COUNT})
    mode = st.dynamixel_x({"Operating_Mode": 4}, servo=XL330)
    check(st.dynamixel_x, mode, {"Min_Position_Limit": 100}, {"lower_goal": None})
    open_end = st.dynamixel_x({"Shutdown": 0}, servo=XL330)
    check(st.dynamixel_x, open_end, {"Temperature_Limit": 50}, {"trip_temperature": None})


@pytest.mark.parametrize(("family", "name"), [("feetech-sts", STS), ("dynamixel-x", XL330), ("dynamixel-mx", MX),
                                              ("dynamixel-ax", AX)])
def test_a_servo_without_firmware_gets_the_factorys(family, name):
    volts = st.load_servo(name).supply.open_circuit_voltage
    bare = st.servo_from_values(name, {"supply": {"open_circuit_voltage": volts}})
    made = REGISTER_FAMILIES[family]({}, servo=bare)
    assert made.kind == "bus"
    assert made.firmware == st.load_servo(name).firmware
    assert made == REGISTER_FAMILIES[family]({}, servo=made)


def test_numbers_of_a_persons_own_are_kept():
    mine = st.servo_from_values("mine", {"firmware": {"proportional_gain": 3.0}})
    made = st.feetech_sts({}, servo=mine)
    assert made.firmware.proportional_gain == 3.0
    assert made.firmware.minimum_duty == 0.016


def test_the_source_names_the_registers_and_what_is_guessed():
    arm = st.feetech_sts({"P_Coefficient": 16}, servo=STS)
    assert "register P_Coefficient (21) = 16" in arm.source("firmware.proportional_gain").source
    assert "Acceleration (41) = 0, Maximum_Acceleration (85) = 100" in arm.source(
        "firmware.acceleration_limit").source
    guessed = {"firmware.compute_delay"}
    for name in arm.names():
        if name.startswith("firmware."):
            assert (arm.source(name).origin == "assumed") is (name in guessed), name
    assert "literature" in ORIGINS


@pytest.mark.parametrize(("model", "divisor", "least", "most"), [
    ("XL330-M288", 256, None, None), ("XC330-T288", 256, 128, 256), ("XC330-M288", 256, 128, 256),
    ("XL430-W250", 128, 128, 150), ("XC430-W240", 128, 128, 150), ("2XL430-W250", 128, 128, 150),
    ("XM430 W350", 128, 128, 150), ("xm540_w270", 128, 128, 150), ("MX-64", 128, 128, 150), ("my-xm430", 128, 128, 150),
    ("2XC430-W250", 128, 128, 256), ("mine", 128, 128, 256)])
def test_the_divisor_of_the_gain_p_is_that_of_the_model(model, divisor, least, most):
    """Measured of an XL330, else assumed within a range; of a model whose page was not read the XL330's is in it."""
    gain = st.dynamixel_x({"Position_P_Gain": 100}, servo=st.servo_from_values("a", {}, title=model)).source(
        "firmware.proportional_gain")
    assert gain.value == pytest.approx(100 / (divisor * 885 * COUNT), rel=1e-14)
    assert gain.origin == ("literature" if least is None else "assumed")
    assert (gain.lower, gain.upper) == ((None, None) if least is None else pytest.approx(
        (100 / (most * 885 * COUNT), 100 / (least * 885 * COUNT)), rel=1e-14))


@pytest.mark.parametrize(("change", "servo", "one", "two", "name"), [
    (st.feetech_sts, STS, {"CW_Dead_Zone": 4}, {"CCW_Dead_Zone": 4}, "deadband_angle"),
    (st.dynamixel_ax, AX, {"CW_Compliance_Margin": 4}, {"CCW_Compliance_Margin": 4}, "deadband_angle"),
    (st.dynamixel_ax, AX, {"CW_Compliance_Slope": 64}, {"CCW_Compliance_Slope": 64}, "proportional_gain")])
def test_of_two_ways_the_larger_counts_and_it_is_said(change, servo, one, two, name):
    both = change(one | two, servo=servo)
    for half in (one, two):
        with pytest.warns(UserWarning, match="differ by the way of turning"):
            assert getattr(change(half, servo=servo).firmware, name) == getattr(both.firmware, name)


# -- what is refused

@pytest.mark.parametrize(("change", "servo", "registers", "said"), [
    (st.feetech_sts, STS, {"P_Coefficient": 0}, r"P_Coefficient \(21\) .*: got 0, .* 1 to 254; without P"),
    (st.feetech_sts, STS, {"P_Coefficient": 255}, "got 255, allowed: a whole number from 1 to 254"),
    (st.feetech_sts, STS, {"P_Coefficient": 15.5}, "got 15.5"),
    (st.feetech_sts, STS, {"P_Coefficient": True}, "got True"),
    (st.feetech_sts, STS, {"P_Coefficient": "16"}, "got '16'"),
    (st.feetech_sts, STS, {"P_Coefficient": math.nan}, "got nan"),
    (st.feetech_sts, STS, {"Operating_Mode": 1}, "allowed: 0; only the position mode is computed"),
    (st.feetech_sts, STS, {"Goal_Velocity": 0, "Phase": 4}, "else the servo stands"),
    (st.feetech_sts, STS, {"Min_Position_Limit": 3000, "Max_Position_Limit": 2000}, "less than Max_Position_Limit"),
    (st.feetech_sts, STS, {"Hts": 1, "Minimum_Velocity_Limit": 2}, "given by two names: got 2"),
    (st.feetech_sts, STS, [("P_Coefficient", 16)], "a mapping of names to raw values"),
    (st.feetech_sts, XL330, {}, "registers of Feetech STS for 'dynamixel-xl330-m288', which has those of Dynamixel X"),
    (st.dynamixel_x, XL330, {"Position_P_Gain": 0}, "without P the servo"),
    (st.dynamixel_x, XL330, {"Feedforward_1st_Gain": 10}, "the scale of the feed-forward is not published"),
    (st.dynamixel_x, XL330, {"Operating_Mode": 0}, "3 or 4 or 5; only the position modes"),
    (st.dynamixel_x, XL330, {"Drive_Mode": 4}, "profiles by time are not computed"),
    (st.dynamixel_x, XL330, {"Goal_PWM": 500, "PWM_Limit": 400}, "at most PWM_Limit = 400"),
    (st.dynamixel_x, XL330, {"Goal_Current": 500, "Current_Limit": 400}, "at most Current_Limit = 400"),
    (st.dynamixel_x, XL330, {"Min_Position_Limit": 9, "Max_Position_Limit": 9}, "less than Max_Position_Limit = 9"),
    (st.dynamixel_x, XL430, {"Operating_Mode": 5}, "does not sense its current"),
    (st.dynamixel_x, st.servo_from_values("xl330", {}), {"PWM_Slope": 100}, "supply voltage is not given"),
    (st.dynamixel_mx, MX, {"CW_Angle_Limit": 0, "CCW_Angle_Limit": 0}, "a wheel has no position loop"),
    (st.dynamixel_mx, MX, {"CW_Angle_Limit": 9, "CCW_Angle_Limit": 9}, "less than CCW_Angle_Limit = 9"),
    (st.dynamixel_mx, MX, {"Torque_Control_Mode_Enable": 1}, "control of the torque is not computed"),
    (st.dynamixel_ax, AX, {"CCW_Angle_Limit": 2000}, "from 0 to 1023"),
])
def test_what_is_wrong_is_said_in_one_line(change, servo, registers, said):
    with pytest.raises(ParameterError) as caught:
        change(registers, servo=servo)
    assert re.search(said, str(caught.value)), str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("change", "servo", "name", "near"), [
    (st.feetech_sts, STS, "P_Coeficient", "P_Coefficient"), (st.feetech_sts, STS, "Position_P_Gain", None),
    (st.dynamixel_x, XL330, "position_p_gain", "Position_P_Gain"), (st.dynamixel_x, XL430, "Goal_Current", None),
    (st.dynamixel_x, XL430, "PWM_Slope", None), (st.dynamixel_mx, MX, "P_gain", "P_Gain"),
    (st.dynamixel_ax, AX, "Compliance_Slope", "CW_Compliance_Slope")])
def test_an_unknown_register_is_refused_with_the_nearest(change, servo, name, near):
    with pytest.raises(UnknownNameError) as caught:
        change({name: 1}, servo=servo)
    assert near is None or near in caught.value.suggestions
    assert "\n" not in str(caught.value)


def test_whole_numbers_of_any_kind_are_taken():
    made = [st.feetech_sts({"P_Coefficient": value}, servo=STS) for value in (16, 16.0, np.int32(16), np.uint8(16))]
    assert all(one == made[0] for one in made)


def test_a_whole_dump_is_taken():
    """What a person reads out of a servo, with registers that do not change how it moves."""
    dump = {"Model_Number": 777, "ID": 3, "Baud_Rate": 0, "Return_Delay_Time": 0, "Homing_Offset": -120,
            "Present_Position": 2000, "Present_Load": -40, "Present_Temperature": 31, "Lock": 1, "Torque_Enable": 1}
    assert st.feetech_sts(dump, servo=STS) == st.load_servo(STS)
