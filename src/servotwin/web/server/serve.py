"""Run the server until it is interrupted."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from servotwin.errors import InputError, MissingExtraError
from servotwin.web.live import LiveBench
from servotwin.web.server.limits import LONGEST_MESSAGE

if TYPE_CHECKING:
    from servotwin.web.live import Scene

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
        Is told the `Links` as soon as the server listens.

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

        from servotwin.web.server.app import application
        from servotwin.web.server.guard import names_of
        from servotwin.web.server.line import Door, Line
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
    from servotwin.web.server.guard import names_of

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
