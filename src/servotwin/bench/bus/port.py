"""What the makers' packages take for their port: their own spins while it waits, and has fixed times of its own."""

from __future__ import annotations

import time

from servotwin.bench.backends.backend import Backend

BITS = 10  # of a byte on the wire, with start and stop
_SLICE = 0.01  # s of one read
_BABBLE = 50  # reads until a line that never falls silent is taken as it is


class BusPort:
    """A backend as Feetech's and Robotis' packages see a port; both call these names.

    Parameters
    ----------
    backend : Backend
    baud : int
        [bit/s]
    patience : float
        How long an answer may be late beyond its time on the wire [s].
    """

    is_using = False

    def __init__(self, backend: Backend, baud: int, patience: float) -> None:
        self.backend = backend
        self.patience = patience
        self.sent = 0.0
        self._baud = baud
        self._left = b""
        self._deadline = 0.0

    def getBaudRate(self) -> int:
        """Return the speed of the wire [bit/s]."""
        return self._baud

    def clearPort(self) -> None:
        """Forget what has come: an answer that was too late is not one to the next question."""
        self._left = b""
        for _ in range(_BABBLE):
            if not self.backend.read(0.0):
                break

    def writePort(self, packet: list[int]) -> int:
        """Send a packet, and note when it had gone out."""
        self.backend.send(bytes(packet))
        self.sent = time.perf_counter() + len(packet) * BITS / self._baud
        return len(packet)

    def readPort(self, length: int) -> bytes:
        """Return at most so many bytes; waits for the first a little."""
        if not self._left and length > 0:
            self._left = self.backend.read(max(0.0, min(self._deadline - time.perf_counter(), _SLICE)))
        found, self._left = self._left[:length], self._left[length:]
        return found

    def setPacketTimeout(self, packet_length: int) -> None:
        """Expect an answer of so many bytes."""
        self.setPacketTimeoutMillis(1e3 * (packet_length * BITS / self._baud + self.patience))

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Expect an answer within a time [ms]."""
        self._deadline = time.perf_counter() + 1e-3 * msec

    def isPacketTimeout(self) -> bool:
        """Return whether the answer is too late."""
        return time.perf_counter() > self._deadline
