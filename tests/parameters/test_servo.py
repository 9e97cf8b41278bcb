"""A servo: plain numbers by group, with what is known of each."""

import copy
import dataclasses
import pickle

import pytest
from hypothesis import given

from servotwin.errors import ParameterError, UnknownNameError
from servotwin.parameters import GROUPS, Motor, Quantity, Servo, load_servo, servo_from_values, unit_of

from .conftest import plain_values, servos

NAME = "motor.armature_resistance"


@pytest.fixture
def servo():
    return servo_from_values("mine", {"motor": {"armature_resistance": 3, "torque_constant": 4e-3},
                                      "electronics": {"off_state": "brake"}}, title="Mine")


@given(plain_values)
def test_plain_values_come_back(values):
    servo = servo_from_values("mine", values)
    given_names = {f"{group}.{key}" for group, entries in values.items() for key in entries}
    assert set(servo.names()) == given_names
    for name in given_names:
        group, _, key = name.partition(".")
        assert servo.get(name) == getattr(getattr(servo, group), key) == values[group][key]
        quantity = servo.source(name)
        assert (quantity.value, quantity.origin, quantity.unit) == (values[group][key], "assumed", unit_of(name))


def test_all_groups_are_there_and_absent_fields_are_none(servo):
    for group, kind in GROUPS.items():
        assert isinstance(getattr(servo, group), kind)
    assert servo.gear.gear_reduction is None
    assert servo.get("gear.gear_reduction") is None
    assert servo.motor.armature_resistance == 3.0
    assert type(servo.motor.armature_resistance) is float


def test_names_follow_the_order_of_the_groups(servo):
    assert servo.names() == (NAME, "motor.torque_constant", "electronics.off_state")


def test_replace_changes_what_it_names_and_nothing_else(servo):
    other = servo.replace({NAME: 3.1, "gear.gear_reduction": 200})
    assert (other.get(NAME), other.gear.gear_reduction) == (3.1, 200.0)
    assert (other.source(NAME).origin, other.source(NAME).source) == ("assumed", "set by the user")
    assert other.source("motor.torque_constant") == servo.source("motor.torque_constant")
    assert (other.name, other.title) == (servo.name, servo.title)
    assert servo.get(NAME) == 3.0
    assert servo.replace({}) == servo


def test_replace_by_none_takes_away(servo):
    other = servo.replace({NAME: None})
    assert other.get(NAME) is None
    assert NAME not in other.names()
    assert NAME not in other.quantities


def test_replace_checks_what_depends_on_several_fields():
    servo = servo_from_values("mine", {"stops": {"lower_angle": 0.0, "upper_angle": 1.0}})
    assert servo.replace({"stops.lower_angle": 5.0, "stops.upper_angle": 6.0}).stops.lower_angle == 5.0
    with pytest.raises(ParameterError, match=r"stops\.lower_angle: got 5\.0, allowed: less than stops\.upper_angle"):
        servo.replace({"stops.lower_angle": 5.0})


def test_replace_keeps_sheet_fit_and_notes():
    servo = load_servo("hitec-hs-755hb")
    other = servo.replace({NAME: 3.1})
    assert other.sheet == servo.sheet
    assert other.notes == servo.notes


@pytest.mark.parametrize("change", [
    lambda servo: servo.replace({"motor.armature_resistence": 3.0}),
    lambda servo: servo.get("motor.armature_resistence"),
    lambda servo: servo.source("motor.armature_resistence"),
    lambda servo: servo_from_values("x", {"motor": {"armature_resistence": 3.0}}),
])
def test_an_unknown_name_gets_the_nearest_suggestion(servo, change):
    with pytest.raises(UnknownNameError) as caught:
        change(servo)
    assert caught.value.suggestion == NAME
    assert "did you mean 'motor.armature_resistance'?" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", "motor", "motor.", ".armature_resistance", "armature_resistance", "motor.title",
                                  "load.inertia", "motor.armature_resistance.value", "moter.armature_resistance"])
def test_what_is_no_dotted_name_is_refused(servo, name):
    with pytest.raises(UnknownNameError):
        servo.get(name)
    with pytest.raises(UnknownNameError):
        servo.replace({name: 1.0})


def test_an_unknown_group_is_refused():
    with pytest.raises(UnknownNameError, match=r"unknown parameter group 'moter'; did you mean 'motor'\?"):
        servo_from_values("mine", {"moter": {"armature_resistance": 3.0}})


@pytest.mark.parametrize("entries", [3.0, None, [("armature_resistance", 3.0)], "armature_resistance"])
def test_a_group_must_be_a_mapping(entries):
    with pytest.raises(ParameterError, match=r"motor.*allowed: a mapping of names to values"):
        servo_from_values("mine", {"motor": entries})


@pytest.mark.parametrize("name", ["", None, 3, b"mine"])
def test_a_servo_needs_a_name(name):
    with pytest.raises(ParameterError, match=r"name of a servo.*allowed: a short id"):
        servo_from_values(name, {})


def test_bad_values_are_refused(servo):
    with pytest.raises(ParameterError, match=r"motor\.armature_resistance: got -3\.0, allowed: a positive"):
        servo_from_values("mine", {"motor": {"armature_resistance": -3.0}})
    with pytest.raises(ParameterError, match=r"motor\.armature_resistance: got nan, allowed"):
        servo.replace({NAME: float("nan")})


def test_the_source_of_what_is_absent_is_refused(servo):
    with pytest.raises(ParameterError, match="not given by servo 'mine'"):
        servo.source("gear.gear_reduction")


def test_a_servo_made_of_groups_knows_that_its_values_are_assumed():
    servo = Servo(name="mine", motor=Motor(armature_resistance=3.0))
    assert servo.source(NAME) == Quantity(value=3.0, unit="ohm", origin="assumed")
    stale = dataclasses.replace(servo.replace({NAME: 4.0}), motor=Motor(armature_resistance=5.0))
    assert stale.source(NAME).value == 5.0
    assert stale.source(NAME).source is None


def test_mappings_cannot_be_changed(servo):
    with pytest.raises(TypeError):
        servo.quantities[NAME] = None
    with pytest.raises(dataclasses.FrozenInstanceError):
        servo.title = "other"


@pytest.mark.long
@given(servos())
def test_servos_are_comparable_hashable_picklable_and_copyable(servo):
    for other in (pickle.loads(pickle.dumps(servo)), copy.deepcopy(servo), copy.copy(servo), servo.replace({})):
        assert other == servo
        assert hash(other) == hash(servo)
        assert other.names() == servo.names()
    assert servo.replace({NAME: 123.25}) != servo


class TestQuantity:
    def test_spread_in_words(self):
        assert Quantity(value=1.0, unit="1", origin="assumed", std=0.25).spread == "± 0.25"
        assert Quantity(value=1.0, unit="1", origin="assumed", lower=0.5, upper=2.0).spread == "0.5 to 2"
        assert Quantity(value=1.0, unit="1", origin="assumed", lower=0.5).spread == "from 0.5"
        assert Quantity(value=1.0, unit="1", origin="assumed", upper=2.0).spread == "up to 2"
        assert Quantity(value=1.0, unit="1", origin="assumed").spread == ""

    @pytest.mark.parametrize(("change", "named"), [
        ({"origin": "guessed"}, "origin"), ({"origin": "measured"}, "source"),
        ({"origin": "measured", "source": ""}, "source"), ({"lower": 2.0}, "lower"), ({"upper": 0.5}, "upper"),
        ({"std": -1.0}, "std"), ({"std": 1.0, "lower": 0.5}, "std"), ({"std": float("nan")}, "std"),
        ({"lower": float("-inf")}, "lower"), ({"upper": float("inf")}, "upper"),
    ])
    def test_what_does_not_fit_is_refused(self, change, named):
        with pytest.raises(ParameterError) as caught:
            Quantity(**({"value": 1.0, "unit": "1", "origin": "assumed"} | change))
        assert named in str(caught.value)
        assert "\n" not in str(caught.value)
