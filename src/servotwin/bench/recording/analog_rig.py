"""The bench of a servo that takes pulses: a board sends them, and reads tap, shunt and supply."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from servotwin.bench.backends.board_backend import Backend
from servotwin.bench.recording.bench_wiring import SIGNALS, Wiring
from servotwin.bench.recording.experiment import Experiment, Hold
from servotwin.bench.wire.board import Board, Identity, Message
from servotwin.bench.wire.frames import protocol
from servotwin.errors import BenchError, InputError

_BATCH = 10  # points of one message
_SETTLE, _STILL, _LOOK = 5.0, 2.0, 0.2  # s: longest wait, and counts that a tap at rest may move between two looks
_PATIENCE = 1.0  # s without a row until the board is asked how it does
_COUNT = 1e-7  # s, well below a tick
_ALIVE = 0.25  # s between two signs of life


class AnalogRig:
    """A servo at a board.

    Parameters
    ----------
    backend : Backend
    wiring : Wiring, optional
        The one of the guide unless given.
    rate : {"fast", "frame"}
        Channels are read at 1 kHz, or once a frame at its rising edge.

    Raises
    ------
    InputError
        If there is no such rate.

    Examples
    --------
    >>> from servotwin.bench.backends import MockBackend
    >>> rig = AnalogRig(MockBackend(), rate="frame")
    >>> rig.open().mode
    'computer'
    >>> holds = [Hold(0.06, 1.5e-3), Hold(0.02, None)]
    >>> rows = list(rig.run(Experiment(name="a", motion="a", kind="pulse_width", holds=holds)))
    >>> [round(row[0], 9) for row in rows], [row[1] for row in rows]
    ([0.0, 0.02, 0.04, 0.06], [1500.0, 1500.0, 1500.0, nan])
    >>> rig.close()
    """

    kind = "pulse_width"

    def __init__(self, backend: Backend, wiring: Wiring | None = None, *, rate: str = "fast") -> None:
        if rate not in ("fast", "frame"):
            raise InputError("rate", got=rate, allowed="fast, frame")
        self.wiring = wiring or Wiring()
        self.rate = rate
        self.board = Board(backend, self._heard)
        self.identity: Identity | None = None
        self._messages: deque[Message] = deque()

    def open(self) -> Identity:
        """Take the wire; the servo is limp.

        Raises
        ------
        BenchError
            If there is no board with the firmware of the bench.
        """
        self.identity = self.board.open()
        if self.identity.mode != "computer":
            self.board.order("mode", mode=protocol().words["mode"]["computer"])
        self.board.order("limp")
        self._stream("off")
        return self.identity

    @property
    def columns(self) -> Sequence[str]:
        """Of its rows."""
        return ("time_s", "pulse_width_us", *(SIGNALS[name] for name in self.wiring.order))

    def facts(self) -> Mapping[str, Any]:
        """Return firmware, wiring and rate, and what was lost so far."""
        words = protocol()
        return {"rig": "analog", "port": self.board.backend.name, "wiring": self.wiring.facts(), "rate": self.rate,
                "firmware": None if self.identity is None else self.identity.firmware,
                "protocol": int(words.numbers["version"]),
                "channel_times_us": {name: 1e6 * words.tick * k * words.numbers["channel_ticks"]
                                     for k, name in enumerate(self.wiring.order)},
                "bad_frames": self.board.splitter.bad, "lost_frames": self.board.splitter.lost}

    def approach(self, value: float, frame_period: float = 0.02) -> None:
        """Go to a pulse width [s] and wait until the tap stands still, at most 5 s."""
        self._stream("frame")
        self.board.order("pulse", width=protocol().ticks(value), period=protocol().ticks(frame_period))
        tap = self.wiring.order.index("tap") if "tap" in self.wiring.order else None
        last, still, start = math.nan, 0.0, self.board.time
        while self.board.time - start < _SETTLE and still < 3:
            self._messages.clear()
            self.board.wait(_LOOK)
            seen = [m.values["counts"][tap] for m in self._messages if m.name == "edge" and tap is not None]
            mean = sum(seen) / len(seen) if seen else math.nan
            still = still + 1 if abs(mean - last) < _STILL else 0
            last = mean

    def measure(self, seconds: float) -> dict[str, list[float]]:
        """Return the counts of every channel over a while, by name; pulses continue as they are."""
        self._stream("fast")
        self._messages.clear()
        self.board.wait(seconds)
        width = len(self.wiring.order)
        counts = [count for m in self._messages if m.name == "samples" for count in m.values["counts"]]
        self._stream("off")
        return {name: [float(count) for count in counts[k::width]] for k, name in enumerate(self.wiring.order)}

    def run(self, experiment: Experiment) -> Iterator[Sequence[float]]:
        """Play an experiment on the board's own clock, and yield rows in the order of their times.

        Raises
        ------
        InputError
            If the board cannot make a pulse of it.
        BenchError
            If the wire is cut, or the board ran out of commands.
        """
        if experiment.kind != self.kind:
            raise InputError(f"experiment {experiment.name!r}", got=experiment.kind, allowed=self.kind)
        upload = _Upload(self.board, _points(experiment))
        self._stream(self.rate)
        self.board.order("clear")
        upload.more()
        self._messages.clear()
        self.board.order("play", total=len(upload.points))
        rows = _Rows(self.wiring, self.rate, sum(frames for frames, _, _ in upload.points))
        alive = silence = self.board.time
        while not rows.complete:
            self.board.take(0.02)
            if self._messages:
                silence = self.board.time
            while self._messages:
                yield from rows.of(self._messages.popleft())
            if upload.more() or self.board.time - alive > _ALIVE or not self.board.time > silence:
                self.board.order("ask")
                alive = self.board.time
            if self.board.time - silence > _PATIENCE:
                raise BenchError(self.board.backend.name, f"the board has told nothing for {_PATIENCE:g} s")
        self._stream("off")

    def limp(self) -> None:
        """Stop the pulses; never raises."""
        self.board.limp()

    def close(self) -> None:
        """Stop the pulses and give the wire back."""
        self.limp()
        self.board.close()

    def _stream(self, rate: str) -> None:
        words = protocol().words
        self.board.order("stream", mask=self.wiring.mask, rate=words["rate"][rate],
                         reference=words["reference"][self.wiring.reference])

    def _heard(self, message: Message) -> None:
        self._messages.append(message)


class _Upload:
    """Gives the board its points while there is room."""

    def __init__(self, board: Board, points: Sequence[tuple[int, int, int]]) -> None:
        self.board, self.points, self._sent = board, points, 0
        self._room = int(protocol().numbers["queue"])

    def more(self) -> bool:
        """Send what there is room for; say whether the board was spoken to."""
        if self._sent == len(self.points):
            return False
        room = self.board.order("ask")["room"]
        while room and self._sent < len(self.points):
            batch = self.points[self._sent:self._sent + min(room, _BATCH)]
            room = self.board.order("points", first=self._sent % 2**16, points=batch)["room"]
            self._sent += len(batch)
        return True


class _Rows:
    """Makes rows of what the board tells, in the order of their times.

    Scans arrive some at a time and edges at once, so each waits until the other is known up to its time: an edge says
    when the next one comes, and scans are regular.
    """

    def __init__(self, wiring: Wiring, rate: str, frames: int) -> None:
        self._wiring, self._fast, self._frames = wiring, rate == "fast", frames
        self._start: float | None = None
        self._pulse = math.nan  # us, of the frame under way
        self._edges: deque[tuple[float, float]] = deque()  # time, pulse
        self._scans: deque[tuple[float, list[float]]] = deque()  # time, values
        self._edge_known, self._scan_known = 0.0, -math.inf  # until when
        self.complete = False

    def of(self, message: Message) -> list[Sequence[float]]:
        """Return the rows that a message completes."""
        if message.name == "event":
            self._event(message)
        elif self._start is not None and message.name == "samples":
            return self._samples(message)
        elif self._start is not None and message.name == "edge" and message.time > self._start - _COUNT:
            return self._edge(message)
        return []  # of the pulses before the first frame

    def _event(self, message: Message) -> None:
        name = protocol().word("event", message.values["event"])
        if name == "started":
            self._start = message.time
        elif name in ("starved", "silent", "reset"):
            problem = {"starved": "ran out of commands", "reset": "has started anew (its power?)",
                       "silent": "has heard nothing for a second"}[name]
            raise BenchError("the bench", f"the board {problem}")

    def _edge(self, message: Message) -> list[Sequence[float]]:
        if self._frames == 0:
            return []  # the last pulse continues; its frames are not asked for
        self._frames -= 1
        width, tick, time = message.values["width"], protocol().tick, message.time - (self._start or 0.0)
        pulse = round(1e6 * width * tick, 3) if width else math.nan
        if not self._fast:
            self.complete = self._frames == 0
            return [(_round(time), pulse, *self._values(message.values["counts"]))]
        self._edges.append((time, pulse))
        self._edge_known = time + message.values["period"] * tick
        return self._ready()

    def _samples(self, message: Message) -> list[Sequence[float]]:
        words, width = protocol(), len(self._wiring.order)
        period, held = words.numbers["scan_period"] * words.tick, words.numbers["hold_ticks"] * words.tick
        counts, first = message.values["counts"], message.time - (self._start or 0.0) + held
        count = len(counts) // width
        for k in range(max(math.ceil(-first / period), 0), count):  # some may be older than the first edge
            self._scans.append((first + k * period, self._values(counts[k * width:(k + 1) * width])))
        self._scan_known = first + count * period
        rows = self._ready()
        self.complete = self._frames == 0 and bool(self._scans)
        return rows

    def _ready(self) -> list[Sequence[float]]:
        """Return the rows that nothing can come before any more."""
        rows: list[Sequence[float]] = []
        while self._edges or self._scans:
            edge = self._edges[0][0] if self._edges else math.inf
            scan = self._scans[0][0] if self._scans else math.inf
            if min(edge, scan) > min(self._edge_known, self._scan_known) - 0.5 * _COUNT and math.inf in (edge, scan):
                break
            if edge < scan + 0.5 * _COUNT:
                self._pulse = self._edges.popleft()[1]
            values: Sequence[float] = (math.nan,) * len(self._wiring.order)
            if scan < edge + 0.5 * _COUNT:
                values = self._scans.popleft()[1]
            rows.append((_round(min(edge, scan)), self._pulse, *values))
        return rows

    def _values(self, counts: Sequence[int]) -> list[float]:
        return [float(f"{self._wiring.value(name, count):.6g}")
                for name, count in zip(self._wiring.order, counts, strict=True)]


def _points(experiment: Experiment) -> list[tuple[int, int, int]]:
    """Return frames, width and period [ticks] of each hold; those alike one after the other are joined."""
    words = protocol()
    made: list[tuple[int, int, int]] = []
    for one in experiment.holds:
        period = one.frame_period or experiment.frame_period
        frames, ticks = max(round(one.duration / period), 1), words.ticks(period)
        width = 0 if one.value is None else words.ticks(one.value)
        _check(experiment, one, width, ticks)
        if made and made[-1][1:] == (width, ticks):
            frames += made.pop()[0]
        while frames > 0:
            made.append((min(frames, 2**16 - 1), width, ticks))
            frames -= made[-1][0]
    return made


def _check(experiment: Experiment, hold: Hold, width: int, period: int) -> None:
    numbers, tick = protocol().numbers, protocol().tick
    if not numbers["period_min"] <= period <= numbers["period_max"]:
        raise InputError(f"experiment {experiment.name!r}: frame period", got=f"{1e3 * period * tick:g} ms",
                         allowed=f"{1e3 * numbers['period_min'] * tick:g} to {1e3 * numbers['period_max'] * tick:g} ms")
    widest = min(numbers["width_max"], period - numbers["low_min"])
    if hold.value is not None and not numbers["width_min"] <= width <= widest:
        raise InputError(f"experiment {experiment.name!r}: pulse", got=f"{1e6 * hold.value:g} us",
                         allowed=f"{1e6 * numbers['width_min'] * tick:g} to {1e6 * widest * tick:g} us "
                                 f"at {1e3 * period * tick:g} ms")


def _round(time: float) -> float:
    """Return a time without the rounding of its ticks."""
    return round(time, 7)
