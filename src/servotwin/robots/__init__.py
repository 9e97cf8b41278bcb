"""Servos in robots: at the joints of MuJoCo models, in environments, and the motions that they follow."""

from typing import Any

from servotwin.robots.actuator_recipe import Recipe, recipe_of
from servotwin.robots.arms.arm import Arm, scara, two_link
from servotwin.robots.arms.task_run import TaskMetrics, TaskRun, ideal_task, run_task
from servotwin.robots.arms.tasks import AwayFromLimits, JointPath, LeastMotion, LeastTorque, ToolPath, follow, task_path
from servotwin.robots.drive import DriveState, ServoDrive
from servotwin.robots.mjcf_models import mobile_robot
from servotwin.robots.model_file import joint_names, joint_ranges, robot_model
from servotwin.robots.motion import Motion, read_motion
from servotwin.robots.replay import JointError, Replay, RobotValidation, validate_robot
from servotwin.robots.run import RobotRun, run_motion
from servotwin.robots.servos.command_map import CommandMap
from servotwin.robots.servos.mount import Mount
from servotwin.robots.servos.record import Record, ServoRecord
from servotwin.robots.sizing import Sizing, sizing_of
from servotwin.robots.tracking import contour_error
from servotwin.robots.waypoints import (
    Odometry,
    Pose,
    PurePursuit,
    SpeedMap,
    WaypointRun,
    ideal_waypoints,
    round_of,
    run_waypoints,
    unequal_servos,
    wheel_servo,
    wheel_speed_of,
    worn,
)

__all__ = [
    "Arm", "AwayFromLimits", "CommandMap", "DriveState", "JointError", "JointPath", "LeastMotion", "LeastTorque",
    "Motion", "Mount", "Odometry", "Pose", "PurePursuit", "Recipe", "Record", "Replay", "RobotRun",
    "RobotValidation", "ServoActuated", "ServoDrive", "ServoRecord", "Sizing", "SpeedMap", "TaskMetrics", "TaskRun",
    "ToolPath", "WarpDrive", "WaypointRun", "contour_error", "follow", "ideal_task", "ideal_waypoints", "joint_names",
    "joint_ranges", "mobile_robot", "read_motion", "recipe_of", "robot_model", "round_of", "run_motion", "run_task",
    "run_waypoints", "scara", "sizing_of", "task_path", "two_link", "unequal_servos", "validate_robot",
    "wheel_servo", "wheel_speed_of", "worn",
]


def __getattr__(name: str) -> Any:
    if name == "ServoActuated":  # Gymnasium is slow to load, and an extra
        from servotwin.robots.gym import ServoActuated

        return ServoActuated
    if name == "WarpDrive":
        from servotwin.robots.trainers.warp_drive import WarpDrive

        return WarpDrive
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
