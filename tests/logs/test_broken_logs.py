"""Logs that loggers broke: what is certain is mended by itself, and of the rest one sentence says what to type."""

import re
from pathlib import Path

import numpy as np
import pytest

from reference.broken_logs import SEEDS, Broken, broken_logs
from servotwin.errors import InputError
from servotwin.logs import read_logs

LOGS = {f"{one.kind} {one.seed}": one for one in broken_logs()}


def clean_logs(folder: Path, one: Broken):
    found = []
    for k, content in enumerate(one.clean):
        (folder / f"clean{k}.csv").write_bytes(content)
        found += read_logs(folder / f"clean{k}.csv")
    return found


def options(words):
    """Return what a program says in place of the words of a command line."""
    if not words:
        return {}
    return {"mend": words[1].split(",")} if words[0] == "--mend" else {"columns": f"time={words[1]}"}


def test_there_are_thirty_and_five_kinds_more():
    assert len(LOGS) == 15 * len(SEEDS)


@pytest.mark.long(but="micros 2")
@pytest.mark.parametrize("name", LOGS)
def test_what_comes_back_is_the_clean_log_to_the_bit(tmp_path, name):
    one = LOGS[name]
    file = tmp_path / "run.csv"
    file.write_bytes(one.broken)
    if not one.certain:
        with pytest.raises(InputError) as caught:
            read_logs(file)
        assert one.typed[0] in str(caught.value)
        if one.typed[0] == "--mend":  # what the sentence says is what is typed
            assert one.typed[1] in re.findall(r"--mend ([\w,-]+)", str(caught.value))
        assert "\n" not in str(caught.value)
    found, clean = read_logs(file, **options(one.typed)), clean_logs(tmp_path, one)
    assert len(found) == len(clean)
    for log, right in zip(found, clean, strict=True):
        sure = np.ones(len(right), bool)
        sure[list(one.unsure)] = False
        assert len(log) == len(right)
        assert list(log.measured) == list(right.measured)
        assert np.array_equal(log.time[sure], right.time[sure])
        assert (np.diff(log.time) > 0.0).all()
        assert np.array_equal(log.command, right.command)
        for signal, values in right.measured.items():
            assert np.array_equal(log.measured[signal], values)
        assert log.reading.remarks  # it is said
    assert file.read_bytes() == one.broken


# --------------------------------------------------------------------------------------------- clean logs

MACCEPA = "time=%time:ns command=field.u{0}:rad angle=field.servo{0}_position:rad"
FEETECH = "time=timestamp:iso command=target pos ({0}):360/4096deg angle=pos ({0}):360/4096deg"


@pytest.mark.long
def test_ten_clean_logs_come_through_unchanged(data_folder):
    files = [(path, MACCEPA.format(path.name[5])) for path in sorted((data_folder / "maccepa_hitec").glob("*.csv"))]
    files += [(data_folder / "feetech_backlash_robonine" / f"motor_telemetry_{name}.csv", FEETECH.format(joint))
              for name, joint in (("single", 5), ("comp2", 1))]
    assert len(files) >= 10
    for path, columns in files:
        log, = read_logs(path, columns=columns)
        assert not [one for one in log.reading.remarks if "no command" not in one], (path, log.reading.remarks)
        rows = path.read_text().splitlines()
        assert len(log) == len([row for row in rows if row]) - 1
        angle = log.reading.layout["output_angle"]
        k = rows[0].split(",").index(angle.column)
        cells = [row.split(",")[k] for row in rows[1:] if row]
        raw = np.array([float(cell) if cell else np.nan for cell in cells])
        np.testing.assert_array_equal(log.measured["output_angle"], angle.to_si(raw, "output_angle"))


# ------------------------------------------------------------------------------------------- what else is certain

ROWS = [f"{20 * k},1500,{0.1 * k:.2f}" for k in range(40)]
HEADER = "ms,pulse_us,angle_deg"


def written(folder, lines, name="run.csv", end="\n"):
    (folder / name).write_text("\n".join(lines) + end, encoding="utf-8")
    return folder / name


@pytest.mark.parametrize("change", [
    lambda rows: [*rows[:20], *(row.replace(row.split(",")[0], str(int(row.split(",")[0]) - 300), 1)
                                for row in rows[20:])],  # back by 0.3 s
    lambda rows: [*(f"{int(row.split(',')[0]) + 4_294_900},{row.split(',', 1)[1]}" for row in rows[:20]), *rows[20:]],
])
def test_a_jump_back_that_is_no_overflow_is_never_mended_by_itself(tmp_path, change):
    with pytest.raises(InputError, match=r"runs backwards.*--mend reset"):
        read_logs(written(tmp_path, [HEADER, *change(ROWS)]))


def test_an_overflow_with_a_gap_is_no_certain_one(tmp_path):
    rows = [f"{2**32 - 400 + 20 * k},1500,1.00" for k in range(20)] + [f"{20 * k + 500},1500,1.00" for k in range(20)]
    with pytest.raises(InputError, match="runs backwards"):
        read_logs(written(tmp_path, [HEADER, *rows]))


def test_a_stamp_that_fits_nowhere_is_a_torn_row(tmp_path):
    rows = [*ROWS]
    rows[10] = rows[10].replace("200", "2000", 1)
    file = written(tmp_path, [HEADER, *rows])
    with pytest.raises(InputError, match=r"--mend torn leaves out line 12"):
        read_logs(file)
    log, = read_logs(file, mend=["torn"])
    assert len(log) == 39
    assert 0.2 not in log.time


@pytest.mark.parametrize("cells", ["15,1.00", "160,1.00", "16000,1.00", "1600200,1.00", "1500,30000"])
def test_a_number_that_no_log_of_a_servo_holds_is_a_torn_row(tmp_path, cells):
    file = written(tmp_path, [HEADER, *ROWS[:10], f"200,{cells}", *ROWS[11:]])
    with pytest.raises(InputError, match=r"line 12.*as in the other rows; --mend torn leaves out 1 row"):
        read_logs(file)
    log, = read_logs(file, mend=["torn"])
    assert len(log) == 39


def test_numbers_in_a_wrong_unit_are_no_torn_rows(tmp_path):
    with pytest.raises(InputError, match="microseconds"):
        read_logs(written(tmp_path, ["time_s,pulse_width,output_angle_deg", *ROWS]))
    with pytest.raises(InputError, match="milliamperes"):
        read_logs(written(tmp_path, [HEADER + ",current_A", *(f"{row},{300 if k == 7 else 20}"
                                                              for k, row in enumerate(ROWS))]))
    sent = [row.replace("1500", "5000") if 10 <= k < 20 else row for k, row in enumerate(ROWS)]
    assert read_logs(written(tmp_path, [HEADER, *sent]))[0].command.max() == 5000e-6


def test_a_pulse_without_a_width_is_none(tmp_path):
    rows = [row.replace("1500", "0") if 10 <= k < 20 else row for k, row in enumerate(ROWS)]
    log, = read_logs(written(tmp_path, [HEADER, *rows]))
    assert np.flatnonzero(~log.sent).tolist() == list(range(10, 20))
    assert log.reading.remarks == ("10 of 40 samples have no command: no pulses were sent there",)


def test_thousands_are_told_where_nothing_has_decimals(tmp_path):
    rows = [f"{k};1500;{k};{30 * k:,}".replace(",", ".") for k in range(50)]
    file = written(tmp_path, ["time_s;pulse_us;angle_deg;current_mA", *rows])
    with pytest.raises(InputError, match=r"current_mA: got '1.020'.*such as 30, .*--mend thousands"):
        read_logs(file)
    log, = read_logs(file, mend=["thousands"])
    assert log.measured["supply_current"][34] == pytest.approx(1.02)


def test_two_faults_are_typed_together(tmp_path):
    rows = [*ROWS[:20], "400,15", *ROWS[21:], HEADER, *ROWS]
    file = written(tmp_path, [HEADER, *rows])
    with pytest.raises(InputError, match=r"--mend torn leaves out 1 row"):
        read_logs(file)
    with pytest.raises(InputError, match=r"--mend torn,reset "):
        read_logs(file, mend=["torn"])
    first, second = read_logs(file, mend=["torn", "reset"])
    assert (first.name, second.name, len(first), len(second)) == ("run (1)", "run (2)", 39, 40)


def test_unwritten_zeros_within_a_file_are_torn_rows(tmp_path):
    file = written(tmp_path, [HEADER, *ROWS[:10], "\0" * 100 + ROWS[10], *ROWS[11:]])
    with pytest.raises(InputError, match="a NUL"):
        read_logs(file)
    log, = read_logs(file, mend=["torn"])
    assert len(log) == 39


def test_a_note_before_numbers_is_a_row(tmp_path):
    rows = [f"{'start' if k == 3 else ''},{row}" for k, row in enumerate(ROWS)]
    log, = read_logs(written(tmp_path, ["note,ms,pulse_us,angle_deg", *rows]))
    assert len(log) == 40
    assert log.reading.unread == ("note",)


# ----------------------------------------------------------------------------------------------------- dialects

def test_columns_by_number_and_unit(tmp_path):
    log, = read_logs(written(tmp_path, ROWS), columns="1:ms 2:us 3:deg")
    assert log.command[0] == 1500e-6
    assert log.time[1] == 0.02
    assert np.degrees(log.measured["output_angle"][-1]) == pytest.approx(3.9)
    with pytest.raises(InputError, match="a signal before it"):
        read_logs(tmp_path / "run.csv", columns="1:ms 2:kg 3:deg")


def test_a_rate_stands_for_times_and_jumps_for_commands(tmp_path):
    file = written(tmp_path, [row.split(",")[2] for row in ROWS])
    log, = read_logs(written(tmp_path, ["angle_deg,current_mA", *(f"{row.split(',')[2]},10" for row in ROWS)]),
                     columns="time=50Hz command=0deg@0s,30deg@0.3s")
    assert np.array_equal(log.time, np.arange(40) / 50.0)
    assert np.degrees(log.command[[0, 14, 15]]).round(9).tolist() == [0.0, 0.0, 30.0]
    for wrong, words in (("time=50Hz command=30deg@0.3s", "at the start"),
                         ("time=50deg command=3deg", "a rate of rows"),
                         ("time=50Hz command=3deg@0s,4us@1s", "one unit"), ("time=50Hz command=3kg", "pulse width"),
                         ("time=50Hz command=3deg@0s,4deg@0s", "in the order"), ("time=0Hz command=3deg", "a rate")):
        with pytest.raises(InputError, match=re.escape(words)):
            read_logs(file, columns=wrong)


def test_a_command_that_lacks_is_found_as_a_step_where_there_is_one(tmp_path):
    angle = np.interp(np.arange(60.0), [10, 30], [0.0, 90.0])
    file = written(tmp_path, ["ms,angle_deg", *(f"{20 * k},{q:.1f}" for k, q in enumerate(angle))])
    with pytest.raises(InputError, match=r"--commanded 90deg@0s, as the angle shows an unknown step from 0 to 90 deg"):
        read_logs(file)
    log, = read_logs(file, unknown_step=True)
    assert np.degrees(log.command[0]) == pytest.approx(90.0)
    assert log.reading.columns[-1].known == "guessed: an unknown step, from 0 to 90 deg"
    waves = written(tmp_path, ["ms,angle_deg", *(f"{20 * k},{30 * np.sin(k / 5):.1f}" for k in range(60))])
    with pytest.raises(InputError, match="no command"):
        read_logs(waves, unknown_step=True)


@pytest.mark.parametrize("stamp", ["2024-05-03T12:00:{:06.3f}", "12:00:{:06.3f}", "3.5.2024 12:00:{:06.3f}",
                                   "5/3/2024 12:00:{:06.3f} PM"])
@pytest.mark.parametrize("name", ["time", "time_s", "timestamp"])
def test_dates_beside_our_own_names(tmp_path, stamp, name):
    rows = [f"{stamp.format(0.02 * k)},1500,1.5" for k in range(10)]
    log, = read_logs(written(tmp_path, [f"{name},pulse_width_us,output_angle_deg", *rows]))
    assert log.time.tolist() == pytest.approx((0.02 * np.arange(10)).tolist(), abs=1e-12)


@pytest.mark.parametrize("stamps", [
    ["11:59:59.90 PM", "12:00:00.00 AM", "12:00:00.10 AM"], ["31.12.2025 23:59:59,9", "1.1.2026 00:00:00,0",
                                                              "1.1.2026 00:00:00,1"],
    ["11:59:59.9 AM", "12:00:00.0 PM", "12:00:00.1 PM"]])
def test_times_past_midnight_and_noon(tmp_path, stamps):
    log, = read_logs(written(tmp_path, ["time;pulse_us;angle_deg", *(f"{stamp};1500;1" for stamp in stamps)]))
    assert log.time.tolist() == pytest.approx([0.0, 0.1, 0.2], abs=1e-12)


@pytest.mark.parametrize("mark", ["'", "\u00a0", "\u202f"])
def test_blanks_and_apostrophes_within_numbers(tmp_path, mark):
    rows = [f"{time};1{mark}500;1,5" for time in ("980", f"1{mark}000", f"1{mark}020")]
    log, = read_logs(written(tmp_path, ["time_ms;pulse_us;angle_deg", *rows]))
    assert log.time.tolist() == pytest.approx([0.98, 1.0, 1.02])
    assert log.command[0] == 1500e-6


def test_decimal_commas_among_commas_are_quoted(tmp_path):
    rows = [f'"{20 * k}","1500","{k},5"' for k in range(9)]
    log, = read_logs(written(tmp_path, ['"time_ms","pulse_us","angle_deg"', *rows]))
    assert np.degrees(log.measured["output_angle"][2]) == pytest.approx(2.5)
    with pytest.raises(InputError, match="thousands"):
        read_logs(written(tmp_path, ['"time_ms","pulse_us","angle_deg"', *(
            f'"{20 * k if k < 50 else format(20 * k, ",")}","1500","5"' for k in range(60))]))


def test_labels_in_another_order_or_torn(tmp_path):
    rows = [f"t:{20 * k},pwm:1500,pos:{k}.5" for k in range(20)]
    rows[5] = rows[5][:8]
    file = written(tmp_path, rows)
    with pytest.raises(InputError, match="--mend torn"):
        read_logs(file)
    log, = read_logs(file, mend=["torn"])
    assert len(log) == 19


def test_the_monitors_times_may_come_twice(tmp_path):
    rows = [f"12:00:00.{20 * (k - k % 2):03} -> 1500,{k}.50" for k in range(20)]
    file = written(tmp_path, ["12:00:00.000 -> pwm,angle", *rows])
    with pytest.raises(InputError, match="spread-repeated"):
        read_logs(file)
    log, = read_logs(file, mend=["spread-repeated"])
    assert log.time.tolist() == pytest.approx((0.02 * np.arange(20)).tolist(), abs=1e-12)


@pytest.mark.parametrize("mend", ["torn", ["rows"], [3], ["drop-repeated", "spread-repeated"]])
def test_mends_that_there_are_not(tmp_path, mend):
    with pytest.raises(InputError, match="mend"):
        read_logs(written(tmp_path, [HEADER, *ROWS]), mend=mend)
