"""The pulses of a log: which command each carries, when they come, and what a fit makes of clocks of their own."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.fits import FREE, TRUTH, WRONG, fitted, some
from servotwin.identification import Log
from servotwin.identification.fitting.search.case import Frames, gap_of, gaps, latency, near_edges, signal, widest
from servotwin.logs.regular import made_regular, regular_times

PERIOD = 0.02
DEFAULT = ("delay", "frame_phase", "angle_offset", "initial_state")


def uneven(seed=0, n=60):
    """Return a log whose command changes at uneven times."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.015, 0.025, n))
    return Log(name="uneven", time=time, command=1.5e-3 + 1e-5 * np.arange(n), command_kind="pulse_width",
               measured={"output_angle": np.zeros(n) + 1e-3 * np.arange(n)})


def carried(log, frames):
    """Return what the pulses of frames carry."""
    made = signal(log, frames, 0.5 * PERIOD, PERIOD)
    return made(np.array(made.edges))


def test_gaps_divide_a_frame_and_nothing_changes_inside():
    log = uneven()
    found = gaps(log, PERIOD)
    assert sum(gap.width for gap in found) == pytest.approx(PERIOD, abs=1e-6 * len(found))
    for gap in found[::7]:
        inside = [carried(log, Frames(gap.low + share * gap.width, PERIOD)) for share in (0.02, 0.5, 0.98)]
        np.testing.assert_array_equal(inside[0], inside[1])
        np.testing.assert_array_equal(inside[1], inside[2])
        beyond = carried(log, Frames(gap.high + 1e-7, PERIOD))
        assert (beyond != inside[1]).any()
        again = gap_of(log, Frames(gap.middle, PERIOD))
        assert again.low == pytest.approx(gap.low, abs=1e-9)
        assert again.high == pytest.approx(gap.high, abs=1e-9)


def test_commands_in_step_leave_the_phase_open():
    log = some(std=0.0, duration=1.0)[0]
    assert len(gaps(log, 0.01)) == 1
    assert gap_of(log, widest(log, 0.01)).width == pytest.approx(0.01)


def test_the_command_that_two_assignments_dispute_is_named():
    log = uneven()
    one, other = gaps(log, PERIOD)[3:5]
    at = near_edges(log, Frames(one.middle, PERIOD), Frames(other.middle, PERIOD))
    assert len(at) == 1
    assert (at[0] - log.time[0]) % PERIOD == pytest.approx(other.low, abs=1e-9)


@pytest.mark.parametrize("first", [0.0, 0.013])
def test_pulses_without_a_command_are_not_sent(first):
    """Each edge by itself: what it carries is the command in force at its place in the frames, if there is one."""
    log = uneven()
    silent = (np.arange(60) < 5) | ((np.arange(60) > 20) & (np.arange(60) < 31)) | (np.arange(60) % 17 == 0)
    log = replace(log, command=np.where(silent, np.nan, log.command))
    frames = Frames(0.4 * PERIOD, PERIOD)
    made = signal(log, frames, first, PERIOD)
    k = np.arange(-1 if first else 0, 70)
    latest = np.maximum(np.searchsorted(log.time - log.time[0], frames.phase + k * PERIOD, side="right") - 1, 0)
    edges = np.maximum(first + k * PERIOD, 0.0)
    due = ~silent[latest] & (edges <= log.duration)
    own = np.array(made.edges)
    np.testing.assert_allclose(own[own <= log.duration], edges[due], rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(made(own)[:due.sum()], log.command[latest][due])
    assert made.initial == log.command[5]
    assert set(np.flatnonzero(np.diff(silent)) + 1) <= set(log.changes.tolist())


@pytest.mark.long
@pytest.mark.parametrize("kind", ["a fitted phase", "a fitted period"])
def test_clocks_are_found_in_logs_without_some_pulses(kind):
    servo = TRUTH.replace({"electronics.pulse_timeout": 0.03, "electronics.silence_state": "coast"})
    on = (np.arange(75) < 45) | (np.arange(75) >= 55)
    logs = [replace(log, torque_on=None, command=np.where(on, log.command, np.nan))
            for log in some(servo, torque_on=on)]
    clock, nuisance = (0.0, DEFAULT) if kind == "a fitted phase" else (2e-3, (*DEFAULT, "frame_period"))
    logs = [replace(log, time=log.time * (1.0 + clock) + 1e-3 * k) for k, log in enumerate(logs)]
    off = servo.replace({name: WRONG.get(name) for name in ("motor.armature_resistance", "electronics.stretcher_gain")})
    fit = fitted(logs, servo=off, nuisance=nuisance)
    assert fit.noise["output_angle"] < 1.2e-3
    low, high, _ = fit.intervals()["delay"]
    assert low < 0.05 < high
    if clock:
        assert fit.estimates["frame_period"] == pytest.approx(0.01 * (1.0 + clock), rel=2e-4)


def test_commands_wait_half_a_frame_in_the_mean():
    log = uneven(n=4000)
    assert latency(log, Frames(0.3 * PERIOD, PERIOD)) == pytest.approx(0.5 * PERIOD, rel=0.05)


def test_later_pulses_move_the_motion_by_as_much():
    """With the same commands in the same pulses, of a servo that rests before: by what the edges come later."""
    log = some(std=0.0, motions=("prbs",), duration=1.0, load=st.loads.Inertia(1e-2))[0]
    frames, at = widest(log, 0.01), np.arange(0.1, 0.9, 0.013)
    angle = [st.simulate(st.PulseServo(TRUTH), signal(log, frames, first, 0.01), load=log.load, duration=1.0)
             for first in (0.002, 0.0055)]
    np.testing.assert_allclose(angle[1].at("output_angle", at + 0.0035), angle[0].at("output_angle", at), atol=1e-10)


def test_a_beat_is_found_behind_stamps_that_scatter():
    rng = np.random.default_rng(1)
    true = 0.02 * np.delete(np.arange(200), [50, 51])
    found = regular_times(true + 2e-3 * rng.standard_normal(len(true)).clip(-2.0, 2.0))
    assert found.step == pytest.approx(0.02, rel=1e-4)
    assert found.scatter == pytest.approx(2e-3, rel=0.2)
    np.testing.assert_allclose(found.times, true, atol=8e-4)
    assert regular_times(np.cumsum(rng.exponential(0.02, 300))) is None
    assert made_regular(uneven()).name == "uneven"


@pytest.mark.long
@pytest.mark.parametrize(("jitter", "clock"), [(1e-9, 0.0), (1e-6, 0.0), (0.0, -1e-6)],
                         ids=["1 ns of jitter", "1 us of jitter", "1 ppm slow"])
def test_a_clock_that_is_off_by_nothing_changes_nothing(jitter, clock):
    """Stamps of 1 ns of jitter once made 19 mrad of residuals, and 1 ppm a delay that was a frame off."""
    rng = np.random.default_rng(2)
    logs = [replace(log, time=log.time * (1.0 + clock) + jitter * rng.standard_normal(len(log))) for log in some()]
    fit = fitted(logs, servo=WRONG, free=FREE, nuisance=DEFAULT)
    assert fit.noise["output_angle"] < 1.2e-3
    low, high, method = fit.intervals()["delay"]
    assert method == "by pulses"
    assert low < 0.05 < high
    assert high - low < 0.0115


@pytest.mark.long
@pytest.mark.parametrize("clock", [-4e-4, 4e-4])
def test_pulses_that_drift_a_little_get_a_period_of_their_own(clock):
    """As far as quartz clocks are off: residuals are hardly larger for it, and parameters were biased."""
    logs = [replace(log, time=log.time * (1.0 + clock)) for log in some(duration=3.0)]
    fit = fitted(logs, servo=WRONG, free=FREE, nuisance=DEFAULT)
    assert any("their period was fitted too" in line for line in fit.warnings)
    assert fit.estimates["frame_period"] == pytest.approx(0.01 * (1.0 + clock), rel=1e-4)
    low, high, _ = fit.intervals()["delay"]
    assert low < 0.05 < high


def test_a_held_out_log_is_judged_on_its_second_half():
    logs = some(motions=("step", "prbs", "triangle", "step"))
    logs[3] = replace(logs[3], name="other", time=logs[3].time + 3e-3)
    fit = fitted(logs, holdout=["other"], nuisance=DEFAULT, intervals=False)
    trace = fit.traces[3]
    since = trace.time - trace.log.start
    np.testing.assert_array_equal(trace.judged, since >= 0.5 * trace.log.duration)
    assert fit.holdout.errors["PulseServo"][0].samples == trace.judged.sum()
    assert fit.holdout.total()["PulseServo"] < 1.5e-3
