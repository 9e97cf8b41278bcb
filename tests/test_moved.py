"""Documented import paths of modules that have moved lead to the new place for a release, and warn."""

import importlib
import sys

import pytest

from servotwin.moved import MOVED

WANTED = {"servotwin.robots.steering": "STEERINGS", "servotwin.robots.comparison": "Comparison",
          "servotwin.robots.controlled": "DrivePort", "servotwin.robots.kinematics": "follow",
          "servotwin.robots.redundancy": "LeastMotion", "servotwin.bench.emulator.paper_chain": "chain_rows",
          "servotwin.robots.arm": "two_link", "servotwin.robots.controllers": "STEERINGS",
          "servotwin.robots.task_run": "run_task", "servotwin.robots.tasks": "task_path"}


@pytest.mark.parametrize("old", MOVED)
def test_an_old_path_has_what_the_new_one_has_and_warns(old):
    pytest.importorskip("mujoco", reason="the extra `robots` is not installed")
    new = importlib.import_module(MOVED[old])
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"{old} has moved to {MOVED[old]}"):
        found = importlib.import_module(old)
    assert getattr(found, WANTED[old]) is getattr(new, WANTED[old])


def test_what_never_was_there_is_missing_as_ever():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("servotwin.robots.hovercraft")
