"""Packets of Feetech's STS and SMS servos: bytes to packets, and back. No port, no servo."""

from __future__ import annotations

from servotwin.wire.packet import Packet

PING, READ, WRITE, REG_WRITE, ACTION, RESET = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
BOOT, SET_POSITION, SYNC_READ, SYNC_WRITE = 0x08, 0x0B, 0x82, 0x83
_HEAD = b"\xff\xff"
_SHORTEST = 6  # bytes


def checksum(body: bytes) -> int:
    """Return the check byte of what stands between header and it.

    Examples
    --------
    >>> hex(checksum(bytes.fromhex("010201")))
    '0xfb'
    """
    return ~sum(body) & 0xFF


def frame(id: int, code: int, data: bytes = b"") -> bytes:
    """Return the bytes of an instruction to a servo; of an answer, `code` is the error byte.

    Examples
    --------
    >>> frame(1, PING).hex()
    'ffff010201fb'
    """
    body = bytes((id, len(data) + 2, code)) + data
    return _HEAD + body + bytes((checksum(body),))


def split(buffer: bytearray) -> tuple[list[Packet], int]:
    """Take whole packets out of a buffer; return them, and how many had a bad checksum.

    Bytes before a header are skipped. After a bad checksum the search resumes behind the header, so that a bent length
    costs no packet that follows.

    Examples
    --------
    >>> buffer = bytearray(b"junk" + frame(1, PING) + frame(2, READ, bytes([56, 2]))[:5])
    >>> split(buffer), len(buffer)
    (([Packet(id=1, code=1, data=b'')], 0), 5)
    """
    found, bad, at, end = list[Packet](), 0, 0, len(buffer)
    while True:
        at = buffer.find(_HEAD, at)
        if at < 0:
            at = end - 1 if end and buffer[-1] == 0xFF else end
            break
        if at + 2 < end and buffer[at + 2] == 0xFF:
            at += 1
            continue
        if at + 4 > end:
            break
        length = buffer[at + 3]
        if length < 2:
            at += 2
            continue
        if at + 4 + length > end:
            break
        body = bytes(buffer[at + 2:at + 3 + length])
        if checksum(body) != buffer[at + 3 + length]:
            bad += 1
            at += 2
            continue
        found.append(Packet(body[0], body[2], body[3:]))
        at += 4 + length
    del buffer[:at]
    return found, bad
