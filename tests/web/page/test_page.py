"""The page in a real browser: what a hand does moves the horn, and what the instruments say is what was set."""

import re

import pytest

pytestmark = pytest.mark.slow


def angle(page, servo: int = 0) -> float:
    return page.evaluate(f"bench.history[{servo}].latest('output_angle') * 180 / Math.PI")


def go_on(page, seconds: float) -> None:
    """Wait until the bench, not the wall, has gone on for a time [s]."""
    page.wait_for_function(f"bench.time > {page.evaluate('bench.time') + seconds}")


def test_slider_and_keys_move_the_horn(page):
    slide = page.get_by_label("pulse, slider")
    before, box = angle(page), slide.bounding_box()
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    go_on(page, 1.2)
    assert angle(page) > before + 20.0
    turned = page.locator("svg.servo0 .turn").get_attribute("transform")
    assert float(re.search(r"rotate\((-?[\d.]+)\)", turned).group(1)) == pytest.approx(-angle(page), abs=2.0)
    at = angle(page)
    for _ in range(60):
        slide.press("ArrowLeft")
    go_on(page, 0.8)
    assert angle(page) < at - 3.0


def test_the_oscilloscope_measures_the_pulse_that_was_set(page):
    page.get_by_label("pulse", exact=True).fill("1687")
    page.get_by_label("pulse", exact=True).press("Enter")
    go_on(page, 0.6)
    said = page.locator(".measures .channel1 div", has_text="pulse width").locator("dd").inner_text()
    assert float(said.split()[0]) * 1000.0 == pytest.approx(1687.0, rel=1e-5)
    assert page.locator(".lcd.servo0 div", has_text="width of the pulses").locator("dd").inner_text() == "1687.0 µs"


def test_the_two_models_differ(page):
    page.evaluate("bench.do('set', {'load.torque': 0.5})")
    go_on(page, 1.5)
    assert abs(angle(page, 0) - angle(page, 1)) > 0.3


def test_pause_one_frame_and_run(page):
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Run").wait_for()
    before = page.evaluate("bench.time")
    page.get_by_role("button", name="One frame").click()
    page.wait_for_function(f"bench.time > {before}")
    assert 0.0 < page.evaluate("bench.time") - before <= 0.02 + 1e-9
    page.get_by_role("button", name="Run").click()
    go_on(page, 0.1)


def test_a_link_restores_the_bench(page, opened):
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1750})")
    go_on(page, 0.7)
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Run").wait_for()
    page.wait_for_timeout(300)
    page.locator("summary", has_text="Save and share").click()
    page.get_by_role("button", name="Link").click()
    page.wait_for_function("location.hash.length > 20")
    link, there, time = page.url, angle(page), page.evaluate("bench.time")
    again = opened(link)
    again.wait_for_function(f"window.bench && Math.abs(bench.time - {time}) < 1e-9")
    assert angle(again) == pytest.approx(there, abs=1e-9)


def test_a_lesson_sets_the_bench_up(page):
    page.locator("summary", has_text="Lessons").click()
    page.get_by_role("link", name="Brake or coast").click()
    page.wait_for_selector(".lesson h3")
    assert page.locator(".lesson p").count() >= 4
    page.get_by_role("button", name="Answer").click()
    assert page.locator(".answer").is_visible()


def test_every_control_is_reached_by_tab(page):
    page.get_by_role("button", name="Pause").click()
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    wanted = page.evaluate("""[...document.querySelectorAll('button,select,input,textarea,summary,a[href]')].filter(
        (one) => one.checkVisibility() && !one.disabled && one.tabIndex >= 0).length""")
    seen = page.evaluate("""() => { window.seen = new Set(); document.addEventListener('focusin',
        (event) => window.seen.add(event.target)); return 0; }""")
    for _ in range(wanted + 40):
        page.keyboard.press("Tab")
    seen = page.evaluate("""[...window.seen].filter((one) => one.matches(
        'button,select,input,textarea,summary,a[href]')).length""")
    assert seen >= wanted
