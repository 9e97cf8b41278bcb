"""The inverse servo: (40) returns what was simulated, and its inverse is one."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin import control, physics
from servotwin.control import Reference
from servotwin.errors import InputError

LOADS = {"free": None, "pendulum": st.loads.Pendulum(mass=0.2, length=0.15) + st.loads.Viscous(0.02),
         "pressed": st.loads.Constant(0.4) + st.loads.Inertia(3e-3)}


@pytest.mark.long
@pytest.mark.parametrize("name", LOADS)
def test_equation_40_returns_the_load_torque_of_a_simulated_motion(servo, name):
    model, load = st.AveragedServo(servo), LOADS[name]
    t, h = np.linspace(0.05, 0.95, 91), 1e-5
    command = st.signals.sine(mean=1.2, amplitude=0.4, frequency=1.5, unit="rad")
    result = st.simulate(model, command, duration=1.0, load=load, accuracy=1e-13, output_times=t)
    later, before = (result.at("output_speed", t + by) for by in (h, -h))
    motion = Reference(result["output_angle"], result["output_speed"], (later - before) / (2.0 * h))
    found = control.inverse_of(model, load).load_torque(result["armature_voltage"], motion)
    assert found == pytest.approx(result["load_torque"], abs=1e-6)


def test_the_voltage_of_a_motion_leaves_the_torque_of_its_load(servo):
    load = LOADS["pendulum"]
    inverse, torque = control.inverse_of(st.AveragedServo(servo), load), control.LoadModel(load)
    motion = Reference(np.linspace(-1.0, 2.0, 7), np.linspace(-3.0, 3.0, 7), np.linspace(20.0, -30.0, 7))
    v = inverse.voltage(motion, torque(*motion[:3]))
    leaves = inverse.load_torque(v, motion)
    taken = 0.2 * 0.15**2 * motion.acceleration + 0.02 * motion.speed + torque(*motion[:3])
    assert leaves == pytest.approx(taken, abs=1e-12)


@pytest.mark.parametrize("speed", [2.0, -2.0])
@pytest.mark.parametrize("pressed", [0.8, -0.8, 0.0])
def test_friction_of_the_gear_grows_with_the_torques_as_the_law_says(speed, pressed):
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    inverse, b_L = control.inverse_of(model), 0.0
    v = inverse.voltage(Reference(0.0, speed, 5.0), pressed)
    tau_m = (v - inverse.back_emf_constant * speed) / inverse.volts_per_torque
    shares = physics.torque_share(tau_m, physics.torque_on_gear(pressed, speed, b_L), inverse.motor_share,
                                  inverse.external_share)
    friction = math.copysign(inverse.coulomb_torque_forward + shares, speed)
    assert tau_m == pytest.approx(inverse.total_inertia * 5.0 + pressed + friction, abs=1e-9)


@pytest.mark.parametrize("kind", [st.BoundedServo, st.AveragedServo])
def test_a_commanded_voltage_is_the_voltage_of_the_loop(servo, kind):
    model = kind(servo)
    inverse = control.inverse_of(model)
    for v in (2.0, -1.0):
        asked = inverse.command_angle(v, 1.0)
        result = st.simulate(model, st.signals.constant(asked, unit="rad"), duration=1e-3,
                             initial={"output_angle": 1.0}, output_times=[0.0])
        assert result["armature_voltage"][0] == pytest.approx(v, abs=1e-9)


def test_pulses_have_the_commanded_voltage_in_the_mean(servo):
    model = st.PulseServo(servo)
    inverse = control.inverse_of(model)
    asked = inverse.command_angle(2.0, 1.0)
    result = st.simulate(model, st.signals.constant(asked, unit="rad"), duration=0.04,
                         initial={"output_angle": 1.0}, load=st.loads.Inertia(1e6))  # it stands
    assert result.mean("armature_voltage", since=0.02) == pytest.approx(2.0, rel=1e-3)


def test_a_goal_is_ahead_of_a_profile_by_its_braking_distance():
    servo = st.load_servo("feetech-sts3215-12v")
    inverse = control.inverse_of(st.DigitalServo(servo))
    a = servo.firmware.acceleration_limit
    assert inverse.command_angle(0.0, 1.0, -3.0) == pytest.approx(1.0 - 9.0 / (2.0 * a))


def test_joints_are_their_servos_side_by_side(servo):
    ones = [control.inverse_of(st.PulseServo(servo), load) for load in LOADS.values()]
    many = control.joined(ones)
    moves = Reference(0.5, 2.0, -30.0)
    assert many.voltage(moves, 0.1).tolist() == [one.voltage(moves, 0.1) for one in ones]
    assert many.command_angle(1.0, 0.5, 2.0).tolist() == [one.command_angle(1.0, 0.5, 2.0) for one in ones]


def test_a_motor_has_no_loop_of_its_own(servo):
    inverse = control.inverse_of(st.GearedMotor(servo))
    assert math.isnan(inverse.volts_per_error)
    assert inverse.voltage(Reference(0.0, 2.0)) == pytest.approx(2.0 * inverse.back_emf_constant)


def test_what_makes_no_sense_is_named(servo):
    inverse = control.inverse_of(st.PulseServo(servo))
    with pytest.raises(InputError, match="resistance of ServoInverse: got -1"):
        inverse.replace(resistance=-1.0)
    with pytest.raises(InputError, match="motor_share"):
        inverse.replace(motor_share=1.0)
    with pytest.raises(InputError, match="coasts"):
        control.inverse_of(st.PulseServo(servo.replace({"electronics.off_state": "coast"})))
