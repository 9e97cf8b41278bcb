"""Registers of Dynamixel's XL-320, by the names of the e-manual with underscores.

Protocol 2, but the control of the MX series before it, with an AX's counts.
"""

from __future__ import annotations

import math
from pathlib import Path

from servotwin.parameters.catalog import load_servo
from servotwin.parameters.registers.dynamixel_one import check_limits, shared_settings
from servotwin.parameters.registers.model import RegisterModel
from servotwin.parameters.registers.register import Register, laid
from servotwin.parameters.registers.table import Family, Given, Setting, set_registers
from servotwin.parameters.servo import Servo

_RPM, _DEG = math.pi / 30.0, math.pi / 180.0
_COUNT, _LAST, _SPEED = 300.0 / 1023.0 * _DEG, 1023, 0.111  # rad, counts, rpm
_BITS = (2, 1, 0)  # of Shutdown: voltage, heat, load
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
    "count": "Goal_Position Present_Position", f"{_SPEED} rpm": "Moving_Speed Present_Speed",
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
        Catalog id, path of a servo file, or a servo. What is not given stays as it has it, or is the factory's.

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
        settings=(*_CONTROL, *shared_settings(_COUNT, _LAST, _SPEED * _RPM, _BITS)),
        check=lambda raw: check_limits("Dynamixel XL320", _LAST, raw))
