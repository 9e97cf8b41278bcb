"""Registers of servos that follow an episode of LeRobot: where they are the factory's, those that LeRobot writes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from servotwin.parameters.registers.robots import as_robot_has_it, said_of, set_of_robot
from servotwin.robots.motion import Motion
from servotwin.robots.mount import Mount


def as_motion_says(mounts: Mapping[str, Mount], motion: Motion) -> tuple[dict[str, Mount], tuple[str, ...]]:
    """Return mounts with the servos as the robot of a motion has them, and a line on what was assumed; none if nothing.

    Parameters
    ----------
    mounts : mapping of str to Mount
    motion : Motion
        Its `robot` says which; empty: nothing is assumed.
    """
    found, changed = dict(mounts), dict[str, str]()
    for joint, mount in mounts.items():
        servo = as_robot_has_it(mount.model.servo, motion.robot, joint)
        if servo is not mount.model.servo:
            found[joint] = replace(mount, model=type(mount.model)(servo))
            changed[joint] = set_of_robot(motion.robot, joint)
    return found, (said_of(motion.robot, *changed.values()),) if changed else ()
