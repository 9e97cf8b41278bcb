"""A server of the page that really runs, in a process of its own."""

import pytest

pytest.importorskip("uvicorn", reason="the extra web is not installed")

from web_talk import running


@pytest.fixture(scope="module")
def server():
    """The address of a server, as http://host:port/."""
    with running() as (address, _):
        yield address
