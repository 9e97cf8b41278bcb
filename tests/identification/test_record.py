"""A fitted servo in its file: numbers with origin and spread, and the record of the fit."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.identification import LUMPED, Space, identify
from servotwin.identification.fitting.fit import data_hash
from servotwin.parameters import Servo

DISC = st.loads.Inertia(1.06e-2) + st.loads.Constant(0.3)  # a known torque: the scale of all torques
FREE = ["motor.armature_resistance", "output_torque_constant", "output_coulomb_torque", "load.inertia"]


@pytest.fixture(scope="module")
def logs():
    return [noisy(run(TRUTH, motion, seed=k, load=DISC, delay=0.05, duration=1.5, kind="pulse_width",
                      conditions={"gain": 100.0 * (k // 2), "bench": "left \"one\" [°]"}, name=f"log {k}",
                      parameters={"supply.open_circuit_voltage": 6.0}), 1e-3, seed=k)
            for k, motion in enumerate(("step", "prbs", "step", "triangle"))]


@pytest.fixture(scope="module")
def fit(logs):
    return identify(logs, TRUTH, free=FREE, priors=None, starts=1, compare_with=("slew",), holdout=["log 2"],
                    bounds={"load.inertia": (0.011, 0.05)})


@pytest.mark.long
def test_numbers_say_where_they_come_from(fit):
    for name in ("motor.armature_resistance", "motor.torque_constant", "motor.back_emf_constant",
                 "friction.coulomb_torque_forward", "friction.coulomb_torque_backward"):
        q = fit.servo.source(name)
        assert q.origin == "identified"
        assert "[fit]" in q.source
        assert q.lower < q.value < q.upper
    assert "95 % interval" in fit.servo.source("motor.armature_resistance").source
    assert "output_torque_constant" in fit.servo.source("motor.torque_constant").source
    before = TRUTH.source("electronics.stretcher_gain")
    assert fit.servo.source("electronics.stretcher_gain") == before  # what was not searched stays as it was


def test_ranges_are_the_intervals(fit):
    lower, upper, _ = fit.intervals()["motor.armature_resistance"]
    q = fit.servo.source("motor.armature_resistance")
    assert (q.lower, q.upper) == pytest.approx((lower, upper), rel=1e-12)
    lower, upper, _ = fit.intervals()["output_torque_constant"]
    q = fit.servo.source("motor.back_emf_constant")
    n = TRUTH.gear.gear_reduction
    assert (q.lower * n, q.upper * n) == pytest.approx((lower, upper), rel=1e-12)


def test_the_record(fit, logs):
    record = fit.servo.fit
    assert record["data"] == f"sha256:{data_hash(logs)}"
    assert (record["logs"], record["fitted_logs"]) == (4, 3)
    assert record["model"] == "PulseServo"
    assert record["version"] == st.__version__
    assert record["free"] == FREE
    assert record["bounds"]["load.inertia"] == [0.011, 0.05]
    assert record["at_bound"] == ["load.inertia"]
    assert record["load"]["load.inertia"] == pytest.approx(0.011)
    assert record["nuisance"]["delay"] == fit.estimates["delay"]
    assert record["noise"]["output_angle"] == fit.noise["output_angle"]
    assert record["conditions"]["gain"] == [0.0, 100.0]
    assert record["conditions"]["supply.open_circuit_voltage"] == 6.0
    assert record["conditions"]["motions"] == {"step": 2, "prbs": 1, "triangle": 1}
    assert record["holdout_error"]["step"]["PulseServo"] == fit.holdout.total()["PulseServo"]
    assert "interrupted" not in record


def test_a_servo_file_keeps_all_of_it(fit, tmp_path):
    path = tmp_path / "fitted.toml"
    fit.servo.save(path)
    again = st.load_servo(path)
    assert _plain(again.fit) == _plain(fit.servo.fit)
    for name in ("motor.armature_resistance", "motor.torque_constant", "friction.coulomb_torque_backward"):
        a, b = fit.servo.source(name), again.source(name)
        assert again.get(name) == pytest.approx(fit.servo.get(name), rel=1e-5)
        assert (b.origin, b.source) == (a.origin, a.source)
        assert (b.lower, b.upper) == pytest.approx((a.lower, a.upper), rel=1e-4)
        assert b.lower <= again.get(name) <= b.upper
    again.save(tmp_path / "twice.toml")
    assert (tmp_path / "twice.toml").read_text() == path.read_text()


def _plain(value):
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def test_the_fitted_servo_is_the_prior_of_the_next_fit(fit, logs):
    """Its intervals become beliefs: half the width is 1.96 standard deviations."""
    space = Space(st.PulseServo(fit.servo), ["motor.armature_resistance"], priors="servo")
    lower, upper, _ = fit.intervals()["motor.armature_resistance"]
    assert space.parameters[0].prior == pytest.approx((fit.estimates["motor.armature_resistance"],
                                                       (upper - lower) / 3.92), rel=1e-4)


@pytest.mark.long
def test_what_is_not_determined_keeps_origin_and_spread(logs):
    """Its value goes with the others; what was known of it is what is still known of it."""
    found = identify(logs, TRUTH, free=["gear.gear_reduction", "motor.torque_constant", "motor.back_emf_constant",
                                        "motor.rotor_inertia", "output_coulomb_torque"], priors=None, starts=1,
                     compare_with=(), holdout=0)
    assert "gear.gear_reduction" in found.undetermined
    for name in found.undetermined:
        for member in LUMPED.get(name, ((name,),))[0]:
            q, before = found.servo.source(member), TRUTH.source(member)
            assert q.origin == before.origin
            assert before.source in q.source
            assert q.lower == pytest.approx(min(before.lower, q.value))
            assert q.upper == pytest.approx(max(before.upper, q.value))
            assert q.value == before.value or "do not determine" in q.source
    assert found.servo.fit["undetermined"] == [str(item) for item in found.unidentifiable]


def test_the_hash_is_that_of_what_logs_say(logs):
    first = data_hash(logs)
    assert data_hash([replace(log) for log in logs]) == first
    log = logs[0]
    angle = log.measured["output_angle"].copy()
    angle[3] = np.nextafter(angle[3], math.inf)
    for change in ({"measured": {"output_angle": angle}}, {"left_out": ((0.1, 0.2),)}, {"load": st.loads.Load()},
                   {"command": log.command + 1e-9}, {"torque_on": np.arange(len(log)) > 3}, {"name": "other"},
                   {"command_hold": "linear"}, {"parameters": {"supply.open_circuit_voltage": 6.1}},
                   {"time": log.time + 1e-6}):
        assert data_hash([replace(log, **change), *logs[1:]]) != first
    assert data_hash(logs[::-1]) != first


def test_a_servo_without_a_fit_has_no_record():
    assert not TRUTH.fit
    assert isinstance(TRUTH, Servo)
