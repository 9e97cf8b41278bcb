"""Bad input of `simulate_many` raises before anything runs, and names lane and parameter."""

import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import servotwin as st
from servotwin import loads, signals
from servotwin.errors import (
    CommandError,
    InputError,
    LoadError,
    MissingParameterError,
    ParameterError,
    UnknownNameError,
)
from servotwin.simulation.lanes import many

SERVO = st.load_servo("hitec-hs-755hb")
STEP = signals.step(10.0, 50.0, at=0.05, unit="deg")
NAN = float("nan")


@pytest.fixture(autouse=True)
def _nothing_runs(monkeypatch):
    def run(work):
        raise AssertionError("it ran")
    monkeypatch.setattr(many, "run_lanes", run)


def refused(error, words, model=st.PulseServo, command=STEP, **options):
    with pytest.raises(error, match=re.escape(words[0])) as caught:
        st.simulate_many(model(SERVO), command, **{"duration": 0.1, "output_times": [0.1]} | options)
    for word in words[1:]:
        assert word in str(caught.value)
    assert isinstance(caught.value, InputError)


@pytest.mark.parametrize(("name", "value", "error", "words"), [
    ("electronics.stretcher_gain", [60.0, NAN], ParameterError, ["electronics.stretcher_gain of lane 1", "nan"]),
    ("electronics.stretcher_gain", [60.0, -1.0], ParameterError, ["electronics.stretcher_gain of lane 1", "positive"]),
    ("electronics.stretcher_gain", -1.0, ParameterError, ["electronics.stretcher_gain: got -1.0", "positive"]),
    ("gear.gear_reduction", [2.0, 3.0, 0.5], ParameterError, ["gear.gear_reduction of lane 2", "at least 1"]),
    ("stops.restitution", [0.5, 1.5], ParameterError, ["stops.restitution of lane 1", "from 0 to 1"]),
    ("motor.rotor_inertia", ["1", "2"], InputError, ["motor.rotor_inertia of lane 0", "a finite number"]),
    ("motor.rotor_inertia", [1e-7, None], InputError, ["motor.rotor_inertia of lane 1", "a finite number"]),
    ("motor.rotor_inertia", [True, False], InputError, ["motor.rotor_inertia of lane 0", "True"]),
    ("motor.rotor_inertia", [[1e-7]], InputError, ["motor.rotor_inertia", "one number per lane"]),
    ("motor.rotor_inertia", [[1e-7], [1e-7, 2e-7]], InputError, ["motor.rotor_inertia", "one number per lane"]),
    ("motor.rotor_inertia", [], InputError, ["numbers of lanes", "motor.rotor_inertia: 0"]),
    ("motor.rotor_inertia", [1j, 2j], InputError, ["motor.rotor_inertia of lane 0"]),
    ("motor.rotor_inertia", np.ma.array([1e-7, 2e-7], mask=[False, True]), InputError,
     ["motor.rotor_inertia: got 'a masked array'"]),
    ("motor.rotor_inertia", "x", InputError, ["motor.rotor_inertia", "'x'"]),
    ("electronics.off_state", ["brake", "x"], ParameterError, ["electronics.off_state of lane 1", "brake or coast"]),
    ("electronics.off_state", ["brake", 1], ParameterError, ["electronics.off_state of lane 1", "brake or coast"]),
    ("electronics.off_state", 1.0, ParameterError, ["electronics.off_state", "one such word per lane"]),
    ("electronics.off_state", [["brake"], ["brake", "coast"]], ParameterError, ["one such word per lane"]),
    ("electronics.off_state", np.array("float"), ParameterError, ["electronics.off_state", "brake or coast"]),
    ("electronics.off_state", "float", ParameterError, ["electronics.off_state", "brake or coast"]),
    ("electronics.stretcher_gian", 60.0, UnknownNameError, ["stretcher_gian", "did you mean", "load.inertia"]),
    ("electronics.bridge_gain", 60.0, ParameterError, ["PulseServo does not read 'electronics.bridge_gain'"]),
    ("motor.armature_resistance", None, MissingParameterError, ["PulseServo needs motor.armature_resistance"]),
    ("load.inertia", [0.0, -1e-3], LoadError, ["load.inertia of lane 1", "at least 0"]),
    ("load.torque", [0.0, NAN], LoadError, ["load.torque of lane 1", "finite"]),
    ("load.torque", NAN, LoadError, ["load.torque: got nan"]),
    ("load.pendulum.mass", [0.0, 1.0], LoadError, ["load.pendulum", "0 pendulums"]),
    ("load.mass", 1.0, UnknownNameError, ["load.mass", "load.pendulum.mass"]),
])
def test_parameters(name, value, error, words):
    refused(error, words, parameters={name: value})


def test_relations_between_parameters():
    refused(ParameterError, ["stops.lower_angle of lane 1: got 0.4", "less than stops.upper_angle = 0.3"],
            parameters={"stops.lower_angle": [0.0, 0.4], "stops.upper_angle": [0.3, 0.3]})
    refused(ParameterError, ["supply.bridge_drop_voltage of lane 0: got 7.0", "supply.open_circuit_voltage = 6.0"],
            parameters={"supply.bridge_drop_voltage": 7.0, "supply.open_circuit_voltage": [6.0, 8.0]})
    refused(ParameterError, ["electronics.pulse_width_min: got 0.003"],
            parameters={"electronics.pulse_width_min": 3e-3, "electronics.pulse_width_max": 2e-3})


def test_both_ends_of_a_relation_may_move():
    lanes = many.lanes_of(st.PulseServo(SERVO), STEP, None,
                          {"stops.lower_angle": [7.0, 8.0], "stops.upper_angle": [9.0, 10.0]}, None, None)
    assert lanes.count == 2


@pytest.mark.parametrize(("options", "error", "words"), [
    ({"duration": 0.0}, InputError, ["duration"]),
    ({"duration": [1.0]}, InputError, ["duration"]),
    ({"dtype": "float16"}, InputError, ["dtype", "float16", '"float64" or "float32"']),
    ({"dtype": None}, InputError, ["dtype"]),
    ({"dtype": "double trouble"}, InputError, ["dtype"]),
    ({"outputs": ("output_angel",)}, UnknownNameError, ["output_angel", "did you mean 'output_angle'"]),
    ({"outputs": ()}, InputError, ["outputs", "at least one"]),
    ({"outputs": 3}, InputError, ["outputs", "names"]),
    ({"output_times": [0.2]}, InputError, ["output_times", "0 to 0.1"]),
    ({"output_times": [0.1], "output_step": 0.1}, InputError, ["output_step and output_times"]),
    ({"duration": 1e300}, InputError, ["duration / frame period of lane 0: got '5e+301 frames'", "1e+08"]),
    ({"duration": 1e8, "command": [STEP, signals.constant(1500.0, unit="us", frame_period=2e-3)],
      "parameters": {"electronics.frame_period": [1.0, 1.0]}}, InputError,
     ["frame period of lane 1: got '5e+10 frames'"]),
    ({"executor": ThreadPoolExecutor}, InputError, ["executor", "submit"]),
    ({"executor": 4}, InputError, ["executor", "submit"]),
    ({"chunk": 0}, InputError, ["chunk", "at least 1"]),
    ({"chunk": 1.5}, InputError, ["chunk"]),
    ({"chunk": True}, InputError, ["chunk"]),
    ({"progress": 1}, InputError, ["progress"]),
    ({"seeds": [0.5]}, InputError, ["seeds"]),
    ({"seeds": [2**63]}, InputError, ["seeds", "64 bits"]),
    ({"seeds": [[1], [1, 2]]}, InputError, ["seeds"]),
    ({"seeds": np.ma.array([1, 2], mask=[True, False])}, InputError, ["seeds"]),
    ({"parameters": [1.0]}, InputError, ["parameters", "a mapping"]),
    ({"parameters": {1: 1.0}}, InputError, ["parameters", "a mapping"]),
    ({"initial": {"output_angle": [0.1, NAN]}}, InputError, ["initial output_angle of lane 1"]),
    ({"initial": {"output_angle": NAN}}, InputError, ["initial output_angle: got nan"]),
    ({"initial": {"motor_angle": 0.1}}, UnknownNameError, ["motor_angle", "output_angle, output_speed"]),
    ({"initial": {"output_angle": [0.1, 9.0]}}, InputError, ["initial output_angle of lane 1: got 9.0", "stops"]),
    ({"load": 3.0}, LoadError, ["load", "float"]),
    ({"load": np.array(3.0)}, LoadError, ["load", "float"]),
    ({"load": [None, 3.0]}, LoadError, ["load of lane 1", "float"]),
    ({"load": [None, loads.Recorded([0.0, 0.05], [0.0, 0.0])]}, LoadError, ["recorded torque of lane 1"]),
    ({"load": [loads.Pendulum(mass=0.1, length=0.1), None], "parameters": {"load.pendulum.mass": 0.2}}, LoadError,
     ["load.pendulum of lane 1"]),
    ({"seeds": [1, 2], "parameters": {"load.inertia": [0.0] * 3}}, InputError,
     ["numbers of lanes", "load.inertia: 3", "seeds: 2"]),
    ({"outputs": ("output_angle", "output_speed"), "parameters": {"load.inertia": np.zeros(1_000_000)},
      "duration": 1000.0, "output_times": None}, InputError, ["2 x 1000000 x 1000001", "1.6e+04 GB", "memory"]),
])
def test_other_arguments(options, error, words):
    refused(error, words, parameters=options.pop("parameters", {"stops.lower_angle": [-1.0, -2.0]}), **options)


@pytest.mark.parametrize(("command", "words"), [
    (3.0, ["command: got 'float'"]),
    (np.array(3.0), ["command: got 'float'"]),
    ([STEP, 3.0], ["command of lane 1"]),
    ([STEP, signals.step(0.0, 300.0, unit="deg")], ["angle command of lane 1", "300 deg", "travel"]),
    ([STEP, signals.step(300.0, 0.0, unit="deg")], ["angle command of lane 1", "300 deg", "travel"]),
    ([STEP, signals.constant(21e-3, unit="s")], ["pulse width of lane 1", "20000 us"]),
    ([STEP, signals.constant(15e-3, unit="s", frame_period=0.01)], ["pulse width of lane 1", "10000 us"]),
])
def test_commands(command, words):
    refused(CommandError, words, command=command)


def test_a_command_beyond_the_travel_of_some_lanes():
    refused(CommandError, ["angle command of lane 2: got '50 deg'", "to 28.6479 deg"], model=st.BoundedServo,
            parameters={"stops.upper_angle": [1.0, 2.0, 0.5]})
    refused(CommandError, ["pulse width of lane 1"], command=signals.constant(-1.0, unit="V"), parameters={
        "electronics.voltage_to_pulse_gain": 7e-4, "electronics.command_pulse_offset": [1e-3, 5e-4]})


@pytest.mark.parametrize(("values", "words"), [
    ([1.0, 2.0], ["grid: got [1.0, 2.0]", "mapping"]),
    ({"load.inertia": [[0.0], [0.0, 1.0]]}, ["grid: load.inertia"]),
    ({"load.inertia": []}, ["grid: load.inertia", "at least one"]),
    ({"load.inertia": np.ma.array([0.0, 1.0], mask=[True, False])}, ["grid: load.inertia", "masked"]),
    ({str(k): np.zeros(1000) for k in range(5)}, ["grid: got '1e+15 combinations'", "memory"]),
])
def test_grids(values, words):
    with pytest.raises(InputError) as caught:
        st.grid(values)
    for word in words:
        assert word in str(caught.value)


def test_a_grid_has_each_name_once():
    with pytest.raises(InputError, match="grid: a: got 'two lists'"):
        st.grid({"a": [1.0]}, a=[2.0])


def test_what_is_no_model_is_refused():
    with pytest.raises(InputError, match="BoundedServo or PulseServo or PulseServoInductive"):
        st.simulate_many(3, STEP, duration=0.1)


def test_a_run_of_too_many_ticks_is_said_in_ticks():
    model = st.DigitalServo(st.load_servo("feetech-sts3215-12v"))
    with pytest.raises(InputError, match=r"duration / control period of lane 0: got '1e\+09 ticks'"):
        st.simulate_many(model, signals.constant(0.5, unit="rad"), duration=1e6, output_times=[1.0])
