"""The transfer function of the pulse servos: the gain of their mean, where it holds, and what it leaves out."""

import math

import control
import numpy as np
import pytest

import servotwin as st
from linear.bare_servos import bare
from servotwin.errors import InputError

OMEGA = np.geomspace(0.1, 100.0, 7)


def test_the_bandwidth_of_the_hs_755hb(servo):
    loop = st.linear.transfer_function(st.PulseServo(servo), input="command_angle")
    # The catalog's numbers in (V_oc − V_ce0) K/(T_f s_r); with a loop gain of 1 it was 0.065 Hz.
    assert control.bandwidth(loop) / (2.0 * math.pi) == pytest.approx(3.94, abs=0.005)


@pytest.mark.parametrize("period", [None, 0.01])
@pytest.mark.parametrize("names", [("command_angle", "output_angle"), ("pulse_width", "feedback_voltage"),
                                   ("command_voltage", "armature_current"), ("command_angle", "motor_speed")])
def test_it_is_that_of_the_averaged_servo(servo, period, names):
    model = st.PulseServo(servo)
    load = st.loads.Inertia(2e-3) + st.loads.Spring(0.5)
    pulsed, mean = (st.linear.transfer_function(m, input=names[0], output=names[1], load=load, **more) for m, more in (
        (model, {"frame_period": period}), (model.averaged(period), {})))
    np.testing.assert_allclose(pulsed(1j * OMEGA), mean(1j * OMEGA), rtol=1e-9)


@pytest.mark.long(but="{'supply.internal_resistance': 0.5}")
@pytest.mark.parametrize("changed", [
    {}, {"supply.internal_resistance": 0.5}, {"supply.bridge_drop_resistance": 0.4}, {"supply.current_limit": 1.0},
    {"supply.bridge_drop_voltage": 0.8}], ids=str)
def test_what_the_source_loses_counts(changed):
    servo = bare("hitec-hs-755hb")
    model = st.PulseServo(servo.replace(changed))
    stiffness = 3.0  # of the order of the servo's own: half of the command is left
    load = st.loads.Spring(stiffness, rest_angle=math.pi / 2)
    value = st.linear.transfer_function(model, input="command_angle", load=load).dcgain()
    K, R = servo.gear.gear_reduction * servo.motor.torque_constant, servo.motor.armature_resistance
    source = model.servo.supply
    current = min((source.open_circuit_voltage - source.bridge_drop_voltage) / (
        R + (source.internal_resistance or 0.0) + (source.bridge_drop_resistance or 0.0)),
        source.current_limit or math.inf)
    chip = servo.electronics
    own = K * current * chip.stretcher_gain * chip.one_shot_slope / 0.02 * servo.potentiometer.feedback_gain
    assert value == pytest.approx(own / (own + stiffness), rel=1e-12)
    seen = st.linear.frequency_response(model, [1.0], amplitude=0.01, load=load, mean=math.pi / 2)
    assert seen.gain[0, 0] == pytest.approx(value, rel=0.015)  # frames apart; without the losses 7 % to 40 % off


def test_the_inductive_servo_has_its_current(servo):
    model = st.PulseServoInductive(servo)
    system = st.linear.transfer_function(model, input="command_angle")
    assert len(system.poles()) == 3
    assert system.dcgain() == pytest.approx(1.0, rel=1e-12)


def test_a_coasting_bridge_has_none(servo):
    model = st.PulseServo(servo.replace({"electronics.off_state": "coast"}))
    with pytest.raises(InputError, match=r"transfer function of hitec-hs-755hb: got 'a bridge that coasts'"):
        st.linear.transfer_function(model)


@pytest.mark.parametrize("name", [
    "electronics.minimum_drive_time", "electronics.stretcher_time_constant", "electronics.back_emf_injection",
    "motor.brush_drop_voltage"])
def test_where_the_gain_does_not_hold_one_line_says_so(servo, name):
    model = st.PulseServo(servo.replace({name: 0.01}))
    with pytest.warns(UserWarning, match=f"leaves out {name}: ") as said:
        st.linear.transfer_function(model)
    assert [(one.filename, "\n" in str(one.message)) for one in said] == [(__file__, False)]


@pytest.mark.parametrize(("model", "period", "text"), [
    (st.PulseServo, 0.0, "frame_period: got 0.0"), (st.PulseServo, math.nan, "frame_period: got nan"),
    (st.PulseServo, "x", "frame_period: got 'x'"), (st.BoundedServo, 0.02, "only the pulse servos"),
    (lambda servo: servo, None, "a model of a servo")])
def test_bad_input(servo, model, period, text):
    with pytest.raises(InputError, match=text):
        st.linear.transfer_function(model(servo), frame_period=period)
