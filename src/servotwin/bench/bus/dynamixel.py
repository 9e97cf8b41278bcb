"""Servos of Robotis (Dynamixel), through Robotis' package: protocol 2 (X, newer MX) and 1 (AX, MX)."""

from __future__ import annotations

from typing import Any

from servotwin.bench.backends.backend import Backend
from servotwin.bench.bus.sdk_wire import PATIENCE, BusPort, Dialect, SdkWire
from servotwin.errors import MissingExtraError


def dynamixel_wire(backend: Backend, protocol: int = 2, *, baud: int = 1_000_000,
                   patience: float = PATIENCE) -> SdkWire:
    """Return a wire with Dynamixels of a protocol, 2 or 1.

    Raises
    ------
    MissingExtraError
        If dynamixel-sdk is not installed.
    """
    try:
        import dynamixel_sdk
    except ImportError:
        raise MissingExtraError("dynamixel-sdk", "bench") from None
    handler = dynamixel_sdk.PacketHandler(float(protocol))
    return SdkWire(backend, _two(handler) if protocol == 2 else _one(handler), baud=baud, patience=patience)


def _one(handler: Any) -> Dialect:
    # of the status byte: range, checksum, instruction
    return Dialect(handler, handler.rxPacket, id_at=2, error_at=4, data_at=5, extra=6, refused=8 | 16 | 64)


def _two(handler: Any) -> Dialect:
    def ask(port: BusPort, address: int, size: int, ids: list[int]) -> int:
        return int(handler.syncReadTx(port, address, size, ids, len(ids), False))

    def receive(port: BusPort) -> tuple[Any, int]:
        packet, result = handler.rxPacket(port, False)
        return packet, result

    def sweep(port: BusPort) -> dict[int, int]:
        found, _ = handler.broadcastPing(port)
        return {int(one): int(said[0]) for one, said in found.items()}

    # of the status byte: all but the alert
    return Dialect(handler, receive, id_at=4, error_at=8, data_at=9, extra=11, refused=127, sync_read=ask, sweep=sweep)
