"""Pure pursuit: the arc to a point ahead, corners, arriving, and turning on the spot."""

import math

import numpy as np
import pytest

from servotwin.errors import InputError
from servotwin.robots import Odometry, Pose, PurePursuit
from servotwin.robots.waypoints import PursuitState

KNOWN = {"lookahead": 0.1, "speed": 0.1, "tolerance": 0.01, "track": 0.16}
LINE = PurePursuit(waypoints=[(0.0, 0.0), (1.0, 0.0)], **KNOWN)
CORNER = PurePursuit(waypoints=[(0.0, 0.0), (0.5, 0.0), (0.5, 0.5)], **KNOWN)


def driven(pursuit, pose, frames=2000, frame=0.02):
    """Return the poses of an ideal robot that follows."""
    wheels, state, poses = Odometry(radius=0.03, track=0.16), PursuitState(), [pose]
    for _ in range(frames):
        decision = pursuit.step(state, pose)
        state = decision.state
        left, right = wheels.wheel_speeds(decision.speed, decision.turn_rate)
        pose = wheels.step(pose, frame * left, frame * right)
        poses.append(pose)
    return np.array(poses), state


@pytest.mark.parametrize("aside", [-0.08, -0.02, 0.0, 0.05])
@pytest.mark.parametrize("heading", [-0.4, 0.0, 0.6])
def test_the_arc_leads_through_the_goal(aside, heading):
    pose = Pose(0.3, aside, heading)
    decision = LINE.step(PursuitState(0.25), pose)
    dx, dy = decision.goal[0] - pose.x, decision.goal[1] - pose.y
    assert math.hypot(dx, dy) == pytest.approx(0.1)
    assert decision.goal[1] == pytest.approx(0.0, abs=1e-15)
    left = math.cos(heading) * dy - math.sin(heading) * dx
    assert decision.turn_rate == pytest.approx(decision.speed * 2.0 * left / 0.1**2, abs=1e-15)
    if decision.turn_rate == 0.0:
        return
    around = decision.speed / decision.turn_rate  # both ends of the chord are as far from the arc's centre
    centre = pose.x - around * math.sin(heading), pose.y + around * math.cos(heading)
    assert math.hypot(decision.goal[0] - centre[0], decision.goal[1] - centre[1]) == pytest.approx(abs(around))


def test_no_wheel_is_asked_for_more_than_it_has():
    for aside in np.linspace(-0.099, 0.099, 21):
        decision = LINE.step(PursuitState(0.3), Pose(0.3, aside, 0.0))
        assert decision.speed + 0.08 * abs(decision.turn_rate) <= 0.1 + 1e-12


def test_it_comes_back_to_its_path_and_ends_at_its_end():
    poses, state = driven(LINE, Pose(0.0, 0.08, 0.3))
    assert state.arrived
    assert LINE.apart(poses[:, 0], poses[:, 1])[400:].max() < 1e-3
    np.testing.assert_allclose(poses[-1, :2], [1.0, 0.0], atol=0.0101)
    assert (poses[-1] == poses[-50]).all()


def test_it_takes_a_corner_no_wider_than_its_look_ahead():
    poses, state = driven(CORNER, Pose())
    assert state.arrived
    assert 0.005 < CORNER.apart(poses[:, 0], poses[:, 1]).max() < 0.05


def test_it_turns_on_the_spot_while_its_goal_is_behind():
    decision = LINE.step(PursuitState(), Pose(0.0, 0.0, 3.0))
    assert (decision.speed, decision.turn_rate) == (0.0, pytest.approx(-2.0 * 0.1 / 0.16))
    assert driven(LINE, Pose(0.0, 0.0, 3.0))[1].arrived


def test_a_round_does_not_end_where_it_begins():
    square = PurePursuit(waypoints=[(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4), (0.0, 0.0)], **KNOWN)
    poses, state = driven(square, Pose())
    assert not square.step(PursuitState(), Pose()).state.arrived
    assert state.arrived
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() > 1.4
    assert square.apart(poses[:, 0], poses[:, 1]).max() < 0.05


def test_lengths_and_distances():
    assert CORNER.length == pytest.approx(1.0)
    assert CORNER.at(0.75) == pytest.approx((0.5, 0.25))
    np.testing.assert_allclose(CORNER.apart([0.25, 0.8, -0.3, 0.4], [0.1, 0.9, -0.4, 0.2]), [0.1, 0.5, 0.5, 0.1])


@pytest.mark.parametrize(("wrong", "text"), [
    ({"waypoints": [(0.0, 0.0)]}, "at least two pairs"), ({"waypoints": [(0.0, 0.0), (0.0, 0.0)]}, "twice on end"),
    ({"waypoints": "here"}, "pairs of numbers"), ({"waypoints": [(0.0, math.nan), (1.0, 0.0)]}, "finite"),
    ({"lookahead": 0.0}, "lookahead of a pursuit: got 0"), ({"speed": -1.0}, "speed of a pursuit"),
    ({"most": math.inf}, "most of a pursuit")])
def test_bad_input(wrong, text):
    with pytest.raises(InputError, match=text):
        PurePursuit(**{"waypoints": [(0.0, 0.0), (1.0, 0.0)], **KNOWN, **wrong})
