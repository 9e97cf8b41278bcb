"""Families of bus servos: by which registers they are told where to go and tell where they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from servotwin.bench.bus import registers as tables
from servotwin.bench.bus.registers import Table
from servotwin.errors import BenchError

_ZERO_CELSIUS = 273.15
_RPM = 6.0  # deg/s
_ANY_STS, _ANY_MX, _ANY_X = 32767, 28672, 1048575  # counts either way, where the servo turns without end


class Channel(NamedTuple):
    """A column of a log, made of a register: scale · raw + offset.

    Parameters
    ----------
    column, register : str
    scale, offset : float
        In the unit that the column's name says.
    """

    column: str
    register: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, kw_only=True)
class BusFamily:
    """Servos that have the same registers.

    Parameters
    ----------
    name : str
        As in `servotwin.parameters.registers.REGISTER_FAMILIES`.
    protocol : {"feetech", "dynamixel-2", "dynamixel-1"}
    registers : mapping of str to BusRegister
    block : tuple of int
        Address and bytes of what is read in every row.
    count : float
        Angle of a count [deg].
    middle : int
        Count at angle 0.
    channels : tuple of Channel
        Columns beside angle and speed.
    speed : Channel
    errors : mapping of int to str
        What the bits of the status byte say.
    source : str
        Of all this.
    """

    name: str
    protocol: str
    registers: Table
    block: tuple[int, int]
    count: float
    middle: int
    speed: Channel
    channels: tuple[Channel, ...]
    errors: Mapping[int, str]
    source: str

    def columns(self, values: Mapping[str, int]) -> tuple[Channel, ...]:
        """Return what a row holds, for a servo with these raw values in its registers."""
        angle = Channel("output_angle_deg", "Present_Position", self.count, -self.middle * self.count)
        speed = self.speed
        if self.name == "feetech-sts" and not values.get("Phase", 4) >> 2 & 1:
            speed = speed._replace(scale=50.0 * speed.scale)  # as of Goal_Velocity
        return (angle, speed, *self.channels)

    def goals(self, values: Mapping[str, int]) -> tuple[int, int]:
        """Return the lowest and the highest goal that the servo takes [counts].

        Raises
        ------
        BenchError
            If it is not set to control its angle.
        """
        mode = values.get("Operating_Mode", 3 if self.protocol == "dynamixel-2" else 0)
        if self.protocol == "feetech":
            low, high, turns = values.get("Min_Position_Limit", 0), values.get("Max_Position_Limit", 0), _ANY_STS
            wrong, endless = mode != 0, low == high == 0
        elif self.protocol == "dynamixel-2":
            low, high, turns = values.get("Min_Position_Limit", 0), values.get("Max_Position_Limit", 4095), _ANY_X
            wrong, endless = mode not in (3, 4, 5), mode in (4, 5)
        else:
            low, high, turns = values.get("CW_Angle_Limit", 0), values.get("CCW_Angle_Limit", 1023), _ANY_MX
            wrong, endless = low == high == 0, low == high
        if wrong:
            raise BenchError(f"servo {values.get('ID', '')}", "it is not set to control its angle (Operating_Mode, or "
                             "both angle limits 0)")
        return (-turns, turns) if endless else (low, high)


def _heat(register: str) -> Channel:
    return Channel("housing_temperature_K", register, 1.0, _ZERO_CELSIUS)


_TURN = 360.0 / 4096.0  # deg
_STS = BusFamily(
    name="feetech-sts", protocol="feetech", registers=tables.STS, block=(56, 15), count=_TURN, middle=2048,
    speed=Channel("output_speed_deg_per_s", "Present_Velocity", _TURN),
    channels=(
        Channel("duty", "Present_Load", 1e-3),
        # assumed: what Protection_Current is compared with, the motor's
        Channel("armature_current_A", "Present_Current", 6.5e-3),
        Channel("bus_voltage_V", "Present_Voltage", 0.1), _heat("Present_Temperature")),
    errors={1: "voltage", 2: "angle sensor", 4: "heat", 8: "current", 32: "overload"},
    source="Feetech's memory table of SMS/STS servos; SMS_STS library")


def _x(registers: Table, *current: Channel) -> BusFamily:
    return BusFamily(
        name="dynamixel-x", protocol="dynamixel-2", registers=registers, block=(124, 23), count=_TURN, middle=2048,
        speed=Channel("output_speed_deg_per_s", "Present_Velocity", 0.229 * _RPM),
        channels=(Channel("duty", "Present_PWM", 1.0 / 885.0), *current,
                  Channel("bus_voltage_V", "Present_Input_Voltage", 0.1), _heat("Present_Temperature")),
        # of Hardware_Error_Status; the status byte has one bit for all of them
        errors={1: "voltage", 4: "heat", 8: "encoder", 16: "electric shock or too little power", 32: "overload"},
        source="e-manual of the X series")


def _one(name: str, registers: Table, count: float, middle: int, rpm: float) -> BusFamily:
    return BusFamily(
        name=name, protocol="dynamixel-1", registers=registers, block=(36, 8), count=count, middle=middle,
        speed=Channel("output_speed_deg_per_s", "Present_Speed", rpm * _RPM),
        channels=(Channel("present_load", "Present_Load", 1.0 / 1023.0),
                  Channel("bus_voltage_V", "Present_Voltage", 0.1), _heat("Present_Temperature")),
        errors={1: "voltage", 2: "angle limit", 4: "heat", 8: "range", 16: "checksum", 32: "overload",
                64: "instruction"},
        source="e-manual, protocol 1")


def _motor(unit: float) -> Channel:
    return Channel("armature_current_A", "Present_Current", unit)


_X330 = _x(tables.X330, Channel("supply_current_A", "Present_Current", 1e-3))
_X = _x(tables.X, _motor(2.69e-3))
_XV = _x(tables.X, _motor(1.34e-3))
_MX2 = _x(tables.X, _motor(3.36e-3))
_BARE = _x(tables.X_WITHOUT_CURRENT, Channel("present_load", "Present_Load", 1e-3))
_MX = _one("dynamixel-mx", tables.MX, _TURN, 2048, 0.114)
_AX = _one("dynamixel-ax", tables.AX, 300.0 / 1023.0, 512, 0.111)


class BusModel(NamedTuple):
    """A model of bus servo.

    Parameters
    ----------
    number : int
        That it answers with.
    name : str
    family : BusFamily
    """

    number: int
    name: str
    family: BusFamily


_NAMES: tuple[tuple[BusFamily, str], ...] = (
    (_STS, "777 STS3215, 2825 STS3250"),
    (_X330, "1190 XL330-M077, 1200 XL330-M288, 1210 XC330-T181, 1220 XC330-T288, 1230 XC330-M181, 1240 XC330-M288"),
    (_BARE, "1060 XL430-W250, 1070 XC430-W150, 1080 XC430-W240, 1090 2XL430-W250, 1160 2XC430-W250, 30 MX-28(2.0)"),
    (_X, "1000 XH430-W350, 1010 XH430-W210, 1020 XM430-W350, 1030 XM430-W210, 1100 XH540-W270, 1110 XH540-W150, "
         "1120 XM540-W270, 1130 XM540-W150, 1140 XH540-V270, 1150 XH540-V150, 1170 XW540-T260, 1180 XW540-T140"),
    (_XV, "1040 XH430-V350, 1050 XH430-V210"),
    (_MX2, "311 MX-64(2.0), 321 MX-106(2.0)"),
    (_MX, "29 MX-28, 310 MX-64, 320 MX-106, 360 MX-12W"),
    (_AX, "12 AX-12A, 18 AX-18A, 300 AX-12W"),
)
MODELS: dict[tuple[str, int], BusModel] = {
    (family.protocol, int(number)): BusModel(int(number), name, family)
    for family, words in _NAMES for number, name in (word.split(" ", 1) for word in words.split(", "))}
"""By protocol and model number; numbers as LeRobot and Robotis list them."""

MODEL_NUMBER_AT = {"feetech": 3, "dynamixel-2": 0, "dynamixel-1": 0}
"""Address of the model number, of two bytes, by protocol."""


def count_of(family: BusFamily, angle: float) -> int:
    """Return the goal in counts that is nearest to an angle [rad].

    Examples
    --------
    >>> count_of(MODELS["feetech", 777].family, math.pi / 2)
    3072
    """
    return round(math.degrees(angle) / family.count) + family.middle
