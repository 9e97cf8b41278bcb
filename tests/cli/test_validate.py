"""`servotwin validate`: what it says about a servo and logs, and when it fails."""

import json
import math

import numpy as np
import pytest

import servotwin as st
from cli import fit_logs
from servotwin.identification import read_logs
from servotwin.identification.fitting.validate import validate


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return fit_logs.write_logs(tmp_path_factory.mktemp("validate") / "runs")


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    path = tmp_path_factory.mktemp("servo") / "true.toml"
    st.load_servo(fit_logs.SERVO).replace({"motor.rotor_inertia": fit_logs.INERTIA}).save(path)
    return path


def test_the_true_servo_is_off_by_the_noise(cli, folder, truth):
    found = cli("validate", truth, folder, "--model", "bounded", "--json").data
    assert found["errors"]["all"]["BoundedServo"] == pytest.approx(fit_logs.NOISE, rel=0.5)
    assert set(found["errors"]["by"]["motion"]) == {"step", "stairs"}
    assert found["nuisance"] == {}


def test_another_servo_is_further_off(cli, folder, truth):
    ended = cli("validate", fit_logs.SERVO, folder, "--model", "bounded", "--json")
    better = cli("validate", truth, folder, "--model", "bounded", "--json")
    assert ended.data["errors"]["all"]["BoundedServo"] > 5.0 * better.data["errors"]["all"]["BoundedServo"]


def test_what_is_printed(cli, folder, truth):
    lines = cli("validate", truth, folder, "--model", "bounded").out.splitlines()
    assert lines[0] == "Hitec HS-755HB (hitec-hs-755hb), BoundedServo, 4 logs"
    assert any(line.startswith("motion  bounded servo (°)") for line in lines)
    rows = [line.split() for line in lines if line.startswith(("step-", "stairs-"))]
    assert {row[0] for row in rows} == {"step-0", "stairs-1", "step-2", "step-3"}
    assert all(row[3] == row[5] == "°" and 90.0 < float(row[6]) < 100.0 for row in rows)  # fit in per cent


@pytest.mark.long
def test_a_limit_that_is_exceeded_fails(cli, folder):
    words = ["validate", fit_logs.SERVO, folder, "--model", "bounded"]
    assert cli(*words, "--max-error", "20deg").code == 0
    ended = cli(*words, "--max-error", "20deg", "--max-error", "step=1e-4 rad", "--json")
    assert ended.code == 1
    assert list(ended.data["above"]) == ["step"]
    assert ended.err == ""
    assert "! step: " in cli(*words, "--max-error", "step=1e-4 rad").out


@pytest.mark.long(but="words8-unknown model")
@pytest.mark.parametrize(("words", "said"), [
    (["--max-error", "3"], "a number with one of the units rad, deg"), (["--max-error=-3deg"], "a positive number"),
    (["--max-error", "3 V"], "rad, deg"), (["--max-error", "fish=3deg"], "unknown motion"),
    (["--register", "P_Coefficient=16"], "--register for hitec-hs-755hb: got 'P_Coefficient', allowed: a servo with"),
    (["--nuisance", "none,delay"], "none alone"), (["--nuisance", "fish"], "nuisance: got 'fish'"),
    (["--report", "fish.txt"], "ends in .html"), (["--model", "dc-motor"], "unknown model"),
])
def test_bad_words(cli, folder, tmp_path, words, said):
    assert said in cli("validate", fit_logs.SERVO, folder, *words).error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_a_report_is_not_overwritten(cli, folder, truth, tmp_path):
    words = ["validate", truth, folder / "step-0.csv", "--model", "bounded", "--report", "check.html"]
    assert cli(*words).code == 0
    page = (tmp_path / "check.html").read_text()
    assert "validated on 1 log<" in page
    assert "held out" not in page
    assert "exists already" in cli(*words).error
    assert cli(*words, "--force").code == 0


def test_the_nuisances_of_the_fit_are_used():
    from dataclasses import replace

    servo = st.load_servo(fit_logs.SERVO).replace({"motor.rotor_inertia": fit_logs.INERTIA})
    late = [replace(log, measured={"output_angle": np.interp(log.time - 0.02, log.time, log.measured["output_angle"])
                                   + 0.05}) for log in fit_logs.made_logs(2)]
    plain = validate(late, servo, st.BoundedServo)
    recorded = replace(servo, fit={"model": "BoundedServo", "nuisance": {"delay": 0.02, "angle_offset": 0.05}})
    known = validate(late, recorded)
    assert known.nuisance == {"delay": pytest.approx(0.02), "angle_offset": pytest.approx(0.05)}
    assert isinstance(known.model, st.BoundedServo)
    assert known.total < 0.2 * plain.total
    fitted = validate(late, servo, st.BoundedServo, nuisance=["delay", "angle_offset"])
    assert fitted.fitted == ("delay", "angle_offset")
    assert fitted.nuisance["delay"] == pytest.approx(0.02, abs=2e-3)
    assert fitted.nuisance["angle_offset"] == pytest.approx(0.05, abs=2e-3)
    assert fitted.total == pytest.approx(known.total, rel=0.1)


def test_a_record_that_is_no_number_is_named():
    from dataclasses import replace

    servo = replace(st.load_servo(fit_logs.SERVO), fit={"nuisance": {"delay": "late"}})
    with pytest.raises(st.errors.ServoFileError, match=r"\[fit\] nuisance.delay"):
        validate(fit_logs.made_logs(1), servo, st.BoundedServo)


def test_the_load_of_a_fit_is_used():
    from dataclasses import replace

    servo = st.load_servo(fit_logs.SERVO)
    loaded = validate(fit_logs.made_logs(1), replace(servo, fit={"load": {"load.inertia": 0.02}}), st.BoundedServo)
    free = validate(fit_logs.made_logs(1), servo, st.BoundedServo)
    assert loaded.total > 1.5 * free.total


def test_errors_are_rms_over_samples(folder, truth):
    found = validate(read_logs(folder), st.load_servo(truth), st.BoundedServo)
    every = np.concatenate([trace.residual for trace in found.traces])
    assert found.total == pytest.approx(math.sqrt(np.mean(every**2)), rel=1e-12)


@pytest.mark.long
def test_what_is_found_of_columns_is_kept_with_what_was_said(cli, tmp_path):
    """Commands of servo.write: the sidecar has zero and unit, and the same words may be typed again."""
    rows = [f"{20 * k} {90 if k < 20 else 150} {90 if k < 20 else min(90 + 3 * (k - 20), 150)}" for k in range(60)]
    (tmp_path / "mine.txt").write_text("\n".join(rows) + "\n", encoding="utf-8")
    words = ("validate", "towerpro-mg996r", "mine.txt", "--columns", "time=1:ms command=2:deg angle=3:deg")
    first, again, untold = cli(*words), cli(*words), cli(*words[:3])
    assert "written  mine.json, which keeps --columns" in first.out.splitlines()
    assert json.loads((tmp_path / "mine.json").read_text())["columns"]["command_angle"]["offset"] == -90.0
    for said in (first, again):
        assert said.code == 0
        assert "90 deg is taken for its middle" in " ".join(said.out.split())
    assert "written" not in again.out
    assert untold.code == 0
    assert "is taken for" not in untold.out
    (tmp_path / "other.txt").write_bytes((tmp_path / "mine.txt").read_bytes())
    (tmp_path / "mine.json").unlink()
    both = " ".join(cli(*words[:3], "other.txt", *words[3:]).out.split())
    assert "log 'mine' and 1 more: commands of 90 to 150 deg count from an end" in both
    assert cli(*words[:-1], "time=1:ms command=2:deg-90 angle=3:-deg").code == 2
