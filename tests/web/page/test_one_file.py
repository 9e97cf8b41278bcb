"""The page as one file at a plain server of files: asked for once, it asks for nothing more."""

import functools
import http.server
import threading
import urllib.parse
from pathlib import Path

import pytest

from page_talk import angle, go_on, scene

pytestmark = pytest.mark.slow
LONGEST_LINK = 4096  # characters


@pytest.fixture
def shelf(bench_file):
    """A server of the folder of the file; its address, and all that it was asked for."""
    path, asked = Path(urllib.parse.urlsplit(bench_file).path), []

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_) -> None:
            asked.append(self.path)

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler, directory=path.parent)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/{path.name}", asked
        server.shutdown()
        thread.join()


def test_it_is_asked_for_once_and_its_link_is_short(opened, shelf):
    address, asked = shelf
    page = opened(address)
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1750})")
    page.evaluate("bench.do('set', {'electronics.deadband': 1e-5, 'load.torque': 0.1})")
    go_on(page, 1.0)
    link = page.evaluate("bench.ask({text: true}).then((found) => found.fragment)")
    assert len(link) < LONGEST_LINK
    there, time = angle(page), page.evaluate("bench.time")
    page.evaluate("bench.ask({run: false})")
    again = opened(f"{address}#{page.evaluate('bench.ask({text: true}).then((found) => found.fragment)')}")
    again.wait_for_function(f"bench.time >= {time} && !bench.header.replaying")
    assert abs(angle(again) - there) < 1.0
    assert len(scene(again)["actions"]) == 3
    assert asked == ["/bench.html"] * 2


def test_a_link_that_is_pasted_into_the_open_page_acts(opened, home):
    page = opened(home)
    page.evaluate("location.hash = '#lesson=deadband'")
    page.wait_for_selector(".lesson h2")
    assert page.locator(".lesson h2").inner_text() == "A servo that is content"


def test_what_only_a_server_can_is_said_and_so_is_a_browser_that_cannot(opened, browser, bench_file):
    page = opened(bench_file)
    said = page.locator(".alone-says").text_content()
    assert "servotwin web" in said
    assert "fits" in said
    assert page.evaluate("bench.ask({fit: {plan: true}}).catch((error) => error.message)") == (
        "only with the server: servotwin web")
    old = browser.new_page()
    old.add_init_script("delete self.WebAssembly;")
    old.goto(bench_file)
    old.wait_for_selector("#notice:not([hidden])")
    assert "WebAssembly" in old.locator("#notice").inner_text()
    old.close()


def test_a_motion_that_takes_too_long_stands_and_the_page_goes_on(opened, bench_file):
    page = opened(bench_file)
    stiff = """format = 1
[[servo]]
id = "hitec-hs-755hb"
model = "PulseServoInductive"
parameters = {"motor.rotor_inertia" = 1e-13, "motor.armature_inductance" = 1e-9}
[load]
mass = 0.1
arm = 0.1
"""
    page.evaluate("(text) => bench.ask({scene: text})", stiff)
    page.evaluate("bench.do('command', {shape: 'hold', unit: 'us', value: 1800})")
    page.wait_for_selector("#notice:not([hidden])")
    assert page.locator("#notice").inner_text().startswith("the bench stands: motion: got 'one that takes too long")
    assert "allowed: a new beginning" in page.evaluate("bench.ask({run: true}).catch((error) => error.message)")
    page.evaluate("bench.ask({lesson: 'deadband'})")
    go_on(page, 0.2)
