"""A bus at a port, in wall-clock time."""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from servotwin.errors import BenchError, InputError, ServotwinError

if TYPE_CHECKING:
    from servotwin.wire.bus import Bus


# --- Where a program finds the wire: a pseudo-terminal, or a TCP port -------------------------------------------------

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
        """Return None: TCP has no speed."""
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


# --- A file in which the stored registers of a bus outlive the process ------------------------------------------------

_PAUSE = 0.1  # s between two writings
_AGAIN = 1.0  # s after one that failed
_FORM = "what servotwin wire --keep has written"


class Keep:
    """The file of a bus; read at once where there is one.

    Parameters
    ----------
    path : path
    bus : Bus
    say : callable
        Called when it cannot be written, and when it can again; the bus continues meanwhile.
    """

    def __init__(self, path: str | Path, bus: Bus, say: Callable[[str], None]) -> None:
        self.path, self._bus, self._say = Path(path), bus, say
        self._due, self._fault = -1e9, ""
        if self.path.exists():
            bus.take_kept(read_kept(self.path, bus))
        elif not self.path.parent.is_dir():
            raise InputError("--keep", got=str(path), allowed="a file in a folder that there is")

    def save(self, *, always: bool = False) -> None:
        """Write the file where something has changed, not too often unless `always`; if that fails, later again."""
        now = time.monotonic()
        if not self._bus.to_keep or (not always and now < self._due):
            return
        try:
            self._write()
        except OSError as error:
            self._due, fault = now + _AGAIN, error.strerror or str(error)
            if fault != self._fault or always:
                end = "what is stored is lost" if always else "tried again every second"
                self._say(f"registers cannot be kept in {self.path} ({fault}): {end}")
            self._fault = fault
            return
        if self._fault:
            self._say(f"registers are kept in {self.path} again")
        self._due, self._fault = now + _PAUSE, ""
        self._bus.to_keep = False  # not before: an interrupt may come at any time, and saves what is left

    def _write(self) -> None:
        text = json.dumps({"servotwin": "wire", "protocol": self._bus.protocol, "servos": self._bus.kept()}, indent=1)
        beside = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            beside.write_text(text + "\n", "utf-8")
            beside.replace(self.path)
        except OSError:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise


def read_kept(path: Path, bus: Bus) -> dict[str, dict[str, int]]:
    """Return the registers by servo of a file.

    Raises
    ------
    InputError
        If it is none, or of other servos.
    """
    try:
        found: Any = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise InputError(f"{path}", got="no JSON", allowed=_FORM) from None
    servos = found.get("servos") if isinstance(found, dict) and found.get("servotwin") == "wire" else None
    if not isinstance(servos, dict) or not all(
            isinstance(one, dict) and all(type(value) is int for value in one.values()) for one in servos.values()):
        raise InputError(f"{path}", got="something else", allowed=_FORM)
    if found.get("protocol") != bus.protocol or not set(servos) <= {str(id) for id in bus.ids}:
        raise InputError(f"{path}", got=f"{found.get('protocol')}, IDs {', '.join(servos)}",
                         allowed=f"{bus.protocol}, IDs {', '.join(str(id) for id in bus.ids)}")
    for id, one in servos.items():
        registers = bus.device(int(id)).table.registers
        unknown = next((name for name in one if name not in registers), None)
        if unknown is not None:
            raise InputError(f"{path}: servo {id}", got=unknown, allowed="names of its registers")
    return servos


# --- A bus at a port, in wall-clock time ------------------------------------------------------------------------------

_LOOK = 1e-3  # s of computing between two looks at the port
_SLICE = 1e-2  # s of simulated time led on at once
_TOGETHER = 1e-3  # s within which answers of several servos go out together, when the last is through
_IDLE = 1e-2  # s between two looks where nothing happens
_BEHIND = 0.05  # s behind the wall clock, from which simulated time loses the difference
_LOOK_PAUSE = 1.0  # s between two lines on that
_TIMES = 20000  # answers whose cost is remembered


@dataclass
class Timing:
    """How a service keeps up.

    Parameters
    ----------
    lost : float
        Simulated time that was given up [s].
    losses : int
        How often.
    dropped : int
        Bytes of answers that nobody read.
    costs : deque of float
        Processor time from the last byte read to the answer written, holding apart [s].
    """

    lost: float = 0.0
    losses: int = 0
    dropped: int = 0
    costs: deque[float] = field(default_factory=lambda: deque(maxlen=_TIMES))


class Service:
    """A bus at a port: what comes is answered, and time advances as the wall clock's.

    Parameters
    ----------
    bus : Bus
    tcp : (str, int), optional
        Address and port instead of a pseudo-terminal; 0: any that is free.
    link : path, optional
        Where a link to the port shall be.
    keep : path, optional
        File in which what is stored outlives the process.
    say : callable, optional
        Called with lines for the user.
    each : callable, optional
        Called with the bus before each piece of simulated time, such as to move a hand.

    Attributes
    ----------
    port : str
    timing : Timing
    """

    def __init__(self, bus: Bus, *, tcp: tuple[str, int] | None = None, link: str | Path | None = None,
                 keep: str | Path | None = None, say: Callable[[str], None] | None = None,
                 each: Callable[[Bus], None] | None = None) -> None:
        self.bus, self.timing = bus, Timing()
        self._say, self._each = say or (lambda line: None), each
        self._keep = Keep(keep, bus, self._say) if keep is not None else None
        self._link = Link(link) if link is not None else None
        if self._link is not None:
            self._link.check()
        bus.advance(2e-3)  # kernels are there before anybody finds the port
        bus.advance(7e-4)
        bus.seen(bus.ids[0])
        self._port: PtyPort | TcpPort = PtyPort() if tcp is None else TcpPort(*tcp)
        self.port = self._port.name
        self._wake, self._waker = socket.socketpair()  # which Windows can wait for too
        self._thread: threading.Thread | None = None
        self._ended = False
        self._asked: float | None = None
        self._held = b""
        self._said_at = -1e9
        self.error: ServotwinError | None = None
        if self._link is not None:
            try:
                self._link.make(self.port)
            except BaseException:
                self._close()
                raise
            self.link = str(self._link.path)

    @property
    def tells_rate(self) -> bool:
        """Whether the client's speed is seen here."""
        return self._port.tells_rate

    def start(self) -> None:
        """Serve in a thread."""
        self._thread = threading.Thread(target=self.run, daemon=True, name="servotwin wire")
        self._thread.start()

    def end(self) -> None:
        """Let `run` come to its end."""
        self._ended = True
        with contextlib.suppress(OSError):  # it is over already
            self._waker.send(b".")

    def stop(self) -> None:
        """End, and take the link away."""
        self.end()
        if self._thread is not None:
            self._thread.join()
        self.tidy()
        self._close()

    def _close(self) -> None:
        for one in (self._port, self._wake, self._waker):
            one.close()

    def tidy(self) -> None:
        """Keep what is stored, and take the link away: all that outlives the process."""
        if self._keep is not None:
            self._keep.save(always=True)
        if self._link is not None:
            self._link.remove()

    # --- the loop -----------------------------------------------------------------------------------------------------

    def run(self, duration: float | None = None) -> None:
        """Serve until `stop`, or for a time [s]."""
        try:
            self._serve(duration)
        except ServotwinError as error:
            self.error = error
            self._say(str(error))

    def _serve(self, duration: float | None) -> None:
        bus, clock = self.bus, time.monotonic
        start = clock() - bus.time
        end = None if duration is None else clock() + duration
        while not self._ended and (end is None or clock() < end):
            with bus.lock:
                start = self._follow(start)
                self._finish()
                due = bus.due_within(_TOGETHER)
                wait = max(due + start - clock(), 0.0) if due is not None else _IDLE
                behind = clock() - start - bus.time > _IDLE
            if end is not None:
                wait = min(wait, max(end - clock(), 0.0))
            ready = select.select([self._port, self._wake], [], [], 0.0 if behind else min(wait, _IDLE))[0]
            if self._port in ready:
                data = self._port.read()
                if data:
                    with bus.lock:
                        start = self._follow(start)
                        self._hear(data)
        with bus.lock:
            self._finish()

    def _hear(self, data: bytes) -> None:
        """Take bytes, and note what it costs from here to the answer."""
        began = time.thread_time()
        self.bus.rate = self._port.rate()
        self.bus.write(data)
        self._asked = began if self.bus.due is not None else None

    def _follow(self, start: float) -> float:
        """Lead the bus on to the wall clock, as far as a look allows; return where that has its zero."""
        bus, clock = self.bus, time.monotonic
        began = clock()
        behind = began - start - bus.time
        if behind > _BEHIND:
            start += behind
            self.timing.lost += behind
            self.timing.losses += 1
            if began - self._said_at > _LOOK_PAUSE:
                self._said_at = began
                self._say(f"{1e3 * behind:.0f} ms behind: simulated time has lost them "
                          f"({self.timing.lost:.2f} s so far)")
        target = began - start  # where the clock is by the end is for the next look
        while (left := target - bus.time) > 0.0:
            if self._each is not None:
                self._each(bus)
            self._held += bus.advance(min(left, _SLICE))
            if self._held and not (bus.due is not None and bus.due - bus.time <= _TOGETHER):
                self._answer()
            if clock() - began > _LOOK:
                break
        return start

    def _answer(self) -> None:
        """Write what is through, and note what it has cost since the question."""
        self.timing.dropped += len(self._held) - self._port.write(self._held)
        self._held = b""
        if self._asked is not None:
            self.timing.costs.append(time.thread_time() - self._asked)
            self._asked = None

    def _finish(self) -> None:
        """Say what was noted, and keep what is stored."""
        said = self.bus.counts.said
        if said:
            self.bus.counts.said = []
            for line in said:
                self._say(line)
        if self._keep is not None:
            self._keep.save()
