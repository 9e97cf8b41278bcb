"""Draw the pictures of the guide on robots again: run this file, where MuJoCo can draw without a screen."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import servotwin as st
from servotwin import plotting
from servotwin.cli.robot_task_report import joint_uses
from servotwin.robots import AwayFromLimits, LeastMotion, LeastTorque, run_task, scara, task_path
from servotwin.robots.arms.task_run import NOMINAL, Case, Comparison

IMAGES = Path(__file__).resolve().parents[1] / "images"


def motion(folder):
    """Write a motion of an SO-101 class arm: it reaches out, closes its gripper and lifts."""
    time = np.linspace(0.0, 4.0, 201)
    s = 0.5 - 0.5 * np.cos(np.pi * np.clip(time / 1.5, 0.0, 1.0))  # out
    up = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - 2.2) / 1.5, 0.0, 1.0))
    close = 1.0 / (1.0 + np.exp((time - 1.9) / 0.05))
    table = np.column_stack([time, 40.0 * up, -60.0 + 75.0 * s - 75.0 * up, 60.0 - 55.0 * s + 55.0 * up,
                             30.0 + 20.0 * s - 20.0 * up, 60.0 * up, 5.0 + 40.0 * close])
    names = "shoulder_pan,shoulder_lift,elbow_flex,wrist_flex,wrist_roll,gripper".split(",")
    np.savetxt(folder / "pick.csv", table, delimiter=",", comments="",
               header="time_s," + ",".join(f"{name}_deg" for name in names))
    return folder / "pick.csv"


def servotwin(*words):
    """Run a command."""
    subprocess.run([sys.executable, "-m", "servotwin", "robot", *map(str, words)], check=True)


def by_fidelity():
    """Draw the circle of a SCARA by servos of four fidelities."""
    together = Comparison(servo=st.load_servo("hitec-hs-755hb"), bus_servo=st.load_servo("feetech-sts3215-12v"))
    traces, joints = [], None
    for servos in ("averaged", "bounded", "pulse", "digital"):
        case = Case("scara", "circle", servos, "plain", NOMINAL)
        joints = joints or together.joints(case)
        run = run_task(together.arm(case), together.model(case), joints.path, joint_path=joints)
        traces.append(plotting.ToolTrace(servos, run.run.time[run.moving], run.tool[run.moving], run.contour.error))
    plotting.save(plotting.tool_paths(joints.path.line, traces), IMAGES / "arm_compared.png")


def arms(folder):
    """Draw a SCARA robot at its task, its tool by fidelity, and what its third link is used for."""
    servotwin("scara", "--task", "circle", "--no-video", "--out", folder / "scara")
    shutil.copy(folder / "scara" / "robot.png", IMAGES / "arm_scara.png")
    servotwin("compare", "--out", folder / "compared")  # minutes
    shutil.copy(folder / "compared" / "conditions.png", IMAGES / "compare_conditions.png")
    by_fidelity()
    servotwin("two-link", "--task", "square", "--payload", "50g", "--no-video", "--out", folder / "two")
    shutil.copy(folder / "two" / "robot.png", IMAGES / "arm_two_link.png")
    arm = scara()
    path = task_path(arm, "square")
    ways = {one.name: one.solve(arm, path) for one in (LeastMotion(), AwayFromLimits(), LeastTorque())}
    plotting.save(joint_uses(ways), IMAGES / "arm_redundancy.png")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        servotwin("run", "so101", "--motion", motion(folder), "--supply", "12:0.3", "--no-video", "--out",
                  folder / "pick")
        shutil.copy(folder / "pick" / "robot.png", IMAGES / "robot_run.png")
        shutil.copy(folder / "pick" / "sizing.png", IMAGES / "robot_sizing.png")
        arms(folder)
    print("robot_run.png, robot_sizing.png, arm_scara.png, arm_compared.png, arm_two_link.png, arm_redundancy.png, "
          "compare_conditions.png")
