"""A board that is emulated: its own firmware under simavr, in lockstep with what hangs on its pins."""

from __future__ import annotations

import os
import time as clock
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from servotwin.bench.emulator.process import CYCLE, FREQUENCY, Display, Microcontroller, Pins
from servotwin.bench.flash import firmware_file
from servotwin.bench.wire.frames import Frame, Kind, Splitter, protocol, to_wire
from servotwin.errors import BenchError, InputError

# --- A board that is not there: it speaks the protocol as the firmware does, in the time of its own clock -------------

_VERSION = (1, 0)  # of the firmware that it stands for
REFERENCES: Mapping[str, float] = {"external": 2.5, "supply": 5.0, "internal": 1.1}
"""Of the converter: the guide's TL431, USB, the ATmega328P's sheet [V]."""
_FAR = 2**62  # ticks; never


class Plant(Protocol):
    """The plant at the pins of a board."""

    def rise(self, time: float) -> None:
        """Take the rising edge of a pulse [s]."""

    def fall(self, time: float) -> None:
        """Take the falling edge of a pulse [s]."""

    def voltage(self, channel: str, time: float) -> float:
        """Return the voltage at the pin of a channel at a time, not before the last one [V]."""


class StillPins:
    """Pins that never change.

    Parameters
    ----------
    volts : float
        At each of them [V].
    """

    def __init__(self, volts: float = 1.25) -> None:
        self._volts = volts

    def rise(self, time: float) -> None:
        """Nothing happens."""

    def fall(self, time: float) -> None:
        """Nothing happens."""

    def voltage(self, channel: str, time: float) -> float:
        """Return what they are [V]."""
        return self._volts


class _Point(NamedTuple):
    frames: int
    width: int
    period: int


class MockBackend:
    """A board without a board. Its time advances while it is read, by as much as the reader would wait.

    Parameters
    ----------
    plant : Plant, optional
        Plant at its pins; 1.25 V at each unless given.
    start : int
        Its clock when it is opened [ticks].
    references : mapping of str to float, optional
        Of the converter, other than `REFERENCES` [V].

    Examples
    --------
    >>> wire = MockBackend()
    >>> wire.open()
    >>> wire.send(to_wire(Frame(protocol().kinds["hello"].number, 1, 0, b"")))
    >>> Splitter().feed(wire.read(0.1))[-1].payload[1:9]
    b'servotwn'
    """

    name = "mock"

    def __init__(self, plant: Plant | None = None, *, start: int = 0,
                 references: Mapping[str, float] | None = None) -> None:
        self._volts = {**REFERENCES, **(references or {})}
        self._plant: Plant = plant or StillPins()
        self._start = self._now = start
        self._is_open = False

    def open(self) -> None:
        """Switch the board on."""
        if self._is_open:
            raise BenchError(self.name, "it is open already")
        self._is_open = True
        self._in = Splitter()
        self._out = bytearray()
        self._sequence = self._good = self._pulses = 0
        self._mode = self._rate = self._mask = self._reference = 0
        self._queue: deque[_Point] = deque()
        self._taken = self._played = self._total = self._left = 0
        self._playing = self._framing = False
        self._started = False
        self._point = _Point(1, 0, protocol().ticks(0.02))
        self._edge = self._fall = self._scan = _FAR
        self._scans: list[int] = []
        self._scanned = self._now
        self._heard = self._now
        self._tell("event", event=protocol().words["event"]["reset"], value=0)

    def send(self, data: bytes) -> None:
        """Take bytes and answer at once."""
        self._check()
        for frame in self._in.feed(data):
            self._good += 1
            self._heard = self._now
            kind = protocol().kind(frame.kind)
            if kind is None or kind.sender != "computer":
                self._done(frame, "unknown")
                continue
            try:
                values = kind.unpack(frame.payload)
            except InputError:
                self._done(frame, "length")
                continue
            self._obey(frame, kind, values)

    def read(self, timeout: float) -> bytes:
        """Return the bytes that are due; advance time until some are, or the timeout is over."""
        self._check()
        until = self._now + protocol().ticks(timeout)
        while not self._out and self._now < until:
            self._step(until)
        data, self._out = bytes(self._out), bytearray()
        return data

    def close(self) -> None:
        """Cut the wire; the board continues without it until it is silent for too long."""
        self._is_open = False

    def _check(self) -> None:
        if not self._is_open:
            raise BenchError(self.name, "it is not open")

    # what comes in

    def _obey(self, frame: Frame, kind: Kind, values: Mapping[str, Any]) -> None:
        if kind.name == "hello":
            self._tell("identity", answers=frame.sequence, name="servotwn", major=_VERSION[0], minor=_VERSION[1],
                       mode=self._mode, cause=1)
        elif kind.name == "ask":
            state = 2 if self._playing else 1 if self._framing and self._point.width else 0
            self._tell("status", answers=frame.sequence, mode=self._mode, pulsing=state, room=self._room,
                       played=self._played, frames=self._pulses % 2**32, good=self._good % 2**16,
                       bad=self._in.bad % 2**16, dropped=0, late=0)
        else:
            orders: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
                "pulse": self._pulse, "points": self._points, "clear": self._clear, "play": self._play,
                "limp": self._limp, "stream": self._stream, "mode": self._set_mode}
            self._done(frame, orders[kind.name](values))

    def _pulse(self, values: Mapping[str, Any]) -> str:
        point = _Point(1, values["width"], values["period"])
        if not _possible(point):
            return "range"
        self._playing, self._left = False, 0
        self._point = point
        self._begin()
        return "ok"

    def _points(self, values: Mapping[str, Any]) -> str:
        points = [_Point(*one) for one in values["points"]]
        if not points or not all(one.frames and _possible(one) for one in points):
            return "range"
        if values["first"] != self._taken % 2**16:
            return "order"
        if len(points) > self._room:
            return "full"
        self._queue.extend(points)
        self._taken += len(points)
        return "ok"

    def _clear(self, values: Mapping[str, Any]) -> str:
        self._leave_queue()
        return "ok"

    def _play(self, values: Mapping[str, Any]) -> str:
        if self._playing:
            return "ok"
        if not self._queue or not values["total"]:
            return "range"
        self._total, self._played, self._left = values["total"], 0, 0
        self._playing, self._started = True, False
        self._begin()
        return "ok"

    def _limp(self, values: Mapping[str, Any]) -> str:
        self._leave_queue()
        self._framing, self._edge = False, _FAR
        return "ok"

    def _stream(self, values: Mapping[str, Any]) -> str:
        words = protocol().words
        if (values["mask"] >= 2**len(words["channels"]) or values["rate"] not in words["rate"].values()
                or values["reference"] not in words["reference"].values()):
            return "range"
        self._flush()
        self._mask, self._rate, self._reference = values["mask"], values["rate"], values["reference"]
        period = int(protocol().numbers["scan_period"])
        self._scan = (self._now // period + 1) * period if self._rate == words["rate"]["fast"] else _FAR
        return "ok"

    def _set_mode(self, values: Mapping[str, Any]) -> str:
        if values["mode"] != protocol().words["mode"]["computer"]:
            return "range"  # nobody turns a knob here
        return "ok"

    # time advances

    def _begin(self) -> None:
        if not self._framing:
            self._edge = self._now + protocol().ticks(0.001)
        self._framing = True

    def _step(self, until: int) -> None:
        silent = _FAR
        if self._framing or self._queue:
            silent = self._heard + protocol().ticks(protocol().numbers["silence"])
        self._now = max(self._now, min(self._edge, self._fall, self._scan, silent, until))
        if self._now == self._fall:
            self._plant.fall(self._time)
            self._fall = _FAR
        if self._now == self._scan:
            self._take_scan()
        if self._now == self._edge:
            self._take_edge()
        if self._now >= silent:
            self._limp({})
            self._tell("event", event=protocol().words["event"]["silent"], value=self._played)

    def _take_edge(self) -> None:
        if self._playing and self._left == 0:
            self._next_point()
        self._left -= self._playing
        point = self._point
        self._edge = self._now + point.period
        if point.width:
            self._plant.rise(self._time)
            self._fall = self._now + point.width
            self._pulses += 1
        words = protocol().words["rate"]
        if self._rate == words["frame"]:
            self._tell("edge", width=point.width, period=point.period, mask=self._mask, counts=self._counts())
        elif self._rate == words["fast"]:
            self._tell("edge", width=point.width, period=point.period, mask=0, counts=[])

    def _next_point(self) -> None:
        words = protocol().words["event"]
        if not self._started:
            self._started = True
            self._tell("event", event=words["started"], value=0)
        if self._queue:
            self._point = self._queue.popleft()
            self._left = self._point.frames
            self._played += 1
            return
        self._playing, self._left = False, 0
        ended = self._played >= self._total
        self._tell("event", event=words["ended" if ended else "starved"], value=self._played)

    def _take_scan(self) -> None:
        if not self._scans:
            self._scanned = self._now
        self._scans += self._counts()
        self._scan += int(protocol().numbers["scan_period"])
        room = (int(protocol().numbers["longest_payload"]) - 1) // 2
        if len(self._scans) + bin(self._mask).count("1") > room:
            self._flush()

    def _flush(self) -> None:
        if self._scans:
            now, self._now = self._now, self._scanned
            self._tell("samples", mask=self._mask, counts=self._scans)
            self._now, self._scans = now, []

    def _counts(self) -> list[int]:
        numbers, counts, k = protocol().numbers, [], 0
        reference = self._volts[protocol().word("reference", self._reference)]
        for name, channel in protocol().words["channels"].items():
            if self._mask >> channel & 1:
                held = (self._now + numbers["hold_ticks"] + k * numbers["channel_ticks"]) * protocol().tick
                volts = self._plant.voltage(name, held)
                counts.append(min(max(int(1024 * volts / reference), 0), 1023))
                k += 1
        return counts

    # what goes out

    @property
    def _time(self) -> float:
        return self._now * protocol().tick

    @property
    def _room(self) -> int:
        return int(protocol().numbers["queue"]) - len(self._queue)

    def _leave_queue(self) -> None:
        self._queue.clear()
        self._playing, self._taken, self._left = False, 0, 0

    def _done(self, frame: Frame, result: str) -> None:
        self._tell("done", answers=frame.sequence, result=protocol().words["result"][result],
                   value=self._taken % 2**16, room=self._room)

    def _tell(self, what: str, /, **values: Any) -> None:
        kind = protocol().kinds[what]
        self._sequence = (self._sequence + 1) % 256
        self._out += to_wire(Frame(kind.number, self._sequence, self._now % 2**32, kind.pack(values)))


def _possible(point: _Point) -> bool:
    """Say whether the board can make this pulse."""
    numbers = protocol().numbers
    widest = min(numbers["width_max"], point.period - numbers["low_min"])
    width = point.width == 0 or numbers["width_min"] <= point.width <= widest
    return bool(width and numbers["period_min"] <= point.period <= numbers["period_max"])

# --- A board that is emulated: its own firmware under simavr, in lockstep with what hangs on its pins -----------------

_SLICE = 16_000  # cycles between two looks at the wire: 1 ms
_LEAST = 1_600  # cycles that pass where nobody would wait: who asks again and again gets on
_FULL = 1024
_REFERENCES = {0: "external", 1: "supply", 3: "internal"}  # bits REFS1 and REFS0 of ADMUX


class EmulatedBackend:
    """The firmware on an emulated ATmega328P. Its time advances while it is read, as fast as the computer can.

    Each conversion sees the voltages of the instant at which it is held, each pulse is what the compare unit makes, to
    the cycle. Each opening switches a new board on, whose pins find the plant as the last one has left it.

    Parameters
    ----------
    plant : Plant, optional
        Plant at its pins; 1.25 V at each unless given.
    paper : bool
        Whether the jumper of mode "paper" is closed when it starts.
    references : mapping of str to float, optional
        Of the converter, other than `REFERENCES` [V].
    firmware : path, optional
        Another one than the package's.
    real_time : bool
        Whether it waits where it is faster than the clock on the wall.

    Examples
    --------
    >>> from servotwin.bench.wire import Board
    >>> board = Board(EmulatedBackend())  # doctest: +SKIP
    >>> board.open().mode  # doctest: +SKIP
    'computer'
    """

    name = "emulator"

    def __init__(self, plant: Plant | None = None, *, paper: bool = False,
                 references: Mapping[str, float] | None = None,
                 firmware: str | os.PathLike[str] | None = None, real_time: bool = False) -> None:
        self._plant: Plant = plant or StillPins()
        self._paper = paper
        self._volts = {**REFERENCES, **(references or {})}
        self._firmware = firmware_file() if firmware is None else Path(firmware)
        self._real_time, self._wall = real_time, 0.0
        self._board: Microcontroller | None = None
        self._before = 0  # cycles of the boards before this one
        self._display = Display()
        self._heard = bytearray()
        self.light: list[tuple[float, int]] = []
        """When the light turned on (1) and off (0) [s]."""

    @property
    def time(self) -> float:
        """How long boards have been on since it was opened first [s]."""
        return self._at(0 if self._board is None else self._board.cycle)

    @property
    def lines(self) -> Sequence[str]:
        """The text of its display, two lines of 16 characters."""
        return self._display.lines

    @property
    def pid(self) -> int:
        """Number of the emulator's process."""
        return self._running.pid

    def open(self) -> None:
        """Switch the board on.

        Raises
        ------
        BenchError
            If simavr or a compiler is missing: names the packages.
        """
        if self._board is not None:
            raise BenchError(self.name, "it is open already")
        self._board = Microcontroller(self._firmware, Pins(
            pulse=self._pulse, light=lambda cycle, level: self.light.append((self._at(cycle), level)),
            display=lambda half: self._display.write(half), convert=self._count, reset=self._reset))
        self._display = Display()
        self._heard.clear()
        self._wall = clock.monotonic() - self.time
        if self._paper:
            self._board.pull("B", 0, 0)

    def send(self, data: bytes) -> None:
        """Put bytes onto the wire, which carries them at its own speed."""
        self._running.send(data)

    def read(self, timeout: float) -> bytes:
        """Return what has come; advance time until something has, or the timeout is over."""
        board = self._running
        until = board.cycle + max(round(timeout * FREQUENCY), _LEAST)
        while not self._heard and board.cycle < until:
            self._heard += board.go(min(until, board.cycle + _SLICE))
            if self._real_time:
                clock.sleep(max(self._wall + self.time - clock.monotonic(), 0.0))
        data = bytes(self._heard)
        self._heard.clear()
        return data

    def close(self) -> None:
        """Switch the board off."""
        if self._board is not None:
            self._board.close()
            self._before += self._board.cycle
            self._board = None
            self._plant.fall(self.time)

    def poke(self, address: int, data: bytes) -> None:
        """Put bytes into the board's SRAM."""
        self._running.poke(address, data)

    @property
    def _running(self) -> Microcontroller:
        if self._board is None:
            raise BenchError(self.name, "it is not open")
        return self._board

    def look(self, address: int, size: int) -> bytes:
        """Return bytes of the board's registers and SRAM."""
        return self._running.look(address, size)

    def _at(self, cycle: int) -> float:
        return (self._before + cycle) * CYCLE

    def _pulse(self, cycle: int, level: int) -> None:
        (self._plant.rise if level else self._plant.fall)(self._at(cycle))

    def _count(self, cycle: int, channel: int, reference: int) -> int:
        volts = self._plant.voltage(_CHANNELS[channel], self._at(cycle)) if channel < len(_CHANNELS) else 0.0
        full = self._volts[_REFERENCES.get(reference, "internal")]
        return min(max(int(_FULL * volts / full), 0), _FULL - 1)

    def _reset(self) -> None:
        """Nothing: the display keeps what it shows while the board starts anew."""


_CHANNELS = ("tap", "shunt", "supply", "command")
