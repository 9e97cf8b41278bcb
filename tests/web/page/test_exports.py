"""What leaves the page opens elsewhere, and has the page's numbers."""

import math
import re
import struct
import subprocess
import sys

import numpy as np
import pytest

import servotwin as st
from page_talk import go_on, latest, opened_panel, pause, until

pytestmark = pytest.mark.slow


def saved(page, name: str, folder):
    """Press a button that saves; return where the file is now."""
    with page.expect_download() as coming:
        page.get_by_role("button", name=name, exact=True).click()
    path = folder / coming.value.suggested_filename
    coming.value.save_as(path)
    return path


@pytest.fixture
def done(page):
    """A page at which something was done, and which stands."""
    page.get_by_label("pulse", exact=True).fill("1712")
    page.get_by_label("pulse", exact=True).press("Enter")
    go_on(page, 0.5)
    page.evaluate("bench.do('push', 0.25)")
    page.evaluate("bench.do('set', {'electronics.deadband': 1.2e-5}, 0)")
    go_on(page, 0.4)
    pause(page)
    opened_panel(page, "Save and share")
    return page


def test_table_servo_file_and_script_have_the_numbers_of_the_page(done, tmp_path):
    time, angle = done.evaluate("bench.time"), latest(done, "output_angle")
    table = np.genfromtxt(saved(done, "Table (CSV)", tmp_path), delimiter=",", names=True)
    assert table["time_s"][-1] == pytest.approx(time, abs=1e-9)
    assert math.radians(table["output_angle_deg"][-1]) == pytest.approx(angle, abs=1e-9)
    assert 1e-6 * table["pulse_width_us"][-1] == pytest.approx(1.712e-3, abs=1e-12)
    servo = st.load_servo(saved(done, "Servo file", tmp_path))
    assert servo.get("electronics.deadband") == 1.2e-5
    script = saved(done, "Python script", tmp_path)
    ran = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=60)
    assert ran.stderr == ""
    said = [list(map(float, re.findall(r"-?\d+\.\d+", line))) for line in ran.stdout.splitlines()]
    assert said[0][0] == pytest.approx(math.degrees(angle), abs=2e-9)
    assert said[0][1] == pytest.approx(time, abs=1e-6)


def test_the_picture_shows_all_instruments(done, tmp_path):
    data = saved(done, "Picture (PNG)", tmp_path).read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    size = struct.unpack(">2I", data[16:24])
    drawn = done.evaluate("[...document.querySelectorAll('#instruments canvas')].map((one) => [one.width, one.height])")
    assert len(drawn) == 3
    assert size[0] == max(width for width, _ in drawn) + 32
    lines = 1 + 2 + 1 + 1  # title; two channels; two charts
    assert size[1] >= sum(height for _, height in drawn) + 20 * lines
    assert len(data) > 20_000  # there is something in it


def test_a_bench_and_a_servo_file_open_again(done, opened, home, tmp_path):
    bench = saved(done, "Bench (TOML)", tmp_path)
    time, angle = done.evaluate("bench.time"), latest(done, "output_angle")
    again = opened(home)
    opened_panel(again, "Save and share")
    again.get_by_label("open a bench or a servo file").set_input_files(bench)
    again.wait_for_function(f"Math.abs(bench.time - {time}) < 1e-9")
    assert latest(again, "output_angle") == pytest.approx(angle, abs=1e-9)
    servo = saved(done, "Servo file", tmp_path)
    again.get_by_label("open a bench or a servo file").set_input_files(servo)
    again.wait_for_function("bench.state.name.endsWith('.toml')")
    until(again, 0.1)
    numbers = again.evaluate("bench.facts[0].parameters.find((one) => one.name === 'electronics.deadband').value")
    assert numbers == 1.2e-5
    servos = again.evaluate("bench.facts.length")
    wrong = tmp_path / "broken.toml"
    wrong.write_text("format = 1\nservo = [")
    again.get_by_label("open a bench or a servo file").set_input_files(wrong)
    again.wait_for_selector("#notice:not([hidden])")
    assert "TOML" in again.locator("#notice").inner_text()
    assert again.evaluate("bench.facts.length") == servos  # the bench stays
