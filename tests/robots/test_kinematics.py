"""Inverse kinematics: closed forms, limits, what is out of reach; and redundancy, used for a criterion."""

import builtins
import math

import numpy as np
import pytest

from servotwin.errors import InputError, MissingExtraError
from servotwin.robots import AwayFromLimits, LeastMotion, LeastTorque, follow, ideal_task, scara, task_path, two_link
from servotwin.robots.arms.arm import HEIGHT
from servotwin.robots.arms.arm import TWO_LENGTHS as LENGTHS
from servotwin.robots.arms.task_run import tool_places
from servotwin.robots.arms.tasks import circle, limits_of, square

pytest.importorskip("mink", reason="the extra `robots` is not installed")


def test_two_links_bend_as_the_closed_form_says():
    arm = two_link()
    path = task_path(arm, "square")
    x, z = path.places[:, 0], path.places[:, 2] - HEIGHT
    (a, b), r2 = LENGTHS, x**2 + z**2
    elbow = -np.arccos((r2 - a**2 - b**2) / (2.0 * a * b))  # bent down
    shoulder = np.arctan2(z, x) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
    np.testing.assert_allclose(follow(arm, path).angles, np.stack([shoulder, elbow], axis=1), atol=1e-8)


@pytest.mark.long(but="scara-circle")
@pytest.mark.parametrize(("make", "task"), [
    (scara, "circle"), (scara, "pick-and-place"), (lambda: scara(third_link=False), "square"),
    (two_link, "pick-and-place")])
def test_ideal_actuators_stay_on_the_path(make, task):
    arm = make()
    found = follow(arm, task_path(arm, task))
    assert ideal_task(found).contour.largest < 1e-6
    lower, upper = limits_of(arm.model(), arm)
    assert (found.angles >= lower).all()
    assert (found.angles <= upper).all()
    assert found.limit_distance > 0.02


def test_a_scara_keeps_its_tool_turned_as_asked():
    arm = scara()
    path = task_path(arm, "pick-and-place")
    angles = follow(arm, path).angles
    turned = angles[:, [0, 1, 2, 4]].sum(axis=1)
    np.testing.assert_allclose(turned, path.turns, atol=1e-9)


def test_out_of_reach_is_said_with_how_far():
    words = r"circle of 100 mm at 0\.00 s: got 'a place 40 mm out of its reach, 303 mm from"
    with pytest.raises(InputError, match=words) as caught:
        follow(scara(third_link=False), circle((0.25, 0.0, 0.045), 0.05))  # reaches 0.26 m of the 0.3
    assert "\n" not in str(caught.value)


def test_a_limit_on_the_way_is_said_with_joint_time_and_angle():
    arm = two_link()
    with pytest.raises(InputError, match=r"s: joint elbow: got '-15\d\.\d deg', allowed: -150 to 30 deg, its limits"):
        follow(arm, circle((0.05, 0.0, 0.2), 0.08, plane=(0, 2)))
    with pytest.raises(InputError, match=r"square of 20 mm at 0\.00 s: joint lift: got '\d+ mm', allowed: 0 to 50 mm"):
        follow(scara(), square((0.2, 0.0, 0.2), 0.01))


@pytest.mark.parametrize("missing", ["mink", "daqp"])
def test_without_the_extra_one_line_says_what_to_install(missing, monkeypatch):
    real = builtins.__import__

    def refuse(name, *rest, **more):
        if name == missing:
            raise ImportError(f"No module named {name!r}", name=name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingExtraError, match=rf"{missing} is needed for this: pip install 'servotwin\[robots\]'"):
        follow(two_link(), task_path(two_link(), "circle"))


# --- redundancy -------------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("criterion", "task"), [
    (AwayFromLimits(), "circle"), (AwayFromLimits(), "square"), (LeastTorque(), "square")])
def test_a_criterion_makes_small_what_it_says_and_leaves_the_tool(criterion, task):
    arm = scara()
    path = task_path(arm, task)
    without, found = LeastMotion().solve(arm, path), criterion.solve(arm, path)
    assert criterion.measure(found) < 0.95 * criterion.measure(without)
    for way in (without, found):
        np.testing.assert_allclose(tool_places(arm.model(), way.angles), path.places, atol=1e-9)
    assert LeastMotion().measure(without) < LeastMotion().measure(found)


def test_away_from_limits_is_the_best_of_all_postures():
    """Of one place, against all postures that the third link's turn leaves, by the closed form of two links."""
    arm = scara()
    path = task_path(arm, "circle")
    found = AwayFromLimits().solve(arm, path)
    x, y = path.places[0, :2]
    phi = np.linspace(-math.pi, math.pi, 20_001)  # of the third link in the world
    a, b, c = 0.14, 0.12, 0.08
    x, y = x - c * np.cos(phi), y - c * np.sin(phi)
    cosine = (x**2 + y**2 - a**2 - b**2) / (2.0 * a * b)
    elbow = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    shoulder = np.arctan2(y, x) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
    lift = np.full_like(phi, found.angles[0, 3])
    postures = np.stack([shoulder, elbow, phi - shoulder - elbow, lift, -phi], axis=1)
    lower, upper = limits_of(arm.model(), arm)
    u = (postures - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
    own = (found.angles[0] - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
    assert np.sum(own**6) == pytest.approx(np.nanmin(np.sum(u**6, axis=1)), rel=1e-2)


def test_an_arm_without_a_spare_joint_has_nothing_to_choose():
    arm = scara(third_link=False)
    for criterion in (AwayFromLimits(), LeastTorque()):
        with pytest.raises(InputError, match=r"redundancy of scara-4: got '\w+', allowed: none: it has no more joints"):
            criterion.solve(arm, task_path(arm, "circle"))
