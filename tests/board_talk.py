"""Talk to the firmware in a simulator: a script of bytes and voltages goes in, frames and edges come out.

The codec here is written from the words of the protocol, apart from the package's, so that either can find the other
wrong.
"""

from __future__ import annotations

import binascii
import struct
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

CYCLES = 16_000_000  # per second
CYCLES_PER_TICK = 8
HELLO, PULSE, POINTS, CLEAR, PLAY, LIMP, STREAM, ASK, MODE = range(1, 10)
IDENTITY, DONE, STATUS, EDGE, SAMPLES, EVENT = range(0x81, 0x87)


def crc16(data: bytes) -> int:
    return binascii.crc_hqx(data, 0xFFFF)  # polynomial 0x1021, not reflected


def stuffed(data: bytes) -> bytes:
    return b"".join(bytes([len(piece) + 1]) + piece for piece in data.split(b"\0"))


def unstuffed(data: bytes) -> bytes:
    out, at = [], 0
    while at < len(data):
        out.append(data[at + 1:at + data[at]])
        assert len(out[-1]) == data[at] - 1
        at += data[at]
    return b"\0".join(out)


def frame(kind: int, payload: bytes = b"", sequence: int = 0, version: int = 1) -> bytes:
    body = struct.pack("<BBBBI", len(payload), version, sequence & 255, kind, 0) + payload
    return b"\0" + stuffed(body + struct.pack("<H", crc16(body))) + b"\0"


def pulse(width: int, period: int) -> bytes:
    return frame(PULSE, struct.pack("<HH", width, period))


def points(first: int, *rows: tuple[int, int, int]) -> bytes:
    return frame(POINTS, struct.pack("<H", first) + b"".join(struct.pack("<HHH", *row) for row in rows))


def stream(mask: int, rate: int, reference: int = 0) -> bytes:
    return frame(STREAM, bytes([mask, rate, reference]))


@dataclass
class Script:
    """What happens to the board, and when [s]."""

    jumper: bool = False
    lines: list[tuple[int, int, str]] = field(default_factory=list)

    def wire(self, time: float, data: bytes) -> Script:
        return self._add("wire", time, data.hex())

    def adc(self, time: float, channel: int, millivolt: int) -> Script:
        return self._add("adc", time, f"{channel} {millivolt}")

    def asking(self, start: float, end: float, every: float = 0.02) -> Script:
        """Ask for the status again and again, which also keeps the pulses coming."""
        for k in range(int((end - start) / every)):
            self.wire(start + k * every, frame(ASK, sequence=k))
        return self

    def _add(self, word: str, time: float, rest: str) -> Script:
        at = round(time * CYCLES)
        self.lines.append((at, len(self.lines), f"{word} {at} {rest}"))
        return self

    def __str__(self) -> str:
        return ("j" if self.jumper else " ") + "\n" + "".join(f"{line}\n" for _, _, line in sorted(self.lines))


@dataclass(frozen=True)
class Heard:
    """A frame of the board."""

    cycle: int
    sequence: int
    kind: int
    time: int
    payload: bytes


@dataclass
class Log:
    """What the board did; edges as (cycle, level)."""

    edges: list[tuple[int, int]] = field(default_factory=list)
    light: list[tuple[int, int]] = field(default_factory=list)
    display: list[tuple[int, int, int]] = field(default_factory=list)
    frames: list[Heard] = field(default_factory=list)
    said: str = ""

    def of(self, kind: int) -> list[Heard]:
        return [one for one in self.frames if one.kind == kind]

    @property
    def pulses(self) -> list[tuple[int, int]]:
        """Rising edge and width of every whole pulse [cycles]."""
        assert [level for _, level in self.edges] == [k % 2 == 0 for k in range(len(self.edges))]
        return [(up, down - up) for (up, _), (down, _) in zip(self.edges[::2], self.edges[1::2], strict=False)]


def status(log: Log) -> dict[str, int]:
    """Return the last status that the board told."""
    names = ("answers", "mode", "pulsing", "room", "played", "frames", "good", "bad", "dropped", "late")
    return dict(zip(names, struct.unpack("<BBBBIIHHHH", log.of(STATUS)[-1].payload), strict=True))


def read_log(text: str) -> Log:
    log = Log()
    for line in text.splitlines():
        what, cycle, *rest = line.split()
        if what == "P":
            log.edges.append((int(cycle), int(rest[0])))
        elif what == "L":
            log.light.append((int(cycle), int(rest[0])))
        elif what == "D":
            log.display.append((int(cycle), int(rest[0]), int(rest[1], 16)))
        else:
            body = unstuffed(bytes.fromhex(rest[0]))
            length, version, sequence, kind, time = struct.unpack("<BBBBI", body[:8])
            assert (len(body), version) == (length + 10, 1)
            assert crc16(body[:-2]) == struct.unpack("<H", body[-2:])[0]
            log.frames.append(Heard(int(cycle), sequence, kind, time, body[8:-2]))
    if log.edges and log.edges[0][1] == 0:
        del log.edges[0]  # the pin becomes an output: low
    if log.light and log.light[0][1] == 0:
        del log.light[0]
    return log


def run_board(command: list[str], firmware: Path, script: Script, seconds: float, folder: Path) -> Log:
    """Run a simulator: `command FIRMWARE SCRIPT LOG SECONDS`."""
    told, log = folder / "script.txt", folder / "log.txt"
    told.write_text(str(script))
    done = subprocess.run([*command, str(firmware), str(told), str(log), str(seconds)], capture_output=True, text=True,
                          errors="replace", timeout=1200, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    result = read_log(log.read_text())
    result.said = done.stdout
    return result


def millivolt_of(count: int) -> int:
    """Return what to feed simavr's converter at a reference of 2.5 V, so that it reads this count."""
    return -(-count * 2500 // 1023)


def screens(display: list[tuple[int, int, int]]) -> list[tuple[int, str]]:
    """Return what a 16x2 HD44780 shows each time that its last place is written: (cycle, 32 characters).

    It checks the display's times too: 4.1 ms and 100 us while it wakes, 1.52 ms to clear, 37 us for all else.
    """
    nibbles = list(display)
    assert [(rs, nibble) for _, rs, nibble in nibbles[:4]] == [(0, 3), (0, 3), (0, 3), (0, 2)]
    assert nibbles[0][0] > 0.040 * CYCLES
    assert nibbles[1][0] - nibbles[0][0] > 0.0041 * CYCLES
    assert nibbles[2][0] - nibbles[1][0] > 100e-6 * CYCLES
    memory, at, shown, ready = {}, 0, [], nibbles[3][0] + 37e-6 * CYCLES
    for (cycle, rs, high), (_, same, low) in zip(nibbles[4::2], nibbles[5::2], strict=False):
        assert rs == same
        assert cycle > ready
        byte = high << 4 | low
        ready = cycle + (1.52e-3 if byte == 1 and not rs else 37e-6) * CYCLES
        if rs:
            memory[at] = chr(byte)
            at += 1
            if at == 0x40 + 16:
                shown.append((cycle, "".join(memory[k] for k in [*range(16), *range(0x40, 0x50)])))
        elif byte & 0x80:
            at = byte & 0x7F
    return shown
