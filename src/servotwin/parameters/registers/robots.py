"""Registers that a robot's servos have because its program writes them, where nothing else is known of them."""

from __future__ import annotations

from servotwin.parameters.registers.feetech import family_of
from servotwin.parameters.registers.sets import LEROBOT, LEROBOT_GRIPPER, LEROBOT_SETS
from servotwin.parameters.registers.table import family_label, set_registers, written
from servotwin.parameters.servo import Servo

_ROBOTS = ("so100", "so101", "so_", "bi_so")  # beginnings of LeRobot's `robot_type`, with one or two such arms


def set_of_robot(robot: str, joint: str = "") -> str:
    """Return the name of the set that LeRobot writes into the servo of a joint; empty where none is known.

    Examples
    --------
    >>> set_of_robot("so101_follower", "elbow_flex"), set_of_robot("so101_follower", "gripper"), set_of_robot("koch")
    ('lerobot', 'lerobot-gripper', '')
    """
    if not robot.startswith(_ROBOTS):
        return ""
    return LEROBOT_GRIPPER if "gripper" in joint.lower() else LEROBOT


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
    if not name or family_label(servo) != "Feetech STS":
        return servo
    family = family_of(servo)
    held, values = written(family, servo), LEROBOT_SETS[name]
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
