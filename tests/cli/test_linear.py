"""`servotwin linear`: the numbers of the functions, files, and what is refused."""

import csv
import math

import numpy as np
import pytest

import servotwin as st

SERVO = "hitec-hs-755hb"


@pytest.mark.slow
def test_the_numbers_are_those_of_the_functions(cli):
    found = cli("linear", SERVO, "--load", "inertia=1e-3", "--amplitude", "5deg", "--frame", "20ms,10ms", "--json").data
    model, load = st.PulseServo(st.load_servo(SERVO)), st.loads.Inertia(1e-3)
    omega = np.array(found["frequency"])
    system = st.linear.transfer_function(model, input="command_angle", load=load)
    np.testing.assert_allclose(found["mean"]["gain"], np.abs(system(1j * omega)), rtol=1e-9)
    assert found["mean"]["natural_frequency"] == pytest.approx(system.damp()[0][0])
    assert [loop["period"] for loop in found["loops"]] == [0.02, 0.01]
    for loop in found["loops"]:
        margins = st.linear.sampled(model, load, frame_period=loop["period"]).margins
        assert loop["phase_margin"] == margins.phase
        assert loop["gain_margin"] == margins.gain
    (sines,) = found["sines"]
    seen = st.linear.frequency_response(model, omega, amplitude=math.radians(5.0), load=load)
    assert sines["gain"] == seen.gain[0].tolist()
    assert sines["sticks"] == st.linear.linearise(model, load, amplitude=math.radians(5.0)).sticks(omega).tolist()


@pytest.mark.long
def test_files(cli, tmp_path):
    names = [tmp_path / name for name in ("a.html", "a.png", "a.csv")]
    words = [word for option, name in zip(("--out", "--plot", "--csv"), names, strict=True) for word in (option, name)]
    seen = cli("linear", SERVO, "--model", "bounded", "--amplitude", "20deg", *map(str, words))
    assert "Hz" in seen.out
    page = names[0].read_text(encoding="utf-8")
    assert page.count("<figure>") == 1  # a bounded servo decides at all times
    assert "http" not in page.replace("http://www.w3.org", "")
    rows = list(csv.DictReader(names[2].read_text().splitlines()))
    assert list(rows[0]) == ["frequency_Hz", "mean_gain", "mean_phase_deg", "simulated_20deg_gain",
                             "simulated_20deg_phase_deg", "described_20deg_gain", "described_20deg_phase_deg"]
    assert "exists" in cli("linear", SERVO, "--csv", str(names[2])).error
    cli("linear", SERVO, "--frame", "20ms,10ms", "--csv", str(tmp_path / "b.csv"))
    header = (tmp_path / "b.csv").read_text().splitlines()[0].split(",")
    assert [name for name in header if name.startswith("sampled")] == [
        f"sampled_{period}ms_{what}" for period in (20, 10) for what in ("gain", "phase_deg")]


@pytest.mark.slow
def test_tuning(cli):
    found = cli("linear", SERVO, "--load", "inertia=5e-3", "--tune", "--phase-margin", "50deg", "--frame", "10ms",
                "--json").data
    often = st.load_servo(SERVO).replace({"electronics.frame_period": 0.01})
    alone = st.linear.tune(st.PulseServo(often), st.loads.Inertia(5e-3), phase_margin=math.radians(50.0))
    assert found["settings"] == alone.settings
    assert found["stiffness"] == alone.stiffness
    said = cli("linear", SERVO, "--load", "inertia=5e-3", "--tune", "--phase-margin", "50deg").out
    assert "N m/rad" in said
    assert "of the error at the tap" in said


@pytest.mark.slow
def test_what_has_no_linear_loop_still_has_sines(cli):
    seen = cli("linear", "miuzei-25kg", "--amplitude", "20deg")
    assert "diode" in seen.err
    assert "Hz" in seen.out


@pytest.mark.long(but="words4-together with --tune")
@pytest.mark.parametrize(("words", "text"), [
    (("nothing",), "unknown servo"), ((SERVO, "--tune"), "nothing to tune for"),
    ((SERVO, "--tune", "--overshoot", "ten"), "per cent"), ((SERVO, "--phase-margin", "50deg"), "together with --tune"),
    ((SERVO, "--step", "5deg"), "together with --tune"), ((SERVO, "--derivative"), "together with --tune"),
    ((SERVO, "--tune", "--amplitude", "5deg"), "without --tune"),
    ((SERVO, "--tune", "--angle", "90deg"), "without --tune"),
    ((SERVO, "--tune", "--overshoot", "10%", "--frame", "20ms,10ms"), "one frame period"),
    ((SERVO, "--tune", "--overshoot", "10%", "--derivative"), "has no D"),
    (("feetech-sts3215-12v", "--tune", "--overshoot", "10%", "--frame", "10ms"), "have frames"),
    ((SERVO, "--tune", "--phase-margin", "50"), "units rad, deg"), ((SERVO, "--amplitude", "-1deg"), "--amplitude"),
    ((SERVO, "--amplitude", "200deg"), "travel"), ((SERVO, "--frame", "0ms"), "--frame"),
    ((SERVO, "--frame", "1ms"), "less than a frame of 1000 us"), ((SERVO, "--model", "dc-motor"), "model"),
    ((SERVO, "--tune", "--overshoot", "10%", "--csv", "a.csv"), "no file beside --tune"),
    (("feetech-sts3215-12v", "--frame", "10ms"), "no frames"), ((SERVO, "--out", "a.txt"), ".html")])
def test_bad_input(cli, words, text):
    assert text in cli("linear", *words).error
