"""A serial port: the USB plug of an Uno or a Nano, or a pseudo-terminal."""

from __future__ import annotations

import contextlib
import errno
import re
from typing import TYPE_CHECKING, NamedTuple

from servotwin.bench.wire.frames import protocol
from servotwin.errors import BenchError, MissingExtraError

if TYPE_CHECKING:
    from typing import Any

_NUMBER = re.compile(r"[(\[](?:Errno )?(\d+)[,\]]")
_MOST = 65536  # bytes of one read
_MEANING = {
    errno.ENOENT: "there is no such port; servotwin bench list shows those that there are",
    errno.EACCES: "you may not use it (on Linux: sudo usermod -aG dialout $USER, then log in again)",
    errno.EBUSY: "another program has it",
    errno.ENOTTY: "it is no serial port",
    errno.EIO: "the cable is gone",
    errno.ENXIO: "the cable is gone",
    errno.EISDIR: "it is a folder",
}


class PortFound(NamedTuple):
    """A serial port of this computer.

    Parameters
    ----------
    device, description : str
        Name to open the port by, and the name of the device at it.
    identity : str
        USB vendor and product, empty where it is none.
    """

    device: str
    description: str
    identity: str


def serial_ports() -> list[PortFound]:
    """Return the serial ports of this computer.

    Raises
    ------
    MissingExtraError
        If pyserial is not installed.
    """
    _pyserial()
    from serial.tools.list_ports import comports

    return sorted(PortFound(str(one.device), str(one.description or ""),
                            f"{one.vid:04x}:{one.pid:04x}" if one.vid is not None else "") for one in comports())


class SerialBackend:
    """A serial port as a backend; exclusive, so that no other program reads along.

    Parameters
    ----------
    port : str
        Such as "/dev/ttyUSB0" or "COM3".
    baud : int
        That of the protocol unless given [bit/s].
    """

    def __init__(self, port: str, baud: int | None = None) -> None:
        self._port = port
        self._baud = int(protocol().numbers["baud"]) if baud is None else baud
        self._open: Any = None

    @property
    def name(self) -> str:
        """The port."""
        return f"port {self._port}"

    def open(self) -> None:
        """Take the port for this program alone."""
        serial = _pyserial()
        try:
            self._open = serial.Serial(self._port, self._baud, timeout=0, write_timeout=1.0, exclusive=True)
        except (OSError, ValueError) as error:
            raise self._failed(error) from None
        # an FTDI chip else keeps what has come for 16 ms; Linux only, and not every driver has it
        with contextlib.suppress(OSError, ValueError, AttributeError, NotImplementedError):
            self._open.set_low_latency_mode(True)

    def send(self, data: bytes) -> None:
        """Write all bytes."""
        try:
            self._opened.write(data)
        except OSError as error:
            raise self._failed(error) from None

    def read(self, timeout: float) -> bytes:
        """Return what has come."""
        port = self._opened
        try:
            there = port.in_waiting
            if there:
                return bytes(port.read(min(there, _MOST)))
            port.timeout = timeout
            first = port.read(1)
            return bytes(first + port.read(min(port.in_waiting, _MOST)) if first else first)
        except (OSError, TypeError) as error:  # TypeError: pyserial's own, where another thread closed it
            raise self._failed(error) from None

    def close(self) -> None:
        """Give the port back."""
        if self._open is not None:
            with contextlib.suppress(OSError):
                self._open.close()
            self._open = None

    @property
    def _opened(self) -> Any:
        if self._open is None:
            raise BenchError(self.name, "it is not open")
        return self._open

    def _failed(self, error: Exception) -> BenchError:
        number = getattr(error, "errno", None)
        text = str(error)
        if number is None and (found := _NUMBER.search(text)):  # pyserial puts the system's words into its own
            number = int(found[1])
        if "exclusively lock" in text or "PermissionError" in text:
            number = errno.EBUSY
        if "readiness" in text or "disconnected" in text:
            number = errno.EIO
        return BenchError(self.name, _MEANING.get(number or 0) or text)


def _pyserial() -> Any:
    try:
        import serial
    except ImportError:
        raise MissingExtraError("pyserial", "bench") from None
    return serial
