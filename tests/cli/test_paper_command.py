"""`servotwin paper` passes on what it is told; what the report holds is tested with the report."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from servotwin.errors import OutputExistsError


@pytest.fixture
def asked(monkeypatch):
    calls = []

    def write(out, *, force, formats, progress, moving):
        calls.append((out, force, formats))
        progress("drawing", 0.5)
        progress("drawing", 0.6)
        progress("done", 1.0)
        if out.exists() and not force:
            raise OutputExistsError(out)
        return SimpleNamespace(folder=out, page=out / "report.html", figures=(out / "figures" / "a.png",), data=(),
                               numbers={"worst_angle_deg": 0.98765432}, left_out="")

    monkeypatch.setattr("servotwin.paper.write_paper_report", write)
    return calls


def test_paths_and_headline_numbers(cli, asked):
    ended = cli("paper")
    assert ended.code == 0
    assert asked == [(Path("paper-report"), False, ["png"])]
    assert "paper-report/report.html" in ended.out
    assert "worst_angle_deg  0.98765" in ended.out
    assert ended.err == " 50 % drawing\n100 % done\n"


def test_json(cli, asked):
    found = cli("paper", "--out", "here", "--force", "--formats", "svg,pdf", "--json").data
    assert asked == [(Path("here"), True, ["svg", "pdf"])]
    assert found == {"folder": "here", "report": "here/report.html", "figures": ["here/figures/a.png"], "data": [],
                     "numbers": {"worst_angle_deg": 0.98765432}, "left_out": ""}


@pytest.mark.usefixtures("asked")
def test_a_report_that_is_there(cli, tmp_path):
    ended = cli("paper", "--out", tmp_path)
    assert ended.code == 2
    assert ended.err.splitlines()[-1].startswith(f"servotwin: error: {tmp_path} exists already")


def test_a_format_that_is_none(cli, tmp_path):
    assert "png, svg, pdf" in cli("paper", "--out", tmp_path / "new", "--formats", "png,bmp").error
    assert not (tmp_path / "new").exists()


def test_a_place_that_cannot_be(cli, tmp_path):
    (tmp_path / "file").write_text("kept")
    assert "file" in cli("paper", "--out", "file/report").error
    assert (tmp_path / "file").read_text() == "kept"
