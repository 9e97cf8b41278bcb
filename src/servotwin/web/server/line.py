"""Connections as uvicorn holds them, but for those that stay without saying or taking anything."""

from __future__ import annotations

import asyncio
import socket
import sys
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

MOST_CONNECTIONS = 400
PATIENCE = 15.0
"""In which a request has to be said [s]."""
_LONGEST = 300.0  # s until an answer is taken: the largest log comes within that
_LINGER = 3.0  # s that a browser has to take the end of what it was told
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
        """End a connection that does not answer: what it was told is not waited for."""
        super().keepalive_timeout()
        self.transport.abort()

    async def run_asgi(self) -> None:
        """Serve the page; then the connection ends, whether or not the browser takes notice."""
        try:
            await super().run_asgi()
        finally:
            self.loop.call_later(_LINGER, self.transport.abort)
