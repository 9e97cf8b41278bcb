"""A log that is dropped on the page: its twin beside it, a fit begun and ended there, and its servo on the bench."""

import re

import pytest

from page_talk import angle, go_on, opened_panel, scene

pytestmark = pytest.mark.slow
LONG = 120000  # ms: compiling may be among it
DROP = """([name, text]) => {
    const data = new DataTransfer();
    data.items.add(new File([text], name, {type: 'text/csv'}));
    document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true, cancelable: true}));
}"""
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


def drop(page, name: str, text: str) -> None:
    page.evaluate(DROP, [name, text])


def table(page) -> str:
    return page.evaluate("bench.ask({export: 'csv', servo: 0}).then((found) => found.file.text)")


def said(page, where: str = "own") -> str:
    return page.locator(f".side.{where} p.said").inner_text()


def rms(page) -> float:
    return float(page.locator(".log-panel").get_attribute("data-rms"))


def moved(page) -> str:
    """Let the bench make some steps; return its table."""
    page.evaluate("bench.do('command', {shape: 'step', unit: 'us', low: 1400, high: 1650, period: 0.8})")
    go_on(page, 2.0)
    return table(page)


def test_a_log_is_dropped_fitted_and_taken_over(opened, server, tools):
    page = opened(server)
    log = moved(page)
    drop(page, "mine.csv", log)
    page.wait_for_selector(".log-panel:not([hidden]) canvas", timeout=LONG)
    assert rms(page) < 1e-6
    assert float(re.match(r"mine: ([\d.]+) s", said(page)).group(1)) >= 2.0
    assert "output angle [°]" in page.locator(".side.own table").inner_text()
    page.evaluate("bench.do('set', {'motor.rotor_inertia': 2.5e-7})")  # the bench is another one now than the log's
    page.get_by_role("button", name="Compare", exact=True).click()
    page.wait_for_function("Number(document.querySelector('.log-panel').dataset.rms) > 0.1", timeout=LONG)
    assert "at worst by" in page.locator(".log-panel p.said").inner_text()
    opened_panel(page, "Fit a servo to the log")
    boxes = page.locator(".side.fit fieldset input")
    boxes.first.wait_for()
    for box in boxes.all():
        box.set_checked(box.get_attribute("value") == "output_inertia")
    page.get_by_label("Look for causes").uncheck()
    page.get_by_role("button", name="Fit", exact=True).click()
    page.locator(".side.fit progress").wait_for(timeout=LONG)
    page.wait_for_selector(".found-panel:not([hidden]) .verdict", timeout=LONG)
    assert "Fitted in" in said(page, "fit")
    row = page.locator(".found-panel tr", has_text="output_inertia").inner_text()
    page.evaluate((tools / "axe-core/axe.min.js").read_text())
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    found = page.evaluate("(rules) => axe.run(document, {runOnly: rules, resultTypes: ['violations']})", RULES)
    assert [(one["id"], one["nodes"][0]["html"][:100]) for one in found["violations"]] == []
    before = page.evaluate("bench.facts.length")
    page.get_by_role("button", name="Take over beside").click()
    page.wait_for_function(f"bench.facts.length === {before + 1}")
    inertia = page.evaluate("bench.facts.at(-1).parameters.find((one) => one.name === 'motor.rotor_inertia').value")
    truth = 7.65306e-8  # kg m2, of the file of the paper's servo, with which the log was made
    assert inertia == pytest.approx(truth, rel=0.1), row
    page.get_by_role("button", name="Play its command on the bench").click()
    page.wait_for_selector(".sample.log")
    go_on(page, 1.0)
    assert scene(page)["actions"][-1][2]["shape"] == "recorded"
    assert 1.0 < angle(page) < 180.0


def test_a_table_of_the_bench_lies_over_its_twin_and_is_played(opened, home):
    page = opened(home)
    drop(page, "mine.csv", moved(page))
    page.wait_for_selector(".log-panel:not([hidden]) canvas", timeout=LONG)
    assert rms(page) < 1e-4
    assert float(re.match(r"mine: ([\d.]+) s", said(page)).group(1)) >= 2.0
    assert "output angle [°]" in page.locator(".side.own table").inner_text()
    page.evaluate("bench.do('set', {'motor.rotor_inertia': 2.5e-7})")  # the bench is another one now than the log's
    page.get_by_role("button", name="Compare", exact=True).click()
    page.wait_for_function("Number(document.querySelector('.log-panel').dataset.rms) > 0.1", timeout=LONG)
    page.get_by_role("button", name="Play its command on the bench").click()
    page.wait_for_selector(".sample.log")
    assert scene(page)["actions"][-1][2]["shape"] == "recorded"
    page.get_by_role("button", name="Let it go").click()
    assert page.locator(".log-panel").is_hidden()
    for name, text, words in (("empty.csv", "", "an empty file"), ("odd.csv", "a,b\n1,2\n3,4\n", "allowed:"),
                              ("large.csv", "0" * 21_000_000, "21.0 MB")):
        drop(page, name, text)
        page.wait_for_function("(line) => document.querySelector('.side.own p.said').textContent.includes(line)",
                               arg=words)
        assert "\n" not in said(page)
        assert page.locator(".log-panel").is_hidden()


def test_a_fit_is_cancelled_and_the_next_one_begins(opened, server):
    page = opened(server)
    drop(page, "mine.csv", moved(page))
    page.wait_for_selector(".log-panel:not([hidden]) canvas", timeout=LONG)
    opened_panel(page, "Fit a servo to the log")
    page.locator(".side.fit fieldset input").first.wait_for()
    begin, stop = (page.get_by_role("button", name=name, exact=True) for name in ("Fit", "Cancel the fit"))
    for _ in range(2):
        begin.click()
        page.wait_for_function("document.querySelector('.side.fit progress').value >= 0"
                               " && !document.querySelector('.side.fit progress').hidden")
        stop.click()
        page.wait_for_function("document.querySelector('.side.fit p.said').textContent.includes('cancelled')")
        assert stop.is_disabled()


@pytest.mark.parametrize(("name", "text", "line"), [
    ("empty.csv", "", "an empty file"), ("odd.csv", "a,b\n1,2\n3,4\n", "no time"),
    ("large.csv", "0" * 21_000_000, "21.0 MB")])
def test_what_is_wrong_with_a_log_is_told_in_a_line(opened, server, name, text, line):
    page = opened(server)
    drop(page, name, text)
    page.wait_for_function("(line) => document.querySelector('.side.own p.said').textContent.includes(line)", arg=line)
    assert "\n" not in said(page)
    assert page.locator(".log-panel").is_hidden()


def test_words_for_columns_are_typed_and_read(opened, server):
    page = opened(server)
    rows = "".join(f"{20 * k},{1500 + 100 * (k > 9)},{min(max(k - 12, 0), 10) + 90}\n" for k in range(60))
    drop(page, "odd.csv", f"a,b,c\n{rows}")
    page.wait_for_selector(".side.own input[type=text]")
    page.get_by_label("What its columns mean").fill("time=a:ms command=b:us angle=c:deg")
    page.get_by_role("button", name="Read again").click()
    page.wait_for_selector(".log-panel:not([hidden]) canvas", timeout=LONG)
    assert "60 rows, commanded by pulses from 1500 to 1600 µs" in said(page)
