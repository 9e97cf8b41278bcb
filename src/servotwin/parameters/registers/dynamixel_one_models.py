"""Models of Dynamixel's MX and AX series, protocol 1, each against the control table of its own e-manual page."""

from __future__ import annotations

from dataclasses import dataclass

from servotwin.parameters.registers.model import RegisterModel

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
    # its page prints 104 as model number; 360 is what programs know it by
    _one("MX-12W", 360, "mx", 0.916, unprinted=_LARGE | _DUAL | {"Model_Number"}, P_Gain=8, D_Gain=8, Punch=32),
)
AX_MODELS = (
    _one("AX-12A", 12, "ax", 0.111, Max_Voltage_Limit=140),
    _one("AX-18A", 18, "ax", 0.111, Max_Voltage_Limit=140, Temperature_Limit=75, Max_Torque=983, Torque_Limit=983),
    _one("AX-12W", 300, "ax", 0.111, seen=False, Max_Voltage_Limit=140),
)
"""Of each series the first is what counts for a servo that does not tell its model."""
