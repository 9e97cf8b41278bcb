"""Causes that were planted are found, and nothing in healthy servos."""

import math

import numpy as np
import pytest

import servotwin as st
from diagnosis.planted_servos import PLANTED, SOUND, servo_of
from servotwin.diagnosis import CAUSES, SYMPTOMS
from servotwin.diagnosis.causes import Strength, Trials, patient_of, ranked


def names(found):
    return {finding.symptom.name: [cause.cause for cause in finding.causes] for finding in found.findings}


@pytest.mark.slow
def test_planted_causes_come_first_in_at_least_twelve_of_fifteen():
    firsts = []
    for row in PLANTED:
        servo, load = servo_of(row)
        firsts.append(names(st.diagnose(servo, load=load)).get(row.symptom, ["-"])[:1] == [row.cause])
    assert len(firsts) == 15
    assert sum(firsts) >= 12


@pytest.mark.slow
def test_nothing_is_found_in_healthy_servos():
    for row in SOUND:
        servo, load = servo_of(row)
        assert st.diagnose(servo, load=load).findings == (), row.name
    assert len(SOUND) == 10


@pytest.mark.long
def test_a_cure_cures():
    servo = st.load_servo("hitec-hs-422").replace({"supply.internal_resistance": 8.0})
    load = st.loads.Constant(0.08)
    found = {each.symptom.name: each for each in st.diagnose(servo, load=load).findings}["sags"]
    first = found.causes[0]
    assert (first.cause, first.cures) == ("supply", True)
    assert 0.0 < first.needed < 8.0
    cured = servo.replace({"supply.internal_resistance": first.needed})
    assert "sags" not in names(st.diagnose(cured, load=load))


@pytest.mark.long
def test_a_number_that_cannot_be_taken_away_alone_is_no_cause():
    """A program that computes for thirteen of its ticks: with ticks as short as usual there is no such servo."""
    servo = st.load_servo("jx-pdi-6221mg").replace({"firmware.control_period": 4.5e-3, "firmware.compute_delay": 60e-3})
    found = names(st.diagnose(servo))
    assert found
    assert all("frame rate" in causes for causes in found.values())


def test_two_that_cure_only_together_are_a_pair():
    patient = patient_of(st.PulseServo(st.load_servo("hitec-hs-422")), st.loads.Constant(0.3) + st.loads.Inertia(1.0))

    def strength(one):
        return Strength(2.0 if abs(one.load.torque) > 0.1 or one.load.inertia > 0.1 else 0.0, 1.0)

    causes, pair = ranked(Trials(patient, strength))
    assert causes == []
    assert pair is None  # both are of the load

    def crossed(one):
        heavy, slow = abs(one.load.torque) > 0.1, one.model.value("electronics.frame_period") > 0.015
        return Strength(2.0 if heavy or slow else 0.0, 1.0)

    causes, pair = ranked(Trials(patient, crossed))
    assert causes == []
    assert {each.cause for each in pair} == {"load", "frame rate"}


@pytest.mark.long
def test_a_log_that_shows_more_than_the_servo_says_so():
    model = st.PulseServo(st.load_servo("hitec-hs-422"))
    restless = st.PulseServo(model.servo.replace({"electronics.stretcher_gain": 2500.0}))
    run = st.simulate(restless, st.signals.step(-0.5, 0.2, at=0.5, unit="rad"), duration=4.0, output_step=0.01,
                      load=st.loads.Inertia(1e-3))
    log = st.Log(name="run", time=run.time, command=run["command_angle"], command_kind="angle",
                 measured={"output_angle": run["output_angle"]}, load=st.loads.Inertia(1e-3))
    assert st.diagnose(model, log=log).log_only == ("buzzes",)
    both = st.diagnose(restless, log=log).findings[0]
    assert (both.symptom.name, both.log.found, both.causes[0].cause) == ("buzzes", True, "gain")


def test_bad_input_is_refused():
    servo = st.load_servo("hitec-hs-422")
    with pytest.raises(st.errors.InputError):
        st.diagnose(st.DCMotor(servo))
    with pytest.raises(st.errors.InputError):
        st.diagnose(servo, duration=math.nan)


def test_tables_have_the_causes_and_symptoms():
    assert CAUSES == ("deadband", "gain", "frame rate", "play", "friction", "supply", "register", "load")
    assert len(SYMPTOMS) == 6


@pytest.mark.long
def test_noise_of_a_log_is_no_swing():
    model = st.PulseServo(st.load_servo("hitec-hs-422"))
    run = st.simulate(model, st.signals.step(-0.5, 0.2, at=0.5, unit="rad"), duration=3.0, output_step=0.01)
    noise = np.random.default_rng(0).normal(0.0, math.radians(0.3), len(run.time))
    log = st.Log(name="run", time=run.time, command=run["command_angle"], command_kind="angle",
                 measured={"output_angle": run["output_angle"] + noise})
    found = st.diagnose(model, log=log)
    assert found.log_only == ()
    assert found.findings == ()


@pytest.mark.long
def test_what_only_a_wide_deadband_makes_is_a_sag():
    servo = st.load_servo("hitec-hs-422").replace({"electronics.deadband": 70e-6})
    found = names(st.diagnose(servo, load=st.loads.Constant(0.05)))
    assert found["sags"][0] == "deadband"
