"""What a controller is wired to: steps, bounds, delays, frames, and runs that are those of `simulate`."""

import math
import sys

import numpy as np
import pytest

import servotwin as st
from servotwin import control
from servotwin.errors import InputError, MissingExtraError

SLOW = control.quintic([0.3, 0.8], times=[0.0, 0.2])


@pytest.fixture(scope="module")
def bus():
    return st.DigitalServo(st.load_servo("feetech-sts3215-12v"))


def test_a_loop_of_constant_commands_is_a_simulation(servo):
    model, load = st.PulseServo(servo), st.loads.Inertia(1e-3)
    port = control.SimulatedServo(model, load, resolution=0.0)
    port.start(0.5)
    port.wait(0.1)
    port.send(1.2)
    for time in np.arange(0.107, 0.5, 0.007):
        port.wait(float(time))
    port.wait(0.5)
    seen = port.result(np.linspace(0.0, 0.5, 51))
    plain = st.simulate(model, st.signals.step(0.5, 1.2, at=0.1, unit="rad"), duration=0.5, load=load, output_step=0.01)
    for name in ("output_angle", "armature_voltage", "supply_current", "pulse_width"):
        assert seen[name] == pytest.approx(plain[name], abs=1e-9), name
    assert seen.energy.supply == pytest.approx(plain.energy.supply, rel=1e-9)


def test_pulses_go_out_in_steps_by_the_calibration_of_the_sender(servo):
    off = servo.replace({"potentiometer.feedback_gain": 1.1 * servo.potentiometer.feedback_gain})
    for believed in (servo, off):
        port = control.SimulatedServo(st.PulseServo(servo), believed=believed, resolution=16e-6)
        port.send(1.0)
        port.wait(0.02)
        exact = st.PulseServo(believed).command(st.signals.constant(1.0, unit="rad")).table[0].value
        sent = port.result(np.array([0.01]))["pulse_width"][0]
        assert sent == pytest.approx(16e-6 * round(exact / 16e-6), abs=1e-15)


def test_what_a_wire_cannot_carry_is_the_nearest_that_it_can(servo, bus):
    cases = [(st.PulseServo(servo), 99.0, "pulse_width", 2.7e-3), (control.bare_bridge(servo), 99.0, "duty", 1.0),
             (st.GearedMotor(servo), -99.0, "armature_voltage", -6.0)]
    for model, command, signal, most in cases:
        port = control.SimulatedServo(model)
        port.send(command)
        port.wait(0.005)
        assert port.result(np.array([0.004]))[signal][0] == pytest.approx(most, rel=1e-12)
    with pytest.raises(InputError, match="command at 0 s: got nan"):
        control.SimulatedServo(bus).send(math.nan)


def test_a_voltage_at_the_bridge_is_the_voltage_of_the_motor(servo):
    port = control.SimulatedServo(control.bare_bridge(servo, duty_steps=1000))
    port.send(3.0)
    port.wait(0.3)
    seen = port.result(np.array([0.25]))
    assert seen["armature_voltage"][0] == pytest.approx(3.0, abs=5.6e-3)  # a step of the duty
    F = port.nominal.volts_per_torque * port.nominal.coulomb_torque_forward
    assert seen["output_speed"][0] == pytest.approx((seen["armature_voltage"][0] - F) / port.nominal.back_emf_constant,
                                                    rel=1e-6)


def test_commands_and_measurements_come_late_by_their_delays(servo):
    sensors = [control.Encoder(count=0.0), control.Encoder(count=0.0, shows="before", delay=0.005)]
    port = control.SimulatedServo(st.GearedMotor(servo), sensors=sensors, delay=0.003)
    port.send(6.0)
    seen = []
    for k in range(21):
        port.wait(1e-3 * k)
        seen.append(port.measure())
    angle = np.array([row["output_angle"] for row in seen])
    assert (angle[:4] == 0.0).all()
    assert angle[4] > 0.0
    assert [row["before"] for row in seen[5:]] == angle[:-5].tolist()


def test_sensors_show_steps_and_the_same_noise_for_the_same_seed(servo):
    tap = control.Tap.of(servo, bits=10, reference_voltage=2.5, noise=5e-3)
    rows = []
    for seed in (1, 1, 2):
        port = control.SimulatedServo(st.PulseServo(servo), sensors=[tap], seed=seed)
        port.start(1.0)
        rows.append([port.measure() for _ in range(20)])
    assert rows[0] == rows[1] != rows[2]
    volts = np.array([row["feedback_voltage"] for row in rows[0]])
    assert volts / (2.5 / 1024) == pytest.approx(np.round(volts / (2.5 / 1024)), abs=1e-9)
    p, b_o = servo.potentiometer.feedback_gain, servo.potentiometer.feedback_offset
    assert rows[0][0]["output_angle"] == pytest.approx((volts[0] - b_o) / p)
    assert volts.mean() == pytest.approx(p + b_o, abs=5e-3)


def test_the_tap_of_a_bare_bridge_still_turns_with_the_shaft(servo):
    port = control.SimulatedServo(control.bare_bridge(servo), sensors=[control.Tap.of(servo, bits=16)])
    port.start(0.7)
    assert port.measure()["output_angle"] == pytest.approx(0.7, abs=2e-4)


def test_a_run_tells_what_happened(servo):
    port = control.SimulatedServo(st.PulseServo(servo), sensors=[control.Encoder()])
    run = control.run_loop(port, control.PlainCommand(period=0.02), SLOW, 0.5)
    assert run.time == pytest.approx(0.02 * np.arange(25))
    assert run.command == pytest.approx(SLOW.at(run.time).angle)
    assert run.measured["output_angle"].shape == (25,)
    error = SLOW.at(run.true_time).angle - run.true["output_angle"]
    assert run.rms_error() == pytest.approx(np.sqrt(np.mean(error**2)))
    assert run.largest_error() == pytest.approx(np.abs(error).max())
    assert run.energy == run.true.energy.supply > 0.0
    assert run.chatter == pytest.approx(0.5 / SLOW.duration)  # it only goes up
    assert run.effort == pytest.approx(np.sqrt(np.mean(run.true["armature_voltage"]**2)))
    assert run.reversals == 0.0  # pulses one way, with rests between them
    assert run.true.remarks == ()


def test_a_controller_may_be_told_the_reference_ahead(servo):
    run = control.run_loop(control.SimulatedServo(st.PulseServo(servo)), control.PlainCommand(period=0.02, ahead=0.05),
                           SLOW)
    assert run.command == pytest.approx(SLOW.at(run.time + 0.05).angle)


def test_what_is_predicted_is_stated_before_running(servo):
    port = control.SimulatedServo(st.PulseServo(servo))
    with pytest.warns(UserWarning, match=r"period of 5 ms is shorter than the frame of 20 ms"):
        control.run_loop(port, control.PlainCommand(period=5e-3), SLOW)
    bridge = control.SimulatedServo(control.bare_bridge(servo), sensors=[control.Encoder()])
    with pytest.raises(InputError, match=r"Pid\(proportional_gain\) makes the loop unstable: got -3"):
        control.run_loop(bridge, control.Pid(period=1e-3, proportional_gain=-3.0, filter_rate=300.0), SLOW)


def test_a_controller_that_does_not_fit_is_refused_in_one_line(servo):
    port = control.SimulatedServo(st.PulseServo(servo))
    pid = control.Pid(period=0.02, proportional_gain=1.0, filter_rate=50.0)
    with pytest.raises(InputError, match="command of Pid: got 'armature_voltage', allowed: command_angle"):
        control.run_loop(port, pid, SLOW)
    around = control.Pid(period=0.02, integral_gain=1.0, filter_rate=50.0, commands="command_angle")
    with pytest.raises(InputError, match="sensors of SimulatedServo: got \"none that shows 'output_angle'\""):
        control.run_loop(port, around, SLOW)
    with pytest.raises(InputError, match="delay of SimulatedServo"):
        control.SimulatedServo(st.PulseServo(servo), delay=-1.0)
    with pytest.raises(InputError, match="duty_steps"):
        control.bare_bridge(servo, duty_steps=0)


def test_a_missing_extra_is_one_line(servo, monkeypatch):
    monkeypatch.setitem(sys.modules, "osqp", None)
    with pytest.raises(MissingExtraError, match=r"osqp is needed for this: pip install 'servotwin\[mpc\]'"):
        control.PredictiveControl(period=0.01, inverse=control.inverse_of(st.PulseServo(servo)), observer_rate=20.0)
