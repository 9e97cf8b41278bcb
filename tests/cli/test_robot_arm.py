"""`servotwin robot scara`, `two-link` and `compare`: arms that do tasks, their files, and what is refused."""

import csv
import json

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
pytest.importorskip("mink", reason="the extra `robots` is not installed")
OF_SERVOS = {"run.csv", "tracking.png", "electrical.png", "sizing.png"}
OF_TASK = {"joints.csv", "summary.json", "tool.csv", "tool.png", "index.html"}
SMALL = ("--size", "15mm", "--speed", "0.2", "--no-video", "--out", "out")


@pytest.fixture
def robot(cli, tmp_path, monkeypatch):
    """The command in an empty folder, where nothing can be drawn."""
    monkeypatch.setenv("MUJOCO_GL", "off")
    return lambda *words: cli("robot", *words)


@pytest.mark.long
def test_a_task_with_ideal_actuators(robot, tmp_path):
    ended = robot("scara", "--task", "square", "--redundancy", "limits", "--ideal", *SMALL)
    assert ended.code == 0, ended.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == OF_TASK | {"redundancy.png"}
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert found["ideal_contour"]["largest"] < 1e-6
    assert found["ways"]["limits"]["limit_distance"] > found["ways"]["none"]["limit_distance"]
    assert "scara: square of 30 mm" in ended.out
    with (tmp_path / "out" / "tool.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for axis in "xyz":
        wanted, tool = (np.array([float(row[f"{who}_{axis}_mm"]) for row in rows]) for who in ("wanted", "tool"))
        np.testing.assert_allclose(tool, wanted, atol=0.01)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert page.count("<img") == 2
    assert "Redundancy" in page


@pytest.mark.long
def test_a_task_with_servos(robot, tmp_path):
    ended = robot("two-link", "--payload", "50g", "--supply", "6V:0.1ohm", "--json", *SMALL)
    assert ended.code == 0, ended.err
    assert {path.name for path in (tmp_path / "out").iterdir()} == OF_SERVOS | OF_TASK
    found = ended.data
    assert found["controller"] == "plain"
    assert 1e-4 < found["task_metrics"]["contour_rms"] < 1e-2
    assert found["joints"]["shoulder"]["servo"] == "hitec-hs-755hb"
    assert found["supply"]["internal_resistance"] == 0.1
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert page.index("The tool") < page.index("Is the servo big enough")
    assert "tool.png" in page


@pytest.mark.long
def test_servos_models_and_controllers_by_name(robot):
    words = ("two-link", "--servo", "towerpro-mg996r", "--servo", "elbow=hitec-hs-755hb", "--model", "bounded",
             "--controller", "feedforward", "--json")
    found = robot(*words, *SMALL).data
    assert [each["servo"] for each in found["joints"].values()] == ["towerpro-mg996r", "hitec-hs-755hb"]
    assert {each["model"] for each in found["joints"].values()} == {"bounded"}
    assert found["task_metrics"]["contour_rms"] < 1e-4
    assert found["task_metrics"]["energy"] is None
    assert found["big_enough"]


@pytest.mark.long(but="words2-unknown task 'cirle'; did you mean 'circle'?")
@pytest.mark.parametrize(("words", "said"), [
    (("scara", "--size", "0.2"), "circle of 400 mm at 0.00 s: got 'a place 50 mm out of its reach"),
    (("two-link", "--size", "97.2mm"), "joint elbow: got"),
    (("scara", "--task", "cirle"), "unknown task 'cirle'; did you mean 'circle'?"),
    (("scara", "--redundancy", "most"), "unknown redundancy 'most'"),
    (("scara", "--no-third-link", "--redundancy", "torque"), "redundancy of scara-4: got 'torque', allowed: none"),
    (("two-link", "--controller", "best"), "unknown controller 'best'"),
    (("two-link", "--size", "3kg"), "--size"),
    (("two-link", "--speed", "0"), "speed of a tool's path: got 0.0"),
    (("two-link", "--payload", "-1g"), "payload: got -0.001"),
    (("two-link", "--servo", "wrist=hitec-hs-755hb"), "unknown joint of --servo 'wrist'"),
    (("two-link", "--servo", "no-such-servo"), "unknown servo 'no-such-servo'"),
])
def test_bad_input_is_one_line(robot, tmp_path, words, said):
    ended = robot(*words, "--no-video", "--ideal", "--out", "out")
    assert ended.code == 2
    assert said in ended.err
    assert ended.err.count("\n") == 1 or "robot.png is left out" in ended.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_controllers_fidelities_and_conditions_on_one_page(robot, tmp_path):
    ended = robot("compare", "--robot", "two-link", "--speed", "0.15", "--json", "--out", "out")
    assert ended.code == 0, ended.err
    cases = ended.data["cases"]
    assert len(cases) == 69
    assert not any(case["failure"] for case in cases)

    def behind(controller, servos="pulse", condition="nominal"):
        return next(case["tool_rms"] for case in cases if (case["controller"], case["servos"], case["condition"]) == (
            controller, servos, condition))

    assert behind("computed-torque") < 0.1 * behind("plain")
    assert behind("computed-torque") < 0.3 * behind("computed-torque", condition="30 % wrong")
    assert behind("feedforward", "averaged") < 0.2 * behind("feedforward")
    assert behind("observer", condition="30 % wrong") < 1.2 * behind("observer")
    for name in ("plain", "deadband", "feedforward", "pid", "observer"):
        assert behind(name, condition="low battery") > 1.2 * behind(name)
    assert behind("computed-torque", "ideal torque") < behind("computed-torque")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"compare.csv", "summary.json", "conditions.png",
                                                                    "index.html"}
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "computed torque" in page
    assert "worse than" not in page.split("Where each loses")[0]


@pytest.mark.parametrize(("words", "said"), [
    (("--robot", "so101"), "unknown robot to compare on 'so101'"),
    (("--task", "cube"), "unknown task to compare 'cube'"),
    (("--robot", "two-link", "--task", "square"), "unknown task of these robots 'square'"),
    (("--servo", "no-such"), "unknown servo 'no-such'"), (("--speed", "0"), "speed")])
def test_what_cannot_be_compared(robot, tmp_path, words, said):
    ended = robot("compare", *words, "--out", "out")
    assert said in ended.error
    assert not (tmp_path / "out").exists()
