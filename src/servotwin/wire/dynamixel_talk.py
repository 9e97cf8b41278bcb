"""Answers of Dynamixel's servos to a packet of protocol 2.0, and when."""

from __future__ import annotations

from collections.abc import Sequence

from servotwin.wire import dynamixel_frames as frames
from servotwin.wire.packet import Packet
from servotwin.wire.talk import Reply, Talk
from servotwin.wire.x_servo import LENGTH, X

_FAILED, _UNKNOWN, _DATA = 1, 2, 5  # errors: result, instruction, length
_PING_ANSWER, _HEADER = 14, 11  # bytes


class DynamixelTalk(Talk[X]):
    """Protocol 2.0 between packets and servos."""

    def split(self, buffer: bytearray) -> tuple[list[Packet], int]:
        """Take whole packets off a buffer; return them, and how many were bad."""
        return frames.split(buffer)

    def _own(self, one: X, packet: Packet, byte: float) -> list[Reply]:
        return _answers(one, packet, byte)

    def _to_all(self, packet: Packet, listening: Sequence[X], byte: float) -> list[Reply]:
        data, code = packet.data, packet.code
        if code == frames.PING:
            slot = _PING_ANSWER * byte
            return [_reply(one, _ping(one), byte, one.id * slot) for one in sorted(listening, key=lambda one: one.id)]
        if code in (frames.SYNC_READ, frames.FAST_SYNC_READ) and len(data) >= 4:
            asked = [(id, _word(data, 0), _word(data, 2)) for id in data[4:]]
            return self._reads(asked, listening, byte, fast=code == frames.FAST_SYNC_READ)
        if code in (frames.BULK_READ, frames.FAST_BULK_READ):
            asked = [(data[k], _word(data, k + 1), _word(data, k + 3)) for k in range(0, len(data) - 4, 5)]
            return self._reads(asked, listening, byte, fast=code == frames.FAST_BULK_READ)
        if code == frames.SYNC_WRITE and len(data) >= 4:
            count = _word(data, 2)
            step = count + 1
            self._write_each([(data[k], _word(data, 0), data[k + 1:k + step])
                              for k in range(4, len(data) - count, step)] if count else [], listening)
        elif code == frames.BULK_WRITE:
            self._write_each(_bulk(data), listening)
        elif code in (frames.WRITE, frames.REG_WRITE, frames.ACTION, frames.REBOOT, frames.RESET):
            for one in listening:
                _obey(one, packet, to_all=True)
        return []

    def _write_each(self, wanted: Sequence[tuple[int, int, bytes]], listening: Sequence[X]) -> None:
        for id, address, data in wanted:
            for one in listening:
                if one.is_called(id):
                    one.write(address, data)

    def _reads(self, asked: Sequence[tuple[int, int, int]], listening: Sequence[X], byte: float, *,
               fast: bool) -> list[Reply]:
        """Return the answers, one after the other; who is absent leaves a gap (A), or the end of a fast answer."""
        of = {one.id: one for one in reversed(listening) if one.level > 0}
        if fast:
            return _fast(asked, of, byte)
        made, wait = list[Reply](), 0.0
        for id, address, count in asked:
            one = of.get(id)
            if one is not None:
                found = one.read(address, count)
                made.append(_refused(one, found, byte, wait) if isinstance(found, int) else
                            _reply(one, found, byte, wait))
            wait += (_HEADER + count) * byte
        return made


def _fast(asked: Sequence[tuple[int, int, int]], of: dict[int, X], byte: float) -> list[Reply]:
    parts, whole = list[tuple[int, int, bytes]](), 0
    for k, (id, address, count) in enumerate(asked):
        one = of.get(id)
        found = one.read(address, count) if one is not None else 0
        if one is None or isinstance(found, int):
            parts += [(absent, 0, bytes(size)) for absent, _, size in asked[k:]]
            break
        parts.append((id, one.error, found))
        whole += 1
    if not whole:
        return []
    made = frames.fast_answer(parts)
    made = made[:8 + sum(4 + len(data) for _, _, data in parts[:whole])]
    return [Reply(of[asked[0][0]].delay + len(made) * byte, made)]


def _answers(one: X, packet: Packet, byte: float) -> list[Reply]:
    """Return what a servo answers to a packet of its own: nothing, or one packet."""
    data, code = packet.data, packet.code
    one.protect()
    if code == frames.PING:
        return [_reply(one, _ping(one), byte)]
    if code == frames.READ:
        if one.level < 1:
            return []
        if len(data) != 4:
            return [_refused(one, LENGTH, byte)]
        found = one.read(_word(data, 0), _word(data, 2))
        return [_refused(one, found, byte) if isinstance(found, int) else _reply(one, found, byte)]
    level, id = one.level, one.id
    error = _obey(one, packet, to_all=False)
    return [] if level < 2 else [_refused(one, error, byte, id=id)]


def _obey(one: X, packet: Packet, *, to_all: bool) -> int:
    """Do what a packet asks for; return an error, 0 for none."""
    code, data = packet.code, packet.data
    if code == frames.WRITE:
        return one.write(_word(data, 0), data[2:]) if len(data) > 2 else _DATA
    if code == frames.REG_WRITE:
        one.waiting = data
        return 0 if len(data) > 2 else _DATA
    if code == frames.ACTION:
        waiting, one.waiting = one.waiting, None
        return one.write(_word(waiting, 0), waiting[2:]) if waiting is not None and len(waiting) > 2 else 0
    if code == frames.REBOOT:
        one.power_up()
        return 0
    if code == frames.RESET and len(data) == 1:
        if to_all and data[0] == 0xFF:  # it would leave all with one ID
            return _FAILED
        one.reset(keep_id=data[0] in (1, 2), keep_baud=data[0] == 2)
        return 0
    return _UNKNOWN


def _bulk(data: bytes) -> list[tuple[int, int, bytes]]:
    found, at = list[tuple[int, int, bytes]](), 0
    while at + 5 <= len(data):
        count = _word(data, at + 3)
        found.append((data[at], _word(data, at + 1), data[at + 5:at + 5 + count]))
        at += 5 + count
    return found


def _ping(one: X) -> bytes:
    return one.table["Model_Number"].to_bytes(2, "little") + bytes((one.table["Firmware_Version"] & 0xFF,))


def _word(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8


def _reply(one: X, data: bytes, byte: float, wait: float = 0.0) -> Reply:
    whole = frames.answer(one.id, one.error, data)
    return Reply(one.delay + wait + len(whole) * byte, whole)


def _refused(one: X, error: int, byte: float, wait: float = 0.0, *, id: int | None = None) -> Reply:
    whole = frames.answer(one.id if id is None else id, one.error | error)
    return Reply(one.delay + wait + len(whole) * byte, whole)
