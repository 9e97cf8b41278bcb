"""`servotwin robot fit`: its files, and what is refused in one line."""

import json

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")

import servotwin as st
from robots.robots_cases import links
from robots.test_replay import JOINTS, recorded


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """A folder with an arm and a table of two episodes of it."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    motion = recorded()
    (tmp_path / "arm.xml").write_text(links(dt=2e-3))
    names = [f"{side}.{joint}_rad" for side in ("action", "state") for joint in JOINTS]
    rows = np.column_stack([motion.time, *(some[joint] for some in (motion.angles, motion.measured)
                                           for joint in JOINTS)])
    both = np.concatenate([np.column_stack([np.full(len(rows), k), rows]) for k in range(2)])
    np.savetxt(tmp_path / "arm.csv", both, delimiter=",", comments="",
               header=",".join(["episode_index", "timestamp", *names]))
    return tmp_path


WORDS = ("robot", "fit", "arm.xml", "arm.csv", "--servo", "*=feetech-sts3215-12v", "--no-intervals", "--no-diagnose")


def test_servo_files_a_page_and_numbers(cli, arm):
    ended = cli(*WORDS, "--out", "out", "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)
    assert told["unseen"]["rms"] < 0.5 * told["before_unseen"]["rms"]
    assert {path.name for path in (arm / "out").iterdir()} == {
        "shoulder.toml", "elbow.toml", "summary.json", "errors.png", "windows.png", "index.html"}
    servo = st.load_servo(arm / "out" / "elbow.toml")
    assert servo.source("motor.armature_resistance").origin == "identified"
    checked = cli("robot", "validate", "arm.xml", "arm.csv", "--servo", "*=out/elbow.toml", "--json")
    assert checked.code == 0, checked.err
    assert json.loads(checked.out)["rms"]["servos"] < 2.0 * told["unseen"]["rms"] + 1e-3


def test_what_is_printed(cli, arm):
    ended = cli(*WORDS, "--episode", "0")
    assert ended.code == 0, ended.err
    assert "nothing was held out" in ended.out
    assert "output_torque_constant" in ended.out
    unknown = cli("robot", "fit", "unknown", *WORDS[3:])
    assert unknown.code == 0, unknown.err
    assert "no robot file" in unknown.out


@pytest.mark.parametrize(("words", "said"), [
    (("robot", "fit", "so101", "arm.csv"), "joint of the robot"),
    (("robot", "fit", "nobody.xml", "arm.csv"), "nobody.xml is no file"),
    (("robot", "fit", "arm.xml", "arm.csv"), "servos of the robot"),
    ((*WORDS, "--holdout", "2"), "holdout: got 2"),
    (("robot", "fit", "arm.xml", "none.csv", "--servo", "*=feetech-sts3215-12v"), "none.csv"),
])
def test_bad_input(cli, arm, words, said):
    ended = cli(*words)
    assert ended.code == 2
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1
