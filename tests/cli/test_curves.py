"""`servotwin curves`, `servotwin catalog which`, an arm as a load, and the words in which `simulate` sums up."""

import csv
import math

import numpy as np
import pytest

import servotwin as st

SERVO = "hitec-hs-755hb"


@pytest.fixture(scope="module")
def sheet():
    return st.curves(st.PulseServo(st.load_servo(SERVO)), [4.8, 6.0], (0.5, 0.1), bandwidth=False)


@pytest.mark.long
def test_the_numbers_are_those_of_the_function(cli, sheet):
    found = cli("curves", SERVO, "--voltage", "4.8,6 V", "--lift", "500g", "--arm", "10 cm", "--load", "torque=0.3",
                "--quick", "--json").data["servos"][0]
    assert [part["supply_voltage"] for part in found["voltages"]] == [4.8, 6.0]
    for part, said in zip(sheet.voltages, found["voltages"], strict=True):
        assert said["cold"]["stall_torque"] == part.cold.stall_torque
        assert said["hot"]["torque"] == part.hot.torque.tolist()
        assert said["cold"]["at_load"]["speed"] == part.cold.at(0.3).speed
        assert said["smallest_move"] == part.smallest_move
        assert said["lift"]["margin"] == part.lift.margin
        assert said["lift"]["warming"]["winding_temperature"] == part.lift.warming.now.winding
    assert found["voltages"][1]["printed"][0]["stall_torque"] == 1.2945


@pytest.mark.long
def test_the_table_says_how_far_the_sheet_is_off(cli):
    ended = cli("curves", SERVO, "--quick")
    assert ended.code == 0
    assert ended.err == ""
    lines = {line[:27].strip(): line for line in ended.out.splitlines()}
    assert lines["stall torque, N m"].split()[-3:] == ["1.294", "+28", "%"]
    assert lines["smallest move"].split()[2] == "1.22"
    assert "(12.1 us)" in lines["smallest move"]
    assert "at rest, free  drives 50 times a second, duty" in ended.out
    assert "its sheet: stall current not given" in ended.out


@pytest.mark.long
def test_an_arm_as_a_load_is_a_lift(cli):
    words = ["curves", SERVO, "--quick", "--voltage", "5"]
    assert cli(*words, "--load", "arm=0.5kg:10cm").out == cli(*words, "--lift", "0.5kg", "--arm", "100mm").out


@pytest.mark.long
def test_page_picture_and_points(cli, sheet, tmp_path):
    ended = cli("curves", SERVO, "towerpro-sg90", "--voltage", "4.8", "--quick",
                "--out", "page.html", "--plot", "picture.png", "--csv", "points.csv")
    assert ended.code == 0, ended.err
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count('<section class="servo"') == 2
    assert "http" not in page.replace("http://www.w3.org", "").split("<footer>")[0].split("</style>")[1][:2000]
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "points.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file)
                if (row["servo"], row["winding_temperature_K"]) == (SERVO, "298.15")]
    torque = np.array([float(row["load_torque_Nm"]) for row in rows])
    np.testing.assert_allclose(torque, sheet.at(4.8).cold.torque, rtol=1e-10)
    assert "exists already" in cli("curves", SERVO, "--quick", "--out", "page.html").error


@pytest.mark.long
def test_pictures_of_many_voltages_have_pages(cli, tmp_path):
    words = ["curves", SERVO, "--quick", "--model", "bounded", "--voltage", "4.8,5,5.2,5.4,5.6,6,6", "--plot", "a.png"]
    (tmp_path / "a-2.png").write_text("mine")
    assert "a-2.png exists already" in cli(*words).error
    assert [path.name for path in tmp_path.iterdir()] == ["a-2.png"]
    found = cli(*words, "--out", "page.html", "--force", "--json").data
    assert found["files"] == ["page.html", "a.png", "a-2.png"]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in found["files"][1:])
    assert (tmp_path / "page.html").read_text(encoding="utf-8").count("<img") == 4  # two pages of two pictures


@pytest.mark.parametrize("words", [
    ["curves", SERVO, "towerpro-sg90", "hitec-hs-311", "hitec-hs-422", "towerpro-mg996r", "gobilda-2000-135", "--plot"],
    ["curves", "feetech-sts3215-12v", "--voltage", "9,10,11,12", "--loop"],
    ["linear", SERVO, "--amplitude", "1deg,2deg,3deg,4deg,5deg", "--amplitude", "6deg", "--plot"],
])
def test_pages_are_known_before_anything_is_computed(cli, tmp_path, words):
    (tmp_path / "a-2.png").write_text("mine")
    assert "a-2.png exists already" in cli(*words, "a.png").error
    assert [path.name for path in tmp_path.iterdir()] == ["a-2.png"]


def test_a_servo_that_turns_endlessly_has_no_loop(cli, tmp_path):
    words = ["curves", "feetech-sts3215-12v", "--set", "potentiometer.fixed_angle=0", "--loop", "a.png"]
    assert "--loop: got 'feetech-sts3215-12v', allowed: one" in cli(*words).error


@pytest.mark.long
def test_a_digital_servo_says_once_that_it_is_computed_as_analog_where_that_is_asked_for(cli):
    words = ["curves", "towerpro-mg996r", "--voltage", "5", "--quick"]
    ended = cli(*words, "--model", "pulse")
    assert ended.err == ""
    assert ended.out.count("analog") == 1
    digital = cli(*words).out
    assert "model digital" in digital
    assert "analog" not in digital
    assert "guessed of its program: control_period" in digital


@pytest.mark.long(but="words16---lift: got '1e400kg'")
@pytest.mark.parametrize(("words", "said"), [
    (["none"], "unknown servo 'none'"),
    ([SERVO, SERVO], "'hitec-hs-755hb' twice"),
    ([SERVO, "--voltage", "0"], "--voltage: got '0', allowed: a positive number"),
    ([SERVO, "--voltage", "-5"], "--voltage: got '-5', allowed: a positive number"),
    ([SERVO, "--voltage", "nan"], "--voltage: got 'nan', allowed: a positive number"),
    ([SERVO, "--voltage", "12.5"], "got 12.5, allowed: a positive number [V] up to 12, twice the highest of the sheet"),
    ([SERVO, "--voltage", "5,"], "--voltage"),
    ([SERVO, "--voltage", "5A"], "--voltage: got '5A'"),
    ([SERVO, "--lift", "0.5kg"], "--lift needs --arm LENGTH"),
    ([SERVO, "--arm", "10cm"], "--arm needs --lift MASS"),
    ([SERVO, "--lift", "-1kg", "--arm", "10cm"], "--lift: got '-1kg', allowed: a positive number"),
    ([SERVO, "--lift", "1kg", "--arm", "0cm"], "--arm: got '0cm', allowed: a positive number"),
    ([SERVO, "--lift", "1", "--arm", "10cm"], "--lift: got '1', allowed: a positive number with one of the units kg"),
    ([SERVO, "--lift", "1stone", "--arm", "10cm"], "kg, g, oz, lb"),
    ([SERVO, "--lift", "1kg", "--arm", "10furlong"], "m, cm, mm, in"),
    ([SERVO, "--lift", "nankg", "--arm", "10cm"], "--lift: got 'nankg'"),
    ([SERVO, "--lift", "1e400kg", "--arm", "10cm"], "--lift: got '1e400kg'"),
    ([SERVO, "--load", "inertia=1"], "--load inertia of servotwin curves: allowed: arm="),
    ([SERVO, "--load", "arm=1kg:1m", "--lift", "1kg", "--arm", "1m"], "not beside --lift"),
    ([SERVO, "--load", "torque=nan"], "torque: got 'nan'"),
    ([SERVO, "--hot", "20"], "temperature of the hot winding: got 293.15"),
    ([SERVO, "--model", "dc-motor"], "unknown model 'dc-motor'"),
    ([SERVO, "--out", "page.txt"], "--out: got 'page.txt', allowed: a name that ends in .html, .htm"),
    ([SERVO, "--plot", "none/picture.png"], "--plot none/picture.png"),
    ([SERVO, "--csv", "a.csv", "--out", "a.csv"], "a.csv"),
])
def test_bad_input_is_one_line(cli, tmp_path, words, said):
    assert said in cli("curves", *words, "--quick").error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_which_lists_the_lightest_first_and_says_why_others_cannot(cli):
    words = ["catalog", "which", "--lift", "0.5kg", "--arm", "10cm", "--voltage", "5", "--time", "0.3"]
    lines = cli(*words, "--why").out.splitlines()
    listed = [line.split()[0] for line in lines[3:lines.index("", 3)]]
    found = st.servos_that_lift(0.5, 0.1, voltage=5.0, time=0.3)
    assert listed == [each.servo.name for each in found.found]
    (cannot,) = (line for line in lines if " cannot: " in line)
    assert int(cannot.split()[0]) == len(found.refused)
    assert all(words in cannot for words in ("lack the torque", "are too slow", "are not for this voltage"))
    assert "its sheet begins at 6 V" in next(line for line in lines if "xl-320" in line)
    assert "no servo of the catalog can" in cli("catalog", "which", "--lift", "50kg", "--arm", "1m").out


@pytest.mark.long
def test_which_has_the_same_in_json(cli):
    found = cli("catalog", "which", "--lift", "2kg", "--arm", "8cm", "--json").data
    assert [each["id"] for each in found["found"]] == [
        each.servo.name for each in st.servos_that_lift(2.0, 0.08, voltage=6.0).found]
    assert {each["kind"] for each in found["refused"]} == {"torque", "voltage"}  # some begin at 7.4 or 11.1 V


@pytest.mark.parametrize(("words", "said"), [
    (["--arm", "10cm"], "--lift"),
    (["--lift", "1kg", "--arm", "0m"], "--arm: got '0m'"),
    (["--lift", "1kg", "--arm", "1m", "--time", "-1"], "--time: got '-1'"),
    (["--lift", "1kg", "--arm", "1m", "--voltage", "abc"], "--voltage: got 'abc'"),
])
def test_which_refuses_bad_input(cli, words, said):
    assert said in cli("catalog", "which", *words).error


@pytest.mark.long
def test_an_arm_is_horizontal_in_the_middle_of_the_travel(simulate):
    words = ["--step", "80:100", "--duration", "1", "--json"]
    found = simulate(*words, "--load", "arm=7oz:4in").data
    mass, arm = 7 * 0.028349523125, 4 * 0.0254  # the travel is -15 to 195 degrees
    load = st.loads.Pendulum(mass=mass, length=arm, hanging_angle=0.0)
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), st.signals.step(80.0, 100.0, at=0.1, unit="deg"),
                         duration=1.0, load=load)
    assert found["final_angle"] == pytest.approx(float(result["output_angle"][-1]), rel=1e-12)
    free = st.load_servo(SERVO).replace({"stops.upper_angle": None})
    middle = st.models.mid_travel(st.PulseServo(free))
    there = st.simulate(st.PulseServo(free), st.signals.constant(1500.0, unit="us"), duration=0.1)
    assert middle == pytest.approx(there["command_angle"][0], rel=1e-12)


@pytest.mark.parametrize(("words", "load"), [
    ("torque=0.5kgf.cm", st.loads.Constant(0.5 * 0.0980665)),
    ("torque=-20 mN m", st.loads.Constant(-0.02)),
    ("inertia=3 kg cm2", st.loads.Inertia(3e-4)),
    ("coulomb=1 oz.in", st.loads.Coulomb(0.028349523125 * 9.80665 * 0.0254)),
])
def test_loads_have_units(words, load):
    from servotwin.cli.option_values import load_from

    found = load_from([words])
    for name in ("torque", "inertia", "coulomb_torque"):
        assert getattr(found, name) == pytest.approx(getattr(load.as_load(), name), rel=1e-9)


@pytest.mark.parametrize(("load", "said"), [
    ("arm=1kg", "--load arm: got '1kg', allowed: MASS:LENGTH"),
    ("arm=1:1", "kg, g, oz, lb"),
    ("arm=-1kg:1m", "--load arm: got '-1kg'"),
    ("torque=1kg", "--load torque: got '1kg'"),
    ("inertia=-1kgm2", "--load inertia: Inertia(inertia): got -1.0"),
])
def test_bad_loads_with_units(simulate, load, said):
    assert said in simulate("--step", "0:90", "--load", load).error


def test_an_arm_needs_a_servo(cli):
    said = cli("simulate", SERVO, "--step", "0:3", "--unit", "V", "--model", "dc-motor", "--load", "arm=1kg:1m").error
    assert "a model of a servo, not of a motor" in said


@pytest.mark.long
def test_simulate_sums_up_in_words(simulate):
    words = ["--step", "0:60", "--duration", "2", "--model", "pulse"]
    found = simulate(*words, "--json").data
    result = st.simulate(st.PulseServo(st.load_servo(SERVO)), st.signals.step(0.0, 60.0, at=0.1, unit="deg"),
                         duration=2.0, output_step=1e-4)
    far = np.flatnonzero(np.abs(np.degrees(result["output_angle"]) - 60.0) > 1.0)[-1]
    assert found["time_to_target"] == pytest.approx(result.time[far] - 0.1, abs=1e-4)
    last = result.time >= 1.9
    assert found["holding_error"] == pytest.approx(
        math.radians(60.0) - np.mean(result["output_angle"][last]), abs=1e-5)
    assert found["mean_current"] == pytest.approx(np.mean(result["supply_current"]), rel=0.03)
    text = simulate(*words).out
    assert f"time to get there  {1e3 * found['time_to_target']:.1f} ms (within 1 deg)" in text
    assert "does not get within 1 deg" in simulate(*words, "--load", "torque=0.6").out


@pytest.mark.long
def test_what_moves_has_no_holding_error(simulate):
    ended = simulate("--sine", "90:10:1", "--json").data
    assert ended["holding_error"] is None
    assert ended["time_to_target"] is None
    assert "holding error" not in simulate("--sine", "90:10:1").out
