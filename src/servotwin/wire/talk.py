"""The common part of both protocols: who answers a packet, and what is left where several do."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

from servotwin.wire.device import Device
from servotwin.wire.packet import ALL, Packet

BITS = 10.0  # of a byte on the wire
D = TypeVar("D", bound=Device)


class Reply(NamedTuple):
    """Bytes of a servo's answer, and when the last is through after the packet has come [s]."""

    after: float
    data: bytes


class Talk(ABC, Generic[D]):
    """A protocol between packets and servos."""

    @abstractmethod
    def split(self, buffer: bytearray) -> tuple[list[Packet], int]:
        """Take whole packets off a buffer; return them, and how many were bad."""

    def replies(self, packet: Packet, listening: Sequence[D], byte: float) -> list[Reply]:
        """Return all answers to a packet.

        Parameters
        ----------
        packet : Packet
        listening : sequence of Device
            Those that hear it.
        byte : float
            Time of a byte [s].
        """
        if packet.id == ALL:
            return self._to_all(packet, listening, byte)
        made = [reply for one in listening if one.is_called(packet.id) for reply in self._own(one, packet, byte)]
        return made if len(made) < 2 else [_clash(made)]

    @abstractmethod
    def _to_all(self, packet: Packet, listening: Sequence[D], byte: float) -> list[Reply]:
        """Return the answers to a broadcast."""

    @abstractmethod
    def _own(self, one: D, packet: Packet, byte: float) -> list[Reply]:
        """Return what a servo answers to a packet of its own: nothing, or one packet."""


def _clash(replies: Sequence[Reply]) -> Reply:
    """Return what is left of answers at one time: a line that one pulls low is low."""
    longest = max(replies, key=lambda one: len(one.data))
    left = bytearray(longest.data)
    for one in replies:
        for k, value in enumerate(one.data):
            left[k] &= value
    return Reply(longest.after, bytes(left))
