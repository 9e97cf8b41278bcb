"""A server does not wait for ever: for those who say nothing, who sleep, or who come with what takes long.

Its times are those of a server that is in a hurry, so that this does not take long either.
"""

import json
import socket
import threading
import time
import zlib
from base64 import urlsafe_b64encode
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from web_talk import Deaf, Page, running

pytestmark = pytest.mark.slow
HURRY = """
from servotwin.web.server import serve, session
session.LONGEST_ASIDE, serve.PATIENCE, serve.MOST_CONNECTIONS, serve.PING, session.PATIENCE = 3.0, 1.0, 60, 2.0, 0.3
"""
SERVO = 'format = 1\n{}[[servo]]\nid = "hitec-hs-755hb"\n'
STIFF = SERVO.format("") + 'model = "PulseServoInductive"\nparameters = {"motor.rotor_inertia" = 1e-13, ' \
    '"motor.armature_inductance" = 1e-9}\n[load]\nmass = 0.1\narm = 0.1\n'
SOON = 20.0  # s: it is over long before


@pytest.fixture(scope="module")
def house():
    """Address of a server in a hurry, and the number of its process."""
    with running(before=HURRY) as (address, links):
        yield address, links["pid"]


@pytest.fixture
def other(house):
    """The times of the pushes of a visitor whose bench goes on, whatever the others do."""
    times, leaves = [], threading.Event()

    def watch() -> None:
        with Page(house[0]) as page:
            while not leaves.is_set():
                page.take(SOON)
                times.extend(header["t"] for header, _ in page.pushes)
                page.pushes.clear()

    watching = threading.Thread(target=watch)
    watching.start()
    goes_on(times)
    start = time.monotonic(), times[-1]
    yield times
    wall, bench = time.monotonic() - start[0], times[-1] - start[1]
    goes_on(times)
    leaves.set()
    watching.join(SOON)
    assert not watching.is_alive()
    assert bench > 0.2 * wall - 0.5  # it never stood


def goes_on(times: list[float]) -> None:
    """Wait until more pushes have come."""
    before = len(times)
    soon(lambda: len(times) > before + 20, "the other bench stands")


def threads(pid: int) -> int:
    """Return how many threads a process has."""
    return len(list(Path(f"/proc/{pid}/task").iterdir()))


def soon(holds, what: str) -> None:
    """Wait until something holds."""
    limit = time.monotonic() + SOON
    while not holds():
        assert time.monotonic() < limit, what
        time.sleep(0.05)


def let_in(address: str) -> Page | None:
    """Return a visitor who is let in; None if there is no place."""
    page = Page(address)
    if "hello" in (page.take(20.0) or {}):
        return page
    page.close()
    return None


def test_a_laptop_that_sleeps_loses_its_place(house, other):
    with ExitStack() as stack:
        sleeping = [stack.enter_context(Deaf(house[0])) for _ in range(7)]
        for page in sleeping[:3]:
            page.say(run=False)  # nothing is sent that it would have to take
        found = []
        soon(lambda: found.append(let_in(house[0])) or found[-1] is not None, "no place got free")
        found[-1].close()


def test_who_connects_and_says_nothing_is_cut(house, other):
    own = urlsplit(house[0])
    for words in (b"", b"GET / HTTP/1.1\r\nHost: x\r\n", b"GET /live HTTP/1.1\r\nX: "):
        with socket.create_connection((own.hostname, own.port), SOON) as line:
            line.sendall(words)
            assert ended(line)


def test_one_connection_too_many_is_cut_and_the_rest_stay(house, other):
    own = urlsplit(house[0])
    with ExitStack() as stack:
        lines = [stack.enter_context(socket.create_connection((own.hostname, own.port), SOON)) for _ in range(90)]
        assert all(ended(line) for line in lines[75:])


def ended(line: socket.socket) -> bool:
    """Whether a server ends a connection before long."""
    line.settimeout(SOON)
    try:
        while line.recv(4096):
            pass
    except ConnectionError:
        return True
    except TimeoutError:
        return False
    return True


def test_a_bench_that_takes_too_long_stands_and_the_others_go_on(house, other):
    with Page(house[0]) as page:
        page.until("scene")
        assert "done" in page.ask(scene=STIFF)
        assert "done" in page.ask(do="command", value={"shape": "hold", "unit": "us", "value": 1700.0})
        assert "to compute" in page.until("said", SOON)["said"]
        assert "to compute" in page.ask(run=True)["message"]
        assert "done" in page.ask(lesson="deadband")  # it can be another
        page.pushed(20)


DOTTED = "a." * 200_000 + "a = 1"
BOMB = "#" * 17_000_000


@pytest.mark.parametrize(("message", "said"), [
    ({"scene": DOTTED}, "nested"), ({"scene": "a = " + "[" * 100_000}, "nested"),
    ({"fragment": urlsafe_b64encode(zlib.compress(BOMB.encode(), 9)).decode()}, "too long"),
    ({"scene": SERVO.format("actions = [" + '[0, "command", {shape = "step", unit = "us", low = 1400, high = 1500, '
                            'period = 0.01}],' * 9000 + "]\n")}, "more than 3 s"),
    ({"scene": "x" * 999_000}, "TOML")])
def test_what_takes_long_to_read_ends_and_the_others_go_on(house, other, message, said):
    address, pid = house
    before = threads(pid)
    with Page(address) as page:
        page.until("scene")
        answer = page.ask(**message)
        assert said in answer["message"]
        assert "done" in page.ask(view={})
    soon(lambda: threads(pid) <= before, "a thread goes on")


def test_many_actions_at_an_instant_hold_up_nobody(house, other):
    many = ",".join('[0.5,"set",{"load.inertia"=1e-4}]' for _ in range(20_000))
    with Page(house[0]) as page:
        page.until("scene")
        assert "done" in page.ask(scene=SERVO.format(f"end = 1.0\nactions = [{many}]\n")), page.texts[-1]
        limit = time.monotonic() + SOON
        while not page.pushes or page.pushes[-1][0]["t"] < 1.0:
            assert time.monotonic() < limit
            page.pushes.clear()
            page.pushed(1)


def test_files_are_made_one_at_a_time_and_end_with_their_visitor(house, other):
    address, pid = house
    before = threads(pid)
    with Page(address) as page:
        page.until("scene")
        page.ask(speed="unpaced")
        page.pushed(300)
        page.ask(speed=1.0)
        page.socket.send(json.dumps({"export": "csv", "id": 1001}))
        page.socket.send(json.dumps({"export": "csv", "id": 1002}))
        assert page.until("refused")["refused"] == 1002
        assert "done" in page.ask(do="push", value=0.1)  # and steers meanwhile
        assert threads(pid) > before
    soon(lambda: threads(pid) <= before, "the export goes on")
