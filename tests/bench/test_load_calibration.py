"""Tables of weights with currents, speeds and sags: what they say, what they set, and what is refused."""

import math

import numpy as np
import pytest

import kitchen_draws
import servotwin as st
from reference import kitchen_tables
from servotwin.bench import calibrate_loads, calibrate_table, load_table
from servotwin.bench.load_columns import name_of
from servotwin.datasheet.full_drive import FullDrive
from servotwin.datasheet.holding import changed, hold
from servotwin.errors import InputError

MASSES, CURRENTS = [100, 200, 320, 400, 450], [230, 300, 370, 405, 450]


def truth(seed=1):
    return kitchen_tables.table("speed", seed).servo


def exact(of, voltage=False, share=0.7, rows=6, **measured):
    """Return columns without noise."""
    if voltage:
        volts = np.linspace(1.2 * of.starts_at, 2.0 * of.V, rows)
        return {"supply_voltage_V": volts, "speed [rad/s]": [of.speed(0.0, v) for v in volts]}
    torques = np.linspace(0.0, share * of.stall_torque, rows)
    columns = {"torque_Nm": torques}
    if measured.get("current"):
        columns["current_A"] = [of.current(tau) for tau in torques]
    if measured.get("speed"):
        columns["speed [rad/s]"] = [of.speed(tau) for tau in torques]
    return columns


# --- the table of the case

def test_a_table_of_weights_and_currents():
    found = calibrate_loads({"mass_g": MASSES, "current_mA": CURRENTS}, st.load_servo("towerpro-mg90s"), arm=0.01)
    b, a = np.polyfit(np.array(MASSES) * 1e-3 * 9.80665 * 0.01, np.array(CURRENTS) * 1e-3, 1)
    assert found.figure("no-load current").value == pytest.approx(a, rel=1e-9)
    assert found.figure("torque per current").value == pytest.approx(1.0 / b, rel=1e-9)
    assert found.figure("torque per current").value == pytest.approx(0.1625, rel=1e-3)
    assert found.figure("heaviest load").value == pytest.approx(0.0441, rel=1e-3)
    assert any("25 % of what its sheet says" in text and "1.8 kgf cm" in text for text in found.findings())
    assert any("does it?" in text and "current_limit=450mA" in text for text in found.findings())
    assert any("not each" in text for text in found.findings())
    assert "motor.armature_resistance" not in found.parameters


# --- what is set of the servo makes the table again

@pytest.mark.parametrize(("measured", "wrong"), [
    ({"current": True}, {"tau_c": 1.5, "mu": 0.5}), ({"speed": True}, {"K": 1.3, "R": 0.8}),
    ({"current": True, "speed": True}, {"K": 1.3, "R": 0.8, "tau_c": 1.5, "mu": 0.5})])
def test_the_servo_that_is_made_makes_the_table_again(measured, wrong):
    for seed in range(3):
        of = truth(seed)
        columns = exact(of, **measured)
        found = calibrate_loads(columns, kitchen_draws.servo_of(of, **wrong))
        drive = FullDrive(st.PulseServo(_with_chip(found.servo)))
        for k, torque in enumerate(columns["torque_Nm"]):
            speed = drive.speed(torque)
            if "speed [rad/s]" in columns:
                assert speed == pytest.approx(columns["speed [rad/s]"][k], rel=1e-6)
            if "current_A" in columns:
                assert drive.current(speed) == pytest.approx(columns["current_A"][k], rel=1e-6)
        for name, one in found.parameters.items():
            assert one.origin == "measured"
            assert one.std is not None
            assert found.servo.source(name) == one


def test_voltages_and_speeds_set_torque_constant_and_friction():
    of = truth(2)
    found = calibrate_loads(exact(of, voltage=True), kitchen_draws.servo_of(of, K=0.7, tau_c=1.5))
    assert found.servo.motor.torque_constant * kitchen_draws.N == pytest.approx(of.K, rel=1e-9)
    assert found.servo.motor.back_emf_constant == found.servo.motor.torque_constant
    assert found.servo.friction.coulomb_torque_forward * kitchen_draws.N == pytest.approx(of.tau_c, rel=1e-6)
    assert any("told as a sum" in text for text in found.findings())


def test_viscous_friction_of_the_file_is_kept():
    of = truth(3)
    b = 0.1 * of.tau_c / of.speed(0.0)
    servo = kitchen_draws.servo_of(of).replace({"motor.motor_viscous_friction": b / kitchen_draws.N**2})
    drive = FullDrive(st.PulseServo(_with_chip(servo)))
    torques = np.linspace(0.0, 0.6 * drive.stall_torque, 5)
    speeds = np.array([drive.speed(tau) for tau in torques])
    currents = np.array([drive.current(w) for w in speeds])
    for columns, wrong in (({"speed [rad/s]": speeds}, {"K": 1.2, "R": 1.2}),
                           ({"current_A": currents}, {"tau_c": 1.2, "mu": 0.7}),
                           ({"speed [rad/s]": speeds, "current_A": currents}, {"K": 1.2, "R": 0.8, "tau_c": 1.2})):
        file = kitchen_draws.servo_of(of, **wrong).replace({"motor.motor_viscous_friction": b / kitchen_draws.N**2})
        found = calibrate_loads({"torque_Nm": torques, **columns}, file)
        for name in found.parameters:
            assert found.servo.get(name) == pytest.approx(servo.get(name) or 0.0, rel=1e-6, abs=1e-12), name


def _with_chip(servo):
    known = st.load_servo("hitec-hs-755hb")
    given = {name: known.get(name) for name in known.names()
             if name.split(".")[0] in ("electronics", "potentiometer")}
    return servo.replace(given)


def test_more_torque_than_the_motor_can_give_raises_its_constant():
    of = truth()
    found = calibrate_loads(exact(of, current=True), kitchen_draws.servo_of(of, K=0.5))
    assert found.servo.motor.torque_constant == found.servo.motor.back_emf_constant
    assert any("therefore grows" in text for text in found.findings())


def test_a_supply_that_falls_has_a_resistance():
    of = truth()
    columns = exact(of, current=True)
    columns["supply_voltage_V"] = np.round(5.0 - 0.3 * np.array(columns["current_A"]), 3)
    found = calibrate_loads(columns, kitchen_draws.servo_of(of))
    assert found.parameters["supply.internal_resistance"].value == pytest.approx(0.3, rel=0.01)
    assert found.parameters["supply.open_circuit_voltage"].value == pytest.approx(5.0, rel=0.001)


# --- flat top, standing rows, sag

def test_a_flat_top_is_in_no_line_and_asks_for_the_supply():
    of = truth()
    columns = exact(of, current=True, rows=8)
    current = np.array(columns["current_A"]) + 0.001 * np.array([1, -1, 0, 1, -1, 0, 1, -1])
    current[5:] = current[4] * 1.005
    found = calibrate_loads({**columns, "current_A": current}, kitchen_draws.servo_of(of))
    assert found.lines.flat.rows in ((5, 6, 7), (6, 7))
    assert found.figure("torque per current").value == pytest.approx(of.K * of.efficiency, rel=0.02)
    assert any("does the supply give no more?" in text for text in found.findings())


def test_no_flat_top_is_seen_in_straight_tables():
    flat = 0
    for seed in range(100):
        drawn = kitchen_tables.table("current", seed)
        header, *rows = drawn.text.splitlines()
        columns = {name: [float(row.split(",")[k]) for row in rows] for k, name in enumerate(header.split(","))}
        flat += calibrate_loads(columns, arm=drawn.arm).lines.flat is not None
    assert flat <= 1


def test_rows_that_stand_still_are_left_out():
    of = truth()
    columns = exact(of, current=True, speed=True, share=0.8)
    table = {name: [*values, extra] for (name, values), extra in zip(columns.items(), (
        1.2 * of.stall_torque, of.current(of.stall_torque), 0.0), strict=True)}
    found = calibrate_loads(table)
    assert found.lines.stalled == pytest.approx(1.2 * of.stall_torque)
    assert found.figure("stall torque").value == pytest.approx(of.stall_torque, rel=1e-6)


@pytest.mark.long
def test_a_sag_sets_the_gain_of_the_loop():
    servo = st.load_servo("hitec-hs-755hb")
    model = changed(st.PulseServo(servo), {"electronics.stretcher_gain": 180.0})
    torques = np.linspace(0.3, 0.9, 4)
    sags = [math.degrees(hold(model, tau).error) for tau in torques]
    found = calibrate_loads({"torque_Nm": torques, "sag_deg": sags}, servo)
    gain = found.parameters["electronics.stretcher_gain"]
    assert gain.value == pytest.approx(180.0, rel=0.02)
    shallow = calibrate_loads({"torque_Nm": torques, "sag_deg": [0.0, 40.0, 80.0, 120.0]}, servo)
    assert not shallow.parameters
    assert any("stretcher_gain stays" in text for text in shallow.findings())


def test_an_angle_under_weights_counts_from_the_lightest():
    table = load_table({"mass_g": [0, 100, 200], "angle_deg": [90.0, 89.0, 87.5]}, arm=0.1)
    assert np.degrees(table.sag.values).tolist() == pytest.approx([0.0, 1.0, 2.5])
    assert [one.name for one in calibrate_loads(table).figures] == ["sag per torque", "heaviest load"]


# --- both ways

def test_hysteresis_is_told_apart_from_noise():
    x = np.linspace(1000.0, 2000.0, 9)
    noise = np.random.default_rng(1).normal(0.0, 0.2, 17)
    pulses = np.concatenate([x, x[-2::-1]])
    ways = np.array([-0.5] * 9 + [0.5] * 8)
    for play in (4.2, 0.0):
        found = calibrate_table({"t_a_us": pulses, "q_deg": 0.1 * pulses - 100.0 + play * ways + noise})
        line = found.lines["q(t_a)"].line
        assert abs(line.hysteresis - play) < line.wide(line.hysteresis_error)
        assert line.slope == pytest.approx(0.1, rel=0.01)
        said = next(text for text in found.findings() if "both ways" in text)
        assert ("no hysteresis" in said) == (play == 0.0)


def test_columns_of_both_ways_are_one_table():
    x = np.linspace(1000.0, 2000.0, 5)
    up = 0.1 * x - 60.0
    found = calibrate_table({"Pulse [us]": x, "angle up (deg)": up, "angle down (deg)": up + 2.0 + 0.01 * np.cos(x)})
    assert found.table.rows == 10
    assert found.lines["q(t_a)"].line.hysteresis == pytest.approx(2.0, abs=0.02)


UP, DOWN = -0.5, 0.5
X = np.arange(600.0, 2401.0, 200.0)
TURNS = {  # pulses and ways of a table whose value at the turn stands twice, and the row that turns, from 1
    "held at the top": ([*X, *X[::-1]], [UP] * 11 + [DOWN] * 9, None),
    "gone beyond and back": ([*X, *X[::-1]], [UP] * 10 + [DOWN] * 10, 11),
    "held for three readings": ([*X, X[-1], *X[::-1]], [UP] * 12 + [DOWN] * 9, None),
    "read twice at the start": ([X[0], *X, *X[::-1][1:]], [UP] * 11 + [DOWN] * 9, None),
    "from the top": ([*X[::-1], *X], [DOWN] * 10 + [UP] * 10, 11),
    "come from above to the start": ([*X, *X[::-1][1:]], [DOWN] + [UP] * 9 + [DOWN] * 9, 1),
    "two rounds": ([*X, *X[::-1], *X], [UP] * 11 + [DOWN] * 9 + [UP] * 10, 21)}


@pytest.mark.parametrize("case", TURNS)
def test_a_value_that_stands_twice_where_the_ways_turn_is_of_the_way_it_was_read_on(case):
    pulses, ways, turned = TURNS[case]
    x, noise = np.array(pulses), np.random.default_rng(77).normal(0.0, 0.2, len(pulses))
    found = calibrate_table({"t_a_us": x, "q_deg": 0.1 * x - 100.0 + 4.0 * np.array(ways) + noise})
    line = found.lines["q(t_a)"].line
    assert found.lines["q(t_a)"].ways.tolist() == ways
    assert abs(line.hysteresis - 4.0) < 4.0 * line.hysteresis_error < 0.6  # 2 σ/√n = 0.09 each
    assert not any(row.certain for row in found.rows)
    said = [text for text in found.findings() if "where the ways turn" in text]
    assert [text.split(" (")[0] for text in said] == ([] if turned is None else [f"row {turned}"])


def test_one_reading_at_the_top_in_the_columns_of_both_ways_is_of_the_way_up():
    noise = np.random.default_rng(78).normal(0.0, 0.2, (2, X.size))
    up, down = 0.1 * X - 102.0 + noise[0], 0.1 * X - 98.0 + noise[1]
    down[-1] = up[-1]
    found = calibrate_table({"pulse [us]": X, "angle_up_deg": up, "angle_down_deg": down})
    line = found.lines["q(t_a)"].line
    assert abs(line.hysteresis - 4.0) < 4.0 * line.hysteresis_error < 0.6  # 2 σ/√n = 0.09 each
    assert 10 not in [row.row for row in found.rows if row.certain]
    assert any("row 11" in text and "on the way up" in text for text in found.findings())


def test_without_hysteresis_a_value_that_stands_twice_says_nothing():
    x = np.concatenate([X, X[::-1]])
    found = calibrate_table({"t_a_us": x, "q_deg": 0.1 * x + np.random.default_rng(79).normal(0.0, 0.2, x.size)})
    assert found.table.at_turns.tolist() == [k in (0, 9, 10) for k in range(20)]
    assert not any("where the ways turn" in text for text in found.findings())


def test_rows_in_no_order_are_of_one_way():
    x = np.array([1000.0, 1400.0, 1100.0, 1900.0, 1200.0, 1700.0, 1300.0])
    assert calibrate_table({"t_a_us": x, "q_deg": 0.1 * x + np.cos(x)}).table.ways is None


# --- intervals

@pytest.mark.parametrize("kind", kitchen_tables.KINDS)
def test_intervals_of_a_few_draws_hold(kind):
    held = [hold for seed in range(12) for hold in kitchen_draws.holds(kind, seed).values()]
    assert np.mean(held) > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("kind", kitchen_tables.KINDS)
def test_intervals_hold_in_90_to_98_percent_of_200_draws(kind):
    for name, share in kitchen_draws.shares(kind, 200).items():
        assert 0.9 <= share <= 0.98, name


# --- names and what is refused

@pytest.mark.parametrize(("column", "role", "factor"), [
    ("mass_g", "load", 9.80665e-3), ("Gewicht (kg)", "load", 9.80665), ("load [N]", "load", 1.0),
    ("torque_kgf_cm", "load", 0.0980665), ("load [oz]", "load", 0.0283495 * 9.80665), ("current_mA", "current", 1e-3),
    ("Strom / A", "current", 1.0), ("speed_deg_s", "speed", math.pi / 180.0), ("time_60deg_s", "time", 1.0),
    ("s/60°", "time", 1.0), ("sag_deg", "sag", math.pi / 180.0), ("supply_voltage_V", "voltage", 1.0),
    ("drum radius [mm]", "arm", 1e-3), ("weight (grams)", "load", 9.80665e-3), ("mass_lbs", "load", 4.448222),
    ("ounces", "load", 0.0283495 * 9.80665)])
def test_names_of_columns(column, role, factor):
    found = name_of(column)
    assert found.role == role
    assert found.factor == pytest.approx(factor, rel=1e-5)


@pytest.mark.parametrize(("columns", "arm", "said"), [
    ({"mass_g": MASSES, "current_mA": CURRENTS}, None, "--arm 1cm"),
    ({"mass_g": MASSES[:2], "current_mA": CURRENTS[:2]}, 0.01, "rows"),
    ({"weight": MASSES, "current_mA": CURRENTS}, 0.01, "no unit"),
    ({"mass_g": MASSES, "current_A": CURRENTS}, 0.01, "is the unit right"),
    ({"mass_g": [-m for m in MASSES], "current_mA": CURRENTS}, 0.01, "is the unit right"),
    ({"mass_g": MASSES, "current_mA": CURRENTS[::-1]}, 0.01, "a line that falls"),
    ({"mass_g": MASSES, "speed_deg_s": CURRENTS}, 0.01, "a line that rises"),
    ({"mass_g": MASSES, "note_x": CURRENTS}, 0.01, "beside the load"),
    ({"mass_g": MASSES, "current": CURRENTS}, 0.01, "current has no unit that says so"),
    ({"mass_g": MASSES, "current_mA": [200.0] * 5}, 0.01, "a line that is flat"),
    ({"mass_g": CURRENTS, "current_mA": MASSES}, 0.01, "is each column what its name says"),
    ({"mass_g": [100.0] * 5, "current_mA": CURRENTS}, 0.01, "loads that differ"),
    ({"mass_g": [*MASSES[:4], math.nan], "current_mA": CURRENTS}, 0.01, "row 5"),
    ({"torque_Nm": [0.1, 0.2, 0.3, 0.4, 0.5], "current_mA": CURRENTS}, 0.01, "is a torque"),
    ({"mass_g": MASSES, "arm_cm": [1.0] * 5, "current_mA": CURRENTS}, 0.01, "one of them"),
    ({"mass_g": MASSES, "current_mA": CURRENTS}, 5.0, "0.1 mm to 2 m")])
def test_what_cannot_be_is_refused(columns, arm, said):
    with pytest.raises(InputError) as error:
        calibrate_loads(columns, arm=arm)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_friction_that_scatter_makes_negative_is_as_unsure_as_any():
    found = calibrate_loads({"mass_g": [0, 100, 200, 300, 400], "current_mA": [12, 40, 130, 160, 260]},
                            st.load_servo("towerpro-mg996r"), arm=0.02)
    assert found.figure("no-load current").lower < 0.0 < found.figure("no-load current").upper
    friction = found.parameters["friction.coulomb_torque_forward"]
    assert friction.value == 0.0
    assert friction.std > 5e-5


@pytest.mark.parametrize(("rows", "said"), [
    ("500;800\n1.000;1.100\n1.500;1.400\n2.000;1.700", "line 3, mass_g: got '1.000'"),
    ("500;800,5\n600;1.100,5\n700;1.400,5", "line 3, current_mA: got '1.100,5'"),
    ("567\t812\n812\t967\n967\t1,045", "line 4, current_mA: got '1,045'")])
def test_thousands_are_no_decimals(tmp_path, rows, said):
    (tmp_path / "table.csv").write_text(f"mass_g{';' if ';' in rows else chr(9)}current_mA\n{rows}\n")
    with pytest.raises(InputError, match="separates thousands") as error:
        calibrate_loads(tmp_path / "table.csv", arm=0.02)
    assert said in str(error.value)


@pytest.mark.parametrize("rows", [
    "0.500;0.800\n1.000;1.100\n1.500;1.400\n2.000;1.700", "0,5;1,125\n1;1,25\n1,5;1,375\n2;1,625",
    "1;1.125\n2;1.375\n3;1.625\n4;1.875", "1;1\n2.500;2.250\n3;3\n4;4"])
def test_decimals_are_no_thousands(tmp_path, rows):
    (tmp_path / "table.csv").write_text(f"mass_kg;current_A\n{rows}\n")
    assert calibrate_loads(tmp_path / "table.csv", arm=0.02).figure("heaviest load").value < 1.0
