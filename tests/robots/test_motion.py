"""Motions of tables and of recorded episodes: read rightly, or refused in one line."""

import json
import math

import numpy as np
import pytest

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.robots.motion import Motion, read_motion

ARM = ("shoulder", "elbow", "slider")


@pytest.fixture
def file(tmp_path):
    def write(content):
        path = tmp_path / "motion.csv"
        path.write_text(content)
        return path
    return write


def refused(kind, words, *args, **options):
    with pytest.raises(kind) as caught:
        read_motion(*args, **options)
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


# ---------------------------------------------------------------------------------------- a motion

def test_goals_are_linear_between_samples_and_held_beyond():
    motion = Motion(time=[0.0, 1.0, 3.0], angles={"elbow": [0.2, 1.2, 0.2]}, source="here")
    assert [motion.at("elbow", t) for t in (-5.0, 0.0, 0.25, 1.0, 2.0, 3.0, 50.0)] == pytest.approx(
        [0.2, 0.2, 0.45, 1.2, 0.7, 0.2, 0.2], abs=1e-15)
    assert motion.at("elbow", np.zeros((2, 3))).shape == (2, 3)
    assert isinstance(motion.at("elbow", 0.5), float)
    assert (motion.duration, motion.joints, motion.still) == (3.0, ("elbow",), ())


def test_what_a_motion_says_nothing_of_has_no_goal():
    motion = Motion(time=[0.0, 1.0], angles={"elbow": [0.0, 1.0]}, source="here", still=("shoulder",))
    with pytest.raises(UnknownNameError, match="unknown joint of here 'shoulder'"):
        motion.at("shoulder", 0.0)


def test_a_motion_keeps_its_own_numbers():
    angles = {"elbow": np.zeros(2)}
    motion = Motion(time=np.array([0.0, 1.0]), angles=angles, source="here")
    angles["elbow"][0] = 1.0
    assert motion.at("elbow", 0.0) == 0.0
    with pytest.raises(ValueError, match="read-only"):
        motion.time[0] = 1.0


@pytest.mark.parametrize(("time", "angles", "words"), [
    ([0.0], {"a": [1.0]}, ("here: time", "'1 sample'", "at least two")),
    ([1.0, 2.0], {"a": [1.0, 2.0]}, ("begin at 0",)), ([0.0, 0.0], {"a": [1.0, 2.0]}, ("increasing",)),
    ([0.0, math.nan], {"a": [1.0, 2.0]}, ("here: time", "nan")), ([0.0, 1.0], {}, ("joints", "at least one")),
    ([0.0, 1.0], {"a": [1.0]}, ("here: a", "(1,)", "(2,)")), ([0.0, 1.0], {"a": [1.0, math.inf]}, ("a", "inf")),
    ([0.0, 1.0], {"a": ["x", "y"]}, ("here: a", "numbers")),
])
def test_what_is_no_motion(time, angles, words):
    with pytest.raises(InputError) as caught:
        Motion(time=time, angles=angles, source="here")
    assert all(word in str(caught.value) for word in words), str(caught.value)


# ---------------------------------------------------------------------------------------- tables

@pytest.mark.parametrize(("content", "elbow"), [
    ("time,elbow\n0,0\n0.5,0.1\n", 0.1), ("time_s,elbow_rad\n0,0\n0.5,0.1\n", 0.1),
    ("time_ms,elbow_deg\n0,0\n500,30\n", math.pi / 6), ("elbow_degrees,time\n0,0\n30,0.5\n", math.pi / 6),
    ("time_s;elbow_deg\n0,0;0\n0,5;30\n", math.pi / 6), ("# by hand\ntime_s\telbow_deg\n7\t0\n7.5\t30", math.pi / 6),
    ("time,elbow,\n0,0,\n0.5,0.1,\n", 0.1), ("time,elbow_m\n0,0\n0.5,0.1\n", 0.1),
    ("time,elbow_mm\n0,0\n0.5,100\n", 0.1), ("time,elbow_cm\n0,0\n0.5,10\n", 0.1),
])
def test_a_column_of_a_table_is_in_its_unit(file, content, elbow):
    path = file(content)
    motion = read_motion(path, ARM)
    assert motion.at("elbow", [0.0, 0.5]).tolist() == pytest.approx([0.0, elbow], rel=1e-15)
    assert (motion.duration, motion.joints, motion.still) == (0.5, ("elbow",), ("shoulder", "slider"))
    assert motion.source == str(path)


def test_joints_of_like_names_are_told_apart(file):
    motion = read_motion(file("time,arm_deg,arm_m_deg,arm_2_rad\n0,0,0,0\n1,90,180,2\n"), ["arm", "arm_m", "arm_2"])
    assert [motion.at(joint, 1.0) for joint in ("arm", "arm_m", "arm_2")] == pytest.approx([math.pi / 2, math.pi, 2.0])


@pytest.mark.parametrize(("content", "words"), [
    ("", ("empty file",)), ("time,elbow\n", ("header without rows",)),
    ("time,elbow\n0,1\n", ("one row", "at least two")),
    ("time,elbow\n0,1\n1,nan\n", ("line 3, elbow", "'nan'", "a finite number")),
    ("time,elbow\n0,1\n1,\n", ("line 3, elbow", "nothing", "a number")),
    ("time,elbow\n0,1\n1,x\n", ("line 3, elbow", "'x'")), ("time,elbow\nnan,1\n1,2\n", ("line 2, time", "finite")),
    ("time,elbow\n0,1\n1,1\n1,2\n", ("line 4, time", "1 after 1", "increasing")),
    ("time_s,elbow\n0,1\n2,1\n1,2\n", ("line 4, time_s", "increasing")),
    ("time,elbow\n0,1\n1\n", ("line 3", "1 cell", "2, as the header")),
    ("t,elbow\n0,1\n1,2\n", ("column of time", "t, elbow", "time, time_s, time_ms")),
    ("time,time_s,elbow\n0,0,1\n1,1,2\n", ("column of time", "time, time_s", "one of")),
    ("time_us,elbow\n0,1\n1,2\n", ("column of time", "time_us")),
    ("time\n0\n1\n", ("columns", "also one of a joint: shoulder, elbow, slider")),
    ("time,elbow_us\n0,1\n1,2\n", ("unit of column elbow_us", "'us'", "deg, rad")),
    ("time,elbow_rpm\n0,1\n1,2\n", ("unit of column elbow_rpm", "deg, rad, m, cm, mm")),
    ("time,elbow,elbow_deg\n0,1,1\n1,2,2\n", ("elbow", "columns elbow and elbow_deg", "one of them")),
    ("time,elbow,elbow\n0,1,1\n1,2,2\n", ("elbow 2 times", "once")),
])
def test_what_is_wrong_with_a_table_is_said_in_one_line(file, content, words):
    path = file(content)
    refused(InputError, (str(path), *words), path, ARM)


@pytest.mark.parametrize(("column", "suggestion"), [
    ("elbw_deg", "elbow"), ("shoulder.pos", "shoulder"), ("elbow_velocity", "elbow"), ("Slider_mm", "slider"),
])
def test_a_column_that_is_no_joint_has_a_suggestion(file, column, suggestion):
    path = file(f"time,elbow,{column}\n0,1,2\n1,2,3\n")
    refused(UnknownNameError, (str(path), f"'{column}'", f"did you mean '{suggestion}'", "shoulder, elbow, slider"),
            path, ARM)


@pytest.mark.parametrize(("column", "dimension", "allowed"), [("elbow_mm", "angle", "deg, rad"),
                                                             ("elbow_deg", "length", "m, cm, mm")])
def test_a_hinge_has_no_length_and_a_slide_no_angle(file, column, dimension, allowed):
    path = file(f"time,{column}\n0,1\n1,2\n")
    refused(InputError, (column, f"allowed: {allowed}"), path, {"elbow": dimension})


@pytest.mark.parametrize(("path", "words"), [
    ("none.csv", ("none.csv: no such file",)), ("none.parquet", ("no such file",)), ("a\0b", ("cannot be read",)),
    ("x" * 999, ("cannot be read",)), (".", ("no dataset of LeRobot", "info.json")),
])
def test_a_file_that_is_not_there(tmp_path, path, words):
    refused(InputError, words, f"{tmp_path}/{path}", ARM)


@pytest.mark.parametrize(("options", "words"), [
    ({"unit": "deg"}, ("unit=", "a table")), ({"episode": 0}, ("episode=", "a table")),
    ({"calibration": "x.json"}, ("calibration=", "a table")),
    ({"ranges": {"elbow": (1.0, 0.0)}}, ("ranges: elbow", "(lower, upper) in rad")),
    ({"ranges": {"elbow": 3.0}}, ("ranges: elbow",)), ({"ranges": {"elbow": (0.0, math.nan)}}, ("ranges: elbow",)),
])
def test_options_that_mean_nothing_here(file, options, words):
    refused(InputError, words, file("time,elbow\n0,1\n1,2\n"), ARM, **options)


@pytest.mark.parametrize("joints", ["elbow", [], {"elbow": "speed"}])
def test_joints_are_names(file, joints):
    refused(InputError, ("joints",), file("time,elbow\n0,1\n1,2\n"), joints)


# ---------------------------------------------------------------------------------------- episodes of LeRobot

JOINTS = ("shoulder_pan", "elbow_flex", "gripper")
NAMES = [f"{joint}.pos" for joint in JOINTS]
FPS = 30
CALIBRATION = {joint: {"id": k, "drive_mode": 0, "homing_offset": 7, "range_min": 1000, "range_max": 3000}
               for k, joint in enumerate(JOINTS, 1)}
RANGES = {"shoulder_pan": (-1.0, 1.0), "elbow_flex": (-1.5, 1.5), "gripper": (-0.2, 1.8)}
COUNT = 2.0 * math.pi / 4096


def dataset(folder, names=NAMES, *, robot="so101_follower", goals=((-100.0, 50.0, 0.0), (100.0, -50.0, 100.0))):
    """Write two episodes of two frames; the second one has the goals of the first in the other order."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    feature = {"dtype": "float32", "shape": [len(names)], "names": names}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(
        {"robot_type": robot, "fps": FPS, "features": {"action": feature, "observation.state": feature}}))
    (folder / "data").mkdir()
    frames = np.array([*goals, *goals[::-1]], dtype=np.float32)
    parquet.write_table(arrow.table({
        "action": arrow.array(frames.tolist(), arrow.list_(arrow.float32())),
        "observation.state": arrow.array(frames.tolist(), arrow.list_(arrow.float32())),
        "timestamp": arrow.array(np.array([0, 1, 9, 10], dtype=np.float32) / FPS),
        "episode_index": arrow.array([3, 3, 4, 4])}), folder / "data" / "episodes.parquet")
    return folder


@pytest.mark.parametrize(("options", "angles"), [
    ({"calibration": CALIBRATION, "unit": "range"}, ((-1000, 500, -1000), (1000, -500, 1000))),
    ({"calibration": CALIBRATION, "unit": "range", "ranges": {"gripper": (0.0, 1.0)}},
     ((-1000, 500, 0), (1000, -500, 2000))),
    # -100·4095/360 = -1137.5, from a middle of 2000 down to 862.5 and cut off there
    ({"calibration": CALIBRATION, "unit": "deg"}, ((-1138, 568, -1000), (1137, -569, 1000))),
])
def test_a_calibration_makes_angles_of_goals(tmp_path, options, angles):
    motion = read_motion(dataset(tmp_path / "set"), JOINTS, episode=3, **options)
    np.testing.assert_allclose([motion.angles[joint] for joint in JOINTS], COUNT * np.array(angles).T, atol=1e-12)


@pytest.mark.parametrize(("unit", "angles"), [
    ("range", ((-1.0, 0.75, -0.2), (1.0, -0.75, 1.8))),
    ("deg", ((-math.radians(100), math.radians(50), -0.2), (math.radians(100), -math.radians(50), 1.8))),
    ({"*": "range", "elbow_flex": "rad", "gripper": "0.5deg-10"},
     ((-1.0, 50.0, math.radians(-10) + 0.8), (1.0, -50.0, math.radians(40) + 0.8))),
    ({"shoulder_pan": "-deg+90", "elbow_flex.pos": "deg-90"},
     ((math.radians(190), math.radians(-40), -0.2), (math.radians(-10), math.radians(-140), 1.8))),
])
def test_limits_in_place_of_a_calibration(tmp_path, unit, angles):
    motion = read_motion(dataset(tmp_path / "set"), JOINTS, unit=unit, ranges=RANGES)
    np.testing.assert_allclose([motion.angles[joint] for joint in JOINTS], np.array(angles).T, rtol=1e-12)


@pytest.mark.parametrize(("episode", "first", "named"), [(None, -1.0, 3), (3, -1.0, 3), (4, 1.0, 4)])
def test_an_episode_is_the_one_asked_for(tmp_path, episode, first, named):
    folder = dataset(tmp_path / "set")
    for path in (folder, str(folder / "data" / "episodes.parquet")):
        motion = read_motion(path, [*JOINTS, "wrist"], unit="range", ranges=RANGES, episode=episode)
        assert motion.at("shoulder_pan", 0.0) == first
        assert motion.source == f"{path}, episode {named}"
        assert motion.still == ("wrist",)
        assert motion.duration == pytest.approx(1.0 / FPS, rel=1e-5)


@pytest.mark.parametrize(("robot", "first"), [("so101_follower", 1000), ("koch_follower", -1000)])
def test_dynamixel_servos_turn_round_by_themselves(tmp_path, robot, first):
    inverted = {joint: {**said, "drive_mode": 1} for joint, said in CALIBRATION.items()}
    motion = read_motion(dataset(tmp_path / "set", robot=robot), JOINTS, unit="range", calibration=inverted)
    assert motion.at("shoulder_pan", 0.0) == pytest.approx(COUNT * first, rel=1e-12)


def test_numbers_beyond_a_range_are_degrees(tmp_path):
    folder = dataset(tmp_path / "set", goals=((-120.0, 50.0, 0.0), (100.0, -50.0, 100.0)))
    assert read_motion(folder, JOINTS, ranges=RANGES).at("shoulder_pan", 0.0) == pytest.approx(math.radians(-120.0))


def test_the_calibration_may_be_a_file(tmp_path):
    file = tmp_path / "arm.json"
    file.write_text(json.dumps(CALIBRATION))
    folder = dataset(tmp_path / "set")
    motions = [read_motion(folder, JOINTS, unit="range", calibration=one) for one in (file, str(file), CALIBRATION)]
    assert all(motion.at("elbow_flex", 0.0) == motions[0].at("elbow_flex", 0.0) for motion in motions)
    file.write_text(json.dumps({joint: CALIBRATION[joint] for joint in ("shoulder_pan", "gripper")}))
    refused(InputError, (str(file), "shoulder_pan, gripper", "also elbow_flex"), folder, JOINTS, unit="range",
            calibration=file)


@pytest.mark.parametrize(("made", "options", "words"), [
    ({}, {}, ("unit of shoulder_pan, elbow_flex is not known", "-100 to 100", "degrees", 'unit="range"')),
    ({}, {"unit": "range"}, ("shoulder_pan has -100 to 100 of its calibrated range", "calibration=", "ranges=")),
    ({}, {"unit": "deg"}, ("gripper has 0 to 100 of its calibrated range", "calibration=")),
    ({}, {"unit": "kg"}, ("unit of shoulder_pan", "'kg'", "range, or deg, rad")),
    ({}, {"unit": {"*": 3}}, ("unit of shoulder_pan", "3")), ({}, {"unit": "metres"}, ("unit of shoulder_pan",)),
    ({}, {"unit": {"wrist": "deg"}}, ("unknown joint", "'wrist'", "shoulder_pan, elbow_flex, gripper")),
    ({}, {"unit": "range", "episode": 5}, ("episode", "got 5", "3 to 4")),
    ({}, {"unit": "range", "episode": True}, ("episode", "True")),
    ({"names": ["main_shoulder_pan", "main_elbow_flex", "main_gripper"]}, {"ranges": RANGES},
     ("zero of shoulder_pan, elbow_flex is not known", "before June 2025", '"elbow_flex": "deg-90"')),
    ({"names": ["shoulder_pan.pos", "wrist.pos", "gripper.pos"]}, {"unit": "range"},
     ("unknown joint of the robot", "'wrist'", "shoulder_pan, elbow_flex, gripper")),
    ({"goals": ((math.nan, 0.0, 0.0), (1.0, 0.0, 0.0))}, {"unit": "range", "ranges": RANGES},
     ("shoulder_pan in episode 3", "nan")),
])
def test_what_cannot_be_known_of_goals_is_asked_for(tmp_path, made, options, words):
    folder = dataset(tmp_path / "set", **made)
    refused(InputError, (*words, str(folder)) if "unit of" not in words[0] else words, folder, JOINTS, **options)


def test_a_slide_has_no_servo_that_turns_it(tmp_path):
    joints = dict.fromkeys(JOINTS, "length")
    refused(InputError, ("shoulder_pan", "an angle", "m, cm, mm"), dataset(tmp_path / "set"), joints, unit="range")


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    folder = dataset(tmp_path / "set")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    refused(MissingExtraError, ("servotwin[data]",), folder, JOINTS, unit="deg")
