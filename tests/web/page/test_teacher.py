"""The page as a teacher needs it: a lesson beside the horn, work that stays, white paper, one set of units."""

import io

import numpy as np
import pytest

from page_talk import angle, beside, go_on, opened_panel, pause, scene

pytestmark = pytest.mark.slow
LAPTOP, PHONE = {"width": 1366, "height": 768}, {"width": 390, "height": 844}
BRIGHT = """(name) => { const one = document.querySelector(name); const pen = one.getContext('2d');
    const data = pen.getImageData(0, 0, one.width, one.height).data; let sum = 0; let seen = 0;
    for (let k = 0; k < data.length; k += 4) {
      if (data[k + 3] > 250) { sum += data[k] + data[k + 1] + data[k + 2]; seen += 3; }
    }
    return sum / seen; }"""


def test_the_first_minute_has_one_servo_three_readings_and_says_what_a_second_model_is_for(page):
    assert [one["model"] for one in page.evaluate("bench.facts")] == ["PulseServo"]
    assert page.locator(".lcd-panel dd:visible").count() == 3
    assert page.locator(".model-beside").inner_text().count(".") <= 2
    assert "mean of its pulses" in page.locator(".model-beside").inner_text()
    beside(page)
    assert [one["model"] for one in page.evaluate("bench.facts")] == ["PulseServo", "BoundedServo"]
    assert page.locator(".model-beside").is_hidden()


def test_a_lesson_stands_beside_the_horn_and_first_on_a_phone(opened, home):
    page = opened(f"{home}#lesson=droop", ready=".lesson h2", viewport=LAPTOP)
    horn, lesson, answer = (page.locator(name).bounding_box() for name in (
        ".horn-panel", ".lesson-panel", ".lesson button"))
    assert lesson["x"] >= horn["x"] + horn["width"]
    assert abs(lesson["y"] - horn["y"]) < 5
    assert answer["y"] + answer["height"] < LAPTOP["height"]
    assert page.locator(".scope-panel canvas").bounding_box()["y"] < LAPTOP["height"] - 200
    phone = opened(f"{home}#lesson=droop", ready=".lesson h2", viewport=PHONE)
    first = "[...document.querySelectorAll('.panel')].find((one) => one.checkVisibility()).className"
    assert phone.evaluate(first) == "panel lesson-panel"
    assert phone.locator(".lesson button").bounding_box()["y"] < PHONE["height"]


@pytest.mark.parametrize("storage", ["there", "refused"])
def test_work_stays_when_the_page_is_loaded_once_more(opened, home, storage):
    page = opened(home)
    if storage == "refused":
        page.context.add_init_script("Object.defineProperty(window, 'sessionStorage', {get() { throw Error('no'); }})")
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1750})")
    page.evaluate("bench.do('set', {'load.torque': 0.1})")
    go_on(page, 1.0)
    before, time = scene(page)["actions"], page.evaluate("bench.time")
    page.wait_for_timeout(500)
    page.reload()
    page.wait_for_selector("body.ready")
    page.wait_for_function("bench.time > 0.05")
    if storage == "refused":
        assert scene(page)["actions"] != before
        return
    page.wait_for_function(f"bench.time > {time - 1} && bench.running")
    go_on(page, 0.3)  # it goes on
    assert scene(page)["actions"] == before
    assert angle(page) > 100.0
    page.evaluate("location.hash = '#lesson=deadband'")
    page.wait_for_selector(".lesson h2")
    go_on(page, 0.1)
    page.reload()
    page.wait_for_selector(".lesson h2")
    assert scene(page)["name"] == "A servo that is content"


def test_paper_is_white_and_has_the_lesson(opened, home):
    page = opened(f"{home}#lesson=droop", ready=".lesson h2", color_scheme="dark")
    page.evaluate("document.documentElement.dataset.theme = 'dark'; bench.emit('theme')")
    go_on(page, 0.5)
    pause(page)
    names = [".scope-panel canvas", ".chart canvas"]
    dark = [page.evaluate(BRIGHT, name) for name in names]
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    white = [page.evaluate(BRIGHT, name) for name in names]
    assert dark[0] < 60.0 < 200.0 < white[0]
    assert white[1] != dark[1]  # the lines of a chart, which has no ground of its own
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.locator(".lesson .question").is_visible()
    assert page.locator("#controls").is_hidden()
    assert page.locator(".chart canvas").first.bounding_box()["height"] > 50
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


def test_a_buzz_is_told_in_words_and_the_current_is_its_mean(page):
    page.evaluate("bench.do('set', {'load.torque': 0.6})")
    page.wait_for_function("bench.time > 3")
    pause(page)
    said = page.locator("figcaption .does").inner_text()
    assert said.startswith("buzzes at 50 Hz by 0.")
    page.get_by_role("button", name="Say what is shown").click()
    assert "buzzes at 50 Hz" in page.locator(".words-panel .said").inner_text()
    text = page.evaluate("bench.ask({export: 'csv', servo: 0}).then((found) => found.file.text)")
    table = np.genfromtxt(io.StringIO(text), delimiter=",", names=True)
    last = table["time_s"] > table["time_s"][-1] - 1.0
    mean = float(table["supply_current_A"][last].mean())
    reading = page.locator(".lcd-panel dd:visible").last.inner_text().split()
    assert float(reading[0]) * (1e-3 if reading[1] == "mA" else 1.0) == pytest.approx(
        mean, rel=0.05)  # of samples each millisecond, of drives that last three


def test_one_set_of_units_with_the_mystery_too(page):
    page.evaluate("bench.ask({mystery: 3})")
    page.wait_for_selector(".lesson-panel .card")
    for title in ("Supply, chip and gear", "Any parameter"):
        opened_panel(page, title)
    units = {}
    for box, name in ((".lesson-panel", "friction.coulomb_torque"), (".lesson-panel", "motor.rotor_inertia"),
                      (".lesson-panel", "electronics.deadband")):
        card = page.locator(f"{box} .card", has_text=name.split(".")[1])
        units[name] = card.locator(".unit").inner_text()
    assert units == {"friction.coulomb_torque": "mN m", "motor.rotor_inertia": "g cm²", "electronics.deadband": "µs"}
    assert page.locator(".side.load .slider", has_text="Dry friction").or_(page.locator(
        ".side.load .slider", has_text="dry friction")).locator(".unit").inner_text() == "mN m"
    assert not page.get_by_text("kg m²").all()
