"""What a fit says of itself: exact logs, intervals that a missing law would move, searches, traces that run again."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.digital_servos import ON_BUS, PULSED, digital_log, off
from identification.synthetic_logs import TRUTH
from reference import rig_draws as draws
from reference.rig_defects import with_defect
from reference.rig_fits import fitted
from servotwin.identification import identify
from servotwin.identification.fitting.fit import Start

PLAIN = {"starts": 1, "compare_with": (), "holdout": 0}


def steps(model, unit, middle, reach, hold=25):
    """Return logs without noise of a servo under steps."""
    rng, time, logs = np.random.default_rng(0), np.arange(0.0, 2.0, 0.02), []
    for k in range(3):
        command = middle + np.repeat(rng.uniform(-reach, reach, 1 + len(time) // hold), hold)[:len(time)]
        made = st.simulate(model, st.signals.samples(time, command, unit=unit), duration=float(time[-1]),
                           output_times=time)
        said = 1e-6 * command if unit == "us" else np.radians(command)
        logs.append(st.Log(name=str(k), time=time, command=said, measured={"output_angle": made["output_angle"]},
                           command_kind="pulse_width" if unit == "us" else "angle"))
    return logs


@pytest.mark.long(but="BoundedServo-deg-60.0-30.0-1.2")
@pytest.mark.parametrize(("model", "unit", "middle", "reach", "off"), [
    (st.BoundedServo, "deg", 60.0, 30.0, 1.0), (st.BoundedServo, "deg", 60.0, 30.0, 1.2),
    (st.PulseServo, "us", 1500.0, 300.0, 1.2)])
def test_logs_without_noise_end_exact(model, unit, middle, reach, off):
    """It was a division by zero where the file is right, and "noise of 0.011 mrad" where it is not."""
    logs = steps(model(TRUTH), unit, middle, reach)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = identify(logs, TRUTH.replace({"motor.rotor_inertia": off * TRUTH.get("motor.rotor_inertia")}), model,
                       free=["output_inertia"], priors=None, **PLAIN)
    assert fit.verdict.holds
    assert fit.verdict.sentence.startswith("exact: ")
    assert fit.verdict.causes == ()


@pytest.mark.long
@pytest.mark.parametrize("servo", [PULSED, ON_BUS], ids=["pulses", "bus"])
@pytest.mark.parametrize("nuisance", [None, ("delay", "control_phase", "angle_offset")], ids=["usual", "ticks"])
def test_traces_of_a_digital_servo_run_again(servo, nuisance):
    gains = {} if servo is PULSED else {"gain": 2.0}
    logs = [digital_log(servo, motion, seed=k, phase=0.3, delay=0.013, **(gains if k else {}))
            for k, motion in enumerate(("step", "prbs"))]
    fit = identify(logs, off(servo, {"motor.rotor_inertia": 1.2}), free=["output_inertia"], intervals=False,
                   nuisance=nuisance, **PLAIN)
    for trace in fit.traces:
        times = trace.time - trace.log.start - trace.delay
        again = st.simulate(type(fit.model)(fit.servo.replace(trace.parameters)), trace.command, load=trace.log.load,
                            duration=float(times[-1]), output_times=np.maximum(times, 0.0), initial=trace.initial)
        np.testing.assert_allclose((again["output_angle"] + trace.offset)[times >= 0.0],
                                   trace.simulated[times >= 0.0], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_intervals_are_said_not_to_hold_where_a_simulation_says_so():
    """The true values lie up to 5 half widths off here, and the fit knows which law would do that."""
    found = fitted(draws.random_truth(30), with_defect(draws.random_truth(30), "load friction", 0.2), starts=1)
    widths, why = found.verdict.moved["output_inertia"]
    assert widths > 1.0
    assert why == "load friction"
    assert "would move" in found.verdict.sentence
    blind = fitted(draws.random_truth(30), with_defect(draws.random_truth(30), "load friction", 0.2), starts=1,
                   diagnose=False)
    assert blind.verdict.moved == {}
    assert "was not simulated" in blind.verdict.sentence


def test_searches_say_whether_they_are_bad(fit):
    alone = (Start(10.0, True), Start(30.0, True), Start(40.0, True))
    good = replace(fit, starts=alone)
    bad = replace(good, verdict=replace(fit.verdict, holds=False))
    assert good.searches[0] == 1
    assert "no harm, for what is left is noise" in good.searches[1]
    assert "perhaps bad" in bad.searches[1]
    assert "given up" in replace(bad, starts=(Start(10.0, True), Start(30.0, False))).searches[1]
    assert replace(bad, starts=(Start(10.0, True), Start(10.05, True))).searches[0] == 2
