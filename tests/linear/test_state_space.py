"""State space: the polynomials of the transfer function, two bodies with a spring between them."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, LoadError

OMEGA = np.geomspace(0.5, 200.0, 5)
INDUCTIVE = {"motor.armature_inductance": 2e-3, "friction.zero_crossing_slope": 1.0}


@pytest.mark.parametrize("kind", [st.DCMotor, st.GearedMotor, st.AveragedServo, st.AveragedServoInductive,
                                  st.BoundedServo, st.PulseServo, st.PulseServoInductive])
def test_it_is_the_transfer_function(servo, kind):
    model = kind(servo.replace(INDUCTIVE))
    load = None if kind is st.DCMotor else st.loads.Inertia(2e-3) + st.loads.Pendulum(mass=0.1, length=0.1)
    system = st.linear.state_space(model, load)
    for k, name in enumerate(system.output_labels):
        one = st.linear.transfer_function(model, output=name, load=load)
        np.testing.assert_allclose(system(1j * OMEGA)[k, 0], one(1j * OMEGA), rtol=1e-9, err_msg=name)


def test_a_pendulum_at_an_angle(servo):
    model, load = st.GearedMotor(servo), st.loads.Pendulum(mass=0.2, length=0.1, hanging_angle=0.3)
    for angle in (0.3, 1.0, 0.3 + math.pi):
        stiffness = st.linear.state_space(model, load, angle=angle)
        rigid = st.linear.state_space(model, st.loads.Inertia(0.2 * 0.1**2))
        inertia = servo.gear.gear_reduction**2 * servo.motor.rotor_inertia + 0.2 * 0.1**2 + (
            servo.gear.output_inertia or 0.0)
        pulled = stiffness.A[1, 0] - rigid.A[1, 0]
        assert pulled == pytest.approx(-0.2 * 0.1 * 9.80665 * math.cos(angle - 0.3) / inertia, rel=1e-12)


@pytest.mark.parametrize("where", ["gear", "arm"])
def test_two_bodies(servo, where):
    """The modes of two bodies with a spring between them, free of friction, back-EMF and loop; digital.md §4."""
    free = servo.replace({"motor.back_emf_constant": 1e-12, "motor.motor_viscous_friction": 0.0,
                          "gear.backlash": None, "electronics.stretcher_gain": 1e-9})
    k, J_load = 80.0, 0.004
    J_motor = free.gear.gear_reduction**2 * free.motor.rotor_inertia
    if where == "gear":
        model = st.PulseServo(free.replace({"gear.stiffness": k, "gear.output_inertia": None}))
        load, J_1, J_2 = st.loads.Inertia(J_load), J_motor, J_load
    else:
        model = st.PulseServo(free)
        load, J_1, J_2 = (st.loads.Flexible(stiffness=k, damping=0.0, inertia=J_load),
                          J_motor + (free.gear.output_inertia or 0.0), J_load)
    system = st.linear.state_space(model, load)
    assert max(system.poles().imag) == pytest.approx(math.sqrt(k / J_1 + k / J_2), rel=1e-6)
    model = st.PulseServo(model.servo.replace({"electronics.stretcher_gain": 60.0}))
    one, system = st.linear.transfer_function(model, load=load), st.linear.state_space(model, load)
    at = system.output_labels.index("output_angle")
    np.testing.assert_allclose(one(1j * OMEGA), system(1j * OMEGA)[at, 0], rtol=1e-6)


@pytest.mark.slow
def test_an_elastic_arm_counts_in_frames():
    """A sampled loop with an arm behind a spring follows simulated sines; the rigid one does not."""
    from linear.bare_servos import bare

    model = st.PulseServo(bare("hitec-hs-755hb"))
    arm = st.loads.Flexible(stiffness=8.0, damping=0.02, inertia=0.01)
    omega, size = np.array([8.0, 20.0]), np.radians(0.2)
    seen = st.linear.frequency_response(model, omega, amplitude=[size], load=arm)
    found = st.linear.sampled(model, arm).response(omega, amplitude=size)
    np.testing.assert_allclose(found, seen.response[0], rtol=2e-3)


BOB = st.loads.Pendulum(mass=0.1, length=0.1)


@pytest.mark.parametrize(("load", "more", "error"), [
    (BOB + st.loads.Pendulum(mass=0.1, length=0.1, hanging_angle=1.0), {}, LoadError),
    (None, {"angle": math.inf}, InputError), (None, {"frame_period": -1.0}, InputError)])
def test_bad_input(servo, load, more, error):
    with pytest.raises(error):
        st.linear.state_space(st.PulseServo(servo), load, **more)
