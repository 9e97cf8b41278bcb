"""Heat, inductance and all terms together against the independent reference, at every accuracy.

The windings of these servos warm by tens of kelvin within a fraction of a second, far faster than real ones.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from reference.drivetrain import simulate_case
from reference.drivetrain_cases import random_case
from validation.test_drivetrain_reference import COARSE, on_a_knife_edge, simulate

ALL = {"inductance", "heat", "m6", "stribeck", "backlash", "limit", "coast", "wiper"}
LAWS = ({"heat"}, {"inductance", "heat"}, {"inductance", "m5"}, {"inductance", "heat", "m5", "coast"}, ALL)
ACCURACIES = (1e-7, 1e-9, 1e-11)
FEW, MANY = 5, 100
SHORT, LONG = 0.05, 0.2  # s
FLOOR = 3e-11  # where a servo that sticks and creeps again and again is led by rounding, at any accuracy


def errors(seed, accuracies, duration=LONG):
    """Largest error of the angle [rad] by accuracy; nan where rounding decides."""
    case = replace(random_case(seed, frozenset(LAWS[seed % len(LAWS)])), duration=duration)
    times = np.linspace(0.0, case.duration, 21)
    trace = simulate_case(case, times, **COARSE)
    if on_a_knife_edge(trace):
        return [np.nan] * len(accuracies)
    return [np.max(np.abs(simulate(case, times, accuracy=accuracy)["output_angle"] - trace.output_angle))
            for accuracy in accuracies]


def over(seeds, accuracies, duration):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # random calibrations and capacities differ by design
        return np.array([errors(seed, accuracies, duration) for seed in seeds])


def test_servos_that_warm_up():
    off = over(range(FEW), (1e-9,), SHORT)
    assert np.sum(np.isnan(off)) <= 1
    assert np.nanmax(off) < 1e-9


@pytest.mark.slow
def test_servos_that_warm_up_at_every_accuracy():
    """The error falls with the accuracy asked for."""
    off = over(range(MANY), ACCURACIES, LONG)
    assert np.sum(np.isnan(off[:, 0])) <= 4
    for k, accuracy in enumerate(ACCURACIES):
        assert np.nanmax(off[:, k]) < max(accuracy, FLOOR)
    assert np.all(np.diff(np.nanquantile(off, 0.9, axis=0)) <= 0.0)
