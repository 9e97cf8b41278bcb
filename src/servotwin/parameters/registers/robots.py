"""Registers that a robot's servos have because its program writes them, where nothing else is known of them."""

from __future__ import annotations

from servotwin.parameters.registers.held import register_family_of
from servotwin.parameters.registers.sets import LEROBOT, LEROBOT_ELBOW, LEROBOT_GRIPPER
from servotwin.parameters.registers.table import family_label, set_registers, written
from servotwin.parameters.servo import Servo

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
