"""Bad input to a fit: one clear line each, before anything runs; and what a reader is told."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import TRUTH, noisy, run
from servotwin.errors import InputError, ServotwinError
from servotwin.identification import identify

FREE = ["output_inertia", "output_coulomb_torque"]


@pytest.fixture(scope="module")
def logs():
    return [noisy(run(TRUTH, motion, seed=k, duration=1.0, kind="pulse_width", delay=0.05), 1e-3, seed=k)
            for k, motion in enumerate(("step", "prbs"))]


def refused(words, logs, servo=TRUTH, **more):
    """Check that a fit is refused in one line, and at once."""
    begun = []
    options = {"free": FREE, "priors": None, "starts": 1, "compare_with": (), "holdout": 0,
               "progress": lambda *told: begun.append(told), "servo": servo, **more}
    with pytest.raises(ServotwinError, match=words) as caught:
        identify(logs, **options)
    assert "\n" not in str(caught.value)
    assert begun == []  # an afternoon's fit must not end with a typing error
    return str(caught.value)


# -------------------------------------------------------------------------------------------- logs

def with_angle(log, angle, **more):
    return replace(log, measured={"output_angle": angle}, **more)


def test_no_logs(logs):
    for none in ([], None, 5, [logs[0], "run.csv"]):
        refused("at least one Log", none)
    refused("no such file", "no/such/folder")
    refused("2 logs of this name", [logs[0], logs[0]])


def test_a_constant_log(logs):
    still = with_angle(logs[0], np.full(len(logs[0]), 0.3))
    assert "step 0" in refused("never changes", [still])
    refused("all 2 logs", [still, replace(still, name="other")])


def test_noise_under_one_command_is_constant_too(logs):
    rng = np.random.default_rng(0)
    still = with_angle(logs[0], 0.3 + 1e-3 * rng.normal(size=len(logs[0])),
                       command=np.full(len(logs[0]), logs[0].command[0]))
    refused("never changes", [still])


def test_only_constant_logs_left_to_fit(logs):
    still = with_angle(logs[0], np.full(len(logs[0]), 0.3), name="still")
    refused("moves", [still, logs[1]], holdout=[logs[1].name])


def test_too_few_samples(logs):
    """Three samples make a log, but no fit of four numbers."""
    few = logs[0].part(0.4, 0.46)
    assert len(few) == 3
    refused("sample|changes", [few])
    refused("sample|value|changes", [few], free=FREE, nuisance=())


def test_fewer_values_than_numbers(logs):
    angle = logs[0].measured["output_angle"].copy()
    keep = np.zeros(len(angle), np.bool_)
    keep[[0, 20, 40]] = True
    refused("sample|value", [with_angle(logs[0], np.where(keep, angle, np.nan))])


@pytest.mark.parametrize("factor", [57.3 / 2.0, 15.0])
def test_a_shaft_faster_than_the_servo_can_be(logs, factor):
    fast = with_angle(logs[0], factor * (logs[0].measured["output_angle"] - 1.57))
    text = refused("contradicts the servo", [fast])
    assert "unit" in text


@pytest.mark.long
def test_a_log_of_a_servo_that_is_much_slower_contradicts_the_sheet():
    """A sheet's speed and torque with narrow spread, and logs of another servo: a line says so."""
    slow = TRUTH.replace({"motor.back_emf_constant": 3.0 * TRUTH.motor.back_emf_constant,
                          "motor.torque_constant": 3.0 * TRUTH.motor.torque_constant})
    logs = [noisy(run(slow, motion, seed=k, duration=1.5), 1e-3, seed=k) for k, motion in enumerate(("step", "prbs"))]
    fit = identify(logs, TRUTH, free=["output_torque_constant", "motor.armature_resistance"], priors="servo", starts=1,
                   compare_with=(), holdout=0)
    assert any("contradict the servo file: output_torque_constant" in line for line in fit.warnings)
    assert all("\n" not in line for line in fit.warnings)


@pytest.mark.long
def test_a_good_servo_is_not_contradicted(logs):
    fit = identify(logs, TRUTH, free=FREE, priors="servo", starts=1, compare_with=(), holdout=0)
    assert fit.warnings == ()


def test_a_log_that_starts_where_the_servo_cannot_be(logs):
    off = with_angle(logs[0], logs[0].measured["output_angle"] + 3.0)
    refused("stops", [off], nuisance=("delay", "initial_state"))


def test_the_zero_of_an_encoder_may_be_anywhere(logs):
    """3 rad off: the search begins where the commands are followed in the middle."""
    off = with_angle(logs[0], logs[0].measured["output_angle"] + 3.0)
    fit = identify([off], TRUTH, free=FREE, priors=None, starts=1, compare_with=(), holdout=0)
    assert fit.estimates["angle_offset"] == pytest.approx(3.0, abs=0.01)
    assert fit.training.total()["PulseServo"] < 0.01


@pytest.mark.long
def test_no_torque_at_all(logs):
    """Nothing is commanded: nothing can be said, and nothing is divided by it."""
    off = replace(logs[0], torque_on=np.zeros(len(logs[0]), np.bool_))
    refused("torque|counts", [off], model=st.BoundedServo)
    fit = identify([off], TRUTH, free=FREE, nuisance=(), priors=None, starts=1, compare_with=(), holdout=0)
    assert set(fit.undetermined) == set(FREE)


def test_the_angle_behind_the_shaft_waits_for_a_model_that_has_it(logs):
    more = [replace(log, measured={**log.measured, "load_angle": log.measured["output_angle"]}) for log in logs[:2]]
    refused("'load_angle, which PulseServo does not have', allowed: output_angle$", more,
            sensors=("output_angle", "load_angle"))
    fits = [identify(some, TRUTH, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, intervals=False)
            for some in (more, logs[:2])]
    assert dict(fits[0].estimates) == dict(fits[1].estimates)


# ------------------------------------------------------------------------- what logs can hardly tell

def settled(time):
    """Return a log that looks at a servo only when it has long arrived."""
    command = 1.5e-3 + 2e-4 * np.where(np.arange(len(time)) % 2, 1.0, -1.0)
    angle = np.interp(command, [1.3e-3, 1.7e-3], [1.57 - 0.35, 1.57 + 0.35])
    rng = np.random.default_rng(0)
    return st.Log(name="settled", time=time, command=command, command_kind="pulse_width",
                  measured={"output_angle": np.roll(angle, 1) + 1e-3 * rng.normal(size=len(time))})


def test_numbers_that_the_logs_can_hardly_tell_are_named_before_the_search(logs):
    """Samples two seconds apart tell nothing of inertia, and a prior of one per cent more than noise does."""
    fit = identify([settled(2.0 * np.arange(12))], TRUTH, free=["output_inertia", "electronics.deadband"], priors=None,
                   starts=1, compare_with=(), holdout=0, intervals=False, diagnose=False)
    found = {one.name: one for one in fit.foreseen}
    assert "samples are 2e+03 ms apart" in found["output_inertia"].reason
    assert str(found["output_inertia"]) in fit.warnings
    told = identify(logs, TRUTH, free=FREE, priors={"output_inertia": (5e-3, 1e-7)}, starts=1, compare_with=(),
                    holdout=0, intervals=False, diagnose=False)
    assert [one.name for one in told.foreseen] == ["output_inertia"]
    assert identify(logs, TRUTH, free=FREE, priors=None, starts=1, compare_with=(), holdout=0, intervals=False,
                    diagnose=False).foreseen == ()


# --------------------------------------------------------------------------------------- arguments

@pytest.mark.parametrize(("more", "words"), [
    ({"free": []}, "free"), ({"free": "output_inertia"}, "a list"), ({"free": ["output_inertias"]}, "did you mean"),
    ({"free": ["electronics.bridge_gain"]}, "does not read"), ({"free": ["output_inertia", "motor.rotor_inertia"]},
                                                               "both set"),
    ({"nuisance": ("dleay",)}, "nuisance"), ({"nuisance": "delay"}, "nuisance.*a list"),
    ({"nuisance": ("delay", "delay")}, "nuisance"), ({"nuisance": 5}, "nuisance"),
    ({"sensors": ("bus_current",)}, "sensors"), ({"sensors": ("supply_current",)}, "sensors"),
    ({"sensors": ()}, "output_angle or feedback_voltage"), ({"sensors": "output_angle"}, "sensors.*a list"),
    ({"priors": "sevro"}, "priors"), ({"priors": {"output_inertia": (-1.0, 1.0)}}, "prior of output_inertia"),
    ({"priors": {"motor.armature_resistance": (3.0, 1.0)}}, "not free"),
    ({"bounds": {"output_inertia": (2.0, 1.0)}}, "bounds of output_inertia"), ({"bounds": [1.0]}, "bounds"),
    ({"starts": 0}, "starts"), ({"starts": 1.5}, "starts"), ({"starts": None}, "starts"),
    ({"holdout": 1.0}, "holdout"), ({"holdout": ["step 0", "prbs 1"]}, "all logs"), ({"holdout": "step 0"}, "holdout"),
    ({"loss": "cauchy"}, "huber"), ({"loss": None}, "loss"),
    ({"level": 0.0}, "level"), ({"level": 1.0}, "level"), ({"level": 95}, "level"), ({"level": float("nan")}, "level"),
    ({"level": "high"}, "level"),
    ({"noise": {"output_angle": 0.0}}, "noise"), ({"noise": {"output_angle": -1e-3}}, "noise"),
    ({"noise": {"output_angle": float("nan")}}, "noise"), ({"noise": {"angle": 1e-3}}, "noise"),
    ({"noise": 3.0}, "noise"),
    ({"diagnose": "yes"}, "diagnose"), ({"diagnose": None}, "diagnose"), ({"seed": -1}, "seed"),
    ({"seed": 1.5}, "seed"), ({"seed": "a"}, "seed"),
    ({"compare_with": ("M2",)}, "compare_with"), ({"compare_with": "slew"}, "compare_with"),
    ({"compare_with": 5}, "compare_with"), ({"progress": 3}, "progress"),
    ({"model": st.AveragedServo}, "model of a fit"), ({"model": "pulse"}, "model of a fit"),
    ({"model": st.PulseServo(TRUTH)}, "model of a fit"), ({"servo": "hitec"}, "servo of a fit"),
], ids=lambda value: next(iter(value)) if isinstance(value, dict) else "")
def test_arguments_that_make_no_sense(logs, more, words):
    refused(words, logs, **more)


def test_what_a_log_says_is_not_searched(logs):
    said = replace(logs[0], parameters={"electronics.stretcher_gain": 60.0})
    refused("searched, but log", [said], free=["electronics.stretcher_gain"])
    refused("searched, but log", [replace(logs[0], parameters={"motor.rotor_inertia": 6e-8})])


def test_loads_that_differ_are_not_searched(logs):
    other = replace(logs[1], load=st.loads.Inertia(1e-3))
    refused("2 different values", [logs[0], other], free=["load.inertia"])
    refused("load without it", [other], free=["load.pendulum.mass"])


@pytest.mark.long
def test_bad_arguments_of_a_fit(logs):
    fit = identify(logs, TRUTH, free=FREE, priors=None, starts=1, compare_with=(), holdout=0)
    for level in (0.0, 1.0, -1.0, 2.0, float("nan")):
        with pytest.raises(InputError, match="level"):
            fit.intervals(level)
    for number in (0, -1, 1.5, True, "3"):
        with pytest.raises(InputError, match="draw"):
            fit.draw(number)
