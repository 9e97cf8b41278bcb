"""The emulated microcontroller, in a process of its own: it advances by a time, and says what happens at its pins."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path
from struct import Struct, pack
from typing import IO, NamedTuple

from servotwin.errors import BenchError
from servotwin.simulation.compile.storage import is_there, kept_folder, key_of, writable_folder

# --- The harness is compiled where it runs ----------------------------------------------------------------------------

_SOURCES = ("harness.c", "pipes.h", "foresight.h")
LIBRARIES = ("-lsimavr", "-lelf")
_COMPILERS = ("cc", "gcc", "clang")
_PACKAGES = "sudo apt install gcc libsimavr-dev libelf-dev"


def harness() -> Path:
    """Return the compiled harness, which is kept in the user's cache.

    Raises
    ------
    BenchError
        If there is no C compiler, or simavr is not installed.
    """
    with as_file(files("servotwin.bench.emulator")) as folder:
        texts = [(folder / name).read_text(encoding="utf-8") for name in _SOURCES]
        name = f"harness-{key_of(*texts, *LIBRARIES)}"
        kept = kept_folder() / name
        if is_there(kept):
            return kept
        own = writable_folder() / name  # another one where the cache can only be read
        return own if is_there(own) else _made(own, folder / _SOURCES[0])


def _made(path: Path, source: Path) -> Path:
    handle, aside = tempfile.mkstemp(prefix=path.name, dir=path.parent)
    os.close(handle)
    made = Path(aside)
    try:
        _compile(source, aside)
        made.chmod(0o700)  # a wide umask would let others write it
        made.replace(path)  # two processes that compile at once make the same
    finally:
        made.unlink(missing_ok=True)
    return path


def _compile(source: Path, target: str) -> None:
    compiler = next((found for found in map(shutil.which, _COMPILERS) if found), None)
    if compiler is None:
        raise BenchError("emulator", f"there is no C compiler to build it with ({_PACKAGES})")
    done = subprocess.run([compiler, "-O2", "-o", target, str(source), *LIBRARIES], capture_output=True, text=True,
                          check=False)
    if done.returncode == 0:
        return
    said = done.stderr
    if "simavr" in said or "-lelf" in said or "libelf" in said:
        raise BenchError("emulator", f"simavr is not installed ({_PACKAGES})")
    last = next((line for line in said.splitlines() if "error" in line), "no reason given")
    raise BenchError("emulator", f"{compiler} cannot build it: {last.strip()} ({_PACKAGES})")


# --- The display of the board: what an HD44780 shows of what is written to it, half a byte at a time ------------------

COLUMNS = 16
LINES = 2
_SECOND = 0x40  # address of the second line
_ROW = 40  # characters of a line in its memory
_DATA = 0x10  # bit that stands for RS
_TABLE = {0xDF: "°", 0xE4: "µ", 0xF7: "π", 0xF4: "Ω", 0x7E: "→", 0x7F: "←", 0x5C: "¥"}  # of its ROM A00
_CLEAR, _HOME, _ENTRY, _SWITCH, _SHIFT, _FUNCTION, _GLYPHS, _ADDRESS = (1 << k for k in range(8))


class Display:
    """A 16 × 2 HD44780 on four data lines that is only written to.

    Examples
    --------
    >>> display = Display()
    >>> for order in (3, 3, 3, 2, 2, 8, 0, 12, 0, 6):
    ...     display.write(order)
    >>> for letter in b"90":
    ...     display.write(16 | letter >> 4)
    ...     display.write(16 | letter & 15)
    >>> display.lines
    ('90              ', '                ')
    """

    def __init__(self) -> None:
        self._memory = [" "] * (2 * _ROW)
        self._at = 0  # address counter
        self._step = 1
        self._four = False  # data lines; eight after power comes
        self._high: int | None = None  # first half of a byte
        self._on = False
        self._glyphs = False  # what is written goes to the generator of characters

    @property
    def lines(self) -> tuple[str, str]:
        """Its text; blanks where it is off."""
        if not self._on:
            return " " * COLUMNS, " " * COLUMNS
        return "".join(self._memory[:COLUMNS]), "".join(self._memory[_ROW:_ROW + COLUMNS])

    def write(self, half: int) -> None:
        """Take half a byte, as E falls; bit 4 is RS."""
        nibble = half & 15
        if not self._four:  # the lower four lines are not connected, and read as 0
            self._order(nibble << 4)
            return
        if self._high is None:
            self._high = nibble
            return
        byte, self._high = self._high << 4 | nibble, None
        if half & _DATA:
            self._put(byte)
        else:
            self._order(byte)

    def _put(self, byte: int) -> None:
        if self._glyphs:
            return
        place = self._at if self._at < _ROW else self._at - _SECOND + _ROW
        if 0 <= place < len(self._memory):
            letter = chr(byte) if 0x20 <= byte < 0x7E else "\N{REPLACEMENT CHARACTER}"
            self._memory[place] = _TABLE.get(byte, letter)
        self._move(self._step)

    def _move(self, by: int) -> None:
        """Move on in the order of its memory: the second line follows the first, and the first the second."""
        place = self._at if self._at < _ROW else self._at - _SECOND + _ROW
        place = (place + by) % (2 * _ROW)
        self._at = place if place < _ROW else place - _ROW + _SECOND

    def _order(self, byte: int) -> None:
        if byte & _ADDRESS:
            self._at, self._glyphs = byte & 0x7F, False
        elif byte & _GLYPHS:
            self._glyphs = True
        elif byte & _FUNCTION:
            self._four = not byte & 0x10
            self._high = None
        elif byte & _SHIFT:
            if not byte & 0x08:
                self._move(1 if byte & 0x04 else -1)
        elif byte & _SWITCH:
            self._on = bool(byte & 0x04)
        elif byte & _ENTRY:
            self._step = 1 if byte & 0x02 else -1
        elif byte & (_HOME | _CLEAR):
            self._at, self._glyphs = 0, False
            if byte & _CLEAR:
                self._memory[:] = " " * len(self._memory)
                self._step = 1


# --- The emulated microcontroller, in a process of its own ------------------------------------------------------------

FREQUENCY = 16_000_000
"""Clock of the microcontroller [Hz]."""
CYCLE = 1.0 / FREQUENCY
"""Of its clock [s]."""

_HEAD = Struct("<QBBH")
_GO, _WIRE, _POKE, _LOOK, _COUNTS = (Struct(f"<c{fields}") for fields in ("Q", "H", "HB", "HB", "B"))
_HELD = Struct("<QB")
_MOST = 65536  # bytes of one read, of one message
_PATIENCE = 2.0  # s for a process to end by itself
_BACKLOG = 4096  # bytes of one order, so that neither side waits for the other with both pipes full


class Pins(NamedTuple):
    """The listeners to what happens at the pins; times in cycles.

    Parameters
    ----------
    pulse : callable
        (cycle, level) of the pulse's pin.
    light : callable
        (cycle, level) of the light's pin.
    display : callable
        Half a byte as E falls, with RS as bit 4.
    convert : callable
        (cycle, channel, reference bits) of a voltage that is held; returns what the converter finds. May be asked
        for instants to come, which come so if there is no edge of the pulse before them.
    reset : callable
        The board has been reset by itself.
    """

    pulse: Callable[[int, int], None]
    light: Callable[[int, int], None]
    display: Callable[[int], None]
    convert: Callable[[int, int, int], int]
    reset: Callable[[], None]


class Microcontroller:
    """An ATmega328P at 16 MHz with a program, switched on; it ends with the process that has started it.

    Parameters
    ----------
    program : path
        Intel hex.
    pins : Pins

    Raises
    ------
    BenchError
        If simavr or a compiler is missing, or the program cannot be read.
    """

    def __init__(self, program: str | os.PathLike[str], pins: Pins) -> None:
        if not Path(program).is_file():
            raise BenchError(os.fspath(program), "there is no such firmware")
        self.cycle = 0
        self.lost = 0  # bytes to the board that came too fast for it
        self._pins = pins
        self._heard = bytearray()
        self._looked = b""
        self._errors: IO[bytes] = tempfile.TemporaryFile()
        try:
            self._process = subprocess.Popen([harness(), os.fspath(program)], stdin=subprocess.PIPE,
                                             stdout=subprocess.PIPE, stderr=self._errors, bufsize=0)
        except BaseException:
            self._errors.close()
            raise
        pipes = self._process.stdin, self._process.stdout
        self._in, self._out = (pipe.fileno() for pipe in pipes if pipe is not None)

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid

    def go(self, until: int) -> bytes:
        """Advance to a cycle, or a little beyond, and return what has come over the wire meanwhile.

        Raises
        ------
        BenchError
            If the process has ended, or the program has crashed.
        """
        self._order(_GO.pack(b"g", until))
        self._listen(ord("h"))
        heard, self._heard = bytes(self._heard), bytearray()
        return heard

    def send(self, data: bytes) -> None:
        """Put bytes onto the wire to the board."""
        for k in range(0, len(data), _BACKLOG):
            part = data[k:k + _BACKLOG]
            self._order(_WIRE.pack(b"w", len(part)) + part)

    def poke(self, address: int, data: bytes) -> None:
        """Put bytes into registers or SRAM, addressed as the program does."""
        for k, byte in enumerate(data):
            self._order(_POKE.pack(b"p", address + k, byte))

    def look(self, address: int, size: int) -> bytes:
        """Return bytes of registers or SRAM, at most 255; none beyond their end."""
        self._order(_LOOK.pack(b"m", address, size))
        self._listen(ord("m"))
        return self._looked

    def pull(self, port: str, bit: int, level: int) -> None:
        """Hold a pin at a level from outside."""
        self._order(b"d" + port.encode() + bytes((bit, level)))

    def close(self) -> None:
        """End it."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None and not pipe.closed:
                pipe.close()
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def _order(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._in, data):]
        except OSError:
            raise self._dead() from None

    def _listen(self, last: int) -> None:
        """Tell the pins what happens, until an event of this kind has come."""
        pins, unpack, data, ends = self._pins, _HEAD.unpack_from, b"", False
        while not ends:
            try:
                more = os.read(self._out, _MOST)
            except OSError:
                more = b""
            if not more:
                raise self._dead()
            data, at = data + more, 0
            while len(data) - at >= _HEAD.size:
                cycle, kind, a, b = unpack(data, at)
                if kind == 80:  # P
                    pins.pulse(cycle, a)
                elif kind == 65 or kind == 84 or kind == 109:  # A, T, m
                    if len(data) - at < _HEAD.size + b:
                        break
                    at += b
                    text = data[at + _HEAD.size - b:at + _HEAD.size]
                    if kind == 65:
                        counts = [self._pins.convert(cycle, channel, a) for cycle, channel in _HELD.iter_unpack(text)]
                        self._order(_COUNTS.pack(b"v", len(counts)) + pack(f"<{len(counts)}H", *counts))
                    elif kind == 84:
                        self._heard += text
                    else:
                        self._looked = text
                else:
                    self._seldom(cycle, kind, a)
                at += _HEAD.size
                ends = ends or kind == last
                self.cycle = cycle if kind == 104 else self.cycle
            data = data[at:]

    def _seldom(self, cycle: int, kind: int, a: int) -> None:
        if kind == 76:  # L
            self._pins.light(cycle, a)
        elif kind == 68:  # D
            self._pins.display(a)
        elif kind == 79:  # O
            self.lost += 1
        elif kind == 82:  # R
            self._pins.reset()
        elif kind == 120:  # x
            raise BenchError("emulator", f"the program has crashed, or sleeps for ever, after {cycle * CYCLE:.6f} s")

    def _dead(self) -> BenchError:
        try:
            self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return BenchError("emulator", "its process does not answer any more")
        self._errors.seek(0)
        said = self._errors.read(_MOST).decode(errors="replace").strip().splitlines()
        why = said[-1] if said else f"its process has ended ({self._process.returncode})"
        return BenchError("emulator", why)
