"""The servos written by hand: every number follows from the sheet, from Table II, or is assumed and says its range.

Those made from their sheets by `servo_from_sheet` are in `test_catalog_sheets.py`.
"""

import csv
import itertools
import math
import re
import sys
import tomllib
import warnings

import numpy as np
import pytest

import rest_bands
import servotwin as st
from servotwin import units
from servotwin.errors import MissingParameterError, UnknownNameError
from servotwin.models import MODELS
from servotwin.parameters import GROUPS, catalog_names, load_dataset, load_servo
from servotwin.physics import averaged_bridge_gain
from servotwin.physics.sheet import motor_from_sheet

IDS = ("futaba-s3003", "hitec-hs-311", "hitec-hs-755hb", "towerpro-mg90s", "towerpro-mg996r", "towerpro-sg90")
BENCH = "hitec-hs-755hb"
OTHERS = tuple(name for name in IDS if name != BENCH)
DIMENSIONS = {"supply_voltage": "voltage", "voltage_min": "voltage", "voltage_max": "voltage", "stall_torque": "torque",
              "speed_per_60deg": "time", "no_load_current": "current", "stall_current": "current",
              "idle_current": "current", "deadband": "time", "pulse_min": "time", "pulse_max": "time",
              "travel": "angle", "travel_per_400us": "angle", "mass": "mass"}
ROUNDED = 1e-5  # the files hold six digits
# What stands behind the range where it is wider than the sheet alone says
NO_LOAD_CURRENTS = {"futaba-s3003": (0.1, 0.15, 0.2), "towerpro-mg996r": (0.5, 0.6)}
WIDENED = ("towerpro-sg90", "towerpro-mg90s")  # to a measured unit
# Of these only a product acts, or they are counted
WITHOUT_RANGE = {"electronics.comparator_gain", "electronics.off_state", "firmware.signal_loss"}


@pytest.fixture(params=IDS)
def servo(request):
    return load_servo(request.param)


@pytest.fixture(params=OTHERS)
def other(request):
    return load_servo(request.param)


def facts(servo):
    return {name: entry for name, entry in servo.sheet.items() if name not in ("flags", "also_at")}


def fact(servo, name):
    entry = servo.sheet[name]
    return units.to_si(entry["value"], entry["unit"], DIMENSIONS[name])


def sheet_motor(servo, **assumed):
    facts = {"supply_voltage": fact(servo, "supply_voltage"), "stall_torque": fact(servo, "stall_torque"),
             "no_load_speed": math.radians(60.0) / fact(servo, "speed_per_60deg"),
             "no_load_current": fact(servo, "no_load_current")}
    if "stall_current" in servo.sheet:
        facts["stall_current"] = fact(servo, "stall_current")
    return motor_from_sheet(**(facts | assumed))


def derived(motor, N):
    K_out, tau_c = motor.output_torque_constant, motor.coulomb_torque
    return {"motor.armature_resistance": motor.resistance, "motor.torque_constant": K_out / N,
            "motor.back_emf_constant": K_out / N, "friction.coulomb_torque_forward": tau_c / N,
            "friction.coulomb_torque_backward": tau_c / N}


def line(x, y):
    """Slope, offset, their standard errors and covariance, of a straight line."""
    (slope, offset), covariance = np.polyfit(x, y, 1, cov=True)
    return slope, offset, math.sqrt(covariance[0, 0]), math.sqrt(covariance[1, 1]), covariance[0, 1]


# -- what is there

def test_names():
    names = catalog_names()
    assert list(names) == sorted(names)
    assert set(IDS) < set(names)
    assert len(names) >= 30


def test_every_file_is_named_as_it_calls_itself(servo):
    assert servo.name in IDS
    assert load_servo(servo.name) == servo
    assert servo.title
    assert servo.notes


@pytest.mark.parametrize("kind", MODELS.values(), ids=list(MODELS))
def test_every_servo_runs_in_every_model_that_it_has_numbers_for(servo, kind):
    if kind is st.DigitalServo and servo.kind == "analog":
        with pytest.raises(MissingParameterError, match=r"firmware\.control_period, firmware\.proportional_gain"):
            kind(servo)
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = kind(servo)
    result = st.simulate(model, st.signals.step(1.2, 1.4, at=0.05, unit="V"), duration=0.2)
    result.raise_if_failed()
    turned = result[model.layout[0]] - result[model.layout[0]][0]
    if "command_voltage" in model.signals:  # a servo stands still until it is told otherwise
        assert np.abs(turned[result.time < 0.05]).max() < 1e-12
    assert turned[-1] > 0.01


def test_every_servo_has_what_the_pulse_level_needs(servo):
    for name in ("deadband", "stretcher_gain", "minimum_drive_time", "off_state", "frame_period", "one_shot_offset",
                 "one_shot_slope", "pulse_width_min", "pulse_width_max", "voltage_to_pulse_gain",
                 "command_pulse_offset"):
        assert servo.get(f"electronics.{name}") is not None, name


def test_every_servo_reaches_what_it_is_told_but_for_friction(servo):
    model = st.models.BoundedServo(servo)
    middle = 90.0 if servo.name == BENCH else 0.0
    result = st.simulate(model, st.signals.step(middle - 25.0, middle + 25.0, at=0.05, unit="deg"), duration=1.5)
    result.raise_if_failed()
    assert result["output_speed"][-1] == 0.0
    assert abs(result["output_angle"][-1] - math.radians(middle + 25.0)) <= rest_bands.averaged(servo)


def test_an_unknown_servo_is_refused_in_one_line():
    with pytest.raises(UnknownNameError) as caught:
        load_servo("hitec-hs-755")
    said = str(caught.value)
    assert "did you mean 'hitec-hs-755hb', " in said
    assert sum(f"'{name}'" in said for name in catalog_names()) == 5
    assert "`servotwin catalog list`" in said
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["", "\0", "x" * 300, "no\nsuch"])
def test_odd_names_are_refused_in_one_line(name):
    with pytest.raises(UnknownNameError) as caught:
        load_servo(name)
    assert "\n" not in str(caught.value)


def test_reading_the_catalog_needs_no_heavy_package():
    import subprocess

    code = ("import sys, servotwin as st; st.load_servo('hitec-hs-755hb');"
            "print([m for m in ('tomlkit', 'scipy', 'matplotlib', 'pandas', 'control') if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# -- where it comes from

def test_everything_says_where_it_comes_from(servo):
    for name in servo.names():
        quantity = servo.source(name)
        assert quantity.source, name
        if quantity.origin in ("assumed", "measured", "datasheet") and name not in WITHOUT_RANGE \
                and name != "supply.open_circuit_voltage":
            assert quantity.spread, name


def test_no_source_is_a_file_of_ours(servo):
    texts = [servo.source(name).source for name in servo.names()] + [e["source"] for e in facts(servo).values()]
    for text in [*texts, servo.notes]:
        assert not re.search(r"file id|\.csv|/work|/home|/tmp|servo_specs", text), text


def test_the_sheet_gives_value_unit_and_source(servo):
    for name, entry in facts(servo).items():
        assert set(entry) == {"value", "unit", "source"}
        assert fact(servo, name) > 0.0
        assert entry["source"]


def test_what_rests_on_an_assumption_is_assumed(other):
    # the converter's gain s_r is assumed, and with it all that it scales
    for name in ("potentiometer.feedback_gain", "potentiometer.feedback_offset", "electronics.voltage_deadband",
                 "electronics.command_offset", "electronics.bridge_gain"):
        assert other.source(name).origin == "assumed", name
    if "assumed" in other.sheet["no_load_current"]["source"]:
        assert {other.source(name).origin for name in derived(sheet_motor(other), 1.0)} == {"assumed"}


# -- the numbers

def test_motor_and_friction_follow_from_the_sheet(servo):
    motor = sheet_motor(servo)
    assert motor.feasible
    for name, value in derived(motor, servo.gear.gear_reduction).items():
        assert servo.get(name) == pytest.approx(value, rel=ROUNDED), name


def test_their_ranges_hold_all_that_was_assumed(servo):
    currents = NO_LOAD_CURRENTS.get(servo.name, (fact(servo, "no_load_current"),))
    motors = [sheet_motor(servo, drop_voltage=drop, gear_efficiency=eta, no_load_current=current)
              for drop, eta, current in itertools.product((0.0, 0.2, 0.4), (0.7, 0.8, 0.9), currents)]
    assert all(motor.feasible for motor in motors)
    found = [derived(motor, servo.gear.gear_reduction) for motor in motors]
    for name in found[0]:
        low, high = min(one[name] for one in found), max(one[name] for one in found)
        quantity = servo.source(name)
        assert quantity.lower <= low * (1 + ROUNDED), name
        assert quantity.upper >= high * (1 - ROUNDED), name
        if servo.name not in WIDENED:
            assert (quantity.lower, quantity.upper) == pytest.approx((low, high), rel=ROUNDED), name


def test_the_running_current_of_the_mg996r_is_possible_only_at_its_low_end():
    servo = load_servo("towerpro-mg996r")
    assert sheet_motor(servo, no_load_current=0.6).feasible
    assert not sheet_motor(servo, no_load_current=0.7).feasible
    assert not sheet_motor(servo, no_load_current=0.9).feasible


def test_the_bench_servo_is_in_the_ranges_of_its_class():
    servo = load_servo(BENCH)
    N = servo.gear.gear_reduction
    assert servo.motor.armature_resistance == pytest.approx(3.04, abs=0.005)
    assert N * servo.motor.torque_constant == pytest.approx(1.04, abs=0.005)
    assert N**2 * servo.motor.rotor_inertia == pytest.approx(6e-3, rel=1e-4)


def test_rotor_inertia_is_in_its_prior(servo):
    J = servo.gear.gear_reduction**2 * servo.motor.rotor_inertia
    low, high = (2e-4, 2e-3) if fact(servo, "mass") < 0.02 else (1e-3, 2e-2)
    assert low <= J <= high


def test_supply_and_deadband_are_the_sheets(servo):
    assert servo.supply.open_circuit_voltage == fact(servo, "supply_voltage")
    if "deadband" in servo.sheet:
        assert servo.electronics.deadband == fact(servo, "deadband")
    s_r = servo.electronics.pulse_to_voltage_gain
    assert servo.electronics.voltage_deadband == pytest.approx(s_r * servo.electronics.deadband, rel=ROUNDED)


def test_the_loop_gain_is_the_mean_of_the_pulses(servo):
    e, supply = servo.electronics, servo.supply
    gain = averaged_bridge_gain(supply.open_circuit_voltage, supply.bridge_drop_voltage, e.stretcher_gain,
                                e.frame_period, e.one_shot_slope)
    assert e.bridge_gain * e.comparator_gain == pytest.approx(gain, rel=ROUNDED)
    assert 60.0 <= e.stretcher_gain <= 200.0
    bounds = servo.source("electronics.bridge_gain")
    assert bounds.lower <= gain * 60.0 / e.stretcher_gain * (1 + ROUNDED)
    assert bounds.upper >= gain * 200.0 / e.stretcher_gain * (1 - ROUNDED)


def test_pulse_and_voltage_commands_agree(servo):
    e = servo.electronics
    assert e.one_shot_slope == pytest.approx(1.0 / e.pulse_to_voltage_gain, rel=ROUNDED)
    k_p1, k_p2 = e.voltage_to_pulse_gain, e.pulse_to_voltage_gain
    for v_i in (0.6, 1.4, 2.2):
        by_pulse = (k_p1 * v_i + e.command_pulse_offset - e.one_shot_offset) / e.one_shot_slope
        assert k_p1 * k_p2 * v_i + e.command_offset == pytest.approx(by_pulse, abs=2e-3)


def test_angle_over_pulse_is_the_sheets(other):
    pot, e = other.potentiometer, other.electronics
    found = e.pulse_to_voltage_gain / pot.feedback_gain  # rad/s of pulse width
    if "travel_per_400us" in other.sheet:
        expected = fact(other, "travel_per_400us") / 400e-6
    elif "travel" in other.sheet:
        expected = fact(other, "travel") / (fact(other, "pulse_max") - fact(other, "pulse_min"))
    else:
        expected = math.radians(0.1) / 1e-6  # a servo of the SG90's class
    assert found == pytest.approx(expected, rel=ROUNDED)
    neutral = (0.0 * pot.feedback_gain + pot.feedback_offset) * e.one_shot_slope + e.one_shot_offset
    assert neutral == pytest.approx(1520e-6 if other.name == "futaba-s3003" else 1500e-6, rel=ROUNDED)
    assert f"{neutral * 1e6:.0f} us" in " ".join(other.notes.split())


def test_stops_lie_within_what_pulses_can_ask_for_or_say_why(servo):
    stops, pot, e = servo.stops, servo.potentiometer, servo.electronics
    assert stops.lower_angle <= 0.0 < stops.upper_angle
    if "travel" in servo.sheet and servo.name != BENCH:
        assert stops.upper_angle - stops.lower_angle >= fact(servo, "travel")
    width = [(pot.feedback_gain * q + pot.feedback_offset) * e.one_shot_slope + e.one_shot_offset
             for q in (stops.lower_angle, stops.upper_angle)]
    assert 0.0 < width[0] < width[1] < 3e-3


def test_the_bench_servo_holds_table_ii_by_least_squares():
    servo = load_servo(BENCH)
    table = load_dataset("urrea-kern-table-2").columns
    q, v_i, t_a, v_o = np.radians(table["q_deg"]), table["V_i_V"], table["t_a_us"] * 1e-6, table["V_o_V"]
    p, b_o, s_p, s_b, _ = line(q, v_o)
    k_p1, t_0, s_k, s_t, _ = line(v_i, t_a)
    _, b_i, _, s_i, _ = line(v_i, v_o)
    s_r, b_t, s_s, s_bt, covariance = line(t_a, v_o)
    # T_0 = −b_t/s_r with both uncertain, and they are correlated
    s_T = math.sqrt(s_bt**2 + (b_t / s_r * s_s) ** 2 - 2.0 * b_t / s_r * covariance) / s_r
    for name, value, std in (
            ("potentiometer.feedback_gain", p, s_p), ("potentiometer.feedback_offset", b_o, s_b),
            ("electronics.voltage_to_pulse_gain", k_p1, s_k), ("electronics.command_pulse_offset", t_0, s_t),
            ("electronics.command_offset", b_i, s_i), ("electronics.pulse_to_voltage_gain", s_r, s_s),
            ("electronics.one_shot_slope", 1.0 / s_r, s_s / s_r**2), ("electronics.one_shot_offset", -b_t / s_r, s_T)):
        quantity = servo.source(name)
        assert quantity.value == pytest.approx(value, rel=ROUNDED), name
        assert quantity.std == pytest.approx(std, rel=0.02), name
        assert quantity.origin == "measured"
        assert "Table II" in quantity.source


def test_the_others_take_the_bench_as_their_transmitter(other):
    bench = load_servo(BENCH)
    for name in ("electronics.voltage_to_pulse_gain", "electronics.command_pulse_offset"):
        assert other.get(name) == bench.get(name)
        assert other.source(name).std == bench.source(name).std


# -- the sheet facts, against the compiled lists where these are at hand

ROWS = {"hitec-hs-755hb": ("HS-755HB", 6.0), "hitec-hs-311": ("HS-311", 6.0), "futaba-s3003": ("S3003", 6.0),
        "towerpro-mg996r": ("MG996R", 6.0), "towerpro-sg90": ("SG90", 4.8),
        "towerpro-mg90s": ("P-0090-MM 'MG90S'", 6.0)}
COLUMNS = {"stall_torque": ("stall_torque_Nm", "N m"), "speed_per_60deg": ("speed_s_per_60deg", "s"),
           "no_load_current": ("noload_running_current_A", "A"), "stall_current": ("stall_current_A", "A"),
           "idle_current": ("idle_current_A", "A"), "deadband": ("deadband_us", "us"), "travel": ("travel_deg", "deg"),
           "mass": ("mass_g", "g")}


def test_the_sheets_facts_are_those_of_the_lists(servo, data_folder):
    with (data_folder / "servo_specs" / "servo_specs_by_voltage.csv").open(newline="", encoding="utf-8") as file:
        model, volts = ROWS[servo.name]
        row = next(r for r in csv.DictReader(file) if r["model"] == model and float(r["V"] or 0) == volts)
    compared = 0
    for name, (column, unit) in COLUMNS.items():
        if name in servo.sheet and row[column]:
            assert servo.sheet[name]["unit"] == unit
            assert servo.sheet[name]["value"] == pytest.approx(float(row[column])), name
            compared += 1
    assert compared >= 4
    if "pulse_min" in servo.sheet:
        shortest, longest = (servo.sheet[name]["value"] for name in ("pulse_min", "pulse_max"))
        assert row["pulse_range_us"] == f"{shortest:.0f}-{longest:.0f}"


def test_files_are_easy_to_edit_by_hand(servo):
    """One line per value, in the order of the groups, with the keys in one order."""
    from importlib import resources

    text = (resources.files("servotwin.parameters") / "catalog" / f"{servo.name}.toml").read_text(encoding="utf-8")
    tables = [name for name in tomllib.loads(text) if name in GROUPS]
    assert tables == [name for name in GROUPS if name in tables]
    for row in re.findall(r"^\w+ = \{.*\}$", text, re.MULTILINE):
        keys = re.findall(r"(?:\{ |, )(value|unit|origin|source|std|lower|upper) = ", row)
        assert keys == sorted(keys, key=["value", "unit", "origin", "source", "std", "lower", "upper"].index)


def test_no_rig_is_in_a_servo():
    """What belonged to the bench of a fit stands beside it: the logs of others know nothing of its delay and zero."""
    for name in catalog_names():
        assert not {"nuisance", "frame_phase", "control_phase"} & set(load_servo(name).fit), name
