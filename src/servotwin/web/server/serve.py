"""Run the server until it is interrupted."""

from __future__ import annotations

import asyncio
import socket
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from servotwin.errors import InputError, MissingExtraError
from servotwin.web.live import LiveBench, Scene, SceneServo
from servotwin.web.server.messages import LONGEST_MESSAGE

# --- Connections as uvicorn holds them, but for those that stay without saying or taking anything ---------------------

MOST_CONNECTIONS = 400
PATIENCE = 15.0
"""In which a request has to be said [s]."""
_LONGEST = 300.0  # s until an answer is taken: the largest log comes within that
_LINGER = 3.0  # s that a browser has to take the end of what it was sent
_UNSENT = 65536  # bytes that the system keeps of what a browser has not taken: old pushes are worth nothing
_UNWRITTEN = 16384  # bytes that wait here


class Door(H11Protocol):
    """A connection that asks; one too many, or one that asks nothing, is cut."""

    _asked: Any = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, if there is room."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self.loop.call_later(PATIENCE, self._look, 0.0)

    def _look(self, waited: float) -> None:
        """Cut a connection that has asked nothing since the last look, or takes too long over an answer."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:  # gone, or it became a `Line`
            return
        busy = self.cycle is not None and not self.cycle.response_complete
        waited = waited + PATIENCE if busy and self.cycle is self._asked else 0.0
        if (not busy and self.cycle is self._asked) or waited >= _LONGEST:
            self.transport.abort()
            return
        self._asked = self.cycle
        self.loop.call_later(PATIENCE, self._look, waited)


class Line(WebSocketsSansIOProtocol):
    """The way to a page; what is not taken does not pile up, and an end is one."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin."""
        super().connection_made(transport)
        self.transport.set_write_buffer_limits(high=_UNWRITTEN)
        own = self.transport.get_extra_info("socket")
        if own is not None and sys.platform in ("linux", "darwin"):
            option = getattr(socket, "TCP_NOTSENT_LOWAT", 25 if sys.platform == "linux" else 0x201)
            try:
                own.setsockopt(socket.IPPROTO_TCP, option, _UNSENT)
            except OSError:  # an old system: it keeps more
                return

    def keepalive_timeout(self) -> None:
        """End a connection that does not answer: what it was sent is not waited for."""
        super().keepalive_timeout()
        self.transport.abort()

    async def run_asgi(self) -> None:
        """Serve the page; then the connection ends, whether or not the browser takes notice."""
        try:
            await super().run_asgi()
        finally:
            self.loop.call_later(_LINGER, self.transport.abort)


# --- The bench that a page shows first --------------------------------------------------------------------------------

SERVO = "hitec-hs-755hb"
"""The paper's servo."""


def first_scene() -> Scene:
    """Return the paper's servo, pulse by pulse.

    Examples
    --------
    >>> [one.model for one in first_scene().servos]
    ['PulseServo']
    """
    return Scene(servos=(SceneServo(id=SERVO, model="PulseServo"),), load={"inertia": 1e-4})


# --- Run the server until it is interrupted ---------------------------------------------------------------------------

LOOPBACK = "127.0.0.1"
PING = 20.0
"""How often a page is asked whether it is there, and how long it may take to say so [s]."""
_HAND_OVER = 1e-3  # s after which a thread that computes lets the benches have a turn


class Links(NamedTuple):
    """Where the page is: for everyone, and, in a class, for the teacher, with the code for watchers."""

    page: str
    teacher: str | None = None
    code: str | None = None


def serve(scene: Scene, *, host: str = LOOPBACK, port: int = 8000, classroom: bool = False,
          ready: Callable[[Links], object] | None = None) -> None:
    """Serve the page until the process is interrupted.

    Parameters
    ----------
    scene : Scene
        The bench that the page shows first.
    host : str
        Address to listen at; the loopback unless given.
    port : int
        0: any that is free.
    classroom : bool
        Whether there is one bench, which the teacher steers and others watch.
    ready : callable, optional
        Called with the `Links` as soon as the server listens.

    Raises
    ------
    MissingExtraError
        If starlette, uvicorn or websockets is not installed.
    ServotwinError
        If the bench is not possible, the address is not one to listen at, or the port is taken.
    """
    try:
        import uvicorn
        import websockets  # noqa: F401 - uvicorn speaks through it

        from servotwin.web.server.app import application, names_of
    except ImportError as error:
        raise MissingExtraError(error.name or "uvicorn", "web") from None
    LiveBench(replace(scene, end=0.0))  # raises if there is no such bench
    listening = _listening(host, port)
    with listening:
        port = listening.getsockname()[1]
        app, house = application(scene, names_of(host, port), classroom=classroom)
        sys.setswitchinterval(_HAND_OVER)
        config = uvicorn.Config(app, log_level="critical", access_log=False, server_header=False, http=Door, ws=Line,
                                ws_max_size=LONGEST_MESSAGE, ws_ping_interval=PING, ws_ping_timeout=PING,
                                ws_per_message_deflate=False, timeout_graceful_shutdown=1,
                                h11_max_incomplete_event_size=65536)
        if ready is not None:
            ready(_links(host, port, house.teacher, house.code))
        uvicorn.Server(config).run(sockets=[listening])


def _links(host: str, port: int, teacher: str | None, code: str | None) -> Links:
    from servotwin.web.server.app import names_of

    shown = host
    if host in ("0.0.0.0", "::"):
        others = sorted(name for name in names_of(host, port) if name[0].isdigit() and not name.startswith("127."))
        shown = others[0].rpartition(":")[0] if others else LOOPBACK
    page = f"http://{f'[{shown}]' if ':' in shown and not shown.startswith('[') else shown}:{port}/"
    return Links(page, None if teacher is None else f"{page}?teacher={teacher}", code)


def _listening(host: str, port: int) -> socket.socket:
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError):
        raise InputError("host", got=host,
                         allowed="an address of this computer, such as 127.0.0.1 or 0.0.0.0") from None
    found = socket.socket(family, kind, protocol)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind(address)
        found.listen(128)
    except OSError as error:
        found.close()
        if error.errno in (98, 48, 10048):
            raise InputError(f"port {port}", got="one that another program listens at",
                             allowed="one that is free, or --port 0 for any") from None
        raise InputError(f"address {host} port {port}", got=error.strerror or "not possible",
                         allowed="an address of this computer, and a port that you may use") from None
    return found
