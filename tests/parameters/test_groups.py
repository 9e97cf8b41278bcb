"""Every field of every group checks its value once, and refuses in one line that names it."""

import dataclasses
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

from servotwin import units
from servotwin.errors import ParameterError
from servotwin.parameters import GROUPS

from .conftest import COMPANIONS, MASSES

# The names of physics, group by group
NAMES = {
    "motor": "armature_resistance armature_inductance torque_constant back_emf_constant rotor_inertia "
             "motor_viscous_friction brush_drop_voltage",
    "gear": "gear_reduction backlash output_inertia stiffness damping",
    "friction": "coulomb_torque_forward coulomb_torque_backward zero_crossing_slope breakaway_ratio stribeck_speed "
                "stribeck_exponent load_friction load_friction_stribeck load_friction_motor load_friction_external "
                "load_friction_motor_stribeck load_friction_external_stribeck load_friction_motor_quad "
                "load_friction_external_quad bearing_coulomb_torque",
    "electronics": "bridge_gain comparator_gain voltage_to_pulse_gain pulse_to_voltage_gain command_offset "
                   "command_pulse_offset voltage_deadband frame_period deadband stretcher_gain minimum_drive_time "
                   "stretcher_time_constant off_state silence_state one_shot_offset one_shot_slope back_emf_injection "
                   "supply_coupling pulse_timeout pulse_width_min pulse_width_max",
    "potentiometer": "feedback_gain feedback_offset backlash noise linearity_angle linearity_error quantisation "
                     "fixed_angle",
    "firmware": "control_period control_phase compute_delay angle_quantum filter_weight deadband_angle deadband_law "
                "proportional_gain integral_gain derivative_gain velocity_feedforward acceleration_feedforward "
                "derivative_of derivative_ticks derivative_threshold integral_limit anti_windup integral_at_rest "
                "rest_travel duty_quantum whole_counts minimum_duty torque_limit duty_limit duty_slew current_limit "
                "current_sense off_state torque_off_state pulse_resolution command_kind bus_latency lower_goal "
                "upper_goal speed_limit acceleration_limit minimum_speed overload_duty overload_time stall_travel "
                "overload_output overload_latches trip_current trip_time trip_temperature undervoltage "
                "undervoltage_action restart_time signal_timeout signal_loss failsafe_angle soft_start_duty "
                "soft_start_time",
    "supply": "open_circuit_voltage internal_resistance bridge_drop_voltage bridge_drop_resistance current_limit",
    "stops": "lower_angle upper_angle restitution",
    "thermal": "winding_capacity housing_capacity winding_to_housing housing_to_ambient ambient magnet_coefficient",
}
FIELDS = [(group, f.name, f.metadata) for group, kind in GROUPS.items() for f in dataclasses.fields(kind)]
NUMBERS = [(group, name, meta) for group, name, meta in FIELDS if isinstance(meta["rule"], str)
           and meta["rule"] != "table"]
IDS = [f"{group}.{name}" for group, name, _ in NUMBERS]


def build(group, name, value):
    return GROUPS[group](**{name: value}, **COMPANIONS.get(f"{group}.{name}", {}))


def refused(group, name, value):
    with pytest.raises(ParameterError) as caught:
        build(group, name, value)
    error = caught.value
    text = str(error)
    assert error.what == f"{group}.{name}"
    assert text.startswith(f"{group}.{name}: got {error.got!r}"[:60])
    assert "allowed: " in text
    assert "\n" not in text
    return text


def test_names_are_those_of_the_specification():
    assert {group: [f.name for f in dataclasses.fields(kind)] for group, kind in GROUPS.items()} == {
        group: names.split() for group, names in NAMES.items()}
    assert list(GROUPS) == list(NAMES)


def test_nothing_is_required():
    for kind in GROUPS.values():
        assert all(value is None for value in dataclasses.asdict(kind()).values())


def test_every_field_says_dimension_rule_and_meaning():
    for group, name, metadata in FIELDS:
        assert metadata["meaning"], f"{group}.{name}"
        assert metadata["rule"], f"{group}.{name}"
        assert metadata["dimension"] == "word" or metadata["dimension"] in units.DIMENSIONS, f"{group}.{name}"


@pytest.mark.parametrize(("group", "name", "metadata"), NUMBERS, ids=IDS)
def test_what_is_no_finite_number_is_refused(group, name, metadata):
    for value in (math.nan, math.inf, -math.inf, True, False, "3.0", b"3", [3.0], (), {}, 1j, 10**400):
        refused(group, name, value)


@pytest.mark.parametrize(("group", "name", "metadata"), NUMBERS, ids=IDS)
def test_numbers_of_every_kind_become_floats(group, name, metadata):
    for value in (1, 1.0, np.float64(1.0), np.float32(1.0), np.int64(1), Fraction(1, 1)):
        kept = getattr(build(group, name, value), name)
        assert kept == 1.0
        assert type(kept) is float


OUTSIDE = {"a positive number": (0.0, -1.0, -1e-300), "a number of at least 0": (-1e-300, -1.0),
           "a number of at least 1": (0.999999, 0.0, -280.0), "a number from 0 to 1": (-0.01, 1.01)}
INSIDE = {"a positive number": (1e-12, 5.0), "a number of at least 0": (0.0, 5.0), "a finite number": (-5.0, 0.0, 5.0),
          "a number of at least 1": (1.0, 280.0), "a number from 0 to 1": (0.0, 1.0)}


@pytest.mark.parametrize(("group", "name", "metadata"), NUMBERS, ids=IDS)
def test_ranges(group, name, metadata):
    for value in INSIDE[metadata["rule"]]:
        assert getattr(build(group, name, value), name) == value
    for value in OUTSIDE.get(metadata["rule"], ()):
        assert metadata["rule"] in refused(group, name, value)


def test_a_number_that_is_lost_as_a_float_is_judged_as_the_float():
    assert "positive" in refused("motor", "armature_resistance", Fraction(1, 10**400))
    assert GROUPS["motor"](motor_viscous_friction=Fraction(-1, 10**400)).motor_viscous_friction == 0.0


@pytest.mark.parametrize(("name", "rule"), [
    ("motor.armature_resistance", "positive"), ("motor.torque_constant", "positive"),
    ("motor.rotor_inertia", "positive"), ("motor.motor_viscous_friction", "at least 0"),
    ("gear.gear_reduction", "at least 1"), ("friction.coulomb_torque_forward", "at least 0"),
    ("friction.zero_crossing_slope", "positive"), ("friction.breakaway_ratio", "at least 1"),
    ("electronics.frame_period", "positive"), ("electronics.one_shot_offset", "finite"),
    ("electronics.command_offset", "finite"), ("electronics.deadband", "at least 0"),
    ("potentiometer.feedback_gain", "positive"), ("potentiometer.feedback_offset", "finite"),
    ("stops.restitution", "0 to 1"), ("thermal.magnet_coefficient", "finite"),
])
def test_the_rules_that_physics_asks_for(name, rule):
    group, _, key = name.partition(".")
    assert rule in GROUPS[group].__dataclass_fields__[key].metadata["rule"]


def test_the_message_is_the_one_that_was_promised():
    assert refused("motor", "armature_resistance", -3.0) == \
        "motor.armature_resistance: got -3.0, allowed: a positive number [ohm]"


@pytest.mark.parametrize("name", ["off_state", "silence_state"])
@pytest.mark.parametrize("word", ["brake", "coast"])
def test_off_state(name, word):
    assert getattr(GROUPS["electronics"](**{name: word}), name) == word


@pytest.mark.parametrize("word", ["Brake", "", 1, True, ["brake"], math.nan])
def test_off_state_refuses(word):
    for name in ("off_state", "silence_state"):
        assert "brake or coast" in refused("electronics", name, word)


@pytest.mark.parametrize(("group", "values", "named"), [
    ("stops", {"lower_angle": 1.0, "upper_angle": 1.0}, "stops.upper_angle"),
    ("stops", {"lower_angle": 2.0, "upper_angle": 1.0}, "stops.upper_angle"),
    ("electronics", {"pulse_width_min": 2e-3, "pulse_width_max": 1e-3}, "electronics.pulse_width_max"),
    ("supply", {"open_circuit_voltage": 6.0, "bridge_drop_voltage": 6.0}, "supply.open_circuit_voltage"),
    ("friction", {"stribeck_exponent": 2.0}, "friction.stribeck_speed"),
    ("gear", {"damping": 0.1}, "gear.stiffness"),
    ("thermal", {"winding_capacity": 2.0}, "thermal.housing_to_ambient"),
    ("thermal", {name: MASSES[name] for name in list(MASSES)[1:]}, "thermal.winding_capacity"),
    ("thermal", {"magnet_coefficient": -0.001}, "thermal.winding_capacity"),
    ("thermal", {"magnet_coefficient": -0.001, "housing_capacity": 30.0}, "thermal.winding_capacity"),
    ("friction", {"load_friction": 0.1, "load_friction_motor": 0.1}, "friction.load_friction_motor"),
    ("friction", {"load_friction_stribeck": 0.1, "load_friction_external": 0.1}, "friction.load_friction_external"),
    ("potentiometer", {"linearity_angle": (0.0, 1.0)}, "potentiometer.linearity_angle"),
    ("potentiometer", {"linearity_error": (0.0, 1.0)}, "potentiometer.linearity_angle"),
    ("potentiometer", {"linearity_angle": (0.0, 1.0), "linearity_error": (0.0,)}, "potentiometer.linearity_angle"),
    ("potentiometer", {"linearity_angle": (0.0, 0.0), "linearity_error": (0.0, 1.0)}, "increasing"),
    ("potentiometer", {"linearity_angle": (1.0, 0.0), "linearity_error": (0.0, 1.0)}, "increasing"),
])
def test_what_contradicts_is_refused(group, values, named):
    with pytest.raises(ParameterError) as caught:
        GROUPS[group](**values)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_air_has_a_temperature_without_any_heat():
    assert GROUPS["thermal"](ambient=310.0).ambient == 310.0


def test_a_gear_may_lock_itself():
    assert GROUPS["friction"](load_friction_external=1.2).load_friction_external == 1.2


@pytest.mark.parametrize("bad", [3.0, (), [], "0 1", (0.0, math.nan), (0.0, "1"), (0.0, True), {0.0: 1.0}])
def test_a_bad_table_is_refused(bad):
    with pytest.raises(ParameterError, match=r"potentiometer\.linearity_angle.*allowed"):
        GROUPS["potentiometer"](linearity_angle=bad, linearity_error=(0.0, 1.0))


def test_tables_may_be_arrays():
    group = GROUPS["potentiometer"](linearity_angle=np.array([0.0, 1.0]), linearity_error=[0, 1])
    assert group.linearity_angle == (0.0, 1.0)
    assert group.linearity_error == (0.0, 1.0)


def test_groups_are_frozen_keyword_only_comparable_and_picklable():
    motor = GROUPS["motor"](armature_resistance=3.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        motor.armature_resistance = 4.0
    with pytest.raises(TypeError):
        GROUPS["motor"](3.0)
    assert motor == GROUPS["motor"](armature_resistance=3.0)
    assert hash(motor) == hash(GROUPS["motor"](armature_resistance=3.0))
    assert pickle.loads(pickle.dumps(motor)) == motor
