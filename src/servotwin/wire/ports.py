"""Where a program finds the wire: a pseudo-terminal, or a TCP port."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from pathlib import Path

from servotwin.errors import BenchError, InputError

_MOST = 65536  # bytes of one read
_TCGETS2, _SIZE, _SPEED_AT = 0x802C542A, 44, 40  # Linux on x86 and ARM: struct termios2, its output speed
_UNSET = 110  # bit/s of a port that nobody has set yet: no program talks to servos so slowly


class PtyPort:
    """A pseudo-terminal, raw on both ends; the slave stays open here, so that clients may come and go.

    Raises
    ------
    BenchError
        If this system has none.
    """

    def __init__(self) -> None:
        try:
            import termios
            import tty

            self._master, self._slave = os.openpty()
        except (ImportError, OSError, AttributeError) as error:
            raise BenchError("pseudo-terminal", f"this system gives none ({error}); --tcp serves instead") from None
        tty.setraw(self._master)
        tty.setraw(self._slave)
        modes = termios.tcgetattr(self._slave)
        modes[4] = modes[5] = termios.B110
        termios.tcsetattr(self._slave, termios.TCSANOW, modes)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self.tells_rate = self._raw_rate() == _UNSET

    def fileno(self) -> int:
        """Return what tells that something has come."""
        return self._master

    def read(self) -> bytes:
        """Return what has come."""
        try:
            return os.read(self._master, _MOST)
        except OSError:
            return b""

    def write(self, data: bytes) -> int:
        """Write as much as fits; return how many bytes: what nobody reads is lost."""
        try:
            return os.write(self._master, data)
        except OSError:
            return 0

    def rate(self) -> float | None:
        """Return the speed that the client has set [bit/s]; None where that cannot be known, or nobody has."""
        if not self.tells_rate:
            return None
        found = self._raw_rate()
        return None if found in (None, _UNSET) else found

    def _raw_rate(self) -> float | None:
        import fcntl

        try:
            found = fcntl.ioctl(self._master, _TCGETS2, bytes(_SIZE))
        except OSError:
            return None
        return float(struct.unpack_from("=I", found, _SPEED_AT)[0])

    def close(self) -> None:
        """Give it up."""
        for one in (self._master, self._slave):
            with contextlib.suppress(OSError):
                os.close(one)


class TcpPort:
    """A TCP port for pyserial's `socket://`, one client at a time.

    Parameters
    ----------
    host : str
    port : int
        0: any that is free.
    """

    tells_rate = False

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        try:
            self._listener = socket.create_server((host, port))
        except (OSError, OverflowError) as error:
            raise InputError("--tcp", got=f"{host}:{port}", allowed=f"a port that is free ({error})") from None
        self._listener.setblocking(False)
        self._client: socket.socket | None = None
        self.name = f"socket://{host}:{self._listener.getsockname()[1]}"

    def fileno(self) -> int:
        """Return what tells that something has come, or somebody."""
        return (self._client or self._listener).fileno()

    def read(self) -> bytes:
        """Return what has come."""
        if self._client is None:
            try:
                self._client, _ = self._listener.accept()
            except OSError:
                return b""
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._client.recv(_MOST)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._client.close()
            self._client = None
        return data

    def write(self, data: bytes) -> int:
        """Write as much as fits; return how many bytes."""
        if self._client is None:
            return 0
        try:
            return self._client.send(data)
        except OSError:
            return 0

    def rate(self) -> float | None:
        """Return None: TCP knows no speed."""
        return None

    def close(self) -> None:
        """Give it up."""
        if self._client is not None:
            self._client.close()
        self._listener.close()


class Link:
    """A symbolic link to a port, which goes with it.

    Raises
    ------
    InputError
        If there is something else at the path; a link to a port that is no more is replaced.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._mine = False

    def check(self) -> None:
        """Raise where the link cannot be."""
        if self.path.is_symlink() and not self.path.exists():
            return
        if os.path.lexists(self.path):
            raise InputError("--link", got=str(self.path), allowed="a path where nothing is yet")
        if not self.path.parent.is_dir():
            raise InputError("--link", got=str(self.path), allowed="a path in a folder that there is")

    def make(self, target: str) -> None:
        """Let the link be there, at once and whole."""
        self.check()
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        try:
            self.path.symlink_to(target)
        except OSError as error:
            raise InputError("--link", got=str(self.path), allowed=f"a path that can be made ({error})") from None
        self._mine = True

    def remove(self) -> None:
        """Take it away."""
        if self._mine:
            self._mine = False
            with contextlib.suppress(OSError):
                self.path.unlink()
