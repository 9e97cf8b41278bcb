"""What goes to one browser: the latest push, and short messages in order; a slow one misses pushes."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

_MOST_TEXTS = 256  # that wait: who takes none of them is gone
_MOST_LETTERS = 20_000_000  # of them, beside the one that comes
_FEW = 4  # texts that wait, and the browser may say more
SLOWEST = 30.0
"""How long a browser may take over one message [s]."""


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
        self._letters = 0  # of all texts
        self._push: Callable[[], bytes] | None = None
        self._something, self._room = asyncio.Event(), asyncio.Event()
        self._room.set()
        self.missed = self._sent = self._taken = 0
        self.closed = False

    @property
    def free(self) -> bool:
        """Whether nothing waits."""
        return self._push is None and not self._texts

    def text(self, text: str) -> None:
        """Send a message; a browser that takes none of many is given up."""
        if len(self._texts) >= _MOST_TEXTS or self._letters > _MOST_LETTERS:
            self.closed = True
        else:
            self._texts.append(text)
            self._letters += len(text)
            if len(self._texts) >= _FEW:
                self._room.clear()
        self._something.set()

    def push(self, packed: Callable[[], bytes]) -> None:
        """Send a push, unless a later one comes before its turn: only then it is packed."""
        if self._push is not None:
            self.missed += 1
        self._push = packed
        self._something.set()

    async def room(self) -> None:
        """Wait until few messages wait: who does not listen is not listened to."""
        await self._room.wait()

    async def deliver(self) -> None:
        """Send what waits until the browser is gone, or does not take it."""
        sending, watching = asyncio.create_task(self._send()), asyncio.create_task(self._watch())
        try:
            await asyncio.wait([sending, watching], return_when=asyncio.FIRST_COMPLETED)
        finally:
            sending.cancel()
            watching.cancel()
            await asyncio.gather(sending, watching, return_exceptions=True)

    async def _send(self) -> None:
        while not self.closed:
            await self._something.wait()
            self._something.clear()
            while not (self.closed or self.free):
                self._sent += 1
                await self._send_next()
                self._taken = self._sent

    async def _watch(self) -> None:
        """Return when a message has been on its way for too long: one look for all is cheaper than a timer for each."""
        last = 0
        while self._taken == self._sent or self._sent != last:
            last = self._sent
            await asyncio.sleep(SLOWEST)

    async def _send_next(self) -> None:
        if self._texts:
            text = self._texts.popleft()
            self._letters -= len(text)
            if len(self._texts) < _FEW:
                self._room.set()
            await self._socket.send_text(text)
            return
        push, self._push = self._push, None
        if push is not None:
            await self._socket.send_bytes(push())
