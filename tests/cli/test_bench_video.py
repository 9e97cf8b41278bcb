"""`servotwin bench marker` and `servotwin bench video`: files, words and errors."""

import json

import numpy as np
import pytest
import typer

pytest.importorskip("cv2", reason="the extra `video` is not installed")

from bench.clips import Scene, film
from servotwin.cli import commands
from servotwin.cli.bench import marker, video
from servotwin.logs import read_logs


@pytest.fixture
def bench(cli, monkeypatch):
    whole, group = typer.Typer(), typer.Typer()
    group.command("marker")(marker)
    group.command("video")(video)
    whole.add_typer(group, name="bench")
    monkeypatch.setattr(commands, "app", whole)
    return lambda *words: cli("bench", *words)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    scene = Scene(side=60.0, size=(240, 200), lamp=(225, 5, 10, 0.2))
    return film(tmp_path_factory.mktemp("clip") / "clip.mp4", scene,
                lambda time: -min(max(4.0 * (time - 0.4), 0.0), 1.0), np.arange(30) / 30.0)


@pytest.fixture
def log(tmp_path):
    (tmp_path / "run.csv").write_text("time_s,pulse_width_us\n0,1500\n0.2,1700\n1,1700\n")
    return tmp_path / "run.csv"


def test_a_mark_is_written_once(bench, tmp_path):
    for name in ("mark.svg", "mark.pdf", "mark.png"):
        ended = bench("marker", "--side", "16mm", "--out", name)
        assert (ended.code, (tmp_path / name).stat().st_size > 500) == (0, True)
    assert "black side 16 mm" in ended.out
    assert "use --force" in bench("marker", "--out", "mark.svg").error
    assert bench("marker", "--out", "mark.svg", "--id", "1", "--force").code == 0


@pytest.mark.parametrize(("words", "says"), [
    (("--out", "mark.gif"), ".svg, .pdf, .png"), (("--out", "m.svg", "--side", "20"), "--side"),
    (("--out", "m.svg", "--side", "2mm"), "5 mm to 200 mm"), (("--out", "m.svg", "--id", "77"), "0 to 49"),
    (("--out", "m.png", "--dpi", "9"), "72 to 2400")])
def test_marks_that_cannot_be(bench, tmp_path, words, says):
    assert says in bench("marker", *words).error
    assert not list(tmp_path.iterdir())


def test_a_clip_becomes_a_log(bench, clip, log, tmp_path):
    ended = bench("video", clip, "--log", log, "--instant", "led", "--flip", "--out", "filmed.csv", "--json")
    assert ended.code == 0, ended.err
    assert ended.data["files"] == ["filmed.csv", "filmed.json"]
    assert ended.data["remarks"] == []
    assert ended.data["video"]["mark"] == 0
    read, = read_logs(tmp_path / "filmed.csv")
    seen = read.used("output_angle")
    angle = np.degrees(read.measured["output_angle"][seen])
    assert angle[-1] - angle[0] == pytest.approx(57.3, abs=0.5)
    again = bench("video", clip, "--log", log, "--out", "filmed.csv")
    assert "use --force" in again.error
    shown = bench("video", clip, "--log", log, "--led", "220,0,20,20", "--zero", "12deg", "--out", "filmed.csv",
                  "--force")
    assert "--flip counts the other way" in shown.out
    assert "time 0   led" in shown.out


def test_without_a_log_the_command_is_missing_and_said_to_be(bench, clip, tmp_path):
    ended = bench("video", clip, "--instant", "0.2s", "--zero", "12deg", "--out", "bare.csv")
    assert "there is no command in it" in ended.out
    rows = (tmp_path / "bare.csv").read_text().splitlines()
    assert rows[0] == "time_s,output_angle_deg"
    first = [float(cell) for cell in rows[1].split(",")]
    assert first == pytest.approx([-0.2, 12.0])
    assert json.loads((tmp_path / "bare.json").read_text())["recorded"]["video"]["instant"]["kind"] == "given"


@pytest.mark.parametrize(("words", "says"), [
    (("--led", "1,2,3"), "--led"), (("--led", "-1,2,3,4"), "--led"), (("--instant", "soon"), "led, jump, none"),
    (("--led", "1,2,3,4", "--instant", "jump"), "with --instant jump"), (("--zero", "12"), "--zero"),
    (("--instant", "7s"), "a time in the clip"), (("--log", "gone.csv"), "no such file"), (("--id", "5"), "mark 5"),
    (("--slow", "0"), "slow")])
def test_bad_words_write_nothing(bench, clip, tmp_path, words, says):
    assert says in bench("video", clip, "--out", "out.csv", *words).error
    assert not list(tmp_path.iterdir())


def test_bad_places(bench, clip, tmp_path):
    assert ".csv" in bench("video", clip, "--out", "out.txt").error
    assert "no such file" in bench("video", "gone.mp4", "--out", "out.csv").error
    (tmp_path / "cut.mp4").write_bytes(clip.read_bytes()[:4000])
    assert "the clip is cut" in bench("video", "cut.mp4", "--out", "out.csv").error
    assert [one.name for one in tmp_path.iterdir()] == ["cut.mp4"]
