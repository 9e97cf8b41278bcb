"""Registers of Feetech's STS servos (STS3215, STS3250 …), by the names that LeRobot gives them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from servotwin.errors import ParameterError
from servotwin.parameters.catalog import load_servo
from servotwin.parameters.registers.table import (
    LEROBOT_SETS,
    Family,
    Given,
    Raw,
    Register,
    RegisterModel,
    Setting,
    laid,
    model_for,
    on,
    set_registers,
    written,
)
from servotwin.parameters.servo import Servo

# --- Models of Feetech's STS series, each against what was published of its registers ---------------------------------

@dataclass(frozen=True, kw_only=True)
class StsModel(RegisterModel):
    """A model of the STS series.

    Parameters
    ----------
    current_unit : float
        Of Protection_Current and Present_Current [A].
    unit_assumed : bool
        Whether that unit is assumed.
    """

    current_unit: float = 6.5e-3
    unit_assumed: bool = False


_TABLE = "Feetech, memory table of the STS series"
_PAGE = "https://wiki.aifitlab.com/feetech-servo-motor-docs/feetech-sts-servo-memory-table-analysis"
_DUMP = "factory dump of an STS3215, firmware 3.10 (github.com/0o8o0-blip/sts3215-firmware)"
_BAM = "github.com/Rhoban/bam, bam/feetech/actuator.py: 3400 counts/s"
_DUMPED = ("Phase", "Unloading_Condition", "LED_Alarm_Condition", "P_Coefficient", "D_Coefficient",
           "Minimum_Startup_Force", "Protection_Current", "Velocity_closed_loop_P_proportional_coefficient",
           "Velocity_closed_loop_I_integral_coefficient", "Moving_Velocity_Threshold", "DTs", "Minimum_Velocity_Limit",
           "Maximum_Acceleration", "Acceleration_Multiplier")  # the table of the series leaves these open
_ELSEWHERE = {**dict.fromkeys(_DUMPED, _DUMP), "Maximum_Velocity_Limit": _BAM}
_UNITS = frozenset({"Velocity_Unit_factor", "Goal_Time"})  # 82 and 44: sources disagree, or say nothing

STS_MODELS = (
    StsModel(name="STS3215-7V4", number=777, document=_TABLE, page=_PAGE, elsewhere=_ELSEWHERE,
             values={"Max_Voltage_Limit": 80}, assumed=_UNITS | {"Max_Voltage_Limit"}),
    StsModel(name="STS3215-12V", number=777, document=_TABLE, page=_PAGE, assumed=_UNITS,
             elsewhere={**_ELSEWHERE, "Max_Voltage_Limit": _DUMP}),
    StsModel(name="STS3250", number=2825, document=_TABLE, page=_PAGE,
             values={"Maximum_Velocity_Limit": 254}, current_unit=3.8 / 310.0, unit_assumed=True,
             units=dict.fromkeys(("Protection_Current", "Present_Current"), f"{3800.0 / 310.0:.4g} mA, assumed"),
             assumed=_UNITS | {"Maximum_Velocity_Limit", "Max_Voltage_Limit", *_DUMPED}),
)
"""The first is what counts for a servo that does not tell its model."""


# --- Registers of Feetech's STS servos (STS3215, STS3250 …), by the names that LeRobot gives them ---------------------

_COUNT = 2.0 * math.pi / 4096.0  # rad
_MIDDLE = 2048  # counts at angle 0
_TICK = 1e-3  # s
_GUESS = "assumed"
_ZERO_CELSIUS = 273.15
_MASK = "Unloading_Condition"
_by_voltage, _by_heat, _by_current, _by_load = on(0, _MASK), on(2, _MASK), on(3, _MASK), on(5, _MASK)
_in_counts, _zero_is_most = on(2, "Phase"), on(3, "Phase")
_FEEDBACK = tuple((name, address) for name, address in (
    ("Firmware_Major_Version", 0), ("Firmware_Minor_Version", 1), ("Model_Number", 3), ("Goal_Position", 42),
    ("Present_Position", 56), ("Present_Velocity", 58), ("Present_Load", 60), ("Present_Voltage", 62),
    ("Present_Temperature", 63), ("Status", 65), ("Moving", 66), ("Present_Current", 69), ("Goal_Position_2", 71)))
_KNOWN: dict[str, Register] = {
    "P_Coefficient": Register(21, 1, 254, 32, why="without P the servo does not control its angle"),
    "D_Coefficient": Register(22, 0, 254, 32),
    "I_Coefficient": Register(23, 0, 254, 0),
    "Minimum_Startup_Force": Register(24, 0, 254, 16),
    "Integral_Limit": Register(25, 0, 254, 0),
    "CW_Dead_Zone": Register(26, 0, 32, 1),
    "CCW_Dead_Zone": Register(27, 0, 32, 1),
    "Min_Position_Limit": Register(9, 0, 4094, 0),
    "Max_Position_Limit": Register(11, 0, 4095, 4095),
    "Max_Temperature_Limit": Register(13, 0, 100, 70),
    "Min_Voltage_Limit": Register(15, 0, 254, 40),
    "Max_Torque_Limit": Register(16, 0, 1000, 1000),
    "Torque_Limit": Register(48, 0, 1000, 1000),
    "Phase": Register(18, 0, 254, 12),
    "Unloading_Condition": Register(19, 0, 254, 44),
    "Protection_Current": Register(28, 1, 511, 310),
    "Over_Current_Protection_Time": Register(38, 0, 254, 200),
    "Protective_Torque": Register(34, 0, 254, 20),
    "Protection_Time": Register(35, 0, 254, 200),
    "Overload_Torque": Register(36, 0, 254, 80),
    "Acceleration": Register(41, 0, 254, 0),
    "Goal_Velocity": Register(46, 0, 32767, 0),
    "Moving_Velocity_Threshold": Register(80, 0, 254, 2),
    "DTs": Register(81, 1, 254, 20),
    "Minimum_Velocity_Limit": Register(83, 0, 254, 1),
    "Maximum_Velocity_Limit": Register(84, 1, 254, 68),
    "Maximum_Acceleration": Register(85, 1, 254, 100),
    "Acceleration_Multiplier": Register(86, 1, 254, 1),
    "Operating_Mode": Register(33, 0, 3, 0, (0,), "only the position mode is computed"),
    "Angular_Resolution": Register(30, 1, 100, 1, (1,), "only the finest resolution is computed"),
    # without effect on the control of the angle
    "ID": Register(5, 0, 253, 1),
    "Baud_Rate": Register(6, 0, 7, 0),
    "Return_Delay_Time": Register(7, 0, 254, 0),
    "Response_Status_Level": Register(8, 0, 1, 1),
    "Max_Voltage_Limit": Register(14, 0, 254, 140),
    "LED_Alarm_Condition": Register(20, 0, 254, 47),
    "Homing_Offset": Register(31, -2047, 2047, 0),
    "Velocity_closed_loop_P_proportional_coefficient": Register(37, 0, 254, 10),
    "Velocity_closed_loop_I_integral_coefficient": Register(39, 0, 254, 200),
    "Torque_Enable": Register(40, 0, 128, 0),
    "Goal_Time": Register(44, 0, 1000, 0),
    "Lock": Register(55, 0, 1, 0),
    "Velocity_Unit_factor": Register(82, 0, 254, 1),
    **{name: Register(address, -32767, 65535, 0, reading=True) for name, address in _FEEDBACK},
}
# Bytes and signs: LeRobot's control and encoding tables, Feetech's SMS_STS library (signs of load and current)
REGISTERS: dict[str, Register] = laid(_KNOWN, sizes={2: (
    "Model_Number Min_Position_Limit Max_Position_Limit Max_Torque_Limit Protection_Current Homing_Offset "
    "Goal_Position Goal_Time Goal_Velocity Torque_Limit Present_Position Present_Velocity Present_Load "
    "Present_Current Goal_Position_2")}, signs={
    "Homing_Offset": 11, "Goal_Position": 15, "Goal_Time": 10, "Goal_Velocity": 15, "Present_Position": 15,
    "Present_Velocity": 15, "Present_Load": 10, "Present_Current": 15, "Goal_Position_2": 15},
    stored=(range(40), range(78, 87)), units={
    "count": "Min_Position_Limit Max_Position_Limit CW_Dead_Zone CCW_Dead_Zone Homing_Offset Goal_Position "
             "Present_Position Moving_Velocity_Threshold",
    "0.1 V": "Max_Voltage_Limit Min_Voltage_Limit Present_Voltage", "°C": "Max_Temperature_Limit Present_Temperature",
    "0.1 %": "Max_Torque_Limit Torque_Limit Minimum_Startup_Force Present_Load Goal_Time",
    "6.5 mA": "Protection_Current Present_Current", "%": "Protective_Torque Overload_Torque",
    "10 ms": "Protection_Time Over_Current_Protection_Time", "2 µs": "Return_Delay_Time", "ms": "DTs",
    "count/s": "Goal_Velocity Present_Velocity Goal_Position_2",
    "50 count/s": "Minimum_Velocity_Limit Maximum_Velocity_Limit",
    "100 count/s²": "Acceleration Maximum_Acceleration", "0.4 %": "Integral_Limit"})
"""By LeRobot's names; 0 to 39 and 78 to 86 outlive power-off."""


_SERVED = frozenset({
    "ID", "Baud_Rate", "Return_Delay_Time", "Response_Status_Level", "Max_Voltage_Limit", "Max_Torque_Limit",
    "Homing_Offset", "Torque_Enable", "Goal_Position", "Lock", "Angular_Resolution"})


def feetech_sts(registers: Given, *, servo: str | Path | Servo) -> Servo:
    """Return a servo with registers of Feetech's STS series set into its firmware.

    Parameters
    ----------
    registers : mapping of str to int, or str
        Raw values by LeRobot's names, such as ``{"P_Coefficient": 16, "D_Coefficient": 32}``; all of a dump may be
        given. Angle 0 is at count 2048. ``"lerobot"`` stands for what LeRobot writes into the servos of an SO-100 or
        SO-101 follower, ``"lerobot-gripper"`` for what it writes into the one of the gripper.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or a servo. A register that is not given keeps its value, or has the
        factory's.

    Raises
    ------
    UnknownNameError
        If there is no such register or set: the nearest are suggested.
    ParameterError
        If a value is not whole, out of range or not computed.

    Warns
    -----
    UserWarning
        If the dead zones of both ways differ: the larger one counts for both.

    Examples
    --------
    >>> arm = feetech_sts({"P_Coefficient": 16, "Acceleration": 254}, servo="feetech-sts3215-12v")
    >>> round(arm.firmware.proportional_gain, 4)
    2.6076
    >>> arm.source("firmware.proportional_gain").source[:52]
    'Feetech STS firmware: register P_Coefficient (21) = '
    >>> feetech_sts("lerobot", servo="feetech-sts3215-12v").firmware.proportional_gain == arm.firmware.proportional_gain
    True
    """
    base = servo if isinstance(servo, Servo) else load_servo(servo)
    number = registers.get("Model_Number", 0) if isinstance(registers, Mapping) else 0
    return set_registers(family_of(base, number), registers, base)


def family_of(servo: Servo, number: int = 0) -> Family:
    """Return the registers of a servo of this series, by its model number, else by its name."""
    return sts_family(model_for(STS_MODELS, servo, number, REGISTERS))


def family_as_set(servo: Servo) -> Family:
    """Return the registers of a servo with the step of its speeds: 50 counts/s where bit 2 of its Phase is not set."""
    family = family_of(servo)
    if _in_counts(written(family, servo)):
        return family
    return replace(family, registers={name: replace(one, unit="50 count/s") if one.unit == "count/s" else one
                                      for name, one in family.registers.items()})


def sts_family(model: StsModel) -> Family:
    """Return the registers of a model."""
    return Family(
        label="Feetech STS", model=model.name, reference=model.document, count=_COUNT, middle=_MIDDLE,
        registers=model.registers(REGISTERS),
        assumed=model.unseen(REGISTERS), elsewhere=model.elsewhere, masks=(_MASK,), sets=LEROBOT_SETS,
        settings=(*_CONTROL, *_profile(model), *_trips(model)),
        other_names={"Hts": "Minimum_Velocity_Limit", "Moving_Velocity": "Moving_Velocity_Threshold",
                     "Goal_Speed": "Goal_Velocity", "Present_Speed": "Present_Velocity"},
        copied={"Torque_Limit": "Max_Torque_Limit"}, pairs=(("CW_Dead_Zone", "CCW_Dead_Zone"),), check=_check,
        served=_SERVED)


def _check(raw: Raw) -> None:
    low, high = raw["Min_Position_Limit"], raw["Max_Position_Limit"]
    if low >= high and high > 0:
        raise ParameterError("register Min_Position_Limit of Feetech STS", got=low,
                             allowed=f"less than Max_Position_Limit = {high}, or 0 for both: turns without end")
    if raw["Goal_Velocity"] == 0 and not _zero_is_most(raw):
        raise ParameterError("register Goal_Velocity of Feetech STS", got=0,
                             allowed="more than 0 where bit 3 of Phase is not set: else the servo stands")


def _goal(name: str) -> Setting:
    limits = ("Min_Position_Limit", "Max_Position_Limit")
    register = limits[name == "upper_goal"]
    return Setting(name, lambda raw, _: (raw[register] - _MIDDLE) * _COUNT if raw[limits[1]] > 0 else None, limits,
                   "angle 0 at count 2048")


_CONTROL = (
    Setting("control_period", lambda raw, _: _TICK, said="position loop of 1 kHz"),
    Setting("compute_delay", lambda raw, _: _TICK, said="a guess: the next tick", origin=_GUESS, bounds=(0.0, _TICK)),
    Setting("angle_quantum", lambda raw, _: _COUNT, said="4096 counts a turn"),
    Setting("filter_weight", lambda raw, _: 0.8, said="of the newest count 0.8"),
    Setting("deadband_angle", lambda raw, _: max(raw["CW_Dead_Zone"], raw["CCW_Dead_Zone"]) * _COUNT,
            ("CW_Dead_Zone", "CCW_Dead_Zone"), "counts, the larger one"),
    Setting("proportional_gain", lambda raw, _: raw["P_Coefficient"] / (4000.0 * _COUNT), ("P_Coefficient",),
            "P/4 steps of duty a count"),
    Setting("integral_gain",
            lambda raw, _: raw["I_Coefficient"] / (500.0 * 1000.0 * _COUNT * _TICK)
            if raw["Moving_Velocity_Threshold"] else 0.0, ("I_Coefficient", "Moving_Velocity_Threshold"),
            "I/500 steps of duty a count and tick, at rest"),
    Setting("derivative_gain", lambda raw, _: raw["D_Coefficient"] * raw["DTs"] * _TICK / (8000.0 * _COUNT),
            ("D_Coefficient", "DTs"), "D/8 steps of duty for each count that the error changes in DTs ticks"),
    Setting("derivative_of", lambda raw, _: "error"),
    Setting("derivative_ticks", lambda raw, _: float(raw["DTs"]), ("DTs",), "ms"),
    Setting("derivative_threshold", lambda raw, _: raw["Moving_Velocity_Threshold"] * _COUNT,
            ("Moving_Velocity_Threshold",), "counts"),
    Setting("integral_limit", lambda raw, _: 4.0 * raw["Integral_Limit"] / 1000.0, ("Integral_Limit",),
            "4 steps of duty; 0: none"),
    Setting("anti_windup", lambda raw, _: 1000.0 * _COUNT, said="a count of error a step of duty"),
    Setting("integral_at_rest", lambda raw, _: "yes" if raw["Moving_Velocity_Threshold"] else None,
            ("Moving_Velocity_Threshold",)),
    Setting("rest_travel", lambda raw, _: raw["Moving_Velocity_Threshold"] * _COUNT or None,
            ("Moving_Velocity_Threshold",), "counts"),
    Setting("duty_quantum", lambda raw, _: 1e-3, said="duty in steps of 1/1000"),
    Setting("whole_counts", lambda raw, _: "yes", said="whole counts and steps"),
    Setting("minimum_duty", lambda raw, _: raw["Minimum_Startup_Force"] / 1000.0, ("Minimum_Startup_Force",), "1/1000"),
    Setting("torque_limit", lambda raw, _: raw["Torque_Limit"] / 1000.0, ("Torque_Limit",),
            "1/1000, from Max_Torque_Limit at power-up"),
    Setting("duty_limit", lambda raw, _: 0.97, said="as an oscilloscope showed the authors of BAM"),
    Setting("command_kind", lambda raw, _: "goal", ("Operating_Mode",), "goals on the bus"),
    _goal("lower_goal"),
    _goal("upper_goal"),
    Setting("signal_loss", lambda raw, _: "hold", said="keeps its last goal"),
)


def _speed(raw: Raw, _: Servo) -> float:
    if raw["Goal_Velocity"] == 0:
        return raw["Maximum_Velocity_Limit"] * 50.0 * _COUNT
    return raw["Goal_Velocity"] * (1.0 if _in_counts(raw) else 50.0) * _COUNT


def _acceleration(raw: Raw, _: Servo) -> float:
    if raw["Acceleration"] == 0:
        return raw["Maximum_Acceleration"] * raw["Acceleration_Multiplier"] * 100.0 * _COUNT
    return min(raw["Acceleration"], raw["Maximum_Acceleration"]) * 100.0 * _COUNT


def _profile(model: StsModel) -> tuple[Setting, ...]:
    most = "Maximum_Velocity_Limit"
    return (
        Setting("speed_limit", _speed, ("Goal_Velocity", "Phase", most),
                f"counts/s, or 50 counts/s where bit 2 of Phase is not set; 0: {most} in 50 counts/s",
                factors=(0.4, 1.0) if most in model.assumed else None),
        Setting("acceleration_limit", _acceleration,
                ("Acceleration", "Maximum_Acceleration", "Acceleration_Multiplier"),
                "100 counts/s2, the smaller of the first two; 0: the product of the others"),
        Setting("minimum_speed", lambda raw, _: raw["Minimum_Velocity_Limit"] * 50.0 * _COUNT,
                ("Minimum_Velocity_Limit",), "50 counts/s"),
    )


def _trips(model: StsModel) -> tuple[Setting, ...]:
    def overload(raw: Raw) -> bool:
        return _by_load(raw) and raw["Overload_Torque"] <= 100

    unit = f"{1e3 * model.current_unit:.4g} mA"
    return (
        Setting("overload_duty", lambda raw, _: raw["Overload_Torque"] / 100.0 if overload(raw) else None,
                ("Overload_Torque", _MASK), "%"),
        Setting("overload_time", lambda raw, _: raw["Protection_Time"] * 0.01 if overload(raw) else None,
                ("Protection_Time", _MASK), "10 ms"),
        Setting("stall_travel", lambda raw, _: 50.0 * _COUNT if overload(raw) else None, (_MASK,), "50 counts"),
        Setting("overload_output", lambda raw, _: min(raw["Protective_Torque"] / 100.0, 1.0) if overload(raw) else None,
                ("Protective_Torque", _MASK), "%"),
        Setting("trip_current", lambda raw, _: raw["Protection_Current"] * model.current_unit
                if _by_current(raw) else None, ("Protection_Current", _MASK), unit,
                *((_GUESS, (6.5e-3 / model.current_unit, 1.0)) if model.unit_assumed else ())),
        Setting("trip_time", lambda raw, _: raw["Over_Current_Protection_Time"] * 0.01 if _by_current(raw) else None,
                ("Over_Current_Protection_Time", _MASK), "10 ms"),
        Setting("trip_temperature", lambda raw, _: raw["Max_Temperature_Limit"] + _ZERO_CELSIUS
                if _by_heat(raw) else None, ("Max_Temperature_Limit", _MASK), "deg C"),
        Setting("undervoltage", lambda raw, _: raw["Min_Voltage_Limit"] * 0.1
                if _by_voltage(raw) and raw["Min_Voltage_Limit"] else None, ("Min_Voltage_Limit", _MASK), "0.1 V"),
        Setting("undervoltage_action", lambda raw, _: "stop", (_MASK,)),
    )
