"""How a shaft stands: swings are counted, creeping is not."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

import servotwin as st
from servotwin.bench import standing
from servotwin.bench.standing import turning_points
from servotwin.errors import InputError


def test_turning_points_of_a_sine():
    """Ten periods turn twenty times."""
    values = np.sin(np.linspace(0.0, 20.0 * math.pi, 2001))
    assert turning_points(values.tolist(), 0.1) == pytest.approx([1.0, -1.0] * 10, abs=1e-9)
    assert len(turning_points(values.tolist(), 1.99)) == 18  # without the halves at both ends
    assert turning_points(values.tolist(), 2.01) == []


def test_creep_and_ripple_are_no_swings():
    creep = np.linspace(0.0, 1.0, 1001)
    assert turning_points(creep.tolist(), 0.1) == []
    assert turning_points((creep + 0.04 * np.sin(300.0 * creep)).tolist(), 0.1) == []
    assert turning_points([], 0.1) == []
    assert turning_points([1.0], 0.1) == []


@dataclass(frozen=True)
class Recorded:
    """Stands for a result whose angle is known."""

    angle: Callable
    time: np.ndarray = ()
    names = ("output_angle", "armature_current")
    ended = 3.0

    def __getitem__(self, name):
        return np.radians(self.angle(self.time)) if name == "output_angle" else np.full_like(self.time, 0.5)


def test_a_vibration_on_a_drift_is_counted():
    """Swings of 2°, forty a second, while the shaft goes 60° its way."""
    still = standing(Recorded(lambda t: 60.0 + 20.0 * t + np.sin(80.0 * math.pi * t)), 0.0)
    assert math.degrees(still.swing) == pytest.approx(61.0, abs=1.0)
    assert still.frequency == pytest.approx(40.0, abs=0.5)


def test_small_swings_between_large_ones_are_not_counted():
    result = Recorded(lambda t: 90.0 + 10.0 * np.sin(4.0 * math.pi * t) + 0.8 * np.sin(80.0 * math.pi * t))
    assert standing(result, 0.0).frequency == pytest.approx(2.0, abs=0.2)
    assert standing(result, 0.0, least=math.radians(0.05)).frequency == pytest.approx(40.0, abs=0.5)


def test_numbers_by_hand():
    still = standing(Recorded(lambda t: 90.0 + 3.0 * np.sin(4.0 * math.pi * t)), 0.0, 2.0)
    assert math.degrees(still.mean) == pytest.approx(90.0, abs=1e-3)
    assert math.degrees(still.swing) == pytest.approx(6.0, abs=1e-3)
    assert still.frequency == 2.0
    assert still.current == pytest.approx(0.5, rel=1e-12)


def test_the_lowest_bus_is_that_of_the_start(servo):
    """From rest a motor draws most: (V_oc - V_ce0) / (R_a + R_b)."""
    soft = servo.replace({"supply.internal_resistance": 0.5})
    model = st.PulseServo(soft)
    result = st.simulate(model, st.signals.step(0.0, 90.0, unit="deg"), duration=0.1)
    drop = 0.5 * 5.6 / (model.value("motor.armature_resistance") + 0.5)
    assert standing(result, 0.0).lowest_bus == pytest.approx(6.0 - drop, abs=5e-3)


def test_a_motor_has_no_supply(servo):
    result = st.simulate(st.AveragedServo(servo), st.signals.constant(90.0, unit="deg"), duration=0.1)
    assert math.isnan(standing(result, 0.0).lowest_bus)


def test_bad_input_is_refused(servo):
    result = st.simulate(st.BoundedServo(servo), st.signals.constant(90.0, unit="deg"), duration=0.2)
    for start, end in ((-0.1, None), (0.2, None), (0.1, 0.05), (0.0, 0.3), (math.nan, None)):
        with pytest.raises(InputError, match="stretch"):
            standing(result, start, end)
    for least in (0.0, -1.0, math.nan):
        with pytest.raises(InputError, match="least"):
            standing(result, 0.0, least=least)
