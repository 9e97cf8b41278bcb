"""The page's files: all of them and nothing else, and none twice."""

import http.client
import re
from urllib.parse import urlsplit

import pytest


def answer(server: str, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of what is asked for."""
    line = http.client.HTTPConnection(urlsplit(server).netloc, timeout=20)
    line.request("GET", path, headers=headers)
    got = line.getresponse()
    found = got.status, {name.lower(): value for name, value in got.getheaders()}, got.read()
    line.close()
    return found


def test_a_browser_asks_for_all_modules_at_once_and_for_none_again(server):
    status, headers, page = answer(server, "/")
    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    links = re.findall(r"<([^>]+)>; rel=modulepreload", headers["link"])
    assert len(links) > 20
    named = {*links, *re.findall(r'(?:src|href)="(/page/[^"]+)"', page.decode())}
    for name in named:
        status, headers, _ = answer(server, name)
        assert (status, headers["cache-control"]) == (200, "no-cache"), name
        assert headers["content-type"].startswith(("text/javascript", "text/css", "image/svg+xml")), name
        status, again, rest = answer(server, name, **{"If-None-Match": headers["etag"]})
        assert (status, again["etag"], rest) == (304, headers["etag"], b""), name


def test_every_module_that_a_module_wants_is_there(server):
    _, headers, _ = answer(server, "/")
    links = set(re.findall(r"<([^>]+)>; rel=modulepreload", headers["link"]))
    for name in links:
        text = answer(server, name)[2].decode()
        wanted = re.findall(r'^(?:import|export)[^;]*? from "\./([^"]+)"', text, re.MULTILINE)
        assert {name.rpartition("/")[0] + "/" + one for one in wanted} <= links, name


@pytest.mark.long(but="/page/")
@pytest.mark.parametrize("path", ["/page/../server/app.py", "/page/%2e%2e/server/app.py", "/page/js/../../__init__.py",
                                  "/page//etc/passwd", "/page/", "/page/js", "/page/js/main.js%00", "/page/C:\\x"])
def test_what_is_no_file_of_the_page_is_not_found(server, path):
    assert answer(server, path)[0] == 404
