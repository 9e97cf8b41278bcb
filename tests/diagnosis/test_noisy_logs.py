"""Noisy logs: nothing is found in healthy ones, and a fault where there is one. `benchmarks/diagnosis` draws many."""

import math
from functools import cache

import numpy as np
import pytest

import servotwin as st
from servotwin.diagnosis.symptoms import NO_NOISE, Noise, end_of, holds_of, noise_of
from servotwin.loads import Constant, Inertia, Load

ENCODER, CONVERTER = math.radians(360.0 / 4096), math.radians(300.0 / 1024)  # counts [rad]
PULSE, DIGITAL, BUS = "futaba-s3003", "feetech-ft-2806", "feetech-sts3215-7v4"
STEPS = ((0.3, 40.0), (4.1, -30.0), (8.5, 15.0), (12.2, -20.0), (16.4, 35.0))
SMALL = ((0.3, 4.0), (4.1, -2.0), (8.5, 3.0), (12.2, -4.0), (16.4, 2.0))
LATE = ((0.3, -40.0), (5.45, 45.0), (9.0, -20.0))  # after 6 s still on its way
RAMPS = tuple((0.5 + 0.02 * k, 0.8 * min(k, 50) - 1.2 * max(0, min(k - 150, 50))) for k in range(201))
SINES = tuple((0.5 + 0.02 * k, 25.0 * math.sin(2.0 * math.pi * k / 100.0)) for k in range(301))


def recorded(name, changes, load, moves, begin, end, rate, noise, count):
    """Return what a recorder notes of a servo from begin to end [s]: moves in s and deg, noise in deg, count in rad."""
    model = st.models.default_model(st.load_servo(name).replace(changes))
    middle, (at, to) = st.models.mid_travel(model), np.array(((0.0, 0.0), *moves)).T
    command = st.signals.samples(at, middle + np.radians(to), unit="rad", hold="previous")
    time = np.arange(begin, end, 1.0 / rate)
    run = st.simulate_many(model, [command], duration=end, load=load, output_times=time, seeds=0).raise_if_failed()
    scatter = np.random.default_rng(round(1000.0 * end)).normal(0.0, math.radians(noise), len(time))
    angle = run["output_angle"][0] + scatter
    sent = middle + np.radians(to[np.searchsorted(at, time + 1e-9, side="right") - 1])
    return st.Log(name="noisy", time=time, command=sent, command_kind="angle", load=load,
                  measured={"output_angle": count * np.round(angle / count) if count else angle})


@pytest.mark.parametrize(("name", "moves", "begin", "end", "rate", "noise", "count"), [
    (PULSE, LATE, 0.0, 12.0, 100.0, 0.1, 0.0),
    (BUS, LATE, 0.0, 12.0, 100.0, 0.1, 0.0),
    ("dynamixel-mx-28", LATE, 0.0, 12.0, 100.0, 0.1, 0.0),
    (PULSE, STEPS, 0.0, 16.95, 20.0, 0.4, 0.0),
    (PULSE, STEPS, 0.45, 12.75, 25.0, 0.5, CONVERTER),
    (PULSE, SMALL, 0.0, 20.0, 100.0, 0.4, 0.0),
    (DIGITAL, SMALL, 0.0, 20.0, 100.0, 0.4, 0.0),
    (BUS, SMALL, 0.0, 20.0, 100.0, 0.4, 0.0),
    (PULSE, STEPS[:1], 5.0, 25.0, 30.0, 0.4, 0.0),
    (DIGITAL, STEPS[:1], 0.35, 30.0, 500.0, 0.2, 0.0),
    (DIGITAL, RAMPS, 0.0, 10.0, 100.0, 0.3, CONVERTER),
    (BUS, STEPS, 4.2, 16.95, 1000.0, 0.04, ENCODER),
    (BUS, SINES, 1.0, 20.0, 20.0, 0.3, 0.0),
])
def test_nothing_is_found_in_a_healthy_log(name, moves, begin, end, rate, noise, count):
    log = recorded(name, {}, Load(), moves, begin, end, rate, noise, count)
    found = st.diagnose(st.load_servo(name), log=log)
    assert found.findings == ()
    assert found.log_only == ()
    assert found.looked.seconds == found.looked.whole == log.duration


@pytest.mark.parametrize(("wanted", "name", "changes", "load", "moves", "end", "rate", "noise", "count"), [
    ("buzzes", "hitec-hs-422", {"electronics.stretcher_gain": 2500.0}, Inertia(1e-3), STEPS[:1], 10.0, 100.0, 0.3, 0.0),
    ("sags", "hitec-hs-422", {"supply.internal_resistance": 8.0}, Constant(0.08), STEPS, 15.0, 50.0, 0.3, CONVERTER),
    ("overshoots", "hitec-hs-422", {"electronics.stretcher_gain": 400.0}, Inertia(3e-4), STEPS, 20.0, 200.0, 0.2, 0.0),
    ("does not move", BUS, {f"friction.coulomb_torque_{way}": 0.012 for way in ("forward", "backward")}, Load(), STEPS,
     20.0, 40.0, 0.1, ENCODER),
])
def test_a_fault_is_found_in_its_log(wanted, name, changes, load, moves, end, rate, noise, count):
    log = recorded(name, changes, load, moves, 0.0, end, rate, noise, count)
    assert wanted in st.diagnose(st.load_servo(name), log=log).log_only


@cache
def steps(amplitude, noise, seconds, rate=100.0):
    """Return times, a target that jumps after half of the time, and an angle that is there and swings at 3 Hz [rad]."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    target = np.where(time < 0.5 * seconds, 0.0, 0.5)
    scatter = np.random.default_rng(4).normal(0.0, noise, len(time))
    return time, target, target + amplitude * np.sin(6.0 * math.pi * time) + scatter


@pytest.mark.parametrize(("amplitude", "noise", "found"), [
    (0.0, 0.0, False), (0.0, 0.02, False), (0.0, 0.2, False), (0.0008, 0.0, False), (0.002, 0.0, True),
    (0.05, 0.02, True), (0.02, 0.01, True), (0.0005, 0.02, False),
])
def test_a_swing_is_what_turns_back_by_more_than_noise(amplitude, noise, found):
    time, target, angle = steps(amplitude, noise, 40.0)
    holds = holds_of(time, target, angle, noise_of(angle, [(0, 2000), (2000, 4000)], 0.0))
    assert [hold.swing > 0.0 for hold in holds] == [found, found]


@pytest.mark.parametrize("noise", [0.001, 0.1])
def test_the_noise_is_that_of_the_log_also_beside_a_swing(noise):
    for amplitude in (0.0, 30.0 * noise):
        assert noise_of(steps(amplitude, noise, 40.0)[2], [(0, 2000), (2000, 4000)], 0.0).size == pytest.approx(
            noise, rel=0.1)
    assert noise_of(np.zeros(9), [], 0.0).size == math.inf  # nothing says what is noise


@pytest.mark.parametrize(("speed", "noise", "rests", "doubt"), [
    (0.0, NO_NOISE, True, 0.0),
    (1.0, NO_NOISE, False, 0.6),  # for as long again
    (1e-3, NO_NOISE, True, 0.0),  # 0.03 deg in half a second
    (0.05, Noise(0.02, 0.0, 4.0), True, 4.0 * 0.02 * (2.0 + math.sqrt(12.0) * 0.5 / 0.6) / math.sqrt(61)),
    (1.0, Noise(0.02, 0.0, 4.0), False, 0.6 + 4.0 * 0.02 * 2.0 / math.sqrt(51)),
    (0.05, Noise(0.0, 0.04, 4.0), True, 0.04 * (0.5 + 1.5 * 0.5 / 0.6)),
])
def test_a_shaft_rests_where_its_speed_has_sunk_into_its_noise(speed, noise, rests, doubt):
    time = 0.01 * np.arange(61)
    end = end_of(time, speed * (time - time[-1]), noise)
    assert end.rests is rests
    assert end.angle == pytest.approx(0.0, abs=1e-12)
    assert end.doubt == pytest.approx(doubt, abs=1e-12)


def test_what_is_still_on_its_way_where_its_log_ends_is_said():
    log = recorded(PULSE, {}, Inertia(0.05), STEPS, 0.0, 9.05, 100.0, 0.1, 0.0)
    looked = st.diagnose(st.load_servo(PULSE), log=log).looked
    assert (looked.stretches, looked.rests) == (3, 2)


def test_a_part_of_a_log_is_looked_at():
    log = recorded(PULSE, {}, Load(), STEPS, 0.0, 12.0, 100.0, 0.1, 0.0)
    looked = st.diagnose(st.load_servo(PULSE), log=log, duration=4.0).looked
    assert looked.seconds == pytest.approx(4.0, abs=0.02)
    assert looked.whole == log.duration
    assert looked.stretches == 1
