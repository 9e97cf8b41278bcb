"""Calibration from anyone's bench table: the paper's numbers, errors that cover, instruments and rows that are off."""

import json
import math

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import servotwin as st
from servotwin.bench import calibrate_table
from servotwin.bench.table_parameters import plus_minus, residual_pattern
from servotwin.cli.fit_report import calibrate_from
from servotwin.errors import InputError, OutputExistsError

SOURCE = "Table II"


@pytest.fixture(scope="module")
def found(table, servo):
    return calibrate_table(table, servo, source=SOURCE)


def renamed(table):
    names = {"q_deg": "output_angle_deg", "t_a_us": "pulse_width_us", "V_i_V": "command_voltage_V",
             "V_o_V": "feedback_voltage_V", "ADC_i": "command_count", "ADC_o": "feedback_count",
             "f_Hz": "pulse_rate_Hz"}
    return {names[name]: values for name, values in table.items()}


# --- the paper's table

@pytest.mark.parametrize(("name", "value", "std", "unit"), [
    ("potentiometer.feedback_gain", (0.4197, 5e-5), (math.degrees(0.039e-3), 3e-5), "V/rad"),
    ("potentiometer.feedback_offset", (0.5878, 5e-5), (0.0043, 5e-5), "V"),
    ("electronics.pulse_to_voltage_gain", (735.6, 0.05), (5.3, 0.05), "V/s"),
    ("electronics.command_offset", (0.1038, 5e-5), (0.0040, 5e-5), "V"),
    ("electronics.voltage_to_pulse_gain", (1092.9e-6, 5e-8), (5.4e-6, 5e-8), "s/V"),
    ("electronics.command_pulse_offset", (-21.5e-6, 5e-8), (8.3e-6, 5e-8), "s"),
    ("electronics.one_shot_slope", (1 / 735.6, 1e-7), (5.3 / 735.6**2, 1e-7), "s/V"),
    ("electronics.one_shot_offset", (-0.163e-3, 5e-7), (1.29e-5, 5e-8), "s"),
])
def test_parameters_of_the_papers_table(found, name, value, std, unit):
    quantity = found.parameters[name]
    assert quantity.value == pytest.approx(value[0], abs=1.001 * value[1])
    assert quantity.std == pytest.approx(std[0], abs=1.001 * std[1])
    assert (quantity.unit, quantity.origin) == (unit, "measured")
    assert quantity.source.startswith(SOURCE)


def test_the_servo_takes_the_values_with_origin_and_error(found, servo, tmp_path):
    for name, quantity in found.parameters.items():
        assert found.servo.source(name) == quantity
    untouched = set(servo.names()) - set(found.parameters)
    assert untouched
    assert all(found.servo.source(name) == servo.source(name) for name in untouched)
    found.servo.save(tmp_path / "servo.toml")
    again = st.load_servo(tmp_path / "servo.toml")
    assert all(again.source(name) == quantity for name, quantity in found.parameters.items())


def test_the_catalogs_calibration_is_this_one(found, servo):
    for name, quantity in found.parameters.items():
        assert quantity.value == pytest.approx(servo.get(name), rel=1e-5), name
        assert quantity.std == pytest.approx(servo.source(name).std, rel=1e-5), name


def test_lines_are_those_of_table_fits(found, fits):
    assert set(found.lines) == set(fits)
    for name, fit in fits.items():
        assert found.lines[name].line == fit.line
        assert found.lines[name].slope_unit.replace("counts", "count") == fit.slope_unit.replace("counts", "count")


def test_own_names_and_units_say_the_same(found, table):
    other = renamed(table)
    other["pulse_width_ms"] = 1e-3 * other.pop("pulse_width_us")
    other["output_angle"] = np.radians(other.pop("output_angle_deg"))
    other["feedback_voltage_mV"] = 1e3 * other.pop("feedback_voltage_V")
    again = calibrate_table(other)
    assert again.parameters.keys() == found.parameters.keys()
    for name, quantity in found.parameters.items():
        assert again.parameters[name].value == pytest.approx(quantity.value, rel=1e-9)
        assert again.parameters[name].std == pytest.approx(quantity.std, rel=1e-6)


def test_only_the_angle_over_pulse_width_is_curved(found):
    assert found.curved == ("q(t_a)",)
    words = found.findings()[0]
    assert "p = 0.024" in words
    assert "1.8 °" in words
    assert "the ends lie below the line and the middle above it" in words


def test_the_two_instruments_at_the_potentiometer_disagree(found):
    command, feedback = found.instruments
    assert not command.disagrees_in
    assert command.expected_from == "1024 counts over 2.5 V"
    assert feedback.disagrees_in == ("zero", "gain")
    assert feedback.expected_from == "ADC_i"
    for words in ("432.65(84)", "44.1(1.1)", "5.7 % above that of ADC_i, 409.12", "zero is off by 39 standard errors",
                  "0.518, 0.855, 1.215, 1.555, 1.911"):
        assert words in feedback.words
    assert any("feedback_gain would be 0.4438 V/rad instead of 0.4197" in words for words in found.remarks)


def test_the_row_of_90_degrees_is_a_hint_and_no_proof(found):
    hint, = found.rows
    assert (hint.row, hint.line, hint.column, hint.better, hint.steps) == (2, "V_o(t_a)", "t_a", 1542.0, 1)
    assert not hint.certain
    assert (1e3 * hint.largest, 1e3 * hint.largest_after) == pytest.approx((10.7, 2.9), abs=0.05)
    assert "from 10.7 to 2.9 mV" in hint.words
    assert any(words.startswith("no row is certain") for words in found.remarks)


# --- standard errors

def test_error_of_the_one_shot_covers_its_covariance():
    rng = np.random.default_rng(11)
    t_a = np.linspace(700.0, 2300.0, 7)
    found = [calibrate_table({"t_a_us": t_a, "V_o_V": 0.12 + 7.356e-4 * t_a + rng.normal(0.0, 3e-3, 7)}).parameters
             for _ in range(400)]
    for name, truth in (("electronics.one_shot_slope", 1.0 / 735.6), ("electronics.one_shot_offset", -0.12 / 735.6)):
        values = np.array([one[name].value for one in found])
        mean_square = np.mean([one[name].std ** 2 for one in found])
        assert values.mean() == pytest.approx(truth, abs=5.0 * values.std() / math.sqrt(400.0))
        # 400 draws give a variance to 7 %; without the covariance it would be 2.4 times as large for the offset
        assert values.var() == pytest.approx(mean_square, rel=0.25)


def test_angles_and_a_known_potentiometer_stand_for_voltages(table, servo, found):
    other = {name: table[name] for name in ("q_deg", "t_a_us", "V_i_V")}
    known = calibrate_table(other, servo)
    for name in ("electronics.pulse_to_voltage_gain", "electronics.one_shot_slope", "electronics.one_shot_offset",
                 "electronics.command_offset"):
        assert known.parameters[name].value == pytest.approx(found.parameters[name].value, rel=0.05)
    rng = np.random.default_rng(12)
    p, b_o = servo.source("potentiometer.feedback_gain"), servo.source("potentiometer.feedback_offset")
    line = known.lines["q(t_a)"]
    fitted = line.line(np.array(line.x))
    sigma = math.sqrt(sum(r * r for r in line.line.residuals) / 3.0)
    draws = []
    for _ in range(400):
        a, c = np.radians(np.polyfit(line.x, fitted + rng.normal(0.0, sigma, 5), 1))
        slope = 1e-6 / (rng.normal(p.value, p.std) * a)
        draws.append((slope, -1e-6 * c / a - rng.normal(b_o.value, b_o.std) * slope))
    for values, name in zip(np.array(draws).T, ("one_shot_slope", "one_shot_offset"), strict=True):
        assert values.std() == pytest.approx(known.parameters[f"electronics.{name}"].std, rel=0.12)


def test_without_potentiometer_the_pulse_gain_is_told_and_nothing_invented(table):
    found = calibrate_table({name: table[name] for name in ("q_deg", "t_a_us")})
    assert not found.parameters
    assert any("0.10043(72) °/µs" in words for words in found.remarks)


def test_what_hangs_on_a_changed_gain_is_named(table, servo):
    other = servo.replace({"electronics.pulse_to_voltage_gain": 800.0})
    remarks = calibrate_table(table, other).remarks
    assert any("-8.0 %" in words and "voltage_deadband" in words and "bridge_gain" in words for words in remarks)


def test_words():
    assert plus_minus(1.0, 0.0) == "1"
    assert residual_pattern([2.0, 0.0, 1.0], [1.0, 1.0, -2.0]) == "the ends lie above the line and the middle below it"
    assert residual_pattern([0.0, 1.0], [0.0, 0.0]) == "all on the line"
    assert "no pattern" in residual_pattern(range(7), [1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0])


# --- bad input

GOOD = "q_deg,V_o_V,note\n0,0.590,a\n45,0.912,b\n90,1.253,c\n135,1.572,d\n"


@pytest.mark.parametrize(("text", "words"), [
    ("", "an empty file"),
    ("q_deg,V_o_V\n", "a header without rows"),
    ("q_deg,note\n0,1\n1,2\n2,3\n3,4\n", "got 'q_deg, note', allowed: at least two of output_angle_deg"),
    (GOOD.replace(",", ";").replace("1.253", "1,253"), "line 4, V_o_V: got '1,253', allowed: a number with a decimal "),
    (GOOD.replace(".", ","), "line 2: got '4 cells', allowed: 3, as the header"),
    ("q_deg,f_Hz\n0,61\n45,61\n90,61\n135,61\n", "at least two of"),
    ("q_deg,V_o_V\n0,0.590\n45,0.912\n90,1.253\n", "rows: got 3, allowed: at least 4"),
    (GOOD.replace("0.912", "?"), "line 3, V_o_V: got '?', allowed: a number"),
    (GOOD.replace("0.912", ""), "line 3, V_o_V: got 'nothing', allowed: a number"),
    (GOOD.replace("0.912", "nan"), "line 3, V_o_V: got nan, allowed: a finite number"),
    (GOOD.replace("135", "4000"), "column q_deg, row 4: got 4000.0, allowed: -3600 to 3600; is the unit right"),
    (GOOD.replace("V_o_V", "pulse_width"), "column pulse_width, row 1: got 0.59, allowed: 5e-05 to 0.02"),
    (GOOD.replace("V_o_V", "t_a_us"), "column t_a_us, row 1: got 0.59, allowed: 50 to 20000"),
    ("q_deg,V_o_V\n0,0.5\n45,0.5\n90,0.5\n135,0.5\n", "column V_o_V: got '0.5 in all rows', allowed: values that"),
    (GOOD.replace("note", "V_o_V"), "V_o_V 2 times"),
    ("q_deg,V_o_V\n0,1.572\n45,1.253\n90,0.912\n135,0.590\n", "allowed: a rising line"),
], ids=["empty", "no rows", "missing columns", "mixed decimals", "decimal commas", "rate is no line", "three rows",
        "no number", "blank", "nan", "angle of 4000", "pulse in s", "pulse in ms", "constant", "twice", "falling"])
def test_bad_files_are_named_in_one_line(tmp_path, text, words):
    file = tmp_path / "table.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        calibrate_table(file)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("columns", "words"), [
    ({"q_deg": [0, 1, 2, 3], "V_o_V": [0, 1, 2]}, "q_deg 4, V_o_V 3"),
    ({"q_deg": [[0, 1], [2, 3]], "V_o_V": [0, 1, 2, 3]}, "shape (2, 2)"),
    ({"q_deg": ["a", "b", "c", "d"], "V_o_V": [0, 1, 2, 3]}, "column q_deg"),
    ({"q_deg": [0, 1, 2, math.inf], "V_o_V": [0, 1, 2, 3]}, "row 4: got inf"),
    ({"V_o_V": [0, 1, 2, 3], "V_o_2_V": [0, 1, 2, 3]}, "at least two of"),
    ({}, "got 'none'"),
])
def test_bad_columns_are_named(columns, words):
    with pytest.raises(InputError) as caught:
        calibrate_table(columns)
    assert words in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        calibrate_table(tmp_path / "none.csv")


# --- on the command line

@pytest.fixture(scope="module")
def app():
    made = typer.Typer()

    @made.command()
    def fit(table: str, servo: str | None = None, out: str | None = None, force: bool = False,
            as_json: bool = False) -> None:
        from pathlib import Path

        calibrate_from(Path(table), servo, None if out is None else Path(out), force=force, as_json=as_json)

    return made


@pytest.fixture
def file(tmp_path, table):
    path = tmp_path / "table.csv"
    rows = zip(*table.values(), strict=True)
    path.write_text("\n".join([",".join(table), *(",".join(f"{v:.12g}" for v in row) for row in rows)]),
                    encoding="utf-8")
    return path


def test_the_command_shows_and_writes(app, file, tmp_path):
    out = tmp_path / "mine.toml"
    words = [str(file), "--servo", "hitec-hs-755hb", "--out", str(out)]
    done = CliRunner().invoke(app, words, catch_exceptions=False, env={"COLUMNS": "400"})
    for text in ("109.77(69) °/V", "potentiometer.feedback_gain", "disagree in zero and gain", "from 10.7 to 2.9 mV"):
        assert text in done.stdout
    assert st.load_servo(out).source("potentiometer.feedback_gain").source.startswith(str(file))
    before = out.read_bytes()
    again = CliRunner().invoke(app, words)
    assert isinstance(again.exception, OutputExistsError)
    assert out.read_bytes() == before
    assert CliRunner().invoke(app, [*words, "--force"]).exit_code == 0


def test_the_command_prints_json_in_si(app, file):
    done = CliRunner().invoke(app, [str(file), "--as-json"], catch_exceptions=False)
    facts = json.loads(done.stdout)
    assert facts["parameters"]["electronics.one_shot_slope"]["value"] == pytest.approx(1.359e-3, rel=1e-3)
    assert [pair["disagrees_in"] for pair in facts["instruments"]] == [[], ["zero", "gain"]]
    assert facts["lines"]["q(t_a)"]["curved"]
    assert facts["rows_off"][0]["better"] == 1542.0
    assert facts["rows_off"][0]["row"] == 3


def test_the_command_writes_over_no_input(app, file):
    done = CliRunner().invoke(app, [str(file), "--out", str(file), "--force"])
    assert isinstance(done.exception, InputError)
    assert file.read_text(encoding="utf-8").startswith("q_deg")
