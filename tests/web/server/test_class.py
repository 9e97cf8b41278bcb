"""A class: one bench, which the teacher steers and others watch."""

import time
from contextlib import ExitStack
from urllib.parse import urlsplit

import pytest

from web_talk import Page, running


@pytest.fixture(scope="module")
def school():
    """Address on this computer, what the teacher's link says, and the code."""
    with running("--host", "0.0.0.0", "--class") as (page, links):
        here = f"http://127.0.0.1:{urlsplit(page).port}/"
        yield here, "?" + urlsplit(links["teacher"]).query, "?code=" + links["code"]


def test_who_watches_sees_the_same_and_steers_nothing(school):
    address, teacher, code = school
    with Page(address, teacher) as teaches, Page(address, code) as watches:
        assert teaches.until("hello")["hello"]["code"] == code[6:]
        assert watches.until("hello")["hello"]["code"] is None
        teaches.ask(do="command", value={"shape": "hold", "unit": "us", "value": 1800.0})
        assert "watching" in watches.ask(do="push", value=1.0)["message"]
        assert "watching" in watches.ask(run=False)["message"]
        watches.pushed(30)
        teaches.pushed(30)
        seen = {header["t"]: parts[0][0].tobytes() for header, parts in watches.pushes}
        both = [(header, parts) for header, parts in teaches.pushes if header["t"] in seen]
        assert len(both) > 10
        assert all(seen[header["t"]] == parts[0][0].tobytes() for header, parts in both)


@pytest.mark.parametrize("query", ["", "?code=", "?code=wrong1", "?teacher=wrong"])
def test_without_the_code_nobody_gets_in(school, query):
    with Page(school[0], query) as page:
        assert "code" in page.until("full")["full"]


@pytest.mark.long
def test_forty_watch_one_stream_and_the_next_is_told(school):
    address, teacher, code = school
    with ExitStack() as stack:
        teaches = stack.enter_context(Page(address, teacher))
        pages = [stack.enter_context(Page(address, code)) for _ in range(40)]
        for page in pages:
            assert page.until("hello")["hello"]["role"] == "watcher"
        with Page(address, code) as late:
            assert "40 places" in late.until("full")["full"]
        teaches.ask(do="command", value={"shape": "sine", "unit": "us", "mean": 1500.0, "amplitude": 200.0,
                                         "frequency": 1.0})
        for page in (teaches, *pages):
            page.pushed(20)
        seen = {}
        for page in (teaches, *pages):
            for header, parts in page.pushes[-20:]:
                rows = b"".join(points.tobytes() + pulses.tobytes() for points, pulses in parts)
                assert seen.setdefault((header["t"], len(rows)), rows) == rows
        assert len(seen) < 200  # with benches of their own there would be 820
    assert comes_in(address, code)


@pytest.mark.long
def test_codes_are_not_tried_out_one_after_the_other(school):
    address, teacher, code = school
    said = [""]
    while len(said) < 900 and "too many at once" not in said[-1]:  # tries grow old: a slow machine takes more
        with Page(address, f"?code=wrong{len(said)}") as page:
            said.append(page.until("full")["full"])
    assert "too many at once" in said[-1]
    with Page(address, teacher) as page:  # who has the teacher's link is not kept out by that
        assert page.until("hello")["hello"]["role"] == "teacher"
    assert comes_in(address, code)


def comes_in(address, code) -> bool:
    """Whether a watcher is let in, at once or soon."""
    for _ in range(100):
        with Page(address, code) as page:
            if "hello" in (page.take() or {}):
                return True
        time.sleep(0.1)
    return False
