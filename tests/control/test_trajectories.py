"""Trajectories against closed forms: durations, limits that are reached and kept, rests, continuity."""

import math

import numpy as np
import pytest

from servotwin import control
from servotwin.errors import InputError

SHAPES = {
    "trapezoid": (control.trapezoid([0.2, 1.7, -0.5], speed=2.0, acceleration=9.0), 1),
    "trapezoid without cruise": (control.trapezoid([0.0, 0.1], speed=2.0, acceleration=9.0), 1),
    "s-curve": (control.s_curve([0.2, 1.7, -0.5], speed=2.0, acceleration=9.0, jerk=90.0), 2),
    "s-curve without cruise": (control.s_curve([0.0, 0.3], speed=2.0, acceleration=9.0, jerk=90.0), 2),
    "s-curve of jerk alone": (control.s_curve([0.0, 0.02], speed=2.0, acceleration=9.0, jerk=90.0), 2),
    "quintic": (control.quintic([0.2, 1.7, -0.5], speed=2.0, acceleration=9.0, jerk=90.0), 3),
    "quintic through": (control.quintic([0.2, 1.7, -0.5], times=[0.0, 1.0, 2.5]), 3),
}


@pytest.fixture(params=SHAPES, scope="module")
def shape(request):
    return SHAPES[request.param]


def test_it_rests_at_both_ends(shape):
    path, _ = shape
    for time in (-1.0, path.duration + 1.0):
        assert path.at(time)[1:] == (0.0, 0.0, 0.0)
    assert path.at(-1.0).angle == pytest.approx(path.at(0.0).angle, abs=1e-15)
    assert path.at(path.duration).speed == pytest.approx(0.0, abs=1e-9)


def test_rates_are_the_derivatives(shape):
    path, smooth = shape
    h, t = 1e-5, np.linspace(0.003, path.duration - 0.003, 400)
    later, before, now = path.at(t + h), path.at(t - h), path.at(t)
    for order in range(smooth):
        difference = (later[order] - before[order]) / (2.0 * h)
        assert difference == pytest.approx(now[order + 1], abs=2e-3 * np.abs(now[order + 1]).max())


@pytest.mark.parametrize(("make", "limits"), [
    (control.trapezoid, {"speed": 2.0, "acceleration": 9.0}),
    (control.s_curve, {"speed": 2.0, "acceleration": 9.0, "jerk": 90.0}),
    (control.quintic, {"speed": 2.0, "acceleration": 9.0, "jerk": 90.0})])
@pytest.mark.parametrize("way", [1.5, 0.3, 0.02])
def test_limits_are_kept_and_one_of_them_is_reached(make, limits, way):
    path = make([0.0, way], **limits)
    seen = path.at(np.linspace(0.0, path.duration, 20001))
    shares = [np.abs(getattr(seen, name)).max() / limit for name, limit in limits.items()]
    assert max(shares) == pytest.approx(1.0, abs=1e-6)
    assert path.at(path.duration).angle == pytest.approx(way, abs=1e-12)


@pytest.mark.parametrize(("path", "duration"), [
    (control.trapezoid([0.0, 1.0], speed=2.0, acceleration=8.0), 1.0 / 2.0 + 2.0 / 8.0),
    (control.trapezoid([0.0, 1.0], speed=9.0, acceleration=4.0), 2.0 * math.sqrt(1.0 / 4.0)),
    (control.s_curve([0.0, 1.0], speed=2.0, acceleration=8.0, jerk=80.0), 1.0 / 2.0 + 2.0 / 8.0 + 8.0 / 80.0),
    (control.s_curve([0.0, 1.0], speed=9.0, acceleration=99.0, jerk=32.0), 4.0 * (1.0 / 2.0 / 32.0)**(1.0 / 3.0)),
    (control.quintic([0.0, 1.0], acceleration=5.0), math.sqrt(10.0 / math.sqrt(3.0) / 5.0))])
def test_durations_are_those_of_the_closed_forms(path, duration):
    assert path.duration == pytest.approx(duration, rel=1e-12)


@pytest.mark.parametrize("make", [control.trapezoid, control.s_curve])
def test_joints_arrive_together_each_within_its_own_limits(make):
    more = {"jerk": [200.0, 100.0]} if make is control.s_curve else {}
    path = make([[0.0, 1.0], [1.0, 0.5]], speed=[2.0, 0.5], acceleration=[20.0, 10.0], **more)
    seen = path.at(np.linspace(0.0, path.duration, 5001))
    assert seen.angle.shape == (5001, 2)
    assert np.abs(seen.speed).max(axis=0) == pytest.approx([1.0, 0.5], abs=1e-6)  # the second one sets the pace
    assert seen.angle[:, 1] == pytest.approx(1.0 - 0.5 * seen.angle[:, 0], abs=1e-12)


def test_a_quintic_with_times_goes_through_its_waypoints_and_keeps_its_jerk_continuous():
    path = control.quintic([[0.0, 1.0], [1.0, 0.0], [0.5, 2.0]], times=[0.0, 0.7, 2.0])
    assert path.at([0.0, 0.7, 2.0]).angle == pytest.approx(np.array([[0.0, 1.0], [1.0, 0.0], [0.5, 2.0]]), abs=1e-12)
    assert path.at(0.7 - 1e-9).jerk == pytest.approx(path.at(0.7).jerk, rel=1e-5)
    assert path.at([0.0, 2.0]).acceleration == pytest.approx(np.zeros((2, 2)), abs=1e-9)


def test_two_waypoints_with_times_are_the_one_polynomial():
    tau = np.linspace(0.0, 1.0, 11)
    path = control.quintic([0.0, 2.0], times=[0.0, 0.5])
    assert path.at(0.5 * tau).angle == pytest.approx(2.0 * (10.0 * tau**3 - 15.0 * tau**4 + 6.0 * tau**5), abs=1e-12)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: control.trapezoid([0.0, 1.0], speed=-1.0, acceleration=1.0), "speed"),
    (lambda: control.trapezoid([0.0, math.nan], speed=1.0, acceleration=1.0), "angles"),
    (lambda: control.trapezoid([1.0, 1.0], speed=1.0, acceleration=1.0), "hold"),
    (lambda: control.s_curve([0.0, 1.0], speed=1.0, acceleration=1.0, jerk="much"), "jerk"),
    (lambda: control.quintic([0.0, 1.0]), "neither"),
    (lambda: control.quintic([0.0, 1.0], times=[0.0, 1.0], speed=1.0), "times and limits"),
    (lambda: control.quintic([0.0, 1.0], times=[0.0, 0.0]), "times"),
    (lambda: control.sampled([0.0, 1.0], [0.0, 1.0]), "at least 6"),
    (lambda: control.step(0.0, 1.0, at=2.0, duration=1.0), "at"),
    (lambda: control.hold(0.0, 0.0), "duration"),
    (lambda: control.Trajectory([0.0, 1.0], [[1.0, 2.0]]), "shape")])
def test_bad_input_is_one_line(call, words):
    with pytest.raises(InputError, match=words) as told:
        call()
    assert "\n" not in str(told.value)
