"""The numbers of docs/theory/averaging.md are those of a new run."""

import importlib.util
import re

import pytest

from docs.pages import ROOT

PAGE = ROOT / "docs" / "theory" / "averaging.md"


def module(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / "_ext" / f"{name}.py")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def set_s():
    return module("set_s")


@pytest.mark.long(but="step")
@pytest.mark.parametrize("name", ["sag", "stiffness", "step"])
def test_the_table_is_the_one_that_the_runs_give(set_s, name):
    assert set_s.TABLES[name]() in PAGE.read_text(encoding="utf-8")


def test_no_table_of_the_page_goes_unchecked(set_s):
    text = PAGE.read_text(encoding="utf-8")
    assert len(re.findall(r"^\| ---", text, re.MULTILINE)) == len(set_s.TABLES)


def test_the_rule_for_short_drives_gives_the_number_that_is_said(set_s):
    inertia, stalled = 6e-3, set_s.DRIVE_VOLTAGE / set_s.R
    start, stop = (set_s.K_OUT * stalled - set_s.FRICTION) / inertia, set_s.FRICTION / inertia
    g = 0.5 * set_s.PULSE_PER_RADIAN * start * (1.0 + start / stop) * set_s.STRETCHER**2
    u_0 = set_s.PULSE_PER_RADIAN * 2.0 / 57.29578 - 0.5 * set_s.DEADBAND
    left = (u_0 / (1.0 + 50 * g * u_0) + 0.5 * set_s.DEADBAND) / set_s.PULSE_PER_RADIAN
    assert f"{2.0 - 57.29578 * left:.2f}° after 50 frames" in PAGE.read_text(encoding="utf-8")


def test_every_picture_of_the_theory_is_there():
    named = {name for page in (ROOT / "docs" / "theory").glob("*.md")
             for name in re.findall(r"\]\(\.\./images/([\w.]+)\)", page.read_text(encoding="utf-8"))}
    assert {"pulse_frame.png", "pulse_sag.png", "pulse_small_step.png"} <= named
    assert {name for name in named if not (ROOT / "docs" / "images" / name).is_file()} == set()
