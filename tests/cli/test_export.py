"""`servotwin export c`: what it writes and says, and what it refuses in one line."""

import json

import pytest

from servotwin.cli import main

SERVO = "hitec-hs-755hb"


@pytest.mark.long
def test_it_writes_two_files_and_says_what_is_left_out(tmp_path, capsys):
    assert main(["export", "c", SERVO, "--out", str(tmp_path / "firmware"), "--load", "inertia=1e-3", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["model"] == "PulseServo"
    assert "heat" in told["left_out"]
    files = sorted((tmp_path / "firmware").iterdir())
    assert sorted(told["files"]) == [str(path) for path in files]
    assert [path.name for path in files] == ["hitec_hs_755hb.c", "hitec_hs_755hb.h"]


@pytest.mark.long
def test_name_model_and_parameters(tmp_path):
    assert main(["export", "c", SERVO, "--model", "bounded", "--name", "elbow", "--parameters", "--out",
                 str(tmp_path)]) == 0
    assert "int elbow_make(" in (tmp_path / "elbow.h").read_text()


@pytest.mark.parametrize(("words", "said"), [
    (["--model", "dc-motor", "--set", "motor.armature_inductance=1e-3"], "DCMotor"), (["--name", "9"], "name"),
    (["--model", "pulsed"], "pulsed"), (["--load", "recorded=none.csv"], "none.csv"),
    (["--accuracy", "2"], "accuracy")])
def test_what_is_not_possible_is_said_in_a_line_and_nothing_is_written(words, said, tmp_path, capsys):
    assert main(["export", "c", SERVO, "--out", str(tmp_path / "new"), *words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert said in lines[0]
    assert not (tmp_path / "new").exists()


@pytest.mark.long
def test_files_stay_unless_forced(tmp_path, capsys):
    words = ["export", "c", SERVO, "--model", "bounded", "--out", str(tmp_path)]
    assert main(words) == 0
    (tmp_path / "hitec_hs_755hb.c").write_text("mine")
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert (tmp_path / "hitec_hs_755hb.c").read_text() == "mine"
    assert main([*words, "--force"]) == 0
    assert (tmp_path / "hitec_hs_755hb.c").read_text() != "mine"


@pytest.mark.long
def test_a_folder_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "file").write_text("x")
    assert main(["export", "c", SERVO, "--model", "bounded", "--out", str(tmp_path / "file" / "below")]) == 2
    assert "cannot be written" in capsys.readouterr().err
