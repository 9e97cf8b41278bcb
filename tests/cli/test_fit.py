"""`servotwin fit`: what it prints and writes, and how it refuses."""

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import servotwin as st
from cli import fit_logs
from servotwin.cli.fit_report import facts
from servotwin.identification import Ladder, Rung, compare_structures, identify, read_logs
from servotwin.identification.fitting.yielding import Widened

QUICK = ["--servo", fit_logs.SERVO, "--model", "bounded", "--free", "output_inertia", "--no-priors", "--starts", "1",
         "--nuisance", "none", "--no-compare"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return fit_logs.write_logs(tmp_path_factory.mktemp("fit") / "runs")


@pytest.fixture
def fit(cli, folder):
    return lambda *words: cli("fit", folder, *words)


def test_the_fit_is_that_of_the_function(fit, folder, tmp_path):
    ended = fit(*QUICK, "--holdout", "step-3", "--out", "my.toml", "--json")
    assert (ended.code, ended.err) == (0, "")
    expected = identify(read_logs(folder), st.load_servo(fit_logs.SERVO), st.BoundedServo, ["output_inertia"], (),
                        None, starts=1, holdout=["step-3"], compare_with=())
    found = ended.data
    assert found["estimates"]["output_inertia"]["value"] == expected.estimates["output_inertia"]
    assert found["estimates"]["output_inertia"]["upper"] == expected.intervals()["output_inertia"].upper
    assert found["held_out"] == ["step-3"]
    assert found["errors"]["held_out"]["all"]["BoundedServo"] == pytest.approx(fit_logs.NOISE, rel=0.4)
    servo = st.load_servo(tmp_path / "my.toml")
    assert servo.motor.rotor_inertia == expected.servo.motor.rotor_inertia
    assert servo.source("motor.rotor_inertia").origin == "identified"
    assert servo.fit["data"] == found["data"]


def test_the_truth_is_inside_the_interval(fit):
    found = fit(*QUICK, "--json").data["estimates"]["output_inertia"]
    assert found["lower"] < fit_logs.OUTPUT_INERTIA < found["upper"]
    assert found["upper"] - found["lower"] < 0.05 * found["value"]


def test_what_is_printed(fit):
    ended = fit("--servo", fit_logs.SERVO, "--model", "bounded", "--free", "output_inertia, output_coulomb_torque",
                "--no-priors", "--starts", "1", "--holdout", "0")
    lines = ended.out.splitlines()
    assert re.fullmatch(r"Hitec HS-755HB \(hitec-hs-755hb\), BoundedServo, 4 logs, 0 of them held out, [\d.]+ s",
                        lines[0])
    row = next(line for line in lines if line.startswith("output_inertia "))
    assert re.search(r"\d+\.\d+ +\d+\.\d+ to \d+\.\d+ +kg cm² +(normal|profile) +0 % +60$", row)
    assert any(line.split()[0] == "angle_offset" and line.endswith("rig") for line in lines if line)
    header = next(line for line in lines if line.startswith("motion"))
    assert "bounded servo (°)" in header
    assert "delay + slew + lag (°)" in header
    assert {line.split()[0] for line in lines if " fitted " in line} == {"step", "stairs", "all"}


def test_what_the_logs_cannot_say_is_said(fit):
    ended = fit("--servo", fit_logs.SERVO, "--model", "bounded", "--free", "output_inertia,"
                "output_coulomb_torque,motor.torque_constant", "--no-priors", "--starts", "1",
                "--nuisance", "none", "--no-compare", "--json")
    found = ended.data
    assert found["undetermined"]
    named = {name for item in found["undetermined"] for name in item["parameters"]}
    assert named == {"output_inertia", "output_coulomb_torque", "motor.torque_constant"}
    assert found["estimates"]["output_inertia"]["lower"] is None
    assert found["estimates"]["output_inertia"]["method"] == "undetermined"


@pytest.mark.long
def test_bounds_and_priors_have_units(fit):
    words = [*QUICK, "--bounds", "output_inertia=30..40kg cm2", "--json"]
    found = fit(*words).data
    assert found["at_bound"] == ["output_inertia"]
    assert found["estimates"]["output_inertia"]["value"] == pytest.approx(40e-4, rel=1e-9)
    tight = fit(*QUICK, "--prior", "output_inertia=47.05kg cm2±0.001%", "--json").data
    assert tight["estimates"]["output_inertia"]["value"] == pytest.approx(47.05e-4, rel=2e-5)
    assert tight["estimates"]["output_inertia"]["prior_share"] > 0.99
    assert tight["yielded"] == []
    about = fit(*QUICK, "--prior", "output_inertia=0.001%", "--json").data  # of 60 kg cm², which the logs contradict
    (one,) = about["yielded"]
    assert (one["parameter"], one["of_file"]) == ("output_inertia", False)
    assert (one["file"], one["file_std"]) == pytest.approx((60e-4, 60e-9), rel=1e-3)
    assert one["logs_lower"] < fit_logs.OUTPUT_INERTIA < one["logs_upper"]
    assert one["words"] in about["warnings"]


@pytest.mark.long
def test_windows_are_left_out(fit):
    every = fit(*QUICK, "--holdout", "0", "--json").data
    some = fit(*QUICK, "--holdout", "0", "--leave-out", "step-0=0.3..0.5", "--leave-out", "0ms..100ms", "--json").data
    count = [sum(e["samples"] for e in found["errors"]["fitted"]["logs"]["BoundedServo"]) for found in (every, some)]
    assert count == [4 * 35, 4 * 30 - 10]


@pytest.mark.long
def test_the_report_is_written(fit, tmp_path):
    ended = fit(*QUICK, "--report", "fit.html", "--out", "my.toml")
    assert ended.code == 0, ended.err
    assert ended.out.rstrip().splitlines()[-2:] == ["  written  my.toml", "  written  fit.html"]
    assert (tmp_path / "fit.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.long
def test_advice_without_logs(cli):
    words = ["fit", "--advise", "--servo", fit_logs.SERVO, "--model", "bounded", "--free", "output_inertia"]
    found = cli(*words, "--json").data["advice"]
    assert found["widest"] == "output_inertia"
    assert found["experiments"][0]["widest"] < found["now"]["output_inertia"]
    text = cli(*words).out
    assert text.splitlines()[0].startswith("next experiments")
    assert any(line.startswith("next: ") for line in text.splitlines())
    assert found["alone"]["output_inertia"] > 10.0 * found["now"]["output_inertia"]


def test_advice_after_a_fit(fit):
    ended = fit(*QUICK, "--advise", "--json")
    assert set(ended.data["advice"]["now"]) == {"output_inertia"}


def test_the_ladder_is_shown(fit, folder, monkeypatch):
    def ladder(logs, servo, model, free, **options):
        names = iter(("M1", "M2"))
        one = identify(logs, servo, st.BoundedServo, free, (), None, starts=1, compare_with=(), intervals=False)
        return Ladder(tuple(Rung(next(names), one, 0.01, hold, -5.0) for hold in (0.011, 0.02)), "M1", "the simplest",
                      0.013, ("M1", "M2"))

    monkeypatch.setattr("servotwin.identification.friction_ladder", ladder)
    words = ["--servo", fit_logs.SERVO, "--free", "output_inertia", "--ladder"]
    ended = fit(*words)
    lines = ended.out.splitlines()
    assert lines[1].split() == ["M1", "1", "0.573", "0.63", "-5.0", "chosen"]
    assert lines[2].split() == ["M2", "1", "0.573", "1.15", "-5.0", "overfitted"]
    assert lines[3] == "M1: the simplest"
    assert lines[4] == ("error on logs that had no say in the choice: 0.745 ° (held-out logs in two halves, which "
                        "choose M1 and M2)")
    found = fit(*words, "--json").data["ladder"]
    assert (found["chosen"], found["error"], found["choices"]) == ("M1", 0.013, ["M1", "M2"])


@pytest.mark.long
def test_structures_are_shown_and_reported(fit, tmp_path, monkeypatch):
    """Four structures with Coulomb friction: a table in the terminal, in JSON and on the page."""
    monkeypatch.setattr("servotwin.identification.compare_structures", partial(compare_structures, rungs=("M1",)))
    ended = fit(*QUICK[:2], "--free", "output_inertia", "--structures", "--holdout", "0", "--starts", "1",
                "--no-intervals", "--nuisance", "none", "--report", "fit.html")
    page = (tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "What was compared" in page
    for name in ("analog, brake, M1", "analog, coast, M1", "digital, brake, M1", "digital, diode, M1"):
        assert any(line.startswith(name) for line in ended.out.splitlines())
        assert name in page


def test_the_ladder_and_structures_exclude_each_other(fit):
    assert "--ladder: got 'also --structures'" in fit(*QUICK[:2], "--ladder", "--structures").error


@pytest.mark.long
def test_what_is_wrong_with_logs_is_said_and_mended(cli, tmp_path):
    """A log whose angle was turned: without --mend it is named, with it the fit is as good as with the others."""
    folder = fit_logs.write_logs(tmp_path / "runs", 3)
    path = folder / "step-0.csv"
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    where = next(k for k, name in enumerate(header.split(",")) if name.startswith("output_angle"))
    turned = [",".join(f"{-float(cell):.9g}" if k == where else cell for k, cell in enumerate(row.split(",")))
              for row in rows]
    path.write_text("\n".join([header, *turned]) + "\n", encoding="utf-8")
    words = ["--servo", fit_logs.SERVO, "--free", "output_inertia", "--holdout", "0", "--no-compare", "--starts", "1",
             "--no-intervals", "--mend", "sign"]
    ended = cli("fit", folder, *words)
    assert ended.code == 0
    assert f"! mended: log '{path.stem}': the angle turns against the command" in " ".join(ended.out.split())
    checked = cli("validate", fit_logs.SERVO, folder, "--nuisance", "angle_offset", "--mend", "sign", "--json").data
    assert any(path.stem in line for line in checked["warnings"])
    for wrong in ("sing", "pulses"):
        ended = cli("fit", folder, "--servo", fit_logs.SERVO, "--mend", wrong)
        assert ended.code == 2
        assert "mend" in ended.err
        assert "not-followed" in ended.err




def test_a_bench_table(cli, tmp_path):
    (tmp_path / "bench.csv").write_text("q_deg,V_o_V\n0,0.590\n45,0.912\n90,1.253\n135,1.572\n")
    ended = cli("fit", "--table", "bench.csv", "--out", "my.toml", "--json")
    assert "potentiometer.feedback_gain" in ended.data["parameters"]
    assert (tmp_path / "my.toml").exists()
    assert "a table alone" in cli("fit", "--table", "bench.csv", "--advise").error


def test_an_interrupt_keeps_the_best_so_far(fit, tmp_path, monkeypatch):
    from servotwin.identification.fitting.search.least_squares import Search

    run, steps = Search.run, []

    def interrupted(self, start, *, most=60, tell=None, **more):
        def told(step, outcome):
            if tell is not None:
                tell(step, outcome)
            steps.append(step)
            if len(steps) == 3:
                raise KeyboardInterrupt
        return run(self, start, most=most, tell=told, **more)

    monkeypatch.setattr(Search, "run", interrupted)
    ended = fit(*QUICK, "--out", "my.toml", "--json")
    assert ended.code == 130
    assert ended.data["interrupted"] is True
    found = ended.data["estimates"]["output_inertia"]
    assert found["lower"] < found["value"] < found["upper"]
    servo = st.load_servo(tmp_path / "my.toml")
    assert servo.fit["interrupted"] is True
    assert servo.motor.rotor_inertia == pytest.approx(fit_logs.INERTIA, rel=0.2)
    steps.clear()
    assert "INTERRUPTED" in fit(*QUICK).out


def test_the_time_that_a_fit_may_take(fit, tmp_path):
    ended = fit("--starts", "6", "--within", "0.4 s", "--out", "my.toml", "--json")
    if ended.code == 0:  # slow machines find nothing in that time
        assert ended.data["interrupted"] is True
        assert ended.data["unknown"]
        assert st.load_servo(tmp_path / "my.toml").fit["unknown"] == ended.data["unknown"]
    assert "--within" in fit(*QUICK, "--within", "1us", "--out", "none.toml").error
    assert "--within" in fit(*QUICK, "--within", "soon").error
    assert not (tmp_path / "none.toml").exists()


def test_an_interrupt_before_the_first_step_leaves_nothing(fit, tmp_path, monkeypatch):
    from servotwin.identification.fitting.search.least_squares import Search

    def interrupted(self, *arguments, **more):
        raise KeyboardInterrupt

    monkeypatch.setattr(Search, "run", interrupted)
    ended = fit(*QUICK, "--out", "my.toml")
    assert (ended.code, ended.out) == (130, "")
    assert ended.err == "servotwin: interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_accuracy_is_that_of_the_words(fit, folder):
    found = {words: fit(*QUICK, *words, "--json").data["estimates"]["output_inertia"]["value"]
             for words in ((), ("--accuracy", "1e-7"), ("--accuracy", "1e-11"))}
    usual, said, fine = found.values()
    assert usual == said
    expected = identify(read_logs(folder), st.load_servo(fit_logs.SERVO), st.BoundedServo, ["output_inertia"], (),
                        None, starts=1, compare_with=(), accuracy=1e-11)
    assert fine == expected.estimates["output_inertia"]


@pytest.mark.long(but="words20-unknown model 'averaged'")
@pytest.mark.parametrize(("words", "said"), [
    (["--bounds", "output_inertia=3..1"], "LOWEST..HIGHEST"),
    (["--bounds", "output_inertia=1ohm..2ohm"], "one of the units kg m2"),
    (["--bounds", "motor.torque_constant=1..2"], "a name that is not searched"),
    (["--bounds", "output_inertia"], "NAME=..."),
    (["--prior", "output_inertia=x"], "VALUE±STANDARD_DEVIATION"),
    (["--prior", "output_inertia=10%", "--prior", "output_inertia=20%"], "one of both"),
    (["--holdout", "1.5"], "--holdout: got '1.5'"),
    (["--holdout", "fish"], "stairs-1, step-0"),
    (["--leave-out", "5"], "START..STOP"),
    (["--leave-out", "5..3"], "the earlier one first"),
    (["--leave-out", "fish=3..5"], "unknown log of --leave-out 'fish'"),
    (["--leave-out", "0..9"], "no value outside the windows"),
    (["--level", "2"], "--level: got '2'"),
    (["--loss", "l1"], "loss: got 'l1'"),
    (["--accuracy", "0"], "accuracy: got 0.0, allowed: a number of radians, from 1e-13 to 0.0001"),
    (["--accuracy", "nan"], "accuracy: got nan"),
    (["--accuracy", "1mrad"], "--accuracy"),
    (["--nuisance", "fish"], "nuisance: got 'fish'"),
    (["--sensors", "fish"], "sensors: got 'fish'"),
    (["--format", "xml"], "unknown format of logs 'xml'"),
    (["--model", "averaged"], "unknown model 'averaged'"),
    (["--free", "outputinertia"], "did you mean 'output_inertia'"),
    (["--set", "motor.torque_constant=-1"], "a positive number"),
    (["--ladder"], "--ladder: got 'a bounded servo'"),
    (["--out", "my.txt"], "ends in .toml"),
    (["--report", "my.txt"], "ends in .html"),
    (["--out", "no/my.toml"], "the folder no does not exist"),
])
def test_bad_words(fit, tmp_path, words, said):
    plain = list(QUICK)
    if words[0] in plain:
        del plain[plain.index(words[0]):plain.index(words[0]) + 2]
    assert said in fit(*plain, *words).error
    assert list(tmp_path.iterdir()) == []


def test_files_are_checked_before_anything_runs(fit, tmp_path, monkeypatch):
    monkeypatch.setattr("servotwin.identification.fitting.identify", None)
    (tmp_path / "my.toml").write_text("mine")
    for words in (["--out", "my.toml"], ["--report", "my.html", "--out", "my.toml"]):
        assert "exists already" in fit(*QUICK, *words).error
    assert (tmp_path / "my.toml").read_text() == "mine"


def test_an_input_is_never_an_output(cli, tmp_path):
    (tmp_path / "servo.toml").write_text("name = 'x'\n")
    assert "is the same file as the input" in cli("fit", "gone.csv", "--servo", "servo.toml", "--out", "servo.toml",
                                                  "--force").error


@pytest.mark.long
def test_something_has_to_be_given(cli, folder):
    assert "no logs" in cli("fit").error
    assert "--servo is needed" in cli("fit", folder).error
    assert "no such file" in cli("fit", "gone.csv", *QUICK).error
    assert "2 logs of this name" in cli("fit", folder, folder / "step-0.csv", *QUICK).error


HEAD = "time,pulse_width_us,output_angle_deg"
BAD = {
    "nothing commanded": ("time,output_angle_deg\n0,0\n1,2\n2,3", "no command among the columns"),
    "wrong unit": ("time,pulse_width_us,output_angle\n0,1500,4000\n0.02,1600,4010\n0.04,1600,4020",
                   "degrees or counts"),
    "backwards": (f"{HEAD}\n0,1500,0\n0.02,1600,1\n0.01,1600,2", "time runs backwards"),
    "constant": (f"{HEAD}\n0,1500,5\n0.02,1600,5\n0.04,1600,5\n0.06,1600,5", "an angle that never changes"),
    "two samples": (f"{HEAD}\n0,1500,0\n0.02,1600,1", "2 samples"),
    "too fast": ("\n".join([HEAD, *(f"{0.02 * k:.2f},1600,{60 * k}" for k in range(8))]), "contradicts the servo"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_logs(cli, tmp_path, what):
    text, said = BAD[what]
    (tmp_path / "log.csv").write_text(text + "\n")
    assert said in cli("fit", "log.csv", *QUICK, "--out", "my.toml").error
    assert not (tmp_path / "my.toml").exists()


def test_json_of_a_failure(fit):
    ended = fit(*QUICK, "--level", "2", "--json")
    assert json.loads(ended.out)["error"]["what"] == "--level"


@pytest.mark.long
def test_the_same_words_give_the_same_numbers(fit):
    first, second = (fit(*QUICK, "--json").data for _ in range(2))
    first.pop("seconds"), second.pop("seconds")
    assert first == second
    assert np.isfinite(first["estimates"]["output_inertia"]["value"])


@pytest.mark.long
def test_the_supply_of_the_logs_is_that_of_the_servo_that_is_saved(cli, tmp_path):
    """Logs at 5 V gave a servo of 6 V, that of the sheet."""
    logs = fit_logs.write_logs(tmp_path / "runs", count=2)
    for file in logs.glob("*.json"):
        said = json.loads(file.read_text())
        file.write_text(json.dumps({**said, "parameters": {"supply.open_circuit_voltage": 5.0}}))
    words = [logs, *QUICK, "--no-intervals", "--holdout", "0", "--set", "motor.armature_resistance=3.1ohm", "--force"]
    assert cli("fit", *words, "--out", "my.toml", "--json").data["set"] == ["motor.armature_resistance"]
    servo = st.load_servo(tmp_path / "my.toml")
    voltage, resistance = servo.source("supply.open_circuit_voltage"), servo.source("motor.armature_resistance")
    assert (voltage.value, voltage.origin) == (5.0, "measured")
    assert "logs" in voltage.source
    assert (resistance.origin, resistance.source) == ("assumed", "set by --set")
    file.write_text(json.dumps({**said, "parameters": {"supply.open_circuit_voltage": 6.5}}))  # they disagree
    cli("fit", *words, "--out", "my.toml")
    assert st.load_servo(tmp_path / "my.toml").supply.open_circuit_voltage == 6.0


# ---------------------------------------------------------------------------------------- tables of other loggers

def foreign(folder, end="\n"):
    """Write a log of the known servo as another logger would."""
    log = fit_logs.made_logs(1)[0]
    rows = [f"{1e3 * t:.0f};{np.degrees(u):.6f};{90.0 - np.degrees(q):.6f}".replace(".", ",")
            for t, u, q in zip(log.time, log.command, log.measured["output_angle"], strict=True)]
    path = folder / "mine.csv"
    path.write_text("\n".join(["millis;target;pos", *rows]) + end, encoding="utf-8")
    return path.name


@pytest.mark.long
def test_columns_are_shown_changed_and_kept(cli, tmp_path):
    path = foreign(tmp_path, end="\n700;60,0;3")
    guessed = cli("validate", fit_logs.SERVO, path, "--model", "bounded")
    assert guessed.code == 0
    assert guessed.out.splitlines()[:5] == [
        "column  signal         unit  known",
        "millis  time           ms    guessed from its name",
        "target  command_angle  deg   guessed from its values, 0 to 60",
        guessed.out.splitlines()[3], f"{path}: line 37 does not end in a newline and was left out"]
    assert re.fullmatch(r"pos +output_angle +deg +guessed from its values, .*", guessed.out.splitlines()[3])
    assert [file.name for file in tmp_path.iterdir()] == [path]  # nothing is written unasked
    said = cli("fit", path, *QUICK, "--columns", "angle=pos:-deg+90")
    assert re.search(r"^pos +output_angle +-deg\+90 +--columns$", said.out, re.MULTILINE)
    assert "written  mine.json, which keeps --columns" in said.out.splitlines()
    again = cli("fit", path, *QUICK, "--json")
    assert {one["known"] for one in again.data["reading"][0]["columns"]} == {"sidecar"}
    assert again.data["estimates"]["output_inertia"]["value"] == pytest.approx(fit_logs.OUTPUT_INERTIA, rel=0.03)
    before = (tmp_path / "mine.json").read_bytes()
    other = cli("validate", fit_logs.SERVO, path, "--columns", "angle=pos:deg")
    assert (other.code, other.out) == (2, "")
    assert "pos:-deg+90 there, pos:deg here" in other.error
    assert "--force" in other.error
    assert (tmp_path / "mine.json").read_bytes() == before


@pytest.mark.parametrize(("words", "said"), [
    (["--columns", "angle=position:deg"], "column of output_angle: got 'position', allowed: millis, target, pos"),
    (["--columns", "angle=pos:kg"], "--columns output_angle=pos: got 'kg', allowed: deg, rad"),
    (["--joint", "elbow:deg"], "no dataset"),
])
def test_columns_that_cannot_be(cli, tmp_path, words, said):
    ended = cli("fit", foreign(tmp_path), *QUICK, *words)
    assert ended.code == 2
    assert said in ended.error
    assert len(list(tmp_path.iterdir())) == 1


def test_json_has_widened_priors_and_numbers_that_would_move(folder):
    found = identify(read_logs(folder), st.load_servo(fit_logs.SERVO), st.BoundedServo, ["output_inertia"], (), None,
                     starts=1, compare_with=())
    wide = Widened("output_inertia", file=6e-3, file_std=1e-4, logs=5e-3, apart=5.0, std=1e-3, unit="kg m2")
    told = facts(replace(found, widened=(wide,), verdict=replace(
        found.verdict, moved={"output_inertia": (0.4, "play")})), [])
    assert told["moved"] == {"output_inertia": {"half_widths": 0.4, "by": "play"}}
    assert told["widened"] == [{
        "parameter": "output_inertia", "unit": "kg m2", "file": 6e-3, "file_std": 1e-4, "logs": 5e-3, "apart": 5.0,
        "std": 1e-3, "of_file": True, "words": str(wide)}]
    assert told["yielded"] == []
