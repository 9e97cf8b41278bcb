"""Metrics of a step against closed forms: they come from the solution, whatever the output step and between samples."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as some

import servotwin as st
from servotwin import loads
from servotwin.errors import InputError, SimulationError
from servotwin.models import mid_travel
from servotwin.models.default import default_model
from servotwin.simulation.start import Status


@pytest.fixture(scope="module")
def linear(servo):
    """An averaged servo without dry friction: a linear system of second order from angle command to angle."""
    return servo.replace({"friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0})


def tuned(servo, omega_n, zeta):
    """Choose rotor inertia and bridge gain so that J q̈ + B q̇ + c q = c q* has these ω_n and ζ."""
    motor, N = servo.motor, servo.gear.gear_reduction
    B = N**2 * (motor.torque_constant * motor.back_emf_constant / motor.armature_resistance
                + motor.motor_viscous_friction)
    J = B / (2.0 * zeta * omega_n)
    gain = J * omega_n**2 * motor.armature_resistance / (
        N * motor.torque_constant * servo.potentiometer.feedback_gain * servo.electronics.comparator_gain)
    return servo.replace({"motor.rotor_inertia": J / N**2, "electronics.bridge_gain": gain})


def response(omega_n, zeta, t):
    """Unit step response of ω_n²/(s² + 2ζω_n s + ω_n²) from rest, from its poles."""
    poles = np.roots([1.0, 2.0 * zeta * omega_n, omega_n**2])
    a, b = poles
    return np.real(1.0 - (b * np.exp(a * t) - a * np.exp(b * t)) / (b - a))


def response_metrics(omega_n, zeta, duration):
    """Rise, settling and overshoot of that response, relative to its value at `duration`, on a dense grid."""
    t = np.linspace(0.0, duration, 2_000_001)
    y = response(omega_n, zeta, t)
    y = y / y[-1]
    rise = t[np.argmax(y >= 0.9)] - t[np.argmax(y >= 0.1)]
    settling = t[np.flatnonzero(np.abs(y - 1.0) > 0.02)[-1]]
    return rise, settling, max(0.0, y.max() - 1.0)


STEP = st.signals.step(20.0, 80.0, at=0.1, unit="deg")
WAY = math.radians(60.0)
CASES = [(20.0, 0.1), (20.0, 0.3), (20.0, 0.7), (50.0, 0.9), (20.0, 1.5), (20.0, 4.0)]


# ---------------------------------------------------------------------------------------- second order

@pytest.mark.long(but="50.0-0.9")
@pytest.mark.parametrize(("omega_n", "zeta"), CASES)
def test_a_linear_servo_of_second_order(linear, omega_n, zeta):
    duration = 0.1 + 14.0 / (omega_n * min(zeta, 1.0 / (2.0 * zeta)))
    model = st.AveragedServo(tuned(linear, omega_n, zeta))
    found = st.simulate(model, STEP, duration=duration, output_step=duration).step_metrics()
    rise, settling, overshoot = response_metrics(omega_n, zeta, duration - 0.1)
    grid = (duration - 0.1) / 2e6
    assert found.initial == pytest.approx(math.radians(20.0), abs=1e-12)
    assert found.target == pytest.approx(math.radians(80.0), abs=1e-12)
    assert found.final == pytest.approx(found.target, abs=2e-6 * WAY)
    assert found.steady_error == found.target - found.final
    assert found.rise_time == pytest.approx(rise, abs=3.0 * grid)
    assert found.settling_time == pytest.approx(settling, abs=3.0 * grid)
    assert found.overshoot == pytest.approx(overshoot, abs=1e-9)


@pytest.mark.parametrize("zeta", [0.1, 0.3, 0.5, 0.7])
def test_overshoot_and_top_speed_in_closed_form(linear, zeta):
    omega_n = 25.0
    model = st.AveragedServo(tuned(linear, omega_n, zeta))
    found = st.simulate(model, STEP, duration=0.1 + 40.0 / (zeta * omega_n), output_step=1.0).step_metrics()
    root = math.sqrt(1.0 - zeta**2)
    assert found.overshoot == pytest.approx(math.exp(-math.pi * zeta / root), rel=1e-9)
    assert found.slew_rate == pytest.approx(WAY * omega_n * math.exp(-zeta / root * math.acos(zeta)), rel=1e-9)


def test_peak_current_is_the_first_one(linear):
    """At the step the shaft stands: all the voltage is on the resistance."""
    model = st.AveragedServo(tuned(linear, 25.0, 0.5))
    found = st.simulate(model, STEP, duration=1.0, output_step=1.0).step_metrics()
    servo, e = model.servo, model.servo.electronics
    voltage = e.bridge_gain * e.comparator_gain * servo.potentiometer.feedback_gain * WAY
    assert found.peak_current == pytest.approx(voltage / servo.motor.armature_resistance, rel=1e-12)


@pytest.mark.long
@settings(max_examples=15, deadline=None)
@given(some.floats(5.0, 60.0), some.floats(0.1, 0.95), some.floats(-90.0, 90.0), some.floats(0.0, 0.5))
def test_what_scales_and_what_does_not(linear, omega_n, zeta, way, at):
    """Size, sign, place and time of the step leave rise, settling and overshoot of a linear servo alone."""
    assume(abs(way) > 1.0)
    model = st.AveragedServo(tuned(linear, omega_n, zeta))
    after = 30.0 / (omega_n * zeta)
    one = st.simulate(model, st.signals.step(90.0, 120.0, unit="deg"), duration=after, output_step=after).step_metrics()
    two = st.simulate(model, st.signals.step(90.0, 90.0 + way, at=at, unit="deg"), duration=at + after,
                      output_step=after).step_metrics()
    assert two.rise_time == pytest.approx(one.rise_time, rel=1e-9)
    assert two.settling_time == pytest.approx(one.settling_time, rel=1e-6)
    assert two.overshoot == pytest.approx(one.overshoot, rel=1e-7, abs=1e-9)
    assert two.slew_rate == pytest.approx(one.slew_rate * abs(way) / 30.0, rel=1e-7)
    assert two.final - two.initial == pytest.approx(math.radians(way), rel=1e-6)


# ---------------------------------------------------------------------------------------- first order

def test_a_motor_that_runs_up_in_closed_form(linear):
    """Angle of a motor with negligible inductance under a voltage step: V/k (t − τ(1 − e^(−t/τ))); it never settles."""
    servo = linear.replace({"motor.armature_inductance": 1e-9, "motor.motor_viscous_friction": 0.0})
    motor = servo.motor
    tau = motor.rotor_inertia * motor.armature_resistance / (motor.torque_constant * motor.back_emf_constant)
    T = 40.0 * tau
    step = st.signals.step(0.0, 3.0, unit="V")
    found = st.simulate(st.DCMotor(servo), step, duration=T, output_step=T).step_metrics()
    t = np.linspace(0.0, T, 1_000_001)
    way = t - tau * (1.0 - np.exp(-t / tau))
    way = way / way[-1]
    assert found.slew_rate == pytest.approx(3.0 / motor.back_emf_constant, rel=1e-6)
    assert found.rise_time == pytest.approx(t[np.argmax(way >= 0.9)] - t[np.argmax(way >= 0.1)], rel=1e-5)
    assert found.settling_time == pytest.approx(t[np.argmax(way >= 0.98)], rel=1e-5)
    assert found.overshoot == 0.0
    assert math.isnan(found.target)
    assert math.isnan(found.steady_error)
    assert found.peak_current == pytest.approx(3.0 / motor.armature_resistance, rel=1e-4)


# ---------------------------------------------------------------------------------------- the bounded servo

def test_slew_of_a_bounded_servo_is_its_no_load_speed(servo):
    model = st.BoundedServo(servo)
    plant = model.pack(loads.Load())
    found = st.simulate(model, st.signals.step(0.0, 170.0, unit="deg"), duration=2.0).step_metrics()
    no_load = (plant.follower.V_max - plant.motor.R * plant.friction.F_forward / plant.motor.K) / plant.motor.K_b
    assert found.slew_rate == pytest.approx(no_load, rel=1e-6)
    assert found.peak_current == pytest.approx(plant.follower.V_max / plant.motor.R, rel=1e-12)
    # It stops short, where half the deadband and what friction holds take all of the error
    per_torque = plant.motor.R / (plant.motor.K * plant.follower.gain)
    held = plant.follower.half_deadband + per_torque * plant.friction.F_forward
    assert 0.0 < found.steady_error <= held / plant.sensor.p


COMMANDS = {
    "angle": STEP, "pulse": st.signals.step(900.0, 1600.0, at=0.1, unit="us"),
    "voltage": st.signals.step(0.8, 1.5, at=0.1, unit="V"),
    "samples": st.signals.samples([0.0, 0.1], [20.0, 80.0], unit="deg"),
}


@pytest.mark.long(but="BoundedServo-samples")
@pytest.mark.parametrize(("name", "command"), [
    ("AveragedServo", "angle"), ("AveragedServoInductive", "voltage"), ("BoundedServo", "pulse"),
    ("BoundedServo", "samples")])
def test_the_output_step_changes_nothing(servo, name, command):
    model = getattr(st, name)(servo)
    coarse, fine, odd = (st.simulate(model, COMMANDS[command], duration=0.6, **times).step_metrics() for times in (
        {"output_step": 0.6}, {"output_step": 1e-3}, {"output_times": [0.0, 0.0314, 0.6]}))
    assert coarse == fine == odd


@pytest.mark.long
def test_peaks_lie_between_samples(linear):
    """The top of a sine is found although no sample is on it."""
    model = st.AveragedServo(tuned(linear, 25.0, 0.1))
    result = st.simulate(model, STEP, duration=1.0, output_times=[0.0, 1.0])
    dense = np.abs(result.at("output_angle", np.linspace(0.0, 1.0, 200_001)))
    assert result.peak("output_angle") == pytest.approx(dense.max(), rel=1e-8)
    assert result.peak("output_angle") >= dense.max()
    assert result.peak("output_angle") > 1.1 * np.abs(result["output_angle"]).max()


@pytest.mark.long(but="armature_voltage")
@pytest.mark.parametrize("signal", ["output_speed", "armature_current", "armature_voltage", "load_torque"])
def test_peaks_are_those_of_a_dense_grid(servo, signal):
    model = st.BoundedServo(servo)
    result = st.simulate(model, STEP, duration=0.6, load=loads.Inertia(2e-3), output_step=0.3)
    times = np.union1d(np.linspace(0.0, 0.6, 100_001), [event.time for event in result.events])
    dense = np.abs(result.at(signal, times)).max()
    assert result.peak(signal) >= dense * (1.0 - 1e-9)
    assert result.peak(signal) == pytest.approx(dense, rel=1e-3)


def test_a_step_that_moves_nothing_has_no_times(servo):
    """Within the deadband of the bounded servo."""
    found = st.simulate(st.BoundedServo(servo), st.signals.step(90.0, 90.01, unit="deg"), duration=0.5).step_metrics()
    assert math.isnan(found.rise_time)
    assert math.isnan(found.settling_time)
    assert math.isnan(found.overshoot)
    assert (found.slew_rate, found.peak_current) == (0.0, 0.0)
    assert found.steady_error == pytest.approx(math.radians(0.01))


# ---------------------------------------------------------------------------------------- what does not arrive

@pytest.mark.parametrize(("short", "arrives"), [(0.049, True), (0.051, False)])
def test_a_shaft_that_ends_farther_off_than_5_percent_has_no_times(linear, short, arrives):
    """A load torque leaves a linear servo short of its target by torque over stiffness, whatever the time."""
    servo = tuned(linear, 25.0, 0.7)
    model = st.AveragedServo(servo)
    e, motor, N = servo.electronics, servo.motor, servo.gear.gear_reduction
    stiffness = (N * motor.torque_constant * e.bridge_gain * e.comparator_gain * servo.potentiometer.feedback_gain
                 / motor.armature_resistance)
    found = st.simulate(model, st.signals.step(20.0, 80.0, unit="deg"), duration=2.0, output_step=2.0,
                        load=loads.Constant(short * WAY * stiffness)).step_metrics()
    assert found.steady_error == pytest.approx(short * WAY, rel=1e-6)
    for value in (found.rise_time, found.settling_time, found.overshoot):
        assert math.isnan(value) != arrives


@pytest.mark.parametrize(("servo_name", "way", "band"), [
    ("hitec-hs-755hb", 60.0, 1.0), ("hitec-hs-755hb", 1.5, 0.75), ("feetech-sts3215-12v", 20.0, 1.0),
    ("feetech-sts3215-12v", 10.0, 0.5), ("feetech-sts3215-12v", 1.0, 4.0 * 360.0 / 4096.0),
    ("feetech-sts3215-12v", 0.6, 0.3)])
def test_near_is_a_degree_or_a_part_of_a_small_step(servo_name, way, band):
    """5 % of it, or two deadbands (of 1 count either way; 8 us, 0.8 deg), but at most half of it."""
    model = default_model(st.load_servo(servo_name))
    start = math.degrees(mid_travel(model))
    found = st.simulate(model, st.signals.step(start, start + way, at=0.1, unit="deg"), duration=0.5).step_metrics()
    assert math.degrees(found.arrival_band) == pytest.approx(band, rel=1e-6)


def test_a_small_step_that_moves_nothing_does_not_arrive(servo):
    """It used to be within 1 deg from the beginning."""
    found = st.simulate(st.BoundedServo(servo), st.signals.step(90.0, 90.01, unit="deg"), duration=0.5).step_metrics()
    assert math.isnan(found.arrival_time)


@pytest.mark.long
def test_lanes_and_runs_arrive_alike():
    """A deadband that differs from lane to lane decides for each; the third lane's is wider than the step."""
    model, command = st.PulseServo(st.load_servo("hitec-hs-755hb")), st.signals.step(0.0, 3.0, at=0.1, unit="deg")
    widths = np.array([4e-6, 8e-6, 60e-6])
    study = st.sweep(model, command, duration=1.5, draws={"electronics.deadband": widths}, metrics=[
        "rise_time", "settling_time", "overshoot", "steady_error", "rest_swing"])
    for k, width in enumerate(widths.tolist()):
        own = st.PulseServo(model.servo.replace({"electronics.deadband": width}))
        metrics = st.simulate(own, command, duration=1.5).step_metrics()
        for name in ("rise_time", "settling_time", "overshoot"):
            assert study.table[name][k] == pytest.approx(getattr(metrics, name), abs=2e-3, nan_ok=True)
    assert np.isnan(study.table["rise_time"]).tolist() == [False, False, True]
    assert study.table["rest_swing"].tolist() == [0.0, 0.0, 0.0]


# ---------------------------------------------------------------------------------------- what is refused

@pytest.mark.parametrize("command", [
    st.signals.constant(90.0, unit="deg"), st.signals.ramp(20.0, 80.0, over=0.1, unit="deg"),
    st.signals.sine(mean=90.0, amplitude=10.0, frequency=1.0, unit="deg"),
    st.signals.samples([0.0, 0.1, 0.2], [20.0, 30.0, 40.0], unit="deg"),
    st.signals.step(20.0, 80.0, at=-0.1, unit="deg"), st.signals.step(20.0, 80.0, at=0.3, unit="deg"),
    st.signals.step(20.0, 80.0, at=5.0, unit="deg"),
    st.signals.samples([0.0, 0.1], [20.0, 30.0], unit="deg", hold="linear"),
])
@pytest.mark.filterwarnings("ignore:the first change of the command")
def test_what_is_no_step_within_the_run_is_refused(servo, command):
    result = st.simulate(st.BoundedServo(servo), command, duration=0.3)
    with pytest.raises(InputError, match=r"step metrics: got .*, allowed: ") as caught:
        result.step_metrics()
    assert str(caught.value).isprintable()


def test_a_run_that_failed_has_no_metrics(servo):
    import dataclasses

    result = st.simulate(st.BoundedServo(servo), STEP, duration=0.3)
    failed = dataclasses.replace(result, status=Status.DIVERGED, ended=0.2, cause="told so")
    with pytest.raises(SimulationError, match=r"ended at t = 0\.2 s: told so"):
        failed.step_metrics()
