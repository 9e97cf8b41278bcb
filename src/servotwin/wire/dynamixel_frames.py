"""Packets of Dynamixel's protocol 2.0: bytes to packets, and back. No port, no servo."""

from __future__ import annotations

from servotwin.wire.packet import ALL, Packet

PING, READ, WRITE, REG_WRITE, ACTION, RESET = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
REBOOT, CLEAR, STATUS, SYNC_READ, SYNC_WRITE = 0x08, 0x10, 0x55, 0x82, 0x83
FAST_SYNC_READ, BULK_READ, BULK_WRITE, FAST_BULK_READ = 0x8A, 0x92, 0x93, 0x9A
_HEAD, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"
_LONGEST = 2048  # bytes that a packet may say it has


def _table() -> tuple[int, ...]:
    found = []
    for k in range(256):
        value = k << 8
        for _ in range(8):
            value = (value << 1 ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
        found.append(value)
    return tuple(found)


_CRC = _table()


def crc16(data: bytes, crc: int = 0) -> int:
    """Return the CRC-16 (polynomial 0x8005) of bytes, continued from that of those before.

    Examples
    --------
    >>> hex(crc16(bytes.fromhex("fffffd00010300 01")))
    '0x4e19'
    """
    for byte in data:
        crc = (crc << 8 ^ _CRC[crc >> 8 ^ byte]) & 0xFFFF
    return crc


def frame(id: int, code: int, data: bytes = b"") -> bytes:
    """Return the bytes of an instruction, stuffed so that no header stands within.

    Examples
    --------
    >>> frame(1, PING).hex()
    'fffffd0001030001194e'
    """
    body = bytes((code,)) + data
    if _HEAD in body:
        body = body.replace(_HEAD, _STUFFED)
    length = len(body) + 2
    made = b"\xff\xff\xfd\x00" + bytes((id, length & 0xFF, length >> 8)) + body
    return made + crc16(made).to_bytes(2, "little")


def answer(id: int, error: int, data: bytes = b"") -> bytes:
    """Return the bytes of a status packet.

    Examples
    --------
    >>> answer(1, 0, bytes([0x06, 0x04, 0x26])).hex()
    'fffffd000107005500060426655d'
    """
    return frame(id, STATUS, bytes((error,)) + data)


def fast_answer(parts: list[tuple[int, int, bytes]]) -> bytes:
    """Return one status packet of several servos: error, id and data of each, with the CRC so far behind it.

    The packet says it comes from everybody.
    """
    length = 1 + sum(4 + len(data) for _, _, data in parts)
    made = bytearray(b"\xff\xff\xfd\x00" + bytes((ALL, length & 0xFF, length >> 8, STATUS)))
    crc, done = 0, 0
    for id, error, data in parts:
        made += bytes((error, id)) + data
        crc, done = crc16(bytes(made[done:]), crc), len(made)
        made += crc.to_bytes(2, "little")
    return bytes(made)


def split(buffer: bytearray) -> tuple[list[Packet], int]:
    r"""Take whole packets out of a buffer; return them, and how many had a bad CRC.

    Examples
    --------
    >>> split(bytearray(b"junk" + frame(1, WRITE, b"\x74\x00\xff\xff\xfd\x00")))
    ([Packet(id=1, code=3, data=b't\x00\xff\xff\xfd\x00')], 0)
    """
    found, bad, at, end = list[Packet](), 0, 0, len(buffer)
    while True:
        at = buffer.find(_HEAD, at)
        if at < 0:
            at = end - (2 if buffer[-2:] == b"\xff\xff" else 1 if buffer[-1:] == b"\xff" else 0)
            break
        if at + 7 > end:
            break
        length = buffer[at + 5] | buffer[at + 6] << 8
        if buffer[at + 3] == 0xFD or not 3 <= length <= _LONGEST:
            at += 3
            continue
        last = at + 7 + length
        if last > end:
            break
        whole = bytes(buffer[at:last])
        if crc16(whole[:-2]) != whole[-2] | whole[-1] << 8:
            bad += 1
            at += 3
            continue
        body = whole[7:-2]
        if _STUFFED in body:
            body = body.replace(_STUFFED, _HEAD)
        found.append(Packet(whole[4], body[0], body[1:]))
        at = last
    del buffer[:at]
    return found, bad
