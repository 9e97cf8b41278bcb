"""Sampled loops: closed forms of the double integrator and the motor, limits, and what simulated sines do."""

import math

import control
import numpy as np
import pytest

import servotwin as st
from linear.bare_servos import bare
from servotwin.errors import InputError

SIZES = np.radians([0.2, 1.0, 5.0])


def off(servo, *names):
    """The servo without some numbers, and without friction and dead zone."""
    names = [name for name in names if servo.get(name) is not None]
    zero = [name for name in servo.names() if name.startswith(("friction.load_friction", "friction.coulomb_torque"))
            or name in ("firmware.deadband_angle", "firmware.minimum_duty", "firmware.derivative_threshold",
                        "gear.backlash", "supply.bridge_drop_voltage")]
    return servo.replace(dict.fromkeys(names)).replace(dict.fromkeys(zero, 0.0))


def sts(P=32, D=32):
    servo = st.feetech_sts({"P_Coefficient": P, "D_Coefficient": D}, servo="feetech-sts3215-12v")
    return off(servo, "firmware.whole_counts", "firmware.duty_quantum", "firmware.angle_quantum",
               "firmware.speed_limit", "firmware.acceleration_limit", "firmware.minimum_speed")


def test_a_burst_on_a_lossless_motor_is_a_velocity_jump():
    """P = c/s²: a burst of area a at d moves the speed by a c, so L* = a c [(T − d) z + d]/(z − 1)²."""
    servo = bare("hitec-hs-755hb").replace({"motor.motor_viscous_friction": 0.0, "motor.back_emf_constant": 1e-12})
    model = st.PulseServo(servo)
    seen = st.linear.sampled(model)
    T, d = model.frame_period, seen.law.delay
    N, k_a, R = (servo.gear.gear_reduction, servo.motor.torque_constant, servo.motor.armature_resistance)
    c = N * k_a / R / (N**2 * servo.motor.rotor_inertia + (servo.gear.output_inertia or 0.0))
    a = model.mean_gain() * T * servo.potentiometer.feedback_gain
    omega = np.array([1.0, 10.0, 100.0])
    z = np.exp(1j * omega * T)
    loop = a * c * ((T - d) * z + d) / (z - 1.0) ** 2
    np.testing.assert_allclose(seen.open_loop(omega), loop, rtol=1e-6)
    np.testing.assert_allclose(seen.response(omega), a / T * c / (1j * omega) ** 2 * np.exp(-1j * omega * d)
                               / (1.0 + loop), rtol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["hitec-hs-755hb", *(
    pytest.param(name, marks=pytest.mark.slow) for name in ("towerpro-mg90s", "gobilda-2000-67"))])
def test_simulated_sines_of_pulse_servos(name):
    model = st.PulseServo(bare(name))
    bandwidth = control.bandwidth(st.linear.transfer_function(model, input="command_angle"))
    omega = bandwidth * np.array([0.7])
    omega = omega[omega < math.pi / model.frame_period]
    loop, seen = st.linear.sampled(model), st.linear.frequency_response(model, omega, amplitude=SIZES)
    for row, size, impulse, width in zip(
            seen.response, SIZES, (0.015, 0.07, math.inf), (1e-3, 1e-3, 0.04), strict=True):
        assert np.abs(np.abs(loop.response(omega)) / np.abs(row) - 1.0).max() < impulse
        error = loop.response(omega, amplitude=size) / row
        assert np.abs(np.abs(error) - 1.0).max() < width
        assert np.degrees(np.abs(np.angle(error))).max() < 2.0


@pytest.mark.long
@pytest.mark.parametrize(("D", "P"), [(0, 16), (32, 32)])
def test_simulated_sines_of_ticks(D, P):
    """Exact where nothing is cut, held or dropped: D is renewed every 20th tick, duties come a tick later."""
    model = st.DigitalServo(sts(P, D))
    omega = 2.0 * np.pi * np.array([1.0, 4.0, 12.0])
    seen = st.linear.frequency_response(model, omega, amplitude=[0.003])
    np.testing.assert_allclose(st.linear.sampled(model).response(omega), seen.response[0], rtol=1e-4)


def test_ticks_far_shorter_than_the_motion_are_no_ticks():
    servo = sts(16, 0).replace({"firmware.control_period": 1e-5, "firmware.compute_delay": 0.0,
                                "firmware.filter_weight": 1.0})
    model, omega = st.DigitalServo(servo), np.array([3.0, 30.0])
    K = servo.gear.gear_reduction * servo.motor.torque_constant
    K_b, R = servo.gear.gear_reduction * servo.motor.back_emf_constant, servo.motor.armature_resistance
    J = servo.gear.gear_reduction**2 * servo.motor.rotor_inertia + (servo.gear.output_inertia or 0.0)
    b = servo.gear.gear_reduction**2 * servo.motor.motor_viscous_friction + K * K_b / R
    k, s = model.loop_stiffness(), 1j * omega
    np.testing.assert_allclose(st.linear.sampled(model).response(omega), k / (J * s * s + b * s + k), rtol=2e-4)


def test_short_frames_are_the_mean():
    """ω_n = √(k_θ/J), ζ = b/(2 √(k_θ J)) of physics.md, which the sampled poles go to as T_f → 0."""
    servo = bare("hitec-hs-755hb")
    for period, near in ((0.004, 0.15), (0.0026, 0.1)):
        model = st.PulseServo(servo.replace({"electronics.frame_period": period}))
        mean = st.linear.state_space(model, input="command_angle").poles()
        found = st.linear.sampled(model).poles
        assert np.abs(np.sort_complex(found) / np.sort_complex(mean) - 1.0).max() < near


@pytest.mark.parametrize("model", [st.PulseServo(bare("hitec-hs-755hb")), st.DigitalServo(sts(16)),
                                   st.DigitalServo(sts(32))], ids=["HS-755HB", "P 16", "P 32"])
def test_the_margins_are_where_it_becomes_unstable(model):
    loop = st.linear.sampled(model)
    assert loop.stable
    gain = loop.margins.gain
    assert loop.poles_at(0.999 * gain)[0].real < 0.0 < loop.poles_at(1.001 * gain)[0].real
    crossover = loop.margins.crossover
    assert abs(loop.open_loop(crossover)) == pytest.approx(1.0, abs=1e-4)
    assert np.angle(-loop.open_loop(crossover)) == pytest.approx(loop.margins.phase, abs=1e-3)


def test_one_tick_later_is_a_delay():
    """The delay margin of a loop without aliases: so much later it is just unstable."""
    model = st.DigitalServo(sts(32, 0))
    loop = st.linear.sampled(model)
    for more, stable in ((0.9, True), (1.1, False)):
        later = st.DigitalServo(model.servo.replace({
            "firmware.compute_delay": 1e-3 + more * loop.margins.delay, "firmware.control_period": 4e-3}))
        assert st.linear.sampled(later).stable is stable


@pytest.mark.parametrize(("make", "text"), [
    (lambda s: st.linear.sampled(st.BoundedServo(s)), "model of a sampled loop"),
    (lambda s: st.linear.sampled(st.PulseServo(s), frame_period=-1.0), "frame_period"),
    (lambda s: st.linear.sampled(st.PulseServo(s), angle=9.0), "travel"),
    (lambda s: st.linear.sampled(st.PulseServo(s)).response([200.0]), "below half the rate"),
    (lambda s: st.linear.sampled(st.PulseServo(s)).response([2.0], amplitude=-1.0), "amplitude"),
    (lambda s: st.linear.sampled(st.DigitalServo(sts())).response([2.0], amplitude=1.0), "amplitude of a digital"),
    (lambda s: st.linear.sampled(st.DigitalServo(sts())).loop(), "loop of a digital servo"),
    (lambda s: st.linear.sampled(st.DigitalServo(st.load_servo("miuzei-25kg"))), "diode"),
    (lambda s: st.linear.sampled(st.PulseServo(s.replace({
        "potentiometer.fixed_angle": 1.0, "stops.lower_angle": None, "stops.upper_angle": None,
        "stops.restitution": None}))), "no loop")])
def test_bad_input(servo, make, text):
    with pytest.raises(InputError, match=text):
        make(servo)


def test_a_profile_is_named():
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    with pytest.warns(UserWarning, match=r"leaves out firmware\.acceleration_limit, firmware\.speed_limit"):
        st.linear.sampled(model)


@pytest.mark.parametrize(("model", "holds"), [
    (st.PulseServo(st.load_servo("hitec-hs-755hb")), 1), (st.DigitalServo(sts(D=0)), 1), (st.DigitalServo(sts()), 20)])
def test_the_closed_loop_is_a_system_of_python_control(model, holds):
    """Its poles are those of the loop, its period is that after which the loop is the same again."""
    seen = st.linear.sampled(model)
    system = seen.system()
    assert system.dt == pytest.approx(holds * seen.period)
    np.testing.assert_allclose(np.sort(np.abs(system.poles())), np.sort(np.abs(np.linalg.eigvals(
        seen.law.monodromy()))), atol=1e-9)
    step = control.step_response(system, T=np.arange(200) * system.dt)
    assert step.outputs[-1] == pytest.approx(1.0, abs=1e-3)
