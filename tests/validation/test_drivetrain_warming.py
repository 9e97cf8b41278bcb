"""Heat, inductance and all terms together against the independent reference, at every accuracy.

The windings of these servos warm by tens of kelvin within a fraction of a second, far faster than real ones.

`python -m validation.test_drivetrain_warming 0 100`, in tests/, prints the errors of as many; each takes ten seconds.
"""

import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

import plain_run
import servotwin as st
from reference.drivetrain import simulate_case
from reference.drivetrain_cases import random_case
from validation.test_drivetrain_reference import COARSE, on_a_knife_edge, simulate

pytestmark = pytest.mark.long

ALL = {"inductance", "heat", "m6", "stribeck", "backlash", "limit", "coast", "wiper"}
LAWS = ({"heat"}, {"inductance", "heat"}, {"inductance", "m5"}, {"inductance", "heat", "m5", "coast"}, ALL)
ACCURACIES = (1e-7, 1e-9, 1e-11)
FEW, MANY = 5, 12
SHORT, LONG = 0.05, 0.2  # s
FLOOR = 3e-11  # where a servo that sticks and creeps again and again is led by rounding, at any accuracy


def errors(seed, accuracies, duration=LONG, by=st.simulate):
    """Largest error of the angle [rad] by accuracy; nan where rounding decides."""
    case = replace(random_case(seed, frozenset(LAWS[seed % len(LAWS)])), duration=duration)
    times = np.linspace(0.0, case.duration, 21)
    trace = simulate_case(case, times, **COARSE)
    if on_a_knife_edge(trace):
        return [np.nan] * len(accuracies)
    return [np.max(np.abs(simulate(case, times, by, accuracy=accuracy)["output_angle"] - trace.output_angle))
            for accuracy in accuracies]


def over(seeds, accuracies, duration, by=st.simulate):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # random calibrations and capacities differ by design
        return np.array([errors(seed, accuracies, duration, by) for seed in seeds])


def test_servos_that_warm_up():
    off = over(range(FEW), (1e-9,), SHORT)
    np.testing.assert_allclose(over(range(FEW), (1e-9,), SHORT, plain_run.simulate), off, rtol=0.0, atol=1e-13)
    assert np.sum(np.isnan(off)) <= 1
    assert np.nanmax(off) < 1e-9


@pytest.mark.slow
def test_servos_that_warm_up_at_every_accuracy():
    """The error falls with the accuracy asked for."""
    off = over(range(MANY), ACCURACIES, LONG)
    assert np.sum(np.isnan(off[:, 0])) <= 1
    for k, accuracy in enumerate(ACCURACIES):
        assert np.nanmax(off[:, k]) < max(accuracy, FLOOR)
    assert np.all(np.diff(np.nanquantile(off, 0.9, axis=0)) <= 0.0)


@pytest.mark.parametrize("inductive", [False, True])
def test_ten_minutes_of_heating(servo, inductive):
    """Lanes beside finer ones to the end, and beside `simulate` for the first half minute."""
    heat = {"thermal.winding_capacity": 2.0, "thermal.housing_capacity": 60.0, "thermal.winding_to_housing": 8.0,
            "thermal.housing_to_ambient": 10.0, "thermal.magnet_coefficient": -1.5e-3}
    kind = st.PulseServoInductive if inductive else st.PulseServo
    model, load = kind(servo.replace(heat | {"motor.armature_inductance": 1e-3})), st.loads.Inertia(1e-3)
    at = np.arange(0.0, 600.0, 0.4)
    goals = np.random.default_rng(7).uniform(20.0, 160.0, at.size)
    command = st.signals.samples(at, goals, unit="deg", hold="previous")
    times, names = np.arange(30.0, 601.0, 30.0), ("winding_temperature", "housing_temperature")
    usual, fine = (st.simulate_many(model, command, duration=600.0, load=load + st.loads.Constant(0.0), outputs=names,
                                    output_times=times, parameters={"load.torque": [0.2, 0.3]}, accuracy=accuracy)
                   for accuracy in (1e-9, 1e-12))
    first = st.simulate(model, command, duration=30.0, load=load + st.loads.Constant(0.2), output_times=[30.0])
    for name in names:
        assert np.all(usual[name][:, -1] > 300.0)
        np.testing.assert_allclose(usual[name], fine[name], rtol=0.0, atol=1e-7)
        np.testing.assert_allclose(first[name], usual[name][0, :1], rtol=0.0, atol=1e-8)


if __name__ == "__main__":
    worst = np.zeros(len(ACCURACIES))
    for number in range(*map(int, sys.argv[1:])):
        (off,) = over([number], ACCURACIES, LONG)
        worst = np.fmax(worst, off)
        sys.stdout.write(f"{number} {'+'.join(sorted(LAWS[number % len(LAWS)]))}: {off}\n")
        sys.stdout.flush()
    sys.stdout.write(f"largest: {worst}\n")
