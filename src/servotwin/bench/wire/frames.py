"""Frames on the wire: length, version, sequence, kind, time, payload, CRC-16; stuffed, so that 0 begins anew."""

from __future__ import annotations

import binascii
import struct
from typing import NamedTuple

from servotwin.bench.wire.protocol import protocol

_HEAD = struct.Struct("<BBBBI")
_CRC = struct.Struct("<H")
_FIRST = 0xFFFF  # what the CRC starts with
_BLOCK = 254  # bytes that one length byte of the stuffing can speak for


class Frame(NamedTuple):
    """A frame that arrived whole.

    Parameters
    ----------
    kind : int
    sequence : int
        Of the sender's frames, modulo 256.
    time : int
        Of the sender [ticks], modulo 2³².
    payload : bytes
    """

    kind: int
    sequence: int
    time: int
    payload: bytes


def to_wire(frame: Frame) -> bytes:
    """Return the bytes of a frame, with a 0 before and after.

    Examples
    --------
    >>> to_wire(Frame(1, 7, 0, b"")).hex()
    '000104010701010101034feb00'
    """
    head = _HEAD.pack(len(frame.payload), int(protocol().numbers["version"]), frame.sequence, frame.kind, frame.time)
    body = head + frame.payload
    return b"\0" + stuffed(body + _CRC.pack(binascii.crc_hqx(body, _FIRST))) + b"\0"


def from_wire(block: bytes) -> Frame | None:
    """Return the frame between two zeros, None if it is not whole.

    Examples
    --------
    >>> from_wire(to_wire(Frame(1, 7, 0, b"")).strip(bytes(1)))
    Frame(kind=1, sequence=7, time=0, payload=b'')
    """
    body = unstuffed(block)
    if body is None or len(body) < _HEAD.size + _CRC.size:
        return None
    length, version, sequence, kind, time = _HEAD.unpack_from(body)
    if length != len(body) - _HEAD.size - _CRC.size or version != protocol().numbers["version"]:
        return None
    if binascii.crc_hqx(body[:-_CRC.size], _FIRST) != _CRC.unpack_from(body, len(body) - _CRC.size)[0]:
        return None
    return Frame(kind, sequence, time, body[_HEAD.size:-_CRC.size])


def stuffed(data: bytes) -> bytes:
    """Return data without zeros by consistent overhead byte stuffing (Cheshire & Baker 1999).

    Examples
    --------
    >>> stuffed(bytes([1, 0, 0, 2])).hex()
    '0201010202'
    """
    out = bytearray()
    parts = data.split(b"\0")
    for k, part in enumerate(parts):
        while len(part) >= _BLOCK:
            out += b"\xff" + part[:_BLOCK]
            part = part[_BLOCK:]
            if not part and k == len(parts) - 1:
                return bytes(out)
        out.append(len(part) + 1)
        out += part
    return bytes(out)


def unstuffed(data: bytes) -> bytes | None:
    """Return what was stuffed, None if nothing can have been.

    Examples
    --------
    >>> unstuffed(stuffed(bytes(300))) == bytes(300), unstuffed(bytes([9, 1]))
    (True, None)
    """
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        part = data[at + 1:at + code]
        if code == 0 or len(part) != code - 1 or 0 in part:
            return None
        out += part
        at += code
        if code <= _BLOCK and at < len(data):
            out.append(0)
    return bytes(out)


class Splitter:
    """Takes bytes as they come and gives the frames in them; counts what was no frame, and what never came.

    Parameters
    ----------
    bad : int
        Pieces between zeros that were no whole frame, so far.
    lost : int
        Frames that the sender's numbers say are missing, so far: 255 at most between two that came.

    Examples
    --------
    >>> splitter = Splitter()
    >>> wire = to_wire(Frame(1, 7, 0, b"")) + bytes([3, 3]) + to_wire(Frame(1, 9, 0, b""))
    >>> [frame.sequence for frame in splitter.feed(wire)], splitter.bad, splitter.lost
    ([7, 9], 1, 1)
    """

    def __init__(self) -> None:
        self.bad = 0
        self.lost = 0
        self._rest = b""
        self._last: int | None = None
        self._overlong = False

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that these bytes complete."""
        found = []
        *blocks, self._rest = (self._rest + data).split(b"\0")
        for block in blocks:
            if self._overlong:  # counted when it became too long
                self._overlong = False
            elif block:
                frame = from_wire(block)
                if frame is None:
                    self.bad += 1
                else:
                    found.append(self._counted(frame))
        if len(self._rest) > _longest():
            self.bad += not self._overlong
            self._rest, self._overlong = b"", True
        return found

    def again(self) -> None:
        """Forget the sender's last number: it begins anew, after a reset say."""
        self._last = None

    def _counted(self, frame: Frame) -> Frame:
        if self._last is not None:
            self.lost += (frame.sequence - self._last - 1) % 256
        self._last = frame.sequence
        return frame


def _longest() -> int:
    """Return the most bytes of a stuffed frame."""
    whole = _HEAD.size + int(protocol().numbers["longest_payload"]) + _CRC.size
    return whole + whole // _BLOCK + 1


class Clock:
    """Time of the board since the first look [s], from its ticks, which wrap every 36 minutes.

    Looks may be out of order by less than a quarter of that.

    Examples
    --------
    >>> clock = Clock()
    >>> clock.seconds(2**32 - 2), clock.seconds(2**32 - 1), clock.seconds(4)
    (0.0, 5e-07, 3e-06)
    """

    def __init__(self) -> None:
        self._first: int | None = None
        self._ticks = 0

    def seconds(self, ticks: int) -> float:
        """Return the time of a look, which may be a little before the last one."""
        if self._first is None:
            self._first = self._ticks = ticks
        ahead = (ticks - self._ticks) % 2**32
        if ahead >= 2**31:
            ahead -= 2**32
        now = self._ticks + ahead
        self._ticks = max(self._ticks, now)
        return (now - self._first) * protocol().tick
