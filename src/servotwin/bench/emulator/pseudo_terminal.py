"""The wire of a board as a pseudo-terminal: any program that opens serial ports takes it for one."""

from __future__ import annotations

import errno
import os
import select
import sys
import time as clock
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from servotwin.errors import BenchError

if TYPE_CHECKING:
    from servotwin.bench.backends.board_backend import Backend

_STEP = 2e-3  # s of the board between two looks at the terminal
_MOST = 65536  # bytes
_FULL = 1 << 16  # bytes that wait for a program that does not read; older ones are lost, as on a serial port


class Terminal:
    """A pseudo-terminal in front of a backend; what a program writes is sent, what the board says can be read.

    Bytes written before a program has opened it are lost, as with a board that is not plugged in: a program has to
    shake hands. A program that closes it and opens it again finds the board as it was left.

    Parameters
    ----------
    backend : Backend
        Best one that keeps time with the clock on the wall; it is opened and closed with the terminal.

    Raises
    ------
    BenchError
        If this system has no pseudo-terminals.

    Examples
    --------
    >>> from servotwin.bench.backends.emulated import MockBackend
    >>> with Terminal(MockBackend()) as terminal:
    ...     terminal.serve(0.01)
    ...     terminal.port[:5]
    '/dev/'
    """

    def __init__(self, backend: Backend) -> None:
        if sys.platform == "win32":
            raise BenchError("pseudo-terminal", "Windows has none; leave --pty away")
        self.backend = backend
        self._master = self._slave = -1
        self._waiting = b""
        self.port = ""
        """Name of the port, once it is open."""

    def __enter__(self) -> Terminal:
        self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def open(self) -> None:
        """Make the terminal and switch the board on."""
        import tty

        self.backend.open()
        try:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.port = os.ttyname(self._slave)
            os.close(self._slave)  # so that it is seen when a program opens and closes it
        except OSError as error:
            self.close()
            raise BenchError("pseudo-terminal", error.strerror or str(error)) from None

    def close(self) -> None:
        """Take the terminal away and switch the board off."""
        if self._master >= 0:
            os.close(self._master)
            self._master = -1
        self.backend.close()

    def serve(self, seconds: float | None = None, *, go_on: Callable[[], bool] = lambda: True) -> None:
        """Carry bytes to and fro.

        Parameters
        ----------
        seconds : float, optional
            On the clock on the wall; until it is interrupted unless given.
        go_on : callable
            Asked every few milliseconds.
        """
        end = None if seconds is None else clock.monotonic() + seconds
        while go_on() and (end is None or clock.monotonic() < end):
            self.step()

    def step(self) -> None:
        """Take what a program has written, advance the board a little, and pass on what it has said."""
        written = self._taken()
        if written:
            self.backend.send(written)
        self._waiting = (self._waiting + self.backend.read(_STEP))[-_FULL:]
        poll = select.poll()
        poll.register(self._master, select.POLLHUP)
        opened = not any(event & select.POLLHUP for _, event in poll.poll(0))
        if not opened:
            self._waiting = b""  # nobody listens: a program that comes later hears what comes then
            return
        try:
            self._waiting = self._waiting[os.write(self._master, self._waiting):]
        except OSError as error:
            if error.errno not in (errno.EAGAIN, errno.EIO):
                raise BenchError(self.port, error.strerror or str(error)) from None

    def _taken(self) -> bytes:
        try:
            return os.read(self._master, _MOST)
        except OSError as error:  # EIO: nobody has it open
            if error.errno in (errno.EAGAIN, errno.EIO):
                return b""
            raise BenchError(self.port, error.strerror or str(error)) from None
