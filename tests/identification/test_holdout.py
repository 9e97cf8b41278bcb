"""What is held out, and tables of errors."""

import math
from dataclasses import replace

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError
from servotwin.identification import ErrorTable, Log, LogError
from servotwin.identification.fitting.fit import split
from servotwin.identification.fitting.traces import log_error, pooled


def logs(**counts):
    time = np.linspace(0.0, 1.0, 5)
    return [Log(name=f"{motion} {k}", time=time, command=time, command_kind="angle", measured={"output_angle": time},
                motion=motion) for motion, count in counts.items() for k in range(count)]


def named(some, which):
    return [some[k].name for k in which]


# ------------------------------------------------------------------------------------------- split

def test_a_fourth_of_each_kind_is_held_out_unless_there_are_few():
    some = logs(step=8, prbs=4, ramp=3, drop=1)
    fitted, out = split(some, None, 0)
    assert sorted(fitted + out) == list(range(16))
    held = named(some, out)
    assert [sum(name.startswith(kind) for name in held) for kind in ("step", "prbs", "ramp", "drop")] == [2, 1, 0, 0]


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9, 0.999])
def test_a_share_is_taken_of_each_kind_and_one_log_of_each_is_left(share):
    some = logs(step=10, prbs=4, drop=1)
    _, out = split(some, share, 3)
    held = named(some, out)
    for kind, count in (("step", 10), ("prbs", 4), ("drop", 1)):
        expected = min(math.floor(share * count + 0.5), count - 1)
        assert sum(name.startswith(kind) for name in held) == expected


def test_nothing_is_held_out_with_zero():
    assert split(logs(step=8), 0, 0) == (list(range(8)), [])
    assert split(logs(step=8), 0.0, 0)[1] == []


def test_names_are_taken_as_given():
    some = logs(step=5)
    assert split(some, ["step 3", "step 1", "step 3"], 0) == ([0, 2, 4], [1, 3])
    assert split(some, (), 0)[1] == []


def test_the_seed_alone_decides():
    some = logs(step=20, prbs=8)
    first = split(some, None, 5)
    assert split(some, None, 5) == first
    assert any(split(some, None, seed) != first for seed in range(4))
    counts = np.zeros(28)
    for seed in range(200):
        counts[split(some, None, seed)[1]] += 1
    assert (np.abs(counts / 200.0 - 0.25) < 0.12).all()  # every log has its chance: four standard deviations


@pytest.mark.parametrize("holdout", [1.0, -0.1, 2, True, math.nan, "step 0", ["nope"], [0], math.inf],
                         ids=["all", "negative", "two", "true", "nan", "text", "unknown", "number", "inf"])
def test_other_shares_are_refused_in_one_line(holdout):
    with pytest.raises(InputError, match="holdout") as caught:
        split(logs(step=4), holdout, 0)
    assert "\n" not in str(caught.value)


def test_not_all_can_be_held_out():
    with pytest.raises(InputError, match="all logs"):
        split(logs(step=2), ["step 0", "step 1"], 0)


# ------------------------------------------------------------------------------------------ errors

def error(log, rms, samples=10, motion="step", **conditions):
    return LogError(log, motion, conditions, rms, 2.0 * rms, samples)


TABLE = ErrorTable(("A", "B"), {
    "A": (error("1", 0.3, 10, gain=100.0), error("2", 0.4, 30, gain=200.0), error("3", 0.1, 5, "prbs", gain=100.0)),
    "B": (error("1", 0.5, 10, gain=100.0), error("2", 0.2, 30, gain=200.0), error("3", 0.1, 5, "prbs", gain=100.0))})


def test_errors_are_pooled_over_samples():
    assert pooled(TABLE.errors["A"]) == pytest.approx(math.sqrt((10 * 0.09 + 30 * 0.16 + 5 * 0.01) / 45))
    assert TABLE.total()["B"] == pytest.approx(math.sqrt((10 * 0.25 + 30 * 0.04 + 5 * 0.01) / 45))
    assert math.isnan(pooled([]))


def test_errors_by_label():
    by = TABLE.by()
    assert list(by) == ["step", "prbs"]
    assert by["step"]["A"] == pytest.approx(math.sqrt((10 * 0.09 + 30 * 0.16) / 40))
    assert by["prbs"] == pytest.approx({"A": 0.1, "B": 0.1})
    assert TABLE.by("gain")["200"] == pytest.approx({"A": 0.4, "B": 0.2})
    assert TABLE.labels() == ("motion", "gain")
    assert TABLE.logs == ("1", "2", "3")
    assert bool(TABLE)


def test_an_empty_table_is_empty():
    for table in (ErrorTable((), {}), ErrorTable(("A",), {"A": ()})):
        assert not table
        assert table.logs == ()
        assert table.labels() == ("motion",)
        assert table.by() == {}


def test_the_error_of_a_log_carries_its_conditions():
    log = replace(logs(step=1)[0], parameters={"supply.open_circuit_voltage": 7.4}, conditions={"gain": 300.0},
                  load=st.loads.Inertia(2e-3) + st.loads.Pendulum(mass=0.1, length=0.2))
    known = log_error(log, np.array([0.3, -0.4]), np.array([2.0, 4.0]))
    assert known.fit_percent == pytest.approx(100.0 * (1.0 - np.sqrt(0.125)))  # 100 (1 − |y − ŷ|/|y − ȳ|)
    assert np.isnan(log_error(log, np.array([0.3]), np.array([2.0])).fit_percent)
    found = log_error(log, np.array([0.3, -0.4]))
    assert (found.rms, found.largest, found.samples) == (pytest.approx(math.sqrt(0.125)), 0.4, 2)
    assert found.conditions["voltage"] == 7.4
    assert found.conditions["gain"] == 300.0
    assert "0.196 N m pendulum" in found.conditions["load"]
    assert "kg m²" in found.conditions["load"]
    own = replace(log, conditions={"voltage": "low", "load": "arm"})
    assert log_error(own, np.array([1.0])).conditions == {"voltage": "low", "load": "arm"}
    assert log_error(logs(step=1)[0], np.array([1.0])).conditions == {"load": "none"}
