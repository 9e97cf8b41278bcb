"""The report of a fit: whole, by itself, and with the numbers of the fit."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import servotwin as st
from cli import fit_logs
from servotwin.errors import OutputExistsError
from servotwin.identification import identify
from servotwin.identification.fitting.fit import LINEARISED_TIMES
from servotwin.identification.fitting.identify import LINEARISED
from servotwin.identification.fitting.search.case import SHARED
from servotwin.identification.fitting.uncertainty import Unidentifiable
from servotwin.identification.fitting.verdict import Cause
from servotwin.identification.report import page as report
from servotwin.identification.report import pictures as report_pictures
from servotwin.identification.report.pictures import (
    dimension_of_free,
    error_rows,
    estimate_lines,
    nominal_of,
    tables_of,
)
from servotwin.look import figure_in, unit_for
from servotwin.units import from_si


@pytest.fixture(scope="module")
def fit():
    logs = fit_logs.made_logs(4)
    logs[0] = replace(logs[0], name="step <b>0</b> & more", conditions={"gain": 2.0})
    return identify(logs, st.load_servo(fit_logs.SERVO), st.BoundedServo, ["output_inertia", "output_coulomb_torque"],
                    ("angle_offset",), "servo", holdout=["step-3"], starts=1, compare_with=("slew",))


@pytest.fixture(scope="module")
def page(fit):
    return report.page(fit)


class _Reader(HTMLParser):
    EMPTY = ("meta", "img", "br")

    def __init__(self):
        super().__init__()
        self.open, self.images, self.ids, self.links, self.addresses = [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.images += [found] if tag == "img" else []
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        self.addresses += [found[key] for key in ("src", "href", "data") if key in found]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def read(page):
    reader = _Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


@pytest.mark.long
def test_the_page_is_whole_and_needs_nothing_else(page):
    found = read(page)
    assert all(address.startswith(("#", "data:image/svg+xml;base64,")) for address in found.addresses)
    assert "<script" not in page
    assert "@import" not in page
    assert "url(" not in page
    assert len(found.ids) == len(set(found.ids))
    assert {link.removeprefix("#") for link in found.links} == set(found.ids)
    assert all(image["alt"] for image in found.images)


@pytest.mark.long
def test_names_are_escaped(page):
    assert "step <b>0</b>" not in page
    assert "step &lt;b&gt;0&lt;/b&gt; &amp; more" in page


def test_the_table_has_the_numbers_of_the_fit(fit, page):
    for name in fit.space.names:
        dimension = dimension_of_free(name)
        unit = unit_for(fit.estimates[name], dimension)
        row = re.search(rf"<td>{re.escape(name)}</td>(.*?)</tr>", page)[1].replace("−", "-")
        cells = [float(cell) for cell in re.findall(r"(?:>| to )(-?[\d.]+)(?=<| to )", row)]
        interval = fit.intervals()[name]
        before = nominal_of(fit, name)
        expected = [from_si(value, unit, dimension) for value in (fit.estimates[name], *interval[:2], before)]
        width = expected[2] - expected[1]
        np.testing.assert_allclose(cells[:3], expected[:3], atol=0.05 * width)
        assert cells[3] == pytest.approx(expected[3], rel=1e-3)


def test_every_log_is_drawn_and_those_held_out_are_marked(fit, page):
    drawn = page.split('id="logs"')[1].split("</section>")[0]
    assert drawn.count("<figcaption>") == len(fit.traces)
    assert drawn.count('<figure class="held">') == 1
    assert re.search(r'<figure class="held"><figcaption><b>step-3</b>', drawn)


@pytest.mark.slow
def test_of_many_logs_the_worst_the_middle_and_the_best_are_open(fit):
    """The others are folded, the worst of them first, and what is too much is said."""
    traces = tuple(replace(fit.traces[k % 4], log=replace(fit.traces[k % 4].log, name=f"log-{k}"),
                           simulated=fit.traces[k % 4].measured + 1e-3 * (k + 1)) for k in range(32))
    drawn = report.page(replace(fit, traces=traces)).split('id="logs"')[1].split("</section>")[0]
    opened, *folded = drawn.split("<details>")
    assert re.findall(r"<figcaption><b>(log-\d+)</b>", opened) == ["log-31", "log-15", "log-0"]
    assert [re.search(r"<summary><b>(log-\d+)</b>", one)[1] for one in folded[:2]] == ["log-30", "log-29"]
    assert f"{29 - len(folded)} further logs" in drawn


def test_the_window_with_the_largest_difference_is_enlarged(fit):
    trace = fit.traces[0]
    simulated = trace.measured.copy()
    simulated[20] += 1.0
    low, high = report_pictures.worst_window(replace(trace, simulated=simulated))
    assert low <= trace.time[20] <= high
    assert high - low < 0.6 * (trace.time[-1] - trace.time[0])


@pytest.mark.long
def test_the_verdict_is_on_top(fit, page):
    bad = replace(fit.verdict, holds=False, sentence="residuals are 4 times < the noise",
                  causes=(Cause("load friction", "", 4e-3, 1e-3, "climb the ladder"),))
    for verdict, sections in ((fit.verdict, ("note verdict good", "What is left")),
                              (bad, ("Residuals are 4 times &lt; the noise.", "load friction", "climb the ladder"))):
        text = report.page(replace(fit, verdict=verdict))
        assert re.search(r'<section id="([a-z]+)"', text)[1] == "verdict"
        top = text.split('id="verdict"')[1].split("</section>")[0]
        assert all(words in top for words in sections)
        read(text)


@pytest.mark.long
def test_what_is_not_determined_is_said(fit):
    item = Unidentifiable(("output_inertia", "output_coulomb_torque"), (1.0, -1.0),
                          ("output_inertia · output_coulomb_torque",), ("a known inertia at the horn",))
    text = report.page(replace(fit, unidentifiable=(item,), at_bound=("output_coulomb_torque",)))
    unknown = text.split('id="unknown"')[1].split("</section>")[0]
    assert "only output_inertia · output_coulomb_torque is determined" in unknown
    assert "At a bound of the search: <code>output_coulomb_torque</code>" in unknown
    assert ">undetermined<" in re.search(r"<td>output_inertia</td>(.*?)</tr>", text)[1]


@pytest.mark.long
def test_an_interrupted_fit_says_so(fit):
    text = report.page(replace(fit, interrupted=True, doubt=None, ends={}, warnings=("a < b",)))
    assert "The fit was interrupted" in text
    assert "there are no intervals" in text
    assert "there are no intervals" not in report.page(replace(fit, interrupted=True))
    assert "<p>a &lt; b</p>" in text
    assert ">not sought<" in text
    read(text)


def test_how_wide_intervals_of_a_stopped_fit_are_is_said_alike(page):
    """A page once said twice where three is meant."""
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "identify.md").read_text(encoding="utf-8")
    for text in (page, LINEARISED, guide.replace("three times as wide", "3 times as wide")):
        assert f"{LINEARISED_TIMES:g} times as wide" in " ".join(text.split())


@pytest.mark.long
def test_the_same_fit_gives_the_same_page(fit, page):
    assert report.page(fit) == page


@pytest.mark.long
def test_nothing_is_overwritten(fit, tmp_path):
    path = tmp_path / "fit.html"
    path.write_text("mine")
    with pytest.raises(OutputExistsError):
        fit.report(path)
    assert path.read_text() == "mine"
    assert fit.report(path, overwrite=True) == path
    assert path.read_text().startswith("<!DOCTYPE html>")


def test_pictures_are_svg(page):
    for image in read(page).images:
        content = base64.b64decode(image["src"].partition(",")[2])
        assert content.lstrip().startswith(b"<?xml")
        assert b"<image" not in content  # drawn, not a bitmap: it prints well


def test_the_forest_shows_intervals_relative_to_the_sheet(fit):
    ax = report_pictures.forest(fit).axes[0]
    lines = [line for line in ax.get_lines() if line.get_marker() == "|"]
    for line, name in zip(lines, fit.space.names, strict=True):
        interval, before = fit.intervals()[name], nominal_of(fit, name)
        np.testing.assert_allclose(line.get_xdata(), [interval.lower / before, interval.upper / before], rtol=1e-12)
    assert [label.get_text() for label in ax.get_yticklabels()] == list(fit.space.names)


def test_the_correlation_is_that_of_the_fit(fit):
    drawn = report_pictures.correlation(fit).axes[0].collections[0].get_array()
    np.testing.assert_allclose(np.asarray(drawn).reshape(3, 3), fit.correlation, rtol=1e-12)
    assert report_pictures.correlation(replace(fit, covariance=np.full((3, 3), np.nan))) is None


def test_error_rows_are_those_of_the_tables(fit):
    rows = error_rows(tables_of(fit), "motion")
    assert [(row.value, row.which) for row in rows] == [("step", "held out"), ("step", "fitted"), ("stairs", "fitted")]
    assert rows[0].errors == fit.holdout.by()["step"]


def test_tables_of_errors_say_all_and_begin_with_the_worst_log(fit):
    tables = tables_of(fit)
    drawn = report.errors(tables, fit.traces, "motion").rows
    assert [row[:2] for row in drawn[-2:]] == [("all", "held out"), ("all", "fitted")]
    assert [float(row[2]) for row in drawn[-2:]] == pytest.approx(
        [np.degrees(tables[row[1]].total()["BoundedServo"]) for row in drawn[-2:]], rel=5e-3)
    logs = report.logs(tables, fit.traces)
    errors = [float(row[logs.head.index("rms error")].split()[0]) for row in logs.rows]
    assert errors == sorted(errors, reverse=True)
    assert len(errors) == len(fit.traces)
    alone = report.logs({"": tables["fitted"]}, fit.traces, 2)
    assert (alone.head[0], len(alone.rows)) == ("log (2 worst of 3)", 2)
    assert "part" not in alone.head


def test_a_gap_in_time_breaks_the_line(fit):
    trace = fit.traces[0]
    keep = (trace.time < 0.2) | (trace.time > 0.4)
    cut = replace(trace, time=trace.time[keep], measured=trace.measured[keep], simulated=trace.simulated[keep])
    for one, gaps in ((trace, 0), (cut, 1)):
        line = report_pictures.beside(one).axes[0].get_lines()[0]
        assert np.isnan(line.get_ydata()).sum() == gaps


def test_the_autocorrelation_of_a_wave_is_a_wave():
    k = np.arange(400)
    found = report_pictures.autocorrelation([np.sin(2.0 * np.pi * k / 40.0)])
    np.testing.assert_allclose(found[:101], (1.0 - k[:101] / 400.0) * np.cos(2.0 * np.pi * k[:101] / 40.0), atol=0.02)


def test_lines_have_the_digits_that_the_interval_allows(fit):
    for line in estimate_lines(fit):
        spread = float(line.upper) - float(line.lower)
        step = 10.0 ** -len(line.value.partition(".")[2])
        assert step <= 0.2 * spread


@pytest.mark.parametrize(("value", "within", "text"), [
    (3.71881e-3, 2e-5, "3.719"), (3.71881e-3, 2e-3, "3.72"), (0.0, 0.0, "0"), (12345.6789e-3, 10.0, "12346"),
    (float("nan"), 1.0, "–"), (-2.5e-3, 1e-4, "-2.50"),
])
def test_figures(value, within, text):
    assert figure_in(value, "mN m/A", "torque per current", within=within) == text


@pytest.mark.parametrize("name", SHARED)
def test_every_effect_of_the_rig_that_all_logs_share_can_be_shown(name):
    """A fit whose pulses came at another period than the log said ended without its page."""
    assert dimension_of_free(name) in ("time", "angle")
