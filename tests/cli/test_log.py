"""`servotwin log`: what a log holds and lacks, and the mended log."""

import json
from pathlib import Path

import numpy as np
import pytest

from reference.broken_logs import KINDS, SEEDS, broken_logs, clean_rows
from servotwin.logs import read_logs

ASKED = [one for one in broken_logs() if not one.certain]


def written(name, rows, header="ms,pulse_us,angle_deg"):
    Path(name).write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return name


def steps(*, sign=1.0, command=lambda c: c, delay=60, zero=0.0):
    """Return rows of steps of +-30 deg that a shaft follows after a delay."""
    rows, angle = [], 0.0
    goal = [0, 30, -30, 1, 0, 30]
    for k in range(600):
        t = 10 * k
        then = goal[max(0, t - delay) // 1000]
        angle += max(-3.0, min(3.0, then - angle))
        rows.append(f"{t},{command(goal[t // 1000])},{sign * angle + zero:.2f}")
    return rows


@pytest.mark.long(but="thousands 0")
@pytest.mark.parametrize("one", ASKED, ids=lambda one: f"{one.kind} {one.seed}")
def test_what_the_sentence_says_works_when_it_is_typed(cli, one):
    Path("run.csv").write_bytes(one.broken)
    assert one.typed[0] in cli("log", "run.csv").error
    ended = cli("log", "run.csv", *one.typed, "--out", "mended.csv")
    assert ended.code == 0, ended.err
    assert Path("run.csv").read_bytes() == one.broken
    names = ["mended.csv"] if len(one.clean) == 1 else [f"mended-{k + 1}.csv" for k in range(len(one.clean))]
    for name, content in zip(names, one.clean, strict=True):
        Path("clean.csv").write_bytes(content)
        log, right = read_logs(name)[0], read_logs("clean.csv")[0]
        sure = np.ones(len(right), bool)
        sure[list(one.unsure)] = False
        assert np.array_equal(log.time[sure], right.time[sure])
        assert np.array_equal(log.measured["output_angle"], right.measured["output_angle"])
        if one.typed[0] == "--mend":
            assert "(" in json.loads(Path(name).with_suffix(".json").read_text())["source"]  # what was mended


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_certain_is_said(cli, seed):
    Path("run.csv").write_bytes(KINDS["micros"](seed).broken)
    assert "micros() begins again after 4294.967296 s in line" in " ".join(cli("log", "run.csv").out.split())


def test_what_a_log_holds(cli):
    written("run.csv", steps(command=lambda c: 1500 + 10 * c))
    found, = cli("log", "run.csv", "--json").data["logs"]
    assert found["rows"] == 600
    assert found["clock"]["period"] == pytest.approx(0.01)
    assert found["motion"]["lag"] == pytest.approx(0.06, abs=0.011)
    assert found["motion"]["steps"] == 4
    assert np.degrees(found["motion"]["gain"]) * 1e-6 == pytest.approx(0.1, rel=1e-3)
    assert found["motion"]["zero"] == pytest.approx(1500e-6, abs=1e-7)
    assert np.degrees(found["motion"]["speed"]) == pytest.approx(300.0, rel=0.01)
    assert found["wrong"] == []
    assert not [one for one in found["missing"] if "large step" in one or "small steps" in one or "way back" in one]
    text = cli("log", "run.csv").out
    assert "0.1 deg/us, 0 at 1500.0 us" in text
    assert "begins 60 ms after" in " ".join(text.split()).replace("70", "60")


@pytest.mark.long(but="rows5-1 reading of the angle, the first at 2.5 s")
@pytest.mark.parametrize(("rows", "words"), [
    (steps(sign=-1.0), 'angle=angle_deg:-deg"'),
    (steps(sign=-1.0, command=lambda c: c + 90, zero=90.0), 'angle=angle_deg:-deg+180"'),
    (steps(sign=0.5), 'angle=angle_deg:2deg"'), (steps(command=lambda c: c + 90), 'command=command_deg:deg-90"'),
    ([f"{10 * k},{(k // 100) % 2 * 40},{(7 * k + 300) % 360:.1f}" for k in range(600)], "jumps by a whole turn"),
    ([f"{10 * k},{(k // 100) % 2 * 40},{300 if k == 250 else (k // 100) % 2 * 40}.00" for k in range(600)],
     "1 reading of the angle, the first at 2.5 s"),
    ([f"{10 * k},{(k // 100) % 2 * 40},{0.05 if 250 <= k < 450 else 0.01 * (k * k * 7919 % 997 % 37):.2f}"
      for k in range(600)],
     "to the last digit from 2.5 to 4.49 s"),
    ([f"{10 * k},{min(max(k % 100 - 3, 0) * 3, 60) * (1 - k // 100 % 2 * 2) + 0.01 * (k % 7):.2f},"
      f"{60 * (1 - k // 100 % 2 * 2)}" for k in range(600)], "each other's columns"),
    ([f"{0.01 * k},{(k // 100) % 2 * 40},{(k // 100) % 2 * 40}.00" for k in range(600)], "faster than any servo"),
    ([f"{10 * k},{(k // 100) % 2 * 40},5.00" for k in range(600)], "the shaft does not"),
    ([f"{10 * k},20,{max(0, min(20, k - 50))}.00" for k in range(600)], "the command never changes"),
])
def test_what_cannot_be_right_is_said_with_what_to_type(cli, rows, words):
    written("run.csv", rows, header="ms,command_deg,angle_deg")
    assert any(words in one for one in cli("log", "run.csv", "--json").data["logs"][0]["wrong"]), cli(
        "log", "run.csv", "--json").data["logs"][0]["wrong"]


def test_what_is_said_to_type_puts_it_right(cli):
    written("run.csv", steps(sign=-1.0, command=lambda c: c + 90, zero=90.0), header="ms,command_deg,angle_deg")
    ended = cli("log", "run.csv", "--columns", "angle=angle_deg:-deg+180", "--json")
    assert not [one for one in ended.data["logs"][0]["wrong"] if "falls" in one]


def test_gaps_counts_and_the_end_of_a_range(cli):
    rng = np.random.default_rng(0)
    angle = np.round((30.0 * np.sin(0.02 * np.arange(800)) + rng.normal(0.0, 0.2, 800)) / (360.0 / 4096)) * 360.0 / 4096
    angle = np.minimum(angle, 25.0488281)
    rows = [f"{10 * k},{1500 + 300 * np.sin(0.02 * (k + 5)):.1f},{q:.7f}" for k, q in enumerate(angle)]
    del rows[300:330]
    written("run.csv", rows)
    found, = cli("log", "run.csv", "--json").data["logs"]
    assert found["clock"]["gap_count"] == 1
    assert found["clock"]["gaps"][0]["length"] == pytest.approx(0.31)
    assert found["signals"]["output_angle"]["counts"] == 4096
    assert found["signals"]["output_angle"]["flat_high"] > 50
    assert any("end of its range" in one for one in found["wrong"])
    assert found["motion"]["steps"] == 0
    assert found["motion"]["lag"] == pytest.approx(0.05, abs=0.02)


@pytest.mark.long
def test_files_are_never_written_over(cli):
    written("run.csv", steps(command=lambda c: 1500 + 10 * c))
    before = Path("run.csv").read_bytes()
    assert "run.csv" in cli("log", "run.csv", "--out", "run.csv", "--force").error
    assert Path("run.csv").read_bytes() == before
    assert not Path("run.json").exists()
    Path("run.json").write_text('{"format": "servotwin-log-1", "motion": "steps"}')
    assert cli("log", "run.csv", "--out", "m.csv", "--plot", "m.png").code == 0
    assert Path("m.png").read_bytes().startswith(b"\x89PNG")
    assert read_logs("m.csv")[0].motion == "steps"
    assert "exists already" in cli("log", "run.csv", "--out", "m.csv").error
    assert cli("log", "run.csv", "--out", "m.csv", "--force").code == 0


@pytest.mark.parametrize(("content", "words"), [
    (None, "no such file"), (b"", "an empty file"), (bytes(range(256)) * 20, "binary data"),
    (b"\0" * 4000, "binary data"),
    (b"ms,pulse_us,angle_deg\n" + b"0,1500,nan\n20,1500,nan\n40,1500,nan\n", "no value"),
    (b"ms,pulse_us,angle_deg\nnan,nan,nan\nnan,nan,nan\nnan,nan,nan\n", "line 2, ms"),
    (b"ms,pulse_us,angle_deg\n0,1500,1\n20,1500,2\n40,1500,3\n", "3 rows"), (b"hello\nworld\n", "hello"),
])
def test_what_is_no_log_is_one_line(cli, content, words):
    if content is not None:
        Path("run.csv").write_bytes(content)
    assert words in cli("log", "run.csv").error


@pytest.mark.long
def test_words_that_are_none(cli):
    written("run.csv", steps())
    for words, said in ((("--mend", "tron"), "did you mean 'torn'"), (("--mend", "wrap"), "beside a servo"),
                        (("--rate", "5s"), "a rate of rows"), (("--commanded", "x"), "a value with its unit"),
                        (("--rate", "50Hz", "--columns", "time=ms:ms"), "time twice")):
        assert said in cli("log", "run.csv", *words).error


def test_a_lift_without_header_and_command(cli):
    rows = [f"{k * 12 // 5},{min(max(k - 40, 0), 153)},{0.1 + 0.001 * (k % 7):.3f}" for k in range(300)]
    Path("lift0.txt").write_text("\n".join([*rows, ""]))
    ended = cli("log", "lift0.txt", "--columns", "1:ms 2:deg 3:A")
    assert "an unknown step, from 0 to 153 deg" in ended.out
    said = cli("log", "lift0.txt", "--columns", "1:ms 2:deg 3:A", "--commanded", "153deg@0s", "--json")
    assert [one["signal"] for one in said.data["logs"][0]["columns"]] == [
        "time", "output_angle", "supply_current", "command_angle"]
    assert cli("fit", "lift0.txt", "--servo", "hitec-hs-755hb", "--columns", "1:ms 2:deg 3:A").error.count(
        "--commanded 153deg@0s") == 1


RAW = ["t,Goal_Position,Present_Position,Present_Speed,Present_Voltage,Present_Current", *(
    f"{0.02 * k:.2f},{2048 + 100 * (k > 5)},{2048 + min(10 * max(k - 7, 0), 100)},{32768 + k},74,{k % 9}"
    for k in range(60)), ""]


def test_raw_registers_are_asked_for_and_read_when_they_are_said(cli):
    Path("raw.csv").write_text("\n".join(RAW))
    assert "allowed: --registers feetech-sts, or a model" in cli("log", "raw.csv", "--out", "si.csv").error
    assert "did you mean 'feetech-sts'" in cli("log", "raw.csv", "--out", "si.csv", "--registers", "feetech").error
    assert [path.name for path in Path().iterdir()] == ["raw.csv"]
    shown = cli("log", "raw.csv", "--out", "si.csv", "--registers", "feetech-sts").out
    assert "Present_Current   armature_current  6.5mA               --registers feetech-sts" in shown
    log, = read_logs("si.csv")
    np.testing.assert_allclose(np.degrees(log.command[-1]), 100 * 360.0 / 4096.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(np.degrees(log.measured["output_speed"]), -np.arange(60) * 360.0 / 4096.0, atol=1e-9)
    np.testing.assert_allclose(log.measured["bus_voltage"], 7.4)


def test_a_servo_says_whose_raw_registers_they_are(cli):
    Path("raw.csv").write_text("\n".join(RAW))
    shown = cli("validate", "feetech-sts3215-7v4", "raw.csv").out
    assert "Present_Current   armature_current  6.5mA               register of STS3215-7V4" in shown
    assert [path.name for path in Path().iterdir()] == ["raw.csv"]


def test_a_clean_log_is_left_as_it_is(cli):
    rows = clean_rows(4)
    Path("run.csv").write_text(rows.text())
    found, = cli("log", "run.csv", "--out", "again.csv", "--json").data["logs"]
    assert found["remarks"] == []
    log, again = read_logs("run.csv")[0], read_logs("again.csv")[0]
    assert np.array_equal(log.time, again.time)
    assert np.array_equal(log.command, again.command)
    assert np.array_equal(log.measured["output_angle"], again.measured["output_angle"])


@pytest.mark.long
def test_measured_logs_raise_few_doubts(data_folder):
    from servotwin.identification.survey.survey import survey_of

    logs = [log for path in sorted((data_folder / "bam_xl330" / "raw").glob("*.json")) for log in read_logs(path)]
    logs += read_logs(data_folder / "miuzei_25kg" / "runs.json")
    assert len(logs) > 60
    assert [(log.name, survey_of(log).wrong) for log in logs if survey_of(log).wrong] == []


def test_a_column_that_is_not_the_command_is_doubted(data_folder):
    """The second servo moves while the command of the column `u2` stands."""
    from servotwin.identification.survey.survey import survey_of

    path, = (data_folder / "maccepa_hitec").glob("servo2_step90*.csv")
    log, = read_logs(path, columns="time=%time:ns command=field.u2:rad angle=field.servo2_position:rad")
    assert "look which column is the command" in survey_of(log).wrong[0]
