"""Frames and messages: what goes in comes out, what is bent does not, and all is counted."""

import itertools
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from servotwin.bench.backends import MockBackend
from servotwin.bench.wire import Board, Clock, Frame, Splitter, from_wire, protocol, to_wire
from servotwin.bench.wire.frames import stuffed, unstuffed
from servotwin.errors import BenchError, InputError

PAYLOADS = st.binary(max_size=72)


@given(st.binary(max_size=600))
def test_stuffing_has_no_zero_and_comes_back(data):
    wire = stuffed(data)
    assert 0 not in wire
    assert unstuffed(wire) == data
    assert len(wire) <= len(data) + len(data) // 254 + 1


@given(PAYLOADS, st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_a_frame_comes_back(payload, sequence, time):
    frame = Frame(0x85, sequence, time, payload)
    assert from_wire(to_wire(frame).strip(b"\0")) == frame


@given(st.lists(PAYLOADS, min_size=1, max_size=5), st.integers(1, 40))
def test_frames_come_back_in_whatever_pieces_the_bytes_arrive(payloads, size):
    frames = [Frame(2, k, 0, payload) for k, payload in enumerate(payloads)]
    wire = b"".join(map(to_wire, frames))
    splitter = Splitter()
    assert [one for k in range(0, len(wire), size) for one in splitter.feed(wire[k:k + size])] == frames
    assert (splitter.bad, splitter.lost) == (0, 0)


def test_of_frames_with_one_bent_byte_in_a_thousand_none_is_accepted_and_all_are_counted():
    rng = random.Random(1)
    sent, seen, bent_frames, splitter = [], [], 0, Splitter()
    for k in range(20_000):
        frame = Frame(0x85, k % 256, k, rng.randbytes(rng.randrange(72)))
        wire = bytearray(to_wire(frame))
        bent = [at for at in range(1, len(wire) - 1) if rng.random() < 1e-3]
        for at in bent:
            wire[at] ^= rng.randrange(1, 256)
        bent_frames += bool(bent)
        if not bent:
            sent.append(frame)
        seen += splitter.feed(bytes(wire))
    assert bent_frames > 500
    assert seen == sent
    assert splitter.lost == bent_frames
    assert splitter.bad >= bent_frames  # a byte bent to 0 makes two pieces


@pytest.mark.parametrize("seed", range(3))
def test_noise_on_the_wire_neither_stops_nor_fools_either_side(seed):
    rng = random.Random(seed)
    mock, splitter = MockBackend(), Splitter()
    mock.open()
    for _ in range(2000):
        noise = rng.randbytes(rng.randrange(1, 120)) + b"\0" * rng.randrange(2)
        assert splitter.feed(noise) == []
        mock.send(noise)
    mock.send(b"\0")
    mock.close()
    mock.open()
    assert Board(_Opened(mock)).open().mode == "computer"


def test_whole_frames_with_nonsense_inside_are_answered_and_do_no_harm():
    rng = random.Random(5)
    mock = MockBackend()
    board = Board(mock)
    board.open()
    for k in range(3000):
        mock.send(to_wire(Frame(rng.randrange(256), k % 256, rng.randrange(2**32), rng.randbytes(rng.randrange(73)))))
        board.take(0.0)
    assert board.order("ask")["bad"] == 0
    assert board.order("limp")["result"] == 0


class _Opened:
    """A backend that is open already."""

    def __init__(self, backend):
        self.backend = backend
        self.name, self.send, self.read, self.close = backend.name, backend.send, backend.read, backend.close

    def open(self):
        pass


def test_time_goes_on_where_its_ticks_wrap():
    board = Board(MockBackend(start=2**32 - protocol().ticks(0.5)))
    times = []
    board.listen = lambda message: times.append(message.time)
    board.open()
    board.order("stream", mask=1, rate=1, reference=0)
    board.order("pulse", width=3000, period=40000)
    for _ in range(60):
        board.take(0.02)
        board.order("ask")
    edges = times[-40:]
    assert edges[-1] > 1.0
    assert all(abs(b - a - 0.02) < 1e-9 for a, b in itertools.pairwise(edges))


def test_looks_at_the_clock_may_be_a_little_out_of_order():
    clock = Clock()
    assert clock.seconds(100) == 0.0
    assert clock.seconds(50) == -50 * protocol().tick
    assert clock.seconds(200) == 100 * protocol().tick


ORDERS = [
    ("pulse", {"width": 100, "period": 40000}, "range"),
    ("pulse", {"width": 3000, "period": 60000}, "range"),
    ("pulse", {"width": 5900, "period": 6006}, "range"),
    ("points", {"first": 3, "points": [(1, 3000, 40000)]}, "order"),
    ("points", {"first": 0, "points": [(0, 3000, 40000)]}, "range"),
    ("play", {"total": 1}, "range"),
    ("stream", {"mask": 255, "rate": 1, "reference": 0}, "range"),
]


@pytest.mark.parametrize(("name", "values", "result"), ORDERS)
def test_the_board_refuses_what_it_cannot_do(name, values, result):
    board = Board(MockBackend())
    board.open()
    with pytest.raises(BenchError, match=result):
        board.order(name, **values)


def test_points_whose_answer_was_lost_are_not_taken_twice():
    mock = MockBackend()
    board = Board(mock)
    board.open()
    points = {"first": 0, "points": [(1, 3000, 40000), (2, 0, 40000)]}
    board.order("points", **points)
    assert board.order("points", **points)["value"] == 2


@pytest.mark.parametrize("values", [{}, {"width": 1}, {"width": 70000, "period": 1}, {"width": "x", "period": 1},
                                    {"width": 1, "period": 1, "more": 1}])
def test_a_message_says_which_field_does_not_fit(values):
    with pytest.raises(InputError, match="pulse"):
        protocol().kinds["pulse"].pack(values)


def test_the_text_of_the_protocol_is_one():
    kinds = protocol().kinds
    assert len({kind.number for kind in kinds.values()}) == len(kinds)
    for kind in kinds.values():
        assert kind.sender in ("computer", "board")
        assert kind.answer in ("", *kinds)
        assert kind.text
        assert kind.sender == "board" or kind.answer
        assert all(one.text or one.name in ("minor", "mode") for one in kind.fields)
