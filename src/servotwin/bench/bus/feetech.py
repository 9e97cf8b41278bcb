"""Servos of Feetech (STS, SMS), through Feetech's package."""

from __future__ import annotations

from servotwin.bench.backends.backend import Backend
from servotwin.bench.bus.sdk_wire import PATIENCE, BusPort, Dialect, SdkWire
from servotwin.errors import MissingExtraError


def feetech_wire(backend: Backend, *, baud: int = 1_000_000, patience: float = PATIENCE) -> SdkWire:
    """Return a wire with Feetech's servos, whose low byte comes first: STS and SMS, not SCS.

    Raises
    ------
    MissingExtraError
        If feetech-servo-sdk is not installed.
    """
    try:
        import scservo_sdk
    except ImportError:
        raise MissingExtraError("feetech-servo-sdk", "bench") from None
    handler = scservo_sdk.PacketHandler(0)

    def ask(port: BusPort, address: int, size: int, ids: list[int]) -> int:
        return int(handler.syncReadTx(port, address, size, ids, len(ids)))

    dialect = Dialect(handler, handler.rxPacket, id_at=2, error_at=4, data_at=5, extra=6, refused=0, sync_read=ask)
    return SdkWire(backend, dialect, baud=baud, patience=patience)
