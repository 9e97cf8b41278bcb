"""Which numbers kernels do not know of which no term says where they act, and how it is kept."""

import json

import pytest

from servotwin.models.engine.batch import tiles
from servotwin.models.terms.numbers import ACTS
from servotwin.simulation.compile.text import reading, unread
from servotwin.simulation.lanes.forms import DIGITAL, side_by_side

pytestmark = pytest.mark.long

SILENT = ("shaft.b_out", "stops.restitution")
BY_GAPS = side_by_side(tiles.GAPS, "float64")
find = unread.unread.__wrapped__  # without its own memory


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SERVOTWIN_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(reading, "ACTS", {path: acts for path, acts in ACTS.items() if path not in SILENT})
    return tmp_path / "cache"


def test_what_a_term_says_is_known_where_it_is_read(folder, monkeypatch):
    """Lanes side by side leave stops to others, and go through the play by a law of their own."""
    assert set(find(BY_GAPS)) == {"shaft.b_out", "stops.restitution"}
    assert find(DIGITAL) == ()
    monkeypatch.setattr(reading, "ACTS", ACTS)
    assert list(reading.unread_numbers(BY_GAPS, ())) == []


def test_it_is_found_once_on_a_machine(folder, monkeypatch):
    before = find(BY_GAPS)
    (file,) = folder.iterdir()
    assert tuple(json.loads(file.read_text())["unread"]) == before
    monkeypatch.setattr(reading, "unread_numbers", None)
    assert find(BY_GAPS) == before


@pytest.mark.parametrize("text", ["", "[]", '{"unread": 1}', "{}", '{"unread": ["heat.C_w"'])
def test_what_cannot_be_read_is_found_again(folder, text):
    before = find(BY_GAPS)
    (file,) = folder.iterdir()
    file.write_text(text)
    assert find(BY_GAPS) == before
    assert json.loads(file.read_text())["unread"] == list(before)


def test_a_cache_that_cannot_be_written_costs_the_time_alone(folder, capfd):
    folder.write_text("not a folder")
    assert "stops.restitution" in find(BY_GAPS)
    assert capfd.readouterr() == ("", "")


def test_what_came_with_the_package_comes_first(folder, tmp_path, monkeypatch):
    find(BY_GAPS)
    (file,) = folder.iterdir()
    (tmp_path / file.name).write_text('{"unread": ["shaft.J"]}')
    monkeypatch.setattr(unread, "shipped_folder", lambda: tmp_path)
    assert find(BY_GAPS) == ("shaft.J",)
