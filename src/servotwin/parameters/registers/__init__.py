"""Registers of bus servos: raw values, as they are written into a servo, become the numbers of its firmware."""

from pathlib import Path
from typing import Protocol

from servotwin.parameters.registers.dynamixel_one import dynamixel_ax, dynamixel_mx, dynamixel_xl320
from servotwin.parameters.registers.dynamixel_x import dynamixel_x
from servotwin.parameters.registers.feetech import feetech_sts
from servotwin.parameters.registers.table import Given
from servotwin.parameters.servo import Servo

__all__ = ["REGISTER_FAMILIES", "dynamixel_ax", "dynamixel_mx", "dynamixel_x", "dynamixel_xl320", "feetech_sts"]


class _Setter(Protocol):
    def __call__(self, registers: Given, *, servo: str | Path | Servo) -> Servo: ...


REGISTER_FAMILIES: dict[str, _Setter] = {
    "feetech-sts": feetech_sts, "dynamixel-x": dynamixel_x, "dynamixel-mx": dynamixel_mx,
    "dynamixel-ax": dynamixel_ax, "dynamixel-xl320": dynamixel_xl320}
"""By the word that sheets call them by; they come ready of the factory with no register given."""
