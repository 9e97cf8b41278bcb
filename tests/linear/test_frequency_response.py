"""Simulated sines against closed forms: linear loops, the sampled loop, saturation, standstill; then the contract."""

import math

import control
import numpy as np
import pytest

import servotwin as st
from linear.bare_servos import bare
from servotwin.errors import CommandError, InputError, LoadError, UnknownNameError
from servotwin.linear import FrequencyResponse

ANALOG = [name for name in st.catalog_names() if st.load_servo(name).kind == "analog"]


def differs(seen, expected):
    """Largest relative difference of complex responses."""
    return np.abs(seen.response / expected - 1.0).max()


@pytest.mark.long(but="BoundedServo-pulse_width-feedback_voltage-2e-05")
@pytest.mark.parametrize(("model_class", "input", "output", "amplitude"), [
    (st.DCMotor, "armature_voltage", "motor_angle", 1.0), (st.GearedMotor, "armature_voltage", "output_speed", 1.0),
    (st.BoundedServo, "command_angle", "output_angle", 0.02),
    (st.BoundedServo, "pulse_width", "feedback_voltage", 2e-5),
    (st.BoundedServo, "command_voltage", "armature_current", 0.01),
    (st.AveragedServo, "command_angle", "output_angle", 0.02),
    (st.AveragedServoInductive, "command_angle", "output_speed", 0.02)])
def test_a_linear_model_gives_its_transfer_function(model_class, input, output, amplitude):
    model = model_class(bare("hitec-hs-755hb"))
    names = {"input": input, "output": output, "load": st.loads.Inertia(2e-3) + st.loads.Viscous(0.05)}
    omega = np.array([3.0, 25.0, 120.0])
    seen = st.linear.frequency_response(model, omega, amplitude=[amplitude, 0.1 * amplitude], **names)
    assert differs(seen, st.linear.transfer_function(model, **names)(1j * omega)) < 1e-4
    assert (seen.distortion < 1e-3).all()
    assert (seen.input, seen.output) == (input, output)


def sampled(model, omega, mean):
    """The small-signal response with frames: one impulse of voltage a frame, at the decision behind the edge."""
    g = model.value
    N = g("gear.gear_reduction")
    K, R, p = N * g("motor.torque_constant"), g("motor.armature_resistance"), g("potentiometer.feedback_gain")
    J = N * N * g("motor.rotor_inertia") + model.value_or("gear.output_inertia", 0.0)
    b = K * N * g("motor.back_emf_constant") / R + N * N * g("motor.motor_viscous_friction")
    T, slope = model.frame_period, g("electronics.one_shot_slope")
    drive = g("supply.open_circuit_voltage") - g("supply.bridge_drop_voltage")
    area = drive * g("electronics.stretcher_gain") * slope
    late = g("electronics.one_shot_offset") + slope * (p * mean + g("potentiometer.feedback_offset"))
    z, a = np.exp(-1j * omega * T), b / J
    loop = area * p * K / (R * b) * (  # of the plant's answer to an impulse, K/(R b) (1 − e^{−a t}), at t = k T − late
        z / (1.0 - z) - math.exp(a * (late - T)) * z / (1.0 - math.exp(-a * T) * z))
    plant = K / R / (1j * omega * (1j * omega * J + b))
    return area / T * p * plant * np.exp(-1j * omega * late) / (1.0 + loop)


@pytest.mark.parametrize("name", ["hitec-hs-755hb", "towerpro-sg90", "gobilda-2000-67", "miuzei-ms18"])
def test_small_sines_of_a_pulse_servo_are_those_of_the_sampled_loop(name):
    model = st.PulseServo(bare(name))
    nyquist = math.pi / model.frame_period
    omega = nyquist * np.array([0.01, 0.1, 0.3, 0.6, 0.9, 0.99])
    seen = st.linear.frequency_response(model, omega, amplitude=np.radians([0.02, 0.2]))
    expected = sampled(model, omega, seen.mean)
    assert np.abs(seen.response[0] / expected - 1.0).max() < 3e-3
    assert np.abs(seen.response[1] / expected - 1.0).max() < 3e-2  # grows with the amplitude: drives last


def gain_errors(model, parts, amplitude):
    """How far sines differ in gain from the transfer function, at parts of its bandwidth."""
    system = st.linear.transfer_function(model, input="command_angle")
    omega = control.bandwidth(system) * np.array(parts)
    seen = st.linear.frequency_response(model, omega, amplitude=amplitude)
    return np.abs(seen.gain[0] / np.abs(system(1j * omega)) - 1.0).max()


def follows_its_transfer_function(name):
    servo = bare(name)
    assert gain_errors(st.PulseServo(servo), [0.05, 0.1, 0.2, 0.3, 0.4], math.radians(1.0)) < 0.05
    assert gain_errors(st.BoundedServo(servo), [0.1, 0.4, 0.7, 1.0, 2.0, 5.0], math.radians(1.0)) < 1e-4


@pytest.mark.parametrize("name", ["hitec-hs-755hb", "gobilda-2000-67"])  # the paper's servo, and the fastest
def test_sines_of_one_degree_follow_the_transfer_function(name):
    follows_its_transfer_function(name)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* contradicts itself")
@pytest.mark.parametrize("name", ANALOG)
def test_sines_of_one_degree_follow_the_transfer_function_of_every_analog_servo(name):
    follows_its_transfer_function(name)


def test_a_saturated_servo_is_a_relay_before_its_motor():
    servo = bare("hitec-hs-755hb")
    model = st.BoundedServo(servo.replace({"electronics.bridge_gain": 1e4}))
    amplitude, omega = 1.3, np.array([25.0, 60.0])
    seen = st.linear.frequency_response(model, omega, amplitude=amplitude)
    motor = st.linear.transfer_function(st.GearedMotor(servo.replace({"motor.armature_inductance": 1e-9})))
    expected = 4.0 * model.voltage_limit / (math.pi * amplitude) * np.abs(motor(1j * omega))
    np.testing.assert_allclose(seen.gain[0], expected, rtol=5e-3)
    assert (seen.distortion > 0.01).all()  # a triangle has 12 %, less what the inertia takes


def test_a_servo_that_does_not_move_has_a_gain_of_zero(servo):
    seen = st.linear.frequency_response(st.BoundedServo(servo), [1.0, 5.0], amplitude=np.radians([0.3, 10.0]))
    assert (seen.response[0] == 0.0).all()
    assert (seen.gain[1] > 0.5).all()
    assert (seen.change < 1e-3).all()
    assert np.isnan(seen.bandwidth()[0])


def test_amplitudes_and_frequencies_do_not_know_of_each_other(servo):
    model = st.PulseServo(servo.replace({"potentiometer.noise": 1e-3}))
    both = st.linear.frequency_response(model, [4.0, 30.0], amplitude=[0.05, 0.2], seed=3)
    alone = [st.linear.frequency_response(model, [30.0], amplitude=size, seed=seed)
             for size, seed in ((0.05, 3), (0.2, 4), (0.05, 5))]
    assert both.response[0, 1] == alone[0].response[0, 0]
    assert both.response[1, 1] == alone[1].response[0, 0]
    assert both.response[0, 1] != alone[2].response[0, 0]


def test_the_frames_may_be_the_transmitters(servo):
    model, other = (st.PulseServo(servo.replace({"electronics.frame_period": T})) for T in (0.02, 0.005))
    fast = st.linear.frequency_response(model, [10.0, 300.0], amplitude=0.1, frame_period=0.005)
    np.testing.assert_array_equal(
        fast.response, st.linear.frequency_response(other, [10.0, 300.0], amplitude=0.1).response)


def test_a_coasting_servo_has_an_answer(servo):
    seen = st.linear.frequency_response(
        st.PulseServo(servo.replace({"electronics.off_state": "coast"})), [6.0], amplitude=0.2)
    assert 0.9 < seen.gain[0, 0] < 1.2


def response_of(values, frequency):
    gain = np.atleast_2d(values).astype(complex)
    rest = np.zeros(gain.shape)
    return FrequencyResponse(input="command_angle", output="output_angle", frequency=frequency, mean=0.0,
                             amplitude=np.arange(1.0, 1.0 + len(gain)), response=gain, distortion=rest, change=rest)


def test_bandwidth_is_where_the_gain_has_dropped():
    omega = np.geomspace(0.05, 50.0, 200)
    lag = response_of(0.5 / (1.0 + 1j * omega / 2.0), omega)
    assert lag.bandwidth()[0] == pytest.approx(2.0 * math.sqrt(10.0**0.3 - 1.0), rel=2e-3)
    assert lag.bandwidth(drop=20.0)[0] == pytest.approx(2.0 * math.sqrt(99.0), rel=2e-3)
    assert lag.bandwidth(drop=9.0, reference=1.0)[0] == pytest.approx(
        2.0 * math.sqrt(0.25 * 10.0**0.9 - 1.0), rel=2e-3)
    np.testing.assert_allclose(lag.phase[0], -np.arctan(omega / 2.0), atol=1e-12)
    first, last = omega[[0, 1]], [[1.0, 0.9], [0.0, 0.0], [1.0, np.nan], [1.0, 0.0]]
    np.testing.assert_array_equal(response_of(last, first).bandwidth(), [np.inf, np.nan, np.nan, first[1]])
    assert np.isnan(lag.bandwidth(reference=1.0)[0])  # below from the start


def test_it_goes_to_python_control(servo):
    seen = st.linear.frequency_response(st.BoundedServo(servo), [2.0, 9.0], amplitude=[0.1, 0.4])
    system = seen.system(1)
    assert (system.input_labels, system.output_labels) == (["command_angle"], ["output_angle"])
    np.testing.assert_array_equal(system(1j * seen.frequency), seen.response[1])
    assert "2 amplitudes, 2 frequencies" in repr(seen)
    with pytest.raises(ValueError, match="read-only"):
        seen.response[0, 0] = 0.0


BAD = [
    ({"frequencies": []}, InputError, "frequencies: .*at least one"),
    ({"frequencies": 3.0}, InputError, "frequencies: .*a list"),
    ({"frequencies": [1.0, math.nan]}, InputError, "frequency: got nan"),
    ({"frequencies": [0.0]}, InputError, "frequency: got 0.0"),
    ({"frequencies": [2.0, 2.0]}, InputError, "frequency 1: .*more than 2 rad/s"),
    ({"frequencies": [160.0]}, InputError, "less than 157.1 rad/s, half the frame rate"),
    ({"frequencies": [1e-7]}, InputError, "frequency: .*a run of"),
    ({"frequencies": np.ma.masked_array([1.0, 2.0], mask=[0, 1])}, InputError, "masked"),
    ({"amplitude": -0.1}, InputError, "amplitude: got -0.1"),
    ({"amplitude": [0.1, math.inf]}, InputError, "amplitude: got inf"),
    ({"amplitude": [[0.1]]}, InputError, "amplitude: .*shape"),
    ({"amplitude": "large"}, InputError, "amplitude: got 'large'"),
    ({"amplitude": 2.0}, CommandError, "the travel of hitec-hs-755hb"),
    ({"amplitude": 1.2e-3, "mean": 1.5e-3, "input": "pulse_width"}, InputError, "the travel of hitec-hs-755hb"),
    ({"amplitude": 2e-3, "mean": 1.5e-3, "input": "pulse_width"}, CommandError, "pulse width"),
    ({"mean": math.nan}, InputError, "mean: got nan"),
    ({"input": "voltage"}, UnknownNameError, "command_voltage"),
    ({"output": "angle"}, UnknownNameError, "output_angle"),
    ({"frame_period": -0.02}, InputError, "frame_period: got -0.02"),
    ({"seed": 0.5}, InputError, "seed: got 0.5"),
    ({"load": 1.0}, LoadError, "load: got 'float'"),
    ({"model": st.BoundedServo(st.load_servo("hitec-hs-755hb")), "frame_period": 0.01}, InputError, "only the pulse"),
    ({"model": st.load_servo("hitec-hs-755hb")}, InputError, "a model of a servo"),
]


@pytest.mark.parametrize(("changed", "error", "text"), BAD)
def test_bad_input_is_one_line(servo, changed, error, text):
    given = {"model": st.PulseServo(servo), "frequencies": [5.0], "amplitude": 0.1} | changed
    with pytest.raises(error, match=text) as raised:
        st.linear.frequency_response(**given)
    assert "\n" not in str(raised.value)


def test_a_pulse_that_the_chip_refuses_is_no_command(servo):
    model = st.PulseServo(servo.replace({"stops.lower_angle": -3.0, "stops.upper_angle": 6.0}))
    with pytest.raises(InputError, match=r"0.0003 to 0.0027, the pulses accepted of hitec-hs-755hb"):
        st.linear.frequency_response(model, [5.0], amplitude=1.3e-3, mean=1.5e-3, input="pulse_width")


@pytest.mark.parametrize(("number", "text"), [({"drop": 0.0}, "drop"), ({"reference": math.nan}, "reference")])
def test_a_bandwidth_needs_a_drop(number, text):
    with pytest.raises(InputError, match=text):
        response_of([1.0], np.array([1.0])).bandwidth(**number)


def test_there_is_a_system_for_each_amplitude_only():
    with pytest.raises(InputError, match="0 to 0"):
        response_of([1.0], np.array([1.0])).system(1)
