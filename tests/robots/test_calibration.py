"""LeRobot's goals as counts and angles: as its own `_unnormalize` makes them, and as the angles that these are."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin.errors import InputError
from servotwin.robots.motion import DEGREES, OPENING, RANGE, Calibration, joint_angles, read_calibration

ELBOW = {"id": 3, "drive_mode": 0, "homing_offset": -1017, "range_min": 901, "range_max": 3100}  # middle 2000.5
COUNT = 2.0 * math.pi / 4096


@pytest.mark.parametrize(("form", "goal", "count", "turned"), [
    (RANGE, -100.0, 901, 3100), (RANGE, 100.0, 3100, 901), (RANGE, 250.0, 3100, 901),
    (RANGE, 0.0, 2000, 2000),  # of 2000.5
    (RANGE, 50.0, 2550, 1450),  # 901 + 2199·3/4 = 2550.25, 901 + 2199/4 = 1450.75
    (OPENING, 0.0, 901, 3100), (OPENING, 100.0, 3100, 901), (OPENING, -5.0, 901, 3100),
    (OPENING, 10.0, 1120, 2880),  # 901 + 219.9, 901 + 1979.1
    (DEGREES, 0.0, 2000, 2000), (DEGREES, 90.0, 3024, 3024),  # 2000.5 + 1023.75; LeRobot turns no degrees round
    (DEGREES, -120.0, 635, 635),  # 2000.5 - 1365: beyond the range, and cut off from 635.5
    (DEGREES, 350.0, 5981, 5981),  # 2000.5 + 3981.25, with 4095 counts in 360 degrees
])
def test_goals_are_the_counts_that_lerobot_sends(form, goal, count, turned):
    known = read_calibration({"a": ELBOW, "b": {**ELBOW, "drive_mode": 1}})
    assert [known[name].counts(np.array([goal]), form).tolist() for name in "ab"] == [[count], [turned]]
    feetech_only = read_calibration({"b": {**ELBOW, "drive_mode": 1}}, drive_mode=False)
    assert feetech_only["b"].counts(np.array([goal]), form).tolist() == [count]


@given(st.floats(-150.0, 150.0), st.integers(0, 2000), st.integers(2001, 4095), st.sampled_from([RANGE, DEGREES]))
def test_an_angle_is_its_count_from_the_middle(goal, low, high, form):
    one = Calibration(range_min=low, range_max=high)
    count = one.counts(np.array([goal]), form)[0]
    angle = joint_angles(np.array([goal]), form, one, None)[0]
    assert angle == pytest.approx(COUNT * (count - (low + high) / 2.0), abs=1e-12)
    if form == DEGREES:  # less what is cut off, and LeRobot's turn of 4095 counts
        assert abs(angle - math.radians(goal)) <= COUNT + abs(math.radians(goal)) / 4096


@pytest.mark.parametrize(("form", "goal", "calibrated", "limits", "angle"), [
    (RANGE, -100.0, True, None, -1099.5 * COUNT), (RANGE, -100.0, True, (-1.0, 2.0), 0.5 - 1099.5 * COUNT),
    (OPENING, 0.0, True, (-0.2, 1.8), -0.2), (OPENING, 100.0, True, (-0.2, 1.8), -0.2 + 2199 * COUNT),
    (OPENING, 0.0, True, None, -1099.5 * COUNT),
    (RANGE, -100.0, False, (-1.0, 2.0), -1.0), (RANGE, 100.0, False, (-1.0, 2.0), 2.0),
    (RANGE, 50.0, False, (-1.0, 2.0), 1.25), (RANGE, 120.0, False, (-1.0, 2.0), 2.0),
    (OPENING, 50.0, False, (-0.2, 1.8), 0.8), (DEGREES, 90.0, False, None, math.pi / 2),
    (DEGREES, 90.0, False, (-1.0, 2.0), 0.5 + math.pi / 2),
])
def test_where_a_range_lies(form, goal, calibrated, limits, angle):
    one = read_calibration({"elbow": ELBOW})["elbow"] if calibrated else None
    np.testing.assert_allclose(joint_angles(np.array([goal]), form, one, limits), [angle], rtol=1e-12)


def test_a_gripper_that_closes_with_more_counts_opens_with_greater_angles():
    one = read_calibration({"gripper": {**ELBOW, "drive_mode": 1}})["gripper"]
    angles = joint_angles(np.array([0.0, 100.0]), OPENING, one, (-0.2, 1.8))
    np.testing.assert_allclose(angles, [-0.2, -0.2 + 2199 * COUNT], rtol=1e-12)


@pytest.mark.parametrize("form", [RANGE, OPENING])
def test_a_share_of_an_unknown_range_is_no_angle(form):
    with pytest.raises(InputError, match="with a calibration, or limits"):
        joint_angles(np.zeros(1), form, None, None)


@pytest.mark.parametrize(("content", "words"), [
    ("", ("empty file",)), ("[1, 2]", ("shoulder_pan", "as LeRobot writes it")), ("{}", ("as LeRobot writes it",)),
    ('{"homing_offset": [1, 2], "motor_names": ["a", "b"]}', ("homing_offset", "as LeRobot writes it")),  # of 2024
    ('{"elbow": {"range_min": 1}}', ("elbow range_max", "nothing", "a whole number")),
    ('{"elbow": {"range_min": 1.5, "range_max": 3}}', ("elbow range_min", "1.5", "a whole number")),
    ('{"elbow": {"range_min": true, "range_max": 3}}', ("elbow range_min", "a whole number")),
    ('{"elbow": {"range_min": 3, "range_max": 3}}', ("elbow range_min and range_max", "3 and 3", "smaller one first")),
    ('{"elbow": {"range_min": 1, "range_max": 3, "drive_mode": 2}}', ("elbow drive_mode", "0 or 1")),
])
def test_what_is_no_calibration_is_said_in_one_line(tmp_path, content, words):
    file = tmp_path / "arm.json"
    file.write_text(content)
    with pytest.raises(InputError) as caught:
        read_calibration(file)
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in (str(file), *words)), str(caught.value)
