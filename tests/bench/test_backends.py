"""The contract of all backends: open, send, read, close; mock, serial port and emulator pass the same tests."""

import itertools
import time

import pytest

from bench_wires import BoardOnTerminal
from servotwin.bench.backends import EmulatedBackend, MockBackend, SerialBackend
from servotwin.bench.emulator.process import harness
from servotwin.bench.wire import Board, Frame, Splitter, protocol, to_wire
from servotwin.errors import BenchError


def mock(made):
    return MockBackend()


def serial(made):
    pytest.importorskip("serial")
    terminal = BoardOnTerminal()
    made.append(terminal.cut)
    return SerialBackend(terminal.port)


def emulator(made):
    try:
        harness()
    except BenchError as error:
        pytest.skip(str(error))
    return EmulatedBackend()


BACKENDS = {"mock": mock, "serial": serial, "emulator": emulator}


@pytest.fixture(params=BACKENDS)
def wire(request):
    made = []
    backend = BACKENDS[request.param](made)
    yield backend
    backend.close()
    for undo in made:
        undo()


def hello(sequence):
    return to_wire(Frame(protocol().kinds["hello"].number, sequence, 0, b""))


def started(wire):
    """Open it, and wait until a board that starts then listens."""
    wire.open()
    while wire.read(0.1):
        pass


def heard(wire, tries=40):
    splitter = Splitter()
    for _ in range(tries):
        for frame in splitter.feed(wire.read(0.05)):
            if frame.kind == protocol().kinds["identity"].number:
                return frame
    raise AssertionError("no answer")


def test_what_is_sent_is_answered(wire):
    started(wire)
    wire.send(hello(9))
    assert heard(wire).payload[:9] == b"\x09servotwn"


def test_bytes_may_come_in_pieces(wire):
    started(wire)
    for byte in hello(3):
        wire.send(bytes([byte]))
    assert heard(wire).payload[0] == 3


def test_reading_ends_when_its_time_is_over(wire):
    started(wire)
    start = time.monotonic()
    assert wire.read(0.05) == b""
    assert time.monotonic() - start < 2.0


def test_a_closed_wire_says_so_in_one_line_and_opens_again(wire):
    for act in (lambda: wire.send(b"x"), lambda: wire.read(0.0)):
        with pytest.raises(BenchError, match="not open"):
            act()
    wire.open()
    wire.close()
    wire.close()
    with pytest.raises(BenchError, match="not open"):
        wire.send(b"x")
    started(wire)
    wire.send(hello(1))
    assert heard(wire).payload[0] == 1


def test_a_board_takes_orders_through_it(wire):
    board = Board(wire)
    assert board.open().mode == "computer"
    edges = []
    board.listen = lambda message: edges.append(message) if message.name == "edge" else None
    board.order("stream", mask=0b0111, rate=protocol().words["rate"]["frame"], reference=0)
    board.order("pulse", width=3000, period=8000)
    for _ in range(200):
        board.take(0.02)
        if len(edges) > 20:
            break
    seen = {(one.values["width"], one.values["period"], len(one.values["counts"])) for one in edges}
    assert seen == {(3000, 8000, 3)}
    steps = {round((b.time - a.time) / protocol().tick) for a, b in itertools.pairwise(edges)}
    assert steps == {8000}
    board.limp()
    assert board.order("ask")["pulsing"] == 0
    board.close()


def test_the_queue_plays_in_order_and_says_when_it_ends(wire):
    board = Board(wire)
    board.open()
    told = []
    board.listen = told.append
    points = [(2, 3000, 8000), (1, 0, 8000), (3, 2000, 10000)]
    board.order("stream", mask=1, rate=protocol().words["rate"]["frame"], reference=0)
    board.order("points", first=0, points=points)
    board.order("play", total=3)
    for _ in range(200):
        board.take(0.02)
        if any(m.name == "event" and m.values["event"] == protocol().words["event"]["ended"] for m in told):
            break
    played = [(m.values["width"], m.values["period"]) for m in told if m.name == "edge"]
    wanted = [(width, period) for frames, width, period in points for _ in range(frames)]
    assert played[:len(wanted)] == wanted
    events = [protocol().word("event", m.values["event"]) for m in told if m.name == "event"]
    assert [one for one in events if one != "reset"] == ["started", "ended"]


def test_a_board_that_hears_nothing_for_a_second_lets_the_servo_go(wire):
    board = Board(wire)
    board.open()
    told = []
    board.listen = told.append
    board.order("stream", mask=1, rate=protocol().words["rate"]["frame"], reference=0)
    board.order("pulse", width=3000, period=40000)
    start = board.time
    for _ in range(400):
        board.take(0.02)  # listens only
        silent = [m for m in told if m.name == "event" and m.values["event"] == protocol().words["event"]["silent"]]
        if silent:
            break
    assert 0.99 < silent[0].time - start < 1.1
    assert max(m.time for m in told if m.name == "edge") <= silent[0].time


def test_ports_that_cannot_be_used_are_told_in_one_line(tmp_path):
    pytest.importorskip("serial")
    (tmp_path / "file").write_text("")
    for port, said in (("/dev/ttyNONE", "no such port"), (str(tmp_path / "file"), "no serial port"),
                       (str(tmp_path), "folder")):
        with pytest.raises(BenchError, match=said) as caught:
            SerialBackend(port).open()
        assert "\n" not in str(caught.value)


def test_a_port_that_is_taken_is_told(tmp_path):
    pytest.importorskip("serial")
    terminal = BoardOnTerminal()
    first, second = SerialBackend(terminal.port), SerialBackend(terminal.port)
    first.open()
    with pytest.raises(BenchError, match="another program"):
        second.open()
    first.close()
    terminal.cut()


def test_a_cable_that_is_pulled_is_told(tmp_path):
    pytest.importorskip("serial")
    terminal = BoardOnTerminal()
    board = Board(SerialBackend(terminal.port))
    board.open()
    terminal.cut()
    with pytest.raises(BenchError):
        board.wait(10.0)
    board.limp()
    board.close()


class _Other(MockBackend):
    """A board with another firmware."""

    def _tell(self, what, /, **values):
        super()._tell(what, **(values | {"name": "blink"} if what == "identity" else values))


class _Babble(MockBackend):
    """Something that talks, but not so."""

    def read(self, timeout):
        super().read(timeout)
        return b"hello world\r\n\0"


class _Mute(MockBackend):
    def read(self, timeout):
        super().read(timeout)
        return b""


@pytest.mark.parametrize(("backend", "said"), [(_Other, "another firmware.*blink"), (_Babble, "not as the firmware"),
                                               (_Mute, "no answer")])
def test_what_is_not_the_bench_is_told_in_one_line(backend, said):
    with pytest.raises(BenchError, match=said):
        Board(backend()).open()
