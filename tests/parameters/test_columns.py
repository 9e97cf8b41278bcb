"""A group of which some values are columns is checked as a group is, and the lane is named."""

import numpy as np
import pytest

from servotwin.errors import ParameterError
from servotwin.parameters.groups import check_columns

from .conftest import MASSES

PAIR = np.array([2.0, 3.0])


@pytest.mark.parametrize(("group", "values", "message"), [
    ("stops", {"lower_angle": np.array([0.1, 0.4]), "upper_angle": 0.3},
     "stops.lower_angle of lane 1: got 0.4, allowed: less than stops.upper_angle = 0.3"),
    ("stops", {"lower_angle": 0.1, "upper_angle": np.array([0.3, 0.05])},
     "stops.lower_angle of lane 1: got 0.1, allowed: less than stops.upper_angle = 0.05"),
    ("stops", {"lower_angle": np.array([0.1, 0.2]), "upper_angle": np.array([0.3, 0.2])},
     "stops.lower_angle of lane 1: got 0.2, allowed: less than stops.upper_angle = 0.2"),
    ("electronics", {"pulse_width_min": np.array([1e-3, 3e-3]), "pulse_width_max": 2e-3},
     "electronics.pulse_width_min of lane 1: got 0.003, allowed: less than electronics.pulse_width_max = 0.002"),
    ("supply", {"bridge_drop_voltage": 0.4, "open_circuit_voltage": np.array([6.0, 0.3])},
     "supply.bridge_drop_voltage of lane 1: got 0.4, allowed: less than supply.open_circuit_voltage = 0.3"),
    ("friction", {"stribeck_exponent": PAIR},
     "friction.stribeck_exponent of lane 0: got 2.0, allowed: only together with friction.stribeck_speed"),
    ("friction", {"load_friction": PAIR, "load_friction_motor": 0.5},
     "friction.load_friction_motor: got 0.5, allowed: not beside friction.load_friction, "
     "which belongs to another friction law"),
    ("friction", {"load_friction": 0.5, "load_friction_external": PAIR},
     "friction.load_friction_external of lane 0: got 2.0, allowed: not beside friction.load_friction, "
     "which belongs to another friction law"),
    ("firmware", {"compute_delay": np.array([1e-3, 0.1]), "control_period": 1e-3},
     "firmware.compute_delay of lane 1: got 0.1, allowed: at most 15 times firmware.control_period = 0.015"),
    ("firmware", {"derivative_ticks": np.array([20.0, 1.5])},
     "firmware.derivative_ticks of lane 1: got 1.5, allowed: a whole number"),
    ("firmware", {"whole_counts": "yes", "angle_quantum": 1e-3},
     "firmware.whole_counts: got 'yes', allowed: only together with firmware.angle_quantum, firmware.duty_quantum"),
    ("thermal", {"winding_capacity": PAIR},
     "thermal.winding_capacity of lane 0: got 2.0, allowed: only together with thermal.housing_capacity, "
     "thermal.winding_to_housing, thermal.housing_to_ambient"),
    ("thermal", {"magnet_coefficient": -PAIR, "ambient": 300.0},
     "thermal.magnet_coefficient of lane 0: got -2.0, allowed: only together with thermal.winding_capacity, "
     "thermal.housing_capacity, thermal.winding_to_housing, thermal.housing_to_ambient"),
    ("thermal", {**MASSES, "ambient": np.array([300.0, -1.0])},
     "thermal.ambient of lane 1: got -1.0, allowed: a positive number [K]"),
    ("potentiometer", {"linearity_angle": (0.0, 1.0), "feedback_gain": PAIR},
     "potentiometer.linearity_error: allowed: as many values as potentiometer.linearity_angle"),
    ("potentiometer", {"linearity_angle": np.array([1.0, 0.0]), "linearity_error": (0.0, 1.0), "feedback_gain": PAIR},
     "potentiometer.linearity_angle: got (1.0, 0.0), allowed: increasing angles"),
])
def test_what_contradicts_is_refused_in_one_line(group, values, message):
    with pytest.raises(ParameterError) as caught:
        check_columns(group, values)
    assert str(caught.value) == message


@pytest.mark.parametrize(("group", "values"), [
    ("stops", {"lower_angle": np.array([0.1, 0.2]), "upper_angle": 0.3}),
    ("stops", {"lower_angle": None, "upper_angle": PAIR}),
    ("friction", {"stribeck_exponent": PAIR, "stribeck_speed": 10.0}),
    ("friction", {"stribeck_exponent": 2.0, "stribeck_speed": PAIR}),
    ("friction", {"load_friction_motor": PAIR, "load_friction_external": 0.5}),
    ("thermal", {**MASSES, "winding_capacity": PAIR}),
    ("thermal", {**MASSES, "magnet_coefficient": -PAIR}),
    ("thermal", {"ambient": 290.0 + PAIR}),
    ("potentiometer", {"feedback_gain": PAIR, "linearity_angle": (0.0, 1.0), "linearity_error": [0, 1]}),
    ("potentiometer", {"quantisation": PAIR, "linearity_angle": np.array([0.0, 1.0]),
                       "linearity_error": np.array([0.0, 1.0])}),
])
def test_what_agrees_is_taken_and_left_as_it_is(group, values):
    before = {name: np.copy(value) for name, value in values.items() if isinstance(value, np.ndarray)}
    check_columns(group, values)
    for name, value in before.items():
        np.testing.assert_array_equal(values[name], value)
