"""What goes to one browser: the latest push, and short messages in order; a slow one misses pushes."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

_MOST_TEXTS = 256  # that wait: who takes none of them is gone
_SLOWEST = 30.0  # s for one message


class Outbox:
    """The way to one browser.

    A push that comes while another is on its way replaces the one that waits; `missed` counts those.

    Parameters
    ----------
    socket : WebSocket
        That was accepted.
    """

    def __init__(self, socket: WebSocket) -> None:
        self._socket = socket
        self._texts: deque[str] = deque()
        self._push: bytes | None = None
        self._something = asyncio.Event()
        self.missed = 0
        self.closed = False

    @property
    def free(self) -> bool:
        """Whether nothing waits."""
        return self._push is None and not self._texts

    def text(self, text: str) -> None:
        """Send a message; a browser that takes none of many is given up."""
        if len(self._texts) >= _MOST_TEXTS:
            self.closed = True
        else:
            self._texts.append(text)
        self._something.set()

    def push(self, data: bytes) -> None:
        """Send a push, unless a later one comes before its turn."""
        if self._push is not None:
            self.missed += 1
        self._push = data
        self._something.set()

    async def deliver(self) -> None:
        """Send what waits until the browser is gone."""
        while not self.closed:
            await self._something.wait()
            self._something.clear()
            while not self.closed and (self._texts or self._push is not None):
                if self._texts:
                    await asyncio.wait_for(self._socket.send_text(self._texts.popleft()), _SLOWEST)
                    continue
                data, self._push = self._push, None
                if data is not None:
                    await asyncio.wait_for(self._socket.send_bytes(data), _SLOWEST)
