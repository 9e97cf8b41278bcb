"""What a sheet prints beside what the servo made of it does: each figure, by simulation."""

import math

import pytest

import servotwin as st
from servotwin.datasheet.sheet import beside_flags, motion_of, printed_beside
from servotwin.identification import Sheet, SheetPoint, servo_from_sheet

ONE = SheetPoint(supply_voltage=6.0, stall_torque=0.2354, no_load_speed=math.pi / 3 / 0.11, no_load_current=0.1,
                 stall_current=0.9, idle_current=0.006)
TWO = SheetPoint(supply_voltage=4.8, stall_torque=0.18, no_load_speed=math.pi / 3 / 0.14)
WHOLE = {"deadband": 8e-6, "pulse_min": 1e-3, "pulse_max": 2e-3, "travel": math.radians(120.0)}


def test_every_printed_figure_has_its_simulated_one():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE, TWO), **WHOLE))
    found = printed_beside(servo)
    assert [(each.name, each.voltage) for each in found] == [
        ("stall torque", 6.0), ("time for 60 deg", 6.0), ("current without load", 6.0), ("stall current", 6.0),
        ("current at rest", 6.0), ("stall torque", 4.8), ("time for 60 deg", 4.8), ("deadband", 6.0), ("travel", 6.0)]
    of = {(each.name, each.voltage): each for each in found}
    assert of["deadband", 6.0].simulated == pytest.approx(8.0, rel=1e-3)
    assert of["travel", 6.0].simulated == pytest.approx(120.0, rel=1e-3)
    assert of["time for 60 deg", 6.0].off == pytest.approx(0.0, abs=0.05)
    assert beside_flags(servo, found) == (
        "current at rest at 6 V: 0 A simulated, 0.006 printed (the model has no current of its own electronics)",)
    assert {each.name for each in printed_beside(servo, steady=True)} == {
        "stall torque", "time for 60 deg", "current without load", "stall current"}


@pytest.mark.parametrize(("change", "flagged"), [
    ({"motor.armature_resistance": 1.3}, "stall torque"),
    ({"friction.coulomb_torque_forward": 2.5}, "current without load"),
    ({"motor.torque_constant": 1.3, "motor.back_emf_constant": 1.3}, "time for 60 deg"),
    ({"electronics.deadband": 2.0}, "deadband"), ({"potentiometer.feedback_gain": 0.8}, "travel"),
    ({"motor.rotor_inertia": 10.0}, "rotor: time constant 250")])
def test_a_figure_that_is_off_by_more_than_15_percent_is_flagged_by_name_and_number(change, flagged):
    sheet = Sheet(name="a", points=(ONE,), **WHOLE)
    servo = servo_from_sheet(sheet)
    other = servo.replace({name: by * servo.get(name) for name, by in change.items()})
    flags = beside_flags(other, printed_beside(other))
    assert any(flag.startswith(flagged) for flag in flags), flags


@pytest.mark.long
def test_a_slow_step_is_flagged():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,)))
    motion = motion_of(servo)
    assert not motion.late
    assert motion.passes < 1.4 * 0.11
    assert motion.spans["passes"].lower < motion.passes < motion.spans["passes"].upper
    assert motion.spans["error"].lower < motion.error < motion.spans["error"].upper
    heavy = servo.replace({"motor.rotor_inertia": 3.0 * servo.motor.rotor_inertia})
    assert motion_of(heavy).late
    assert any(flag.startswith("60 deg from rest: passes 54 deg after") for flag in beside_flags(
        heavy, (), motion_of(heavy)))


def test_a_servo_that_turns_without_end_has_no_step():
    servo = servo_from_sheet(Sheet(name="a", points=(ONE,), continuous=True, deadband=90e-6))
    assert motion_of(servo) is None
    width = next(each for each in printed_beside(servo) if each.name == "deadband")
    assert width.simulated == pytest.approx(90.0, abs=0.5)


def test_a_servo_without_a_sheet_has_nothing_beside():
    assert printed_beside(st.load_servo("miuzei-25kg")) == ()
