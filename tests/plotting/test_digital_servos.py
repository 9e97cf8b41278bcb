"""Pictures of digital servos: the loop at rest, and a response with duty, reference and trip."""

import numpy as np
import pytest

import servotwin as st
from servotwin import plotting

STS = st.feetech_sts({"P_Coefficient": 16}, servo="feetech-sts3215-12v")


def loop(**changes):
    return st.datasheet.Loop(st.DigitalServo(STS.replace({f"firmware.{name}": value
                                                          for name, value in changes.items()})))


def test_the_loop_is_drawn_with_what_is_told_of_it():
    one = loop()
    figure = plotting.loop_curve([one])
    whole, middle = figure.axes
    assert all("(" in label for label in (whole.get_ylabel(), whole.get_xlabel(), middle.get_xlabel()))
    motor = whole.get_lines()[0]
    x, y = np.radians(motor.get_xdata()), motor.get_ydata()
    np.testing.assert_allclose(y, [one.at(error).motor for error in x], atol=1e-12)
    assert y.max() == pytest.approx(one.cap_torque, rel=1e-12)
    np.testing.assert_allclose(y, -y[::-1], atol=1e-12)
    lifts, holds = (line.get_ydata() for line in whole.get_lines()[1:3])
    assert (lifts < holds).all()
    np.testing.assert_allclose(lifts, -holds[::-1], atol=1e-12)
    said = " ".join(text.get_text() for ax in (whole, middle) for text in ax.texts)
    for words in ("cap: 6.01 N m", "trips after 2 s", "dead zone", "startup force: 0.099 N m", "free shaft moves"):
        assert words in said
    dashes = {str(line.get_linestyle()) + str(line._dash_pattern) for line in whole.get_lines()[:3]}
    assert len(dashes) == 3  # told apart in grey print


def test_a_loop_without_zone_startup_and_trips_is_drawn_without_them():
    bare = loop(deadband_angle=None, minimum_duty=None, overload_duty=None, trip_current=None)
    said = " ".join(text.get_text() for ax in plotting.loop_curve([bare]).axes for text in ax.texts)
    assert "cap:" in said
    for words in ("dead zone", "startup", "trips"):
        assert words not in said


@pytest.mark.long
def test_several_voltages_are_told_apart():
    sheet = st.curves(st.DigitalServo(STS), voltage=[12.0, 9.0], bandwidth=False)
    loops = [part.loop for part in sheet.voltages]
    labels = [text.get_text() for text in plotting.loop_curve(loops).legends[0].get_texts()]
    assert {"motor, 12 V", "motor, 9 V"} <= set(labels)
    assert plotting.loop_curve([*loops, *loops], page=2).get_suptitle().endswith(", page 2 of 2")


@pytest.mark.parametrize(("torque", "shaded"), [(0.2, []), (12.0, ["tripped by current"])])
def test_a_response_shows_duty_reference_and_trips(torque, shaded):
    result = st.simulate(st.DigitalServo(STS), st.signals.step(0.0, 30.0, at=0.1, unit="deg"), duration=2.5,
                         load=st.loads.Constant(torque) + st.loads.Inertia(1e-3))
    figure = plotting.time_response(result)
    names = [ax.get_ylabel().split("\n")[0] for ax in figure.axes]
    assert names == ["output angle", "output speed", "duty", "armature current"]
    angle, duty = figure.axes[0], figure.axes[2]
    assert [line.get_label() for line in angle.get_lines()] == ["command", "reference", "output angle"]
    np.testing.assert_allclose(angle.get_lines()[1].get_ydata(), np.degrees(result["reference_angle"]), rtol=1e-12)
    np.testing.assert_allclose(duty.get_lines()[0].get_ydata(), 100.0 * result["duty"], rtol=1e-12)
    assert [area.get_label() for area in duty.collections] == shaded
