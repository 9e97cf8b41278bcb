"""What boards print when they start: read as what it says, with the supply just before."""

import numpy as np
import pytest

from servotwin.logs import read_logs

ESP = "ets Jun  8 2016 00:22:57\n\nrst:0x{} ({}),boot:0x13 (SPI_FAST_FLASH_BOOT)\nentry 0x400805f0\n"
LOW = "by its brown-out detector: its supply was too low"
TEXTS = [
    ("Brownout detector was triggered\n\n" + ESP.format("c", "SW_CPU_RESET"), "ESP32", LOW),
    (ESP.format("f", "RTCWDT_BROWN_OUT_RESET"), "ESP32", LOW), (ESP.format("f", "BROWNOUT_RST"), "ESP32", LOW),
    (ESP.format("1", "POWERON_RESET"), "ESP32", "by power that came on"),
    (ESP.format("8", "TG1WDT_SYS_RESET"), "ESP32", "by its watchdog"),
    (ESP.format("c", "SW_CPU_RESET"), "ESP32", "by its program"),
    ("MCUSR=0x04\n", "AVR", LOW), ("MCUSR: 2\n", "AVR", "by its reset pin"),
    ("MCUSR=8\n", "AVR", "by its watchdog"),
    ("MCUSR=0b00000101\n", "AVR", "by power that came on and its brown-out detector: its supply was too low"),
    ("Servo logger v1.2\n", None, ""), ("MCUSR=0\n", None, "")]


@pytest.mark.parametrize("case", range(len(TEXTS)))
@pytest.mark.parametrize("restarts", [False, True])
def test_a_boot_text_is_read_as_what_it_says(tmp_path, case, restarts):
    """In the middle of a log, whose clock goes on or begins again: then the text belongs to what was before."""
    text, board, why = TEXTS[case]
    time = np.arange(60) * 20
    rows = [f"{t},{1500 + 100 * (t > 400)},{0.1 * t:.1f},{4.9 - 0.02 * (k % 30):.2f},{200 + k}"
            for k, t in enumerate(time.tolist())]
    later = [f"{t},{row.partition(',')[2]}" for t, row in zip(time.tolist(), rows[30:], strict=False)]
    path = tmp_path / "log.csv"
    path.write_text("time_ms,pulse_us,angle_deg,voltage_V,current_mA\n" + "\n".join(rows[:30]) + "\n" + text
                    + "\n".join(later if restarts else rows[30:]) + "\n")
    logs = read_logs(path, mend=("reset",) if restarts else (), unknown_step=True)
    said = [remark for log in logs for remark in log.reading.remarks if "was reset" in remark]
    if board is None:
        assert said == []
        return
    (one,) = said
    assert f"the board ({board}) was reset {why}; just before: 4.32 V, 0.229 A" in one
    assert one in logs[0].reading.remarks
