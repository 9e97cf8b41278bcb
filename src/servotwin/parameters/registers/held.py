"""Registers of a servo, and which numbers of its program follow from each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from servotwin.parameters.registers.dynamixel_one import ax_family_of, mx_family_of
from servotwin.parameters.registers.dynamixel_one import family_of as family_of_xl320
from servotwin.parameters.registers.dynamixel_x import family_of as family_of_x
from servotwin.parameters.registers.feetech import family_as_set
from servotwin.parameters.registers.table import (
    LEROBOT,
    LEROBOT_ELBOW,
    LEROBOT_GRIPPER,
    Family,
    Register,
    family_label,
    set_registers,
    written,
)
from servotwin.parameters.servo import Servo

# --- Registers of a servo, and which numbers of its program follow from each ------------------------------------------

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


# --- Registers that a robot's servos have because its program writes them, where nothing else is known of -------------

# Beginnings of LeRobot's `robot_type`: with one or two arms of an SO-100, SO-101; of a Koch or an OMX
_SO, _X = ("so100", "so101", "so_", "bi_so"), ("koch", "omx")


def set_of_robot(robot: str, joint: str = "") -> str:
    """Return the name of the set that LeRobot writes into the servo of a joint; empty where none is known.

    Examples
    --------
    >>> set_of_robot("so101_follower", "elbow_flex"), set_of_robot("so101_follower", "gripper")
    ('lerobot', 'lerobot-gripper')
    >>> set_of_robot("koch_follower", "elbow_flex"), set_of_robot("koch_follower", "wrist_flex")
    ('lerobot-elbow', '')
    """
    if robot.startswith(_X):
        return LEROBOT_ELBOW if "elbow_flex" in joint.lower() else ""
    if not robot.startswith(_SO):
        return ""
    return LEROBOT_GRIPPER if "gripper" in joint.lower() else LEROBOT


def left_by_lerobot(robot: str) -> str:
    """Return a sentence on the registers that LeRobot writes into a robot's servos and leaves; empty where not known.

    Examples
    --------
    >>> left_by_lerobot("koch_follower")[:73]
    'LeRobot writes P 1500, I 0 and D 600 into elbow_flex when it connects; it'
    """
    if robot.startswith(_X):
        return ("LeRobot writes P 1500, I 0 and D 600 into elbow_flex when it connects; it leaves the profile, the "
                "limits, and all gains of the other joints as they are")
    if robot.startswith(_SO):
        return ("LeRobot writes P 16, I 0, D 32 and an acceleration of 254 when it connects; it leaves the limit of "
                "speed, dead zones and startup force as they are, and other versions write other values")
    return ""


def as_robot_has_it(servo: Servo, robot: str, joint: str = "") -> Servo:
    """Return a servo with the registers that LeRobot writes into the one at a joint, as assumed.

    A servo of another family, or one whose registers of the set are not the factory's, is returned as it is, and so is
    one of a robot of which no set is known.

    Parameters
    ----------
    servo : Servo
    robot : str
        LeRobot's `robot_type`.
    joint : str

    Examples
    --------
    >>> from servotwin.parameters import load_servo
    >>> arm = as_robot_has_it(load_servo("feetech-sts3215-7v4"), "so101_follower", "elbow_flex")
    >>> arm.source("firmware.proportional_gain").source[:66]
    'Feetech STS firmware: register P_Coefficient (21) = 16 assumed; P/'
    """
    name = set_of_robot(robot, joint)
    family = register_family_of(servo) if name and family_label(servo) else None
    if family is None or name not in family.sets:
        return servo
    held, values = written(family, servo), family.sets[name]
    if any(held[key] != family.registers[key].factory for key in values):
        return servo
    return set_registers(family, name, servo, assumed=True)


def said_of(robot: str, *names: str) -> str:
    """Return a sentence on the registers that were assumed.

    Examples
    --------
    >>> said_of("so101_follower")
    "registers assumed as LeRobot writes them for so101_follower (set lerobot), not the factory's"
    """
    sets = " and ".join(dict.fromkeys(names or (LEROBOT,)))
    return f"registers assumed as LeRobot writes them for {robot} (set {sets}), not the factory's"
