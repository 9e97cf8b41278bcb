"""The code of README and guide runs, and prints what it says that it prints."""

import contextlib
import io
import re
import shlex
import shutil
import subprocess
import sys
from importlib.resources import files

import pytest

import servotwin as st
from docs.pages import PAGES, ROOT, blocks, promised, with_code


def name_of(page):
    return page.relative_to(ROOT).as_posix()


@pytest.mark.long(but="docs/guide/signals.md")
@pytest.mark.parametrize("page", with_code("python"), ids=name_of)
def test_python(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for block in blocks(page, "python"):
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile("\n" * block.line + block.code, str(page), "exec"), names)
        assert printed.getvalue().splitlines() == promised(block.code), f"{name_of(page)}, line {block.line}"


@pytest.mark.long(but="docs/guide/ticks.md")
@pytest.mark.parametrize("page", with_code("c"), ids=name_of)
def test_programs_in_c(page, tmp_path):
    """What includes the header compiles with it."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: cc is not found")
    (tmp_path / "servotwin.h").write_bytes(files("servotwin.simulation").joinpath("servotwin.h").read_bytes())
    programs = [block.code for block in blocks(page, "c") if "#include" in block.code]
    for name in {name for text in programs for name in re.findall(r'#include "(\w+)\.h"', text)} - {"servotwin"}:
        st.export.c(st.PulseServo(st.load_servo(name.replace("_", "-")))).write(tmp_path, overwrite=True)
    assert programs
    for text in programs:
        subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I", tmp_path, "-x",
                        "c", "-"], input=text, text=True, check=True)


SERVES = ("$ servotwin web", "$ servotwin wire")  # until they are interrupted: tests/web and tests/wire run them


def consoles():
    """The commands of each block."""
    return [[line[2:] for line in re.sub(r"\\\n\s*", "", block.code).splitlines()
             if line.startswith("$ servotwin ") and not line.startswith(SERVES)]
            for page in PAGES for block in blocks(page, "console")]


def commands():
    return list(dict.fromkeys(line for lines in consoles() for line in lines))


def makers(line):
    """The commands above one, in its block, that write a file which it reads."""
    above = next(lines[:lines.index(line)] for lines in consoles() if line in lines)
    return [one for one in above if "--out " in one and one.split("--out ")[1].split()[0] in line.split()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the servo file, the robot and the motion that the guide writes."""
    place = tmp_path_factory.mktemp("guide")
    page = ROOT / "docs" / "guide" / "servos.md"
    text = next(block.code for block in blocks(page, "python") if "my-servo.toml" in block.code)
    (place / "my-servo.toml").write_text(re.search(r'"""\n(.*?)"""', text, re.DOTALL)[1], encoding="utf-8")
    robot = next(block.code for block in blocks(ROOT / "docs" / "guide" / "robot-run.md", "python"))
    with contextlib.chdir(place):
        exec(robot, {})
    return place


@pytest.mark.slow
@pytest.mark.parametrize("line", commands())
def test_command_line(line, folder):
    for one in (*makers(line), line):
        words = [sys.executable, "-m", *shlex.split(one), *(["--force"] if "--plot" in one or "--out" in one else [])]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_the_pages_are_found():
    assert len(with_code("python")) >= 10
    assert len(commands()) >= 6
