"""LeRobot's own bus and arm, unchanged, at a port; in a process of its own, for it gets empty modules for torch."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from wire_served import served

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
pytestmark = [
    pytest.mark.lerobot, pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("lerobot") is None, reason="lerobot is not installed (CONTRIBUTING.md "
                       "says how, without torch)"),
    pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals here")]


def lerobot(what, port, folder):
    script = Path(__file__).parents[1] / "wire_lerobot.py"
    done = subprocess.run([sys.executable, script, what, port, folder], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_bus(tmp_path):
    with served("so101", "--no-body", "--keep", tmp_path / "kept.json") as facts:
        found = lerobot("bus", facts["port"], tmp_path)
    assert all(found["homed"][name] in (2047, 2048) for name in NAMES)
    assert found["calibrated"]
    assert found["again"]
    assert found["ids"] == {str(k): 777 for k in range(1, 7)}
    assert found["lost"] == 0
    assert all(abs(found["reached"][name] - 10.0) < 3.0 for name in NAMES)  # at P 16 it stands as low as that


def test_arm_with_a_hand(tmp_path):
    hand = tmp_path / "hand.csv"
    angles = "\n".join(f"{time}," + ",".join([str(angle)] * 6) for time, angle in ((0, 0), (1, 60), (3, -60), (4, 0)))
    hand.write_text("time_s," + ",".join(f"{name}_deg" for name in NAMES) + "\n" + angles + "\n", "utf-8")
    with served("so101", "--no-body", "--hand", hand) as facts:
        found = lerobot("arm", facts["port"], tmp_path)
    for name, (low, high, _) in found["calibration"].items():
        assert (low, high) == (0, 4095) if name == "wrist_roll" else high - low > 1000
    assert found["reached"] != found["seen"]
