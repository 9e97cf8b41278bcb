"""Many servos at once: each lane is what `simulate` says of it alone, whoever computes it and in whatever pieces."""

import math
import pickle
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import servotwin as st
from absent_values import ABSENT, HEAT, TABLES
from servotwin import loads, signals
from servotwin.simulation import result as results_of
from servotwin.simulation.lanes import many
from servotwin.simulation.lanes.inputs import LOAD_NAMES, lanes_of, with_numbers
from servotwin.simulation.lanes.packing import Commands
from servotwin.simulation.lanes.whole_runs import run as run_lanes
from servotwin.tables import read_columns

SERVO = st.load_servo("hitec-hs-755hb")
MODELS = (st.BoundedServo, st.PulseServo)
STEP = signals.step(10.0, 50.0, at=0.05, unit="deg")


def agree(got, wanted, what):
    scale = max(1.0, np.nanmax(np.abs(wanted), initial=0.0))
    np.testing.assert_allclose(got, wanted, rtol=0.0, atol=2e-8 * scale, err_msg=what)


def compare(batch, results):
    """All signals of all lanes are those of the results."""
    assert batch.ok
    for lane, result in enumerate(results):
        for name in batch.names[1:]:
            agree(batch[name][lane], result[name], f"{name} of lane {lane}")


WORDS = ("electronics.off_state", "electronics.silence_state")
ENDLESS = "potentiometer.fixed_angle"  # takes no angles: its columns are tested with it


def names_of(model):
    return [name for name in (*model.requires, *model.optional)
            if name not in (*WORDS, *TABLES, ENDLESS)]


def with_its_group(name):
    """Return a servo that has what a parameter makes no sense without."""
    if name == "friction.stribeck_exponent":
        return SERVO.replace({"friction.stribeck_speed": 8.0, "friction.breakaway_ratio": 1.5})
    if name == "gear.damping":
        return SERVO.replace({"gear.stiffness": ABSENT["gear.stiffness"]})
    if name == "friction.bearing_coulomb_torque":
        return SERVO.replace({part: ABSENT[part] for part in ("gear.backlash", "gear.output_inertia")})
    if name == "friction.stribeck_speed":
        return SERVO.replace({"friction.breakaway_ratio": 1.5})
    return SERVO.replace({part: ABSENT[part] for part in HEAT}) if name.startswith("thermal.") else SERVO


@pytest.mark.long(but="PulseServo-friction.coulomb_torque_forward")
@pytest.mark.filterwarnings("ignore:hitec-hs-755hb. at:UserWarning")
@pytest.mark.parametrize(("model", "name"), [(model, name) for model in MODELS for name in names_of(model)])
def test_every_parameter_may_be_a_column(model, name):
    servo = with_its_group(name)
    value = servo.get(name)
    column = np.array([1.0, 1.03]) * (ABSENT[name] if value is None else value)
    if name == "friction.breakaway_ratio":
        column = np.array([1.0, 1.5])
    load = loads.Inertia(1e-3) + loads.Constant(0.05)
    outputs = model(servo.replace({name: column[0]})).available
    batch = st.simulate_many(model(servo), STEP, duration=0.3, load=load, parameters={name: column},
                             output_step=0.01, outputs=outputs, seeds=5)
    compare(batch, [st.simulate(model(servo.replace({name: x})), STEP, duration=0.3, load=load, output_step=0.01,
                                seed=5) for x in column.tolist()])


@pytest.mark.long(but="BoundedServo-load.viscous_friction")
@pytest.mark.parametrize(("model", "name"), [(model, name) for model in MODELS for name in LOAD_NAMES
                                            if model.bears_flexible or ".flexible." not in name])
def test_every_number_of_a_load_may_be_a_column(model, name):
    load = (loads.Inertia(1e-3) + loads.Pendulum(mass=0.1, length=0.1) + loads.Spring(0.1, 0.2)
            + loads.Viscous(1e-4) + loads.Coulomb(0.01) + loads.Recorded([0.0, 0.1, 1.0], [0.0, 0.05, 0.0]))
    if ".flexible." in name:
        load += loads.Flexible(stiffness=20.0, inertia=2e-3, damping=0.01, mass=0.1, length=0.1)
    column = np.array([0.5, 1.3]) * {"mass": 0.1, "length": 0.1, "gravity": 9.8, "inertia": 1e-3, "torque": 0.05,
                                     "viscous_friction": 1e-3, "coulomb_torque": 0.02}.get(name.split(".")[-1], 0.2)
    batch = st.simulate_many(model(SERVO), STEP, duration=0.3, load=load, parameters={name: column}, output_step=0.02,
                             outputs=("output_angle", "load_torque", "armature_current"), seeds=0)
    compare(batch, [st.simulate(model(SERVO), STEP, duration=0.3, load=with_numbers(load, {name: x}), output_step=0.02)
                    for x in column.tolist()])
    assert batch[1].load == with_numbers(load, {name: float(column[1])})


@pytest.mark.parametrize("model", MODELS)
def test_every_lane_has_its_own_command_and_load(model):
    servo = SERVO.replace({"electronics.voltage_to_pulse_gain": 7e-4})
    commands = [STEP, signals.sine(mean=1500.0, amplitude=200.0, frequency=3.0, unit="us"),
                signals.step(1200.0, 1500.0, at=0.1, unit="us", frame_period=0.012), STEP,
                signals.pulse_train([0.0, 0.015, 0.04, 0.06, 0.3], [1.5e-3, 1.5e-3, 1.6e-3, 1.4e-3, 1.3e-3], unit="s"),
                signals.step(1.5, 2.0, at=0.1, unit="V"), signals.ramp(0.0, 30.0, over=0.2, unit="deg")]
    hung = [None, loads.Inertia(1e-3), loads.Pendulum(mass=0.1, length=0.1), loads.Free(),
            loads.Pendulum(mass=0.1, length=0.1, inertia=1e-3) + loads.Spring(0.2, 0.1),
            loads.Recorded([0.0, 1.0], [0.0, 0.1]) + loads.Constant(0.05),
            loads.Spring(0.1) + loads.Spring(0.2, 0.3) + loads.Pendulum(mass=0.1, length=0.1)
            + loads.Pendulum(mass=0.05, length=0.2, hanging_angle=1.0)]
    batch = st.simulate_many(model(servo), commands, load=hung, duration=0.4, output_step=0.02, seeds=3,
                             outputs=model(servo).available)
    results = [st.simulate(model(servo), command, load=load, duration=0.4, output_step=0.02, seed=3)
               for command, load in zip(commands, hung, strict=True)]
    compare(batch, results)
    assert [result.command for result in batch] == commands


def test_equal_lanes_of_unlike_neighbours_are_equal():
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.3, seeds=0, outputs=("output_angle", "load_torque"),
                             parameters={"load.inertia": [1e-3, 2e-3, 1e-3, 5e-3, 1e-3]}, load=loads.Constant(0.1))
    for name in batch.names[1:]:
        assert np.array_equal(batch[name][0], batch[name][2])
        assert np.array_equal(batch[name][0], batch[name][4])


def test_a_shared_command_is_lowered_once():
    command = signals.samples(np.linspace(0.0, 1.0, 50), np.zeros(50), unit="rad")
    lanes = lanes_of(st.BoundedServo(SERVO), [command, STEP] * 20, None, None, None, None)
    assert len(Commands(lanes).rows) == len(command.pieces.table) + len(STEP.pieces.table)


def test_words_may_differ():
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.5, outputs=("output_angle", "armature_voltage"),
                             parameters={"electronics.off_state": ["brake", "coast", "brake"]}, seeds=0)
    compare(batch, [st.simulate(st.PulseServo(SERVO.replace({"electronics.off_state": word})), STEP, duration=0.5)
                    for word in ("brake", "coast", "brake")])
    assert batch[1].model.servo.electronics.off_state == "coast"


def test_what_all_lanes_share_may_be_a_number():
    batch = st.simulate_many(
        st.PulseServo(SERVO), STEP, duration=0.3, output_times=[0.1, 0.3], seeds=[0],
        parameters={"electronics.stretcher_gain": 90.0, "load.inertia": [2e-3], "electronics.off_state": "brake",
                    "stops.upper_angle": None, "motor.armature_resistance": np.array([2.0, 3.0])})
    servo = SERVO.replace({"electronics.stretcher_gain": 90.0, "electronics.off_state": "brake",
                           "stops.upper_angle": None})
    compare(batch, [st.simulate(st.PulseServo(servo.replace({"motor.armature_resistance": R})), STEP, duration=0.3,
                                load=loads.Inertia(2e-3), output_times=[0.1, 0.3]) for R in (2.0, 3.0)])


def test_one_lane_alone():
    batch = st.simulate_many(st.BoundedServo(SERVO), STEP, duration=0.3)
    assert batch["output_angle"].shape == (1, 301)
    compare(batch, [st.simulate(st.BoundedServo(SERVO), STEP, duration=0.3)])


def test_what_the_caller_gave_stays_the_callers():
    times, inertia = np.array([0.05, 0.1]), np.array([0.0, 1e-3])
    batch = st.simulate_many(st.BoundedServo(SERVO), STEP, duration=0.1, output_times=times,
                             parameters={"load.inertia": inertia})
    times[:], inertia[:] = 7.0, 7.0
    assert batch.time.tolist() == [0.05, 0.1]
    assert batch[1].load.inertia == 1e-3


def test_initial_values():
    start = {"output_angle": [0.1, 0.2, 0.3], "output_speed": 1.0}
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.2, initial=start, output_step=0.01)
    assert batch["output_angle"][:, 0].tolist() == [0.1, 0.2, 0.3]
    compare(batch, [st.simulate(st.PulseServo(SERVO), STEP, duration=0.2, output_step=0.01, seed=lane,
                                initial={"output_angle": q, "output_speed": 1.0})
                    for lane, q in enumerate(start["output_angle"])])


def test_noise_is_that_of_the_seed():
    servo = SERVO.replace({"potentiometer.noise": 2e-3})
    own = st.simulate_many(st.PulseServo(servo), [STEP] * 3, duration=0.3)["output_angle"]
    chosen = st.simulate_many(st.PulseServo(servo), STEP, duration=0.3, seeds=[2, 0, 0])["output_angle"]
    assert np.array_equal(own[2], chosen[0])
    assert np.array_equal(chosen[1], chosen[2])
    assert not np.array_equal(own[0], own[1])
    agree(own[1], st.simulate(st.PulseServo(servo), STEP, duration=0.3, seed=1)["output_angle"], "noise")


@pytest.mark.long
def test_single_precision():
    inertia = {"load.inertia": np.linspace(0.0, 2e-3, 9)}
    single, double = (st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.5, parameters=inertia, dtype=dtype)
                      for dtype in (np.float32, "float64"))
    assert single["output_angle"].dtype == np.float32
    assert double["output_angle"].dtype == np.float64
    assert np.abs(single["output_angle"] - double["output_angle"]).max() < 1e-3


ALL = {"outputs": ("output_angle", "output_speed", "load_torque", "armature_current", "command_angle"),
       "parameters": {"load.inertia": np.linspace(0.0, 2e-3, 23), "load.pendulum.mass": np.linspace(0.0, 0.2, 23),
                      "potentiometer.feedback_gain": SERVO.potentiometer.feedback_gain * np.linspace(0.95, 1.05, 23)},
       "load": loads.Pendulum(mass=0.1, length=0.1), "duration": 0.3, "output_step": 0.013}


def same(one, other):
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.names)


@pytest.mark.parametrize("model", MODELS)
def test_results_do_not_depend_on_chunk_or_threads(model):
    batch = st.simulate_many(model(SERVO), STEP, **ALL)
    for chunk in (1, 7, 16, 1000):
        assert same(batch, st.simulate_many(model(SERVO), STEP, chunk=chunk, **ALL))
    with ThreadPoolExecutor(3) as threads:
        assert same(batch, st.simulate_many(model(SERVO), STEP, chunk=2, executor=threads, **ALL))
        assert threads.submit(int, "1").result() == 1  # it is the caller's to shut down


@pytest.mark.slow
def test_results_do_not_depend_on_processes():
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, **ALL)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as processes:
        assert same(batch, st.simulate_many(st.PulseServo(SERVO), STEP, chunk=10, executor=processes, **ALL))


def test_only_what_the_outputs_read_is_computed(monkeypatch):
    asked = []
    monkeypatch.setattr(many, "run_lanes", lambda work: (asked.append(work.fields), run_lanes(work))[1])
    for outputs in ("output_angle", ("motor_speed",), ("command_angle",), ("armature_current", "error_time"),
                    ("load_torque",)):
        st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.1, outputs=outputs)
    assert asked == [("angle",), ("speed",), ("angle",), ("speed", "drive", "error"),
                     ("angle", "speed", "contact", "drive")]


@pytest.mark.parametrize(("name", "column"), [
    ("gear.backlash", [0.0, 0.01]), ("potentiometer.backlash", [0.0, 0.01]),
    ("electronics.silence_state", ["brake", "coast"])])
def test_outputs_read_what_any_lane_needs(name, column):  # a fit's trial of play had no speed of the motor
    servo = SERVO.replace({"gear.output_inertia": 1e-4})
    how = {"duration": 0.2, "load": loads.Inertia(1e-3), "output_step": 0.02}
    alone = st.simulate(st.PulseServo(servo.replace({name: column[1]})), STEP, **how)
    for output in st.PulseServo(servo).available:
        batch = st.simulate_many(st.PulseServo(servo), STEP, parameters={name: column}, outputs=(output,), **how)
        agree(batch[output][1], alone[output], output)


def test_a_failed_lane_harms_no_other():
    resistance = SERVO.motor.armature_resistance * np.array([1.0, 1e-300, 1.1])
    options = {"duration": 0.3, "output_step": 0.01, "outputs": ("output_angle", "command_angle")}
    batch = st.simulate_many(st.BoundedServo(SERVO), STEP, parameters={"motor.armature_resistance": resistance},
                             **options)
    good = st.simulate_many(st.BoundedServo(SERVO), STEP, parameters={"motor.armature_resistance": resistance[::2]},
                            **options)
    assert not batch.ok
    (failure,) = batch.failures
    assert failure.lane == 1
    assert batch.status[1] != 0
    assert batch.status[[0, 2]].tolist() == [0, 0]
    for name in batch.names[1:]:
        assert np.isnan(batch[name][1, batch.time > failure.time]).all()
        assert np.array_equal(batch[name][[0, 2]], good[name])
    with pytest.raises(st.errors.SimulationError, match="lane 1"):
        batch.raise_if_failed()
    assert good.raise_if_failed() is good
    assert batch[1].cause == failure.cause


@pytest.fixture(scope="module")
def batch():
    return st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.3, output_step=0.05,
                            outputs=["output_angle", "drive"], parameters={"load.inertia": [0.0, 1e-3, 2e-3]})


def test_a_batch_is_a_sequence_of_results(batch):
    assert len(batch) == 3
    assert [result.load.inertia for result in batch] == [0.0, 1e-3, 2e-3]
    assert batch[-1].load == batch[np.int64(2)].load
    result = batch[1]
    assert isinstance(result, st.Result)
    assert np.array_equal(result["output_angle"], batch["output_angle"][1])
    assert result["output_speed"].shape == result.time.shape
    assert result.events
    for lane in (3, -4):
        with pytest.raises(IndexError, match="the batch has 3"):
            batch[lane]


def test_a_batch_names_its_signals(batch):
    assert batch.names == ("time", "output_angle", "drive")
    assert batch.units == {"time": "s", "output_angle": "rad", "drive": "1"}
    assert batch["time"] is batch.time
    assert "drive" in batch
    with pytest.raises(KeyError, match=r"output_speed.*allowed: time, output_angle, drive"):
        batch["output_speed"]
    for array in (batch.time, batch.status, batch["drive"]):
        assert not array.flags.writeable


def test_a_batch_can_be_pickled(batch):
    again = pickle.loads(pickle.dumps(batch))
    assert same(batch, again)
    assert again[2].load == batch[2].load


def test_xarray(batch):
    data = pytest.importorskip("xarray") and batch.to_xarray()
    assert data["output_angle"].dims == ("lane", "time")
    assert data["output_angle"].attrs["units"] == "rad"
    assert data["load.inertia"].values.tolist() == [0.0, 1e-3, 2e-3]
    assert data["status"].dims == ("lane",)
    assert data.sizes == {"lane": 3, "time": 7}


def test_pandas(batch):
    pytest.importorskip("pandas")
    frame = batch.to_dataframe()
    assert frame.index.names == ["lane", "time"]
    assert list(frame.columns) == ["output_angle", "drive"]
    assert np.array_equal(frame.loc[2, "output_angle"], batch["output_angle"][2])
    assert frame.attrs["units"] == batch.units


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_files_have_a_row_for_each_lane_and_time(batch, tmp_path, monkeypatch, ending):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    monkeypatch.setattr(results_of, "_ROWS", 10)  # one lane at a time
    batch.save(tmp_path / f"a.{ending}")
    found = read_columns(tmp_path / f"a.{ending}")
    assert list(found) == ["lane", "load.inertia", "time_s", "output_angle_deg", "drive"]
    assert found["lane"].tolist() == [lane for lane in range(3) for _ in range(7)]
    assert found["load.inertia"].tolist() == [x for x in (0.0, 1e-3, 2e-3) for _ in range(7)]
    assert found["time_s"] == pytest.approx(np.tile(batch.time, 3))
    assert found["output_angle_deg"] == pytest.approx(np.degrees(batch["output_angle"]).ravel(), rel=1e-14)


def test_files_are_kept_unless_asked(batch, tmp_path):
    (tmp_path / "a.csv").write_text("mine")
    for name, said in (("a.csv", "exists already"), ("a.txt", r"ends in \.csv or \.parquet"), ("none/a.csv", "none")):
        with pytest.raises(st.errors.OutputError if name != "a.csv" else st.errors.OutputExistsError, match=said):
            batch.save(tmp_path / name)
    assert (tmp_path / "a.csv").read_text() == "mine"
    batch.save(tmp_path / "a.csv", overwrite=True)
    assert (tmp_path / "a.csv").read_text().startswith("lane,")


def test_progress(capsys):
    seen = []
    options = {"duration": 0.1, "parameters": {"load.inertia": np.zeros(10)}, "chunk": 4, "output_times": [0.1]}
    st.simulate_many(st.BoundedServo(SERVO), STEP, progress=lambda done, total: seen.append((done, total)), **options)
    assert seen == [(4, 10), (8, 10), (10, 10)]
    st.simulate_many(st.BoundedServo(SERVO), STEP, progress=True, **options)
    assert capsys.readouterr().out == ""


class Future:
    """Runs when it is asked for its result."""

    def __init__(self, log, run, work):
        self.log, self.run, self.work = log, run, work

    def result(self):
        self.log.append("result")
        return self.run(self.work)

    def cancel(self):
        self.log.append("cancel")


class Executor:
    """Any object with `submit` will do."""

    _max_workers = 2

    def __init__(self):
        self.log = []

    def submit(self, run, work):
        self.log.append("submit")
        return Future(self.log, run, work)


def test_few_chunks_are_in_flight():
    executor = Executor()
    st.simulate_many(st.BoundedServo(SERVO), STEP, duration=0.1, parameters={"load.inertia": np.zeros(10)}, chunk=1,
                     executor=executor, output_times=[0.1])
    assert executor.log[:6] == ["submit"] * 4 + ["result", "submit"]
    assert executor.log.count("result") == 10
    assert "cancel" not in executor.log


def test_an_interrupt_cancels_what_waits():
    def interrupt(done, total):
        raise KeyboardInterrupt

    executor = Executor()
    with pytest.raises(KeyboardInterrupt):
        st.simulate_many(st.BoundedServo(SERVO), STEP, duration=0.1, parameters={"load.inertia": np.zeros(10)}, chunk=1,
                         executor=executor, progress=interrupt, output_times=[0.1])
    assert executor.log == ["submit"] * 4 + ["result"] + ["cancel"] * 3


def test_grid():
    values = st.grid({"electronics.off_state": ["brake", "coast"], "load.inertia": [0.0, 1e-3, 2e-3]})
    assert values["electronics.off_state"].tolist() == ["brake"] * 3 + ["coast"] * 3
    assert values["load.inertia"].tolist() == [0.0, 1e-3, 2e-3] * 2
    assert {name: len(column) for name, column in st.grid(a=1.0, b=range(4)).items()} == {"a": 4, "b": 4}
    assert st.grid({}) == {}
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.1, parameters=values, output_times=[0.1])
    assert batch["output_angle"].shape == (6, 1)
    with pytest.raises(st.errors.InputError, match="grid: a"):
        st.grid(a=[[1.0]])


def test_a_grid_may_have_many_names():
    values = st.grid({f"{k}": [1.0, 2.0] if k in (3, 68) else [0.0] for k in range(70)})
    assert values["3"].tolist() == [1.0, 1.0, 2.0, 2.0]
    assert values["68"].tolist() == [1.0, 2.0, 1.0, 2.0]
    assert values["0"].tolist() == [0.0] * 4


def test_arrays_without_dimensions_are_what_they_hold():
    batch = st.simulate_many(st.PulseServo(SERVO), np.array(STEP, dtype=object), load=np.array(None), duration=0.1,
                             parameters={"electronics.off_state": np.array("coast")}, output_times=[0.1])
    assert batch["output_angle"].shape == (1, 1)
    assert batch[0].model.servo.electronics.off_state == "coast"


def test_long_runs_go_in_small_chunks(monkeypatch):
    lanes = []
    monkeypatch.setattr(many, "_CHUNK_FRAMES", 20.0)  # an interrupt waits for what runs
    monkeypatch.setattr(many, "run_lanes", lambda work: (lanes.append(work.packed.size), run_lanes(work))[1])
    st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.2, parameters={"load.inertia": np.zeros(5)},
                     output_times=[0.2])
    assert sorted(lanes) == [1, 2, 2]


def test_what_is_beyond_float32_is_infinite_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        batch = st.simulate_many(st.BoundedServo(SERVO), STEP, duration=0.1, output_times=[0.0], dtype="float32",
                                 initial={"output_speed": 1e200}, outputs="output_speed")
    assert np.isinf(batch["output_speed"][0, 0])


def test_a_lane_is_found_by_its_parameters():
    batch = st.simulate_many(st.PulseServo(SERVO), STEP, duration=0.5, output_times=[0.5],
                             parameters={"electronics.deadband": [4e-6, 4e-4]})
    error = np.abs(batch["output_angle"][:, -1] - math.radians(50.0))
    assert error[0] < error[1]
