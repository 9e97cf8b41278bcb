"""Servos of the catalog made from their sheets: each is made again from its own file, and does as it says."""

import csv
import math
import re
import warnings
from importlib import resources

import pytest

import servotwin as st
from servotwin.identification import motor_range, servo_file_text, servo_from_sheet, sheet_contradictions, sheet_of
from servotwin.models import MODELS
from servotwin.parameters import catalog_names, load_servo

ANALOG = {name: kind for name, kind in MODELS.items() if name != "digital"}  # what needs no program

BY_HAND = ("futaba-s3003", "hitec-hs-311", "hitec-hs-755hb", "towerpro-mg90s", "towerpro-mg996r", "towerpro-sg90")
# bus servos, which no model of a chip runs, and those that were fitted to logs are in test_catalog_bus.py
FITTED = ("miuzei-25kg",)
MADE = tuple(name for name in catalog_names() if name not in (*BY_HAND, *FITTED) and load_servo(name).kind != "bus")
IMPOSSIBLE = ("dfrobot-df05bb", "dsservo-ds3218", "dsservo-rds3115", "feetech-ft-7235", "geekservo-2kg",
              "towerpro-mg995")


@pytest.fixture(params=MADE)
def servo(request):
    return load_servo(request.param)


def test_there_are_enough():
    assert len(MADE) + len(BY_HAND) >= 30


def test_each_file_is_what_its_own_sheet_makes(servo):
    text = (resources.files("servotwin.parameters") / "catalog" / f"{servo.name}.toml").read_text(encoding="utf-8")
    assert servo_file_text(servo_from_sheet(sheet_of(servo), allow_impossible=True)) == text


def test_impossible_sheets_are_known_and_flagged(servo):
    found = sheet_contradictions(sheet_of(servo))
    assert bool(found) is (servo.name in IMPOSSIBLE)
    flagged = [flag for flag in servo.sheet["flags"] if flag.startswith("impossible")]
    assert flagged == [one.flag for one in found]
    assert ("contradicts itself" in " ".join(servo.notes.split())) is bool(found)


def test_every_servo_has_flags_in_words():
    for name in catalog_names():
        flags = load_servo(name).sheet["flags"]
        assert isinstance(flags, list), name
        assert all(isinstance(flag, str) and flag for flag in flags), name


def test_no_source_is_a_file_of_ours(servo):
    texts = [servo.source(name).source for name in servo.names()] + [servo.notes, repr(servo.sheet)]
    for text in texts:
        assert not re.search(r"file id|\.csv|/work|/home|/tmp|servo_specs", text), text


@pytest.mark.filterwarnings("ignore:.* contradicts itself")
@pytest.mark.parametrize("kind", ANALOG.values(), ids=list(ANALOG))
@pytest.mark.parametrize("name", MADE[::5])
def test_the_models_run_them(name, kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = kind(load_servo(name))
    result = st.simulate(model, st.signals.step(1.2, 1.4, at=0.05, unit="V"), duration=0.2)
    result.raise_if_failed()
    assert result[model.layout[0]][-1] - result[model.layout[0]][0] > 0.01


@pytest.mark.filterwarnings("ignore:.* contradicts itself")
def test_simulated_speed_and_stall_torque_are_the_sheets(servo):
    """The pulse servo against the formulas within 1.5 and 3 %, and these against the print within what it disagrees.

    Figures of one voltage are met; those of several, with speeds rounded to 0.01 s, fit one motor to 10 % at worst.
    """
    sheet = sheet_of(servo)
    motor, point = motor_range(sheet), sheet.nominal
    U = point.supply_voltage - motor.drop_voltage
    speed = (U - motor.resistance.value * motor.no_load_current.value) / motor.output_torque_constant.value
    eta = motor.gear_efficiency.value
    torque = min(eta, 1.0) * motor.output_torque_constant.value * (  # above 1 only what the motor makes is left
        U / motor.resistance.value - motor.no_load_current.value)
    low, high = 0.8 * servo.stops.lower_angle, 0.8 * servo.stops.upper_angle
    step = st.signals.step(low, high, at=0.02, unit="rad")
    run = st.simulate(st.PulseServo(servo), step, duration=min(1.5, 0.05 + 1.2 * (high - low) / speed),
                      output_step=2e-3)
    run.raise_if_failed()
    assert abs(run["output_speed"]).max() == pytest.approx(speed, rel=0.015)
    for share, up in ((0.97, True), (1.03, False)):
        held = st.simulate(st.PulseServo(servo), st.signals.constant(high, unit="rad"), duration=0.4,
                           load=st.loads.Constant(share * torque), initial={"output_angle": 0.0})
        held.raise_if_failed()
        play = (servo.gear.backlash or 0.0) + math.radians(0.5)
        assert bool(held["output_angle"][-1] > play) is up, share
    if motor.possible:
        rel = 0.005 if len(sheet.main) == 1 else 0.1
        assert (speed, torque) == pytest.approx((point.no_load_speed, point.stall_torque), rel=rel)


def test_what_is_printed_lies_within_what_the_ranges_allow(servo):
    """At the corners of the ranges speed and stall torque lie on both sides of what is printed."""
    sheet = sheet_of(servo)
    motor = motor_range(sheet)
    if not motor.possible:
        return
    for point in sheet.main:
        speeds, torques = [], []
        for drop in (0.0, 0.4):
            for R in (motor.resistance.lower, motor.resistance.upper):
                for K in (motor.output_torque_constant.lower, motor.output_torque_constant.upper):
                    for I_0 in (motor.no_load_current.lower, motor.no_load_current.upper):
                        U = point.supply_voltage - drop
                        speeds.append((U - R * I_0) / K)
                        torques += [eta * K * (U / R - I_0) for eta in (
                            motor.gear_efficiency.lower, motor.gear_efficiency.upper)]
        assert min(speeds) * 0.999 <= point.no_load_speed <= max(speeds) * 1.001
        assert min(torques) * 0.999 <= point.stall_torque <= max(torques) * 1.001


# -- the facts, against the compiled lists where these are at hand

COLUMNS = {"stall_torque": "stall_torque_Nm_{}", "speed_per_60deg": "speed_s_per_60deg_{}",
           "no_load_current": "run_mA_{}", "stall_current": "stall_mA_{}"}


def test_facts_of_the_list_by_model_are_in_the_files(data_folder):
    with (data_folder / "servo_specs" / "servo_specs_by_model.csv").open(newline="", encoding="utf-8") as file:
        rows = {f"{row['make']} {row['model']}".lower().replace(" ", "-"): row for row in csv.DictReader(file)}
    compared = 0
    for name in sorted(set(rows) & set(MADE) - {"hitec-hs-645mg"}):  # that one is of the list by voltage
        sheet, row = load_servo(name).sheet, rows[name]
        assert sheet["mass"]["value"] == pytest.approx(float(row["mass_g"]))
        for entry in (sheet, *sheet.get("also_at", ())):
            volts = {6.0: "6v0", 4.8: "4v8"}[entry["supply_voltage"]["value"]]
            if entry["stall_torque"]["source"] != sheet["stall_torque"]["source"]:
                continue
            for key, column in COLUMNS.items():
                text = row[column.format(volts)]
                if text:
                    by = 1e-3 if "_mA_" in column else 1.0
                    assert entry[key]["value"] == pytest.approx(by * float(text)), (name, key)
                    compared += 1
    assert compared > 70


def test_facts_of_the_list_by_voltage_are_in_the_files(data_folder):
    with (data_folder / "servo_specs" / "servo_specs_by_voltage.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["stall_torque_Nm"] and row["speed_s_per_60deg"]]
    printed = {(float(row["V"]), float(row["stall_torque_Nm"]), float(row["speed_s_per_60deg"])) for row in rows}
    found = 0
    for name in MADE:
        sheet = load_servo(name).sheet
        for entry in (sheet, *sheet.get("also_at", ())):
            if "speed_per_60deg" not in entry:
                continue
            found += tuple(entry[key]["value"] for key in ("supply_voltage", "stall_torque", "speed_per_60deg")) \
                in printed
    assert found >= 25
