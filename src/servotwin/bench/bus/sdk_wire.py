"""The wire through the makers' packages: they make and check the packets."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from servotwin.bench.backends.board_backend import Backend
from servotwin.errors import BenchError, MissingExtraError

# --- The port that the makers' packages take --------------------------------------------------------------------------

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

# --- A wire with bus servos: ask one, ask several at once, tell one, tell several at once -----------------------------

class Answer(NamedTuple):
    """The answer of a servo.

    Parameters
    ----------
    data : bytes
    error : int
        Its status byte; 0: all is well.
    sent, received : float
        When the question had gone out and the answer had come, `time.perf_counter` [s].
    """

    data: bytes
    error: int
    sent: float
    received: float

    @property
    def middle(self) -> float:
        """Between question and answer [s]; the servo looked at its registers at most half their distance from it."""
        return 0.5 * (self.sent + self.received)


class BusWire(Protocol):
    """Five things to do with servos on a wire. A packet that is damaged counts as none."""

    @property
    def name(self) -> str:
        """Of the wire, for messages."""

    def open(self) -> None:
        """Take the wire.

        Raises
        ------
        BenchError
            If it is not there, or somebody else has it.
        """

    def ping(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the model numbers of those servos that answer, by id.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def read(self, servo: int, address: int, size: int) -> Answer:
        """Ask a servo for a block of its registers, several times if need be.

        Raises
        ------
        BenchError
            If it does not answer, refuses, or the wire is cut.
        """

    def read_all(self, servos: Sequence[int], address: int, size: int) -> dict[int, Answer]:
        """Ask several servos for the same block, once; those that did not answer are left out.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def write(self, servo: int, address: int, data: bytes) -> None:
        """Write into a servo's registers, and see that it arrived.

        Raises
        ------
        BenchError
            If it did not, or the wire is cut.
        """

    def write_all(self, address: int, data: Mapping[int, bytes]) -> None:
        """Write into several servos' registers at the same instant; nobody answers.

        Raises
        ------
        BenchError
            If the wire is cut.
        """

    def close(self) -> None:
        """Give the wire back."""

# --- The wire through the makers' packages: they make and check the packets -------------------------------------------

PATIENCE = 0.02  # s: a USB adapter may keep what has come for 16 ms
_TRIES = 4  # of a question to one servo
_LISTEN = 4  # packets too many, damaged or of others, that are passed over
_BROKEN = (IndexError, TypeError, ValueError)  # what the packages raise on damaged packets


@dataclass(frozen=True)
class Dialect:
    """How a maker's package is called, and where its packets have what.

    Parameters
    ----------
    handler : object
        Its packet handler.
    receive : callable
        From port to (packet, result).
    id_at, length_at, error_at, data_at, extra : int
        Places in an answer, and what its length counts beside the data.
    refused : int
        Bits of the status byte that say that nothing was done.
    sync_read : callable, optional
        From (port, address, size, ids) to result; None: servos are asked one by one.
    sweep : callable, optional
        From port to {id: model number}, in one question.
    """

    handler: Any
    receive: Callable[[BusPort], tuple[Any, int]]
    id_at: int
    length_at: int
    error_at: int
    data_at: int
    extra: int
    refused: int
    sync_read: Callable[[BusPort, int, int, list[int]], int] | None = None
    sweep: Callable[[BusPort], dict[int, int]] | None = None


class SdkWire:
    """Servos that speak one dialect, on a backend.

    Parameters
    ----------
    backend : Backend
    dialect : Dialect
    baud : int
        [bit/s]
    patience : float
        How long an answer may be late beyond its time on the wire [s].
    """

    def __init__(self, backend: Backend, dialect: Dialect, *, baud: int = 1_000_000,
                 patience: float = PATIENCE) -> None:
        self.port = BusPort(backend, baud, patience)
        self._dialect = dialect

    @property
    def name(self) -> str:
        """The backend's."""
        return self.port.backend.name

    def open(self) -> None:
        """Take the wire."""
        self.port.backend.open()

    def ping(self, ids: Sequence[int]) -> dict[int, int]:
        """Return the model numbers of those servos that answer, by id."""
        if self._dialect.sweep is not None:
            found = self._dialect.sweep(self._ready())
            return {one: found[one] for one in sorted(found) if one in ids}
        return {one: 0 for one in ids if self._answers(one)}

    def _answers(self, servo: int) -> bool:
        packet = [0] * 6  # the packages' own ping asks for the model number, which lies elsewhere in another's servo
        packet[2], packet[3], packet[4] = servo, 2, 1
        try:
            return bool(self._dialect.handler.txRxPacket(self._ready(), packet)[1] == 0)
        except _BROKEN:
            return False

    def read(self, servo: int, address: int, size: int) -> Answer:
        """Ask a servo for a block of its registers."""
        error = 0
        for late in self._tries():
            found = self._asked(servo, address, size)
            if servo in found:
                self._pass_over(late)
                return found[servo]
            error = self._last_error
        raise BenchError(f"servo {servo} at {self.name}", f"it refuses to tell its registers from {address} on"
                         if error & self._dialect.refused else "it does not answer")

    def read_all(self, servos: Sequence[int], address: int, size: int) -> dict[int, Answer]:
        """Ask several servos for the same block, once."""
        if self._dialect.sync_read is not None:
            self._dialect.sync_read(self._ready(), address, size, list(servos))
            return self._hear(servos, size)
        found: dict[int, Answer] = {}
        for servo in servos:
            found |= self._asked(servo, address, size)
        return found

    def write(self, servo: int, address: int, data: bytes) -> None:
        """Write into a servo's registers, and see that it arrived."""
        refused = False
        for late in self._tries():
            try:
                result, error = self._dialect.handler.writeTxRx(self._ready(), servo, address, len(data), list(data))
            except _BROKEN:
                continue
            refused = result == 0
            if refused and not error & self._dialect.refused:
                self._pass_over(2 * late)
                return
            # it may be set to answer questions only
            if not refused and servo in (found := self._asked(servo, address, len(data))):
                if found[servo].data == data:
                    self._pass_over(2 * late)
                    return
                refused = True
        raise BenchError(f"servo {servo} at {self.name}", f"it does not take what is written into register {address}"
                         if refused else "it does not answer")

    def write_all(self, address: int, data: Mapping[int, bytes]) -> None:
        """Write into several servos' registers at the same instant."""
        size = len(next(iter(data.values())))
        words = [byte for servo, one in data.items() for byte in (servo, *one)]
        self._dialect.handler.syncWriteTxOnly(self._ready(), address, size, words, len(words))

    def close(self) -> None:
        """Give the wire back."""
        self.port.backend.close()

    # --- packets ------------------------------------------------------------------------------------------------------

    _last_error = 0

    def _tries(self) -> Iterator[int]:
        """Yield some times, with more patience each: this machine may be what is slow."""
        usual = self.port.patience
        try:
            for k in range(_TRIES):
                self.port.patience = usual * 2**k
                yield k
        finally:
            self.port.patience = usual

    def _pass_over(self, late: int) -> None:
        """Let late answers to earlier questions come: no packet has the address that it answers."""
        if late:
            self.port.setPacketTimeout(0)
        for _ in range(late):
            if self.port.isPacketTimeout():
                break
            with contextlib.suppress(*_BROKEN):
                self._dialect.receive(self.port)

    def _asked(self, servo: int, address: int, size: int) -> dict[int, Answer]:
        self._dialect.handler.readTx(self._ready(), servo, address, size)
        return self._hear([servo], size)

    def _ready(self) -> BusPort:
        self.port.is_using = False  # the packages leave it set behind an error
        return self.port

    def _hear(self, servos: Sequence[int], size: int) -> dict[int, Answer]:
        """Return the answers that come until all are there, or it is too late.

        The packages' own loop takes answers in order, and loses all that follow one that is missing.
        """
        found: dict[int, Answer] = {}
        self._last_error = 0
        for _ in range(len(servos) + _LISTEN):
            if len(found) == len(servos) or self.port.isPacketTimeout():
                break
            try:
                packet, result = self._dialect.receive(self.port)
                if result != 0:
                    continue
                servo, error = packet[self._dialect.id_at], packet[self._dialect.error_at]
                data = bytes(packet[self._dialect.data_at:self._dialect.data_at + size])
            except _BROKEN:
                continue
            self._last_error = error
            if servo in servos and len(data) == size == packet[self._dialect.length_at] - self._dialect.extra:
                found[servo] = Answer(data, error, self.port.sent, time.perf_counter())
        return found


# --- Servos of Robotis (Dynamixel), through Robotis' package: protocol 2 (X, newer MX) and 1 (AX, MX) -----------------

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
    return Dialect(handler, handler.rxPacket, id_at=2, length_at=3, error_at=4, data_at=5, extra=2,
                   refused=8 | 16 | 64)


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
    return Dialect(handler, receive, id_at=4, length_at=5, error_at=8, data_at=9, extra=4, refused=127, sync_read=ask,
                   sweep=sweep)


# --- Servos of Feetech (STS, SMS), through Feetech's package ----------------------------------------------------------

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

    dialect = Dialect(handler, handler.rxPacket, id_at=2, length_at=3, error_at=4, data_at=5, extra=2, refused=0,
                      sync_read=ask)
    return SdkWire(backend, dialect, baud=baud, patience=patience)
