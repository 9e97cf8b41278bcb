"""Set S, the invented servo of docs/theory/averaging.md: what its pulses do, and what their mean does.

Sags are means over 0.6 s to 1.2 s of a run of 1.2 s that starts at the angle without error, the load there from t = 0
on. They are not settled yet: the settled ones are means over 3 s to 4 s. The one-shot is 0.5 ms, 0.6 ms and 0.9 ms long
at the start, which moves when a frame's drive begins and so the sag by less than a hundredth of a degree.
"""

import math

import numpy as np
import pytest

import servotwin as st

SLOPE, PULSE_PER_RADIAN = 1e-3, 573e-6  # s/V, s/rad
MOMENTS = 2400  # of a mean over time
CENTRES = [500.0, 600.0, 900.0]  # us, the one-shot at the start


def set_s(centre=600.0, **electronics):
    return st.PulseServo(st.servo_from_values("set-s", {
        "motor": {"armature_resistance": 3.1, "torque_constant": 1.03, "back_emf_constant": 1.03,
                  "rotor_inertia": 6e-3, "motor_viscous_friction": 0.0},
        "gear": {"gear_reduction": 1.0},
        "friction": {"coulomb_torque_forward": 0.2, "coulomb_torque_backward": 0.2},
        "electronics": {"frame_period": 0.02, "deadband": 8e-6, "stretcher_gain": 60.0, "minimum_drive_time": 0.0,
                        "off_state": "brake", "one_shot_offset": 0.0, "one_shot_slope": SLOPE, **electronics},
        "potentiometer": {"feedback_gain": PULSE_PER_RADIAN / SLOPE, "feedback_offset": 1e-6 * centre / SLOPE},
        "supply": {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 0.4},
    }))


def mean_sag(model, torque, start, end, command=None):
    """Mean of −q [deg] from `start` to `end` [s]."""
    times = start + (end - start) * (np.arange(MOMENTS) + 0.5) / MOMENTS
    command = st.signals.constant(0.0, unit="deg") if command is None else command
    result = st.simulate(model, command, duration=end, load=st.loads.Constant(torque), output_times=times)
    return -math.degrees(float(result["output_angle"].mean()))


def stepped(model, degrees, duration):
    result = st.simulate(model, st.signals.step(0.0, degrees, unit="deg"), duration=duration)
    return np.degrees(result["output_angle"])


@pytest.mark.parametrize(("centre", "period", "torque", "printed", "settled"), [
    (600.0, 0.02, 0.3, 3.99, 4.36), (500.0, 0.02, 0.3, 3.99, 4.36), (900.0, 0.02, 0.6, 10.47, 10.64),
    (600.0, 0.01, 0.3, 2.35, 2.44), (500.0, 0.01, 0.6, 5.55, 5.57), (900.0, 0.005, 0.3, 1.41, 1.44),
    (600.0, 0.005, 0.6, 3.00, 3.00),
])
def test_the_pulses_sag(centre, period, torque, printed, settled):
    model = set_s(centre, frame_period=period)
    assert mean_sag(model, torque, 0.6, 1.2) == pytest.approx(printed, abs=0.01)
    assert mean_sag(model, torque, 3.0, 4.0) == pytest.approx(settled, abs=0.02)


@pytest.mark.parametrize("torque", [0.3, 0.6])
@pytest.mark.parametrize("period", [0.02, 0.01, 0.005])
def test_the_mean_voltage_stands_where_its_stiffness_and_its_friction_let_it(period, torque):
    stiffness = st.physics.pulse_stiffness(1.03 / 3.1, 5.6, 60.0, PULSE_PER_RADIAN, period)
    least, most = (math.degrees(0.5 * 8e-6 / PULSE_PER_RADIAN + (torque + friction) / stiffness)
                   for friction in (-0.2, 0.2))
    sag = mean_sag(set_s(frame_period=period).averaged(), torque, 3.0, 4.0)
    assert least - 1e-9 <= sag <= most
    if period == 0.02:  # overdamped there: it does not fall beyond the first angle that holds
        assert sag == pytest.approx(least, abs=1e-6)


def test_the_mean_voltage_sags_by_half_as_much_as_the_pulses():
    assert mean_sag(set_s().averaged(), 0.3, 0.6, 1.2) == pytest.approx(2.19, abs=0.005)


@pytest.mark.parametrize("centre", CENTRES)
def test_a_step_of_60_degrees_at_a_brake(centre):
    angle = stepped(set_s(centre), 60.0, 1.2)
    assert angle[-1] == pytest.approx(58.66, abs=0.005)
    assert np.all(np.diff(angle) >= 0.0)


@pytest.mark.parametrize("centre", CENTRES)
def test_a_step_of_60_degrees_that_coasts_overshoots(centre):
    assert stepped(set_s(centre, off_state="coast"), 60.0, 1.2).max() - 60.0 == pytest.approx(5.6, abs=0.1)


@pytest.mark.parametrize("centre", CENTRES)
def test_a_step_of_2_degrees_stands_halfway_after_a_second(centre):
    assert stepped(set_s(centre), 2.0, 1.0)[-1] == pytest.approx(1.04, abs=0.005)


def test_the_mean_voltage_never_moves_for_2_degrees():
    assert stepped(set_s().averaged(), 2.0, 10.0).max() == 0.0


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_losing_one_frame_of_three_makes_the_sag_half_as_large_again(lost):
    edges = [0.02 * k for k in range(200) if k % 3 != lost]
    command = st.signals.pulse_train(edges, [600.0] * len(edges))
    assert mean_sag(set_s(), 0.6, 0.6, 1.2, command) == pytest.approx(15.18, abs=0.02)  # printed: about 15.5
    assert mean_sag(set_s(), 0.6, 3.0, 4.0, command) == pytest.approx(15.84, abs=0.02)


def test_without_pulses_it_creeps_at_a_brake():
    last = st.signals.pulse_train([0.0], [600.0])
    result = st.simulate(set_s(), last, duration=1.2, load=st.loads.Constant(0.6))
    assert result["output_speed"][-1] == pytest.approx(-(0.6 - 0.2) * 3.1 / 1.03**2, rel=1e-9)


def test_without_pulses_it_falls_when_it_coasts():
    last = st.signals.pulse_train([0.0], [600.0])
    result = st.simulate(set_s(off_state="coast"), last, duration=0.08, load=st.loads.Constant(0.6))
    assert result["output_speed"][-1] == pytest.approx(-(0.6 - 0.2) / 6e-3 * 0.08, rel=1e-9)
