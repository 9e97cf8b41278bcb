"""Servo files: what is saved is read back, bit for bit, and what is wrong is said in one line."""

import dataclasses
import os
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from servotwin import units
from servotwin.errors import OutputError, OutputExistsError, ServoFileError
from servotwin.parameters import GROUPS, load_servo, servo_from_values, unit_of

from .conftest import COMPANIONS, servos

GOOD = """
name = "mine"
[motor]
armature_resistance = { value = 3.0, unit = "ohm", origin = "measured", source = "my bench" }
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="mine.toml"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def refused(path):
    with pytest.raises(ServoFileError) as caught:
        load_servo(path)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    return caught.value


# -- round trips

@pytest.mark.long
@given(servos())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
def test_what_is_saved_is_read_back(tmp_path, servo):
    path = tmp_path / "servo.toml"
    servo.save(path, overwrite=True)
    again = load_servo(path)
    assert again == servo
    assert dict(again.quantities) == dict(servo.quantities)
    assert (again.sheet, again.fit, again.notes, again.title) == (servo.sheet, servo.fit, servo.notes, servo.title)


@pytest.mark.parametrize("other", ["stops", "potentiometer"])  # of stops and an endless shaft a servo has one
def test_every_field_survives(tmp_path, other):
    values = {group: {name: 0.7 if f.metadata["rule"] == "a number from 0 to 1" else 1.25
                      for name, f in kind.__dataclass_fields__.items() if isinstance(f.metadata.get("rule"), str)
                      and f.metadata["rule"] != "table" and not name.startswith("load_friction_")}
              for group, kind in GROUPS.items()}
    values["electronics"] |= {"off_state": "coast", "silence_state": "brake", "pulse_width_min": 0.25}
    values["potentiometer"] |= {"linearity_angle": (-1.0, 0.1, 2.0), "linearity_error": (0.0, 0.1 + 0.2, -1e-300)}
    values["supply"]["bridge_drop_voltage"] = 0.1
    values["stops"]["lower_angle"] = -1.0
    values["firmware"] |= {"derivative_ticks": 2.0, "lower_goal": -1.0}
    if other == "potentiometer":
        gone = len(values.pop("stops"))
    else:
        gone = len([values["potentiometer"].pop("fixed_angle")])
    servo = servo_from_values("mine", values)
    servo.save(tmp_path / "a.toml")
    again = load_servo(tmp_path / "a.toml")
    assert again == servo
    words = sum(isinstance(f.metadata.get("rule"), tuple) for f in GROUPS["firmware"].__dataclass_fields__.values())
    every = sum(len(kind.__dataclass_fields__) - 1 for kind in GROUPS.values())
    assert len(again.names()) == every - 7 - words - gone


def test_the_saved_file_is_plain_si_with_one_table_per_group(tmp_path):
    servo_from_values("mine", {"gear": {"gear_reduction": 280.0}, "electronics": {"off_state": "brake"}}).save(
        str(tmp_path / "a.toml"))
    content = tomllib.loads((tmp_path / "a.toml").read_text(encoding="utf-8"))
    assert content == {"name": "mine", "title": "", "gear": {"gear_reduction": {
        "value": 280.0, "unit": "1", "origin": "assumed"}},
        "electronics": {"off_state": {"value": "brake", "origin": "assumed"}}}


def test_sheet_and_fit_are_kept_as_they_are(write, tmp_path):
    path = write(GOOD + """
[sheet]
stall_torque = { value = 13.2, unit = "kgf cm", source = "list" }
[fit]
data = "1f3a"
at_bound = ["motor.armature_resistance"]
when = 2011-03-01
bounds = { "motor.armature_resistance" = [1.0, 5.0] }
""")
    servo = load_servo(path)
    assert servo.sheet["stall_torque"] == {"value": 13.2, "unit": "kgf cm", "source": "list"}
    assert servo.fit["at_bound"] == ["motor.armature_resistance"]
    servo.save(tmp_path / "again.toml")
    assert load_servo(tmp_path / "again.toml") == servo


# -- reading

@pytest.mark.parametrize(("group", "name", "dimension"), [
    (group, name, f.metadata["dimension"]) for group, kind in GROUPS.items()
    for name, f in kind.__dataclass_fields__.items()
    if f.metadata.get("rule") in ("a positive number", "a finite number")
    and name != "pulse_width_min"])
def test_every_unit_of_the_dimension_is_read(write, group, name, dimension):
    beside = "".join(f'{key} = {{ value = {value}, unit = "{unit_of(f"{group}.{key}")}", origin = "assumed" }}\n'
                     for key, value in COMPANIONS.get(f"{group}.{name}", {}).items())
    for unit, factor in units.DIMENSIONS[dimension].items():
        path = write(f'name="a"\n[{group}]\n{name} = {{ value = 3, unit = "{unit}", origin = "assumed", std = 1 }}\n'
                     + beside)
        servo = load_servo(path)
        assert servo.get(f"{group}.{name}") == pytest.approx(3 * factor, rel=1e-15)
        quantity = servo.source(f"{group}.{name}")
        assert quantity.std == pytest.approx(factor, rel=1e-15)
        assert quantity.unit == units.si_unit(dimension)


def test_bounds_are_converted_too(write):
    quantity = load_servo(write('name="a"\n[stops]\nupper_angle = { value = 90, unit = "deg", origin = "assumed", '
                                'lower = 80, upper = 100 }')).source("stops.upper_angle")
    assert quantity.lower < quantity.value < quantity.upper < 1.8


@pytest.mark.parametrize("text", [GOOD.replace("\n", "\r\n"), "\N{ZERO WIDTH NO-BREAK SPACE}" + GOOD,
                                  GOOD.replace("my bench", "Meßplatz Ω")])
def test_files_of_all_editors_are_read(write, text):
    assert load_servo(write(text)).motor.armature_resistance == 3.0


@pytest.mark.parametrize("kind", ["analog", "digital", "bus"])
def test_the_kind_is_kept_and_analog_unless_given(write, tmp_path, kind):
    servo = load_servo(write(f'kind = "{kind}"\n{GOOD}'))
    servo.save(tmp_path / "again.toml")
    assert load_servo(tmp_path / "again.toml") == servo
    assert (servo.kind, load_servo(write(GOOD)).kind) == (kind, "analog")
    assert servo.replace({"motor.armature_resistance": 2.0}).kind == kind


@pytest.mark.parametrize(("kind", "said"), [('"brushless"', "kind: not a kind of servo: got 'brushless'"),
                                            ("1", "kind: not a text: got 1")])
def test_an_unknown_kind_is_said(write, kind, said):
    with pytest.raises(ServoFileError, match="allowed: ") as caught:
        load_servo(write(f"kind = {kind}\n{GOOD}"))
    assert said in str(caught.value)


def test_the_title_is_the_name_unless_given(write):
    assert load_servo(write(GOOD)).title == "mine"


def test_a_file_is_found_by_suffix_by_separator_and_by_being_there(write, tmp_path, monkeypatch):
    path = write(GOOD)
    bare = write(GOOD, "mine")
    monkeypatch.chdir(tmp_path)
    for name in (path, str(path), "mine.toml", bare, str(bare), "mine", os.path.join(".", "mine")):
        assert load_servo(name).name == "mine"


# -- what is wrong

@pytest.mark.parametrize(("old", "new", "key", "parts"), [
    ("3.0", "-3.0", "armature_resistance", ["got -3.0", "allowed: a positive number [ohm]"]),
    ("3.0", "nan", "armature_resistance", ["got nan", "allowed: a positive number [ohm]"]),
    ("3.0", "-inf", "armature_resistance", ["got -inf"]),
    ("3.0", '"3"', "armature_resistance", ["got '3'"]),
    ("3.0", "true", "armature_resistance", ["got True"]),
    ("3.0", "[3.0]", "armature_resistance", ["got (3.0,)"]),
    ("3.0", "2011-03-01", "armature_resistance", ["datetime.date"]),
    ("3.0", "1" + "0" * 400, "armature_resistance", ["got inf"]),
    ("3.0", "-1" + "0" * 400, "armature_resistance", ["got -inf"]),
    ('"ohm"', '"V"', "armature_resistance", ["wrong unit: got 'V'", "allowed: ohm, mohm"]),
    ('unit = "ohm", ', "", "armature_resistance", ["no unit", "allowed: ohm, mohm"]),
    ('"ohm"', "1", "armature_resistance", ["unit is not a text: got 1"]),
    ("measured", "guessed", "armature_resistance", ["got 'guessed'", "measured, identified, datasheet"]),
    ('origin = "measured", ', "", "armature_resistance", ["no origin", "measured, identified"]),
    (', source = "my bench"', "", "armature_resistance", ["source of a value that is measured"]),
    ('"my bench"', '""', "armature_resistance", ["source of a value that is measured"]),
    ('"my bench"', "3", "armature_resistance", ["source is not a text"]),
    ("value = 3.0, ", "", "armature_resistance", ["no value"]),
    ("value", "valu", "armature_resistance", ["unknown entry 'valu'; did you mean 'value'?"]),
    ('"my bench"', '"my bench", lower = 4.0', "armature_resistance", ["lower: got 4.0", "at most the value 3.0"]),
    ('"my bench"', '"my bench", upper = 2.0', "armature_resistance", ["upper: got 2.0", "at least the value 3.0"]),
    ('"my bench"', '"my bench", std = -1.0', "armature_resistance", ["std: got -1.0"]),
    ('"my bench"', '"my bench", std = 1.0, lower = 1.0', "armature_resistance", ["either std or lower and upper"]),
    ('"my bench"', '"my bench", std = "1"', "armature_resistance", ["std is not a number"]),
    ('"my bench"', '"my bench", upper = 1' + "0" * 400, "armature_resistance", ["upper: got inf"]),
    ("{ value = 3.0,", "3.0 #", "armature_resistance", ["got 3.0", "{ value = ..., unit"]),
    ("armature_resistance", "armature_resistence", None, ["unknown parameter", "did you mean 'armature_resistance'?"]),
    ("armature_resistance", "title", None, ["unknown parameter 'title'"]),
])
def test_what_is_wrong_in_a_value_is_said_with_table_and_key(write, old, new, key, parts):
    error = refused(write(GOOD.replace(old, new)))
    assert "[motor]" in str(error)
    assert error.table == "motor"
    assert error.key == key
    for part in parts:
        assert part in str(error)


@pytest.mark.parametrize(("text", "parts"), [
    ("", ["name: missing", "allowed: a short id"]), (GOOD.replace('"mine"', '""'), ["name: missing"]),
    (GOOD.replace('"mine"', "3"), ["name: not a text: got 3"]), ("title = []\n" + GOOD, ["title: not a text"]),
    (GOOD.replace("[motor]", "[moter]"), ["unknown table or key 'moter'; did you mean 'motor'?"]),
    ("motor = 3\n" + GOOD.split("[motor]")[0], ["[motor]: not a table: got 3"]),
    (GOOD.replace("[motor]", "[[motor]]"), ["[motor]: not a table: got [{", "allowed: a table [motor]"]),
    ('"a\\nb\\u001b" = 1\n' + GOOD, ["unknown table or key 'a\\nb\\x1b'"]),
    (GOOD + "[gear]\ngear_reduction = { value = 0.5, unit = '1', origin = 'assumed' }",
     ["[gear] gear_reduction", "got 0.5", "a number of at least 1"]),
    (GOOD + "[gear]\ngear_reduction = 280.0", ["[gear] gear_reduction", "not a value with its origin: got 280.0"]),
    ("sheet = 1\n" + GOOD, ["not a table"]),
    ("fit = []\n" + GOOD, ["not a table"]),
    (GOOD + "[stops]\nlower_angle = { value = 1, unit = 'rad', origin = 'assumed' }\n"
            "upper_angle = { value = 1, unit = 'rad', origin = 'assumed' }\n", ["[stops] lower_angle", "less than"]),
    (GOOD + "[electronics]\noff_state = { value = 'off', origin = 'assumed' }", ["off_state", "brake or coast"]),
    (GOOD + "[electronics]\noff_state = { value = 'brake', unit = '1', origin = 'assumed' }", ["off_state", "a word"]),
    (GOOD + "[electronics]\noff_state = { value = 'brake', std = 1, origin = 'assumed' }", ["off_state", "a word"]),
    (GOOD + "[potentiometer]\nlinearity_angle = { value = [0, 1], unit = 'deg', origin = 'assumed' }",
     ["[potentiometer] linearity_error", "as many values"]),
])
def test_what_is_wrong_in_a_file_is_said(write, text, parts):
    error = refused(write(text))
    for part in parts:
        assert part in str(error)


@pytest.mark.parametrize(("low", "high", "parts"), [
    ("{ value = 8.4, unit = 'V' }", "{ value = 6, unit = 'V' }", ["voltage_max of 'mine'", "got '8.4 to 6 V'"]),
    ("{ value = 4.8, unit = 'V' }", None, ["got 'one end alone'", "two positive voltages, the lower one first"]),
    (None, "{ value = 6, unit = 'V' }", ["got 'one end alone'"]),
    ("{ value = 0, unit = 'V' }", "{ value = 6, unit = 'V' }", ["got '0 to 6 V'"]),
    ("{ value = nan, unit = 'V' }", "{ value = 6, unit = 'V' }", ["[sheet] voltage_min of 'mine'", "nan"]),
    ("{ value = 4.8, unit = 'V' }", "{ value = inf, unit = 'V' }", ["[sheet] voltage_max of 'mine'", "inf"]),
    ("{ value = 4.8, unit = 'A' }", "{ value = 6, unit = 'V' }", ["[sheet] voltage_min of 'mine'", 'unit = "V"']),
    ("4.8", "6.0", ["[sheet] voltage_min of 'mine'", "got 4.8"])])
def test_a_range_of_voltages_that_is_none_is_one_line(write, low, high, parts):
    ends = {"voltage_min": low, "voltage_max": high}
    error = refused(write(GOOD + "[sheet]\n" + "".join(f"{key} = {end}\n" for key, end in ends.items() if end)))
    for part in parts:
        assert part in str(error)


@pytest.mark.parametrize("text", [
    GOOD + "[", GOOD + "[motor]\n", GOOD + GOOD.split("[motor]")[1], "= 3", "\0", "name = 'a", "x = " + "[" * 5000,
    "name = 1" + "0" * 5000, b"\x7fELF",
])
def test_broken_toml_is_one_line(write, text):
    assert "is not valid TOML: " in str(refused(write(text)))


def test_broken_toml_says_where(write):
    assert "line 3, column 7" in str(refused(write("\n\n[motor}\n")))


@pytest.mark.parametrize("content", [b"name = '\xff'", "name = 'é'".encode("latin-1"), GOOD.encode("utf-16")])
def test_a_file_that_is_not_utf_8_is_one_line(write, content):
    assert "is not UTF-8 text" in str(refused(write(content)))


def test_a_file_that_cannot_be_read_is_one_line(write, tmp_path):
    assert "no such file" in str(refused(tmp_path / "none.toml"))
    assert "is a folder" in str(refused(tmp_path))
    assert "cannot be read" in str(refused(write(GOOD) / "below.toml"))
    assert "cannot be read" in str(refused(tmp_path / ("x" * 300 + ".toml")))


def test_a_path_with_a_nul_is_one_line():
    with pytest.raises(ServoFileError, match="null byte"):
        load_servo("a\0.toml")


# -- writing

@pytest.fixture
def servo():
    return servo_from_values("mine", {"gear": {"gear_reduction": 280.0}})


def test_nothing_is_overwritten_unless_asked(servo, tmp_path):
    path = tmp_path / "a.toml"
    path.write_text("precious")
    with pytest.raises(OutputExistsError, match="exists already"):
        servo.save(path)
    assert path.read_text() == "precious"
    servo.save(path, overwrite=True)
    assert load_servo(path) == servo


@pytest.mark.parametrize("where", ["folder", "below a file", "in a missing folder", "name too long", "nul"])
def test_what_cannot_be_written_is_one_line(servo, tmp_path, where):
    (tmp_path / "file").write_text("")
    path = {"folder": tmp_path, "below a file": tmp_path / "file" / "a.toml",
            "in a missing folder": tmp_path / "none" / "a.toml", "name too long": tmp_path / ("x" * 300),
            "nul": tmp_path / "a\0b"}[where]
    with pytest.raises(OutputError) as caught:
        servo.save(path, overwrite=True)
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_failure_half_way_loses_nothing(servo, tmp_path, monkeypatch):
    path = tmp_path / "a.toml"
    path.write_text("precious")

    def fail(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OutputError, match=r"cannot be written \(No space left on device"):
        servo.save(path, overwrite=True)
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["a.toml"]


def test_text_that_no_file_can_hold_is_one_line(servo, tmp_path):
    broken = dataclasses.replace(servo_from_values("mine", {}), notes="\ud800")
    with pytest.raises(OutputError, match="not valid Unicode"):
        broken.save(tmp_path / "a.toml")
    assert not list(tmp_path.iterdir())


@given(st.sampled_from(["stretcher_gain", "frame_period"]), st.floats(1e-300, 1e300))
def test_numbers_keep_every_bit(tmp_path_factory, name, value):
    path = tmp_path_factory.mktemp("bits") / "a.toml"
    servo_from_values("mine", {"electronics": {name: value}}).save(path)
    assert load_servo(path).get(f"electronics.{name}") == value


def test_a_file_of_a_servo_that_turns_without_end_has_no_stops(tmp_path):
    servo_from_values("mine", {"potentiometer": {"fixed_angle": 1.5}}).save(tmp_path / "wheel.toml")
    assert load_servo(tmp_path / "wheel.toml").potentiometer.fixed_angle == 1.5
    with (tmp_path / "wheel.toml").open("a", encoding="utf-8") as file:
        file.write('[stops]\nupper_angle = { value = 90, unit = "deg", origin = "assumed" }\n')
    with pytest.raises(ServoFileError, match=r"wheel\.toml.*potentiometer\.fixed_angle.*stops\.upper_angle[^\n]*$"):
        load_servo(tmp_path / "wheel.toml")
