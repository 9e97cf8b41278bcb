"""Lists of sheets."""

import math

import pytest

from servotwin.errors import InputError
from servotwin.identification import read_sheets, servo_from_sheet, sheet_contradictions
from servotwin.parameters import operating_voltages

HEADER = "maker,model,type,V,stall_torque_Nm,speed_s_per_60deg,noload_running_current_A,deadband_us,pulse_range_us\n"


def write(folder, text, name="list.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_of_one_model_are_one_sheet(tmp_path):
    path = write(tmp_path, HEADER + "Acme,S 1,digital,4.8,0.3,0.23,,8,500-2500\nAcme,S 1,digital,6.0,0.4,0.19,0.1,,\n"
                 "Acme,S 2,,6.0,0.4,,,,\n")
    found = read_sheets(path)
    assert [sheet.name for sheet in found.sheets] == ["acme-s-1"]
    assert found.left_out == ("Acme S 2: no torque and speed at one voltage",)
    sheet = found.sheets[0]
    assert (sheet.title, sheet.modulation, sheet.deadband) == ("Acme S 1", "digital", 8e-6)
    assert (sheet.pulse_min, sheet.pulse_max) == pytest.approx((5e-4, 2.5e-3))
    assert [point.no_load_speed for point in sheet.main] == pytest.approx([math.pi / 3 / 0.23, math.pi / 3 / 0.19])
    assert [point.no_load_current for point in sheet.main] == [None, 0.1]


def test_rows_of_another_source_do_not_make_the_servo(tmp_path):
    path = write(tmp_path, "model,V,stall_torque_Nm,speed_s_per_60deg,source\n"
                 "A,6.0,0.4,0.19,box\nA,6.0,0.5,0.17,shop\n")
    sheet = read_sheets(path).sheets[0]
    assert sheet.source == "box"
    assert len(sheet.main) == len(sheet.others) == 1
    assert sheet.source_at(sheet.others[0]) == "shop"


@pytest.mark.parametrize("text", [
    "model,V,stall_torque_Nm,speed_s_per_60deg,voltage_range_V\nA,6.0,0.4,0.19,4.8-7.2\n",
    "model;V;stall_torque_Nm;speed_s_per_60deg;voltage_range_V\nA;6,0;0,4;0,19;4,8-7,2\n"])
def test_a_list_may_say_between_which_voltages_a_servo_runs(tmp_path, text):
    servo = servo_from_sheet(read_sheets(write(tmp_path, text)).sheets[0])
    assert operating_voltages(servo) == (4.8, 7.2)


@pytest.mark.parametrize(("text", "said"), [
    (HEADER.replace("pulse_range_us", "voltage_range_V") + "A,B,,6,1,0.2,,8,7.2\n", "line 2, voltage_range_V"),
    (HEADER.replace("pulse_range_us", "voltage_range_V") + "A,B,,6,1,0.2,,8,7.2-4.8\n", "line 2: voltage range"),
    ("", "an empty file"), (HEADER, "a header without rows"), ("model,V\nA,6\n", "also stall_torque_Nm"),
    (HEADER.replace("deadband_us", "dead_band_us") + "A,B,,6,1,0.2,,,\n", "did you mean 'deadband_us'?"),
    (HEADER + "A,B,,6,much,0.2,,,\n", "line 2, stall_torque_Nm: got 'much'"),
    (HEADER + "A,B,,6,nan,0.2,,,\n", "line 2, stall_torque_Nm: got 'nan'"),
    (HEADER + "A,B,,6,-1,0.2,,,\n", "line 2: stall torque at 6 V"),
    (HEADER + "A,B,,6,1,0,,,\n", "line 2: no load speed at 6 V"),
    (HEADER + "A,B,,6,1,0.2,,8000,\n", "line 2: deadband"),
    (HEADER + "A,B,,6,1,0.2,,8,500\n", "line 2, pulse_range_us"),
    (HEADER + "A,B,,6,1,0.2,,8,500-2500,9\n", "line 2: got '10 cells'"),
    (HEADER + "A,B,,6,1,0.2,,,\nA,b,,6,1,0.2,,,\n", "'a-b', which is taken"),
])
def test_bad_lists_are_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError) as caught:
        read_sheets(write(tmp_path, text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_lists(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_sheets(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="an empty file"):
        read_sheets(tmp_path / "binary.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_sheets(tmp_path)


@pytest.mark.long
def test_the_compiled_list_makes_servos_and_names_what_cannot_be(data_folder):
    """FT-7235 asks for 145 to 152 % of efficiency, RDS3115 for 117 to 165 %, DS3218 for 128 % and more."""
    found = read_sheets(data_folder / "servo_specs" / "servo_specs_by_voltage.csv")
    assert len(found.sheets) == 27
    assert len(found.left_out) == 5
    impossible = {sheet.name for sheet in found.sheets if sheet_contradictions(sheet)}
    assert impossible == {"feetech-ft-7235-c018", "dsservo-rds3115", "dsservo-ds3218", "geekservo-2kg-grey",
                          "dfrobot-df05bb"}
    for sheet in found.sheets:
        if sheet.name not in impossible:
            assert servo_from_sheet(sheet).name == sheet.name
