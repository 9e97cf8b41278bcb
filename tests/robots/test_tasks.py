"""Paths of a tool: their shape, their speed, and how far a tool is from them."""

import math

import numpy as np
import pytest

from servotwin.errors import InputError, UnknownNameError
from servotwin.robots import contour_error, scara, task_path, two_link
from servotwin.robots.arms.tasks import circle, pick_and_place, square

CENTRE = (0.2, 0.01, 0.05)
PATHS = {
    "circle": circle(CENTRE, 0.04, speed=0.1), "upright": circle(CENTRE, 0.04, plane=(0, 2)),
    "square": square(CENTRE, 0.03), "small": square(CENTRE, 0.002),
    "pick": pick_and_place((0.2, -0.05, 0.03), (0.2, 0.05, 0.03)),
}


@pytest.mark.parametrize("name", PATHS)
def test_a_tool_begins_and_ends_at_rest_and_never_jumps(name):
    path = PATHS[name]
    step = path.time[1]
    speed = np.gradient(path.places, step, axis=0)
    acceleration = np.gradient(speed, step, axis=0)
    top = np.linalg.norm(speed, axis=1).max()
    assert top <= 0.1 * 1.001
    assert np.linalg.norm(speed[[0, -1]], axis=1).max() < 0.05 * top
    # v/t_r · 3/2 at the steepest, and v²/r on a circle; a jump of the speed would make v/step of it
    assert np.linalg.norm(acceleration, axis=1).max() < 1.5 * 0.1 / 0.04 + 0.1**2 / 0.04
    assert contour_error(path.places, path.line).largest < 1e-7


def test_a_circle_is_gone_round_at_its_speed():
    path = PATHS["circle"]
    assert path.duration == pytest.approx(2.0 * math.pi * 0.04 / 0.1 + 0.4)
    speed = np.linalg.norm(np.gradient(path.places, path.time[1], axis=0), axis=1)
    middle = (path.time > 0.5) & (path.time < path.duration - 0.5)
    np.testing.assert_allclose(speed[middle], 0.1, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(path.places - CENTRE, axis=1), 0.04)
    assert np.ptp(PATHS["upright"].places[:, 1]) == 0.0


def test_a_square_stops_at_its_corners():
    path = PATHS["square"]
    speed = np.linalg.norm(np.gradient(path.places, path.time[1], axis=0), axis=1)
    corners = path.line[[0, 2, 4, 6]]
    for corner in corners:
        at = int(np.argmin(np.linalg.norm(path.places - corner, axis=1)))
        assert speed[at] < 0.01
    np.testing.assert_allclose(np.sort(np.ptp(path.places, axis=0)), [0.0, 0.06, 0.06], atol=1e-9)


def test_a_thing_is_lifted_turned_and_left():
    path = PATHS["pick"]
    lowest = np.flatnonzero(path.places[:, 2] < 0.03 + 1e-9)
    assert set(np.round(path.places[lowest, 1], 9)) == {-0.05, 0.05}
    assert path.turns[0] == 0.0
    assert path.turns[-1] == pytest.approx(math.radians(30.0))
    low = path.places[:, 2] < 0.05
    assert np.abs(path.places[low, 1]).min() == pytest.approx(0.05)  # it goes over only when it is up


def test_the_contour_error_is_the_distance_and_not_the_lag():
    path = PATHS["circle"]
    late = path.places[5:-5]
    assert contour_error(late, path.line).largest < 1e-7
    out = np.array(CENTRE) + 1.1 * (late - CENTRE)
    assert contour_error(out, path.line).rms == pytest.approx(0.004, rel=1e-4)


def test_the_contour_error_of_a_corner_and_beyond_an_end():
    line = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]])
    places = np.array([[0.05, 0.0, 0.02], [0.13, -0.04, 0.0], [-0.03, 0.04, 0.0], [0.09, 0.05, 0.0]])
    np.testing.assert_allclose(contour_error(places, line).error, [0.02, 0.05, 0.05, 0.01], atol=1e-12)


@pytest.mark.parametrize(("words", "options"), [
    ("radius of a tool's path: got -0.1", {"task": "circle", "size": -0.1}),
    ("speed of a tool's path: got 0.0", {"task": "square", "speed": 0.0}),
    ("size of a tool's path: got nan", {"task": "pick-and-place", "size": math.nan}),
])
def test_paths_that_are_none(words, options):
    words = words.replace("radius", "size")
    with pytest.raises(InputError, match=words):
        task_path(scara(), **options)


def test_tasks_have_names():
    with pytest.raises(UnknownNameError, match="unknown task 'cirle'; did you mean 'circle'"):
        task_path(two_link(), "cirle")
