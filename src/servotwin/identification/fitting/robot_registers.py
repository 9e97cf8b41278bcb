"""The registers of a servo whose logs are of a robot: where they are the factory's, those that its program writes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from servotwin.logs.log import Log
from servotwin.models import Model
from servotwin.parameters.registers.robots import as_robot_has_it, said_of, set_of_robot


def as_logs_say(model: Model, logs: Sequence[Log]) -> tuple[Model, tuple[str, ...]]:
    """Return a model of the servo as the robot of its logs has it, and a line on what was assumed; none where nothing.

    A log's condition `robot` is LeRobot's `robot_type`, and its condition `joint` the servo's. Where logs are of
    several robots, nothing is assumed; where some are of a gripper, the other joints count.

    Parameters
    ----------
    model : Model
    logs : sequence of Log
    """
    robots = {str(log.conditions.get("robot", "")) for log in logs}
    joints = [str(log.conditions.get("joint", "")) for log in logs]
    if len(robots) != 1:
        return model, ()
    robot = robots.pop()
    joint = next((name for name in joints if "gripper" not in name.lower()), joints[0])
    servo = as_robot_has_it(model.servo, robot, joint)
    if servo is model.servo:
        return model, ()
    return type(model)(servo), (said_of(robot, set_of_robot(robot, joint)),)


def of_no_robot(logs: Sequence[Log]) -> list[Log]:
    """Return logs that do not say which robot they are of."""
    return [replace(log, conditions={name: value for name, value in log.conditions.items() if name != "robot"})
            for log in logs]
