"""The page in a real browser: what a hand does moves the horn, and what the instruments say is what was set."""

import re

import pytest

from page_talk import angle, beside, go_on, opened_panel, pause

pytestmark = pytest.mark.slow


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


def test_the_two_models_differ(page):
    beside(page)
    page.evaluate("bench.do('set', {'load.torque': 0.5})")
    go_on(page, 1.5)
    assert abs(angle(page, 0) - angle(page, 1)) > 0.3


def test_pause_one_frame_and_run(page):
    pause(page)
    before = page.evaluate("bench.time")
    page.get_by_role("button", name="One frame").click()
    page.wait_for_function(f"bench.time > {before}")
    assert 0.0 < page.evaluate("bench.time") - before <= 0.02 + 1e-9
    page.get_by_role("button", name="Run").click()
    go_on(page, 0.1)


def test_a_link_restores_the_bench(page, opened):
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1750})")
    go_on(page, 0.7)
    pause(page)
    opened_panel(page, "Save and share")
    page.get_by_role("button", name="Link").click()
    page.wait_for_function("location.hash.length > 20")
    link, there, time = page.url, angle(page), page.evaluate("bench.time")
    again = opened(link)
    again.wait_for_function(f"window.bench && Math.abs(bench.time - {time}) < 1e-9")
    assert angle(again) == pytest.approx(there, abs=1e-9)
