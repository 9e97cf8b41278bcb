"""A servo made of a sheet does what the sheet says, and says where every number comes from."""

import math
import re
import warnings

import pytest

import rest_bands
import servotwin as st
from servotwin.errors import InputError
from servotwin.identification import (
    Sheet,
    SheetPoint,
    motor_range,
    servo_file_text,
    servo_from_sheet,
    sheet_contradictions,
    sheet_flags,
    sheet_of,
    write_servo_text,
)
from servotwin.identification.sheets.motor_range import torque_question
from servotwin.models import MODELS
from servotwin.parameters import catalog_names, load_servo

ANALOG = {name: kind for name, kind in MODELS.items() if name != "digital"}  # what needs no program

BARE = Sheet(name="bare", points=(SheetPoint(supply_voltage=6.0, stall_torque=0.4, no_load_speed=5.5),))
ONE = SheetPoint(supply_voltage=6.0, stall_torque=1.2945, no_load_speed=math.pi / 3 / 0.23, no_load_current=0.285)
TWO = SheetPoint(supply_voltage=4.8, stall_torque=1.0787, no_load_speed=math.pi / 3 / 0.28, no_load_current=0.23)
STALL = SheetPoint(supply_voltage=6.0, stall_torque=0.3432, no_load_speed=math.pi / 3 / 0.15, no_load_current=0.18,
                   stall_current=0.8)
FULL = Sheet(name="full", title="Full 1", points=(ONE, TWO), deadband=8e-6, pulse_min=556e-6, pulse_max=2410e-6,
             neutral_pulse=1.5e-3, travel=math.radians(202.0), angle_per_pulse=math.radians(0.1125) * 1e6, mass=0.11,
             gear_reduction=300.0, motor_type="3-pole", modulation="analog", source="the box",
             sources={"mass": "kitchen scales"}, note="Bought used.")
IMPOSSIBLE = Sheet(name="wonder", points=(SheetPoint(
    supply_voltage=8.4, stall_torque=3.3539, no_load_speed=math.pi / 3 / 0.098, no_load_current=0.34,
    stall_current=3.6),), source="a shop")
SHEETS = {"bare": BARE, "full": FULL, "stall": Sheet(name="stall", points=(STALL,))}


@pytest.fixture(params=SHEETS)
def sheet(request):
    return SHEETS[request.param]


def top_speed(servo):
    """The highest speed of a turn from stop to stop, nearly."""
    low, high = 0.9 * servo.stops.lower_angle, 0.9 * servo.stops.upper_angle
    result = st.simulate(st.PulseServo(servo), st.signals.step(low, high, at=0.02, unit="rad"), duration=0.6,
                         output_step=2e-3)
    result.raise_if_failed()
    return abs(result["output_speed"]).max()


def lifts(servo, torque):
    """Whether the servo, told to go far up, turns against a torque, and with it."""
    result = st.simulate(st.PulseServo(servo), st.signals.constant(0.8 * servo.stops.upper_angle, unit="rad"),
                         duration=0.4, load=st.loads.Constant(torque), initial={"output_angle": 0.0})
    result.raise_if_failed()
    return result["output_angle"][-1] > math.radians(1.0)


# -- it does what the sheet says

@pytest.mark.parametrize("point", [ONE, STALL, BARE.points[0]], ids=["running", "both", "none"])
def test_speed_and_stall_torque_of_the_pulse_servo_are_the_sheets(point):
    servo = servo_from_sheet(Sheet(name="a", points=(point,)))
    assert top_speed(servo) == pytest.approx(point.no_load_speed, rel=0.01)
    assert lifts(servo, 0.97 * point.stall_torque)
    assert not lifts(servo, 1.03 * point.stall_torque)


def test_without_load_friction_the_speed_stays_and_the_torque_is_that_of_the_motor():
    servo = servo_from_sheet(Sheet(name="a", points=(STALL,)), load_friction=False)
    assert servo.friction.load_friction_motor is None
    assert top_speed(servo) == pytest.approx(STALL.no_load_speed, rel=0.01)
    eta = motor_range(Sheet(name="a", points=(STALL,))).gear_efficiency.value
    assert lifts(servo, 0.97 * STALL.stall_torque / eta)
    assert not lifts(servo, 1.03 * STALL.stall_torque / eta)
    assert "stalls at more than the sheet's torque" in " ".join(servo.notes.split())
    result = st.simulate(st.PulseServo(servo), st.signals.step(-20.0, 20.0, unit="deg"), duration=0.2)
    assert result.stats.method == "closed form"


def test_the_running_current_is_the_sheets():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,)))
    step = st.signals.step(-85.0, 85.0, at=0.02, unit="deg")
    result = st.simulate(st.PulseServo(servo), step, duration=0.5)
    running = result["output_speed"] > 0.99 * ONE.no_load_speed
    assert running.sum() > 50
    assert abs(result["armature_current"][running]).mean() == pytest.approx(0.285, rel=0.05)


@pytest.mark.parametrize("kind", ANALOG.values(), ids=list(ANALOG))
def test_every_model_runs_it(sheet, kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = kind(servo_from_sheet(sheet))
    result = st.simulate(model, st.signals.step(1.2, 1.4, at=0.05, unit="V"), duration=0.2)
    result.raise_if_failed()
    turned = result[model.layout[0]] - result[model.layout[0]][0]
    assert turned[-1] > 0.01


def test_the_bounded_servo_goes_where_it_is_told(sheet):
    servo = servo_from_sheet(sheet)
    result = st.simulate(st.BoundedServo(servo), st.signals.step(-25.0, 25.0, at=0.05, unit="deg"), duration=1.5)
    assert result["output_speed"][-1] == 0.0
    assert abs(result["output_angle"][-1] - math.radians(25.0)) <= rest_bands.averaged(servo)


# -- where the numbers come from

def test_every_number_has_origin_source_and_spread(sheet):
    servo = servo_from_sheet(sheet)
    for name in servo.names():
        quantity = servo.source(name)
        assert quantity.origin in ("datasheet", "assumed"), name
        assert quantity.source, name
        if name not in ("electronics.comparator_gain", "electronics.off_state", "supply.open_circuit_voltage") \
                and (name, sheet.gear_reduction) != ("gear.gear_reduction", 300.0):
            assert quantity.spread, name


def test_motor_and_friction_are_those_of_the_sheet_over_the_reduction(sheet):
    servo, motor = servo_from_sheet(sheet), motor_range(sheet)
    N = servo.gear.gear_reduction
    for name, expected, by in (
            ("motor.armature_resistance", motor.resistance, 1.0),
            ("motor.torque_constant", motor.output_torque_constant, N),
            ("motor.back_emf_constant", motor.output_torque_constant, N),
            ("friction.coulomb_torque_forward", motor.coulomb_torque, N),
            ("friction.coulomb_torque_backward", motor.coulomb_torque, N)):
        q = servo.source(name)
        assert (q.value, q.lower, q.upper) == pytest.approx(
            (expected.value / by, expected.lower / by, expected.upper / by)), name
    eta = motor.gear_efficiency.value
    for name in ("load_friction_motor", "load_friction_external"):
        mu = getattr(servo.friction, name)
        assert (1 - mu) / (1 + mu) == pytest.approx(eta)


def test_what_is_printed_is_datasheet_and_what_is_not_is_assumed():
    bare, full = servo_from_sheet(BARE), servo_from_sheet(FULL)
    for name, printed in (("motor.armature_resistance", "datasheet"), ("electronics.deadband", "datasheet"),
                          ("gear.gear_reduction", "datasheet"), ("supply.open_circuit_voltage", "datasheet"),
                          ("friction.coulomb_torque_forward", "datasheet")):
        assert full.source(name).origin == printed, name
        if name != "supply.open_circuit_voltage":
            assert bare.source(name).origin == "assumed", name
    assert full.electronics.deadband == 8e-6
    assert "the box" in full.source("electronics.deadband").source
    assert "no-load current assumed" in bare.source("motor.armature_resistance").source


def test_angle_and_pulse_are_the_sheets():
    servo = servo_from_sheet(FULL)
    e, pot = servo.electronics, servo.potentiometer
    per_pulse = e.pulse_to_voltage_gain / pot.feedback_gain
    assert math.degrees(per_pulse) * 1e-6 == pytest.approx(0.1125)
    assert pot.feedback_offset * e.one_shot_slope + e.one_shot_offset == pytest.approx(1.5e-3)
    from_travel = servo_from_sheet(Sheet(name="a", points=(ONE,), pulse_min=1e-3, pulse_max=2e-3,
                                         travel=math.radians(120.0)))
    per_pulse = from_travel.electronics.pulse_to_voltage_gain / from_travel.potentiometer.feedback_gain
    assert math.degrees(per_pulse) * 1e-6 == pytest.approx(0.12)
    assert math.degrees(from_travel.stops.upper_angle) == pytest.approx(75.0)
    assert math.degrees(from_travel.stops.lower_angle) == pytest.approx(-75.0)


def test_stops_that_are_printed_are_taken():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,), stop_travel=math.radians(200.0)))
    assert math.degrees(servo.stops.upper_angle) == pytest.approx(100.0)
    assert servo.source("stops.upper_angle").origin == "datasheet"


def test_pulses_that_the_sheet_has_are_accepted():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,), pulse_min=2e-4, pulse_max=3.2e-3,
                                   travel=math.radians(270.0)))
    assert servo.electronics.pulse_width_min < 2e-4
    assert servo.electronics.pulse_width_max > 3.2e-3


def test_play_acts_unless_it_is_left_out():
    sheet = Sheet(name="a", points=(ONE,), backlash=math.radians(0.5))
    servo = servo_from_sheet(sheet)
    assert math.degrees(servo.gear.backlash) == pytest.approx(0.5)
    assert servo.gear.output_inertia > 0.0
    assert servo_from_sheet(sheet, backlash=False).gear.backlash is None


# -- files

def test_a_servo_is_made_again_from_its_own_file(sheet, tmp_path):
    servo = servo_from_sheet(sheet)
    write_servo_text(servo, tmp_path / "a.toml")
    read = load_servo(tmp_path / "a.toml")
    again = servo_from_sheet(sheet_of(read))
    assert servo_file_text(again) == (tmp_path / "a.toml").read_text(encoding="utf-8")
    for name in servo.names():
        value, expected = read.get(name), servo.get(name)
        assert value == (expected if isinstance(expected, str) else pytest.approx(expected, rel=1e-5, abs=1e-15)), name


def test_the_sheet_in_the_file_has_all_of_its_facts():
    again = sheet_of(servo_from_sheet(FULL))
    for name in ("deadband", "pulse_min", "pulse_max", "neutral_pulse", "travel", "angle_per_pulse", "mass",
                 "gear_reduction"):
        assert getattr(again, name) == pytest.approx(getattr(FULL, name), rel=1e-9), name
    assert (again.name, again.title, again.note, again.motor_type, again.modulation, again.source) == (
        "full", "Full 1", "Bought used.", "3-pole", "analog", "the box")
    assert again.source_of("mass") == "kitchen scales"
    assert [point.supply_voltage for point in again.main] == [4.8, 6.0]
    assert again.nominal.stall_torque == pytest.approx(1.2945)
    assert again.nominal.no_load_speed == pytest.approx(ONE.no_load_speed, rel=1e-9)


def test_what_a_sheet_was_given_by_hand_is_no_figure_of_it():
    assert sheet_of(load_servo("futaba-s3003")).nominal.no_load_current is None
    assert sheet_of(load_servo("hitec-hs-755hb")).nominal.no_load_current == 0.285


def test_texts_with_quotes_come_through(tmp_path):
    note = 'Says "fast" \\ in """three""" quotes.'
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,), title='The "S"', source='A \\ "B"', note=note))
    write_servo_text(servo, tmp_path / "a.toml")
    read = load_servo(tmp_path / "a.toml")
    assert read.title == 'The "S"'
    assert sheet_of(read).note == note
    assert " ".join(read.notes.split()).startswith(note)
    assert sheet_of(read).source == 'A \\ "B"'


def test_a_file_without_a_usable_sheet_is_refused(tmp_path):
    head = 'name = "x"\n[sheet]\n'
    for text, said in ((head, "has no table"), (head + "torque = 3\n", "torque"),
                       (head + "stall_torque = 3\n", "stall_torque of 'x'"),
                       (head + 'deadband = { value = 8, unit = "V" }\n', "deadband of 'x'"),
                       (head + 'stall_torque = { value = 1, unit = "N m" }\n', "without supply_voltage"),
                       (head + 'stall_torque = { value = -1, unit = "N m" }\n'
                               'supply_voltage = { value = 6, unit = "V" }\n', "stall torque at 6 V"),
                       (head + "also_at = 3\n", "also_at")):
        (tmp_path / "x.toml").write_text(text)
        with pytest.raises(InputError, match=said) as caught:
            sheet_of(load_servo(tmp_path / "x.toml"))
        assert "\n" not in str(caught.value)


# -- sheets that cannot be true

def test_an_impossible_sheet_is_no_servo():
    with pytest.raises(InputError, match="impossible sheet of 'wonder'") as caught:
        servo_from_sheet(IMPOSSIBLE)
    for word in ("3.354 N m", "0.098 s/60°", "3.6 A", "8.4 V", "145 %", "at most 2.3 N m"):
        assert word in str(caught.value)
    assert len(str(caught.value)) < 600
    assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("ignore:.*contradicts itself")
def test_an_impossible_sheet_may_be_allowed_and_stays_flagged():
    servo = servo_from_sheet(IMPOSSIBLE, allow_impossible=True)
    assert servo.sheet["flags"][0] == "impossible: efficiency 1.45 at 8.4 V"
    assert "The sheet contradicts itself: 3.354 N m" in " ".join(servo.notes.split())
    assert "contradicts itself" in servo.source("motor.torque_constant").source
    assert servo.friction.load_friction_motor is None
    assert top_speed(servo) == pytest.approx(math.pi / 3 / 0.098, rel=0.01)
    assert not lifts(servo, IMPOSSIBLE.points[0].stall_torque)
    assert lifts(servo, 0.97 * IMPOSSIBLE.points[0].stall_torque / 1.445)


def point(V, T_s, seconds, I_0=None, I_s=None):
    return SheetPoint(supply_voltage=V, stall_torque=T_s, no_load_speed=math.pi / 3 / seconds, no_load_current=I_0,
                      stall_current=I_s)


@pytest.mark.parametrize(("points", "flag", "words"), [
    ((point(6.0, 2.5, 0.11, 0.1, 2.1),), "impossible: efficiency 2.08 at 6 V", ("208 %", "at most 1.2 N m")),
    ((point(6.0, 0.1961, 0.12, 0.09, 0.9),), "impossible: efficiency 0.42 at 6 V",
     ("39 to 42 %", "at least 0.24 N m", "at most 0.78 A")),
    ((point(4.8, 1.2, 0.2), point(6.0, 1.0, 0.16)), "impossible: stall torque does not grow with voltage",
     ("1.2 N m at 4.8 V", "1 N m at 6 V", "each other's place")),
    ((point(4.8, 1.0, 0.16), point(6.0, 1.2, 0.2)), "impossible: speed does not grow with voltage", ("375 °/s",)),
    ((point(4.8, 1.0, 0.2), point(6.0, 1.0, 0.16)), "impossible: stall torque does not grow with voltage", ()),
    ((point(4.8, 0.3432, 0.17, 0.16), point(6.0, 0.5001, 0.14)), "impossible: stall torque grows x1.46 with voltage",
     ("x1.25 to x1.42",)),
])
def test_contradictions_name_the_figures(points, flag, words):
    sheet = Sheet(name="a", points=points)
    found = sheet_contradictions(sheet)
    assert found[0].flag == flag
    assert sheet_flags(sheet)[0] == flag
    for word in words:
        assert word in found[0].text
    with pytest.raises(InputError):
        servo_from_sheet(sheet)


def test_the_figures_named_as_possible_are_possible():
    """With the torque, the time or the current that the words name, the sheet has no contradiction any more."""
    bad = {"T_s": 2.5, "seconds": 0.11, "I_0": 0.1, "I_s": 2.1}
    text = sheet_contradictions(Sheet(name="a", points=(point(6.0, **bad),)))[0].text
    assert "at most 1.2 N m" in text
    assert "at least 0.23 s" in text
    assert "at least 4.2 A" in text
    for change in ({"T_s": 1.2}, {"seconds": 0.23}, {"I_s": 4.2}):
        assert sheet_contradictions(Sheet(name="a", points=(point(6.0, **(bad | change)),))) == ()
    for change in ({"T_s": 1.21}, {"seconds": 0.228}, {"I_s": 4.1}):
        assert sheet_contradictions(Sheet(name="a", points=(point(6.0, **(bad | change)),))) != ()


@pytest.mark.parametrize(("seconds", "possible"), [(0.1, True), (0.12, True)])
def test_sheets_of_one_motor_are_no_contradiction(seconds, possible):
    R, K, eta, I_0 = 3.0, 5.0 * seconds / (math.pi / 3), 0.8, 0.2
    points = [SheetPoint(supply_voltage=V, stall_torque=eta * K * ((V - 0.2) / R - I_0),
                         no_load_speed=(V - 0.2 - R * I_0) / K, no_load_current=I_0, stall_current=(V - 0.2) / R)
              for V in (4.8, 6.0, 7.4)]
    assert (sheet_contradictions(Sheet(name="a", points=points)) == ()) is possible


def test_flags_say_what_is_missing_and_what_is_odd():
    assert sheet_flags(FULL) == ("stall current not given",)
    assert sheet_flags(BARE) == ("no current given", "deadband, pulse range, travel not given", "one voltage only")
    odd = Sheet(name="a", points=(point(4.8, 1.9, 0.17), point(6.0, 1.95, 0.14)), mass=0.062, modulation="digital")
    assert "torque grows only x1.03 from 4.8 to 6 V" in sheet_flags(odd)
    assert "torque x2.3 of what is usual for its mass" in sheet_flags(odd)
    assert "digital" in sheet_flags(odd)
    other = SheetPoint(supply_voltage=6.0, stall_torque=1.5, no_load_speed=ONE.no_load_speed, source="a forum")
    assert "sources disagree: torque x1.16" in sheet_flags(Sheet(name="a", points=(ONE, other)))
    alike = SheetPoint(supply_voltage=6.0, stall_torque=1.292, no_load_speed=ONE.no_load_speed, source="a forum")
    assert not any("disagree" in flag for flag in sheet_flags(Sheet(name="a", points=(ONE, alike))))


@pytest.mark.parametrize(("torque", "mass", "asked"), [
    (13.0, None, "13 N m, or 13 kgf cm = 1.27 N m"), (13.0, 0.045, "1.27 N m"), (1.8, 0.009, "0.177 N m"),
    (1.29, None, None), (1.29, 0.11, None), (3.35, None, None), (3.3539, 0.0645, None), (30.0, 0.9, None)])
def test_newton_metres_typed_for_kilogram_centimetres_are_asked_about(torque, mass, asked):
    """Without currents nothing contradicts a giant; its mass does, or that no catalog servo is so strong."""
    sheet = Sheet(name="mine", points=(SheetPoint(supply_voltage=6.0, stall_torque=torque, no_load_speed=4.5),),
                  mass=mass)
    if asked is None:
        servo_from_sheet(sheet)  # a warning would be an error here
        return
    with pytest.warns(UserWarning, match=re.escape(asked)):
        servo_from_sheet(sheet)


def test_what_the_catalog_has_is_not_asked_about():
    for name in catalog_names():
        servo = st.load_servo(name)
        if "supply_voltage" in servo.sheet:
            assert torque_question(sheet_of(servo)) is None, name
