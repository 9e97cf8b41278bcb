"""Answers of Feetech's servos to a packet, and when."""

from __future__ import annotations

from collections.abc import Sequence

from servotwin.wire import feetech_frames as frames
from servotwin.wire.packet import Packet
from servotwin.wire.sts import Sts
from servotwin.wire.talk import Reply, Talk

_MIDDLE_BYTES = 2


class FeetechTalk(Talk[Sts]):
    """Feetech's protocol between packets and servos."""

    def split(self, buffer: bytearray) -> tuple[list[Packet], int]:
        """Take whole packets off a buffer; return them, and how many were bad."""
        return frames.split(buffer)

    def _own(self, one: Sts, packet: Packet, byte: float) -> list[Reply]:
        return _answers(one, packet, byte)

    def _to_all(self, packet: Packet, listening: Sequence[Sts], byte: float) -> list[Reply]:
        data = packet.data
        if packet.code == frames.PING:
            slot = 6 * byte
            return [_reply(one, b"", byte, one.id * slot) for one in sorted(listening, key=lambda one: one.id)]
        if packet.code == frames.SYNC_READ and len(data) >= 2:
            return self._sync_read(data[0], data[1], data[2:], listening, byte)
        if packet.code == frames.SYNC_WRITE and len(data) >= 2 and data[1]:
            self._sync_write(data[0], data[1], data[2:], listening)
        elif packet.code in (frames.WRITE, frames.REG_WRITE, frames.ACTION, frames.RESET, frames.SET_POSITION):
            for one in listening:
                _obey(one, packet)
        return []

    def _sync_read(self, address: int, count: int, ids: bytes, listening: Sequence[Sts], byte: float) -> list[Reply]:
        """Return the answers: each at its place in the list, so that who is absent leaves a gap."""
        of = {one.id: one for one in reversed(listening)}
        slot, made = (6 + count) * byte, list[Reply]()
        for place, id in enumerate(ids):
            one = of.get(id)
            data = one.read(address, count) if one is not None else None
            if one is not None and data is not None:
                made.append(_reply(one, data, byte, place * slot))
        return made

    def _sync_write(self, address: int, count: int, data: bytes, listening: Sequence[Sts]) -> None:
        of = {id: [one for one in listening if one.is_called(id)] for id in data[::count + 1]}
        for at in range(0, len(data) - count, count + 1):
            for one in of[data[at]]:
                one.write(address, data[at + 1:at + 1 + count])


def _answers(one: Sts, packet: Packet, byte: float) -> list[Reply]:
    """Return what a servo answers to a packet of its own: nothing, or one packet."""
    data = packet.data
    if packet.code == frames.PING:
        return [_reply(one, b"", byte)]
    if packet.code == frames.READ:
        found = one.read(data[0], data[1]) if len(data) == 2 else None
        return [] if found is None else [_reply(one, found, byte)]
    answers, id = one.answers_writes, one.id
    if not _obey(one, packet) or not answers:
        return []
    return [_reply(one, b"", byte, id=id)]


def _obey(one: Sts, packet: Packet) -> bool:
    """Do what a packet asks for; return whether there is such an instruction."""
    code, data = packet.code, packet.data
    if code == frames.WRITE and len(data) > 1:
        one.write(data[0], data[1:])
    elif code == frames.REG_WRITE and len(data) > 1:
        one.waiting = data
    elif code == frames.ACTION:
        waiting, one.waiting = one.waiting, None
        if waiting is not None:
            one.write(waiting[0], waiting[1:])
    elif code == frames.RESET:
        one.reset()
    elif code == frames.SET_POSITION and len(data) in (0, _MIDDLE_BYTES):
        one.centre(int.from_bytes(data, "little") & 0x0FFF if data else 2048)
    else:
        return False  # the boot loader (0x08) too
    return True


def _reply(one: Sts, data: bytes, byte: float, wait: float = 0.0, *, id: int | None = None) -> Reply:
    whole = frames.frame(one.id if id is None else id, one.status(), data)
    return Reply(one.delay + wait + len(whole) * byte, whole)
