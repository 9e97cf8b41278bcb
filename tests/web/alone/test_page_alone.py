"""The page as one file: what it is made of, how large it is, what it says where it cannot be made."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import servotwin.web
from servotwin.cli.commands import app
from servotwin.web.alone import page
from servotwin.web.alone.page import modules

JS = Path(servotwin.web.__file__).parent / "alone" / "js"
LARGEST = 450_000  # bytes
TRIVIAL = {"0", "1", "2", "10", "1000"}  # places, halves, the base of what is written, milliseconds in a second


def test_no_module_that_computes_holds_a_number():
    """A law or a limit of its own would be one."""
    for path in sorted(JS.glob("*.js")):
        text = re.sub(r"//.*|/\*.*?\*/", "", path.read_text(), flags=re.S)
        text = re.sub(r"`[^`]*`|\"[^\"\n]*\"|/(?:[^/\n\\]|\\.)+/[a-z]*", "", text)
        found = set(re.findall(r"(?<![\w.$])\d[\d_.e-]*", text)) - TRIVIAL
        assert not found, (path.name, found)


def test_every_module_finds_what_it_imports():
    found = modules()
    for name, text in found.items():
        for other in re.findall(r"""^import\b[^;]*?["']([^"']+)["'];""", text, re.M):
            assert other in found, (name, other)


def exported(*options):
    """Return what `servotwin web --export` does."""
    return CliRunner().invoke(app, ["web", "--export", *map(str, options)])


@pytest.mark.long
def test_what_cannot_be_written_is_said_in_a_line(tmp_path, monkeypatch):
    there = tmp_path / "there.html"
    there.write_text("mine")
    for target, words in ((there, "exists already"), (tmp_path / "no" / "a.html", "does not exist"),
                          (tmp_path / "a.txt", "ends in .html")):
        done = exported(target)
        assert done.exit_code != 0
        assert words in str(done.exception or done.output)
    assert there.read_text() == "mine"
    page.module.cache_clear()
    monkeypatch.setattr(page, "compilers", tuple)
    done = exported(tmp_path / "a.html")
    assert re.search(r"no compiler makes WebAssembly \(no C compiler\): install .* ziglang", str(done.exception))
    assert [path.name for path in tmp_path.iterdir()] == ["there.html"]


@pytest.mark.long
def test_a_bench_as_a_file_is_small_and_asks_for_nothing(tmp_path):
    name = "</script><script>document.title = 'planted'</script>"
    (tmp_path / "scene.toml").write_text(f'format = 1\nname = "{name}"\n[[servo]]\nid = "hitec-hs-755hb"\n')
    done = exported(tmp_path / "a.html", "--scene", tmp_path / "scene.toml")
    if isinstance(done.exception, page.NoCompilerError):
        pytest.skip(str(done.exception))
    assert done.exit_code == 0, done.exception
    text = (tmp_path / "a.html").read_text()
    assert len(text) < LARGEST
    head = re.sub(r'<script type="application/gzip".*?</script>', "", text, flags=re.S)
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)""", head)
    assert "default-src 'none'" in head
    assert "planted" not in text  # what a scene calls itself travels packed
