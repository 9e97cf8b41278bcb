"""`servotwin robot fit`: its files, and what is refused in one line."""

import contextlib
import json
import signal
import subprocess
import sys
import time as clock
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")

import servotwin as st
from robots.robots_cases import links
from robots.test_replay import JOINTS, recorded
from servotwin.identification.fitting import checks
from servotwin.identification.fitting.search import stopping

pytestmark = pytest.mark.long


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


WORDS = ("robot", "fit", "arm.xml", "arm.csv", "--servo", "*=feetech-sts3215-12v", "--no-intervals", "--no-trials")


def test_servo_files_a_page_and_numbers(cli, arm):
    """A hinge beside the arm of which nothing was recorded has a servo too: that is not fitted, and gets no file."""
    beside = '<body pos="1 0 0"><joint name="beside" axis="0 1 0"/><geom size=".01" mass=".01"/></body></worldbody>'
    (arm / "arm.xml").write_text((arm / "arm.xml").read_text().replace("</worldbody>", beside))
    ended = cli(*WORDS, "--out", "out", "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)
    assert told["unseen"]["rms"] < 0.5 * told["before_unseen"]["rms"]
    assert {path.name for path in (arm / "out").iterdir()} == FILES
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


STOPPED = """
import contextlib, signal, sys
from servotwin.identification.fitting import checks

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore them
number, stage = int(sys.argv.pop(1)), sys.argv.pop(1)

@contextlib.contextmanager
def shown(progress):
    if callable(progress):
        yield progress
        return
    begun, sent = [], []

    def tell(share, text):
        if begun and text.startswith(stage) and not sent:
            sent.append(text)
            signal.raise_signal(number)
        begun.extend([share] if share > 0.0 else [])

    yield tell

checks.shown = shown
from servotwin.cli import main
main()
"""
FILES = {"shoulder.toml", "elbow.toml", "summary.json", "errors.png", "windows.png", "index.html"}


@pytest.mark.parametrize(("number", "code", "stage", "unknown"), [
    (signal.SIGINT, 130, "joints one by one", ["where the search of single joints ends", "what the whole robot does",
                                               "intervals"]),
    (signal.SIGTERM, 143, "the whole robot", ["what the whole robot does", "intervals"])])
def test_a_stop_keeps_the_best_so_far(arm, child_environment, number, code, stage, unknown):
    words = [word for word in WORDS if word != "--no-intervals"]
    done = subprocess.run([sys.executable, "-c", STOPPED, str(int(number)), stage, *words, "--out", "out"],
                          capture_output=True, text=True, cwd=arm, env=child_environment, check=False)
    assert done.returncode == code, done.stderr
    assert "interrupted; keeping the best so far" in done.stderr
    assert f"not known are {', '.join(unknown)}" in " ".join(done.stdout.split())
    assert {path.name for path in (arm / "out").iterdir()} == FILES
    told = json.loads((arm / "out" / "summary.json").read_text())
    assert told["interrupted"]
    assert told["unknown"] == unknown
    assert told["unseen"]["rms"] < told["before_unseen"]["rms"]
    assert "stopped: the best so far" in (arm / "out" / "index.html").read_text()


@pytest.fixture
def hour_passes(monkeypatch):
    """Lets an hour pass where the search of the whole robot begins, whatever time this machine takes until there."""
    ahead = []
    monkeypatch.setattr(stopping, "clock", SimpleNamespace(monotonic=lambda: clock.monotonic() + 3600.0 * len(ahead)))

    @contextlib.contextmanager
    def shown(progress):
        yield lambda share, text: ahead.extend(["an hour"] if text.startswith("the whole robot") else [])

    monkeypatch.setattr(checks, "shown", shown)


@pytest.mark.usefixtures("hour_passes")
def test_a_time_keeps_the_best_so_far(cli, arm):
    words = [word for word in WORDS if word != "--no-intervals"]
    ended = cli(*words, "--within", "59min", "--json")
    assert ended.code == 0, ended.err
    assert ended.data["interrupted"]
    assert ended.data["unknown"] == ["what the whole robot does", "intervals"]
    assert ended.data["unseen"]["rms"] < ended.data["before_unseen"]["rms"]


def test_a_time_in_which_nothing_is_found(cli, arm):
    assert cli(*WORDS, "--within", "1ms").error.startswith("--within: got 'a time in which nothing was found'")
    assert cli(*WORDS, "--within", "soon").error.startswith("--within")


@pytest.mark.parametrize(("words", "said"), [
    (("robot", "fit", "so101", "arm.csv"), "joint of the robot"),
    (("robot", "fit", "nobody.xml", "arm.csv"), "nobody.xml is no file"),
    (("robot", "fit", "arm.xml", "arm.csv"), "servos of the robot"),
    ((*WORDS, "--holdout", "2"), "--holdout: got 2"),
    ((*WORDS, "--masses", "-1"), "--masses: got -1"),
    ((*WORDS, "--masses", "nan"), "--masses: got nan"),
    (("robot", "fit", "arm.xml", "goals.csv", *WORDS[4:]), "goals.csv: columns: got 'timestamp, action.shoulder_rad, "
     "action.elbow_rad', allowed: a time, and an action and a state"),
    (("robot", "validate", "arm.xml", "goals.csv", *WORDS[4:6]), "goals.csv: columns"),
    (("robot", "fit", "arm.xml", "header.csv", *WORDS[4:]), "at least one row"),
    (("robot", "validate", "arm.xml", "nan.csv", *WORDS[4:6]), "elbow in episode 0: got nan, allowed: finite numbers"),
    (("robot", "fit", "arm.xml", "nan.csv", *WORDS[4:]), "elbow in episode 0: got nan, allowed: finite numbers"),
    (("robot", "fit", "unknown", "empty", *WORDS[4:]), "empty: got 'no dataset of LeRobot'"),
    (("robot", "fit", "arm.xml", "none.csv", "--servo", "*=feetech-sts3215-12v"), "none.csv"),
])
def test_bad_input(cli, arm, words, said):
    lines = (arm / "arm.csv").read_text().splitlines()
    (arm / "header.csv").write_text(lines[0] + "\n")
    (arm / "goals.csv").write_text("\n".join(",".join(line.split(",")[1:4]) for line in lines[:40]))
    (arm / "nan.csv").write_text("\n".join([*lines[:20], lines[20].rpartition(",")[0] + ",nan", *lines[21:80]]))
    (arm / "empty").mkdir()
    ended = cli(*words)
    assert ended.code == 2
    assert said in ended.err
    assert len(ended.err.strip().splitlines()) == 1
