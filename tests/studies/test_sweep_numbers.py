"""Numbers of a study in closed form: metrics on unequal steps, the middle of the draws, and lanes across chunks."""

import json
import math

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import InputError, OutputError
from servotwin.studies import variance_share
from servotwin.studies.lane_metrics import lane_metrics, output_times, step_time
from servotwin.studies.study import bar_of

STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")


@pytest.fixture(scope="module")
def model(servo):
    return st.PulseServo(servo)


def test_errors_on_unequal_steps_weigh_by_time():
    """e = 0, 3, 3, −1 at 0, 0.1, 1.1 and 1.5 s: trapezia of e² over 1.5 s."""
    times = np.array([0.0, 0.1, 1.1, 1.5])
    error = np.array([[0.0, 3.0, 3.0, -1.0], [0.0, 0.0, 0.0, 2.0]])
    signals = {"command_angle": np.ones((2, 4)), "output_angle": 1.0 - error}
    found = lane_metrics(["rms_error", "peak_error"], times, math.nan, signals)
    np.testing.assert_allclose(found["rms_error"], np.sqrt([(0.45 + 9.0 + 2.0) / 1.5, 0.8 / 1.5]), rtol=1e-14)
    assert found["peak_error"].tolist() == [3.0, 2.0]


def test_metrics_of_a_run_are_those_of_its_solution_on_unequal_steps(model):
    """Samples stand after each decision and at the step besides every `output_step`; the mean is over time."""
    study = st.sweep(model, st.signals.sine(mean=60.0, amplitude=20.0, frequency=2.0, unit="deg"), duration=0.5,
                     draws={"load.inertia": [1e-3]}, output_step=0.05, metrics=["rms_error", "end_output_speed"])
    run = st.simulate(model, study.plan.job.command, duration=0.5, load=st.loads.Inertia(1e-3), output_step=1e-4)
    error = run["command_angle"] - run["output_angle"]
    exact = math.sqrt(np.trapezoid(error**2, run.time) / 0.5)
    assert np.ptp(np.diff(study.plan.job.times)) > 0.005
    assert study.table["rms_error"][0] == pytest.approx(exact, rel=0.03)
    assert study.table["end_output_speed"][0] == pytest.approx(run["output_speed"][-1], abs=1e-9)


def test_slew_rate_and_current_count_either_way():
    signals = {"output_speed": np.array([[1.0, -4.0, 2.0], [0.0, 3.0, -1.0]]),
               "armature_current": np.array([[0.5, -0.2, 0.0], [0.1, -0.9, 0.3]])}
    found = lane_metrics(["slew_rate", "peak_current"], np.array([0.0, 1.0, 2.0]), math.nan, signals)
    assert found["slew_rate"].tolist() == [4.0, 3.0]
    assert found["peak_current"].tolist() == [0.5, 0.9]


@pytest.mark.parametrize("way", [1.0, -0.5])
def test_rise_and_settling_of_an_exponential(way):
    """1 − e^(−t/T): from 10 to 90 % T ln 9; within 2 % after T ln 50; up or down, whenever it steps."""
    T, start = 0.07, 0.3
    times = np.linspace(0.0, 3.0, 1501)
    t = np.maximum(times - start, 0.0)
    angle = way * -np.expm1(-t / T)
    speed = np.where(times >= start, way / T * np.exp(-t / T), 0.0)
    found = lane_metrics(["rise_time", "settling_time", "overshoot"], times, start,
                         {"output_angle": angle[None] + 0.2, "output_speed": speed[None]})
    assert found["rise_time"][0] == pytest.approx(T * math.log(9.0), rel=1e-6)
    assert found["settling_time"][0] == pytest.approx(T * math.log(50.0), rel=1e-6)
    assert found["overshoot"][0] == 0.0


def test_what_is_no_single_step_has_no_step_time():
    assert step_time(STEP) == 0.1
    assert math.isnan(step_time(st.signals.constant(3.0, unit="deg")))
    assert math.isnan(step_time(st.signals.ramp(0.0, 3.0, over=0.1, unit="deg")))
    assert math.isnan(step_time(st.signals.samples([0.0, 0.1, 0.2], [1.0, 2.0, 3.0], unit="deg")))


def test_samples_stand_where_the_current_is_highest():
    """Shortly after each decision, at the step and at the end, each once."""
    times = output_times(0.05, 0.02, 0.02, np.array([0.0012, 0.0212]))
    expected = sorted({0.0, 0.02, 0.04, 0.05, *(d + 1e-3 * x for d in (0.0012, 0.0212) for x in (0.02, 0.2, 0.5, 1.2))})
    np.testing.assert_allclose(times, expected, rtol=1e-14)


@pytest.mark.parametrize(("draws", "middle"), [([4.0, 1.0, 3.0, 2.0], 2.0), ([9.0, 1.0, 4.0], 4.0), ([7.0], 7.0),
                                               ([2.0, 1.0], 1.0)])
def test_what_the_servo_does_not_say_is_nominally_the_middle_draw(model, draws, middle):
    """Of an even number the lower of both: a value that was drawn."""
    column = [0.03 * x for x in draws]
    study = st.sweep(model, STEP, duration=0.2, draws={"motor.brush_drop_voltage": column},
                     metrics=["end_output_angle"])
    assert study.plan.nominal["motor.brush_drop_voltage"] == pytest.approx(0.03 * middle, rel=1e-12)
    servo = model.servo.replace({"motor.brush_drop_voltage": 0.03 * middle})
    own = st.simulate(st.PulseServo(servo), STEP, duration=0.2)["output_angle"][-1]
    assert study.tornado("end_output_angle").nominal == pytest.approx(own, abs=1e-9)


def test_quantiles_are_the_smallest_values_that_enough_lanes_reach(model):
    study = st.sweep(model, STEP, duration=0.2, draws={"load.inertia": np.linspace(0.0, 3e-3, 10)},
                     metrics=["end_output_angle"])
    ordered = np.sort(study.table["end_output_angle"]).tolist()
    found = study.quantiles((0.0, 0.05, 0.5, 0.51, 1.0))["end_output_angle"]
    assert list(found.values()) == [ordered[0], ordered[0], ordered[4], ordered[5], ordered[9]]


def test_shares_of_few_lanes_by_hand():
    """Classes of means 2.5 and 4.5: 8 of a sum of squares of 18, corrected to 1 − (10/18) (7/6)."""
    values = np.array([0.0] * 4 + [1.0] * 4)
    metric = np.array([1.0, 2.0, 3.0, 4.0, 3.0, 4.0, 5.0, 6.0])
    assert variance_share(values, metric) == pytest.approx(1.0 - 10.0 / 18.0 * 7.0 / 6.0, rel=1e-12)
    assert variance_share(np.where(values > 0.0, "coast", "brake"), metric) == pytest.approx(0.3518518, abs=1e-6)


def test_what_does_nothing_has_hardly_a_share_of_few_lanes():
    rng = np.random.default_rng(5)
    shares = [variance_share(rng.normal(size=30), rng.normal(size=30)) for _ in range(300)]
    assert np.mean(shares) < 0.08  # of five classes; without the correction it is 4/29


@pytest.mark.parametrize(("metric", "low", "high", "reach"), [
    ([0.1, 0.5, 0.2], "a", "b", 0.4), ([0.3, 0.2, 0.7], "b", "c", 0.5), ([0.1, math.nan, 0.2], "a", "c", 0.15)])
def test_a_bar_of_three_options_lies_between_the_two_that_reach_farthest(metric, low, high, reach):
    bar = bar_of("electronics.off_state", ("a", "b", "c"), np.array(metric), 0.25, 0.5)
    assert (bar.low, bar.high) == (low, high)
    assert bar.reach == pytest.approx(reach)


@pytest.fixture
def folder(model, tmp_path):
    st.sweep(model, STEP, duration=0.2, draws={"load.inertia": np.linspace(0.0, 3e-3, 10)}, chunk=4,
             metrics=["end_output_angle"], directory=tmp_path / "study")
    return tmp_path / "study"


@pytest.mark.parametrize(("file", "change"), [
    ("lanes-00000.csv", lambda lines: lines[:-1]), ("lanes-00000.csv", lambda lines: [*lines, lines[-1]]),
    ("lanes-00002.csv", lambda lines: lines[:-1]), ("lanes-00001.csv", lambda lines: [lines[0]]),
    ("lanes-00001.csv", lambda lines: [line.rpartition(",")[0] for line in lines])])
def test_a_chunk_with_rows_missing_or_too_many_is_not_gone_on_with(model, folder, file, change):
    lines = (folder / file).read_text().splitlines()
    (folder / file).write_text("\n".join(change(lines)) + "\n")
    with pytest.raises(InputError, match=file.replace(".", r"\.")):
        st.sweep(model, STEP, duration=0.2, draws={"load.inertia": np.linspace(0.0, 3e-3, 10)}, chunk=4,
                 metrics=["end_output_angle"], directory=folder, resume=True)


def test_a_study_that_says_more_is_another_one(model, folder):
    """Such as one of a servo that had a number which this one lacks."""
    file = folder / "study.json"
    content = json.loads(file.read_text())
    content["definition"]["parameters"]["gear.backlash"] = 0.01
    file.write_text(json.dumps(content))
    with pytest.raises(OutputError, match=r"another study: parameters\.gear\.backlash is not given and was 0\.01"):
        st.sweep(model, STEP, duration=0.2, draws={"load.inertia": np.linspace(0.0, 3e-3, 10)}, chunk=4,
                 metrics=["end_output_angle"], directory=folder, resume=True)


@pytest.mark.long
def test_failures_keep_their_lanes_in_every_chunk(model):
    stiffness = np.full(9, 0.1)
    stiffness[[2, 7]] = 1e27
    study = st.sweep(model, STEP, duration=0.2, draws={"load.spring.stiffness": stiffness}, chunk=2,
                     load=st.loads.Spring(0.1), metrics=["end_output_angle"])
    assert [failure.lane for failure in study.failures] == [2, 7]
    assert np.flatnonzero(np.isnan(study.table["end_output_angle"])).tolist() == [2, 7]
    assert np.flatnonzero(study.table["ended"] < 0.2).tolist() == [2, 7]
    assert study.table["lane"].tolist() == list(range(9))
    assert study.summary()["failed"] == 2
    assert study.summary()["metrics"]["end_output_angle"]["lanes"] == 7


def test_lanes_of_one_chunk_have_seeds_of_their_own(servo):
    noisy = st.PulseServo(servo.replace({"potentiometer.noise": 2e-3}))
    same = {"load.inertia": [1e-3] * 6}
    runs = [st.sweep(noisy, STEP, duration=0.3, draws=same, chunk=chunk, seed=4, metrics=["end_error_time"])
            for chunk in (2, 6)]
    errors = runs[0].table["end_error_time"]
    assert len(set(errors.tolist())) == 6
    np.testing.assert_array_equal(errors, runs[1].table["end_error_time"])


def test_the_noise_of_the_tornado_is_the_same_in_all_its_lanes(servo):
    """So that what does not matter moves nothing, and what matters is not mistaken for luck."""
    noisy = st.PulseServo(servo.replace({"potentiometer.noise": 2e-3}))
    study = st.sweep(noisy, STEP, duration=0.3, lanes=8, metrics=["end_error_time"], seed=1, vary={
        "stops.upper_angle": "uniform:3rad..4rad", "stops.lower_angle": "uniform:-2rad..-1rad"})
    assert np.ptp(study.table["end_error_time"]) > 1e-7
    assert np.ptp(study.moved["end_error_time"]) == 0.0
