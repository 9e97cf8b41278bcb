"""Backends, which carry bytes to a bench and back: a serial port, an emulator, a mock."""

from __future__ import annotations

from typing import Protocol


class Backend(Protocol):
    """Four things to do with a wire.

    Time on it is that of the bench: a backend that simulates may run faster or slower than the clock on the wall.
    """

    @property
    def name(self) -> str:
        """Its name in messages: a port, "emulator", "mock"."""

    def open(self) -> None:
        """Take the wire.

        Raises
        ------
        BenchError
            If it is not there, or somebody else has it.
        """

    def send(self, data: bytes) -> None:
        """Put bytes on the wire.

        Raises
        ------
        BenchError
            If it is cut or not open.
        """

    def read(self, timeout: float) -> bytes:
        """Return what has come, at once if something has; else wait for at most `timeout` [s], and maybe return b"".

        Raises
        ------
        BenchError
            If it is cut or not open.
        """

    def close(self) -> None:
        """Give the wire back; of one that is not open nothing happens."""
