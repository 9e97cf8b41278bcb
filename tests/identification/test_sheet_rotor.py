"""The rotor that a sheet does not tell: smooth, and such that the servo is as fast as its sheet says."""

import math

import numpy as np
import pytest

import servotwin as st
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.turning import slow_rotor, time_constant_of
from servotwin.identification import Sheet, SheetPoint, servo_from_sheet, sheet_contradictions
from servotwin.identification.sheets.motor_range import usual_torque
from servotwin.identification.sheets.servo_of_sheet import time_constant
from servotwin.models import default_model, mid_travel
from servotwin.parameters import catalog_names, load_servo, printed_points
from servotwin.physics import stall_current_for

pytestmark = pytest.mark.filterwarnings("ignore:.* contradicts itself")
PAPER = "hitec-hs-755hb"  # keeps the 6.0e-3 kg m2 with which its reproduction was made
FRAMES = 4 * 20e-3  # s: below, an analog servo overshoots by its frames, whatever its rotor
# A digital servo decides each millisecond: four of its periods are less than any printed time
STARTS = math.radians(54.0)


def time_60(servo):
    own = servo.supply.open_circuit_voltage
    return next((point.time_60 for point in printed_points(servo) if point.time_60
                 and abs(point.supply_voltage - own) < 1e-6), None)


ASSUMED = [name for name in catalog_names() if load_servo(name).source("motor.rotor_inertia").origin == "assumed"]
PULSED = [name for name in catalog_names() if load_servo(name).kind != "bus" and time_60(load_servo(name))]


def random_sheets(seed, count):
    """Return sheets as makers could print them: of one motor each, with and without currents, mass and kind."""
    random, found = np.random.default_rng(seed), []
    while len(found) < count:
        mass, speed = math.exp(random.uniform(math.log(5e-3), math.log(0.12))), math.pi / 3.0 / math.exp(
            random.uniform(math.log(0.045), math.log(0.28)))
        voltage = float(random.choice([4.8, 5.0, 6.0, 7.4, 8.4]))
        torque, ratio = usual_torque(mass) * math.exp(random.normal(0.0, 0.36)), random.uniform(0.05, 0.2)
        stall = float(stall_current_for(voltage, torque, speed, 0.0, random.uniform(0.6, 0.95), 0.3)) / (1 - ratio)**2
        given = random.choice(["none", "running", "both", "stall"])
        point = SheetPoint(supply_voltage=voltage, stall_torque=torque, no_load_speed=speed,
                           stall_current=stall if given in ("both", "stall") else None,
                           no_load_current=ratio * stall if given in ("both", "running") else None)
        sheet = Sheet(name=f"random-{len(found)}", points=(point,), mass=mass if random.random() < 0.7 else None,
                      modulation=str(random.choice(["analog", "digital"])),
                      motor_type=str(random.choice(["", "3-pole", "coreless", "brushless"])),
                      deadband=float(random.choice([1e-6, 2e-6, 4e-6, 8e-6])) if random.random() < 0.6 else None,
                      backlash=math.radians(0.5) if random.random() < 0.2 else None)
        if not sheet_contradictions(sheet):
            found.append(sheet)
    return found


def check_step(servo):
    """Check a step of -30 to 30 degrees from rest: within 1.4 printed times at 54 degrees, overshoot 15 %."""
    model = default_model(servo)
    start, printed = mid_travel(model) - math.radians(30.0), time_60(servo)
    run = st.simulate(model, st.signals.step(start, start + math.radians(60.0), unit="rad"), duration=0.6,
                      output_step=5e-4)
    turned = run["output_angle"] - start
    assert run.time[np.argmax(turned > STARTS)] <= 1.4 * printed, servo.name
    assert turned[-1] > STARTS, servo.name
    overshoot = turned.max() / math.radians(60.0) - 1.0
    assert overshoot <= (0.15 if printed > FRAMES or servo.kind == "digital" else 0.35), (servo.name, overshoot)


@pytest.mark.parametrize("name", PULSED[::6])
def test_a_servo_of_the_catalog_is_as_fast_as_its_sheet_says(name):
    check_step(load_servo(name))


@pytest.mark.parametrize("sheet", random_sheets(1, 30)[::6], ids=lambda sheet: sheet.name)
def test_a_servo_of_a_random_sheet_is_as_fast_as_it_says(sheet):
    check_step(servo_from_sheet(sheet))


@pytest.mark.slow
def test_all_of_them_are_as_fast_as_their_sheets_say():
    assert len(PULSED) > 40
    for name in PULSED:
        check_step(load_servo(name))
    for sheet in random_sheets(1, 30):
        check_step(servo_from_sheet(sheet))


@pytest.mark.parametrize("name", [name for name in ASSUMED if load_servo(name).kind == "bus"])
def test_a_bus_servo_at_full_drive_is_as_fast_as_its_sheet_says(name):
    """Its own step is slower by its registers, which say how fast it may speed up."""
    servo = load_servo(name)
    drive = FullDrive(default_model(servo))
    printed = max(time_60(servo), math.pi / 3.0 / drive.no_load_speed)  # its program may not give all of the duty
    assert drive.swing(None, 0.0, STARTS).time <= 1.4 * printed


# -- the rule

@pytest.mark.parametrize("name", ASSUMED)
def test_every_assumed_rotor_of_the_catalog_follows_the_rule(name):
    servo, rotor = load_servo(name), load_servo(name).source("motor.rotor_inertia")
    tau, expected = time_constant_of(servo), time_constant(servo.sheet.get("motor_type", ""), time_60(servo))
    if name == PAPER:
        assert rotor.value * servo.gear.gear_reduction**2 == pytest.approx(6.0e-3, rel=1e-5)
        assert tau == pytest.approx(0.017, abs=2e-4)
        return
    assert tau == pytest.approx(expected.value, rel=2e-5)
    assert (rotor.lower / rotor.value, rotor.upper / rotor.value) == pytest.approx(
        (expected.lower / expected.value, expected.upper / expected.value), rel=1e-4)
    assert "no source" in rotor.source


@pytest.mark.parametrize(("kind", "seconds", "value", "lower", "upper"), [
    ("", 0.2, 25.0, 12.0, 55.0), ("3-pole", 0.08, 25.0, 12.0, 48.0), ("brushed", 0.05, 17.5, 8.4, 30.0),
    ("iron core", 0.2, 25.0, 12.0, 55.0), ("coreless", 0.2, 12.0, 5.0, 20.0), ("Core-less", 0.03, 10.5, 4.375, 18.0),
    ("brushless", 0.1, 12.0, 5.0, 20.0), ("BLDC", 0.1, 12.0, 5.0, 20.0)])
def test_the_time_constant_is_of_the_kind_of_motor_and_bounded_by_the_printed_time(kind, seconds, value, lower, upper):
    found = time_constant(kind, seconds)
    assert [1e3 * x for x in (found.value, found.lower, found.upper)] == pytest.approx([value, lower, upper])


def test_it_does_not_depend_on_mass_and_changes_smoothly_with_all_else():
    def inertia(seconds, torque, mass):
        point = SheetPoint(supply_voltage=6.0, stall_torque=torque, no_load_speed=math.pi / 3 / seconds)
        servo = servo_from_sheet(Sheet(name="a", points=(point,), mass=mass))
        return servo.motor.rotor_inertia * servo.gear.gear_reduction**2

    masses = (0.012, 0.024, 0.025, 0.026, 0.06)
    assert len({inertia(0.05, 0.24, mass) for mass in (*masses, None)}) == 1
    for seconds in np.geomspace(0.03, 0.3, 24).tolist():
        assert inertia(1.01 * seconds, 0.24, None) == pytest.approx(inertia(seconds, 0.24, None), rel=0.025)
    rotors = [inertia(0.12, usual_torque(mass), mass) for mass in masses]  # J grows as the torque does
    assert [rotor / usual_torque(mass) for rotor, mass in zip(rotors, masses, strict=True)] == pytest.approx(
        [rotors[0] / usual_torque(masses[0])] * 5)


def test_a_rotor_that_cannot_be_true_is_flagged():
    servo = load_servo(PAPER)
    assert slow_rotor(servo) is None
    said = slow_rotor(servo.replace({"motor.rotor_inertia": 20.0 * servo.motor.rotor_inertia}))
    assert said == "rotor: time constant 337.7 ms, longer than the 230 ms that are printed for 60 deg"
    assert [name for name in catalog_names() if slow_rotor(load_servo(name))] == []
    assert slow_rotor(st.servo_from_values("a", {"motor": {"rotor_inertia": 1.0}})) is None
