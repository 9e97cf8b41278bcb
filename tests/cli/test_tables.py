"""The rows of what is printed: each number stands at its label, in its unit."""

import math
import re

import pytest

import servotwin as st
from servotwin.cli.summary import lines

SERVO = "hitec-hs-755hb"


def rows(text):
    """Return label and value of each line of pairs."""
    found = {}
    for line in text.splitlines():
        label, _, value = line.strip().partition("  ")
        found.setdefault(label, value.strip())
    return found


def number(text):
    return float(text.split()[0])


@pytest.mark.parametrize(("inertia", "arrives"), [("1e-2", True), ("3e-2", False)])
def test_every_row_of_a_step_is_its_metric(simulate, inertia, arrives):
    printed = rows(simulate("--step", "0:90", "--at", "0.2", "--model", "bounded", "--load", f"inertia={inertia}").out)
    run = st.simulate(st.BoundedServo(st.load_servo(SERVO)), st.signals.step(0.0, 90.0, at=0.2, unit="deg"),
                      duration=1.5, load=st.loads.Inertia(float(inertia)))
    metrics = run.step_metrics()
    expected = {"final angle": (math.degrees(metrics.final), "deg", 0.006),
                "holding error": (math.degrees(metrics.steady_error), "deg", 0.006),
                "rise time": (1e3 * metrics.rise_time, "ms (10 to 90 %)", 0.06),
                "settling time": (1e3 * metrics.settling_time, "ms (2 %)", 0.06),
                "overshoot": (100.0 * metrics.overshoot, "%", 0.006),
                "peak speed": (math.degrees(metrics.slew_rate), "deg/s", 0.06)}
    if arrives:
        expected["time to get there"] = (1e3 * metrics.arrival_time, "ms (within 1 deg)", 0.06)
    else:
        assert printed["time to get there"] == "does not get within 1 deg"
        assert metrics.overshoot > 0.01
    for label, (value, unit, rounding) in expected.items():
        assert number(printed[label]) == pytest.approx(value, abs=rounding), label
        assert re.sub(r",? \(?-?[\d.]+ to (-?[\d.]+|never)\)?$", "", printed[label]).partition(" ")[2] == unit
    assert metrics.settling_time > metrics.rise_time > 0.0
    mean, peak = (number(part) for part in printed["current"].split(", "))
    assert (mean, peak) == pytest.approx((run.mean_current, metrics.peak_current), abs=6e-4)
    assert number(printed["energy"]) == pytest.approx(run.energy.supply, rel=1e-3)


def test_what_a_run_does_not_have_is_shown_as_none():
    """A motor has no target, a shaft that stays has no times."""
    facts = {"final_angle": 1.0, "mean_current": 0.25, "peak_current": 0.5, "energy": {"supply": 1.0}, "step_metrics": {
        "target": math.nan, "rise_time": math.nan, "settling_time": 0.25, "overshoot": math.nan, "slew_rate": math.pi}}
    assert dict(lines(facts)) == {
        "final angle": "57.30 deg", "rise time": "-", "overshoot": "-", "settling time": "250.0 ms (2 %)",
        "peak speed": "180.0 deg/s", "current": "0.250 A in the mean, 0.500 A at most",
        "energy": "1 J supplied: nothing moved"}
    facts["step_metrics"] |= {"target": 1.1, "arrival_band": math.radians(0.35), "rise_time": 0.1,
                              "settling_time": math.nan, "overshoot": 0.125}
    facts |= {"time_to_target": 0.2, "holding_error": math.radians(-2.0)}
    found = dict(lines(facts))
    assert (found["holding error"], found["rise time"], found["overshoot"], found["time to get there"]) == (
        "-2.00 deg", "100.0 ms (10 to 90 %)", "12.50 %", "200.0 ms (within 0.35 deg)")
    assert found["settling time"] == "-"


def draws(stiff, lanes=8):
    return "load.spring.stiffness\n" + "".join(f"{1e27 if k in stiff else 0.1}\n" for k in range(lanes))


@pytest.mark.long
@pytest.mark.parametrize(("failed", "named", "more"), [
    ((1,), [1], ""), ((0, 4, 6), [0, 4, 6], ""), ((1, 2, 5, 7), [1, 2, 5], "; and 1 more"),
    (range(1, 8), [1, 2, 3], "; and 4 more")])
def test_three_failures_are_named_and_the_others_counted(cli, tmp_path, failed, named, more):
    (tmp_path / "draws.csv").write_text(draws(failed))
    ended = cli("sweep", SERVO, "--step", "0:60", "--duration", "0.2", "--draws", "draws.csv", "--load", "spring=0.1",
                "--model", "pulse")
    assert ended.code == 0, ended.err
    text = " ".join(ended.out.split())
    start = text.index(f"failed {len(failed)}: ")
    said = text[start:text.index(" metric ", start)]
    assert [int(part.split()[0]) for part in said.split("lane ")[1:]] == named
    assert said.count(" more") == bool(more)
    assert said.endswith(more)


def test_a_sweep_without_failures_says_none(cli, tmp_path):
    (tmp_path / "draws.csv").write_text(draws(()))
    ended = cli("sweep", SERVO, "--step", "0:60", "--duration", "0.2", "--draws", "draws.csv", "--load", "spring=0.1",
                "--metric", "rise_time", "--metric", "peak_current")
    assert rows(ended.out)["failed"] == "none"
    assert rows(ended.out)["varied"] == "load.spring.stiffness"


def test_the_tables_of_a_sweep_are_its_numbers(cli):
    words = ["sweep", SERVO, "--step", "0:60", "--duration", "0.6", "--lanes", "40", "--vary",
             "motor.torque_constant=uniform:10%", "--vary", "load.inertia=uniform:0..2e-3", "--metric", "settling_time",
             "--metric", "peak_current"]
    text = cli(*words).out.splitlines()
    study = st.sweep(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 60.0, at=0.1, unit="deg"), duration=0.6,
                     lanes=40, metrics=["settling_time", "peak_current"], vary={
                         "motor.torque_constant": "uniform:10%", "load.inertia": "uniform:0..2e-3"})
    for label, unit, name, factor in (("settling time", "ms", "settling_time", 1e3),
                                      ("peak current", "A", "peak_current", 1.0)):
        line = next(line for line in text if line.startswith(label))
        cells = line.removeprefix(label).split()
        tornado, quantiles = study.tornado(name), study.quantiles()[name]
        assert cells[0] == unit
        assert [float(cell) for cell in cells[1:]] == pytest.approx(
            [factor * x for x in (tornado.nominal, *quantiles.values())], rel=1e-3)
    bars = study.tornado("settling_time").bars
    shown = [line.split() for line in text if line.startswith(("motor.torque_constant ", "load.inertia "))]
    assert [cells[0] for cells in shown] == [bar.name for bar in bars]
    for cells, bar in zip(shown, bars, strict=True):
        assert [float(cell) for cell in cells[-4:-2]] == pytest.approx([1e3 * bar.at_low, 1e3 * bar.at_high], rel=1e-3)
        assert float(cells[-2]) == pytest.approx(100.0 * bar.share, abs=0.06)
        assert cells[-1] == "%"


@pytest.mark.parametrize("hold", ["previous", "linear"])
def test_samples_of_a_file_are_held_as_asked(simulate, tmp_path, hold):
    (tmp_path / "angles.csv").write_text("time_s,command_angle_deg\n0,10\n0.3,60\n0.6,20\n")
    words = ["--command", "angles.csv", "--duration", "0.6", "--model", "bounded", "--json"]
    found = simulate(*words, *(["--hold", hold] if hold == "linear" else [])).data
    signal = st.signals.samples([0.0, 0.3, 0.6], [10.0, 60.0, 20.0], unit="deg", hold=hold)
    run = st.simulate(st.BoundedServo(st.load_servo(SERVO)), signal, duration=0.6)
    assert found["final_angle"] == pytest.approx(float(run["output_angle"][-1]), rel=1e-12)
    assert found["peak_current"] == pytest.approx(run.peak("armature_current"), rel=1e-12)
