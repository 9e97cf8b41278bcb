"""Which numbers kernels do not know, and how it is kept."""

import json

import pytest

from servotwin.simulation.compile import reading, unread
from servotwin.simulation.lane_recipes import GAP_RUNS, PLAIN_RUNS, side_by_side

BY_GAPS = side_by_side(5, "float64", False, False)
find = unread.unread.__wrapped__  # without its own memory


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_lanes_side_by_side_do_not_know_steps_of_the_potentiometer(folder):
    assert "sensor.step" in find(BY_GAPS)
    assert "sensor.step" not in find(GAP_RUNS)


def test_it_is_found_once_on_a_machine(folder, monkeypatch):
    before = find(PLAIN_RUNS)
    (file,) = folder.iterdir()
    assert tuple(json.loads(file.read_text())["unread"]) == before
    monkeypatch.setattr(reading, "unread_numbers", None)
    assert find(PLAIN_RUNS) == before


@pytest.mark.parametrize("text", ["", "[]", '{"unread": 1}', "{}", '{"unread": ["heat.C_w"'])
def test_what_cannot_be_read_is_found_again(folder, text):
    before = find(PLAIN_RUNS)
    (file,) = folder.iterdir()
    file.write_text(text)
    assert find(PLAIN_RUNS) == before
    assert json.loads(file.read_text())["unread"] == list(before)


def test_a_cache_that_cannot_be_written_costs_the_time_alone(folder, capfd):
    folder.write_text("not a folder")
    assert "elastic.J" in find(PLAIN_RUNS)
    assert capfd.readouterr() == ("", "")


def test_what_came_with_the_package_comes_first(folder, tmp_path, monkeypatch):
    find(PLAIN_RUNS)
    (file,) = folder.iterdir()
    (tmp_path / file.name).write_text('{"unread": ["shaft.J"]}')
    monkeypatch.setattr(unread, "shipped_folder", lambda: tmp_path)
    assert find(PLAIN_RUNS) == ("shaft.J",)
