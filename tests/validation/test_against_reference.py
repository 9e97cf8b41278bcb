"""The package against the independent reference, on random servos, loads and commands."""

import warnings

import numpy as np
import pytest

import servotwin as st
from reference import reference
from reference.cases import COMMANDS, DURATION, LOADS, random_case
from validation.cases_in_words import command_of, load_of, servo_of

TIMES = np.linspace(0.0, DURATION, 151)


def run(model_class, case):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # random calibrations differ by design
        model = model_class(servo_of(case))
    return st.simulate(model, command_of(case.command), duration=DURATION, load=load_of(case.load),
                       output_times=TIMES).raise_if_failed()


# Every load with two commands, so that each command is there three times; the servos are random
PAIRS = [(load, COMMANDS[(k + turn) % len(COMMANDS)]) for turn in (0, 3) for k, load in enumerate(LOADS)]
FIRST = PAIRS[:len(LOADS)]  # every load once, every command at least once


def of(load, command, seed):
    return random_case(np.random.default_rng([seed, LOADS.index(load), COMMANDS.index(command)]), load=load,
                       command=command)


@pytest.mark.long(but="free-step")
@pytest.mark.parametrize(("load", "command"), PAIRS)
def test_bounded_servo(load, command):
    bounded_agrees(of(load, command, 0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(80))
def test_more_bounded_servos(seed):
    bounded_agrees(random_case(np.random.default_rng(seed)))


def bounded_agrees(case):
    exact = reference.solve_bounded(case.plant, case.v_c, DURATION, TIMES, breaks=case.breaks)
    result = run(st.BoundedServo, case)
    tolerance = 1e-12 if result.stats.method == "closed form" else 1e-9
    np.testing.assert_allclose(result["output_angle"], exact.q, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(result["output_speed"], exact.w, rtol=0.0, atol=100 * tolerance)


@pytest.mark.long(but="constant-chirp")
@pytest.mark.parametrize(("load", "command"), FIRST)
def test_averaged_servo(load, command):
    case = of(load, command, 1000)
    exact = reference.solve_averaged(case.plant, case.v_c, DURATION, TIMES, breaks=case.breaks)
    result = run(st.AveragedServo, case)
    np.testing.assert_allclose(result["output_angle"], exact.q, rtol=0.0, atol=1e-9)


@pytest.mark.long(but="spring-step")
@pytest.mark.parametrize(("load", "command"), FIRST)
def test_averaged_servo_with_inductance(load, command):
    case = of(load, command, 2000)
    exact = reference.solve_averaged_inductive(case.plant, case.v_c, DURATION, TIMES, breaks=case.breaks)
    result = run(st.AveragedServoInductive, case)
    np.testing.assert_allclose(result["output_angle"], exact.q, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(result["armature_current"], exact.i, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("kind", ["free", "inertia", "viscous", "constant", "spring", "pendulum", "recorded"])
def test_geared_motor(kind):
    case = random_case(np.random.default_rng(3000), load=kind)
    signal = command_of(case.command)  # here it is the armature voltage
    exact = reference.solve_geared_motor(case.plant, lambda t: float(signal(max(t, 0.0))), DURATION, TIMES,
                                         breaks=case.breaks)
    result = run(st.GearedMotor, case)
    scale = np.abs(exact.q).max() + 1.0
    tolerance = (1e-11 if result.stats.method == "closed form" else 1e-8) * scale
    np.testing.assert_allclose(result["output_angle"], exact.q, rtol=0.0, atol=tolerance)


def test_dc_motor():
    case = random_case(np.random.default_rng(4000), load="free", command="sine")
    signal = command_of(case.command)
    exact = reference.solve_dc_motor(case.plant, lambda t: float(signal(max(t, 0.0))), DURATION, TIMES)
    result = run(st.DCMotor, case)
    np.testing.assert_allclose(result["motor_angle"], exact.q, rtol=1e-11, atol=1e-10)
    np.testing.assert_allclose(result["armature_current"], exact.i, rtol=1e-9, atol=1e-10)
