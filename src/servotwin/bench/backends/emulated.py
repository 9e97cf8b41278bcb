"""A board that is emulated: its own firmware under simavr, in lockstep with what hangs on its pins."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path

from servotwin.bench.backends.mock import REFERENCES, Plant, StillPins
from servotwin.bench.emulator.display import Display
from servotwin.bench.emulator.process import CYCLE, FREQUENCY, Microcontroller, Pins
from servotwin.bench.flash import firmware_file
from servotwin.errors import BenchError

_SLICE = 16_000  # cycles between two looks at the wire: 1 ms
_LEAST = 1_600  # cycles that pass where nobody would wait: who asks again and again gets on
_FULL = 1024
_REFERENCES = {0: "external", 1: "supply", 3: "internal"}  # bits REFS1 and REFS0 of ADMUX


class EmulatedBackend:
    """The firmware on an emulated ATmega328P. Its time goes on while somebody reads, as fast as the computer can.

    Each conversion sees the voltages of the instant at which it is held, each pulse is what the compare unit makes, to
    the cycle. Each opening switches a new board on, whose pins find the plant as the last one has left it.

    Parameters
    ----------
    plant : Plant, optional
        What hangs on its pins; 1.25 V at each unless given.
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
        """When the light went on (1) and off (0) [s]."""

    @property
    def time(self) -> float:
        """How long boards have been on since it was opened first [s]."""
        return self._at(0 if self._board is None else self._board.cycle)

    @property
    def lines(self) -> Sequence[str]:
        """What its display shows, two lines of 16 characters."""
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
        """Return what has come; let time go on until something has, or the timeout is over."""
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
