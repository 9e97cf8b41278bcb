"""The board in emulation: the firmware itself under simavr, beside a simulated servo."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from servotwin.bench.converter import Converter
from servotwin.bench.emulator.display import Display
from servotwin.bench.emulator.process import CYCLE, FREQUENCY, Microcontroller, Pins
from servotwin.bench.flash import firmware_file
from servotwin.errors import BenchError, InputError

if TYPE_CHECKING:
    from servotwin.bench.backends.mock import Plant

_STEP = 1e-3  # s that the board goes on at a time
_LEAST = 1e-4  # s that a read without patience lets pass, so that who polls gets on
_BOOT = 2e-3  # s until the board hears; the display wakes later
_BITS = {0: "external", 1: "supply", 3: "internal"}  # REFS of the converter
_VOLTS = {"external": 2.5, "supply": 5.0, "internal": 1.1}  # LM336Z-2.5, USB, ATmega328P's sheet
_MODES = ("computer", "paper")


class EmulatedBackend:
    """The firmware under simavr, with a servo on its pins. Its time goes on while somebody reads.

    Each conversion sees the voltage of the instant at which it is held; each pulse is as long as the compare unit makes
    it, to the cycle. Between two reads nothing happens: what is sent goes onto the wire when the next read begins.

    Parameters
    ----------
    plant : Plant
        What hangs on its pins, such as a `ServoPlant`; of one with a `voltage`, single channels are asked for.
    firmware : path, optional
        Intel hex; the firmware of the bench unless given.
    mode : {"computer", "paper"}
        At the start: "paper" holds D8 at ground.
    references : mapping of str to float, optional
        Other voltages of the converter's references "external", "supply", "internal" [V].
    real_time : bool
        Whether it waits where it is faster than the clock on the wall.

    Examples
    --------
    >>> import servotwin as st
    >>> from servotwin.bench.emulator.plant import ServoPlant
    >>> from servotwin.bench.wire import Board
    >>> wire = EmulatedBackend(ServoPlant(st.PulseServo(st.load_servo("hitec-hs-755hb"))))
    >>> board = Board(wire)
    >>> board.open().firmware  # doctest: +SKIP
    '1.0'
    """

    name = "emulator"

    def __init__(self, plant: Plant, *, firmware: str | os.PathLike[str] | None = None, mode: str = "computer",
                 references: Mapping[str, float] | None = None, real_time: bool = False) -> None:
        if mode not in _MODES:
            raise InputError("mode of the board", got=mode, allowed=" or ".join(_MODES))
        wrong = [name for name in references or {} if name not in _VOLTS]
        if wrong:
            raise InputError("references", got=wrong[0], allowed=", ".join(_VOLTS))
        self.plant = plant
        self.firmware = os.fspath(firmware_file() if firmware is None else firmware)
        self.mode = mode
        self.real_time = real_time
        volts = _VOLTS | dict(references or {})
        self._converters = {bits: Converter(bits=10, reference=volts[name]) for bits, name in _BITS.items()}
        self._voltage: Callable[[int, float], float] = getattr(
            plant, "voltage", lambda channel, time: plant.voltages(time)[channel])
        self._chip: Microcontroller | None = None
        self._heard = b""
        self._display = Display()
        self._ended = 0  # cycles of boards before this one: each opening switches a new one on
        self.lights: list[tuple[float, int]] = []
        """When the light went on (1) and off (0) [s]."""
        self.resets = 0
        """How often the board has reset itself."""

    @property
    def time(self) -> float:
        """How far the board is, since it was opened first [s]."""
        return (self._ended + (0 if self._chip is None else self._chip.cycle)) * CYCLE

    @property
    def lines(self) -> tuple[str, str]:
        """What is read on the display."""
        return self._display.lines

    @property
    def chip(self) -> Microcontroller:
        """The microcontroller, to look into it.

        Raises
        ------
        BenchError
            If it is not switched on.
        """
        if self._chip is None:
            raise BenchError(self.name, "it is not open")
        return self._chip

    def open(self) -> None:
        """Switch the board on.

        Raises
        ------
        BenchError
            If it is on, or a tool is missing: a C compiler, simavr.
        """
        if self._chip is not None:
            raise BenchError(self.name, "it is open already")
        self._display = Display()
        self._chip = Microcontroller(self.firmware, Pins(self._pulse, self._light, self._display.write, self._count,
                                                         self._reset))
        try:
            if self.mode == "paper":
                self._chip.pull("B", 0, 0)
            self._wall = clock.monotonic() - self.time
            self._heard = self._chip.go(round(_BOOT * FREQUENCY))
        except BaseException:
            self.close()
            raise

    def send(self, data: bytes) -> None:
        """Put bytes onto the wire to the board."""
        self.chip.send(data)

    def read(self, timeout: float) -> bytes:
        """Return what has come; where nothing has, let time go on until something does, or for `timeout` [s]."""
        chip = self.chip
        until = chip.cycle + round(max(timeout, _LEAST) * FREQUENCY)
        while not self._heard and chip.cycle < until:
            self._heard += chip.go(min(until, chip.cycle + round(_STEP * FREQUENCY)))
            if self.real_time:
                clock.sleep(max(self._wall + self.time - clock.monotonic(), 0.0))
        data, self._heard = self._heard, b""
        return data

    def close(self) -> None:
        """Switch the board off; the servo gets no more pulses."""
        if self._chip is not None:
            chip, self._chip = self._chip, None
            self._ended += chip.cycle
            self.plant.fall(self._ended * CYCLE)
            chip.close()

    def _pulse(self, cycle: int, level: int) -> None:
        (self.plant.rise if level else self.plant.fall)((self._ended + cycle) * CYCLE)

    def _light(self, cycle: int, level: int) -> None:
        self.lights.append(((self._ended + cycle) * CYCLE, level))

    def _count(self, cycle: int, channel: int, reference: int) -> int:
        time = (self._ended + cycle) * CYCLE
        return self._converters[reference].count(self._voltage(channel, time))

    def _reset(self) -> None:
        self.resets += 1
