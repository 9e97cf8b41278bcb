"""`servotwin robot validate`: recorded goals that go through a robot, its files, and what is refused."""

import json

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")

from robots.robots_cases import links
from robots.test_replay import JOINTS, recorded
from servotwin.robots.replay import IDEAL, SERVOS

pytestmark = pytest.mark.long


def test_the_command(cli, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "off")
    motion = recorded()
    (tmp_path / "arm.xml").write_text(links(dt=2e-3))
    names = [f"{side}.{joint}_rad" for side in ("action", "state") for joint in JOINTS]
    columns = [motion.time, *(some[joint] for some in (motion.angles, motion.measured) for joint in JOINTS)]
    np.savetxt(tmp_path / "arm.csv", np.column_stack(columns), delimiter=",", comments="",
               header=",".join(["timestamp", *names]))
    words = ("robot", "validate", "arm.xml", "arm.csv", "--servo", "*=feetech-sts3215-12v")
    ended = cli(*words, "--out", "out", "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out)
    assert set(told["errors"]) == {SERVOS, IDEAL, "<position> kp 998", "<position> kp 50", "<position> kp 17.8"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "summary.json", "errors.png", "windows.png", "index.html"}
    page = (tmp_path / "out" / "index.html").read_text()
    assert "Where it is worst" in page
    with monkeypatch.context() as one_a_page:
        for module in ("servotwin.plotting", "servotwin.plotting.robots"):
            one_a_page.setattr(f"{module}.JOINTS_A_PAGE", 1)
        assert "shoulder" in cli(*words, "--episode", "0", "--out", "pages").out
    pages = {"windows.png", "windows-2.png"}
    assert {path.name for path in (tmp_path / "pages").glob("windows*")} == pages
    assert all(f'<img src="{name}"' in (tmp_path / "pages" / "index.html").read_text() for name in pages)
    for bad, said in ((("--episode", "7"), "episode: got 7"), (("--unit", "mm"), "allowed")):
        refused = cli(*words, *bad)
        assert refused.code == 2
        assert said in refused.err
    assert cli("robot", "validate", "so101", "arm.csv").code == 2  # joints that do not match
    ran = cli("robot", "run", "arm.xml", "--servo", "*=feetech-sts3215-12v", "--motion", "arm.csv", "--out", "ran",
              "--no-video", "--json")
    assert ran.code == 0, ran.err
    assert 0.0 < json.loads(ran.out)["joints"]["elbow"]["measured_rms"] < 0.05
    assert "off the measured joint" in (tmp_path / "ran" / "index.html").read_text()
    assert "elbow.measured_deg" in (tmp_path / "ran" / "joints.csv").read_text().splitlines()[0]
