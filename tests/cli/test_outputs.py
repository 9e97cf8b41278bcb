"""Outputs are checked before anything is computed, and are written whole or not at all."""

import json
from pathlib import Path

import pytest

from servotwin import plotting, simulation
from servotwin.cli.output_files import Target, check_targets, staged, text_of, write_files
from servotwin.cli.robot_report import RobotResult, carried_out
from servotwin.errors import OutputError, OutputExistsError

STEP = ["--step", "0:90"]


@pytest.fixture
def never_simulated(monkeypatch):
    def refuse(*_, **__):
        pytest.fail("computed before the outputs were checked")

    monkeypatch.setattr(simulation, "simulate", refuse)


@pytest.mark.long(but="words11-is the same file as --out there.csv")
@pytest.mark.parametrize(("words", "said"), [
    (["--out", "there.csv"], "there.csv exists already; use --force"),
    (["--plot", "there.png"], "there.png exists already"),
    (["--out", "new.csv", "--plot", "there.png"], "there.png exists already"),
    (["--out", "none/run.csv"], "the folder none does not exist"),
    (["--out", "there.csv/run.csv"], "there.csv is no folder"),
    (["--plot", "there.csv/run.png"], "there.csv is no folder"),
    (["--out", "folder.csv", "--force"], "is a folder"),
    (["--out", "run.xlsx"], "allowed: a name that ends in .csv"),
    (["--plot", "run.jpg"], "allowed: a name that ends in .png, .svg, .pdf"),
    (["--plot", "run"], "allowed: a name that ends in .png, .svg, .pdf"),
    (["--out", "x.csv", "--plot", "x.csv"], "--plot x.csv is the same file as --out x.csv"),
    (["--out", "there.csv", "--plot", "link.png", "--force"], "is the same file as --out there.csv"),
    (["--out", "loop.csv"], "--out loop.csv"),
    (["--out", "a" * 300 + ".csv"], "cannot be written"),
    (["--out", ""], "--out"),
])
@pytest.mark.usefixtures("never_simulated")
def test_what_cannot_be_written_is_told_first(simulate, tmp_path, words, said):
    (tmp_path / "there.csv").write_text("kept")
    (tmp_path / "there.png").write_text("kept")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "link.png").symlink_to("there.csv")
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    before = sorted(tmp_path.iterdir())
    assert said in simulate(*STEP, *words).error
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "there.csv").read_text() == (tmp_path / "there.png").read_text() == "kept"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc here")
@pytest.mark.usefixtures("never_simulated")
def test_a_folder_that_takes_no_files_even_from_root(simulate):
    assert "--out /proc/run.csv cannot be written" in simulate(*STEP, "--out", "/proc/run.csv").error


def test_only_regular_files_are_replaced(simulate, tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe.csv")
    assert "no regular file" in simulate(*STEP, "--out", "pipe.csv", "--force").error


@pytest.mark.long
def test_force_replaces_and_a_link_stays_a_link(simulate, tmp_path):
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    assert simulate(*STEP, "--out", "link.csv", "--force").code == 0
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text().startswith("time_s,")


def test_an_input_is_never_replaced(simulate, tmp_path):
    text = "time_s,pulse_width_us\n0,1500\n"
    (tmp_path / "in.csv").write_text(text)
    (tmp_path / "torque.csv").write_text("time_s,torque_Nm\n0,0\n2,0\n")
    words = ["--command", "in.csv", "--out", "./in.csv", "--force"]
    assert "is the same file as the input in.csv" in simulate(*words).error
    assert "the input torque.csv" in simulate(*STEP, "--load", "recorded=torque.csv", "--out", "torque.csv",
                                              "--force").error
    assert (tmp_path / "in.csv").read_text() == text


def test_if_the_picture_fails_the_table_is_not_written(simulate, tmp_path, monkeypatch):
    (tmp_path / "run.csv").write_text("old")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(plotting, "save", full)
    words = [*STEP, "--out", "run.csv", "--plot", "run.png", "--force"]
    assert "No space left on device" in simulate(*words).error
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]
    assert (tmp_path / "run.csv").read_text() == "old"


@pytest.mark.long
def test_a_full_disk_names_the_file_that_was_asked_for(child_environment, tmp_path):
    import subprocess
    import sys

    limited = ("import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000));"
               "from servotwin.cli import main; sys.exit(main(sys.argv[1:]))")
    words = ["simulate", "hitec-hs-755hb", *STEP, "--out", "run.csv"]
    done = subprocess.run([sys.executable, "-c", limited, *words], capture_output=True, text=True,
                          env=child_environment, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (2, "servotwin: error: --out run.csv cannot be written (File too large)\n")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_writes_nothing(simulate, tmp_path, monkeypatch):
    from servotwin.errors import SimulationError

    def fail(self):
        raise SimulationError("DIVERGED", 0.5, "the state is no longer finite")

    monkeypatch.setattr(simulation.Result, "raise_if_failed", fail)
    assert simulate(*STEP, "--out", "run.csv").error == (
        "simulation ended at t = 0.5 s: the state is no longer finite")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_comes_meanwhile_is_kept(tmp_path):
    target = Target(option="--out", path=tmp_path / "run.csv", endings=(".csv",))
    check_targets([target], force=False)

    def meanwhile():
        with staged([target], force=False) as drafts:
            drafts[0].write_text("new")
            target.path.write_text("of another")

    with pytest.raises(OutputExistsError):
        meanwhile()
    assert target.path.read_text() == "of another"
    assert list(tmp_path.iterdir()) == [target.path]


def test_names_that_no_system_takes(tmp_path):
    target = Target(option="--out", path=tmp_path / "a\0b.csv", endings=(".csv",))
    with pytest.raises(OutputError, match="--out"):
        check_targets([target], force=False)


def test_a_file_that_came_after_the_check_is_not_replaced(tmp_path):
    targets = [Target(option="--out", path=tmp_path / name, endings=(".txt",)) for name in ("a.txt", "b.txt")]
    writers = {"a.txt": text_of("new"), "b.txt": text_of(lambda: "new")}
    (tmp_path / "b.txt").write_text("old")
    with pytest.raises(OutputExistsError):
        write_files(targets, writers, force=False)
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["old"]
    write_files(targets, writers, force=True)
    assert [path.read_text() for path in sorted(tmp_path.iterdir())] == ["new", "new"]


def test_commands_of_robots_check_their_files_before_the_work(tmp_path, capsys):
    out, motion, done = tmp_path / "out", tmp_path / "out" / "motion.csv", []

    def work():
        done.append(1)
        return RobotResult(facts={"robot": "arm"}, title="an arm", lines=lambda more: [f"{name} {text}" for name, text
                                                                                        in more],
                           writers=lambda: {name: text_of(name) for name in ("motion.csv", "page.html")})

    def carry(**how):
        return carried_out(work, out, ["motion.csv", "page.html"], **{"force": False, "as_json": False, **how})

    assert carry().facts["files"] == [str(motion), str(out / "page.html")]
    assert capsys.readouterr().out.split() == ["an", "arm", "written", str(out / "page.html")]  # a long path wraps
    with pytest.raises(OutputExistsError):
        carry()
    with pytest.raises(OutputError, match="is the same file as the input"):
        carry(force=True, inputs=[motion])
    assert done == [1]
    carry(force=True, as_json=True)
    assert json.loads(capsys.readouterr().out)["files"][-1] == str(out / "page.html")
    assert carried_out(work, None, ["motion.csv"], force=False, as_json=False).facts["files"] == []


def test_a_robot_that_fails_leaves_no_folder(tmp_path):
    def fail():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        carried_out(fail, tmp_path / "out", ["page.html"], force=False, as_json=False)
    assert list(tmp_path.iterdir()) == []
