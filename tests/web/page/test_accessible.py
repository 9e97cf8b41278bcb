"""The page is usable by keyboard and screen reader, on a phone, in the dark, and without motion."""

from urllib.parse import urlsplit

import pytest

from web_talk import running

pytestmark = pytest.mark.slow

PHONE = {"width": 390, "height": 844}
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
OPEN_ALL = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"
CONTROLS = "button,select,input,textarea,summary,a[href],[tabindex='0']"
LEAST = 44  # pixels of what a finger hits
MAIN = "#clock button, #clock select, .side > details > summary, .panel button, .command button, .command select"
BUS = "bench.facts[0].registers !== null && bench.history[0].length > 5"


@pytest.fixture(scope="module")
def axe(tools):
    return (tools / "axe-core/axe.min.js").read_text()


@pytest.fixture(scope="module")
def school():
    """Address of a class on this computer, and what the links of teacher and watchers ask."""
    with running("--host", "0.0.0.0", "--class") as (page, links):
        here = f"http://127.0.0.1:{urlsplit(page).port}/"
        yield here, "?" + urlsplit(links["teacher"]).query, "?code=" + links["code"]


def wrong(page, axe) -> list[str]:
    """Return what axe says against a page, in a line each."""
    page.evaluate(axe)
    found = page.evaluate("(rules) => axe.run(document, {runOnly: rules, resultTypes: ['violations']})", RULES)
    return [f"{one['id']}: {node['html'][:120]}: {node['failureSummary']}" for one in found["violations"]
            for node in one["nodes"]]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_has_nothing_to_say(opened, home, axe, scheme):
    page = opened(home, color_scheme=scheme)
    page.wait_for_function("bench.time > 0.3")
    assert wrong(page, axe) == []
    page.evaluate(OPEN_ALL)
    for name in ("Cursors", "Say what is shown", "Answer"):
        for button in page.get_by_role("button", name=name).all():
            button.click()
    page.get_by_label("Shape").select_option("recorded")
    page.wait_for_timeout(200)
    assert wrong(page, axe) == []


def test_axe_has_nothing_to_say_of_lesson_bus_servo_mystery_and_phone(opened, server, axe):
    page = opened(server + "#lesson=p-gain", viewport=PHONE)
    page.wait_for_function(BUS)
    page.evaluate(OPEN_ALL)
    assert page.locator(".side.registers .card").count() > 5
    page.get_by_role("button", name="Answer").click()
    page.wait_for_timeout(200)
    assert wrong(page, axe) == []
    assert "with the finger" in page.locator(".force").inner_text() or not page.evaluate(
        "matchMedia('(pointer: coarse)').matches")
    page.evaluate("bench.ask({mystery: 3})")
    page.locator(".lesson-panel input").nth(0).fill("8e-6")
    page.get_by_role("button", name="Compare with the truth").click()
    page.wait_for_selector(".lesson-panel table")
    page.set_viewport_size({"width": 1280, "height": 900})
    assert wrong(page, axe) == []


def test_axe_has_nothing_to_say_of_door_watcher_and_teacher(opened, school, axe):
    here, teacher, code = school
    for query, ready in (("", "form"), (teacher, "body.ready"), (code, "body.ready")):
        page = opened(here + query, ready=ready)
        page.wait_for_timeout(300)
        assert wrong(page, axe) == []


def test_who_does_not_know_the_code_sees_the_door_and_who_does_watches(opened, school):
    page = opened(school[0], ready="form")
    assert not page.locator("#controls").is_visible()
    assert not page.locator("canvas").first.is_visible()
    code = page.get_by_label("Code on the teacher's screen")
    assert code.evaluate("(one) => one === document.activeElement")
    code.fill(school[2][6:].upper() + " ")
    page.keyboard.press("Enter")
    page.wait_for_selector("body.ready.watches")
    page.wait_for_function("bench.history[0].length > 5")
    assert not page.get_by_role("button", name="Pause").is_visible()
    assert page.get_by_text("You watch").is_visible()


def test_tab_reaches_every_control_there_and_back_and_shows_where_it_is(page):
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Run").wait_for()
    page.evaluate(OPEN_ALL)
    page.locator(".pick select").first.wait_for()  # the catalog comes later than the bench
    wanted = page.evaluate(f"""() => {{ window.order = []; document.addEventListener('focusin', (event) => {{
            const style = getComputedStyle(event.target);
            window.order.push([event.target, event.target.matches(':focus-visible') && style.outlineStyle === 'solid'
                               && parseFloat(style.outlineWidth) >= 2]); }});
        window.wanted = [...document.querySelectorAll("{CONTROLS}")].filter((one) => one.checkVisibility()
            && !one.disabled && one.tabIndex >= 0); window.wanted[0].focus(); return window.wanted.length; }}""")
    assert wanted > 100
    for _ in range(wanted - 1):
        page.keyboard.press("Tab")
    there = page.evaluate("""() => { const seen = window.order.map(([one]) => one); return {
        missed: window.wanted.filter((one) => !seen.includes(one)).map((one) => one.outerHTML.slice(0, 120)),
        hidden: window.order.slice(1).filter(([, shown]) => !shown).map(([one]) => one.outerHTML.slice(0, 120)),
        as_they_stand: seen.slice(0, window.wanted.length).every((one, k) => one === window.wanted[k]) }; }""")
    assert there == {"missed": [], "hidden": [], "as_they_stand": True}
    page.evaluate("() => { window.wanted[window.wanted.length - 1].focus(); window.order = []; }")
    for _ in range(wanted - 1):
        page.keyboard.press("Shift+Tab")
    back = page.evaluate("""() => window.order.map(([one]) => one).every(
        (one, k) => one === window.wanted[window.wanted.length - 2 - k]) && window.order.length""")
    assert back == wanted - 1


def test_a_phone_scrolls_one_way_and_fits_fingers(opened, home):
    page = opened(home, viewport=PHONE)
    page.wait_for_function("bench.time > 0.3")
    tops = page.evaluate("""['.horn-panel', '.side.command', '.lcd-panel', '.scope-panel', '.traces-panel',
        '.side.load'].map((name) => document.querySelector(name).getBoundingClientRect().top)""")
    assert tops == sorted(tops)
    small = page.evaluate(f"""[...document.querySelectorAll("{MAIN}")].filter((one) => {{
        const box = one.getBoundingClientRect();
        return one.checkVisibility() && Math.min(box.width, box.height) < {LEAST}; }})
        .map((one) => one.outerHTML.slice(0, 100))""")
    assert small == []
    page.evaluate(OPEN_ALL)
    page.get_by_role("button", name="Cursors").click()
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    cut = page.evaluate(f"""[...document.querySelectorAll("{CONTROLS}")].filter((one) => one.checkVisibility()
        && one.getBoundingClientRect().right > {PHONE["width"]} && !one.closest('.scroll')).length""")
    assert cut == 0


def test_what_is_said_is_what_is_shown_and_only_when_asked(page):
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1700})")
    page.evaluate("bench.do('push', 0.4)")
    page.wait_for_function("bench.time > 2.5")
    live = page.evaluate("""() => { window.spoken = 0; const lives = [...document.querySelectorAll(
        '[aria-live]:not([aria-live=off]),[role=status],[role=alert],[role=log],output')];
        for (const one of lives) new MutationObserver((changes) => { window.spoken += changes.length; })
            .observe(one, {subtree: true, childList: true, characterData: true});
        window.angles = 0; new MutationObserver((changes) => { window.angles += changes.length; }).observe(
            document.querySelector('svg.servo0'), {attributeFilter: ['aria-valuenow', 'aria-valuetext']});
        return lives.length; }""")
    assert live >= 2
    page.evaluate("bench.do('command', {shape: 'sine', unit: 'us', mean: 1500, amplitude: 200, frequency: 0.5})")
    page.wait_for_timeout(2500)
    assert page.evaluate("window.spoken") == 0  # numbers that change all the time say nothing by themselves
    assert 2 <= page.evaluate("window.angles") <= 8  # the horn's angle, for who has it under the focus
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1700})")
    page.wait_for_timeout(2000)
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Run").wait_for()
    page.get_by_role("button", name="Say what is shown").click()
    said = page.locator(".words-panel .said").inner_text()
    angle, told = (page.evaluate(f"bench.history[0].latest('{name}') * 180 / Math.PI")
                   for name in ("output_angle", "command_angle"))
    assert said.startswith("Hitec HS-755HB, PulseServo, buzzes at 50 Hz by 0.")
    assert f" degrees at {angle:.1f} degrees, {told - angle:.2f} degrees below its command" in said
    assert page.evaluate("window.spoken") >= 1
    page.locator("summary", has_text="Table of the last two seconds").click()
    page.wait_for_selector(".words-panel tbody tr")
    cells = page.locator(".words-panel tbody tr").last.locator("th,td").all_inner_texts()
    heads = page.locator(".words-panel thead th").all_inner_texts()
    shown = dict(zip(heads, cells, strict=True))
    assert float(shown["time [s]"]) == pytest.approx(page.evaluate("bench.time"), abs=1e-3)
    assert float(shown["angle [°]"]) == pytest.approx(angle, abs=0.06)
    assert page.locator(".words-panel tbody tr").count() == 20


def test_without_motion_the_drawings_change_a_few_times_a_second(opened, home):
    def changes(**options) -> int:
        page = opened(home, **options)
        page.evaluate("bench.do('command', {shape: 'sine', unit: 'us', mean: 1500, amplitude: 200, frequency: 1})")
        page.wait_for_function("bench.time > 1")
        page.evaluate("""() => { window.turns = 0; new MutationObserver(() => { window.turns += 1; }).observe(
            document.querySelector('svg.servo0 .turn'), {attributes: true, attributeFilter: ['transform']}); }""")
        page.wait_for_timeout(2000)
        count = page.evaluate("window.turns")
        page.close()
        return count

    calm, usual = changes(reduced_motion="reduce"), changes()
    assert 2 <= calm <= 8
    assert usual > 3 * calm
