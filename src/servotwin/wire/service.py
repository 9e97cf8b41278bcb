"""A bus at a port, in wall-clock time."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from servotwin.errors import ServotwinError
from servotwin.wire.keeping import Keep
from servotwin.wire.ports import Link, PtyPort, TcpPort

if TYPE_CHECKING:
    from servotwin.wire.bus import Bus

_LOOK = 1e-3  # s of computing between two looks at the port
_SLICE = 1e-2  # s of simulated time led on at once
_TOGETHER = 1e-3  # s within which answers of several servos go out together, when the last is through
_IDLE = 1e-2  # s between two looks where nothing happens
_BEHIND = 0.05  # s behind the wall clock, from which simulated time loses the difference
_PAUSE = 1.0  # s between two lines on that
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
    """A bus at a port: what comes is answered, and time goes on as the wall clock's.

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
        Told lines that people should know.
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
            if began - self._said_at > _PAUSE:
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
