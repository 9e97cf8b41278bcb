"""What is wrong with logs, seen without a fit; and that nothing is seen where nothing is wrong."""

from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from identification.synthetic_logs import ENCODER, MIDDLE, TRUTH, noisy, run
from reference import rig_catalog
from reference.rig_draws import CONDITIONS, file_of, random_truth, runs
from reference.rig_logs import log_of, servo_of
from servotwin.errors import InputError
from servotwin.identification import findings, identify, validate
from servotwin.identification.fitting.checks import MENDED, mended
from servotwin.identification.fitting.suspicions.look import beat_of, look, rough_noise

MODEL = st.PulseServo(TRUTH)
MOTIONS = ("step", "prbs", "triangle")


@pytest.fixture(scope="module")
def logs():
    return [noisy(run(TRUTH, motion, seed=k, kind="pulse_width", delay=0.03, duration=3.0), 1e-3, seed=k)
            for k, motion in enumerate(MOTIONS)]


def with_angle(log, change):
    return replace(log, measured={"output_angle": change(log.measured["output_angle"])})


def seen(logs, model=MODEL):
    return {(one.kind, one.log) for one in findings(logs, model)}


# ------------------------------------------------------------------------------------------------ nothing is wrong

def test_nothing_is_found_on_logs_of_clean_benches():
    """The independent bench, each condition once: noise, counts, jitter and clocks of their own are no defects."""
    for seed, (condition, taking) in enumerate(CONDITIONS.items(), 900):
        truth = random_truth(seed)
        one, = runs(truth, taking, duration=2.0, motions=(("prbs", "steps", "triangle")[seed % 3],))
        log = log_of(one.said, one.load, condition)
        assert findings([log], st.PulseServo(servo_of(file_of(truth)))) == (), condition


def test_nothing_is_found_on_healthy_logs_of_the_catalog():
    """Servos that begin to move late under slow commands, as friction and a soft loop have it."""
    for seed in (8, 18):
        this = rig_catalog.bench("futaba-s3003", seed)
        assert findings(rig_catalog.DEFECTS["none"](this), st.PulseServo(this.file)) == (), seed


@pytest.mark.long
def test_nothing_is_found_on_outliers_or_counts(logs):
    rng = np.random.default_rng(4)
    for share in (0.05, 0.1):
        off = [np.where(rng.random(len(log)) < share, rng.choice([-1.0, 1.0], len(log)), 0.0) for log in logs]
        spoilt = [replace(log, measured={"output_angle": log.measured["output_angle"] + e})
                  for log, e in zip(logs, off, strict=True)]
        assert not seen(spoilt), share
    assert not seen([noisy(log, 0.0, count=ENCODER) for log in logs])


def test_measured_logs_show_the_events_that_are_known(data_folder):
    """Miuzei's runs 51 and 70 hold a command that was never followed and a drop (their SOURCE.md); 31 another."""
    servo = TRUTH.replace({  # 135 degrees for a millisecond, and 1.5 ms at 0, as their SOURCE.md says
        "potentiometer.feedback_gain": 0.85 * 4.0 / 3.0 / np.pi, "potentiometer.feedback_offset": 0.85 * 1.5,
        "electronics.one_shot_slope": 1.0 / 850.0, "electronics.one_shot_offset": 0.0,
        "stops.lower_angle": None, "stops.upper_angle": None})
    found = findings([log for log in st.read_logs(data_folder / "miuzei_25kg") if log.motion in ("prbs", "triangle")],
                     st.PulseServo(servo))
    assert {(one.kind, one.log) for one in found} == {("not followed", f"{k} {motion}") for k, motion in (
        ("031", "prbs"), ("051", "prbs"), ("070", "triangle"))}


# ------------------------------------------------------------------------------------------------- what is found

@pytest.mark.parametrize(("change", "constant"), [(lambda q: -q, 0.0), (lambda q: np.pi - q, 0.0),
                                                  (lambda q: 3.0 - q, None)], ids=["about 0", "about 90", "anywhere"])
def test_a_turned_sign_of_one_log_and_of_all(logs, change, constant):
    one = [with_angle(logs[0], change), *logs[1:]]
    assert seen(one) == {("sign", logs[0].name)}
    right, found = mended(one, MODEL, ("sign",))
    assert [f.kind for f in found] == ["sign"]
    gap = right[0].measured["output_angle"] - logs[0].measured["output_angle"]
    assert np.ptp(gap) < 1e-12
    assert abs(gap[0]) < 0.05  # beside its commands, as the others are
    assert seen([with_angle(log, change) for log in logs]) == {("sign", log.name) for log in logs}


@pytest.mark.parametrize(("modulus", "edge"), [(2.0 * np.pi, MIDDLE), (1.2, MIDDLE - 0.6), (2.0 * np.pi, MIDDLE + 0.4)])
def test_an_angle_that_wraps(logs, modulus, edge):
    wrapped = [with_angle(log, lambda q: np.mod(q - edge, modulus) + edge) for log in logs]
    found = mended(wrapped, MODEL, ("wrap",))
    for log, right in zip(logs, found.logs, strict=True):
        assert right.measured["output_angle"] == pytest.approx(log.measured["output_angle"], abs=0.02)
    assert {one.kind for one in found.findings} == {"wrap"}


def test_a_log_that_lies_a_turn_beside_the_others(logs):
    some = [*logs[:2], with_angle(logs[2], lambda q: q - 4.0 * np.pi)]
    found, = findings(some, MODEL)
    assert (found.kind, found.log) == ("wrap", logs[2].name)
    assert "2 whole turns" in found.sentence
    assert found.mended.measured["output_angle"] == pytest.approx(logs[2].measured["output_angle"])


def wrong_stamps(log, rng, share, pairs):
    time = log.time.copy()
    for k in rng.choice(np.arange(2, len(time) - 3), round(share * len(time)), replace=False):
        time[k:k + 1 + pairs] += rng.uniform(0.3, 0.8) * 0.02 * rng.choice([-1.0, 1.0])
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(time)) > 0.0])
    return replace(log, time=time[keep], command=log.command[keep],
                   measured={"output_angle": log.measured["output_angle"][keep]}), log.time[keep]


@pytest.mark.parametrize(("share", "pairs"), [(0.05, False), (0.03, True)], ids=["single", "pairs"])
def test_wrong_stamps_are_put_on_the_beat(logs, share, pairs):
    made = [wrong_stamps(log, np.random.default_rng(k), share, pairs) for k, log in enumerate(logs)]
    right, found = mended([log for log, _ in made], MODEL, ("stamps",))
    assert {one.kind for one in found} == {"stamps"}
    assert len(found) >= 2
    for log, (_, true) in zip(right, made, strict=True):
        if log.name in {one.log for one in found}:
            assert np.abs(log.time - true).max() < 1e-6


def test_samples_that_were_late_are_left_as_they_are():
    """The same stamps, but the shaft was seen at these times: the angles say so."""
    even = 0.02 * np.arange(150)
    rng = np.random.default_rng(2)
    late = even + np.where(rng.random(150) < 0.05, 0.012, 0.0)
    log = noisy(run(TRUTH, "prbs", time=late, kind="pulse_width", delay=0.03), 1e-3)
    assert beat_of(log.time).off.any()
    assert not seen([log])


def test_rows_that_are_missing_where_the_command_changed(logs):
    keep = np.ones(len(logs[1]), np.bool_)
    keep[[20, 33, 34, 70, 100]] = False  # the command changes at 100
    log = replace(logs[1], time=logs[1].time[keep], command=logs[1].command[keep],
                  measured={"output_angle": logs[1].measured["output_angle"][keep]})
    found, = findings([log], MODEL)
    assert found.kind == "rows"
    lost = np.flatnonzero(np.diff(log.time) > 0.03)
    changed = [k for k in lost if log.command[k] != log.command[k + 1]]
    assert len(found.mended.left_out) <= len(changed)
    for k in changed:
        assert not found.mended.used("output_angle")[k + 1]
    smooth = replace(logs[2], time=logs[2].time[keep], command=logs[2].command[keep],
                     measured={"output_angle": logs[2].measured["output_angle"][keep]})
    assert not seen([smooth])  # a triangle's next sample says where it was


@pytest.mark.long
@pytest.mark.parametrize("factor", [2.0, 3.0, 180.0 / np.pi])
def test_another_scale(factor):
    log = noisy(run(TRUTH, "step", kind="pulse_width", reach=0.4, middle=0.6, duration=3.0), 1e-3)
    found, *_ = findings([with_angle(log, lambda q: factor * q)], MODEL)
    assert found.kind == "span"
    assert found.mended.measured["output_angle"] == pytest.approx(log.measured["output_angle"], abs=1e-9)


def test_commands_that_the_shaft_did_not_follow(logs):
    """It stood for 0.8 s; then what was measured goes on as it did."""
    log = logs[0]
    still = (log.time >= 1.0) & (log.time < 2.2)
    angle = np.where(still, log.measured["output_angle"][50], log.measured["output_angle"])
    found, = findings([replace(log, measured={"output_angle": angle})], MODEL)
    assert found.kind == "not followed"
    out = found.mended.left_out
    assert any(1.0 < start < 1.6 and 2.1 < stop < 2.5 for start, stop in out)


def test_what_follows_is_left_out_until_the_shaft_is_back_where_it_would_be():
    """Pulses are lost for 0.2 s. Under commands that keep the drive full, the shaft stays as far off as it was then."""
    time = np.arange(0.0, 4.0, 0.02)
    width = 1.5e-3 + 4e-4 * np.where(np.random.default_rng(3).random(40).repeat(5) < 0.5, -1.0, 1.0)
    width[150:] = 1.5e-3  # it comes to rest
    here, lost = (st.signals.samples(time, w, unit="s") for w in (width, np.where((time >= 1.4) & (time < 1.6), np.nan,
                                                                                   width)))
    followed, other = (st.simulate(MODEL, signal, duration=float(time[-1]), output_times=time)["output_angle"]
                       for signal in (here, lost))
    apart = np.abs(other - followed)
    assert apart[(time > 1.7) & (time < 2.9)].max() > 0.3
    log = noisy(st.Log(name="lost", time=time, command=width, command_kind="pulse_width",
                       measured={"output_angle": other}), 1e-3)
    found, = findings([log], MODEL)
    assert found.kind == "not followed"
    used = found.mended.used("output_angle")
    assert apart[used].max() < 0.05
    assert used[time > 3.5].any()


def test_pulses_that_the_chip_refuses(logs):
    model = st.PulseServo(TRUTH.replace({"electronics.pulse_width_max": 1.9e-3}))
    found = [one for one in findings([logs[0]], model) if one.kind == "pulses"]
    assert len(found) == 1
    assert found[0].mended is None
    assert "0.0019 s" in found[0].sentence


# ------------------------------------------------------------------------------------------------- in fits

@pytest.mark.long
def test_a_fit_says_it_first_and_mends_it_on_request(logs):
    spoilt = [logs[0], with_angle(logs[1], lambda q: -q)]
    options = {"free": ["output_inertia"], "priors": None, "starts": 1, "compare_with": (), "holdout": 0,
               "intervals": False}
    fit = identify(spoilt, TRUTH, mend=("sign",), **options)
    assert fit.warnings[0].startswith("mended: log 'prbs 1': the angle turns against the command")
    assert fit.servo.fit["mended"] == ["sign"]
    unasked = identify(spoilt, TRUTH, **options)
    assert unasked.warnings == fit.warnings
    assert unasked.estimates == fit.estimates
    assert fit.training.total()["PulseServo"] < 2e-3
    plain = identify(logs[:2], TRUTH, **options)
    assert plain.warnings == ()
    assert "mended" not in plain.servo.fit
    assert fit.servo.fit["data"] != plain.servo.fit["data"]  # of what was given
    found = validate([with_angle(logs[1], lambda q: np.pi - q)], TRUTH)
    assert found.warnings[0].startswith("log 'prbs 1'")


def test_an_error_names_what_was_noticed(logs):
    with pytest.raises(InputError, match=r"between the stops.*turns against the command"):
        validate([with_angle(logs[0], lambda q: -q)], TRUTH)


def test_unknown_kinds_are_refused(logs):
    for kinds in (("sing",), ("pulses",), "wrap", ("wrap", "wrap"), None):
        with pytest.raises(InputError, match="mend"):
            identify(logs, TRUTH, mend=kinds)
    assert "pulses" not in MENDED


# ------------------------------------------------------------------------------------------------- pieces

@pytest.mark.parametrize("period", [0.005, 0.016384, 0.02])
@pytest.mark.parametrize("step", [0.0, 1e-3], ids=["exact", "whole ms"])
def test_a_beat_with_rows_missing(period, step):
    number = np.delete(np.arange(400), [50, 51, 200, 300])
    time = 5.0 + period * number
    beat = beat_of(step * np.round(time / step) if step else time)
    if step < 0.1 * period:
        assert beat.period == pytest.approx(period, rel=1e-3)
        assert beat.number.tolist() == number.tolist()
        assert not beat.off.any()


def test_random_times_have_no_beat():
    rng = np.random.default_rng(0)
    assert beat_of(np.cumsum(rng.exponential(0.02, 300))) is None
    assert beat_of(0.02 * np.arange(10)) is None


def test_noise_needs_no_model():
    """A moving signal, white noise: its standard deviation; counts: that of a step."""
    t = np.arange(400) * 0.02
    rng = np.random.default_rng(1)
    assert rough_noise(np.sin(3.0 * t) + 2e-3 * rng.standard_normal(400)) == pytest.approx(2e-3, rel=0.15)
    assert rough_noise(ENCODER * np.round(np.sin(3.0 * t) / ENCODER)) >= 0.99 * ENCODER / np.sqrt(12.0)


def test_a_look_at_a_potentiometer_tap(logs):
    p, b = TRUTH.potentiometer.feedback_gain, TRUTH.potentiometer.feedback_offset
    angle = logs[0].measured["output_angle"]
    log = replace(logs[0], measured={"feedback_voltage": p * angle + b})
    assert look(log, MODEL).angle == pytest.approx(angle)
    turned = replace(log, measured={"feedback_voltage": 2.0 - (p * angle + b)})
    found, = findings([turned], MODEL)
    assert found.kind == "sign"
    assert np.ptp(found.mended.measured["feedback_voltage"] - log.measured["feedback_voltage"]) < 1e-9


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_short_logs_of_few_steps_are_followed(noise):
    """The habit of a servo that moves three times in a log is unsure; where the shaft arrives, it followed."""
    blamed = []
    for seed in (13, 17, 44, 59, 60, 81, 119, 161, 174):
        rng, time = np.random.default_rng(seed), np.arange(0.0, 2.0, 0.02)
        width = 1500.0 + np.repeat(rng.uniform(-300.0, 300.0, 5), 25)[:len(time)]
        made = st.simulate(st.PulseServo(TRUTH), st.signals.samples(time, width, unit="us"), duration=float(time[-1]),
                           output_times=time)
        log = st.Log(name=str(seed), time=made.time, command=1e-6 * width, command_kind="pulse_width",
                     measured={"output_angle": made["output_angle"] + noise * rng.standard_normal(len(time))})
        blamed += [one for one in findings([log], MODEL) if one.kind == "not followed"]
    assert blamed == []
