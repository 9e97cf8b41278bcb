"""A class: one bench, which the teacher steers and others watch."""

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


@pytest.mark.slow
def test_the_forty_first_watcher_is_told(school):
    address, _, code = school
    pages = [Page(address, code) for _ in range(40)]
    for page in pages:
        page.until("hello")
    with Page(address, code) as late:
        assert "40 places" in late.until("full")["full"]
    for page in pages:
        page.close()
