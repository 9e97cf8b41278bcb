"""The server: what it says, what it refuses, and whom it lets in."""

import json
import urllib.error
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from servotwin.web.live import read_fragment, replay
from web_talk import Page, running


def test_the_page_gets_what_the_bench_shows_and_a_script_repeats_it(server):
    with Page(server) as page:
        assert page.until("hello")["hello"]["role"] == "own"
        assert [one["model"] for one in page.until("scene")["scene"]["servos"]] == ["PulseServo"]
        page.ask(do="command", value={"shape": "hold", "unit": "us", "value": 1700.0})
        page.pushed(20)
        page.ask(do="push", value=0.3)
        page.ask(do="set", value={"electronics.deadband": 2e-5, "load.inertia": 3e-4})
        page.pushed(20)
        page.ask(run=False)
        page.pushed(1)
        said = page.ask(text=True)
        run = replay(said["text"], output_step=1e-3)
        assert read_fragment(said["fragment"]).text() == said["text"]
        points = np.concatenate([parts[0][0] for _, parts in page.pushes])
        column = page.pushes[0][0]["servos"][0]["columns"].index("output_angle")
        end = points[-1]
        assert run[0]["time"][-1] == pytest.approx(end[0], abs=1e-12)
        assert run[0]["output_angle"][-1] == pytest.approx(end[column], abs=1e-9)


def test_slow_motion_pause_and_single_frames(server):
    with Page(server) as page:
        page.ask(run=False)
        page.pushed(1)
        before = page.pushes[-1][0]["t"]
        for _ in range(3):
            page.ask(step=True)
        page.pushed(1)
        edge = page.ask(step=True)["time"]
        assert edge > before
        assert edge * 50.0 == pytest.approx(round(edge * 50.0), abs=1e-9)  # it stands at an edge
        page.ask(speed=1e-4)
        page.ask(run=True)
        page.pushed(30)
        assert 0.0 < page.pushes[-1][0]["t"] - edge < 1e-3
        assert page.pushes[-1][0]["pace"] == pytest.approx(1e-4, rel=0.3)


def opened(request):
    """Return status, headers and body of an answer."""
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers, error.read()


@pytest.mark.parametrize("message", [
    {"do": "command", "value": {"shape": "hold", "unit": "deg", "value": 999.0}}, {"do": "fly", "value": 1},
    {"do": "push", "value": "much"}, {"do": "set", "value": {"motor.foo": 1.0}},
    {"do": "set", "value": {"gear.gear_reduction": -1.0}}, {"speed": 0}, {"speed": 1e9}, {"run": 1},
    {"step": True, "run": True}, {}, {"scene": "not toml ["}, {"scene": "format = 1"}, {"fragment": "xx"},
    {"scene": 'format = 1\n[[servo]]\nid = "../../etc/passwd"'}, {"servos": "all"}, {"servos": [{"keep": 9}]},
    {"lesson": "nonsense"}, {"mystery": -1}, {"guess": {}},
    {"export": "exe"}, {"view": {"a": [1]}}, {"do": "register", "value": {"P_Coefficient": 1}},
    {"do": "frames", "value": {"rate": 0}}])
def test_what_cannot_be_done_is_refused_in_a_line(server, message):
    with Page(server) as page:
        answer = page.ask(**message)
        assert answer["refused"] == 1
        assert 10 < len(answer["message"]) <= 310
        assert "\n" not in answer["message"]
        assert "Traceback" not in answer["message"]
        assert "done" in page.ask(view={})  # and the bench goes on


@pytest.mark.parametrize("text", ["", "[]", "{", "nul", '{"run": NaN}', '{"speed": 1e999}', "[" * 5000,
                                  '{"a":' * 50 + "1" + "}" * 50])
def test_what_is_no_message_is_refused_in_a_line(server, text):
    with Page(server) as page:
        page.socket.send(text)
        assert page.until("refused")["message"]


@pytest.mark.long
def test_the_ninth_visitor_is_told_and_a_place_gets_free():
    with running() as (address, _):
        pages = [Page(address) for _ in range(8)]
        for page in pages:
            page.until("hello")
        with Page(address) as ninth:
            assert "8 places" in ninth.until("full")["full"]
            with pytest.raises(ConnectionClosed) as closed:
                ninth.take()
            assert closed.value.rcvd.code == 4008
        pages.pop().close()
        for _ in range(50):
            with Page(address) as again:
                if "hello" in (again.take() or {}):
                    break
        else:
            raise AssertionError("no place got free")
        for page in pages:
            page.close()


@pytest.mark.parametrize(("headers", "status"), [
    ({"Host": "evil.example"}, 403), ({"Origin": "https://evil.example"}, 403), ({"Origin": "null"}, 403), ({}, 200)])
def test_foreign_hosts_and_pages_are_refused(server, headers, status):
    request = urllib.request.Request(server, headers=headers)
    assert opened(request)[0] == status
    if status == 200:
        return
    own = headers.get("Origin")
    options = {"additional_headers": {"Host": headers["Host"]}} if own is None else {"origin": own}
    with pytest.raises((InvalidStatus, ConnectionClosed)):
        refused(server, options)


def refused(server, options):
    with Page(server, **options) as page:
        page.take()


@pytest.mark.parametrize("path", ["page/../app.py", "page/%2e%2e/app.py", "page/..%2fserver%2fapp.py",
                                  "page//etc/passwd", "api/curves/..%2f..", "page"])
def test_no_path_reaches_a_file(server, path):
    assert opened(server + path)[0] in (404, 405)


@pytest.mark.long
def test_answers_say_what_a_browser_may_do(server):
    _, headers, _ = opened(server)
    assert "default-src 'none'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.long
def test_the_catalog_and_its_curves(server):
    catalog = json.loads(opened(server + "api/catalog")[2])
    curves = json.loads(opened(server + "api/curves/hitec-hs-755hb")[2])
    assert len(catalog) > 50
    assert curves["torque"][0] > 1.0 > curves["torque"][-1] == 0.0
