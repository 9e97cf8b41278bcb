"""Registers that a program writes into a servo, as sets with a name."""

from __future__ import annotations

from collections.abc import Mapping

LEROBOT, LEROBOT_GRIPPER = "lerobot", "lerobot-gripper"
_ARM = {"Return_Delay_Time": 0, "Operating_Mode": 0, "P_Coefficient": 16, "I_Coefficient": 0, "D_Coefficient": 32,
        "Maximum_Acceleration": 254, "Acceleration": 254}
LEROBOT_SETS: Mapping[str, Mapping[str, int]] = {
    LEROBOT: _ARM,
    LEROBOT_GRIPPER: {**_ARM, "Max_Torque_Limit": 500, "Protection_Current": 250, "Overload_Torque": 25}}
"""What LeRobot writes into the servos of an SO-100 or SO-101 follower when it connects, the one of the gripper apart.

Source: github.com/huggingface/lerobot, robots/so_follower/so_follower.py, configure; motors/feetech/feetech.py,
configure_motors.
"""
