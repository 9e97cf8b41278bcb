"""Families of bus servos: which registers take the goal, and which give the position.

Names, addresses, bytes and signs are those of `servotwin.parameters.registers`; those of protocol 1 have their bytes
and signs here (Robotis' e-manual of MX and AX).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from servotwin import plugins
from servotwin.errors import BenchError
from servotwin.parameters.registers.dynamixel_one import AX_MODELS, AX_REGISTERS, MX_MODELS, MX_REGISTERS
from servotwin.parameters.registers.dynamixel_x import FULL, SPEED, X_MODELS, XModel
from servotwin.parameters.registers.dynamixel_x import REGISTERS as X_REGISTERS
from servotwin.parameters.registers.feetech import REGISTERS as STS_REGISTERS
from servotwin.parameters.registers.feetech import STS_MODELS
from servotwin.parameters.registers.table import Register, RegisterModel, laid

# --- How the registers of bus servos lie in their memory: address, bytes, sign ----------------------------------------

_CHUNK = 32  # bytes of one read of many registers
Table = Mapping[str, Register]


def chunks(table: Table) -> list[tuple[int, int]]:
    """Return (address, bytes) of the reads that get all of a table; no register is cut.

    Examples
    --------
    >>> chunks({"a": Register(0, 0, 9, 0, size=2), "b": Register(30, 0, 9, 0, size=4), "c": Register(40, 0, 9, 0)})
    [(0, 2), (30, 11)]
    """
    made: list[tuple[int, int]] = []
    for one in sorted(table.values(), key=lambda one: (one.address, one.size)):
        end = one.address + one.size
        if made and end - made[-1][0] <= _CHUNK:
            made[-1] = (made[-1][0], max(end - made[-1][0], made[-1][1]))
        else:
            made.append((one.address, one.size))
    return made


def decoded(table: Table, memory: Mapping[int, int]) -> dict[str, int]:
    """Return the raw values by name that bytes by address say; registers with bytes missing are left out."""
    found = {}
    for name, one in table.items():
        places = range(one.address, one.address + one.size)
        if all(place in memory for place in places):
            found[name] = one.decode([memory[place] for place in places])
    return found


def _without(known: Mapping[str, Register], *leave: str) -> dict[str, Register]:
    return {name: one for name, one in known.items() if name not in leave}


_OF_CURRENT = ("Current_Limit", "Goal_Current", "Present_Current")
STS = STS_REGISTERS
"""Feetech STS and SMS."""
X330 = _without(X_REGISTERS, "Present_Load")
"""Dynamixel XL330 and XC330."""
X = _without(X_REGISTERS, "Present_Load", "PWM_Slope")
"""Dynamixel X with a current sensor, and MX-64 and MX-106 with protocol 2."""
X_WITHOUT_CURRENT = _without(X_REGISTERS, *_OF_CURRENT, "PWM_Slope")
"""Dynamixel XL430 and XC430, and MX-28 with protocol 2."""
_ONE_SIZES = {2: (
    "CW_Angle_Limit CCW_Angle_Limit Max_Torque Torque_Limit Moving_Speed Model_Number Goal_Position Present_Position "
    "Present_Speed Present_Load Punch Multi_Turn_Offset Realtime_Tick Current Goal_Torque")}
_ONE_SIGNS: dict[str, int | None] = {"Present_Speed": 10, "Present_Load": 10}
MX = laid(MX_REGISTERS, sizes=_ONE_SIZES, signs={
    **_ONE_SIGNS, "Goal_Position": None, "Present_Position": None, "Multi_Turn_Offset": None})
"""Dynamixel MX with protocol 1."""
AX = laid(AX_REGISTERS, sizes=_ONE_SIZES, signs=_ONE_SIGNS)
"""Dynamixel AX."""

# --- Families of bus servos: which registers take the goal, and which give the position -------------------------------

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
        Errors by their bits in the status byte.
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
    name="feetech-sts", protocol="feetech", registers=STS, block=(56, 15), count=_TURN, middle=2048,
    speed=Channel("output_speed_deg_per_s", "Present_Velocity", _TURN),
    channels=(
        Channel("duty", "Present_Load", 1e-3),
        # assumed: what Protection_Current is compared with, the motor's
        Channel("armature_current_A", "Present_Current", STS_MODELS[0].current_unit),
        Channel("bus_voltage_V", "Present_Voltage", 0.1), _heat("Present_Temperature")),
    errors={1: "voltage", 2: "angle sensor", 4: "heat", 8: "current", 32: "overload"},
    source="Feetech's memory table of SMS/STS servos; SMS_STS library")


def _x(registers: Table, *current: Channel) -> BusFamily:
    return BusFamily(
        name="dynamixel-x", protocol="dynamixel-2", registers=registers, block=(124, 23), count=_TURN, middle=2048,
        speed=Channel("output_speed_deg_per_s", "Present_Velocity", SPEED * _RPM),
        channels=(Channel("duty", "Present_PWM", 1.0 / FULL), *current,
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


def _of_x(model: XModel) -> BusFamily:
    """Return the registers of a model of the X series, or of an MX with protocol 2."""
    if model.current_unit is None:
        return _x(X_WITHOUT_CURRENT, Channel("present_load", "Present_Load", 1e-3))
    if model.current_sense == "bus":
        return _x(X330, Channel("supply_current_A", "Present_Current", model.current_unit))
    return _x(X, Channel("armature_current_A", "Present_Current", model.current_unit))


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


def _known() -> Iterator[tuple[RegisterModel, BusFamily]]:
    yield from ((model, _STS) for model in STS_MODELS)
    yield from ((model, _of_x(model)) for model in X_MODELS)
    yield from ((model, _one("dynamixel-mx", MX, _TURN, 2048, model.speed_unit)) for model in MX_MODELS)
    yield from ((model, _one("dynamixel-ax", AX, 300.0 / 1023.0, 512, model.speed_unit)) for model in AX_MODELS)


def _models() -> dict[tuple[str, int], BusModel]:
    found: dict[tuple[str, int], BusModel] = {}
    for model, family in _known():
        key = family.protocol, model.number  # what two models answer with tells their series alone
        found[key] = BusModel(model.number, model.series if key in found else model.name, family)
    return found


MODELS = _models()
"""By protocol and model number, without those of plug-ins; numbers as LeRobot and Robotis list them."""


@cache
def known_models() -> dict[tuple[str, int], BusModel]:
    """Return all models by protocol and model number: `MODELS`, and those of plug-ins."""
    found = dict(MODELS)
    for pairs in plugins.loaded("bus_models", use=lambda models: [
            ((family.protocol, model.number), BusModel(model.number, model.name, family))
            for model, family in models()]).values():
        for key, model in pairs:
            if key in found:
                plugins.leave_out(f"bus model {model.name}", f"{found[key].name} has its number, {model.number}")
            else:
                found[key] = model
    return found


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
