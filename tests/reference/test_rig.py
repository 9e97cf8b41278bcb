"""The bench of small steps against the exact engine, and the frames and stamps that it promises."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from reference import rig  # by this name everywhere: compiled code is kept under the name of its module
from reference.rig_logs import load_of, log_of, servo_of

DISC = rig.Load(inertia=1e-2, torque=0.3)
ARM = rig.Load(inertia=1.06e-2, gravity=0.587, hanging=0.5 * np.pi)
CASES = {
    "plain": ({}, DISC, 0.02, 0.0),
    "arm": ({}, ARM, 0.02, 0.0),
    "late frames": ({}, DISC, 0.02, 0.0131),
    "longer frames": ({}, DISC, 0.02048, 0.0),
    "coasting": ({"coasts": 1.0}, ARM, 0.02, 0.0),
    "breakaway": ({"breakaway": 1.4, "backward": 0.4, "forward": 0.2}, DISC, 0.02, 0.0),
    "M3": ({"load_share": 0.15}, ARM, 0.02, 0.0),
    "M5": ({"motor_share": 0.15, "external_share": 0.2}, ARM, 0.02, 0.0),
    "play": ({"play": 0.02, "wheel": 1e-3}, DISC, 0.02, 0.0),
    "wiper": ({"wiper_play": 0.01}, DISC, 0.02, 0.0),
    "drops": ({"t_min": 5e-4, "V_br": 0.3, "r_c": 0.3, "R_b": 0.2}, DISC, 0.02, 0.0),
}


def widths(turns=100):
    rng = np.random.default_rng(1)
    long = np.repeat(1.55e-3 + rng.uniform(-0.4e-3, 0.4e-3, 8), 20)[:turns]
    return np.where(np.arange(turns) < 70, long, long[69] + np.repeat(rng.uniform(-1e-5, 1e-5, 10), 10)[:turns])


@pytest.mark.parametrize("case", CASES)
def test_it_agrees_with_the_exact_engine(case):
    """A drive may begin or a shaft stop one step of 10 µs late: 0.1 mrad in 2 s."""
    change, load, period, phase = CASES[case]
    servo = rig.Servo()._replace(**change)
    said = rig.record(servo, load, widths(), noise=0.0, before=0.0, period=period, phase=phase)
    edges = phase + period * np.arange(int((said.time[-1] + 0.02 - phase) / period))
    signal = replace(log_of(said, load, case).signal(), edges=tuple(edges.tolist()))
    exact = st.simulate(st.PulseServo(servo_of(servo, period)), signal, duration=float(said.time[-1]),
                        load=load_of(load), output_times=said.time)["output_angle"]
    assert np.ptp(exact) > 0.5
    assert np.max(np.abs(said.angle - exact)) < 1.5e-4


def test_a_smaller_step_changes_less():
    """Of first order at least, for a drive that begins and a shaft that stops."""
    servo, commands = rig.Servo(), widths()
    edges = 0.02 * np.arange(len(commands))
    found = [rig.angles(servo, DISC, edges, commands, edges, step=step) for step in (4e-5, 1e-5, 2e-6)]
    far, near = (np.max(np.abs(one - found[-1])) for one in found[:2])
    assert 1e-6 < near < 0.4 * far


def test_frames_find_the_command_that_has_arrived():
    """Edge k of 20 ms, 5 ms late, finds command k; one 5 ms early the command before."""
    commands = np.arange(1.0, 6.0)
    arrivals = 0.02 * np.arange(5)
    late = rig.frames(commands, arrivals, 0.0, 0.1, phase=0.005, period=0.02)
    early = rig.frames(commands, arrivals, 0.0, 0.1, phase=-0.005, period=0.02)
    glued = rig.frames(commands, arrivals, 0.0, 0.095, phase=0.0, period=0.02)
    np.testing.assert_allclose(late[0], 0.005 + arrivals)
    assert [x[1].tolist() for x in (late, early, glued)] == [[1, 2, 3, 4, 5], [1, 2, 3, 4, 5], [1, 2, 3, 4, 5]]
    np.testing.assert_allclose(early[0], 0.015 + arrivals)


def test_stamps_and_noise_are_what_they_are_said_to_be():
    commands = np.full(2000, 1.5e-3)
    said = rig.record(rig.Servo(), rig.Load(), commands, noise=1e-3, ar=0.8, stamp_jitter=1e-3, clock=1e-3,
                      angle_offset=0.1, seed=3)
    noise = said.angle - said.true_angle - 0.1
    assert np.std(noise) == pytest.approx(1e-3, rel=0.2)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0.8, abs=0.06)
    late = said.time - said.true_time
    slope, start = np.polyfit(said.true_time, late, 1)
    assert slope == pytest.approx(1e-3, abs=1e-5)
    assert np.std(late - slope * said.true_time - start) == pytest.approx(1e-3, rel=0.1)
    assert said.time[0] == 0.0
    assert np.all(np.diff(said.time) > 0.0)


def test_a_digital_servo_holds_and_lost_pulses_are_missed():
    """duty = P e: held within torque / (P K V/R) of its command; an analog one without pulses goes on holding."""
    servo = rig.Servo(digital_rate=1000.0)
    said = rig.record(servo, rig.Load(inertia=1e-2, torque=0.6), widths(), noise=0.0)
    stiff = servo.digital_gain * servo.K * (servo.V_oc - servo.V_ce0) / servo.R
    asked = (said.command[59] - servo.zero) / servo.slope
    assert abs(said.angle[59] - asked) < (0.6 + servo.forward) / stiff + servo.digital_deadband
    none, half = (rig.record(rig.Servo(), DISC, widths(), noise=0.0, lost=lost).angle for lost in (0.0, 0.5))
    assert 5e-3 < np.max(np.abs(half - none)) < 1.0
