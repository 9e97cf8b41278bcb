"""The report of the paper: complete, self-contained, and never half written."""

import csv
import os
import re
import sys
from html.parser import HTMLParser

import pytest

from servotwin.errors import OutputError, OutputExistsError
from servotwin.paper import page as pages
from servotwin.paper import report as paper
from servotwin.parameters import load_servo

MODELS = ("averaged", "bounded", "pulse")
NUMBERS = (2, 4, 5, 6, 8, 13, 14, 15, 16, 17, 22, 23, 24, 25, 26, 27, 28, 29, 30)
VOID = {"meta", "img", "br", "hr", "link", "input", "wbr"}


class Structure(HTMLParser):
    """Checks that tags close in order, and collects identifiers, links and sources."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.loads, self.errors, self.words = [], [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in attributes:
            self.ids.append(attributes["id"])
        if tag == "a":
            self.links.append(attributes["href"])
        self.loads += [value for name, value in attrs if name in ("src", "srcset", "data") and value is not None]
        if tag in ("script", "link", "iframe", "object"):
            self.errors.append(tag)
        if tag == "img" and not attributes.get("alt"):
            self.errors.append("img without alt")

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.errors.append(f"</{tag}> out of order")

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    told = []
    out = tmp_path_factory.mktemp("paper") / "deep" / "report"
    made = paper.write_paper_report(out, force=False, progress=lambda words, done: told.append(done))
    return made, told


@pytest.fixture(scope="module")
def page(report):
    parser = Structure()
    parser.feed(report[0].page.read_text(encoding="utf-8"))
    return parser


@pytest.mark.long
def test_progress_rises_to_one(report):
    assert report[1] == sorted(report[1])
    assert report[1][-1] == 1.0


@pytest.mark.long
def test_every_figure_is_there(report):
    names = {path.name for path in report[0].figures}
    for number in NUMBERS:
        assert f"figure-{number:02d}.png" in names
    assert all(path.stat().st_size > 1000 for path in report[0].figures)


@pytest.mark.parametrize("other", ["none", "one that fails"])
def test_robots_are_done_here_where_no_other_process_does_it(monkeypatch, other):
    def none(*command, **named):
        raise OSError("no more processes")
    if other == "none":
        monkeypatch.setattr(paper.subprocess, "Popen", none)
    else:
        monkeypatch.setattr(paper, "_ROBOTS", "raise SystemExit(1)")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with paper._robots_aside(("png",)) as robots_part:
        assert "mujoco" in robots_part().left_out


@pytest.mark.long
def test_every_plot_has_its_numbers(report):
    names = {path.name for path in report[0].data}
    assert {f"figure-{number}.csv" for number in NUMBERS if number > 8} <= names
    for path in report[0].data:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
        assert len(rows) > 1
        assert {len(row) for row in rows} == {len(rows[0])}


@pytest.mark.long
def test_the_vibration_and_its_cure(report, page):
    numbers = report[0].numbers
    assert numbers["common_supply_swing_deg"] > 2.0
    assert numbers["common_supply_swings_per_s"] > 5.0
    assert numbers["separate_supply_swing_deg"] < 0.2
    assert numbers["separate_supply_swings_per_s"] == 0.0
    assert {"vibration", "figure-vibration", "figure-vibration-frames"} <= set(page.ids)
    assert "#vibration" in page.links
    words = re.sub(r"\s+", " ", "".join(page.words))
    assert f"{numbers['common_supply_swing_deg']:.2f}° from end to end, 7 times a second" in words
    with (report[0].folder / "data" / "figure-vibration.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    seen = {name: {float(row[f"{name}_control_supply_V"]) for row in rows if row[f"{name}_control_supply_V"]}
            for name in ("common", "separate")}
    assert seen["separate"] == {6.0}
    assert min(seen["common"]) < 5.0
    assert max(seen["common"]) == 6.0


@pytest.mark.long
def test_the_robots_do_their_tasks(report, page):
    numbers = report[0].numbers
    for name in ("figure_28", "figure_29"):
        assert numbers[f"{name}_feedforward_contour_rms_mm"] < 0.4 * numbers[f"{name}_plain_contour_rms_mm"]
    assert numbers["figure_30_unequal_missed_mm"] > 50.0
    assert {"robots", "figure-28", "figure-29", "figure-30"} <= set(page.ids)
    assert report[0].left_out == ""


def test_without_mujoco_the_robots_are_left_out(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    left_out = pages.run_robots(load_servo("hitec-hs-755hb"))
    assert left_out == "mujoco is needed for this: pip install 'servotwin[robots]'"
    assert pages.robot_pictures(left_out) == ()
    assert left_out in pages.robot_section(left_out)
    assert pages.headline(left_out) == {}


@pytest.mark.long
def test_nothing_else_is_left(report):
    assert sorted(path.name for path in report[0].folder.iterdir()) == ["data", "figures", "report.html"]


@pytest.mark.long
def test_page_is_well_formed(page):
    assert page.errors == []
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)


@pytest.mark.long
def test_page_loads_nothing(report, page):
    assert all(value.startswith("data:") for value in page.loads)
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    text = report[0].page.read_text(encoding="utf-8")
    assert "@import" not in text
    assert not re.search(r"url\(", text)


@pytest.mark.long
def test_page_says_what_matters(page):
    words = re.sub(r"\s+", " ", "".join(page.words))
    for part in ("publishes no parameter values", "61.035", "times the supply", "identified from Table II",
                 "Table I of the paper", "Table II of the paper", "10.7 to 2.9 mV", "66.9°", "11.6 %",
                 "4.8 times narrower", "± 1.70° to ± 0.04°", "pulse, largest", "In the two other models it sticks"):
        assert part in words
    assert not re.search(r"\b(nan|inf|None)\b", words)


@pytest.mark.long
def test_headline_numbers(report):
    numbers = report[0].numbers
    for model in MODELS:
        assert numbers[f"{model}_worst_angle_deg"] <= 1.1
        assert numbers[f"{model}_worst_feedback_voltage_mV"] <= 11.0
        assert numbers[f"{model}_worst_pulse_width_us"] == 0.0
        assert numbers[f"{model}_worst_feedback_count"] <= 5
    assert numbers["averaged_peak_voltage_over_supply"] > 5.0
    assert numbers["bounded_peak_armature_voltage_V"] == pytest.approx(5.6)
    assert numbers["pulse_peak_armature_voltage_V"] == pytest.approx(5.6)
    assert numbers["pulse_top_speed_deg_per_s"] == pytest.approx(numbers["bounded_top_speed_deg_per_s"], rel=1e-3)


@pytest.mark.long
def test_pulses_narrow_the_standing_band(report):
    numbers = report[0].numbers
    assert numbers["bounded_widest_standing_band_deg"] == pytest.approx(2.10, abs=0.01)
    assert numbers["pulse_widest_standing_band_deg"] == pytest.approx(0.44, abs=0.01)
    assert numbers["bounded_widest_friction_band_deg"] > 20.0 * numbers["pulse_widest_friction_band_deg"]


@pytest.mark.long
def test_every_model_is_in_the_numbers_of_the_figures(report):
    for path in report[0].data:
        with path.open(encoding="utf-8", newline="") as file:
            head = next(csv.reader(file))
        named = {model for model in MODELS if any(column.startswith(f"{model}_") for column in head)}
        if path.stem in ("table-2", *(f"figure-{n}" for n in (13, 14, 15, 16, 17, 25, 26, 27)), "figure-standing"):
            assert named == set(MODELS), path.name


@pytest.mark.long
def test_a_report_that_is_there_is_kept(report):
    before = report[0].page.read_bytes()
    with pytest.raises(OutputExistsError):
        paper.write_paper_report(report[0].folder, force=False)
    assert report[0].page.read_bytes() == before


@pytest.fixture
def quick(monkeypatch):
    """Replace the computation by a few bytes."""
    def write(folder, formats, tell):
        for name in ("figures", "data"):
            (folder / name).mkdir()
        (folder / "figures" / "figure-13.png").write_bytes(b"new")
        (folder / "report.html").write_text("new")
        return {}, ""
    monkeypatch.setattr(paper, "_write_all", write)


def test_force_replaces_the_report_and_nothing_else(tmp_path, quick):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "mine.png").write_text("mine")
    (tmp_path / "figures" / "figure-13.svg").write_text("of the older report")
    (tmp_path / "report.html").write_text("old")
    paper.write_paper_report(tmp_path, force=True)
    assert (tmp_path / "report.html").read_text() == "new"
    assert (tmp_path / "figures" / "mine.png").read_text() == "mine"
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == ["figure-13.png", "mine.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "figures", "report.html"]


def test_a_folder_with_other_files_is_fine(tmp_path, quick):
    (tmp_path / "notes.txt").write_text("mine")
    paper.write_paper_report(tmp_path, force=False)
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_no_trace(tmp_path, monkeypatch, error):
    def fail(folder, formats, tell):
        (folder / "report.html").write_text("half")
        raise error
    monkeypatch.setattr(paper, "_write_all", fail)
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "report.html").write_text("old")
    with pytest.raises(OutputError if isinstance(error, OSError) else KeyboardInterrupt):
        paper.write_paper_report(tmp_path / "old", force=True)
    assert os.listdir(tmp_path / "old") == ["report.html"]
    assert (tmp_path / "old" / "report.html").read_text() == "old"
    with pytest.raises((OutputError, KeyboardInterrupt)):
        paper.write_paper_report(tmp_path / "new" / "deep", force=False)
    assert os.listdir(tmp_path) == ["old"]


def test_a_file_in_the_way_is_named(tmp_path, quick):
    target = tmp_path / "report"
    target.write_text("a file")
    for out in (target, target / "below"):
        with pytest.raises(OutputError, match="report"):
            paper.write_paper_report(out, force=True)
    assert target.read_text() == "a file"
