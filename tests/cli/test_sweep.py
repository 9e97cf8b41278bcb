"""`servotwin sweep`: what it prints and writes, and how it refuses."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest

import servotwin as st

SERVO = "hitec-hs-755hb"
STEP = ["--step", "0:60", "--duration", "0.5"]
VARY = ["--vary", "motor.torque_constant=normal:5%", "--vary", "load.inertia=uniform:0..2e-3"]


@pytest.fixture
def sweep(cli):
    return lambda *words: cli("sweep", SERVO, *words)


def test_the_study_is_that_of_the_function(sweep, tmp_path):
    ended = sweep(*STEP, *VARY, "--lanes", "60", "--seed", "5", "--out", "study", "--plot", "--json",
                  "--metric", "rise_time")
    assert (ended.code, ended.err) == (0, "")
    expected = st.sweep(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 60.0, at=0.1, unit="deg"),
                        duration=0.5, lanes=60, seed=5, vary={
                            "motor.torque_constant": "normal:5%", "load.inertia": "uniform:0..2e-3"})
    found = ended.data["metrics"]
    assert next(iter(found)) == "rise_time"
    assert set(found) == set(expected.metrics)
    for name, quantiles in expected.quantiles().items():
        assert list(found[name]["quantiles"].values()) == list(quantiles.values())
    assert ended.data["definition"]["lanes"] == 60
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == [
        "lanes-00000.csv", "study.json", "summary.json", "tornado.png"]
    assert (tmp_path / "study" / "tornado.png").read_bytes().startswith(b"\x89PNG")
    summary = json.loads((tmp_path / "study" / "summary.json").read_text())
    assert summary["metrics"] == ended.data["metrics"]


def test_what_is_printed(sweep):
    lines = sweep(*STEP, *VARY, "--lanes", "40", "--metric", "steady_error").out.splitlines()
    assert lines[0] == "hitec-hs-755hb, PulseServo, 40 lanes, 0.5 s"
    assert any(line.split()[:2] == ["rise", "time"] and "ms" in line for line in lines)
    assert "what moves steady error, one at a time, and its share of the variance" in lines
    assert any(line.startswith("motor.torque_constant  ") and "mN m/A" in line for line in lines)


def test_the_spread_of_the_file_and_draws_of_a_table(sweep, tmp_path):
    found = sweep(*STEP, "--from-file", "--vary", "supply.open_circuit_voltage=normal:2%", "--lanes", "20", "--json")
    assert found.code == 0, found.err
    vary = found.data["definition"]["vary"]
    assert vary["electronics.stretcher_gain"] == {"kind": "Uniform", "lower": 60.0, "upper": 200.0}
    assert vary["supply.open_circuit_voltage"] == "normal:2%"
    (tmp_path / "draws.csv").write_text("motor.torque_constant,load.inertia\n3.6e-3,0\n3.7e-3,1e-3\n3.8e-3,2e-3\n")
    found = sweep(*STEP, "--draws", "draws.csv", "--json")
    assert found.data["lanes"] == 3
    assert found.data["definition"]["draws"] == ["load.inertia", "motor.torque_constant"]


def test_what_follows_and_what_does_not_matter_is_said(sweep):
    found = sweep(*STEP, "--from-file", "--lanes", "60", "--metric", "slew_rate")
    lines = found.out.splitlines()
    assert any(line.startswith("  follow") and "friction.coulomb_torque_backward" in line for line in lines)
    assert any(line.startswith("sheet.no_load_speed  ") and "°/s" in line for line in lines)
    assert not any(line.startswith("gear.gear_reduction") for line in lines)
    assert lines[-1].endswith("others that vary do not move it")


def test_a_file_without_spreads_has_nothing_to_draw(cli, tmp_path):
    st.load_servo(SERVO).replace({}).save(tmp_path / "a.toml")
    text = re.sub(r", (std|lower|upper) = [-0-9.e]+", "", (tmp_path / "a.toml").read_text(encoding="utf-8"))
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    assert "whose file states no spread" in cli("sweep", "a.toml", *STEP, "--from-file").error
    assert "nothing that varies moves it" in cli("sweep", "a.toml", *STEP, "--vary", "stops.restitution=uniform:0..0.5",
                                                 "--lanes", "4").out


@pytest.mark.long
def test_failed_lanes_are_shown(sweep, tmp_path):
    (tmp_path / "draws.csv").write_text("load.spring.stiffness\n0.1\n1e27\n")
    ended = sweep(*STEP, "--draws", "draws.csv", "--load", "spring=0.1")
    assert ended.code == 0
    assert "1: lane 1 at" in ended.out


@pytest.mark.long
def test_resume(sweep, tmp_path):
    words = [*STEP, *VARY, "--lanes", "30", "--out", "study"]
    first = sweep(*words)
    assert "not empty" in sweep(*words).error
    os.remove(tmp_path / "study" / "lanes-00000.csv")
    assert sweep(*words, "--resume").out == first.out
    assert "lanes is 31 and was 30" in sweep(*STEP, *VARY, "--lanes", "31", "--out", "study",
                                                           "--resume").error


def test_truncation(sweep):
    wide = [*STEP, "--vary", "motor.armature_resistance=normal:60%", "--lanes", "100"]
    assert "motor.armature_resistance of lane " in sweep(*wide).error
    assert sweep(*wide, "--truncate").code == 0


@pytest.mark.long(but="words1---vary: got 'load.inertia', allowed: NAME=DISTRIBUTION")
@pytest.mark.parametrize(("words", "said"), [
    ([], "nothing varies; use at least one of --vary, --from-file, --draws"),
    (["--vary", "load.inertia"], "--vary: got 'load.inertia', allowed: NAME=DISTRIBUTION"),
    (["--vary", "motor.nothing=normal:10%"], "unknown parameter 'motor.nothing'"),
    (["--vary", "motor.armature_inductance=normal:10%"], "does not read"),
    (["--vary", "motor.armature_resistance=normal:3V"], "got 'V', allowed: ohm, mohm"),
    (["--vary", "motor.armature_resistance=normal:nan"], "got 'nan'"),
    (["--vary", "motor.armature_resistance=normal:0%"], "Normal(std): got 0.0"),
    (["--vary", "motor.armature_resistance=normal:-5%"], "Normal(std): got -0.05"),
    (["--vary", "motor.armature_resistance=uniform:-1..-0.5"], "motor.armature_resistance of lane 0: got -"),
    (["--vary", "load.inertia=uniform:0..1", "--vary", "load.inertia=uniform:0..2"], "--vary load.inertia: got"),
    ([*VARY, "--lanes", "0"], "lanes: got 0"),
    ([*VARY, "--lanes", "100000000000"], "what fits into memory"),
    ([*VARY, "--seed", "-1"], "seed: got -1"),
    ([*VARY, "--sampling", "dice"], "latin-hypercube, sobol, random"),
    ([*VARY, "--metric", "overshot"], "did you mean 'overshoot'?"),
    ([*VARY, "--output-step", "nan"], "output_step: got nan"),
    ([*VARY, "--duration", "-1"], "--duration: got -1"),
    ([*VARY, "--resume"], "--resume needs --out FOLDER"),
    ([*VARY, "--plot"], "--plot needs --out FOLDER"),
    ([*VARY, "--out", "file"], "file is no folder"),
    ([*VARY, "--out", "none/study"], "none/study cannot be made (no folder none)"),
    ([*VARY, "--out", "study", "--format", "xlsx"], "csv, parquet"),
    (["--from-file", "--set", "motor.armature_resistance=nan"], "--set motor.armature_resistance: got 'nan'"),
    (["--vary", "sheet.stall_torque=normal:5V"], "unit of a torque: got 'V'"),
    (["--vary", "sheet.gear_efficiency=uniform:0.8..1.2"], "allowed: a positive number, at most 1 [1]"),
    (["--vary", "output_torque_constant=normal:5%"], "from which nothing of 'hitec-hs-755hb' follows"),
    (["--draws", "none.csv"], "none.csv cannot be read (No such file or directory)"),
    (["--draws", "file"], "file: got 'no rows'"),
    (["--draws", "words.csv"], "draws of motor.torque_constant"),
    (["--draws", "ragged.csv"], "ragged.csv cannot be read (not a table of columns)"),
])
def test_bad_input(sweep, tmp_path, words, said):
    (tmp_path / "file").write_text("")
    (tmp_path / "words.csv").write_text("motor.torque_constant\nmuch\n")
    (tmp_path / "ragged.csv").write_text("motor.torque_constant,load.inertia\n1\n")
    assert said in sweep(*STEP, *words).error
    assert not (tmp_path / "study").exists()


@pytest.mark.slow
def test_an_interrupt_says_how_to_go_on(child_environment, tmp_path):
    # Both at 130 samples a lane, so that the chunks are alike; the first makes sure that everything is compiled.
    words = [sys.executable, "-m", "servotwin", "sweep", SERVO, *STEP, *VARY]
    subprocess.run([*words, "--lanes", "10"], env=child_environment, cwd=tmp_path, check=True, capture_output=True)
    heeded = partial(signal.signal, signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore them
    with subprocess.Popen([*words, "--lanes", "2000000", "--out", "study"], stdout=subprocess.PIPE, preexec_fn=heeded,
                          stderr=subprocess.PIPE, text=True, env=child_environment, cwd=tmp_path) as child:
        for _ in range(600):
            if (tmp_path / "study" / "lanes-00001.csv").exists():
                break
            time.sleep(0.1)
        child.send_signal(signal.SIGINT)
        _, err = child.communicate(timeout=60)
    assert child.returncode == 130
    assert err.splitlines() == ["servotwin: what is finished is in study; the same command with --resume goes on",
                                "servotwin: interrupted"]
    found = np.genfromtxt(tmp_path / "study" / "lanes-00000.csv", delimiter=",", skip_header=1, usecols=(0, 1, 2))
    assert np.isfinite(found).all()


def test_remarks_are_counted_with_their_first_lanes(sweep):
    words = ("--step", "0:60", "--duration", "0.8", "--lanes", "16", "--vary", "load.torque=uniform:2..4")
    shown = " ".join(sweep(*words).out.split())
    assert "cannot hold its load: 16 of 16 (lanes 0, 1, 2, 3, 4 ...)" in shown
    found = sweep(*words, "--json").data["remarks"]
    assert found["cannot hold"] == {"lanes": 16, "first": list(range(16))}
    assert "pulses refused" not in found
