"""What the instruments say is what was set: oscilloscope, traces, clock, and how they are looked at."""

import math
import re

import pytest

from page_talk import go_on, opened_panel, pause

pytestmark = pytest.mark.slow


def measured(page, name: str, channel: int = 1) -> str:
    return page.locator(f".measures .channel{channel} div", has_text=re.compile(f"^{name}")).locator("dd").inner_text()


def in_si(said: str) -> float:
    value, unit = said.split()
    return float(value) * {"m": 1e-3, "µ": 1e-6, "k": 1e3}.get(unit[0] if len(unit) > 1 else "", 1.0)


def lit(page, x: float) -> list[int]:
    """Rows of the screen, from its top, in which the first channel's colour is lit at a share of its width."""
    return page.evaluate("""(share) => { const one = document.querySelector('.scope-panel canvas');
        const pen = one.getContext('2d'); const at = Math.round(share * one.width);
        const data = pen.getImageData(at, 0, 1, one.height).data; const rows = [];
        for (let k = 24; k < one.height; k += 1) if (data[4 * k + 2] > 140 && data[4 * k] < 60) rows.push(k);
        return rows; }""", x)


def transmitter(page, label: str, value: str) -> None:
    field = page.get_by_label(label, exact=True)
    field.fill(value)
    field.press("Enter")


def test_the_pulse_is_measured_at_any_frame_rate_and_by_either_edge_until_none_comes(page):
    opened_panel(page, "Transmitter")
    page.locator("summary", has_text="Channels and trigger").click()
    for rate, width in ((50, 1687), (200, 911)):
        transmitter(page, "frame rate", str(rate))
        transmitter(page, "pulse", str(width))
        go_on(page, 0.6)
        assert in_si(measured(page, "pulse width")) == pytest.approx(1e-6 * width, rel=1e-6)
        assert in_si(measured(page, "frequency")) == pytest.approx(rate, rel=1e-4)
        assert in_si(measured(page, "period")) == pytest.approx(1.0 / rate, rel=1e-4)
        assert float(measured(page, "duty").split()[0]) == pytest.approx(1e-4 * width * rate, rel=1e-2)
    page.get_by_label("Time base").select_option("0.001")
    page.wait_for_timeout(300)
    high = lit(page, 0.15)  # the trigger is at a tenth of the screen: 0.5 ms later the pulse is high, 2 ms later not
    low = lit(page, 0.3)
    assert high
    assert low
    assert max(high) < min(low)
    page.get_by_label("Trigger", exact=True).select_option("0-")
    page.wait_for_timeout(300)
    assert max(lit(page, 0.05)) < min(lit(page, 0.15))  # now it ends there
    assert in_si(measured(page, "pulse width")) == pytest.approx(911e-6, rel=1e-6)
    transmitter(page, "frames that are lost", "100")
    go_on(page, 0.8)
    assert measured(page, "pulse width") == "no pulse"
    assert measured(page, "frequency") == "–"


def test_hold_single_shot_and_cursors(page):
    hold = page.get_by_role("button", name="Hold")
    hold.click()
    go_on(page, 0.2)
    still = page.evaluate("document.querySelector('.scope-panel canvas').toDataURL()")
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 2200})")
    go_on(page, 0.5)
    assert page.evaluate("document.querySelector('.scope-panel canvas').toDataURL()") == still
    hold.click()
    go_on(page, 0.3)
    assert in_si(measured(page, "pulse width")) == pytest.approx(2.2e-3, rel=1e-6)
    page.get_by_label("Time base").select_option("0.0005")
    page.get_by_role("button", name="Cursors").click()
    page.get_by_label("cursor time 1").fill("0.1")
    page.get_by_label("cursor time 2").fill("0.54")  # 4.4 divisions later: where the pulse ends
    page.wait_for_timeout(300)
    cursors = page.locator(".measures .cursors dd").all_inner_texts()
    assert in_si(cursors[0]) == pytest.approx(2.2e-3, rel=1e-3)
    assert in_si(cursors[1]) == pytest.approx(1.0 / 2.2e-3, rel=1e-3)
    box = page.locator(".scope-panel canvas").bounding_box()
    middle = box["y"] + 22 + (box["height"] - 22) * 0.5
    page.mouse.move(box["x"] + 0.54 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.3 * box["width"], middle, steps=5)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert in_si(page.locator(".measures .cursors dd").first.inner_text()) == pytest.approx(1e-3, rel=0.02)
    page.locator("summary", has_text="Channels and trigger").click()
    page.get_by_label("Mode").select_option("single")
    page.wait_for_timeout(300)
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 900})")
    go_on(page, 0.4)
    assert in_si(measured(page, "pulse width")) == pytest.approx(2.2e-3, rel=1e-6)  # what was caught stays


def test_the_second_channel_measures_the_bridge(page):
    page.evaluate("bench.do('push', 0.5)")
    page.get_by_label("Time base").select_option("0.01")
    go_on(page, 1.5)
    pause(page)
    high, low, mean, rms = (in_si(measured(page, name, 2)) for name in ("highest", "lowest", "mean", "rms"))
    assert high == pytest.approx(5.6, abs=1e-3)  # the battery's 6 V less what the bridge drops
    assert low == pytest.approx(0.0, abs=1e-3)
    assert 0.0 < mean < rms < high
    assert mean * high == pytest.approx(rms * rms, rel=0.01)  # as of any rectangle that starts at 0


def test_traces_zoom_pan_and_read(page):
    page.evaluate("bench.do('command', {shape: 'sine', unit: 'us', mean: 1500, amplitude: 200, frequency: 1})")
    go_on(page, 3.0)
    pause(page)
    page.get_by_label("Window", exact=True).select_option("2")
    chart = page.locator(".chart[data-chart=Angle]")
    over = chart.locator(".u-over").bounding_box()
    time = page.evaluate("bench.time")
    page.mouse.move(over["x"] + 0.25 * over["width"], over["y"] + 60)
    chart.locator(".when", has_text="at").wait_for()
    at = float(chart.locator(".when").inner_text().split()[1])
    assert at == pytest.approx(time - 1.5, abs=0.01)
    page.wait_for_timeout(300)
    said = float(chart.locator(".sample .value").first.inner_text().rstrip("°"))
    seen = math.degrees(page.evaluate(f"bench.history[0].between('output_angle', {at})"))
    assert said == pytest.approx(seen, abs=0.3)  # the time under the mouse is said to a millisecond
    page.mouse.down()
    page.mouse.move(over["x"] + 0.5 * over["width"], over["y"] + 60, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)
    moved = float(chart.locator(".when").inner_text().split()[1])
    assert moved == pytest.approx(at, abs=0.02)  # what was under the mouse went with it
    assert page.get_by_role("button", name="Follow").get_attribute("aria-pressed") == "false"
    page.get_by_role("button", name="zoom in").click()
    assert page.get_by_label("Window", exact=True).input_value() == "1"
    chart.focus()
    page.keyboard.press("-")
    assert page.get_by_label("Window", exact=True).input_value() == "2"
    page.get_by_label("Torque", exact=True).check()
    assert page.locator(".chart").count() == 3


def test_slow_motion_and_single_frames(page):
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1800})")
    page.locator("#clock select").select_option("0.001")
    page.wait_for_function("bench.header.speed === 0.001")
    before = page.evaluate("bench.time")
    page.wait_for_timeout(1500)
    went = page.evaluate("bench.time") - before
    assert 0.5e-3 < went < 4e-3
    paced, unit = re.search(r"(\d+|\d+\.\d+) (ms|µs) in a second", page.locator(".pace").inner_text()).groups()
    assert 0.5 < float(paced) * {"ms": 1.0, "µs": 1e-3}[unit] < 4.0  # 1, less on a machine that cannot keep up
    assert re.fullmatch(r"\d+\.\d{6} s", page.locator(".time").inner_text())
    page.wait_for_function("bench.header.behind === false")
    for _ in range(3):
        page.get_by_role("button", name="One frame").click()
        page.wait_for_timeout(100)
    frames = 50.0 * page.evaluate("bench.time")
    assert frames == pytest.approx(round(frames), abs=1e-6)
    assert page.get_by_role("button", name="Run").is_visible()
    page.locator("h1").click()
    page.keyboard.press("Space")
    page.get_by_role("button", name="Pause").wait_for()


def test_how_the_bench_is_looked_at_goes_with_its_link(page, opened):
    page.get_by_label("Window", exact=True).select_option("1")
    page.get_by_label("Torque", exact=True).check()
    page.get_by_label("Time base").select_option("0.002")
    page.get_by_label("Told in").select_option("deg")
    page.locator("summary", has_text="Channels and trigger").click()
    page.get_by_label("Channel 2", exact=True).select_option("0:armature_current")
    page.get_by_label("Scale 2").select_option("0.2")
    page.wait_for_timeout(700)
    opened_panel(page, "Save and share")
    page.get_by_role("button", name="Link").click()
    page.wait_for_function("location.hash.length > 20")
    again = opened(page.url)
    again.wait_for_function("bench.history[0]?.length > 0 && document.querySelectorAll('.chart').length === 3")
    assert again.get_by_label("Window", exact=True).input_value() == "1"
    assert again.get_by_label("Time base").input_value() == "0.002"
    assert again.get_by_label("Told in").input_value() == "deg"
    again.locator("summary", has_text="Channels and trigger").click()
    assert again.get_by_label("Channel 2", exact=True).input_value() == "0:armature_current"
    assert again.get_by_label("Scale 2").input_value() == "0.2"
