"""Servos in robots: at the joints of MuJoCo models, in environments, and the motions that they follow."""

from typing import Any

from servotwin.robots.arm import Arm
from servotwin.robots.command_map import CommandMap
from servotwin.robots.contour import contour_error
from servotwin.robots.drive import ServoDrive
from servotwin.robots.kinematics import JointPath, follow
from servotwin.robots.mobile_robot import mobile_robot
from servotwin.robots.model_file import joint_names, joint_ranges, robot_model
from servotwin.robots.motion import Motion, read_motion
from servotwin.robots.mount import Mount
from servotwin.robots.pursuit import PurePursuit
from servotwin.robots.recipe import Recipe, recipe_of
from servotwin.robots.record import Record, ServoRecord
from servotwin.robots.redundancy import AwayFromLimits, LeastMotion, LeastTorque
from servotwin.robots.replay import JointError, Replay, RobotValidation, validate_robot
from servotwin.robots.run import RobotRun, run_motion
from servotwin.robots.scara import scara
from servotwin.robots.sizing import Sizing, sizing_of
from servotwin.robots.state import DriveState
from servotwin.robots.task_run import TaskMetrics, TaskRun, ideal_task, run_task
from servotwin.robots.tasks import ToolPath, task_path
from servotwin.robots.two_link import two_link
from servotwin.robots.waypoints import WaypointRun, ideal_waypoints, round_of, run_waypoints, unequal_servos
from servotwin.robots.wheels import Odometry, Pose, SpeedMap, wheel_servo, wheel_speed_of, worn

__all__ = [
    "Arm", "AwayFromLimits", "CommandMap", "DriveState", "JointError", "JointPath", "LeastMotion", "LeastTorque",
    "Motion", "Mount", "Odometry", "Pose", "PurePursuit", "Recipe", "Record", "Replay", "RobotRun",
    "RobotValidation", "ServoActuated", "ServoDrive", "ServoRecord", "Sizing", "SpeedMap", "TaskMetrics", "TaskRun",
    "ToolPath", "WaypointRun", "contour_error", "follow", "ideal_task", "ideal_waypoints", "joint_names",
    "joint_ranges", "mobile_robot", "read_motion", "recipe_of", "robot_model", "round_of", "run_motion", "run_task",
    "run_waypoints", "scara", "sizing_of", "task_path", "two_link", "unequal_servos", "validate_robot",
    "wheel_servo", "wheel_speed_of", "worn",
]


def __getattr__(name: str) -> Any:
    if name == "ServoActuated":  # Gymnasium is slow to load, and an extra
        from servotwin.robots.gym import ServoActuated

        return ServoActuated
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
