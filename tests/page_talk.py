"""What the tests of the page ask of it."""

import math
import tomllib


def latest(page, name: str, servo: int = 0) -> float:
    """Return the latest value of a signal that the page has (SI)."""
    return page.evaluate(f"bench.history[{servo}].latest('{name}')")


def angle(page, servo: int = 0) -> float:
    """Return the latest angle that the page has [deg]."""
    return page.evaluate(f"bench.history[{servo}].latest('output_angle') * 180 / Math.PI")


def go_on(page, seconds: float) -> None:
    """Wait until the bench, not the wall, has gone on for a time [s]."""
    page.wait_for_function(f"bench.time > {page.evaluate('bench.time') + seconds}")


def come_to_rest(page, servo: int = 0) -> None:
    """Wait until a horn stands: a hand or a frame may come late on a busy machine."""
    before = math.inf
    while abs(angle(page, servo) - before) > 0.2:
        before = angle(page, servo)
        go_on(page, 0.3)


def until(page, time: float) -> None:
    """Wait until the bench has come to a time [s], which takes longer than that on a busy machine."""
    for step in range(1, math.ceil(2.0 * time)):
        page.wait_for_function(f"bench.time >= {0.5 * step}", timeout=60000)
    page.wait_for_function(f"bench.time >= {time}", timeout=60000)


def pause(page) -> None:
    """Stop time, and wait until it stands and all is drawn."""
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Run").wait_for()
    page.wait_for_timeout(300)


def beside(page) -> None:
    """Put the second model beside the first, as the page offers it."""
    page.get_by_role("button", name="Put it beside").click()
    page.wait_for_function("bench.facts.length === 2 && bench.history[1].length > 5")


def scene(page) -> dict:
    """Return the text of the bench, read."""
    return tomllib.loads(page.evaluate("bench.ask({text: true}).then((found) => found.text)"))


def opened_panel(page, title: str) -> None:
    """Open a panel of the side."""
    page.get_by_role("heading", name=title, exact=True).click()
