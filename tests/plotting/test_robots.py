"""Pictures of robots that have followed a motion."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin import plotting

TIME = np.linspace(-0.5, 4.5, 2501)
CURVE = st.curves(st.PulseServo(st.load_servo("hitec-hs-755hb")), bandwidth=False).voltages[0]


def joint(name="elbow", slides=False):
    goal = np.sin(TIME)
    return plotting.JointTrace(name, TIME, goal, 0.9 * goal, goal, slides)


def electrics(**more):
    return plotting.ServoTrace("elbow", TIME, np.sign(np.sin(100.0 * np.pi * TIME)), **more)


def shaft(**more):
    torque = 0.6 * np.sin(TIME)
    values = {"label": "elbow_flex", "words": "2.1×", "curves": [("alone on 6 V", CURVE.cold), ("hot", CURVE.hot)],
              "needed": plotting.Cloud(np.abs(np.cos(TIME)), torque),
              "delivered": plotting.Cloud(np.abs(np.cos(TIME)), 9.0 * torque), "worst": (1.0, 0.5), "rms_torque": 0.4,
              "lasting_torque": 0.8, **more}
    return plotting.ShaftTrace(**values)


@pytest.mark.long(but="2-4")
@pytest.mark.parametrize(("count", "axes"), [(1, 2), (2, 4), (5, 10)])
def test_each_joint_has_its_motion_and_its_error(count, axes):
    figure = plotting.joint_tracking([joint(f"joint {k}") for k in range(count)])
    assert len(figure.axes) == axes


@pytest.mark.parametrize(("slides", "unit", "factor"), [(False, "°", math.degrees(1.0)), (True, "mm", 1e3)])
def test_places_are_in_units_that_people_read(slides, unit, factor):
    above, below = plotting.joint_tracking([joint(slides=slides)], events=(0.0, 4.0)).axes
    assert f"({unit})" in above.get_ylabel()
    assert f"({unit})" in below.get_ylabel()
    assert max(above.lines[-3].get_ydata()) <= factor
    error = next(line for line in below.lines if len(line.get_ydata()) > 2)
    assert max(error.get_ydata()) == pytest.approx(0.1 * factor, rel=1e-3)


@pytest.mark.parametrize(("more", "titles"), [
    ({}, ["motor current (A)"]),
    ({"voltage": 6.0 - 0.1 * np.abs(TIME)}, ["motor current (A)", "supply (V)"]),
    ({"voltage": TIME, "winding": 298.15 + TIME, "housing": 298.15 + 0.0 * TIME},
     ["motor current (A)", "supply (V)", "temperature (°C)"]),
])
def test_what_a_servo_does_not_have_is_not_shown(more, titles):
    figure = plotting.servo_electrics([electrics(**more), electrics()])
    assert [ax.get_title() for ax in figure.axes if ax.get_title()] == titles


def test_a_current_in_pulses_is_shown_as_its_mean():
    (ax,) = plotting.servo_electrics([electrics()]).axes
    mean = ax.lines[0].get_ydata()
    assert len(mean) <= 125  # stretches of at least two frames of 20 ms
    assert np.abs(mean).max() < 0.9
    (band,) = ax.collections
    assert band.get_paths()[0].get_extents().bounds[3] == pytest.approx(2.0)


def test_torques_stand_in_the_curve_of_the_servo():
    ax = plotting.shaft_torques([shaft()]).axes[0]
    lines = {line.get_label(): line for line in ax.lines}
    np.testing.assert_allclose(lines["alone on 6 V"].get_ydata(), CURVE.cold.torque)
    np.testing.assert_allclose(lines["alone on 6 V"].get_xdata(), np.degrees(CURVE.cold.speed))
    assert min(lines["needed, holding back"].get_ydata()) >= 0.0
    assert ax.get_ylim()[1] < 1.7 * CURVE.cold.stall_torque  # what is delivered beyond is left out
    assert lines["least to spare"].get_xdata()[0] == pytest.approx(math.degrees(1.0))
    assert set(lines["lifted without end"].get_ydata()) == {0.8}


def test_what_is_not_known_is_not_drawn():
    ax = plotting.shaft_torques([shaft(worst=None, lasting_torque=math.nan)]).axes[0]
    assert not {"least to spare", "lifted without end"} & {line.get_label() for line in ax.lines}


@pytest.mark.long
def test_they_can_be_saved(tmp_path):
    plotting.save(plotting.shaft_torques([shaft(), shaft(), shaft(), shaft()]), tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
