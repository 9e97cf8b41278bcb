"""How the registers of bus servos lie in their memory: address, bytes, sign.

Names, addresses, bytes and signs are those of `servotwin.parameters.registers`; those of protocol 1 have their bytes
and signs here (Robotis' e-manual of MX and AX).
"""

from __future__ import annotations

from collections.abc import Mapping

from servotwin.parameters.registers.dynamixel_one import AX_REGISTERS, MX_REGISTERS
from servotwin.parameters.registers.dynamixel_x import REGISTERS as X_REGISTERS
from servotwin.parameters.registers.feetech import REGISTERS as STS_REGISTERS
from servotwin.parameters.registers.register import Register, laid

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
