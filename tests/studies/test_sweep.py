"""A sweep says of its lanes what `simulate` says of them, whoever computes them."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import servotwin as st
from servotwin.errors import CommandError, InputError, ParameterError, UnknownNameError
from servotwin.studies import METRICS, variance_share
from servotwin.studies.lane_metrics import decision_times, lane_metrics, output_times

STEP = st.signals.step(0.0, 60.0, at=0.1, unit="deg")
VARY = {"motor.torque_constant": "normal:5%", "electronics.deadband": "uniform:4us..8us",
        "load.inertia": "uniform:1e-3..8e-3"}


@pytest.fixture(scope="module")
def model(servo):
    return st.PulseServo(servo)


@pytest.fixture(scope="module")
def coasting(servo):
    return st.PulseServo(servo.replace({"electronics.off_state": "coast", "potentiometer.noise": 1e-4}))


@pytest.fixture(scope="module")
def study(coasting):
    return st.sweep(coasting, STEP, duration=1.0, lanes=50, vary=VARY, seed=1, metrics=[
        "overshoot", "rise_time", "settling_time", "steady_error", "slew_rate", "peak_current", "end_output_angle",
        "end_bus_voltage"])


def lane(study, k):
    """The lane alone, solved by `simulate`."""
    values = {name: float(column[k]) for name, column in study.plan.columns.items()}
    own = {name: value for name, value in values.items() if not name.startswith("load.")}
    job = study.plan.job
    return st.simulate(type(job.model)(job.model.servo.replace(own)), STEP, duration=1.0,
                       load=st.loads.Inertia(values["load.inertia"]), seed=int(study.plan.seeds[k]))


@pytest.mark.long
def test_metrics_are_those_of_the_continuous_solution(study):
    exact = [lane(study, k) for k in range(12)]
    metrics = [result.step_metrics() for result in exact]
    # Angle and speed are exact at the samples, and a cubic between them; settling ends where the angle is flat, and
    # of the current a drive of less than 0.02 ms is not seen.
    for name, tolerance in (("overshoot", 3e-4), ("rise_time", 2e-5), ("settling_time", 2e-3), ("steady_error", 1e-9),
                            ("slew_rate", 0.02), ("peak_current", 0.2)):
        expected = [getattr(metric, name) for metric in metrics]
        np.testing.assert_allclose(study.table[name][:12], expected, atol=tolerance, err_msg=name)
    assert max(metric.overshoot for metric in metrics) > 0.03
    np.testing.assert_allclose(study.table["end_output_angle"][:12], [m.final for m in metrics], atol=1e-9)
    np.testing.assert_allclose(study.table["end_bus_voltage"][:12], [r["bus_voltage"][-1] for r in exact], atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("vary", [VARY, {**VARY, "electronics.one_shot_slope": "normal:1%"}])
def test_the_peak_of_the_current_of_a_braked_servo(model, vary):
    study = st.sweep(model, STEP, duration=0.6, lanes=12, vary=vary)
    batch = st.simulate_many(model, STEP, duration=0.6, parameters=study.plan.columns, output_times=[0.6])
    exact = [batch[k].step_metrics().peak_current for k in range(12)]
    np.testing.assert_allclose(study.table["peak_current"], exact, rtol=1e-2)


def test_errors_along_a_sine(model):
    sine = st.signals.sine(mean=60.0, amplitude=10.0, frequency=1.0, unit="deg")
    study = st.sweep(model, sine, duration=1.0, lanes=3, vary=VARY, output_step=1e-3)
    assert study.metrics == ("rms_error", "peak_error", "peak_current", "end_output_angle")
    values = {name: column[1] for name, column in study.plan.columns.items() if name != "load.inertia"}
    result = st.simulate(st.PulseServo(model.servo.replace(values)), sine, duration=1.0, output_step=1e-4,
                         load=st.loads.Inertia(study.table["load.inertia"][1]), seed=int(study.plan.seeds[1]))
    error = result["command_angle"] - result["output_angle"]
    assert study.table["rms_error"][1] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-3)
    assert study.table["peak_error"][1] == pytest.approx(np.abs(error).max(), rel=1e-4)


def test_a_bounded_servo_and_a_downward_step(servo):
    down = st.signals.step(60.0, 0.0, at=0.1, unit="deg")
    study = st.sweep(st.BoundedServo(servo), down, duration=1.0, lanes=4, vary={"load.inertia": "uniform:0..2e-3"})
    result = st.simulate(st.BoundedServo(servo), down, duration=1.0,
                         load=st.loads.Inertia(study.table["load.inertia"][2]))
    metrics = result.step_metrics()
    assert study.table["rise_time"][2] == pytest.approx(metrics.rise_time, abs=1e-5)
    assert study.table["settling_time"][2] == pytest.approx(metrics.settling_time, abs=1e-4)


def test_a_parabola_is_measured_exactly():
    t = np.linspace(0.0, 2.0, 12)
    q = 1.0 - (t - 1.23)**2
    found = lane_metrics(["overshoot", "rise_time"], t, 0.0, {
        "output_angle": q[None] * [[1.0], [-3.0]], "output_speed": -2.0 * (t - 1.23) * [[1.0], [-3.0]]})
    way = q[-1] - q[0]
    np.testing.assert_allclose(found["overshoot"], (1.0 - q[0]) / way - 1.0, rtol=1e-12)
    t10, t90 = (1.23 - np.sqrt(1.0 - q[0] - share * way) for share in (0.1, 0.9))
    np.testing.assert_allclose(found["rise_time"], t90 - t10, rtol=1e-9)


def test_a_lane_that_does_not_move_has_no_times():
    found = lane_metrics(["overshoot", "rise_time", "settling_time"], np.array([0.0, 1.0, 2.0]), 0.0, {
        "output_angle": np.ones((1, 3)), "output_speed": np.zeros((1, 3))})
    assert all(np.isnan(column[0]) for column in found.values())


def test_samples_hold_the_step_and_the_end():
    times = output_times(1.0, 0.3, 0.1, np.array([0.0, 0.5, 0.9995]))
    assert {0.0, 0.1, 0.3, 0.5002, 0.6, 1.0} <= set(times.round(12).tolist())
    assert np.all(np.diff(times) > 0.0)
    assert times[-1] == 1.0


def test_the_chip_decides_at_the_end_of_the_pulse(model):
    pulse = st.signals.step(1000.0, 1500.0, at=0.03, unit="us", frame_period=0.02)
    np.testing.assert_allclose(decision_times(model, pulse, 0.07), [0.001, 0.021, 0.0415, 0.0615], rtol=1e-12)
    train = st.signals.pulse_train([0.0, 0.025], [0.001, 0.002], unit="s")
    np.testing.assert_allclose(decision_times(model, train, 0.07), [0.001, 0.027], rtol=1e-12)
    assert decision_times(st.BoundedServo(model.servo), pulse, 0.07).size == 0


class Later:
    """An executor that does the work when it is asked for the result."""

    def __init__(self):
        self.calls = 0

    def submit(self, work, *arguments):
        self.calls += 1
        return Promise(work, arguments)


class Promise:
    def __init__(self, work, arguments):
        self.work, self.arguments = work, arguments

    def result(self):
        return self.work(*self.arguments)

    def cancel(self):
        return True


@pytest.mark.parametrize("options", [
    {"chunk": 7}, {"chunk": 50}, {"executor": Later(), "chunk": 11},
    {"executor": ThreadPoolExecutor(2), "chunk": 3}], ids=["7", "50", "later", "threads"])
def test_who_computes_does_not_matter(coasting, study, options):
    again = st.sweep(coasting, STEP, duration=1.0, lanes=50, vary=VARY, seed=1, metrics=study.metrics, **options)
    assert list(again.table) == list(study.table)
    for name, column in study.table.items():
        np.testing.assert_array_equal(again.table[name], column, err_msg=name)


@pytest.mark.slow
def test_processes(coasting, study):
    import multiprocessing

    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        again = st.sweep(coasting, STEP, duration=1.0, lanes=50, vary=VARY, seed=1, metrics=study.metrics, chunk=20,
                         executor=executor)
    for name, column in study.table.items():
        np.testing.assert_array_equal(again.table[name], column, err_msg=name)


@pytest.mark.slow
def test_a_killed_process_loses_nothing(coasting, study):
    import multiprocessing
    import os
    import signal

    killed = []
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        def kill(done, total):
            if not killed:
                killed.extend(executor._processes)
                os.kill(killed[0], signal.SIGKILL)

        again = st.sweep(coasting, STEP, duration=1.0, lanes=50, vary=VARY, seed=1, metrics=study.metrics, chunk=2,
                         executor=executor, progress=kill)
    assert killed
    for name, column in study.table.items():
        np.testing.assert_array_equal(again.table[name], column, err_msg=name)


def test_a_lost_executor_is_said_in_one_line(model):
    class Lost(Promise):
        def result(self):
            raise ConnectionError("all workers are gone")

    class Away:
        def submit(self, work, *arguments):
            return Lost(work, arguments)

    with pytest.raises(InputError, match="executor: got 'ConnectionError: all workers are gone'"):
        st.sweep(model, STEP, duration=1.0, lanes=5, vary=VARY, executor=Away())


def test_quantiles_are_values_of_lanes(study):
    values = np.sort(study.table["rise_time"])
    found = study.quantiles()["rise_time"]
    assert list(found) == [0.05, 0.25, 0.5, 0.75, 0.95]
    assert found[0.5] == values[24]
    assert found[0.05] == values[2]
    assert study.quantiles([1.0])["rise_time"][1.0] == values[-1]
    with pytest.raises(InputError):
        study.quantiles([1.5])


@pytest.mark.long
def test_the_tornado_moves_one_parameter_at_a_time(model):
    study = st.sweep(model, STEP, duration=1.0, lanes=500, vary=VARY, load=st.loads.Inertia(2e-3))
    tornado = study.tornado("rise_time")
    bar = next(bar for bar in tornado.bars if bar.name == "load.inertia")
    assert bar.low == pytest.approx(1e-3 + 0.05 * 7e-3)
    for inertia, said in ((bar.low, bar.at_low), (bar.high, bar.at_high), (2e-3, tornado.nominal)):
        result = st.simulate(model, STEP, duration=1.0, load=st.loads.Inertia(inertia))
        assert said == pytest.approx(result.step_metrics().rise_time, abs=1e-4)
    assert [bar.reach for bar in tornado.bars] == sorted((bar.reach for bar in tornado.bars), reverse=True)
    assert 0.9 < sum(bar.share for bar in tornado.bars) < 1.1
    with pytest.raises(UnknownNameError, match="rise_time"):
        study.tornado("rise")


def test_words_can_be_varied(model):
    study = st.sweep(model, STEP, duration=1.0, lanes=40, vary={
        "electronics.off_state": "choice:brake,coast", "load.inertia": "uniform:4e-3..5e-3"})
    bar = study.tornado("overshoot").bars[0]
    assert (bar.name, bar.low, bar.high) == ("electronics.off_state", "brake", "coast")
    assert bar.at_low < bar.at_high
    assert bar.share > 0.9
    assert set(study.table["electronics.off_state"].tolist()) == {"brake", "coast"}


def test_share_of_variance_of_a_sum_and_of_noise():
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform(-1.0, 1.0, (3, 20_000))
    metric = 2.0 * x + y**2
    whole = 4.0 / 3.0 + 4.0 / 45.0
    assert variance_share(x, metric) == pytest.approx(4.0 / 3.0 / whole, abs=0.01)
    assert variance_share(y, metric) == pytest.approx(4.0 / 45.0 / whole, abs=0.01)
    assert variance_share(z, metric) < 0.01
    assert variance_share(np.where(x > 0.0, "a", "b"), np.sign(x)) == pytest.approx(1.0)
    assert np.isnan(variance_share(x, np.ones_like(x)))


def test_draws_from_elsewhere(model, study):
    draws = {"motor.torque_constant": [3.6e-3, 3.7e-3, 3.8e-3]}
    found = st.sweep(model, STEP, duration=1.0, draws=draws, vary={"load.inertia": "uniform:0..1e-3"})
    assert len(found) == 3
    assert found.table["motor.torque_constant"].tolist() == draws["motor.torque_constant"]
    assert len(st.sweep(model, STEP, duration=1.0, draws=draws, lanes=2)) == 2
    with pytest.raises(InputError, match="at most 3"):
        st.sweep(model, STEP, duration=1.0, draws=draws, lanes=4)
    with pytest.raises(InputError, match="a column of draws"):
        st.sweep(model, STEP, duration=1.0, draws=draws, vary={"motor.torque_constant": "normal:1%"})


@pytest.mark.long
def test_failed_lanes_are_named_and_have_no_metrics(model):
    draws = {"load.spring.stiffness": [0.1, 1e27, 0.2]}
    study = st.sweep(model, STEP, duration=1.0, draws=draws, load=st.loads.Spring(0.1))
    (failure,) = study.failures
    assert failure.lane == 1
    assert failure.time < 1.0
    assert study.table["status"].tolist() == ["COMPLETED", failure_name(study), "COMPLETED"]
    assert np.isnan(study.table["rise_time"]).tolist() == [False, True, False]
    assert study.summary()["failed"] == 1
    assert study.summary()["metrics"]["rise_time"]["lanes"] == 2


def failure_name(study):
    return next(status.name for status in st.Status if status.message == study.failures[0].cause)


def test_dataframe(study):
    frame = study.to_dataframe()
    assert frame.index.name == "lane"
    assert frame["overshoot"].tolist() == study.table["overshoot"].tolist()


def test_a_step_at_the_very_start_is_a_step(model):
    study = st.sweep(model, st.signals.step(0.0, 60.0, unit="deg"), duration=1.0, lanes=2, vary=VARY)
    assert "rise_time" in study.metrics
    assert np.isfinite(study.table["rise_time"]).all()


@pytest.mark.parametrize(("change", "kind", "said"), [
    ({"vary": {}}, InputError, "at least one parameter"),
    ({"vary": [1]}, InputError, "a mapping"),
    ({"lanes": 0}, InputError, "lanes: got 0"),
    ({"lanes": 2.5}, InputError, "lanes: got 2.5"),
    ({"lanes": 10**14}, InputError, "what fits into memory"),
    ({"seed": -1}, InputError, "seed: got -1"),
    ({"chunk": 0}, InputError, "chunk: got 0"),
    ({"sampling": "halton"}, InputError, "latin-hypercube, sobol, random"),
    ({"duration": float("nan")}, InputError, "duration: got nan"),
    ({"output_step": 0.0}, InputError, "output_step: got 0.0"),
    ({"output_step": 1e-9}, InputError, "duration / output_step"),
    ({"metrics": ["overshot"]}, UnknownNameError, "did you mean 'overshoot'?"),
    ({"metrics": []}, InputError, "at least one of"),
    ({"metrics": ["end_nothing"]}, UnknownNameError, "end_nothing"),
    ({"command": st.signals.constant(10.0, unit="deg"), "metrics": ["overshoot"]}, InputError, "a single step"),
    ({"command": st.signals.step(0.0, 9.0, at=2.0, unit="deg"), "metrics": ["overshoot"]}, InputError, "a single step"),
    ({"command": 3.0}, CommandError, "a signal"),
    ({"executor": ThreadPoolExecutor}, InputError, "submit"),
    ({"progress": 1}, InputError, "progress"),
    ({"vary": {"motor.armature_resistance": "normal:90%"}}, ParameterError, "armature_resistance of lane "),
    ({"vary": {"load.inertia": "uniform:-1e-3..1e-3"}}, ParameterError, "load.inertia of lane "),
    ({"vary": {"stops.upper_angle": "uniform:50deg..70deg"}}, CommandError, "angle command of lane "),
    ({"vary": {"stops.lower_angle": "uniform:-1deg..1deg"}}, CommandError, "angle command of lane "),
])
def test_bad_input_is_refused_before_anything_runs(model, tmp_path, change, kind, said):
    options = {"model": model, "command": STEP, "duration": 1.0, "lanes": 40, "vary": VARY,
               "directory": tmp_path / "study", **change}
    with pytest.raises(kind) as caught:
        st.sweep(options.pop("model"), options.pop("command"), **options)
    assert said in str(caught.value)
    assert not (tmp_path / "study").exists()


def test_a_negative_draw_is_named_and_truncation_is_offered(model):
    vary = {"motor.armature_resistance": "normal:60%"}
    with pytest.raises(ParameterError, match=r"of lane \d+: got -.*--truncate"):
        st.sweep(model, STEP, duration=0.5, lanes=100, vary=vary)
    study = st.sweep(model, STEP, duration=0.5, lanes=100, vary=vary, truncate=True)
    assert study.table["motor.armature_resistance"].min() > 0.0


def test_progress_is_told(model):
    seen = []
    st.sweep(model, STEP, duration=0.2, lanes=10, vary=VARY, chunk=4, progress=lambda *x: seen.append(x))
    assert seen == [(4, 10), (8, 10), (10, 10)]


def test_every_metric_says_what_it_is_made_of():
    for metric in METRICS.values():
        assert metric.dimension in st.units.DIMENSIONS
        assert metric.signals
