"""Numbers far from those of servos: one line that names value, range and the unit that was probably meant."""

import math
import warnings
from dataclasses import fields

import pytest

import servotwin as st
from servotwin.errors import PlausibilityWarning
from servotwin.parameters import GROUPS
from servotwin.parameters.groups import RULES
from servotwin.parameters.servo import AT_OUTPUT, oddity, plausible_range

SERVO = st.load_servo("hitec-hs-755hb")
NUMBERS = [(f"{group}.{f.name}", f.metadata) for group, kind in GROUPS.items() for f in fields(kind)
           if f.metadata["dimension"] != "word"]


@pytest.fixture
def said():
    """Warnings of the test, all of them."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield caught


@pytest.mark.parametrize(("name", "value", "range_", "meant"), [
    ("electronics.deadband", 8.0, "1e-07 to 0.0005 s", "8 us"),
    ("electronics.deadband", 0.008, "1e-07 to 0.0005 s", "0.008 ms"),
    ("electronics.frame_period", 20.0, "0.0002 to 0.2 s", "20 ms"),
    ("stops.upper_angle", 180.0, "-20 to 20 rad", "180 deg"),
    ("gear.backlash", 0.5, "0 to 0.2 rad", "0.5 deg"),
    ("motor.torque_constant", 3.7, "7.143e-05 to 0.1071 N m/A behind a reduction of 280", "3.7 mN m/A"),
    ("motor.rotor_inertia", 0.5, "1.276e-12 to 2.551e-05 kg m2 behind a reduction of 280", "0.5 g cm2"),
    ("motor.armature_inductance", 0.5, "1e-06 to 0.05 H", "0.5 mH"),
    ("supply.open_circuit_voltage", 6000.0, "0.5 to 100 V", "6000 mV"),
    ("thermal.ambient", 25.0, "200 to 400 K", "25 deg C"),
    ("firmware.speed_limit", 300.0, "0.01 to 200 rad/s", "300 deg/s"),
    ("gear.gear_reduction", 1e5, "1 to 4000", "")])
def test_a_number_in_another_unit_is_told_once(said, name, value, range_, meant):
    changed = SERVO.replace({name: value})
    (warning,) = said
    assert warning.category is PlausibilityWarning
    unit = st.units.si_unit(st.parameters.dimension_of(name))
    shown = f"{value:g}" if unit == "1" else f"{value:g} {unit}"
    asks = f": {meant}?" if meant else ""
    assert str(warning.message) == f"hitec-hs-755hb: {name} of {shown} is not plausible ({range_}){asks}"
    changed.replace({"motor.armature_resistance": 3.0})
    changed.replace({name: value})
    assert len(said) == 1  # of new values alone


@pytest.mark.parametrize("name", st.catalog_names())
def test_no_servo_of_the_catalog_is_odd(name):
    servo = st.load_servo(name)
    assert [text for each in servo.names() if (text := oddity(servo, each))] == []


@pytest.mark.parametrize(("name", "metadata"), NUMBERS, ids=[name for name, _ in NUMBERS])
def test_each_number_has_a_range_with_a_source(name, metadata):
    low, high, source = plausible_range(name)
    assert low < high
    assert source
    if metadata["rule"] != "table":
        assert RULES[metadata["rule"]](low)
        assert RULES[metadata["rule"]](high)


def test_what_a_motor_is_at_the_output_may_stand_behind_a_reduction_of_1(said):
    N = SERVO.gear.gear_reduction
    st.servo_from_values("output", {
        "gear": {"gear_reduction": 1.0},
        "motor": {"torque_constant": N * SERVO.motor.torque_constant,
                  "rotor_inertia": N**2 * SERVO.motor.rotor_inertia},
        "friction": {"coulomb_torque_forward": N * SERVO.friction.coulomb_torque_forward, "stribeck_speed": 0.1}})
    assert said == []
    assert plausible_range("motor.rotor_inertia", N).high == pytest.approx(2.0 / N**2)
    assert set(AT_OUTPUT) == {name for name, _ in NUMBERS if plausible_range(name, 7.0) != plausible_range(name)}


@pytest.mark.parametrize("values", [
    {"electronics.deadband": 0.0, "electronics.voltage_deadband": 0.0, "motor.motor_viscous_friction": 0.0},
    {"electronics.deadband": 20e-6, "stops.upper_angle": math.pi, "gear.backlash": 0.0},
    {"electronics.off_state": "coast", "gear.backlash": None}])
def test_usual_numbers_and_nothing_are_not(said, values):
    SERVO.replace(values)
    assert said == []


def test_a_file_is_judged_in_its_own_units(said, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n[electronics]\nframe_period = { value = 20, unit = "s", origin = "assumed" }\n'
                    'deadband = { value = 8e-6, unit = "us", origin = "assumed" }\n'
                    '[stops]\nlower_angle = { value = -9000, unit = "deg", origin = "assumed" }\n')
    st.load_servo(path)
    assert sorted(str(warning.message) for warning in said) == [
        "mine: electronics.deadband of 8e-06 us is not plausible (0.1 to 500 us): 8e-06 s?",
        "mine: electronics.frame_period of 20 s is not plausible (0.0002 to 0.2 s): 20 ms?",
        "mine: stops.lower_angle of -9000 deg is not plausible (-1146 to 1146 deg)"]
    assert all(warning.filename == __file__ for warning in said)


def test_values_by_group_are_judged_too(said):
    st.servo_from_values("mine", {"potentiometer": {"linearity_angle": (0.0, 90.0), "linearity_error": (0.0, 0.01)}})
    (warning,) = said
    assert str(warning.message) == ("mine: potentiometer.linearity_angle of 90 rad is not plausible (-20 to 20 rad): "
                                    "90 deg?")
