"""Faults that were found once, each with what showed it."""

import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin import loads
from servotwin.errors import InputError


@pytest.mark.long
@pytest.mark.parametrize(("amplitude", "frequency"), [(0.3, 2.0), (0.2, 2.9)])
def test_a_sine_is_followed_through_hundreds_of_stick_phases(servo, amplitude, frequency):
    """Releases and sticks alternated at one instant: the closed form lost the digits of a short motion."""
    command = st.signals.sine(mean=1.0, amplitude=amplitude, frequency=frequency, unit="rad")
    result = st.simulate(st.BoundedServo(servo), command, duration=60.0, output_times=[60.0])
    assert result.status.ok
    assert all(b.time > a.time for a, b in zip(result.events, result.events[1:], strict=False))


@pytest.mark.parametrize("change", [
    {"motor.rotor_inertia": 1.27551e-8, "stops.restitution": 0.8},
    {"motor.rotor_inertia": 2e-9, "stops.upper_angle": 3.0, "stops.restitution": 0.9},
])
def test_bouncing_ends_where_a_bounce_is_lower_than_rounding(servo, change):
    """Tens of thousands of bounces followed each other below the last digit of the angle."""
    change = {**change, "electronics.pulse_width_max": 4e-3}
    result = st.simulate(st.BoundedServo(servo.replace(change)), st.signals.step(900.0, 3500.0, unit="us"),
                         duration=1.0, load=loads.Constant(-2.0))
    assert result.status.ok
    assert len(result.events) < 1000
    assert result["output_speed"][-1] == 0.0


def test_another_load_takes_effect_from_the_state_on(servo):
    """A state went on from its anchor with the new load, and the angle jumped."""
    model, command = st.BoundedServo(servo), st.signals.step(0.0, 120.0, unit="deg")
    sim = st.Simulator(model)
    state = sim.advance(sim.initial(command), 0.3, command)
    heavy = st.Simulator(model, load=loads.Inertia(0.05)).advance(state, 0.3 + 1e-9, command)
    assert heavy["output_angle"] == pytest.approx(state["output_angle"], abs=1e-8)
    with pytest.raises(InputError, match="motor_angle"):
        st.Simulator(st.DCMotor(servo)).advance(state, 0.4, st.signals.constant(1.0, unit="V"))


def test_an_impact_at_the_start_counts_in_the_energy(servo):
    model = st.BoundedServo(servo.replace({"stops.restitution": 0.5}))
    upper = servo.stops.upper_angle
    result = st.simulate(model, st.signals.constant(90.0, unit="deg"), duration=0.01,
                         initial={"output_angle": upper, "output_speed": 3.0})
    assert result.energy.stops == pytest.approx(0.5 * model.pack(loads.Load()).shaft.J * 9.0 * 0.75, rel=1e-9)
    assert abs(result.energy.residual) < 1e-12


def test_a_record_that_ends_with_the_run_up_to_rounding(servo):
    result = st.simulate(st.BoundedServo(servo), st.signals.step(0.0, 90.0, at=0.1, unit="deg"), duration=0.1 + 0.2,
                         load=loads.Recorded([0.0, 0.1, 0.3], [0.0, 0.3, 0.1]))
    assert np.isfinite(result["load_torque"]).all()


@pytest.mark.parametrize("model_class", [st.AveragedServo, st.AveragedServoInductive, st.BoundedServo, st.DCMotor])
def test_results_can_be_pickled(servo, model_class):
    result = st.simulate(model_class(servo), st.signals.step(0.7, 1.3, unit="V"), duration=0.1)
    again = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(again[result.names[-1]], result[result.names[-1]])


def test_offsets_that_are_not_given_are_zero(servo):
    values = {}
    for name in servo.names():
        group, key = name.split(".")
        if "offset" not in key:
            values.setdefault(group, {})[key] = servo.get(name)
    bare = st.servo_from_values("bare", values)
    for model_class in (st.AveragedServo, st.BoundedServo):
        model = model_class(bare)
        k_p2, k_p1 = bare.electronics.pulse_to_voltage_gain, bare.electronics.voltage_to_pulse_gain
        assert float(model.command(st.signals.constant(1.0, unit="V"))(0.0)) == pytest.approx(k_p1 * k_p2)
        assert float(model.command(st.signals.constant(1.0, unit="ms"))(0.0)) == pytest.approx(1e-3 * k_p2, rel=1e-5)
        assert model.start_angle(0.3) == pytest.approx(0.3 / bare.potentiometer.feedback_gain)


def test_calibrations_are_compared_at_both_ends(servo):
    slope, T_0, k_p2 = servo.electronics.one_shot_slope, servo.electronics.one_shot_offset, 900.0
    b_i = (1.5e-3 - T_0) / slope - k_p2 * (1.5e-3 - servo.electronics.command_pulse_offset)
    crossing = servo.replace({"electronics.pulse_to_voltage_gain": k_p2, "electronics.command_offset": b_i})
    with pytest.warns(UserWarning, match="one_shot_slope.*pulse_to_voltage_gain"):
        st.BoundedServo(crossing)
