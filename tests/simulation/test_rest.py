"""Whether a shaft comes to rest, and how its bridge drives there: closed forms, then servos that swing, creep, hunt."""

import math
import pickle

import numpy as np
import pytest

import servotwin as st
from servotwin.simulation.remarks import BUZZES, NOT_AT_REST, Remark
from servotwin.simulation.rest import AT_REST, constant_since, swing_of

T = np.linspace(0.0, 4.0, 4001)
LEROBOT = {"D_Coefficient": 32, "Maximum_Acceleration": 254, "Acceleration": 254}


def sine(size, frequency):
    return math.radians(size) * np.sin(2.0 * np.pi * frequency * T)


def steps(size, period):
    """From tooth to tooth, with a wait at each."""
    return math.radians(size) * (np.floor(2.0 * T / period) % 2.0)


ARRIVES = math.radians(20.0) * (1.0 - np.exp(-T / 0.05))


@pytest.mark.parametrize(("angle", "swing", "frequency"), [
    (sine(0.5, 2.0), 1.0, 2.0), (sine(0.06, 7.0), 0.12, 7.0), (ARRIVES + sine(0.3, 1.2), 0.6, 1.2),
    (steps(0.66, 0.9), 0.66, 1.0 / 0.9), (np.exp(-0.02 * T) * sine(0.5, 5.0), None, 5.0)])
def test_a_shaft_that_goes_to_and_fro_swings(angle, swing, frequency):
    found = swing_of(T, angle)
    assert found.frequency == pytest.approx(frequency, rel=0.02)
    if swing is not None:
        assert math.degrees(found.swing) == pytest.approx(swing, rel=1e-3)


@pytest.mark.parametrize("angle", [
    np.zeros_like(T), ARRIVES, sine(0.04, 3.0), math.radians(10.0) * T,
    ARRIVES * (1.0 + np.exp(-3.0 * T) * sine(9.0, 3.0)),
    np.exp(-2.0 * T) * sine(20.0, 4.0), np.where(T < 1.8, sine(3.0, 5.0), 0.0),
    math.radians(20.0) * np.clip(T - 3.5, 0.0, 1.0), sine(3.0, 0.3)],
    ids=["stands", "arrives", "too little", "goes on", "overshoots", "decays", "has stopped", "late", "hardly begun"])
def test_a_shaft_that_stands_arrives_or_decays_does_not(angle):
    assert swing_of(T, angle) == (0.0, 0.0)


def test_since_when_a_command_stands_still():
    since = lambda signal: constant_since(signal.pieces.table, 2.0)  # noqa: E731
    train = st.signals.pulse_train([0.0, 0.5, 1.0, 1.5], [1500.0, 1600.0, 1600.0, 1600.0])
    assert since(st.signals.constant(10.0, unit="deg")) == 0.0
    assert since(st.signals.step(0.0, 10.0, at=0.4, unit="deg")) == 0.4
    assert since(st.signals.ramp(0.0, 10.0, at=0.1, over=0.5, unit="deg")) == pytest.approx(0.6)
    assert since(train) == 0.5
    assert since(st.signals.sine(mean=0.0, amplitude=1.0, frequency=1.0, unit="deg")) == math.inf
    assert since(st.signals.step(0.0, 10.0, at=3.0, unit="deg")) == 0.0


def lerobot(P, **changes):
    servo = st.feetech_sts({"P_Coefficient": P, **LEROBOT}, servo="feetech-sts3215-7v4")
    return st.DigitalServo(servo.replace({"friction.bearing_coulomb_torque": 0.0, **changes}))


@pytest.mark.long(but="16-20.0-0.0")
@pytest.mark.parametrize(("P", "way", "swing"), [(16, -3.0, 0.66), (16, 1.0, 0.66), (32, 20.0, 0.71), (16, 20.0, 0.0)])
def test_a_free_output_shaft_without_friction_floats_from_tooth_to_tooth(P, way, swing):
    """shared/cases/digital-servo-never-rests: swings as measured there; at P 16 not after 20 deg."""
    result = st.simulate(lerobot(P), st.signals.step(way, 0.0, at=0.1, unit="deg"), duration=3.5)
    q = result.at("output_angle", np.linspace(1.5, 3.5, 2001))
    assert math.degrees(result.rest.swing) == pytest.approx(swing, abs=0.02)
    if swing:
        assert np.ptp(q) == pytest.approx(result.rest.swing, rel=0.02)
        (remark,) = result.remarks
        assert remark == (NOT_AT_REST, 3.5)
        assert remark.words.startswith(f"does not come to rest: swings {swing:.2f} deg at ")
    else:
        assert result.remarks == ()


@pytest.mark.long
def test_a_shaft_that_swings_has_no_settling_time():
    command = st.signals.step(-3.0, 0.0, at=0.1, unit="deg")
    swings, rests = (st.simulate(lerobot(32, **changes), command, duration=2.5).step_metrics() for changes in (
        {}, {"gear.backlash": 1e-4}))
    assert math.isnan(swings.settling_time)
    assert 0.0 < rests.settling_time < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("play", [0.5, 1.0])
@pytest.mark.parametrize("inertia", [0.0, 2e-3])
@pytest.mark.parametrize("P", [16, 32])
def test_a_bus_servo_with_play_comes_to_rest_after_every_step(P, inertia, play):
    """shared/cases/digital-servo-never-rests: swing of the last 2 s at most 0.1 deg, both ways, small and large."""
    servo = st.feetech_sts({"P_Coefficient": P, **LEROBOT}, servo="feetech-sts3215-7v4")
    model = st.DigitalServo(servo.replace({"gear.backlash": math.radians(play)}))
    for way in (1.0, -1.0, 3.0, -3.0, 20.0, -20.0):
        result = st.simulate(model, st.signals.step(way, 0.0, at=0.1, unit="deg"), duration=5.0,
                             load=st.loads.Inertia(inertia))
        assert np.ptp(result.at("output_angle", np.linspace(3.0, 5.0, 2001))) <= math.radians(0.1)
        assert result.rest.stands


def test_an_analog_servo_that_hunts():
    """Coasting, stiff and without friction it overshoots its deadband for ever: physics.md, 3."""
    servo = st.load_servo("hitec-hs-755hb").replace({
        "electronics.off_state": "coast", "electronics.stretcher_gain": 200.0, "electronics.minimum_drive_time": 2e-3,
        "friction.coulomb_torque_forward": 0.0, "friction.coulomb_torque_backward": 0.0})
    result = st.simulate(st.PulseServo(servo), st.signals.step(0.0, 5.0, at=0.1, unit="deg"), duration=3.0)
    q = result.at("output_angle", np.linspace(2.0, 3.0, 2001))
    assert np.ptp(q) > 2.0 * AT_REST
    assert result.rest.swing == pytest.approx(np.ptp(q), rel=0.2)
    assert NOT_AT_REST in dict(result.remarks)


def test_what_pulses_move_within_a_frame_is_rest_and_they_are_counted():
    """A braked servo that friction does not hold is lifted once a frame, and sinks: it stands in between."""
    servo = st.load_servo("hitec-hs-755hb")
    result = st.simulate(st.PulseServo(servo), st.signals.constant(0.0, unit="deg"), duration=4.0,
                         load=st.loads.Constant(0.6))
    rest = result.rest
    assert rest.stands
    assert not rest.moves_on
    assert rest.drive_rate == pytest.approx(50.0, abs=2.0)
    driven = result.at("drive", np.linspace(3.5, 4.0, 100_001))
    assert rest.duty == pytest.approx(np.abs(driven).mean(), rel=1e-3)
    assert rest.current == pytest.approx(result.mean("supply_current", 3.5), rel=1e-12)
    assert result.remarks == ()  # the load asks for it


def test_noise_beyond_the_deadband_makes_a_shaft_buzz_that_friction_holds():
    """2 mV at 0.7 V/ms are 2.7 us, and half of the deadband 4 us: one frame in seven drives (two-sided 0.14)."""
    servo = st.load_servo("hitec-hs-755hb").replace({"potentiometer.noise": 2e-3})
    slope = servo.electronics.one_shot_slope
    result = st.simulate(st.PulseServo(servo), st.signals.constant(60.0, unit="deg"), duration=20.0)
    share = math.erfc(0.5 * servo.electronics.deadband / (2e-3 * slope) / math.sqrt(2.0))
    driven = sum(event.kind in ("drive forward", "drive backward") for event in result.events)
    assert driven == pytest.approx(1000.0 * share, rel=0.25)  # 3 sigma of 1000 draws
    assert result.rest.buzzes
    (remark,) = result.remarks
    assert remark.kind == BUZZES


@pytest.mark.parametrize(("command", "load", "duration"), [
    (st.signals.sine(mean=60.0, amplitude=10.0, frequency=1.0, unit="deg"), None, 2.0),
    (st.signals.step(0.0, 20.0, at=0.1, unit="deg"), st.loads.Recorded([0.0, 2.0], [0.0, 0.2]), 2.0),
    (st.signals.step(0.0, 20.0, at=0.1, unit="deg"), None, 0.5)], ids=["sine", "load that changes", "too short"])
def test_nothing_is_said_where_command_or_load_change(command, load, duration):
    result = st.simulate(st.PulseServo(st.load_servo("hitec-hs-755hb")), command, load=load, duration=duration)
    assert result.rest is None
    assert NOT_AT_REST not in dict(result.remarks)


def test_a_mean_voltage_has_no_pulses_and_a_motor_no_rest():
    servo = st.load_servo("hitec-hs-755hb")
    mean = st.simulate(st.BoundedServo(servo), st.signals.step(0.0, 20.0, at=0.1, unit="deg"), duration=2.0).rest
    assert math.isnan(mean.drive_rate)
    assert mean.stands
    assert st.simulate(st.GearedMotor(servo), st.signals.constant(1.0, unit="V"), duration=1.0).rest is None


def test_a_remark_is_a_pair_that_carries_numbers():
    remark = Remark(NOT_AT_REST, 5.0, swing=0.01, frequency=2.0)
    assert dict([remark]) == {NOT_AT_REST: 5.0}
    again = pickle.loads(pickle.dumps(remark))
    assert (again, again.numbers) == (remark, remark.numbers)
    assert Remark(**remark.facts).words == remark.words
