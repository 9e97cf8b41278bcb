"""Poles before running, and gains by rule: closed forms, margins, and stability on all of the catalog."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin import control
from servotwin.control import tuning
from servotwin.errors import InputError

LOAD = st.loads.Inertia(3e-3)


@pytest.fixture(scope="module")
def inverse(servo):
    return control.inverse_of(control.bare_bridge(servo), LOAD)


def poles_in_time(controller, inverse, lag=0.0):
    """The poles as they would be in continuous time [1/s]."""
    z = control.closed_loop_poles(controller, inverse, lag=lag)
    return np.log(z[np.abs(z) > 1e-9]) / controller.period


@pytest.mark.parametrize("damping_ratio", [0.5, 1.0])
def test_pid_gains_put_the_poles_where_they_say(inverse, damping_ratio):
    w, T = 20.0, 1e-5
    gains = tuning.pid_gains(inverse, w, damping_ratio)
    pid = control.Pid(period=T, filter_rate=2e4, **gains._asdict())
    slow = sorted(poles_in_time(pid, inverse), key=abs)[:3]
    beside = 1j * math.sqrt(max(1.0 - damping_ratio**2, 0.0))
    want = [-w, w * (-damping_ratio + beside), w * (-damping_ratio - beside)]
    assert np.prod(slow) == pytest.approx(np.prod(want), rel=0.02)
    assert np.sum(slow) == pytest.approx(np.sum(want), rel=0.02)


def test_without_a_controller_the_poles_are_those_of_the_motor(inverse):
    nothing = control.Pid(period=1e-3, filter_rate=700.0)
    found = sorted(poles_in_time(nothing, inverse).real)
    decay = -inverse.damping / inverse.total_inertia
    assert found == pytest.approx(sorted([0.0, 0.0, -700.0, -700.0, decay]), abs=1e-2)


def test_a_loop_of_its_own_is_a_servo(servo):
    inverse = control.inverse_of(st.BoundedServo(servo), LOAD)
    plant = st.linear.transfer_function(st.BoundedServo(servo), input="command_angle", load=LOAD).poles()
    found = poles_in_time(control.PlainCommand(period=1e-3), inverse)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(plant), rel=1e-6)


def test_a_loop_becomes_unstable_at_the_lag_that_uses_up_its_phase_margin(inverse):
    k, T = 8.0, 1e-3
    m, c = inverse.volts_per_torque * inverse.total_inertia, inverse.volts_per_torque * inverse.damping
    w = math.sqrt((-c**2 + math.sqrt(c**4 + 4.0 * m**2 * k**2)) / (2.0 * m**2))
    most = (math.pi / 2.0 - math.atan(m * w / c)) / w - 0.5 * T  # holding takes half a tick
    pid = control.Pid(period=T, proportional_gain=k, integral_gain=1e-3, filter_rate=1e3)
    assert max(abs(control.closed_loop_poles(pid, inverse, lag=most - 1e-3))) < 1.0
    assert max(abs(control.closed_loop_poles(pid, inverse, lag=most + 1e-3))) > 1.0


def test_a_lag_grows_without_a_jump_from_one_tick_to_the_next(inverse):
    pid = control.Pid(period=1e-3, proportional_gain=8.0, filter_rate=1e3)
    radius = [abs(control.closed_loop_poles(pid, inverse, lag=lag))[1] for lag in (2e-3 - 1e-6, 2e-3 + 1e-6)]
    assert radius[0] == pytest.approx(radius[1], abs=1e-5)


@pytest.mark.parametrize("gain", ["proportional_gain", "integral_gain"])
def test_a_gain_of_the_wrong_sign_is_named(inverse, gain):
    pid = control.Pid(period=1e-3, filter_rate=500.0, **{"proportional_gain": 5.0, gain: -2.0})
    within = control.Feedforward(period=1e-3, inverse=inverse, feedback=pid)
    with pytest.raises(InputError, match=rf"Pid\({gain}\) makes the loop unstable: got -2.0"):
        control.check_stable(within, inverse)


def test_a_negative_bandwidth_is_named(inverse):
    torque = control.ComputedTorque(period=1e-3, inverse=inverse, bandwidth=-20.0, filter_rate=500.0)
    with pytest.raises(InputError, match=r"ComputedTorque\(bandwidth\)"):
        control.check_stable(torque, inverse)


def test_too_much_gain_is_said_with_its_pole(inverse):
    with pytest.raises(InputError, match="Pid makes the loop unstable: got 'a pole of"):
        control.check_stable(control.Pid(period=0.02, proportional_gain=500.0, filter_rate=100.0), inverse)


@pytest.mark.parametrize("names", [
    ["hitec-hs-755hb", "feetech-sts3215-12v", "towerpro-sg90"],
    pytest.param(st.catalog_names(), marks=pytest.mark.slow)], ids=["some", "all"])
@pytest.mark.parametrize("kind", ["pid", "torque", "observer"])
def test_loops_by_rule_are_stable_on_every_servo_and_bear_wrong_numbers(kind, names):
    """Twice as much inertia, a third less, and half as much lag again, of light and heavy loads."""
    for name in names:
        servo = st.load_servo(name)
        for J_L in (1e-5, 1e-2):
            inverse = control.inverse_of(control.bare_bridge(servo), st.loads.Inertia(J_L))
            for T, count in ((1e-3, 2.0 * math.pi / 4096.0), (0.01, 0.0)):
                rates = tuning.rates(inverse, period=T, lag=1e-3, count=count)
                torque = control.ComputedTorque(period=T, inverse=inverse.frictionless, bandwidth=rates.bandwidth,
                                                filter_rate=rates.filter_rate)
                controller = {
                    "pid": control.Pid(period=T, filter_rate=rates.filter_rate,
                                       **tuning.pid_gains(inverse, rates.bandwidth)._asdict()),
                    "torque": torque,
                    "observer": control.DisturbanceObserver(controller=torque, inverse=inverse,
                                                            filter_rate=rates.observer_rate)}[kind]
                for share in (0.67, 1.0, 2.0):
                    other = inverse.replace(inertia=share * inverse.inertia, load_inertia=share * inverse.load_inertia)
                    control.check_stable(controller, other, lag=1.5e-3)


@pytest.mark.long
@pytest.mark.parametrize(("name", "J_L"), [("hitec-hs-755hb", 1e-3), ("towerpro-sg90", 5e-3)])
def test_an_integral_by_rule_leaves_more_than_45_degrees_of_phase_at_the_frames_of_a_pulse_servo(name, J_L):
    model, load = st.PulseServo(st.load_servo(name)), st.loads.Inertia(J_L)
    most = st.linear.tune(model, load, phase_margin=math.radians(45.0)).settings["outer_gain"] / 0.02
    rate = tuning.integral_rate(control.inverse_of(model, load), period=0.02, frame=0.02)
    assert 0.4 * most < rate < most


@pytest.mark.long
def test_a_servo_lags_slow_motions_as_the_rule_says(servo):
    model = st.PulseServo(servo)
    for speed in (0.02, 0.05):
        ramp = control.Trajectory([0.0, 1.5], [[speed], [1.0]])
        run = control.run_loop(control.SimulatedServo(model), control.PlainCommand(period=0.02), ramp)
        lag = tuning.lag_angle(control.inverse_of(model), speed=speed, frame=0.02)
        assert run.error()[-1000:].mean() == pytest.approx(lag, rel=0.1)
    mean = st.BoundedServo(servo)
    run = control.run_loop(control.SimulatedServo(mean), control.PlainCommand(period=0.001),
                           control.Trajectory([0.0, 3.0], [[0.05], [1.0]]))
    inverse = control.inverse_of(mean)
    moving = inverse.back_emf_constant * 0.05 / inverse.volts_per_error
    assert run.error()[-100:].mean() == pytest.approx(tuning.lag_angle(inverse) + moving, rel=0.02)
