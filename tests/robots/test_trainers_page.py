"""The code of the page about trainers, where their packages are installed: each in an environment of its own."""

import contextlib
import io
import re
import sys
from importlib import import_module

import pytest

from docs.pages import ROOT, blocks, promised
from servotwin.errors import MissingExtraError

PAGE = ROOT / "docs" / "guide" / "trainers.md"
pytestmark = pytest.mark.slow


def trainer_of(code):
    """Return the package that a block is about."""
    names = ("mjlab", "newton", "mujoco_warp")
    return next(name for name in names if re.search(rf"^(import|from) {name}\b", code, re.M))


@pytest.mark.parametrize("block", blocks(PAGE, "py")[1:], ids=lambda block: trainer_of(block.code))
def test_code_runs_and_prints_what_it_says(block):
    pytest.importorskip(trainer_of(block.code))
    import warp

    warp.set_device("cpu")
    names = {"__name__": "page"}
    warp.config.quiet = True
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(blocks(PAGE, "py")[0].code, str(PAGE), "exec"), names)
        exec(compile("\n" * block.line + block.code, str(PAGE), "exec"), names)
    assert [line for line in printed.getvalue().splitlines() if not line.startswith("Module ")] == promised(block.code)


@pytest.mark.parametrize("name", ["mjlab", "newton"])
def test_a_trainer_that_is_not_installed_is_named_with_its_extra(name, monkeypatch):
    for part in (name, f"{name}.actuator"):
        monkeypatch.setitem(sys.modules, part, None)
    monkeypatch.delitem(sys.modules, f"servotwin.robots.trainers.{name}", raising=False)
    with pytest.raises(MissingExtraError, match=rf"is needed for this: pip install 'servotwin\[(warp|{name})\]'"):
        import_module(f"servotwin.robots.trainers.{name}")
