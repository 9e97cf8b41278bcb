"""What stands in the registers of a servo, and which numbers of its program follow from each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from servotwin.parameters.registers.dynamixel_one import ax_family_of, mx_family_of
from servotwin.parameters.registers.dynamixel_x import family_of as family_of_x
from servotwin.parameters.registers.dynamixel_xl320 import family_of as family_of_xl320
from servotwin.parameters.registers.feetech import family_as_set
from servotwin.parameters.registers.register import Register
from servotwin.parameters.registers.table import Family, family_label, written
from servotwin.parameters.servo import Servo

_FAMILIES: dict[str, Callable[[Servo], Family]] = {
    "Feetech STS": family_as_set, "Dynamixel X": family_of_x, "Dynamixel MX": mx_family_of,
    "Dynamixel AX": ax_family_of, "Dynamixel XL320": family_of_xl320}


class Held(NamedTuple):
    """A register, what it holds, and the numbers of the firmware group that follow from it."""

    register: Register
    value: int
    numbers: tuple[str, ...]


def register_family_of(servo: Servo) -> Family:
    """Return the registers of a servo that has some, and how its program follows from them."""
    return _FAMILIES[family_label(servo) or ""](servo)


def registers_of(servo: Servo) -> dict[str, Held]:
    """Return the registers from which numbers of a servo's program follow, by name; none of a servo without.

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> held = registers_of(load_servo("feetech-sts3215-12v"))["P_Coefficient"]
    >>> held.value, held.register.upper, held.numbers
    (32, 254, ('proportional_gain',))
    """
    label = family_label(servo)
    if label is None:
        return {}
    family = register_family_of(servo)
    raw = written(family, servo)
    numbers = {name: tuple(one.name for one in family.settings if name in one.registers) for name in family.registers}
    return {name: Held(register, raw[name], numbers[name]) for name, register in family.registers.items()
            if numbers[name]}
