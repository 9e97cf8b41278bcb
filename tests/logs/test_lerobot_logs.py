"""Datasets in the layout of LeRobot, versions 2.1 and 3.0: one log a joint and episode."""

import json
import math

import numpy as np
import pytest

from servotwin.errors import InputError, MissingExtraError
from servotwin.identification import read_lerobot_logs, read_logs

arrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

JOINTS = ["shoulder_pan.pos", "elbow_flex.pos", "gripper.pos"]
FPS, FRAMES = 30, (6, 5)  # of two episodes


def values(episode, size, scale=1.0):
    frame = np.arange(FRAMES[episode])[:, None]
    return (scale * (10.0 * np.arange(size) + frame + 100.0 * episode) / 10.0).astype(np.float32)


def columns(episode, size, scale, fixed):
    frame = np.arange(FRAMES[episode])
    kind = arrow.list_(arrow.float32(), size) if fixed else arrow.list_(arrow.float32())
    action, state = values(episode, size, scale), values(episode, size, scale) - np.float32(0.5)
    return {"action": arrow.array(action.tolist(), kind), "observation.state": arrow.array(state.tolist(), kind),
            "timestamp": arrow.array((frame / FPS).astype(np.float32)), "frame_index": arrow.array(frame),
            "episode_index": arrow.array(np.full(frame.size, episode)), "task_index": arrow.array(0 * frame)}


def dataset(folder, names=JOINTS, *, version="v3.0", robot="so101_follower", scale=1.0, size=3):
    """Write a dataset as LeRobot does: an episode a file before 3.0, several in a file since."""
    feature = {"dtype": "float32", "shape": [size], "names": names}
    info = {"codebase_version": version, "robot_type": robot, "fps": FPS, "total_episodes": 2,
            "features": {"action": feature, "observation.state": feature}}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    tables = [arrow.table(columns(k, size, scale, version == "v3.0")) for k in range(2)]
    if version == "v3.0":
        parquet.write_table(arrow.concat_tables(tables), data / "file-000.parquet")
    else:
        for k, table in enumerate(tables):
            parquet.write_table(table, data / f"episode_{k:06d}.parquet")
    return folder


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
def test_every_joint_of_every_episode_is_a_log(tmp_path, version):
    folder = dataset(tmp_path / "set", version=version)
    logs = read_logs(folder, joints="*:deg")
    assert [log.name for log in logs] == ["shoulder_pan 000000", "elbow_flex 000000", "shoulder_pan 000001",
                                          "elbow_flex 000001"]
    for log in logs:
        joint, episode = log.conditions["joint"], int(log.conditions["episode"])
        k = JOINTS.index(f"{joint}.pos")
        np.testing.assert_allclose(log.time, np.arange(FRAMES[episode]) / FPS, rtol=1e-7)
        np.testing.assert_allclose(log.command, np.radians(values(episode, 3)[:, k].astype(float)), rtol=1e-12)
        np.testing.assert_allclose(log.measured["output_angle"], log.command - math.radians(0.5), atol=1e-7)
        assert log.command_kind == "angle"
    one = read_logs(sorted((folder / "data").rglob("*.parquet"))[0], joints={"elbow_flex": "-0.9deg+45"})
    assert len(one) == (2 if version == "v3.0" else 1)
    np.testing.assert_allclose(one[0].command, np.radians(45.0 - 0.9 * values(0, 3)[:, 1].astype(float)), rtol=1e-6)
    assert read_logs(folder / "meta" / "info.json", joints="gripper:0.5deg")[0].name == "gripper 000000"


@pytest.mark.parametrize(("names", "robot", "scale", "known"), [
    (["main_shoulder_pan", "main_elbow_flex", "main_gripper"], "so100", 1.0, "its name"),
    (JOINTS, "so101_follower", 10.0, "the values"),  # up to 115, beyond the end of a range
    ({"motors": ["main_shoulder_pan", "main_elbow_flex", "main_gripper"]}, "koch", 1.0, "its name"),
])
def test_degrees_where_they_are_known(tmp_path, names, robot, scale, known):
    logs = read_lerobot_logs(dataset(tmp_path / "set", names, robot=robot, scale=scale), joints="shoulder_pan")
    assert all(known in one.known and one.unit == "deg" for log in logs for one in log.reading.columns)
    everything = read_lerobot_logs(tmp_path / "set")
    assert {log.conditions["joint"] for log in everything} == {"shoulder_pan", "elbow_flex"}
    assert "gripper was left out" in everything[0].reading.remarks[0]


def test_names_that_are_not_given_are_numbers(tmp_path):
    logs = read_lerobot_logs(dataset(tmp_path / "set", None, robot=None), joints="1:rad")
    assert [log.name for log in logs] == ["1 000000", "1 000001"]
    np.testing.assert_allclose(logs[0].command, values(0, 3)[:, 1], rtol=1e-7)


@pytest.mark.parametrize(("options", "joints", "words"), [
    ({}, None, ("unit of shoulder_pan, elbow_flex is not known", "-0.5 to 10.9", "degrees, or -100 to 100", "--joint")),
    ({}, "gripper", ("unit of gripper is not known", "0 to 100", "--joint gripper:0.9deg")),
    ({"robot": "aloha", "scale": 10.0}, None, ("is not known",)),  # another robot's numbers may be anything
    ({}, "wrist:deg", ("unknown joint", "'wrist'", "shoulder_pan, elbow_flex, gripper")),
    ({}, "elbow_flex:kg", ("--joint elbow_flex", "'kg'", "deg, rad")),
    ({}, "elbow_flex:deg,elbow_flex:rad", ("elbow_flex twice",)),
    ({}, "", ("--joint", "such as")), ({}, 3, ("--joint",)),
    ({"size": 4}, "shoulder_pan:deg", ()),  # more values than names: no harm
    ({"names": [*JOINTS, "wrist.pos"]}, "wrist:deg", ("action", "4 in every row")),
])
def test_what_cannot_be_known_is_asked_for(tmp_path, options, joints, words):
    folder = dataset(tmp_path / "set", **options)
    if not words:
        assert read_lerobot_logs(folder, joints=joints)
        return
    with pytest.raises(InputError) as caught:
        read_logs(folder, joints=joints)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_what_is_no_dataset_is_said_in_one_line(tmp_path, monkeypatch):
    folder = dataset(tmp_path / "set")
    file = next((folder / "data").rglob("*.parquet"))
    with pytest.raises(InputError, match=r"--columns for .*--joint"):
        read_logs(folder, columns="time=t:s")
    with pytest.raises(InputError, match="no dataset of LeRobot"):
        read_logs(tmp_path, "lerobot")
    loose = tmp_path / "loose.parquet"
    loose.write_bytes(file.read_bytes())
    with pytest.raises(InputError, match="Parquet file"):
        read_logs(loose)
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(InputError, match="not readable as Parquet"):
        read_logs(folder, joints="*:deg")
    parquet.write_table(arrow.table({"action": [[1.0]], "timestamp": [0.0]}), file)
    with pytest.raises(InputError, match=r"also observation\.state"):
        read_logs(folder, joints="*:deg")
    file.unlink()
    with pytest.raises(InputError, match="no data"):
        read_logs(folder, joints="*:deg")
    (folder / "meta" / "info.json").write_text('{"features": {}}')
    with pytest.raises(InputError, match="among them action"):
        read_logs(folder)


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    folder = dataset(tmp_path / "set")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"servotwin\[data\]"):
        read_logs(folder, joints="*:deg")


def joint_table(folder, *, unit="_deg", joints=("shoulder_pan", "gripper"), scale=1.0):
    """Write a table with an action and a state of each joint, and two episodes."""
    header = ["timestamp", "episode_index", *(f"action.{name}.pos{unit}" for name in joints),
              *(f"observation.state.{name}.pos{unit}" for name in joints)]
    rows = [[k / FPS, episode, *(scale * (k + n) for n in range(len(joints))),
             *(scale * (k + n - 0.5) for n in range(len(joints)))] for episode in (0, 1) for k in range(5)]
    file = folder / "arm.csv"
    file.write_text("\n".join([",".join(header), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return file


@pytest.mark.parametrize(("unit", "scale", "joints"), [("_deg", 1.0, None), ("_rad", math.radians(1.0), None),
                                                       ("", 1.0, {"*": "deg", "gripper": "deg"})])
def test_a_table_of_several_joints_is_read_as_a_dataset(tmp_path, unit, scale, joints):
    logs = read_logs(joint_table(tmp_path, unit=unit, scale=scale), joints=joints)
    assert [log.name for log in logs] == ["shoulder_pan 000000", "gripper 000000", "shoulder_pan 000001",
                                          "gripper 000001"]
    np.testing.assert_allclose(logs[1].command, np.radians(np.arange(5) + 1.0), rtol=1e-9)
    np.testing.assert_allclose(logs[1].measured["output_angle"], logs[1].command - math.radians(0.5), atol=1e-9)
    assert logs[0].time[-1] == pytest.approx(4 / FPS)


def test_a_table_of_several_joints_has_units_in_all_names_or_is_told(tmp_path):
    with pytest.raises(InputError, match="unit of shoulder_pan is not known"):
        read_logs(joint_table(tmp_path, unit=""))
    text = joint_table(tmp_path).read_text().replace("action.gripper.pos_deg", "action.gripper.pos")
    (tmp_path / "arm.csv").write_text(text)
    with pytest.raises(InputError, match="some with a unit and some without"):
        read_logs(tmp_path / "arm.csv")


@pytest.mark.parametrize("names", ["action_deg,state_deg", "action,observation.state", "action [deg],state [deg]"])
def test_action_and_state_of_one_joint_are_known_by_name(tmp_path, names):
    rows = "\n".join(f"{k / FPS},{10.0 * k},{10.0 * k - 1.0}" for k in range(12))
    (tmp_path / "one.csv").write_text(f"timestamp,{names}\n{rows}\n")
    log, = read_logs(tmp_path / "one.csv")
    np.testing.assert_allclose(log.command, np.radians(10.0 * np.arange(12)), rtol=1e-6)
    np.testing.assert_allclose(log.measured["output_angle"], np.radians(10.0 * np.arange(12) - 1.0), rtol=1e-6)


def test_the_clock_of_the_loop_is_said(tmp_path):
    log = read_logs(dataset(tmp_path / "set"), joints="shoulder_pan:deg")[0]
    assert any(text.startswith("loop of 30 Hz, stamps are numbers of frames") and "the delay of a fit" in text
               for text in log.reading.remarks)
