"""Draw the pictures of the guide on robots again: run this file, where MuJoCo can draw without a screen."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

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


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-m", "servotwin", "robot", "run", "so101", "--motion", str(motion(folder)),
                        "--supply", "12:0.3", "--no-video", "--out", str(folder / "pick")], check=True)
        shutil.copy(folder / "pick" / "robot.png", IMAGES / "robot_run.png")
        shutil.copy(folder / "pick" / "sizing.png", IMAGES / "robot_sizing.png")
    print("robot_run.png, robot_sizing.png")
