"""A servo that turns without end: its potentiometer stands, and its pulses set a speed."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, InputError, ParameterError, UnknownNameError
from servotwin.models.terms.firmware import pack

from .digital_servos import COUNT, PLANT, digital

NEUTRAL = 1.5  # rad, where the potentiometer stands


@pytest.fixture(scope="module")
def wheel(servo):
    return servo.continuous(NEUTRAL)


def neutral_pulse(servo):
    """Return the width [s] whose one-shot is that of the standing potentiometer."""
    of, sensor = servo.electronics, servo.potentiometer
    return of.one_shot_offset + (sensor.feedback_gain * sensor.fixed_angle + sensor.feedback_offset) * of.one_shot_slope


def speed(model, width, load=None, duration=1.0):
    """Return the mean speed [rad/s] in the second half of a run under a constant pulse [s]."""
    result = st.simulate(model, st.signals.constant(1e6 * width, unit="us"), duration=duration, load=load,
                         output_times=[0.5 * duration, duration], initial={"output_angle": 0.0})
    before, after = result["output_angle"]
    return (after - before) / (0.5 * duration)


def plant(servo):
    """Return resistance, torque per ampere, inertia, friction at the output and the driving voltage (SI)."""
    N = servo.gear.gear_reduction
    return (servo.motor.armature_resistance, N * servo.motor.torque_constant, N**2 * servo.motor.rotor_inertia,
            N * servo.friction.coulomb_torque_forward,
            servo.supply.open_circuit_voltage - servo.supply.bridge_drop_voltage)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_at_full_drive_it_turns_as_fast_as_the_free_motor(wheel, way):
    R, K, _, friction, V = plant(wheel)
    assert speed(st.PulseServo(wheel), neutral_pulse(wheel) + way * 5e-4) == pytest.approx(
        way * (V - R * friction / K) / K, rel=1e-9)


@pytest.mark.parametrize("error", [-12e-6, 8e-6, 16e-6])
def test_near_the_neutral_each_frame_is_one_burst_from_rest(wheel, error):
    # driven for t_on = K (|e| - w/2) towards w_free, then braked towards -w_brake, until it stands
    R, K, J, friction, V = plant(wheel)
    tau, w_free, w_brake = R * J / K**2, (V - R * friction / K) / K, R * friction / K**2
    t_on = wheel.electronics.stretcher_gain * (abs(error) - 0.5 * wheel.electronics.deadband)
    w = w_free * -math.expm1(-t_on / tau)
    stops = tau * math.log1p(w / w_brake)
    assert t_on + stops < 0.02
    angle = w_free * t_on - tau * w + tau * w - w_brake * stops
    assert speed(st.PulseServo(wheel), neutral_pulse(wheel) + error) == pytest.approx(
        math.copysign(angle / 0.02, error), rel=1e-9)


@pytest.mark.parametrize("error", [-3.9e-6, 0.0, 3.9e-6])
def test_within_the_deadband_it_stands(wheel, error):
    assert speed(st.PulseServo(wheel), neutral_pulse(wheel) + error) == 0.0


def test_a_standing_neutral_off_centre_makes_the_two_ways_unequal(servo):
    centred, off = (st.PulseServo(servo.continuous(angle)) for angle in (NEUTRAL, NEUTRAL + 0.02))
    middle = neutral_pulse(centred.servo)
    for model, equal in ((centred, True), (off, False)):
        forward, backward = speed(model, middle + 4e-5), -speed(model, middle - 4e-5)
        assert bool(abs(forward - backward) < 1e-6 * forward) is equal
    moved = neutral_pulse(off.servo) - middle
    assert moved == pytest.approx(0.02 * servo.potentiometer.feedback_gain * servo.electronics.one_shot_slope)
    assert speed(off, middle + moved + 4e-5) == pytest.approx(speed(centred, middle + 4e-5), rel=1e-9)


def test_the_whole_feedback_stands(servo):
    worn = {"potentiometer.backlash": 0.02, "potentiometer.linearity_angle": [0.0, 1.0, 2.0],
            "potentiometer.linearity_error": [0.0, 0.01, -0.02], "potentiometer.quantisation": 1e-3}
    wheel = servo.continuous(NEUTRAL).replace(worn)
    pot = servo.potentiometer
    v_o = round((pot.feedback_gain * NEUTRAL + pot.feedback_offset - 0.005) / 1e-3) * 1e-3
    result = st.simulate(st.PulseServo(wheel), st.signals.constant(1700.0, unit="us"), duration=0.5)
    assert result["output_angle"][-1] > 1.0
    np.testing.assert_allclose(result["feedback_voltage"], v_o, rtol=0.0, atol=1e-12)
    error = 1700e-6 - (servo.electronics.one_shot_offset + v_o * servo.electronics.one_shot_slope)
    np.testing.assert_allclose(result["error_time"][-1], error, rtol=0.0, atol=1e-15)


def test_noise_of_the_standing_feedback_still_dithers(wheel):
    noisy = st.PulseServo(wheel.replace({"potentiometer.noise": 5e-3}))
    result = st.simulate(noisy, st.signals.constant(1e6 * neutral_pulse(wheel), unit="us"), duration=2.0, seed=3)
    assert {-1.0, 1.0} <= set(result["drive"])
    assert len(np.unique(result["error_time"])) > 50


def test_it_starts_anywhere_and_that_changes_nothing_but_the_angle(wheel):
    command = st.signals.step(1500.0, 1540.0, at=0.1, unit="us")
    near, far = (st.simulate(st.PulseServo(wheel), command, duration=0.5, initial=initial)
                 for initial in ({}, {"output_angle": 4096.0}))
    assert near["output_angle"][0] == 0.0
    np.testing.assert_allclose(far["output_angle"] - 4096.0, near["output_angle"], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(far["output_speed"], near["output_speed"], rtol=0.0, atol=1e-11)


def test_it_turns_through_hundreds_of_revolutions_as_evenly_as_at_first(wheel):
    # 1000 s in lanes, of which the first seconds are those of the servo alone
    model, command = st.PulseServo(wheel), st.signals.constant(1560.0, unit="us")
    times = [0.0, 10.0, 20.0, 980.0, 990.0, 1000.0]
    batch = st.simulate_many(model, command, duration=1000.0, output_times=times, outputs=("output_angle",))
    q = batch["output_angle"][0]
    np.testing.assert_allclose(q[1], st.simulate(model, command, duration=10.0)["output_angle"][-1], rtol=1e-9)
    assert q[-1] > 100.0 * math.tau
    np.testing.assert_allclose([q[4] - q[3], q[5] - q[4]], q[2] - q[1], rtol=1e-9)
    assert batch.remarks == ()


@pytest.mark.long(but="PulseServo-command0")
@pytest.mark.parametrize("command", [st.signals.constant(10.0, unit="deg"), st.signals.constant(1.2, unit="V")])
@pytest.mark.parametrize("kind", [st.PulseServo, st.PulseServoInductive, st.DigitalServo])
def test_commands_are_pulses_only(wheel, kind, command):
    more = {"firmware.control_period": 1e-3, "firmware.proportional_gain": 6.0}
    with pytest.raises(CommandError, match=r"^[^\n]*pulse commands only[^\n]*$"):
        st.simulate(kind(wheel.replace(more)), command, duration=0.1)
    sims = st.VectorSimulator(kind(wheel.replace(more)), lanes=2)
    with pytest.raises(CommandError, match="pulse commands only"):
        sims.reset(**{"angle": {"command_angle": 0.5}, "voltage": {"command_voltage": 0.5}}[command.kind])


def test_signals_are_those_that_there_are(wheel):
    names = st.PulseServo(wheel).available
    assert "feedback_voltage" in names
    assert not {"command_angle", "command_voltage"} & set(names)


@pytest.mark.parametrize("name", ["lower_angle", "upper_angle", "restitution"])
def test_stops_and_a_standing_potentiometer_exclude_each_other(wheel, servo, name):
    text = rf"potentiometer\.fixed_angle.*got 'stops\.{name}"
    with pytest.raises(ParameterError, match=text):
        wheel.replace({f"stops.{name}": 0.5})
    bare = servo.replace({f"stops.{other}": None for other in {"lower_angle", "upper_angle", "restitution"} - {name}})
    with pytest.raises(ParameterError, match=text):
        bare.replace({"potentiometer.fixed_angle": 1.0})
    with pytest.raises(ParameterError, match=text):
        st.simulate_many(st.PulseServo(wheel), st.signals.constant(1500.0, unit="us"), duration=0.1,
                         parameters={f"stops.{name}": [0.5, 0.6]})


def test_models_of_the_mean_ignore_it_and_say_so(servo):
    model = st.BoundedServo(servo.continuous(NEUTRAL))
    assert "potentiometer.fixed_angle" in model.ignored
    assert "potentiometer.fixed_angle" not in st.PulseServo(servo.continuous(NEUTRAL)).ignored
    with pytest.raises(InputError, match="potentiometer turns with its shaft"):
        st.PulseServo(servo.continuous(NEUTRAL)).averaged()


def test_its_transfer_function_is_an_integrator_behind_a_lag(wheel):
    model = st.PulseServo(wheel)
    R, K, J, _, V = plant(wheel)
    gain = V * wheel.electronics.stretcher_gain / 0.02 / K  # rad/s per s of pulse
    tau = R * J / K**2
    s = 3.0j
    assert complex(st.linear.transfer_function(model, output="output_speed")(s)) == pytest.approx(
        gain / (tau * s + 1.0), rel=1e-9)
    assert complex(st.linear.transfer_function(model)(s)) == pytest.approx(gain / (tau * s + 1.0) / s, rel=1e-9)
    with pytest.raises(UnknownNameError, match="command_angle"):
        st.linear.transfer_function(model, input="command_angle")
    with pytest.raises(InputError, match="frequency response of hitec-hs-755hb"):
        st.linear.frequency_response(model, [3.0], amplitude=0.1)


@pytest.mark.long
def test_curves_show_the_drive_and_nothing_of_holding(wheel, servo):
    sheet = st.curves(st.PulseServo(wheel)).voltages[0]
    assert sheet.cold.no_load_speed == pytest.approx(
        st.curves(st.PulseServo(servo), bandwidth=False).voltages[0].cold.no_load_speed)
    assert (sheet.holding, sheet.bandwidth) == ((), ())
    assert math.isnan(sheet.smallest_move)
    with pytest.raises(InputError, match="lift by hitec-hs-755hb"):
        st.curves(st.PulseServo(wheel), lift=(0.1, 0.1))


# --- digital servos -----------------------------------------------------------------------------------------------

PWM = {"proportional_gain": 1.0, "control_period": 1e-3}


def on_bus(firmware, fixed_angle, *, gain=None, **groups):
    """Return a servo on a bus whose feedback stands: an encoder, or a potentiometer with a gain [V/rad]."""
    sensor = {"fixed_angle": fixed_angle} | ({} if gain is None else {"feedback_gain": gain, "feedback_offset": 0.3})
    return digital({**PWM, **firmware}, potentiometer=sensor, **groups)


@pytest.mark.parametrize("gain", [None, 0.5])
@pytest.mark.parametrize("duty", [-0.6, 0.25])
def test_with_unit_gain_a_goal_is_a_duty(gain, duty):
    model = on_bus({}, 0.0, gain=gain)
    result = st.simulate(model, st.signals.constant(duty, unit="rad"), duration=2.0)
    N, motor = PLANT["gear"]["gear_reduction"], PLANT["motor"]
    K, friction = N * motor["torque_constant"], N * PLANT["friction"]["coulomb_torque_forward"]
    free = (abs(duty) * 12.0 - motor["armature_resistance"] * friction / K) / K
    assert result["output_angle"][0] == 0.0
    assert result["duty"][-1] == duty
    assert result["command_angle"][-1] == duty
    assert result["output_speed"][-1] == pytest.approx(math.copysign(free, duty), rel=1e-9)
    assert result.remarks == ()


@pytest.mark.parametrize("gain", [None, 0.5])
def test_the_angle_that_a_program_measures_stands(gain):
    # y is the angle in whole counts, whatever the shaft does: u = k_p (g - y)
    model = on_bus({"proportional_gain": 2.0, "angle_quantum": COUNT}, 100.2 * COUNT, gain=gain)
    result = st.simulate(model, st.signals.constant(160 * COUNT, unit="rad"), duration=0.5)
    np.testing.assert_allclose(result["duty"][-1], 2.0 * 60 * COUNT, rtol=1e-9)
    assert result["output_angle"][-1] > 0.1


def test_a_digital_servo_that_hears_pulses_takes_their_goal_against_its_standing_angle(servo):
    wheel = servo.continuous(NEUTRAL).replace({"firmware.control_period": 1e-3, "firmware.proportional_gain": 2.0})
    p, slope = servo.potentiometer.feedback_gain, servo.electronics.one_shot_slope
    half = 0.5 * servo.electronics.deadband
    for error in (-1e-4, 1e-4):
        command = st.signals.constant(1e6 * (neutral_pulse(wheel) + error), unit="us")
        result = st.simulate(st.DigitalServo(wheel), command, duration=0.5)
        assert result["duty"][-1] == pytest.approx(math.copysign(2.0 * (abs(error) - half) / (p * slope), error),
                                                   rel=1e-9)


def test_noise_is_that_of_a_potentiometer_not_of_an_encoder():
    for gain, still in ((0.5, False), (None, True)):
        sensor = {"fixed_angle": 0.2, "noise": 1e-2} | ({} if gain is None else {"feedback_gain": gain})
        result = st.simulate(digital(PWM, potentiometer=sensor), st.signals.constant(0.5, unit="rad"), duration=0.1)
        assert bool(np.ptp(result["duty"][20:]) < 1e-12) is still


def test_the_packed_program_of_an_encoder_on_its_shaft_is_as_before():
    encoder = pack(digital(PWM).given, 0.02)
    assert (encoder.per_volt, encoder.b_o) == (0.0, 0.0)


# --- every way in which it runs -----------------------------------------------------------------------------------

WAYS = {
    "plain": ({}, None),
    "worn, with noise": ({"potentiometer.noise": 2e-3, "potentiometer.backlash": 0.02,
                          "potentiometer.linearity_angle": [0.0, 2.0], "potentiometer.linearity_error": [0.0, 0.02],
                          "potentiometer.quantisation": 2e-3}, st.loads.Inertia(1e-3)),
    "pendulum": ({}, st.loads.Pendulum(mass=0.1, length=0.1)),
    "play": ({"gear.backlash": 0.02, "gear.output_inertia": 1e-3}, st.loads.Viscous(1e-3)),
}
TIMES = np.linspace(0.0, 0.6, 25)
WHEELS = [NEUTRAL - 0.05, NEUTRAL, NEUTRAL + 0.05]


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.slow) if name == "play" else name for name in WAYS])
def test_lanes_are_the_servo_alone(servo, name):
    changes, load = WAYS[name]
    wheel = servo.continuous(NEUTRAL).replace(changes)
    command = st.signals.step(1480.0, 1600.0, at=0.3, unit="us")
    asked = {"duration": 0.6, "load": load, "output_times": TIMES}
    lanes = st.simulate_many(st.PulseServo(wheel), command, outputs=("output_angle", "feedback_voltage", "error_time"),
                             parameters={"potentiometer.fixed_angle": WHEELS}, seeds=[5, 6, 7], **asked)
    for k, angle in enumerate(WHEELS):
        own = st.PulseServo(wheel.replace({"potentiometer.fixed_angle": angle}))
        one = st.simulate(own, command, seed=5 + k, **asked)
        for signal in ("output_angle", "feedback_voltage", "error_time"):
            np.testing.assert_allclose(lanes[signal][k], one[signal], rtol=1e-8, atol=1e-9, err_msg=signal)
    assert lanes.remarks == ()


@pytest.mark.parametrize("name", ["plain", "worn, with noise"])
def test_a_vector_simulator_turns_on_as_a_simulator_does(servo, name):
    changes, load = WAYS[name]
    model = st.PulseServo(servo.continuous(NEUTRAL).replace(changes))
    sims, again = (st.VectorSimulator(model, lanes=3, load=load, seed=11) for _ in range(2))
    ones = [st.Simulator(model, load, seed=11 + lane) for lane in range(3)]
    widths = np.array([1300e-6, 1492e-6, 1700e-6])
    states = [one.initial(st.signals.constant(1e6 * width, unit="us")) for one, width in zip(ones, widths, strict=True)]
    entry = again.c_entry()
    for some in (sims, again):
        some.reset(pulse_width=widths)
    np.testing.assert_array_equal(sims["output_angle"], 0.0)
    for duration in (0.013, 0.2, 1e-3, 0.1):
        sims.advance(duration, pulse_width=widths)
        seen = np.empty(3)
        entry.advance(entry.tick(duration, pulse_width=widths, output_angle=seen))
        states = [one.advance(state, state.time + duration, st.signals.constant(1e6 * width, unit="us"))
                  for one, state, width in zip(ones, states, widths, strict=True)]
        np.testing.assert_allclose(sims["output_angle"], [state["output_angle"] for state in states], rtol=0.0,
                                   atol=1e-9)
        np.testing.assert_array_equal(seen, sims["output_angle"])
        widths = np.roll(widths, 1)


@pytest.mark.long
@pytest.mark.parametrize(("gain", "noise", "load"), [
    (None, 0.0, None), (0.5, 0.0, None), (0.5, 1e-3, None),
    pytest.param(0.5, 1e-3, st.loads.Pendulum(mass=0.1, length=0.1), marks=pytest.mark.slow)])
def test_digital_lanes_are_the_servo_alone(gain, noise, load):
    more = {"potentiometer": {"fixed_angle": 0.1, "noise": noise} | ({} if gain is None else {
        "feedback_gain": gain, "feedback_offset": 0.3})}
    model, command = digital(PWM, **more), st.signals.step(0.5, -0.2, at=0.1, unit="rad")
    asked = {"duration": 0.3, "output_times": np.linspace(0.0, 0.3, 31), "load": load}
    lanes = st.simulate_many(model, command, outputs=("output_angle", "duty"), seeds=[0, 1],
                             parameters={"potentiometer.fixed_angle": [0.1, 0.2]}, **asked)
    for k, angle in enumerate((0.1, 0.2)):
        one = st.simulate(st.DigitalServo(model.servo.replace({"potentiometer.fixed_angle": angle})), command, seed=k,
                          **asked)
        for signal in ("output_angle", "duty"):
            np.testing.assert_allclose(lanes[signal][k], one[signal], rtol=1e-8, atol=1e-9, err_msg=signal)


def test_a_study_of_it_has_metrics_that_need_no_angle_command(wheel):
    command, asked = st.signals.step(1500.0, 1600.0, at=0.1, unit="us"), {
        "duration": 0.3, "lanes": 8, "vary": {"potentiometer.fixed_angle": "normal:2%"}}
    study = st.sweep(st.PulseServo(wheel), command, **asked)
    assert study.metrics == ("slew_rate", "peak_current", "end_output_speed", "end_output_angle")
    with pytest.raises(UnknownNameError, match="rms_error"):
        st.sweep(st.PulseServo(wheel), command, metrics=["rms_error"], **asked)


def test_the_angle_where_it_stands_may_change_between_calls(wheel):
    sims = st.VectorSimulator(st.PulseServo(wheel), lanes=3)
    sims.reset(pulse_width=neutral_pulse(wheel))
    sims.set(parameters={"potentiometer.fixed_angle": [NEUTRAL - 0.05, NEUTRAL, NEUTRAL + 0.05]})
    sims.advance(0.5)
    assert sims["output_angle"][0] > 0.1 > sims["output_angle"][1] == 0.0 > -0.1 > sims["output_angle"][2]
