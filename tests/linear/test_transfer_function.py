"""Transfer functions against the paper's (15) and (22), written out anew."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as s

import servotwin as st
from servotwin import loads
from servotwin.errors import LoadError, UnknownNameError

positive = s.floats(-3.0, 0.0).map(lambda x: 10.0**x)
S_POINTS = 1j * np.logspace(-1, 5, 25) + 0.3


def servo_with(R, L, k_a, k_b, J, B, N=1.0):
    return st.servo_from_values("random", {
        "motor": {"armature_resistance": R, "armature_inductance": L, "torque_constant": k_a, "back_emf_constant": k_b,
                  "rotor_inertia": J, "motor_viscous_friction": B}, "gear": {"gear_reduction": N}})


def values(system):
    return np.array([system(x) for x in S_POINTS])


@settings(max_examples=50, deadline=None)
@given(R=positive, L=positive, k_a=positive, k_b=positive, J=positive, B=positive)
def test_equation_15(R, L, k_a, k_b, J, B):
    system = st.linear.transfer_function(st.DCMotor(servo_with(R, L, k_a, k_b, J, B)))
    expected = k_a / (S_POINTS * ((L * S_POINTS + R) * (J * S_POINTS + B) + k_a * k_b))
    np.testing.assert_allclose(values(system), expected, rtol=1e-9)
    assert system.input_labels == ["armature_voltage"]
    assert system.output_labels == ["motor_angle"]


@settings(max_examples=50, deadline=None)
@given(R=positive, L=positive, k_a=positive, k_b=positive, J=positive, B=positive, N=s.floats(1.0, 400.0),
       J_L=positive, B_L=positive)
def test_equation_22(R, L, k_a, k_b, J, B, N, J_L, B_L):
    n = 1.0 / N
    system = st.linear.transfer_function(st.GearedMotor(servo_with(R, L, k_a, k_b, J, B, N)),
                                         load=loads.Inertia(J_L) + loads.Viscous(B_L))
    J_o, B_o = J + n**2 * J_L, B + n**2 * B_L
    expected = n * k_a / (S_POINTS * ((L * S_POINTS + R) * (J_o * S_POINTS + B_o) + k_a * k_b))
    np.testing.assert_allclose(values(system), expected, rtol=1e-9)
    assert system.output_labels == ["output_angle"]


def test_outputs_are_consistent(servo):
    model = st.GearedMotor(servo)
    angle, speed, motor, current = (
        values(st.linear.transfer_function(model, output=name))
        for name in ("output_angle", "output_speed", "motor_angle", "armature_current"))
    np.testing.assert_allclose(speed, S_POINTS * angle, rtol=1e-12)
    np.testing.assert_allclose(motor, servo.gear.gear_reduction * angle, rtol=1e-12)
    R, L, K_b = servo.motor.armature_resistance, servo.motor.armature_inductance, servo.motor.back_emf_constant
    np.testing.assert_allclose((L * S_POINTS + R) * current + K_b * S_POINTS * motor, 1.0, rtol=1e-9)


@pytest.mark.parametrize("model_class", [st.AveragedServo, st.AveragedServoInductive, st.BoundedServo])
def test_a_servo_follows_its_angle_command_at_rest(servo, model_class):
    model = model_class(servo)
    assert st.linear.transfer_function(model, input="command_angle").dcgain() == pytest.approx(1.0, rel=1e-12)
    volts = st.linear.transfer_function(model, input="command_voltage", output="feedback_voltage").dcgain()
    assert volts == pytest.approx(0.8041, rel=1e-3)  # k_p, Table II
    per_second = st.linear.transfer_function(model).dcgain()
    assert np.degrees(per_second) * 1e-6 == pytest.approx(0.1004, rel=1e-3)  # deg/us, Table II


def test_a_load_with_a_spring_counts(servo):
    system = st.linear.transfer_function(st.GearedMotor(servo), load=loads.Spring(2.0))
    K = servo.gear.gear_reduction * servo.motor.torque_constant
    assert system.dcgain() == pytest.approx(K / (servo.motor.armature_resistance * 2.0), rel=1e-12)


def test_bad_names_and_loads(servo):
    with pytest.raises(UnknownNameError, match="armature_voltage"):
        st.linear.transfer_function(st.DCMotor(servo), input="pulse_width")
    with pytest.raises(UnknownNameError, match="motor_angle"):
        st.linear.transfer_function(st.DCMotor(servo), output="output_angle")
    crossed = loads.Pendulum(mass=0.1, length=0.1) + loads.Pendulum(mass=0.1, length=0.1, hanging_angle=1.0)
    with pytest.raises(LoadError, match="hanging"):
        st.linear.transfer_function(st.GearedMotor(servo), load=crossed)
