"""How the registers of bus servos lie in their memory: address, bytes, sign.

Names and addresses are those of `servotwin.parameters.registers`; bytes and signs stand here. Sources: Feetech's memory
table of SMS/STS servos, LeRobot's control and encoding tables, Feetech's SMS_STS library (signs of load and current),
Robotis' e-manual (X, MX, AX).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from servotwin.parameters.registers.dynamixel_one import AX_REGISTERS, MX_REGISTERS
from servotwin.parameters.registers.dynamixel_x import REGISTERS as X_REGISTERS
from servotwin.parameters.registers.feetech import REGISTERS as STS_REGISTERS
from servotwin.parameters.registers.table import Register

_CHUNK = 32  # bytes of one read of many registers


class BusRegister(NamedTuple):
    """Where a register lies, and what its bytes mean; the low byte first.

    Parameters
    ----------
    address, size : int
        Size in bytes: 1, 2 or 4.
    sign_bit : int, optional
        Bit that says minus, the other bits the magnitude.
    signed : bool
        Two's complement.

    Examples
    --------
    >>> BusRegister(60, 2, sign_bit=10).decode([0x64, 0x04]), BusRegister(126, 2, signed=True).decode([0xff, 0xff])
    (-100, -1)
    >>> BusRegister(42, 2, sign_bit=15).encode(-5).hex()
    '0580'
    """

    address: int
    size: int = 1
    sign_bit: int | None = None
    signed: bool = False

    def decode(self, data: Sequence[int]) -> int:
        """Return the number that the register's bytes mean."""
        raw = int.from_bytes(bytes(data[:self.size]), "little", signed=self.signed)
        if self.sign_bit is not None and raw >> self.sign_bit & 1:
            return -(raw & ((1 << self.sign_bit) - 1))
        return raw

    def encode(self, value: int) -> bytes:
        """Return a number as the register's bytes."""
        if self.sign_bit is not None and value < 0:
            value = -value | 1 << self.sign_bit
        return value.to_bytes(self.size, "little", signed=self.signed)


Table = Mapping[str, BusRegister]


def chunks(table: Table) -> list[tuple[int, int]]:
    """Return (address, bytes) of the reads that get all of a table; no register is cut.

    Examples
    --------
    >>> chunks({"a": BusRegister(0, 2), "b": BusRegister(30, 4), "c": BusRegister(40, 1)})
    [(0, 2), (30, 11)]
    """
    made: list[tuple[int, int]] = []
    for one in sorted(set(table.values())):
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


def _table(known: Mapping[str, Register], sizes: Mapping[int, str], signed: Mapping[str, int | None],
           leave: Sequence[str] = ()) -> dict[str, BusRegister]:
    """Return a table; `signed` has the bit of the sign by name, None for two's complement."""
    size_of = {name: size for size, names in sizes.items() for name in names.split()}
    return {name: BusRegister(one.address, size_of.get(name, 1), signed.get(name),
                              name in signed and signed[name] is None)
            for name, one in known.items() if name not in leave}


STS = _table(STS_REGISTERS, {2: (
    "Model_Number Min_Position_Limit Max_Position_Limit Max_Torque_Limit Protection_Current Homing_Offset "
    "Goal_Position Goal_Time Goal_Velocity Torque_Limit Present_Position Present_Velocity Present_Load "
    "Present_Current Goal_Position_2")}, {
    "Homing_Offset": 11, "Goal_Position": 15, "Goal_Velocity": 15, "Present_Position": 15, "Present_Velocity": 15,
    "Present_Load": 10, "Present_Current": 15, "Goal_Position_2": 15})
"""Feetech STS and SMS."""

_X_SIZES = {2: (
    "Model_Number PWM_Limit Current_Limit Velocity_I_Gain Velocity_P_Gain Position_D_Gain Position_I_Gain "
    "Position_P_Gain Feedforward_2nd_Gain Feedforward_1st_Gain Goal_PWM Goal_Current Realtime_Tick Present_PWM "
    "Present_Current Present_Load Present_Input_Voltage Max_Voltage_Limit Min_Voltage_Limit"), 4: (
    "Model_Information Homing_Offset Moving_Threshold Acceleration_Limit Velocity_Limit Max_Position_Limit "
    "Min_Position_Limit Goal_Velocity Profile_Acceleration Profile_Velocity Goal_Position Present_Velocity "
    "Present_Position Velocity_Trajectory Position_Trajectory")}
_X_SIGNED: dict[str, int | None] = dict.fromkeys((
    "Homing_Offset", "Goal_PWM", "Goal_Current", "Goal_Velocity", "Goal_Position", "Present_PWM", "Present_Current",
    "Present_Load", "Present_Velocity", "Present_Position", "Velocity_Trajectory", "Position_Trajectory"))
_OF_CURRENT = ("Current_Limit", "Goal_Current", "Present_Current")

X330 = _table(X_REGISTERS, _X_SIZES, _X_SIGNED, ("Present_Load",))
"""Dynamixel XL330 and XC330."""

X = _table(X_REGISTERS, _X_SIZES, _X_SIGNED, ("Present_Load", "PWM_Slope"))
"""Dynamixel X with a current sensor, and MX-64 and MX-106 with protocol 2."""

X_WITHOUT_CURRENT = _table(X_REGISTERS, _X_SIZES, _X_SIGNED, (*_OF_CURRENT, "PWM_Slope"))
"""Dynamixel XL430 and XC430, and MX-28 with protocol 2."""

_ONE_SIZES = {2: (
    "CW_Angle_Limit CCW_Angle_Limit Max_Torque Torque_Limit Moving_Speed Model_Number Goal_Position Present_Position "
    "Present_Speed Present_Load Punch Multi_Turn_Offset Realtime_Tick Current Goal_Torque")}
_ONE_SIGNED: dict[str, int | None] = {"Present_Speed": 10, "Present_Load": 10}

MX = _table(MX_REGISTERS, _ONE_SIZES, {
    **_ONE_SIGNED, "Goal_Position": None, "Present_Position": None, "Multi_Turn_Offset": None})
"""Dynamixel MX with protocol 1."""

AX = _table(AX_REGISTERS, _ONE_SIZES, _ONE_SIGNED)
"""Dynamixel AX."""
