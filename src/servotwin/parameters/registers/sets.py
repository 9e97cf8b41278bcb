"""Values that programs write into registers: sets with a name, and the registers that people change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

LEROBOT, LEROBOT_GRIPPER, LEROBOT_ELBOW = "lerobot", "lerobot-gripper", "lerobot-elbow"
_ARM = {"Return_Delay_Time": 0, "Operating_Mode": 0, "P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32,
        "Maximum_Acceleration": 254, "Acceleration": 254}
LEROBOT_SETS: Mapping[str, Mapping[str, int]] = {
    LEROBOT: _ARM,
    LEROBOT_GRIPPER: {**_ARM, "Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}}
"""What LeRobot writes into the servos of an SO-100 or SO-101 follower when it connects, the one of the gripper apart.

Source: github.com/huggingface/lerobot, robots/so_follower/so_follower.py, configure; motors/feetech/feetech.py,
configure_motors.
"""
LEROBOT_X_SETS: Mapping[str, Mapping[str, int]] = {
    LEROBOT_ELBOW: {"Position_P_Gain": 1500, "Position_I_Gain": 0, "Position_D_Gain": 600}}
"""What LeRobot writes into the elbow of a Koch or an OMX follower; the other joints keep the factory's gains.

Source: github.com/huggingface/lerobot, robots/koch_follower/koch_follower.py and robots/omx_follower/omx_follower.py,
configure.
"""

_NO_PROFILE: Mapping[str, float | None] = {"firmware.acceleration_limit": None, "firmware.speed_limit": None}


class RegisterSet(NamedTuple):
    """What may stand in registers of which nobody recorded anything.

    Parameters
    ----------
    name : str
        In words.
    registers : mapping of str to int
        Raw values; the others are as the servo has them.
    numbers : mapping of str to float or None
        Numbers of the servo that no value of a register makes (SI).
    """

    name: str
    registers: Mapping[str, int] = {}
    numbers: Mapping[str, float | None] = {}


class Varied(NamedTuple):
    """A register that people change, or several that get one value.

    Parameters
    ----------
    name : str
        In words.
    registers : tuple of str
    number : str
        Which number of the servo follows from them.
    values : tuple of int
        Raw values that are tried, in order.
    none : bool
        Whether that number may be absent although no value of the registers says so.
    """

    name: str
    registers: tuple[str, ...]
    number: str
    values: tuple[int, ...]
    none: bool = False


SETS: Mapping[str, tuple[RegisterSet, ...]] = {
    "Feetech STS": (
        RegisterSet("LeRobot's", _ARM), RegisterSet("LeRobot's with D 0", {**_ARM, "D_Coefficient": 0}),
        RegisterSet("no profile", {}, _NO_PROFILE), RegisterSet("D 0", {"D_Coefficient": 0}),
        RegisterSet("D 0 and no profile", {"D_Coefficient": 0}, _NO_PROFILE),
        RegisterSet("a program that sets the duty (mode 2)", {
            "D_Coefficient": 0, "Minimum_Startup_Force": 0, "CW_Dead_Zone": 0, "CCW_Dead_Zone": 0}, _NO_PROFILE)),
    "Dynamixel X": (RegisterSet("LeRobot's elbow of a Koch or OMX", LEROBOT_X_SETS[LEROBOT_ELBOW]),)}
"""By the label of the family."""

_GAIN, _DAMPING = "firmware.proportional_gain", "firmware.derivative_gain"
_ACCELERATION, _SPEED = "firmware.acceleration_limit", "firmware.speed_limit"
_TORQUE = "firmware.torque_limit"
_SMALL = (8, 12, 16, 24, 32, 48, 64)
VARIED: Mapping[str, tuple[Varied, ...]] = {
    "Feetech STS": (
        Varied("acceleration", ("Acceleration", "Maximum_Acceleration"), _ACCELERATION,
               (10, 20, 50, 100, 150, 254), none=True),
        Varied("P", ("P_Coefficient",), _GAIN, _SMALL),
        Varied("D", ("D_Coefficient",), _DAMPING, (0, 16, 32, 64)),
        Varied("speed", ("Maximum_Velocity_Limit",), _SPEED, (10, 20, 40, 68, 100, 160, 254)),
        Varied("torque", ("Max_Torque_Limit", "Torque_Limit"), _TORQUE, (150, 250, 400, 500, 700, 1000))),
    "Dynamixel X": (
        Varied("P", ("Position_P_Gain",), _GAIN, (100, 200, 400, 640, 800, 1500)),
        Varied("D", ("Position_D_Gain",), _DAMPING, (0, 300, 600, 1200, 4000)),
        Varied("acceleration", ("Profile_Acceleration",), _ACCELERATION, (0, 5, 10, 20, 50, 100, 200)),
        Varied("speed", ("Profile_Velocity",), _SPEED, (0, 20, 50, 100, 200, 400))),
    "Dynamixel MX": (
        Varied("P", ("P_Gain",), _GAIN, _SMALL), Varied("D", ("D_Gain",), _DAMPING, (0, 8, 32, 100)),
        Varied("acceleration", ("Goal_Acceleration",), _ACCELERATION, (0, 10, 20, 50, 100, 200)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800))),
    "Dynamixel AX": (
        Varied("slope", ("CW_Compliance_Slope", "CCW_Compliance_Slope"), _GAIN, (4, 8, 16, 32, 64, 128)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800))),
    "Dynamixel XL320": (
        Varied("P", ("P_Gain",), _GAIN, _SMALL), Varied("D", ("D_Gain",), _DAMPING, (0, 8, 32, 100)),
        Varied("speed", ("Moving_Speed",), _SPEED, (0, 50, 100, 200, 400, 800)))}
"""Registers that people and programs change, by the label of the family; the values are where a search begins."""
