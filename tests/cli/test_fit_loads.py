"""`fit --table` with tables of loads and records of lifts."""

import json

import numpy as np
import pytest

import servotwin as st

TABLE = "mass_g,current_mA\n100,230\n200,300\n320,370\n400,405\n450,450\n"
COLUMNS = "time=1:ms angle=2:deg current=3:A"


@pytest.fixture
def table(tmp_path):
    (tmp_path / "table.csv").write_text(TABLE)
    return "table.csv"


def records(folder, masses=(0, 200, 400, 600)):
    """Write lifts on a drum of 10 cm: 330 deg/s, 1.05 N m, 1.9 A per N m, 60 ms of dead time; whole degrees."""
    chance = np.random.default_rng(3)
    for mass in masses:
        torque = 1e-3 * mass * 9.80665 * 0.1
        speed, tau = 330.0 * (1.0 - torque / 1.05), 0.03
        t = np.round(np.arange(0.0, 750.0, 2.4))
        s = np.maximum(t / 1e3 - 0.06, 0.0)
        angle = np.minimum(np.floor(speed * (s - tau * (1.0 - np.exp(-s / tau)))), 153.0)
        current = np.where(s > 0.0, 0.15 + 1.9 * torque + 1.2 * np.exp(-s / tau), 0.15) + chance.normal(0, 0.04, t.size)
        (folder / f"lift{mass}.txt").write_text("".join(
            f"{a:.0f} {b:.0f} {c:.4f}\n" for a, b, c in zip(t, angle, current, strict=True)))


def test_a_table_of_loads(cli, table):
    words = ("fit", "--table", table, "--servo", "towerpro-mg90s", "--arm", "1cm")
    facts = cli(*words, "--out", "mine.toml", "--json").data
    assert facts["figures"]["torque per current"]["value"] == pytest.approx(0.1625, rel=0.03)
    assert facts["figures"]["no-load current"]["value"] == pytest.approx(0.1735, rel=0.03)
    assert facts["figures"]["heaviest load"]["value"] == pytest.approx(0.0441, rel=0.03)
    assert min(abs(one["share"] - 0.25) for one in facts["sheet"]) < 0.0075
    servo = st.load_servo("mine.toml")
    assert servo.source("friction.load_friction").origin == "measured"
    shown = cli(*words)
    assert "0.1625" in shown.out
    assert "does it?" in shown.out
    said = cli(*words, "--set", "supply.open_circuit_voltage=5V")
    assert "at 5 V" in said.out


@pytest.mark.long
def test_what_is_missing_is_said_in_one_line(cli, table, tmp_path):
    assert "--arm 1cm" in cli("fit", "--table", table).error
    assert "a length" in cli("fit", "--table", table, "--arm", "far").error
    assert "--table table.csv" in cli("fit", table, "--servo", "towerpro-mg90s").error
    assert "--table" in cli("fit", table, "--servo", "towerpro-mg90s", "--arm", "1cm").error
    assert "units in the names" in cli("fit", "--table", table, "--arm", "1cm", "--columns", "time=1:ms").error
    (tmp_path / "nan.csv").write_text(TABLE.replace("370", "NaN"))
    assert "line 4" in cli("fit", "--table", "nan.csv", "--arm", "1cm").error
    (tmp_path / "dial.csv").write_text("q_deg,V_o_V\n0,0.590\n45,0.912\n90,1.253\n135,1.572\n")
    assert "a table without loads" in cli("fit", "--table", "dial.csv", "--arm", "1cm").error
    assert "--servo" in cli("fit", "--table", table, "--arm", "1cm", "--set", "supply.open_circuit_voltage=5V").error


@pytest.mark.long
def test_the_arm_is_read_from_the_name_and_from_beside(cli, table, tmp_path):
    (tmp_path / "lift_drum1cm.csv").write_text(TABLE)
    (tmp_path / "table.json").write_text(json.dumps({"arm": "1cm"}))
    for name in ("lift_drum1cm.csv", "table.csv"):
        assert cli("fit", "--table", name, "--json").data["arm"] == pytest.approx(0.01)
    records(tmp_path)
    for said in ({"arm": "10cm"}, {"format": "servotwin-log-1", "files": {
            "lift{mass}.txt": {"load": {"drum": {"mass": "{mass}g", "radius": 0.1}}}}}):
        (tmp_path / "logs.json").write_text(json.dumps(said))
        assert cli("fit", "--table", "lift{mass}.txt", "--columns", COLUMNS, "--json").data["arm"] == pytest.approx(0.1)


def test_a_log_with_a_load_is_no_table(tmp_path):
    from servotwin.bench import is_load_table

    file = tmp_path / "log.csv"
    for header in ("time_s,pulse_width_us,output_angle_deg,load_torque_Nm", "t,load [N],current [A]",
                   "time_s,supply_voltage_V,speed_deg_s,angle_deg", "V_i_V,V_o_V,q_deg,f_Hz"):
        file.write_text(header + "\n" + "\n".join(",".join(f"{k}.0" for _ in header.split(",")) for k in range(5)))
        assert not is_load_table(file), header
    for header in ("load [N],I (A)", "supply_voltage_V,time_60deg_s", "weight,current_mA", "weight_kg,sag_deg"):
        file.write_text(header + "\n" + "\n".join(",".join(f"{k}.0" for _ in header.split(",")) for k in range(5)))
        assert is_load_table(file), header


def test_records_of_lifts(cli, tmp_path):
    records(tmp_path)
    facts = cli("fit", "--table", "lift{mass:g}.txt", "--arm", "10cm", "--columns", COLUMNS, "--json").data
    figures = facts["figures"]
    assert np.degrees(figures["no-load speed"]["value"]) == pytest.approx(330.0, rel=0.03)
    assert figures["stall torque"]["value"] == pytest.approx(1.05, rel=0.03)
    assert figures["current per torque"]["value"] == pytest.approx(1.9, rel=0.03)
    assert all(one["dead_time"] == pytest.approx(0.060, rel=0.03) for one in facts["records"])
    assert "lift200.txt" in cli("fit", "--table", "lift{mass}.txt", "--arm", "10cm", "--columns", COLUMNS).out


@pytest.mark.long
def test_records_that_cannot_be(cli, tmp_path):
    records(tmp_path, (0, 200))
    words = ("fit", "--table", "lift{mass}.txt", "--arm", "10cm")
    assert "at least 3" in cli(*words, "--columns", COLUMNS).error
    records(tmp_path)
    assert "--columns" in cli(*words).error
    assert "--arm 1cm" in cli("fit", "--table", "lift{mass}.txt", "--columns", COLUMNS).error
    (tmp_path / "lift800.txt").write_text("".join(f"{k} 0 0.1\n" for k in range(40)))
    assert "does not turn" in cli(*words, "--columns", COLUMNS).error
