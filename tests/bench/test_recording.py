"""Experiments, the analog rig on a mock, and the recorder: what is asked for is played, and what is played is kept."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from servotwin.bench.backends import MockBackend
from servotwin.bench.recording import (
    EXPERIMENTS,
    About,
    AnalogRig,
    Experiment,
    Hold,
    Limits,
    Wiring,
    calibrated,
    experiments,
    load_wiring,
    of_log,
    record,
)
from servotwin.errors import BenchError, InputError, OutputExistsError

PULSES = Limits(kind="pulse_width", low=1e-3, high=2e-3, voltage=6.0, current=1.0)
GOALS = Limits(kind="angle", low=-1.0, high=1.0, voltage=12.0, current=1.0)
ABOUT = About(servo="a servo", licence="CC0-1.0", author="somebody")


class Moving:
    """Pins that tell the time, and how wide the last pulse was."""

    def __init__(self, current=0.2):
        self.width, self.rose, self.current = 0.0, 0.0, current

    def rise(self, time):
        self.rose = time

    def fall(self, time):
        self.width = time - self.rose

    def voltage(self, channel, time):
        return {"tap": 1000.0 * self.width * 0.8, "shunt": self.current, "supply": 1.5, "command": 0.0}[channel]


def rig_of(plant=None, rate="fast"):
    rig = AnalogRig(MockBackend(plant or Moving()), rate=rate)
    rig.open()
    return rig


SHORT = Experiment(name="short", motion="step", kind="pulse_width", frame_period=0.01,
                   holds=[Hold(0.05, 1.2e-3), Hold(0.02, None), Hold(0.05, 1.8e-3), Hold(0.02, 1.8e-3, 0.005)])


@pytest.mark.parametrize("limits", [PULSES, GOALS], ids=["pulses", "goals"])
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_keeps_its_range_and_about_its_time(name, limits):
    if limits is GOALS and name in ("missing", "frame_rates"):
        with pytest.raises(InputError, match="takes pulses"):
            experiments(name, limits)
        return
    made = experiments(name, limits, duration=8.0)
    assert 4.0 < sum(one.duration for one in made) < 15.0
    for one in made:
        limits.check(one)
    if name != "hold":
        assert max(one.highest - one.lowest for one in made) > 0.0


def test_the_staircase_climbs_by_a_microsecond():
    stairs, = experiments("staircase", PULSES)
    values = [one.value for one in stairs.holds]
    assert {round(1e6 * abs(b - a), 6) for a, b in itertools.pairwise(values)} == {1.0}


def test_all_names_all_that_the_wire_carries():
    assert {one.motion for one in experiments("all", GOALS)} == {
        "step", "staircase", "ramp", "chirp", "prbs", "torque_off", "hold"}


@pytest.mark.parametrize("rate", ["fast", "frame"])
def test_rows_are_the_pulses_that_were_asked_for(rate):
    rig = rig_of(rate=rate)
    rig.approach(1.2e-3)
    rows = np.array(list(rig.run(SHORT)))
    rig.close()
    time, pulse = rows[:, 0], rows[:, 1]
    assert (np.diff(time) > 0.0).all()
    edges = np.array([*0.01 * np.arange(12), *(0.12 + 0.005 * np.arange(4))])
    wide = np.array([*[1200.0] * 5, math.nan, math.nan, *[1800.0] * 9])
    if rate == "frame":
        np.testing.assert_allclose(time, edges, atol=1e-9)
        np.testing.assert_array_equal(pulse, wide)
    else:
        at = np.searchsorted(edges, time + 1e-9, side="right") - 1
        np.testing.assert_array_equal(pulse, wide[at])
        seen = np.isfinite(rows[:, 2])
        assert seen.sum() == 140
        np.testing.assert_allclose(np.diff(time[seen]), 1e-3, atol=1e-6)


def test_counts_become_volts_and_amperes_by_the_wiring():
    wiring = Wiring()
    rig = AnalogRig(MockBackend(Moving(current=0.5)), wiring, rate="frame")
    rig.open()
    rig.approach(1.5e-3)
    row = list(rig.run(Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(0.1, 1.5e-3)])))[-1]
    step = 2.5 / 1024
    assert row[2] == pytest.approx(1.2, abs=step)
    assert row[3] == pytest.approx(0.5, abs=step)
    assert row[4] == pytest.approx(6.0, abs=4 * step)


def test_a_record_is_a_log_with_all_that_it_has_to_say(tmp_path):
    rig = rig_of()
    done = record(rig, SHORT, tmp_path / "short.csv", limits=PULSES, about=ABOUT)
    log, = st.read_logs(done.path)
    assert (len(log), log.motion) == (done.rows, "step")
    assert dict(log.parameters) == {"supply.open_circuit_voltage": 6.0, "electronics.frame_period": 0.01}
    assert {"feedback_voltage", "supply_current", "bus_voltage"} <= set(log.measured)
    said = json.loads((tmp_path / "short.json").read_text())["recorded"]
    assert (said["complete"], said["rows"], said["licence"], said["firmware"]) == (True, done.rows, "CC0-1.0", "1.0")
    assert said["wiring"]["reference_voltage"]["value"] == 2.5
    assert rig.board.order("ask")["pulsing"] == 0


def test_a_log_can_be_played_again(tmp_path):
    rig = rig_of(rate="frame")
    steps, = experiments("steps", PULSES, duration=3.0)
    log, = st.read_logs(record(rig, steps, tmp_path / "step.csv", limits=PULSES, about=ABOUT).path)
    again = of_log(log)
    assert [one.value for one in again.holds] == pytest.approx([one.value for one in steps.holds], abs=0.26e-6)
    assert again.duration == pytest.approx(steps.duration)


class StopError(Exception):
    pass


def test_what_ends_a_run_keeps_its_rows_and_lets_the_servo_go(tmp_path):
    rig, rows = rig_of(), itertools.count()

    def stop(row):
        if next(rows) == 40:
            raise StopError

    with pytest.raises(StopError):
        record(rig, SHORT, tmp_path / "a.csv", limits=PULSES, about=ABOUT, watch=stop)
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 42
    assert json.loads((tmp_path / "a.json").read_text())["recorded"]["complete"] is False
    assert rig.board.order("ask")["pulsing"] == 0


class _Cut(MockBackend):
    """A wire that is cut after a while."""

    left = 100

    def read(self, timeout):
        self.left -= 1
        if self.left < 0:
            raise BenchError(self.name, "the cable is gone")
        return super().read(timeout)


class _Deaf(MockBackend):
    """A board that falls silent."""

    left = 100

    def read(self, timeout):
        self.left -= 1
        data = super().read(timeout)
        return data if self.left > 0 else b""


@pytest.mark.parametrize(("backend", "said"), [(_Cut, "cable is gone"), (_Deaf, "does not answer|told nothing")])
def test_a_cut_wire_keeps_the_rows_before_it(tmp_path, backend, said):
    rig = AnalogRig(backend(Moving()))
    rig.open()
    steps, = experiments("steps", PULSES, duration=20.0)
    rig.board.backend.left = 150
    with pytest.raises(BenchError, match=said) as caught:
        record(rig, steps, tmp_path / "a.csv", limits=PULSES, about=ABOUT)
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert f"{len(lines) - 1} rows are kept" in str(caught.value)
    assert len(st.read_logs(tmp_path / "a.csv")[0]) == len(lines) - 1 > 20


@pytest.mark.parametrize("cut", [1, 3, 9])
def test_a_torn_line_is_passed_over(tmp_path, cut):
    whole = record(rig_of(), SHORT, tmp_path / "a.csv", limits=PULSES, about=ABOUT)
    text = whole.path.read_text()
    whole.path.write_text(text[:-cut])
    assert len(st.read_logs(whole.path)[0]) == whole.rows - 1


def test_too_much_current_ends_the_run(tmp_path):
    rig = rig_of(Moving(current=1.4))
    steps, = experiments("steps", PULSES, duration=5.0)
    with pytest.raises(BenchError, match=r"1.4 A .* limit of 1 A; \d+ rows are kept"):
        record(rig, steps, tmp_path / "a.csv", limits=PULSES, about=ABOUT)
    assert rig.board.order("ask")["pulsing"] == 0


def test_nothing_is_overwritten_and_nothing_moves_before_that_is_known(tmp_path):
    (tmp_path / "a.csv").write_text("mine")
    rig = rig_of()
    with pytest.raises(OutputExistsError):
        record(rig, SHORT, tmp_path / "a.csv", limits=PULSES, about=ABOUT)
    assert (tmp_path / "a.csv").read_text() == "mine"
    assert rig.board.order("ask")["frames"] == 0


WRONG = [
    (Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(1.0, 2.1e-3)]), "range"),
    (Experiment(name="a", motion="a", kind="angle", holds=[Hold(1.0, 0.1)]), "pulse_width"),
    (Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(1.0, 1.5e-3)], frame_period=0.001), "period"),
    (Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(1.0, 1.9e-3)], frame_period=0.0031), "pulse"),
]


@pytest.mark.parametrize(("experiment", "said"), WRONG)
def test_what_the_bench_cannot_do_is_refused_in_one_line(tmp_path, experiment, said):
    limits = PULSES if said != "pulse" else Limits(kind="pulse_width", low=1e-3, high=2.95e-3, voltage=6.0, current=1.0)
    if said == "pulse":
        experiment = Experiment(name="a", motion="a", kind="pulse_width", holds=[Hold(1.0, 2.95e-3)],
                                frame_period=0.0031)
    rig = rig_of()
    with pytest.raises(InputError, match=said):
        record(rig, experiment, tmp_path / "a.csv", limits=limits, about=ABOUT)
    assert rig.board.order("ask")["pulsing"] == 0


@pytest.mark.parametrize("change", [{"low": 2e-3}, {"low": math.nan}, {"current": 0.0}, {"voltage": -6.0},
                                    {"kind": "torque"}, {"low": 0.0}])
def test_limits_that_make_no_sense_are_refused(change):
    with pytest.raises(InputError):
        Limits(**{"kind": "pulse_width", "low": 1e-3, "high": 2e-3, "voltage": 6.0, "current": 1.0, **change})


CALIBRATIONS = [("supply", "supply_ratio", 4.03), ("reference", "reference_voltage", 2.487),
                ("shunt", "shunt_gain", 0.98)]


@pytest.mark.parametrize(("what", "name", "truth"), CALIBRATIONS)
def test_a_calibration_finds_the_wire_within_its_error(what, name, truth):
    rng, hits = np.random.default_rng(3), 0
    for _ in range(60):
        meter = np.linspace(0.1, 0.9, 6) * {"supply": 9.0, "reference": 2.4, "shunt": 2.0}[what]
        volts = {"supply": meter / truth, "reference": meter, "shunt": 0.01 + truth * meter}[what]
        reference = truth if what == "reference" else 2.5
        found = calibrated(Wiring(), what, meter, 1024 * volts / reference - 0.5 + rng.normal(0.0, 0.3, 6))
        value = getattr(found.wiring, name)
        assert value.origin == "measured"
        hits += abs(value.value - truth) < 2.776 * value.std  # Student's t of 4 degrees of freedom
    assert 52 <= hits <= 60


@pytest.mark.parametrize(("meter", "counts"), [([1.0, 2.0], [1, 2]), ([1.0, 1.0, 1.0], [1, 2, 3]),
                                               ([1.0, 2.0, math.nan], [1, 2, 3]), ([1.0, 2.0, 3.0], [300, 200, 100]),
                                               ([1.0, 2.0, 3.0], [300, 600, 1023])])
def test_points_that_make_no_line_are_refused(meter, counts):
    with pytest.raises(InputError):
        calibrated(Wiring(), "supply", meter, counts)


def test_a_wiring_comes_back_from_its_file(tmp_path):
    found = calibrated(Wiring(), "shunt", [0.1, 0.5, 1.0], [41.0, 205.2, 409.0]).wiring
    found.save(tmp_path / "bench.toml")
    assert load_wiring(tmp_path / "bench.toml") == found


@pytest.mark.parametrize("text", ["reference = 'none'", "tap_ratio = 'x'", "tap_ratio = -1", "chanels = ['tap']",
                                  "channels = ['tape']", "supply_ratio = { value = 4, unit = 'A' }", "x = [",
                                  "shunt_gain = { value = 1.0, origin = 'measured' }"])
def test_a_wrong_wiring_names_file_and_key(tmp_path, text):
    file = tmp_path / "bench.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"bench\.toml") as caught:
        load_wiring(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("channel", "value"), [("tap", 1.1), ("supply", 6.3), ("shunt", 0.7), ("command", 1.9)])
def test_what_a_pin_shows_is_read_back_whatever_the_wires_are(channel, value):
    crooked = {"tap_ratio": 1.3, "supply_ratio": 4.4, "shunt_gain": 0.8, "shunt_zero": 0.12, "reference_voltage": 2.47}
    wiring = Wiring(**{name: replace(getattr(Wiring(), name), value=number) for name, number in crooked.items()})
    count = wiring.pin(channel, value) / 2.47 * 1024 - 0.5
    assert wiring.value(channel, count) == pytest.approx(value, rel=1e-12)
