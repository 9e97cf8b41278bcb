"""What a server outlives: crowds, nonsense, browsers that take nothing, and those who come with more than is good."""

import json
import os
import random
import threading
import time
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

from servotwin.web.live.actions import KINDS
from servotwin.web.server.visitor import WORDS
from web_talk import Deaf, Page, framed, running

pytestmark = pytest.mark.slow
SOAK = float(os.environ.get("SERVOTWIN_SOAK", "300"))
"""Bench time of the long run [s]; 3600 is its full length."""
PATIENT = "from servotwin.web.server import messages, serve\nmessages.SLOWEST = serve.PING = 1e5"
MESSAGES = 10_000
TOLERANCE = 0.10  # of memory


@pytest.fixture(scope="module")
def house():
    """Address of a server, and the number of its process."""
    with running() as (address, links):
        yield address, links["pid"]


def memory(pid: int) -> int:
    """Return the memory that a process holds [kB]."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1])
    raise AssertionError("no memory is told")


def answers(page: Page) -> bool:
    """Whether a visitor's bench goes on, and its server answers."""
    before = page.ask(view={})["time"]
    page.pushed(10)
    return page.ask(view={})["time"] > before


def let_in(address: str) -> Page:
    """Return a visitor who is let in, at once or soon."""
    for _ in range(200):
        page = Page(address)
        if "hello" in (page.take(20.0) or {}):
            return page
        page.close()
        time.sleep(0.1)
    raise AssertionError("no place got free")


def test_of_a_hundred_eight_are_served_and_the_rest_told():
    with running() as (address, _):
        pages, told = [], []

        def come() -> None:
            page = Page(address)
            pages.append(page)
            told.append(next(iter(page.take(20.0) or {})))

        threads = [threading.Thread(target=come) for _ in range(100)]
        for one in threads:
            one.start()
        for one in threads:
            one.join(30.0)
        assert sorted(told) == ["full"] * 92 + ["hello"] * 8
        for page in pages:
            page.close()
        again = [let_in(address) for _ in range(8)]  # no place is lost
        assert all(answers(page) for page in again)
        with Page(address) as ninth:
            assert "8 places" in ninth.until("full")["full"]
        for page in again:
            page.close()


def nonsense(rng: random.Random) -> bytes | str:
    """Return a message that says nothing that can be done."""
    words = [*WORDS, "id", "value", "servo"]
    values = [None, True, -1, 0.5, 10 ** 400, -(10 ** 30), 1e308, "", "x" * 300, [], {}, [[[[[[[[]]]]]]]],
              {"a": {"b": {}}}, {"shape": "hold", "unit": "us", "value": "9"}, {"shape": "sine"}, "\ud800",
              "../../etc/passwd", [1] * 50]
    kind = rng.randrange(5)
    if kind == 0:
        return rng.randbytes(rng.randrange(200))
    if kind == 1:
        return json.dumps({rng.choice(words): rng.choice(values) for _ in range(3)})[:rng.randrange(1, 60)]
    if kind == 2:
        return "[" * rng.randrange(2000)
    if kind == 3:
        return json.dumps(rng.choice(values))
    own = {rng.choice(words): rng.choice(values), "value": rng.choice(values), "servo": rng.choice(values),
           "id": rng.choice(values)}
    if own.get("do") is not None or rng.random() < 0.3:
        own["do"] = rng.choice([*KINDS, "fly"])
    return json.dumps(own)


def speak_nonsense(address: str, count: int, seed: int, refused: list[int], wrong: list[str]) -> None:
    rng = random.Random(seed)
    with Page(address) as page:
        page.until("scene")
        for k in range(count):
            page.socket.send(nonsense(rng))
            if k % 20 == 19:  # as fast as is allowed
                time.sleep(0.1)
                page.ask(view={})
        page.ask(view={})
        lines = [text["message"] for text in page.texts if "refused" in text]
    refused.append(len(lines))
    wrong += [line for line in lines if "mistake of servotwin" in line or "\n" in line or len(line) > 310]


def test_ten_thousand_messages_of_nonsense(house):
    address, pid = house
    refused, wrong, heap = [], [], []
    with Page(address) as other:
        for part, count in enumerate((300, MESSAGES // 5)):  # once to warm up
            threads = [threading.Thread(target=speak_nonsense, args=(address, count, 10 * part + k, refused, wrong))
                       for k in range(5)]
            for one in threads:
                one.start()
            while any(one.is_alive() for one in threads):
                other.pushed(20)
                other.pushes.clear()
            heap.append(memory(pid))
        assert answers(other)
    assert len(refused) == 10
    assert sum(refused) > 0.8 * MESSAGES
    assert wrong == []
    assert abs(heap[1] / heap[0] - 1.0) < TOLERANCE


@pytest.mark.parametrize("data", [framed(b"\xff\xfe"), b"\x8f\x80\0\0\0\0", framed(b"x" * 200, 9), b"\xff" * 64])
def test_frames_that_are_none_end_that_visit_alone(house, data):
    with Page(house[0]) as other, Deaf(house[0]) as page:
        page.line.sendall(data)
        assert page.is_cut()
        assert answers(other)
    let_in(house[0]).close()


def test_a_tab_that_is_closed_in_the_middle_of_a_word_leaves_its_place(house):
    address, _ = house
    with Page(address) as other:
        for _ in range(20):
            with Deaf(address) as page:
                page.say(speed="unpaced")
                page.line.sendall(framed(b'{"run": true}')[:5])
        let_in(address).close()
        assert answers(other)


def test_a_message_too_large_ends_that_visit_alone(house):
    address, _ = house
    with Page(address) as other, Page(address) as page:
        page.until("scene")
        with pytest.raises(ConnectionClosed) as closed:
            page.ask(scene="x" * 1_100_000)
        assert closed.value.rcvd.code == 1009
        assert answers(other)


def test_too_many_messages_in_a_second_end_that_visit_alone(house):
    address, _ = house
    with Page(address) as other, Page(address) as page:
        page.until("scene")
        with pytest.raises(ConnectionClosed) as closed:
            hurry(page)
        assert closed.value.rcvd.code == 4008
        assert answers(other)


def hurry(page: Page) -> None:
    """Say more than is listened to, and listen until it ends."""
    for _ in range(5000):
        page.socket.send('{"view":{},"id":1}')
    for _ in range(5000):
        page.take()


@pytest.fixture
def patient():
    """Address of a server that cuts nobody off, and the number of its process."""
    with running(before=PATIENT) as (address, links):
        yield address, links["pid"]


def test_who_reads_nothing_misses_pushes_and_costs_no_memory(patient):
    address, pid = patient
    with Page(address) as page:
        page.ask(speed="unpaced")
        page.pushed(200)
        pace = page.pushes[-1][0]["pace"]  # s of the bench per s
    with Page(address) as other, Deaf(address) as page:
        page.say(speed="unpaced")
        other.pushed(200)
        warm, heap, end = memory(pid), [], time.monotonic() + SOAK / pace
        while time.monotonic() < end:
            other.pushed(30)
            other.pushes.clear()
            heap.append(memory(pid))
        assert answers(other)
        limit = time.monotonic() + 60.0 + SOAK / pace
        while page.time_of_next_push() < SOAK:  # what it has been sent before it was full, then what is now
            assert time.monotonic() < limit
        assert answers(other)
    assert max(abs(one / warm - 1.0) for one in [*heap, memory(pid)]) < TOLERANCE
    let_in(address).close()
