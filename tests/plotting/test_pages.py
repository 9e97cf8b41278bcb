"""Pictures of more than one of them can show: pages that are even, leave nothing out and draw nothing twice."""

from dataclasses import replace
from functools import cache
from importlib import import_module
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

import servotwin as st
from servotwin import plotting
from servotwin.cli import linear_report
from servotwin.datasheet import Bandwidth, Loop
from servotwin.errors import InputError
from servotwin.identification.fitting.traces import ErrorTable, LogError
from servotwin.identification.report import page as report_page
from servotwin.identification.report import pictures as report_pictures
from servotwin.logs import Log
from servotwin.look import on_page
from servotwin.look.reports import Section, report_html

TIME = np.linspace(0.0, 1.0, 11)
LINE = np.stack([TIME, 0.5 * TIME, 0.0 * TIME], axis=1)
MODEL = st.BoundedServo(st.load_servo("hitec-hs-755hb"))
SHEET = st.curves(MODEL, bandwidth=False)
BUS = st.load_servo("feetech-sts3215-12v")
(PART,) = SHEET.voltages


def names(count):
    return [f"item {k}" for k in range(count)]


def sheet_of(count):
    """Return a sheet of so many voltages, the more torque the later they come."""
    return replace(SHEET, voltages=tuple(
        replace(PART, voltage=k + 1.0, printed=(), cold=replace(PART.cold, torque=(k + 1.0) * PART.cold.torque),
                bandwidth=(Bandwidth(0.1, k + 1.0),)) for k in range(count)))


def sheets(count):
    return [SimpleNamespace(servo=SimpleNamespace(title=name), voltages=(PART,)) for name in names(count)]


@cache
def loop(volts):
    return Loop(st.DigitalServo(BUS.replace({"supply.open_circuit_voltage": volts})))


def errors(count):
    """Return errors by so many kinds of motion."""
    found = tuple(LogError("log", name, {}, 0.1 * (k + 1), 0.2, 1) for k, name in enumerate(names(count)))
    return {"": ErrorTable(("servo",), {"servo": found})}


def sines(count, page):
    one = np.ones(len(TIME), np.complex128)
    return linear_report.by_amplitude(SimpleNamespace(
        frequency=TIME + 1.0, mean=None, loops={}, simulated=SimpleNamespace(response=np.tile(one, (count, 1))),
        sines=[SimpleNamespace(amplitude=np.radians(k + 1.0), described=None) for k in range(count)]), page)


def titles(figure):
    return [ax.get_title() for ax in figure.axes if ax.get_title()]


def lines(k=0):
    """Return what says the labels of the lines in a panel."""
    return lambda figure: [line.get_label() for line in figure.axes[k].lines if line.get_label()[:1] != "_"]


def volts(figure):
    """Return names of items for voltages from 1 on."""
    labels = [label.removeprefix("motor, ") for label in lines()(figure)]
    return [f"item {int(label.removesuffix(' V')) - 1}" for label in labels if label.endswith(" V")]


class Case(NamedTuple):
    """A picture: where its limit is, how to draw a page of so many things, and which things that shows."""

    limit: str
    draw: Any
    shown: Any
    scaled: bool = True  # whether all its pages have the same axes


PICTURES = {
    "tracking": Case("plotting.robots.JOINTS_A_PAGE", lambda n, page: plotting.joint_tracking(
        [plotting.JointTrace(name, TIME, TIME, TIME, TIME) for name in names(n)], page=page), titles, scaled=False),
    "electrics": Case("plotting.robots.JOINTS_A_PAGE", lambda n, page: plotting.servo_electrics(
        [plotting.ServoTrace(name, TIME, TIME) for name in names(n)], page=page),
        lambda figure: [ax.get_ylabel() for ax in figure.axes], scaled=False),
    "torques": Case("plotting.robots.JOINTS_A_PAGE", lambda n, page: plotting.shaft_torques(
        [plotting.ShaftTrace(name, "", [("alone", PART.cold)], plotting.Cloud(TIME, TIME), plotting.Cloud(TIME, TIME),
                             None, 0.1, 0.1) for name in names(n)], page=page),
        lambda figure: [ax.get_title(loc="left") for ax in figure.axes if ax.axison], scaled=False),
    "windows": Case("plotting.robots.JOINTS_A_PAGE", lambda n, page: plotting.replay_windows(
        [plotting.ReplayTrace(name, TIME, TIME, TIME, {"servos": TIME}) for name in names(n)], page=page), titles,
        scaled=False),
    "paths": Case("plotting.robots.PATHS_A_PAGE", lambda n, page: plotting.robot_paths(
        [plotting.PathTrace(name, LINE * (k + 1), LINE) for k, name in enumerate(names(n))], LINE[:, :2], page=page),
        titles),
    "voltages": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.speed_curves(
        sheet_of(n), page=page), volts),
    "servos": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.compared_curves(
        sheets(n), page=page), lambda figure: [label.removesuffix(", 6 V") for label in lines()(figure)]),
    "holding": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.holding_curves(
        sheet_of(n), page=page), volts),
    "bandwidth": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.bandwidth_curves(
        sheet_of(n), page=page), volts),
    "curves": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.curves(
        [plotting.Curve(name, TIME, TIME * k) for k, name in enumerate(names(n))], x_label="x (1)", y_label="y (1)",
        below=[plotting.Curve(name, TIME, -TIME * k) for k, name in enumerate(names(n))], below_label="d (1)",
        page=page), lines(1)),
    "loops": Case("plotting.bode.LOOPS_A_PAGE", lambda n, page: plotting.loop_curve(
        [loop(k + 1.0) for k in range(n)], page=page), volts, scaled=False),
    "tool": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.tool_paths(
        LINE, [plotting.ToolTrace(name, TIME * (k + 1), LINE, TIME * k) for k, name in enumerate(names(n))], page=page),
        lines(1)),
    "use": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.joint_use(
        ["elbow"], [plotting.JointUse(name, np.zeros((2, 1)), np.ones(1)) for name in names(n)], page=page),
        lambda figure: figure.axes[0].get_legend_handles_labels()[1], scaled=False),
    "ranking": Case("plotting.panels.CURVES_A_PAGE", lambda n, page: plotting.ranking(
        ["plain", "PID"], {name: [10.0**k, np.nan] for k, name in enumerate(names(n))}, x_label="error (mm)",
        page=page), lines()),
    "sines": Case("cli.linear_report.CURVES_A_PAGE", sines, lambda figure: [
        f"item {int(label.split()[2][:-2]) - 1}" for label in lines()(figure) if label.startswith("sines")],
        scaled=False),
    "errors": Case("identification.report.pictures.VALUES_A_PAGE", lambda n, page: report_pictures.errors(
        errors(n), "motion", 1.0, "°", page), lambda figure: [
        tick.get_text() for tick in figure.axes[0].get_yticklabels()], scaled=False),
}


@pytest.mark.parametrize(("count", "most", "sizes"), [
    (1, 12, [1]), (12, 12, [12]), (13, 12, [6, 7]), (24, 12, [12, 12]), (37, 12, [9, 9, 9, 10]),
    (47, 12, [11, 12, 12, 12]), (3, 1, [1, 1, 1]),
])
def test_pages_are_even(count, most, sizes):
    shown = [on_page("joints", range(count), most, page)[0] for page in plotting.pages(count, most)]
    assert [len(items) for items in shown] == sizes
    assert [item for items in shown for item in items] == list(range(count))


@pytest.mark.long(but="ranking")
@pytest.mark.parametrize("name", PICTURES)
def test_every_thing_is_drawn_once_on_some_page(monkeypatch, name):
    """With two on a page; where things stand is not looked for, which takes longest."""
    picture = PICTURES[name]
    where, _, limit = picture.limit.rpartition(".")
    for module in (where, "plotting.panels", "plotting.bode"):
        monkeypatch.setattr(import_module(f"servotwin.{module}"), "finished", lambda figure, foot="": figure,
                            raising=False)
    monkeypatch.setattr(import_module(f"servotwin.{where}"), limit, 2)
    monkeypatch.setattr(import_module("servotwin.plotting.bode"), "_POINTS", 11)
    for count in (1, 2, 3, 7):
        figures = [picture.draw(count, page) for page in plotting.pages(count, 2)]
        shown = [picture.shown(figure) for figure in figures]
        assert [item for items in shown for item in items] == names(count)
        assert {len(items) for items in shown} <= {count // len(shown), count // len(shown) + 1}
        for k in (0, 1) if picture.scaled else ():
            assert len({(ax.get_xlim(), ax.get_ylim()) for figure in figures for ax in figure.axes[k:k + 1]}) <= 1
    for page in (0, 3, -1, 1.0):
        with pytest.raises(InputError, match="allowed: 1 to 2"):
            picture.draw(3, page)
    with pytest.raises(InputError, match="in a picture: got 'none', allowed: at least one"):
        picture.draw(0, 1)


def test_a_page_says_which_it_is():
    drawn = [plotting.Curve(name, TIME, TIME) for name in names(6)]
    feet = [plotting.curves(some, x_label="x (1)", y_label="y (1)", page=page).get_supxlabel()
            for some, page in ((drawn[:5], 1), (drawn, 1), (drawn, 2))]
    assert feet == ["", "page 1 of 2", "page 2 of 2"]


@pytest.mark.parametrize(("count", "pictures"), [(1, 1), (12, 1), (13, 2)])
def test_a_report_has_all_pages(count, pictures):
    assert report_html([Section("", report_page.errors_section(errors(count), [], "Of all logs."))]).count(
        "<img") == pictures


def test_names_of_many_joints_do_not_overlap():
    figure = plotting.ranking(names(47), {"servos": [1.0] * 47}, x_label="error (°)")
    figure.canvas.draw()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_yticklabels()]
    assert len(boxes) == 47
    assert not any(one.overlaps(other) for one, other in pairwise(boxes))


def test_all_that_a_log_measured_is_drawn():
    signals = ("output_angle", "output_speed", "armature_voltage", "armature_current", "supply_current", "bus_voltage",
               "load_torque")
    log = Log(name="a", time=TIME, command=TIME, command_kind="angle", measured=dict.fromkeys(signals, TIME))
    assert len(plotting.log_over_time(log).axes) == len(signals)
