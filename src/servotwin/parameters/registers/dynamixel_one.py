"""Registers of Dynamixel's MX and AX series, protocol 1, by the names of the e-manual with underscores."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from servotwin.errors import ParameterError
from servotwin.parameters.catalog import load_servo
from servotwin.parameters.registers.table import (
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
)
from servotwin.parameters.servo import Servo

# --- Models of Dynamixel's MX and AX series, protocol 1, each against the control table of its own e-manual -----------

# read only, or not in the control table of an MX-28 or MX-12W: what an MX-64 or MX-106 has more
_LARGE = frozenset({"Torque_Control_Mode_Enable", "Goal_Torque", "Current"})
_DUAL = frozenset({"Drive_Mode"})
_SPEED = ("Moving_Speed",)  # the pages print no initial value: 0, no limit, is assumed


@dataclass(frozen=True, kw_only=True)
class OneModel(RegisterModel):
    """A model of the MX or AX series.

    Parameters
    ----------
    speed_unit : float
        Of Moving_Speed and Present_Speed [rpm].
    """

    speed_unit: float


def _one(name: str, number: int, place: str, speed_unit: float, *, seen: bool = True,
         unprinted: frozenset[str] = frozenset(), **values: int) -> OneModel:
    return OneModel(
        name=name, number=number, speed_unit=speed_unit, assumed=frozenset(_SPEED) | unprinted,
        document=f"e-manual of the {name}, control table" if seen else "",
        page=f"https://emanual.robotis.com/docs/en/dxl/{place}/{name.lower()}/" if seen else "",
        units=dict.fromkeys(("Moving_Speed", "Present_Speed"), f"{speed_unit:g} rpm"),
        values={"Model_Number": number, **values})


MX_MODELS = (
    _one("MX-28", 29, "mx", 0.114, unprinted=_LARGE | _DUAL, Baud_Rate=34),
    _one("MX-64", 310, "mx", 0.114, unprinted=_DUAL, Baud_Rate=34, Max_Voltage_Limit=240),
    _one("MX-106", 320, "mx", 0.114, Baud_Rate=34),
    # its page prints 104 as model number; 360 is what programs identify it by
    _one("MX-12W", 360, "mx", 0.916, unprinted=_LARGE | _DUAL | {"Model_Number"}, P_Gain=8, D_Gain=8, Punch=32),
)
AX_MODELS = (
    _one("AX-12A", 12, "ax", 0.111, Max_Voltage_Limit=140),
    _one("AX-18A", 18, "ax", 0.111, Max_Voltage_Limit=140, Temperature_Limit=75, Max_Torque=983, Torque_Limit=983),
    _one("AX-12W", 300, "ax", 0.111, seen=False, Max_Voltage_Limit=140),
)
"""Of each series the first is what counts for a servo that does not tell its model."""


# --- Registers of Dynamixel's MX and AX series, protocol 1, by the names of the e-manual with underscores -------------

_TICK = 1e-3  # s
_RPM = math.pi / 30.0
_DEG = math.pi / 180.0
_GUESS = "assumed"
_BITS = (0, 2, 5)  # of Shutdown: voltage, heat, load
_SLOPES = (2, 4, 8, 16, 32, 64, 128)  # what the servo takes a compliance slope for, each up to the next
# Positions of an MX may lie below 0, in its mode of several turns
_POSITIONS = dict.fromkeys(("Goal_Position", "Present_Position"))
_OTHER_NAMES = {"Alarm_Shutdown": "Shutdown", "Goal_Speed": "Moving_Speed"}


def _common(last: int, *, temperature: int) -> dict[str, Register]:
    feedback = {name: Register(address, 0, 65535, 0, reading=True) for name, address in (
        ("Firmware_Version", 2), ("Goal_Position", 30), ("Present_Position", 36),
        ("Present_Speed", 38), ("Present_Load", 40), ("Present_Voltage", 42), ("Present_Temperature", 43),
        ("Registered", 44), ("Moving", 46))}
    return {
        "CW_Angle_Limit": Register(6, 0, last, 0),
        "CCW_Angle_Limit": Register(8, 0, last, last),
        "Temperature_Limit": Register(11, 0, 150, temperature),
        "Min_Voltage_Limit": Register(12, 50, 250, 60),
        "Max_Torque": Register(14, 0, 1023, 1023),
        "Torque_Limit": Register(34, 0, 1023, 1023),
        "Moving_Speed": Register(32, 0, 1023, 0),
        "Shutdown": Register(18, 0, 127, 36),
        "Model_Number": Register(0, 0, 65535, 0),
        # without effect on the control of the angle
        "ID": Register(3, 0, 253, 1),
        "Baud_Rate": Register(4, 0, 254, 1),
        "Return_Delay_Time": Register(5, 0, 254, 250),
        "Max_Voltage_Limit": Register(13, 50, 250, 160),
        "Status_Return_Level": Register(16, 0, 2, 2),
        "Alarm_LED": Register(17, 0, 127, 36),
        "Torque_Enable": Register(24, 0, 1, 0),
        "LED": Register(25, 0, 1, 0),
        "Lock": Register(47, 0, 1, 0),
        **feedback,
    }


def _told(registers: dict[str, Register], signs: dict[str, int | None]) -> dict[str, Register]:
    """Return registers with the units and signs of what the servo tells, as its page has them."""
    return laid(registers, sizes={2: "Goal_Position Present_Position Present_Speed Present_Load"},
                signs={"Present_Speed": 10, "Present_Load": 10, **signs},
                units={"count": "Goal_Position Present_Position", "0.1 V": "Present_Voltage",
                       "°C": "Present_Temperature"})


MX_REGISTERS: dict[str, Register] = _told({
    "P_Gain": Register(28, 1, 254, 32, why="without P the servo does not control its angle"),
    "I_Gain": Register(27, 0, 254, 0),
    "D_Gain": Register(26, 0, 254, 0),
    "Punch": Register(48, 0, 1023, 0),
    "Goal_Acceleration": Register(73, 0, 254, 0),
    **_common(4095, temperature=80),
    "Resolution_Divider": Register(22, 1, 4, 1, (1,), "only the finest resolution is computed"),
    "Torque_Control_Mode_Enable": Register(70, 0, 1, 0, (0,), "control of the torque is not computed"),
    "Multi_Turn_Offset": Register(20, -24576, 24576, 0),
    "Drive_Mode": Register(10, 0, 3, 0),
    "Realtime_Tick": Register(50, 0, 32767, 0, reading=True),
    "Current": Register(68, 0, 4095, 0, reading=True),
    "Goal_Torque": Register(71, 0, 2047, 0),
}, _POSITIONS)
AX_REGISTERS: dict[str, Register] = _told({
    "CW_Compliance_Margin": Register(26, 0, 255, 1),
    "CCW_Compliance_Margin": Register(27, 0, 255, 1),
    "CW_Compliance_Slope": Register(28, 0, 254, 32),
    "CCW_Compliance_Slope": Register(29, 0, 254, 32),
    "Punch": Register(48, 0, 1023, 32),
    **_common(1023, temperature=70),
}, {})
_MARGINS = ("CW_Compliance_Margin", "CCW_Compliance_Margin")
_COMPLIANCE = ("CW_Compliance_Slope", "CCW_Compliance_Slope")


def dynamixel_mx(registers: Given, *, servo: str | Path | Servo) -> Servo:
    """Return a servo with registers of Dynamixel's MX series, protocol 1, set into its firmware.

    Parameters
    ----------
    registers : mapping of str to int
        Raw values by the e-manual's names with underscores, such as ``{"P_Gain": 32}``. Angle 0 is at count 2048.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or a servo. A register that is not given keeps its value, or has the
        factory's.

    Raises
    ------
    UnknownNameError
        If there is no such register: the nearest are suggested.
    ParameterError
        If a value is not whole, out of range or not computed.

    Examples
    --------
    >>> knee = dynamixel_mx({"P_Gain": 16}, servo="dynamixel-mx-64")
    >>> round(knee.firmware.proportional_gain, 4)
    2.5465
    """
    base, number = _base(registers, servo)
    return set_registers(mx_family_of(base, number), registers, base)


def dynamixel_ax(registers: Given, *, servo: str | Path | Servo) -> Servo:
    """Return a servo with registers of Dynamixel's AX series set into its firmware.

    Parameters
    ----------
    registers : mapping of str to int
        Raw values by the e-manual's names with underscores, such as ``{"CW_Compliance_Slope": 64}``. Angle 0 is at
        count 512, of 300°/1023.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or a servo. A register that is not given keeps its value, or has the
        factory's.

    Raises
    ------
    UnknownNameError
        If there is no such register: the nearest are suggested.
    ParameterError
        If a value is not whole, out of range or not computed.

    Warns
    -----
    UserWarning
        If margins or slopes of both ways differ: the larger ones count for both.

    Examples
    --------
    >>> soft = {"CW_Compliance_Slope": 64, "CCW_Compliance_Slope": 64}
    >>> round(dynamixel_ax(soft, servo="dynamixel-ax-12a").firmware.proportional_gain, 3)
    2.957
    """
    base, number = _base(registers, servo)
    return set_registers(ax_family_of(base, number), registers, base)


def _base(registers: Given, servo: str | Path | Servo) -> tuple[Servo, int]:
    base = servo if isinstance(servo, Servo) else load_servo(servo)
    return base, registers.get("Model_Number", 0) if isinstance(registers, Mapping) else 0


def check_limits(label: str, last: int, raw: Raw) -> None:
    """Raise ParameterError where both angle limits do not go together."""
    low, high = raw["CW_Angle_Limit"], raw["CCW_Angle_Limit"]
    if low == high == 0:
        raise ParameterError(f"registers CW_Angle_Limit and CCW_Angle_Limit of {label}", got=0,
                             allowed="not 0 for both: a wheel has no position loop")
    if low >= high and not low == high == last:
        raise ParameterError(f"register CW_Angle_Limit of {label}", got=low,
                             allowed=f"less than CCW_Angle_Limit = {high}")


def shared_settings(count: float, last: int, speed: float,
                    bits: tuple[int, int, int] = _BITS) -> tuple[Setting, ...]:
    """Return what servos with the control of the MX and AX series have.

    Parameters
    ----------
    count : float
        [rad]
    last : int
        The last count.
    speed : float
        Unit of Moving_Speed [rad/s].
    bits : tuple of int
        Of Shutdown that say whether voltage, heat and load do.
    """
    middle = (last + 1) // 2
    by_voltage, by_heat, by_load = (on(bit, "Shutdown") for bit in bits)

    def goal(name: str, register: str) -> Setting:
        return Setting(name, lambda raw, _: None if raw["CW_Angle_Limit"] == raw["CCW_Angle_Limit"] else
                       (raw[register] - middle) * count, ("CW_Angle_Limit", "CCW_Angle_Limit"),
                       f"angle 0 at count {middle}; {last} twice: turns without end")

    return (
        Setting("control_period", lambda raw, _: _TICK, said="a guess", origin=_GUESS, bounds=(5e-4, 5e-3)),
        Setting("compute_delay", lambda raw, _: 0.0, said="a guess", origin=_GUESS, bounds=(0.0, _TICK)),
        Setting("angle_quantum", lambda raw, _: count, said=f"{count / _DEG:.3g} degrees a count"),
        Setting("command_kind", lambda raw, _: "goal", said="goals on the bus"),
        Setting("torque_limit", lambda raw, _: raw["Torque_Limit"] / 1023.0, ("Torque_Limit",),
                "1/1023, from Max_Torque at power-up"),
        Setting("minimum_duty", lambda raw, _: raw["Punch"] / 1023.0, ("Punch",), "1/1023"),
        goal("lower_goal", "CW_Angle_Limit"),
        goal("upper_goal", "CCW_Angle_Limit"),
        Setting("speed_limit", lambda raw, _: raw["Moving_Speed"] * speed or None, ("Moving_Speed",),
                f"{speed / _RPM:.3g} rpm; 0: none"),
        Setting("overload_output", lambda raw, _: 0.0 if by_load(raw) else None, ("Shutdown",), "torque off"),
        Setting("overload_latches", lambda raw, _: "yes" if by_load(raw) else "no", ("Shutdown",), "till a restart"),
        Setting("trip_temperature", lambda raw, _: raw["Temperature_Limit"] + 273.15 if by_heat(raw) else None,
                ("Temperature_Limit", "Shutdown"), "deg C"),
        Setting("undervoltage", lambda raw, _: raw["Min_Voltage_Limit"] * 0.1 if by_voltage(raw) else None,
                ("Min_Voltage_Limit", "Shutdown"), "0.1 V"),
        Setting("undervoltage_action", lambda raw, _: "stop", ("Shutdown",)),
        Setting("signal_loss", lambda raw, _: "hold", said="keeps its last goal"),
    )


def _margin(raw: Raw) -> int:
    return max(raw[name] for name in _MARGINS)


def _slope(raw: Raw) -> int:
    """Return the slope that the servo takes the written one for."""
    written = max(raw[name] for name in _COMPLIANCE)
    return max((step for step in _SLOPES if step <= written), default=_SLOPES[0])


_MX_GAIN = 4.0 / math.pi  # duty per rad and unit of the manual's K_p = P/8
_MX_COUNT, _AX_COUNT = 2.0 * math.pi / 4096.0, 300.0 / 1023.0 * _DEG
_MX_SETTINGS = (
    Setting("proportional_gain", lambda raw, _: raw["P_Gain"] / (2.0 * math.pi), ("P_Gain",),
            "P/(2 pi) of duty a radian, as an oscilloscope showed the authors of BAM"),
    Setting("integral_gain", lambda raw, _: raw["I_Gain"] * 1000.0 / 2048.0 * _MX_GAIN, ("I_Gain",),
            "I 1000/2048 in the manual, where P is P/8", _GUESS, (0.5, 2.0)),
    Setting("derivative_gain", lambda raw, _: raw["D_Gain"] * 4.0 / 1000.0 * _MX_GAIN, ("D_Gain",),
            "D 4/1000 in the manual, where P is P/8", _GUESS, (0.5, 2.0)),
    Setting("duty_limit", lambda raw, _: 0.9625, said="as an oscilloscope showed the authors of BAM"),
    Setting("acceleration_limit", lambda raw, _: raw["Goal_Acceleration"] * 8.583 * _DEG or None,
            ("Goal_Acceleration",), "8.583 degrees/s2; 0: none"),
)
_AX_SETTINGS = (
    Setting("proportional_gain", lambda raw, _: (1.0 - raw["Punch"] / 1023.0) / (_slope(raw) * 0.29326 * _DEG),
            (*_COMPLIANCE, "Punch"), "from Punch to all of the duty over the slope, the larger one, of 0.29326 "
            "degrees a count"),
    Setting("deadband_angle", lambda raw, _: _margin(raw) * _AX_COUNT, _MARGINS, "counts, the larger one"),
)


def mx_family_of(servo: Servo, number: int = 0) -> Family:
    """Return the registers of a servo of the MX series, by its model number, else by its name."""
    return mx_family(model_for(MX_MODELS, servo, number, MX_REGISTERS))


def mx_family(model: OneModel) -> Family:
    """Return the registers of a model of the MX series."""
    return Family(
        label="Dynamixel MX", model=model.name, reference=model.document, count=_MX_COUNT, middle=2048,
        registers=model.registers(MX_REGISTERS),
        assumed=model.unseen(MX_REGISTERS), masks=("Shutdown",),
        settings=(*_MX_SETTINGS, *shared_settings(_MX_COUNT, 4095, model.speed_unit * _RPM)),
        other_names=_OTHER_NAMES, copied={"Torque_Limit": "Max_Torque"},
        check=lambda raw: check_limits("Dynamixel MX", 4095, raw))


def ax_family_of(servo: Servo, number: int = 0) -> Family:
    """Return the registers of a servo of the AX series, by its model number, else by its name."""
    return ax_family(model_for(AX_MODELS, servo, number, AX_REGISTERS))


def ax_family(model: OneModel) -> Family:
    """Return the registers of a model of the AX series."""
    return Family(
        label="Dynamixel AX", model=model.name, reference=model.document, count=_AX_COUNT, middle=512,
        registers=model.registers(AX_REGISTERS),
        assumed=model.unseen(AX_REGISTERS), masks=("Shutdown",),
        settings=(*_AX_SETTINGS, *shared_settings(_AX_COUNT, 1023, model.speed_unit * _RPM)),
        other_names=_OTHER_NAMES, copied={"Torque_Limit": "Max_Torque"}, pairs=(_MARGINS, _COMPLIANCE),
        check=lambda raw: check_limits("Dynamixel AX", 1023, raw))


# --- Registers of Dynamixel's XL-320, by the names of the e-manual with underscores -----------------------------------

# Protocol 2, but the control of the MX series before it, with an AX's counts.

_RPM_XL320, _DEG_XL320 = math.pi / 30.0, math.pi / 180.0
_COUNT, _LAST, _SPEED_XL320 = 300.0 / 1023.0 * _DEG_XL320, 1023, 0.111  # rad, counts, rpm
_BITS_XL320 = (2, 1, 0)  # of Shutdown: voltage, heat, load
_GAIN = 0.05048199  # duty per rad and unit of P
_FEEDBACK = (("Firmware_Version", 2), ("Goal_Position", 30), ("Present_Position", 37), ("Present_Speed", 39),
             ("Present_Load", 41), ("Present_Voltage", 45), ("Present_Temperature", 46),
             ("Registered_Instruction", 47), ("Moving", 49), ("Hardware_Error_Status", 50))
REGISTERS: dict[str, Register] = laid({
    "P_Gain": Register(29, 1, 254, 32, why="without P the servo does not control its angle"),
    "I_Gain": Register(28, 0, 254, 0),
    "D_Gain": Register(27, 0, 254, 0),
    "Punch": Register(51, 0, 1023, 32),
    "CW_Angle_Limit": Register(6, 0, 1023, 0),
    "CCW_Angle_Limit": Register(8, 0, 1023, 1023),
    "Control_Mode": Register(11, 1, 2, 2, (2,), "a wheel has no position loop"),
    "Temperature_Limit": Register(12, 0, 150, 65),
    "Min_Voltage_Limit": Register(13, 50, 250, 60),
    "Max_Torque": Register(15, 0, 1023, 1023),
    "Torque_Limit": Register(35, 0, 1023, 1023),
    "Moving_Speed": Register(32, 0, 1023, 0),
    "Shutdown": Register(18, 0, 7, 3),
    "Model_Number": Register(0, 0, 65535, 350),
    # without effect on the control of the angle
    "ID": Register(3, 0, 252, 1),
    "Baud_Rate": Register(4, 0, 3, 3),
    "Return_Delay_Time": Register(5, 0, 254, 250),
    "Max_Voltage_Limit": Register(14, 50, 250, 90),
    "Status_Return_Level": Register(17, 0, 2, 2),
    "Torque_Enable": Register(24, 0, 1, 0),
    "LED": Register(25, 0, 7, 0),
    **{name: Register(address, 0, 65535, 0, reading=True) for name, address in _FEEDBACK},
}, sizes={2: "Goal_Position Present_Position Present_Speed Present_Load"}, signs={
    "Present_Speed": 10, "Present_Load": 10}, units={
    "count": "Goal_Position Present_Position", f"{_SPEED_XL320} rpm": "Moving_Speed Present_Speed",
    "0.1 V": "Present_Voltage", "°C": "Present_Temperature"})
XL320_MODELS = (RegisterModel(
    name="XL-320", number=350, document="e-manual of the XL-320, control table",
    page="https://emanual.robotis.com/docs/en/dxl/x/xl320/", assumed=frozenset({"Moving_Speed"})),)
_CONTROL = (
    Setting("proportional_gain", lambda raw, _: raw["P_Gain"] * _GAIN, ("P_Gain",),
            "0.05048199 P of duty a radian, as an oscilloscope showed the authors of BAM"),
    Setting("integral_gain", lambda raw, _: raw["I_Gain"] * 1000.0 / 2048.0 * 8.0 * _GAIN, ("I_Gain",),
            "I 1000/2048 as of the MX series, where P is P/8", "assumed", (0.5, 2.0)),
    Setting("derivative_gain", lambda raw, _: raw["D_Gain"] * 4.0 / 1000.0 * 8.0 * _GAIN, ("D_Gain",),
            "D 4/1000 as of the MX series, where P is P/8", "assumed", (0.5, 2.0)),
    Setting("duty_limit", lambda raw, _: 1.0, said="as an oscilloscope showed the authors of BAM"),
)


def dynamixel_xl320(registers: Given, *, servo: str | Path | Servo) -> Servo:
    """Return a servo with registers of Dynamixel's XL-320 set into its firmware.

    Parameters
    ----------
    registers : mapping of str to int
        Raw values by the e-manual's names with underscores, such as ``{"P_Gain": 32}``. Angle 0 is at count 512, of
        300°/1023.
    servo : str, Path or Servo
        Catalog id, path of a servo file, or a servo. A register that is not given keeps its value, or has the
        factory's.

    Raises
    ------
    UnknownNameError
        If there is no such register: the nearest are suggested.
    ParameterError
        If a value is not whole, out of range or not computed.

    Examples
    --------
    >>> round(dynamixel_xl320({"P_Gain": 64}, servo="dynamixel-xl-320").firmware.proportional_gain, 3)
    3.231
    """
    base = servo if isinstance(servo, Servo) else load_servo(servo)
    return set_registers(family_of(base), registers, base)


def family_of(servo: Servo) -> Family:
    """Return the registers of an XL-320: there is one model."""
    return xl320_family(XL320_MODELS[0])


def xl320_family(model: RegisterModel) -> Family:
    """Return the registers of the model."""
    return Family(
        label="Dynamixel XL320", model=model.name, reference=model.document, count=_COUNT, middle=(_LAST + 1) // 2,
        registers=model.registers(REGISTERS),
        assumed=model.unseen(REGISTERS), masks=("Shutdown",), copied={"Torque_Limit": "Max_Torque"},
        settings=(*_CONTROL, *shared_settings(_COUNT, _LAST, _SPEED_XL320 * _RPM_XL320, _BITS_XL320)),
        check=lambda raw: check_limits("Dynamixel XL320", _LAST, raw))
