"""Describing functions: closed forms, the linear limit, and what simulated sines do."""

import math

import control
import numpy as np
import pytest

import servotwin as st
from linear.bare_servos import bare
from servotwin.errors import InputError
from servotwin.linear.linearise import harmonic

OMEGA = np.array([3.0, 12.0, 30.0])


def test_mean_and_first_harmonic():
    phases = 2.0 * math.pi * (np.arange(512) + 0.5) / 512
    found = harmonic(np.where(np.cos(phases) > 0.0, 3.0, -1.0))  # of friction: 1 + 2 sgn
    assert found.mean == pytest.approx(1.0, abs=1e-12)
    assert found.first == pytest.approx(2j * 4.0 / math.pi, abs=1e-4)


@pytest.mark.long
def test_without_friction_deadband_and_limit_it_is_the_transfer_function():
    model = st.BoundedServo(bare("hitec-hs-755hb"))
    seen = st.linear.linearise(model, st.loads.Spring(0.4, rest_angle=1.0), amplitude=1e-3)
    system = st.linear.transfer_function(model, input="command_angle", load=st.loads.Spring(0.4, rest_angle=1.0))
    np.testing.assert_allclose(seen.response(OMEGA), system(1j * OMEGA), rtol=1e-6)
    assert not seen.sticks(OMEGA).any()


def test_a_pendulum_is_softer_the_further_it_swings():
    """m g l 2 J_1(a)/a about where it hangs (Gelb & Vander Velde), sin about an angle."""
    from scipy.special import j0, j1

    model = st.AveragedServo(bare("hitec-hs-755hb").replace({"friction.zero_crossing_slope": 1.0}))
    pull = 0.3 * 0.2 * 9.80665
    for middle in (0.0, 0.7):
        load = st.loads.Pendulum(mass=0.3, length=0.2, hanging_angle=math.radians(90.0) - middle)
        seen = st.linear.linearise(model, load, amplitude=0.8, angle=math.radians(90.0))
        turn = seen._turn(6.0)
        size, away = turn.angle.first.real, turn.angle.mean - load.hanging_angle
        assert turn.restoring == pytest.approx(2.0 * pull * j1(size) * math.cos(away), rel=1e-6)
        held = pull * j0(size) * math.sin(away)
        N, R = model.value("gear.gear_reduction"), model.value("motor.armature_resistance")
        assert turn.voltage.mean == pytest.approx(R / N / model.value("motor.torque_constant") * held, abs=1e-7)


@pytest.mark.parametrize(("name", "multiples"), [("hitec-hs-645mg", (50, 80)), ("futaba-s3003", (50, 80))])
def test_simulated_sines_that_do_not_stick(name, multiples):
    model = st.PulseServo(st.load_servo(name)).averaged()
    half = 0.5 * model.value("electronics.voltage_deadband") / model.value("potentiometer.feedback_gain")
    bandwidth = control.bandwidth(st.linear.transfer_function(model, input="command_angle"))
    omega = bandwidth * np.array([0.6, 1.0])
    moved = 0
    for multiple in multiples:
        seen = st.linear.linearise(model, amplitude=multiple * half)
        free = ~seen.sticks(omega)
        truth = st.linear.frequency_response(model, omega, amplitude=[multiple * half]).response[0]
        assert np.abs(np.abs(seen.response(omega)[free]) / np.abs(truth[free]) - 1.0).max(initial=0.0) < 0.1
        moved += free.sum()
    assert moved >= 2


def test_what_friction_holds_does_not_move(servo):
    seen = st.linear.linearise(st.BoundedServo(servo), amplitude=0.01)
    assert seen.sticks(OMEGA).all()
    np.testing.assert_array_equal(seen.response(OMEGA), 0.0)
    with pytest.raises(InputError, match="move nothing"):
        seen.system(3.0)


@pytest.mark.long
def test_the_equivalent_system_answers_alike(servo):
    coil = servo.replace({"motor.armature_inductance": 1e-3, "friction.zero_crossing_slope": 1.0})
    for model in (st.BoundedServo(servo), st.AveragedServoInductive(coil)):
        seen = st.linear.linearise(model, st.loads.Pendulum(mass=0.1, length=0.1), amplitude=0.6)
        for omega in OMEGA:
            assert seen.system(omega)(1j * omega) == pytest.approx(complex(seen.response(omega)), rel=1e-4)


@pytest.mark.parametrize(("make", "text"), [
    (lambda s: st.linear.linearise(st.DCMotor(s), amplitude=0.1), "model to linearise"),
    (lambda s: st.linear.linearise(st.BoundedServo(s), amplitude=math.nan), "amplitude"),
    (lambda s: st.linear.linearise(st.BoundedServo(s), amplitude=0.1, angle=7.0), "travel"),
    (lambda s: st.linear.linearise(st.BoundedServo(s), amplitude=2.0), "travel"),
    (lambda s: st.linear.linearise(st.PulseServo(s), amplitude=0.3, angle=3.2), "travel"),
    (lambda s: st.linear.linearise(st.PulseServo(s.replace({"electronics.pulse_width_max": 1.6e-3})), amplitude=0.8),
     "the pulses accepted"),
    (lambda s: st.linear.linearise(st.BoundedServo(s), st.loads.Recorded([0.0, 1.0], [0.0, 0.1]), amplitude=0.1),
     "recorded"),
    (lambda s: st.linear.linearise(st.BoundedServo(s), amplitude=0.1).response([0.0]), "frequency")])
def test_bad_input(servo, make, text):
    with pytest.raises(InputError, match=text):
        make(servo)


def test_the_error_of_a_linear_servo_is_none():
    model = st.BoundedServo(bare("hitec-hs-755hb"))
    off = st.linear.linearise(model, amplitude=1e-2).error([3.0, 12.0])
    np.testing.assert_allclose(off.gain, 0.0, atol=1e-4)
    np.testing.assert_allclose(off.phase, 0.0, atol=1e-4)


@pytest.mark.parametrize("name", ["hitec-hs-422", "emax-es08a"])
def test_the_error_in_gain_and_phase_is_that_of_simulated_sines(name):
    """8 % and 5 deg where nothing sticks: the largest of 35 servos; where it does, more, and it is told."""
    model = st.PulseServo(st.load_servo(name)).averaged()
    omega = 2.0 * math.pi * np.array([1.0, 8.0])
    seen = st.linear.linearise(model, amplitude=math.radians(5.0))
    off, truth = seen.error(omega), st.linear.frequency_response(model, omega, amplitude=math.radians(5.0)).response[0]
    np.testing.assert_allclose((1.0 + off.gain) * np.exp(1j * off.phase) * truth, seen.response(omega), rtol=1e-9)
    free = ~seen.sticks(omega)
    assert free.tolist() == [False, True]
    assert np.abs(off.gain[free]).max() < 0.09
    assert np.degrees(np.abs(off.phase[free])).max() < 5.0
    assert math.degrees(abs(off.phase[0])) > 2.0


def test_the_error_of_what_does_not_move_is_none(servo):
    off = st.linear.linearise(st.BoundedServo(servo), amplitude=0.01).error([3.0])
    assert np.isnan(off.gain).all()
    assert np.isnan(off.phase).all()
